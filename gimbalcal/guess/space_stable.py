r"""A log of a platform that its gyroscopes held still among the stars while the Earth turned below.

Gravity then goes round once in a sidereal day in platform axes,

.. math:: f(t) = c_0 + c_1 \cos \Omega t + c_2 \sin \Omega t ,

and no other rig moves so (Wu et al. 2018, Eq. (4)).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gimbalcal.earth import EARTH_RATE
from gimbalcal.errors import InputError
from gimbalcal.guess.column_names import by_turn
from gimbalcal.guess.log import Log
from gimbalcal.number import Array
from gimbalcal.recording.record import FORCE
from gimbalcal.units import to_si

MIN_TURN = 0.05  # rad that the Earth has to turn, eleven minutes
MIN_ROWS = 50
MAX_STEP = 0.02  # of gravity, from row to row
MAX_RESIDUAL = 1e-3  # of gravity
AXES = ("platform", "middle", "outer")
MAX_ATTITUDE_ERROR = np.radians(1.0)  # of a navigator


def turns_with_the_stars(time: Array, force: Sequence[Array]) -> bool:
    """Return whether forces (n,) along three axes go round as gravity does on such a platform; time (n,) s."""
    whole = np.flatnonzero(np.all([np.isfinite(x) for x in (time, *force)], axis=0))
    rows = whole[:: max(1, len(whole) // 2000)]
    t, f = time[rows], np.stack([x[rows] for x in force], axis=-1)
    angle = EARTH_RATE * (t - t[:1])
    if len(t) < MIN_ROWS or angle[-1] < MIN_TURN:
        return False
    gravity = float(np.median(np.linalg.norm(f, axis=1)))
    design = np.stack([np.ones_like(t), np.cos(angle), np.sin(angle)], axis=-1)
    c, *_ = np.linalg.lstsq(design, f, rcond=None)
    scatter = float(np.median(np.abs(np.diff(f, axis=0)))) / 0.95 if len(f) > 2 else 0.0  # of one sample
    residual = np.sqrt(np.mean((f - design @ c) ** 2))
    moved = float(np.linalg.norm(np.ptp(design @ c, axis=0)))
    return bool(
        scatter < MAX_STEP * gravity
        and moved > 0.3 * np.sin(min(angle[-1], 1.0)) * gravity
        and residual < MAX_RESIDUAL * gravity + 2 * scatter
    )


def static_run(log: Log, latitude: float | None) -> tuple[Log, str] | None:
    """Return the log as a static run, and why it is one; None where it is none.

    Raises InputError where it is one and the latitude [deg] is not given.
    """
    force = log.values(FORCE)
    if len(force) != 3 or not turns_with_the_stars(log.seconds, force):
        return None
    if latitude is None:
        raise InputError(
            "the force goes round once in a sidereal day: a space-stable platform that was left alone, a static run; "
            "what it shows depends on the place, so give --latitude DEG and --height M"
        )
    guesses = {n: log.guesses[n] for n in log.guesses if n in log.names("time", FORCE, "temperature")}
    guesses |= {n: log.guesses[n] for n in log.names("gimbal_angle") if log.guesses[n].axis in AXES}
    for name, x in log.unknown.items():
        turn = by_turn(name)
        if (
            turn
            and turn.axis in ("roll", "pitch", "yaw")
            and np.nanmax(np.abs(to_si(x, turn.unit))) < MAX_ATTITUDE_ERROR
        ):
            guesses[name] = replace(turn, quantity="attitude_error")
    return replace(log, guesses=guesses), "static-run, for the force goes round once in a sidereal day"
