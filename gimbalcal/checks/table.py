"""The table of checks that a recording passes before it is calibrated, in the order in which they are made.

They look for wrong units, axes, signs and clocks, which a calibration would absorb: each area of checks (covariates,
stars, a static run, a unit turned in its place, forces, rates) has its rows, a `Check` each, and `make_checks` makes
those that apply.
"""

from __future__ import annotations

from gimbalcal.checks import covariates, driven_rates, forces, rates, sidereal, sightings, turned_unit
from gimbalcal.checks.check import POSITIONS, STATIC, Check, Examined, make_checks
from gimbalcal.recording.detection import with_rests
from gimbalcal.recording.record import FORCE, RATE, Recording

FORCES_NOT_CHECKED = (
    "order and signs of the accelerometers were not checked: it takes gimbal angles and physical units, or gyroscopes "
    "that were logged from rest to rest"
)


def forces_not_checked(e: Examined) -> str:
    """Remark that nothing shows order and signs of accelerometers that were at rest."""
    known = e.has(f"physical {FORCE}") and (e.attitude_known or e.kind.stabilised)
    by_rates = e.kind.in_positions and e.has(RATE) and not rates.rates_not_checked(e)
    return "" if known or by_rates else FORCES_NOT_CHECKED


CHECKS: tuple[Check, ...] = (
    *covariates.CHECKS,
    *sightings.CHECKS,
    *sidereal.RUN_CHECKS,
    *turned_unit.CHECKS,
    *forces.CHECKS,
    *sidereal.FORCE_CHECKS,
    *driven_rates.CHECKS,
    *rates.CHECKS,
    Check(forces_not_checked, (*POSITIONS, *STATIC), (FORCE,), question=True),
)


def refuse_implausible(recording: Recording) -> tuple[str, ...]:
    """Raise `InputError` with one sentence where units, axes, signs or the clock of a recording cannot be right.

    Return a sentence on each triad that nothing in the recording could check, and on what is odd and may be so.
    """
    if recording.kind.rotating and recording.has(RATE) and recording.has(FORCE):
        recording = with_rests(recording)
    return make_checks(Examined(recording), CHECKS)
