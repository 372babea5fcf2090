"""Whether a unit stayed in its place: what its forces do to its velocity, before anything is calibrated."""

from __future__ import annotations

import numpy as np

from gimbalcal.errors import InputError
from gimbalcal.estimate.systematic.course import Course
from gimbalcal.number import Array
from gimbalcal.recording.plausible_run import named

UNLIKE = 10.0  # times what other turns do in a second: errors of the sensors are alike in all of them
FAST, FAR = 0.2, 0.5  # m/s and m; less than this is a lever arm, or a hand


def refuse_carried(course: Course, drift: Array) -> None:
    """Raise InputError where a turn goes with a velocity that no other has: drift (K, 3) [m/s] gained per stretch.

    A unit that is carried speeds up and slows down again; the part of its velocity that goes on is a tilt.
    """
    turning = course.stop < 0
    if not turning.any():
        return
    usual = float(np.median(np.linalg.norm(drift[turning], axis=1)))
    for leg in np.split(np.arange(len(turning)), np.flatnonzero(np.diff(course.stop)) + 1):
        if not turning[leg[0]] or leg[0] == 0 or leg[-1] == len(turning) - 1:
            continue
        most = float(np.linalg.norm(drift[leg], axis=1).max())
        t = course.time[[leg[0], leg[-1] + 1]]
        length = np.diff(course.time)[leg][:, None]
        v = np.cumsum(drift[leg], axis=0)
        v -= v[-1] * np.cumsum(length, axis=0) / length.sum()
        speed, way = (float(np.linalg.norm(x, axis=-1).max()) for x in (v, np.cumsum(v * length, axis=0)))
        if most > UNLIKE * usual and speed > FAST and way > FAR:
            raise InputError(
                f"{named(course.rows)}: between {t[0]:.6g} and {t[1]:.6g} s the unit was carried away: its "
                f"accelerometers tell of {speed:.2g} m/s and {way:.2g} m, which no other turn has; systematic "
                "calibration is for a unit that stays in its place, so cut the recording there and give the longer part"
            )
