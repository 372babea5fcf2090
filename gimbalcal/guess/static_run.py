r"""A log of a platform that was left alone: gyroscopes held it still among the stars while the Earth turned below.

Gravity then goes round once in a sidereal day in platform axes,

.. math:: f(t) = c_0 + c_1 \cos \Omega t + c_2 \sin \Omega t ,

and no other rig moves so (Wu et al. 2018, Eq. (4)).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from gimbalcal.earth import EARTH_RATE
from gimbalcal.errors import InputError
from gimbalcal.guess.column_names import FORCE, Guess, by_turn
from gimbalcal.number import Array
from gimbalcal.units import to_si

LEAST_TURN = 0.05  # rad that the Earth has to turn, eleven minutes
FEWEST, SMOOTH = 50, 0.02  # rows; and of gravity, what it changes by from row to row at most
LEFT = 1e-3  # of gravity that may be left of it
AXES = ("platform", "middle", "outer")
SMALL = np.radians(1.0)  # attitude errors of a navigator


def turns_with_the_stars(time: Array, force: Sequence[Array]) -> bool:
    """Whether forces (n,) along three axes go round as gravity does on such a platform; time (n,) s."""
    f = np.stack(force, axis=-1)
    whole = np.isfinite(f).all(axis=1) & np.isfinite(time)
    every = max(1, int(whole.sum()) // 2000)
    t, f = time[whole][::every], f[whole][::every]
    angle = EARTH_RATE * (t - t[:1])
    if len(t) < FEWEST or angle[-1] < LEAST_TURN:
        return False
    gravity = float(np.median(np.linalg.norm(f, axis=1)))
    design = np.stack([np.ones_like(t), np.cos(angle), np.sin(angle)], axis=-1)
    c, *_ = np.linalg.lstsq(design, f, rcond=None)
    scatter = float(np.median(np.abs(np.diff(f, axis=0)))) / 0.95 if len(f) > 2 else 0.0  # of one sample
    left = np.sqrt(np.mean((f - design @ c) ** 2))
    moved = float(np.linalg.norm(np.ptp(design @ c, axis=0)))
    return bool(
        scatter < SMOOTH * gravity
        and moved > 0.3 * np.sin(min(angle[-1], 1.0)) * gravity
        and left < LEFT * gravity + 2 * scatter
    )


def as_static_run(columns: Mapping[str, Array], guesses: Mapping[str, Guess], latitude: float | None
                  ) -> tuple[dict[str, Guess], str] | None:  # fmt: skip
    """The columns of a static run and why it is one; None where it is none.

    Raises InputError where it is one and nobody says the latitude.
    """
    clock, unit = next((n, g.unit) for n, g in guesses.items() if g.quantity == "time")
    force = [columns[n] for n, g in guesses.items() if g.quantity == FORCE]
    if len(force) != 3 or not turns_with_the_stars(np.asarray(to_si(columns[clock], unit)), force):
        return None
    gimbals = {n: g for n, g in guesses.items() if g.quantity == "gimbal_angle"}
    if latitude is None:
        raise InputError(
            "the force goes round once in a sidereal day: a space-stable platform that was left alone, a static run; "
            "what it tells hangs on the place, so give --latitude DEG and --height M"
        )
    out = {n: g for n, g in guesses.items() if g.quantity in ("time", FORCE, "temperature")}
    out |= {n: g for n, g in gimbals.items() if g.axis in AXES}
    for name in columns:
        turn = by_turn(name) if name not in guesses else None
        if (
            turn
            and turn.axis in ("roll", "pitch", "yaw")
            and np.nanmax(np.abs(to_si(columns[name], turn.unit))) < SMALL
        ):
            out[name] = replace(turn, quantity="attitude_error")
    return out, "static-run, for the force goes round once in a sidereal day"
