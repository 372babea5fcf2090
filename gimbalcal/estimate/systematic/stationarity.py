"""Check that a unit stayed in its place, from the velocity that its forces would give it before any calibration."""

from __future__ import annotations

import numpy as np

from gimbalcal.errors import InputError
from gimbalcal.number import Array
from gimbalcal.views.segments import Segments

MIN_DRIFT_RATIO = 10.0  # to the median over turns: errors of the sensors are alike in all of them
MIN_SPEED_M_S, MIN_DISTANCE_M = 0.2, 0.5  # less than this is a lever arm, or a hand


def refuse_carried(segments: Segments, drift: Array) -> None:
    """Raise InputError for a turn with a velocity that no other has; drift (K, 3) [m/s]: velocity gained per stretch.

    A unit that is carried speeds up and slows down again; the part of its velocity that persists is a tilt.
    """
    turning = segments.stop < 0
    if not turning.any():
        return
    usual = float(np.median(np.linalg.norm(drift[turning], axis=1)))
    for leg in np.split(np.arange(len(turning)), np.flatnonzero(np.diff(segments.stop)) + 1):
        if not turning[leg[0]] or leg[0] == 0 or leg[-1] == len(turning) - 1:
            continue
        most = float(np.linalg.norm(drift[leg], axis=1).max())
        t = segments.time[[leg[0], leg[-1] + 1]]
        length = np.diff(segments.time)[leg][:, None]
        v = np.cumsum(drift[leg], axis=0)
        v -= v[-1] * np.cumsum(length, axis=0) / length.sum()
        speed, distance = (float(np.linalg.norm(x, axis=-1).max()) for x in (v, np.cumsum(v * length, axis=0)))
        if most > MIN_DRIFT_RATIO * usual and speed > MIN_SPEED_M_S and distance > MIN_DISTANCE_M:
            raise InputError(
                f"{segments.rows.label}: between {t[0]:.6g} and {t[1]:.6g} s the unit was carried away: its "
                f"accelerometers tell of {speed:.2g} m/s and {distance:.2g} m, which no other turn has; systematic "
                "calibration is for a unit that stays in its place, so cut the recording there and give the longer part"
            )
