"""Accelerometers in another unit, all or some of them: at rest the norm of the force is gravity."""

from __future__ import annotations

import numpy as np

from gimbalcal.checks.axes import AXES
from gimbalcal.errors import InputError
from gimbalcal.number import Array
from gimbalcal.recording.record import Recording
from gimbalcal.units import to_si

FORCE_UNITS = {unit: to_si(1.0, unit) for unit in ("m/s^2", "g", "mg", "ug", "ft/s^2", "Gal")}
FAR_OFF, NORM_SHARE = 0.3, 0.25  # of gravity, rms: no low-cost unit is; and what another unit has to leave of it
GONE = 0.1  # of gravity: accelerometers that read less, all of them, had gravity taken off
ALIKE = 0.8, 1.25  # ratios that are one, give or take what a unit can be off


def check_magnitude(rests: Recording, force: Array, step: float = 0.0) -> None:
    """At rest the norm of the force (n, 3) is gravity, give or take the errors of the sensors.

    step [s]: that of a recording in which every sample was logged, and may have been an increment.
    """
    ratio = float(np.median(np.linalg.norm(force, axis=1))) / rests.site.gravity
    if 0.5 <= ratio <= 1.5:
        return
    unit = rests.units.get(("specific_force", "x"), "m/s^2")
    factor = FORCE_UNITS.get(unit, 1.0)
    likely = [name for name, size in FORCE_UNITS.items() if ALIKE[0] < ratio * size / factor < ALIKE[1]]
    remedy = f'the numbers look like {likely[0]}: write unit = "{likely[0]}"' if likely else "correct the unit"
    remedy += " of its columns"
    if step and not likely and ALIKE[0] < ratio / factor / step < ALIKE[1]:
        remedy = (
            f"the numbers look like what each step of {step:.3g} s adds to the velocity: write quantity = "
            '"velocity_increment", unit = "m/s"'
        )
    elif not likely and ratio < GONE:
        remedy = (
            "gravity was taken off (a telephone's linear acceleration: log the accelerometers themselves), or these "
            'are increments: write quantity = "velocity_increment", unit = "m/s"'
        )
    raise InputError(
        f"{rests.label}: at rest the specific force is {ratio * rests.site.gravity:.4g} m/s^2 where gravity is "
        f"{rests.site.gravity:.4g} m/s^2, read in the unit {unit!r}; {remedy}"
    )


def check_each_norm(rests: Recording, force: Array) -> None:
    """One accelerometer alone, or two, in another unit: with it the norm is gravity at every rest."""
    g, best = rests.site.gravity, (FAR_OFF, "", "")
    stated = float(np.sqrt(np.mean((np.linalg.norm(force, axis=1) / g - 1) ** 2)))
    if stated < FAR_OFF or len(force) < 3:
        return
    for few in (f for f in np.ndindex(2, 2, 2) if 0 < sum(f) < 3):
        for unit, size in FORCE_UNITS.items():
            axes = [a for a, wrong in zip(AXES, few, strict=True) if wrong]
            told = rests.units.get(("specific_force", axes[0]), "m/s^2")
            factor = np.where(few, size / FORCE_UNITS.get(told, 1.0), 1.0)
            off = float(np.sqrt(np.mean((np.linalg.norm(factor * force, axis=1) / g - 1) ** 2)))
            best = min(best, (off / NORM_SHARE, " and ".join(axes), unit))
    if best[1] and best[0] < stated:
        raise InputError(
            f"{rests.label}: at rest the norm of the force differs from gravity by {100 * stated:.3g} % rms, and by "
            f"{100 * NORM_SHARE * best[0]:.2g} % if accelerometer {best[1]} alone were in {best[2]}; write unit = "
            f'"{best[2]}" for it in [columns]'
        )
