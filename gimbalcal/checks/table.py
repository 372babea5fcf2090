"""The table of checks that a recording passes before it is calibrated, in the order in which they are made.

They look for wrong units, axes, signs and clocks, which a calibration would absorb: each area of checks (forces, rates,
a static run, a unit turned in its place, stars) has its rows, a `Check` each, and `examine` makes those that apply.
"""

from __future__ import annotations

from gimbalcal.checks import covariates, driven_rates, forces, rates, sidereal, sightings, turned_unit
from gimbalcal.checks.check import Check, Examined, examine
from gimbalcal.recording.completed import with_rests
from gimbalcal.recording.record import FORCE, RATE, Recording

CHECKS: tuple[Check, ...] = (
    *sightings.CHECKS,
    *sidereal.RUN_CHECKS,
    *turned_unit.CHECKS,
    *forces.CHECKS,
    *sidereal.FORCE_CHECKS,
    *rates.CHECKS,
)
NOT_CHECKED = (
    "order and signs of the accelerometers were not checked: it takes gimbal angles and physical units, or gyroscopes "
    "that were logged from rest to rest"
)


def refuse_implausible(recording: Recording) -> tuple[str, ...]:
    """Raise `InputError` with one sentence where units, axes, signs or the clock of a recording cannot be right.

    Return a sentence on each triad that nothing in the recording could check, and on what is odd and may be so.
    """
    odd = examine(recording, covariates.CHECKS)
    if driven_rates.CHECKS[0].applies(Examined(recording)):
        return (*odd, *examine(recording, driven_rates.CHECKS))
    if recording.kind.rotating and recording.has(RATE):
        recording = with_rests(recording)
    remarks = examine(recording, CHECKS)
    unknown = _forces_unchecked(recording, not set(remarks) & {rates.NOT_CHECKED, rates.STATIC_NOT_CHECKED})
    return (NOT_CHECKED, *odd, *remarks) if unknown else (*odd, *remarks)


def _forces_unchecked(recording: Recording, rates_checked: bool) -> bool:
    """Return whether nothing shows order and signs of accelerometers that were at rest."""
    examined = Examined(recording)
    if not recording.kind.at_rest or not examined.has(FORCE):
        return False
    known = examined.has(f"physical {FORCE}") and (examined.attitude_known or recording.kind.stabilised)
    by_rates = recording.kind.in_positions and recording.has(RATE) and rates_checked
    return not (known or by_rates)
