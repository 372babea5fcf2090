"""Navigate a recording by the mechanisation of its kind: space-stable platform or strapdown unit."""

from __future__ import annotations

from gimbalcal.calibration import Calibration
from gimbalcal.errors import InputError
from gimbalcal.navigate.navigation_errors import NONE, Navigated
from gimbalcal.navigate.space_stable_navigator import ALONE, USUAL, Aids
from gimbalcal.navigate.static_run import platform_navigated
from gimbalcal.navigate.strapdown_unit import unit_navigated
from gimbalcal.recording import Recording


def navigated(
    recording: Recording, calibration: Calibration | None = None, aids: Aids = USUAL, label: str = NONE
) -> Navigated:
    """Return the errors of a navigation, of readings that a calibration corrects if there is one.

    Raises InputError for what cannot be navigated: positions, a static run of another platform, no latitude, no force
    or, of a strapdown unit, no rates.
    """
    if recording.kind.stabilised:
        return platform_navigated(recording, calibration, aids, label)
    if not recording.kind.rotating:
        raise InputError(
            f"{recording.title!r} is a {recording.kind} recording; a static run of a space-stable platform is "
            'navigated, or a strapdown unit that stays in its place (kind = "rotation", both triads, every sample)'
        )
    return unit_navigated(recording, calibration, aids, label)


def usual(recording: Recording, damping: float | None = None, alignment: float = USUAL.alignment) -> Aids:
    """Return the references of a navigation; by default a platform is damped and a strapdown unit is not."""
    damped = (ALONE if is_strapdown(recording) else USUAL).damping if damping is None else damping
    return Aids(damping=damped, alignment=alignment)


def is_strapdown(recording: Recording) -> bool:
    """Return whether the unit's own gyroscopes carry its attitude."""
    return recording.kind.rotating
