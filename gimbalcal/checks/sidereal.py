"""A static run that cannot be right: clock or unit against the turn of the Earth, a wrong place, absurd attitudes."""

from __future__ import annotations

import numpy as np

from gimbalcal.checks.axes import PERMUTATIONS, AxisPermutation, in_words, remedy
from gimbalcal.earth import EARTH_RATE
from gimbalcal.errors import InputError
from gimbalcal.number import Array
from gimbalcal.platform import SPACE_STABLE_INERTIAL
from gimbalcal.recording import Recording

WRONG_PLACE = np.radians(5.0)  # above any tilt of a level base and of the polar axis, below a wrong sign or unit
WRONG_ATTITUDE = np.radians(10.0)
WRONG_RATE = 0.2  # of the Earth's; a bias of 50 mg changes it by less
TOLD = 3  # changes that the turn of the Earth does not tell apart, the simplest ones
LEAST_TURN = 0.2  # rad of the Earth, 46 min; and a latitude this far from the pole
CLOCK_JUMP = np.radians(0.2)  # of the sidereal angle: 48 s; drift and encoder errors stay below arc minutes


def check_turn(recording: Recording) -> None:
    """The platform gimbal of a static run follows the Earth; where it does not, the clock or a unit is wrong."""
    if len(recording.time) < 3:
        raise InputError(
            f"{recording.label}: the static run lasts {np.ptp(recording.time):.6g} s, in which the Earth hardly "
            "turns; record hours, or correct the unit of the time"
        )
    if ("gimbal_angle", "platform") not in recording.channels:
        return
    time, angle = recording.time, recording.channels["gimbal_angle", "platform"]
    dt = np.diff(time)
    lag = _wrapped(np.diff(angle) - EARTH_RATE * dt)
    short = EARTH_RATE * dt < 1.0
    rate = float(np.median((_wrapped(np.diff(angle)) / dt)[short])) if short.any() else EARTH_RATE
    if abs(rate / EARTH_RATE - 1) > 0.05 and abs(rate - EARTH_RATE) * np.ptp(time) > CLOCK_JUMP:
        hour = np.degrees(rate) * 3600
        raise InputError(
            f"{recording.label}: the platform gimbal turns by {hour:.5g} deg/h where the Earth turns by 15.041 "
            "deg/h; correct the unit of the time or of the platform angle, or its sign"
        )
    k = int(np.argmax(np.abs(lag)))
    back = np.flatnonzero(np.abs(_wrapped(lag[1:] + lag[:-1])) < np.abs(lag[1:]) / 10) + 1  # there and back again
    glitch = next((int(i) for i in back if i in (k, k + 1) and abs(lag[k]) > CLOCK_JUMP), 0)
    if glitch:
        raise InputError(
            f"{recording.label}: at {time[glitch]:.10g} s alone the platform gimbal reads "
            f"{np.degrees(abs(lag[k])):.4g} deg off its neighbours; leave this row out"
        )
    if abs(lag[k]) > CLOCK_JUMP:
        turned, due = np.degrees([_wrapped(angle[k + 1] - angle[k]), EARTH_RATE * dt[k]])
        raise InputError(
            f"{recording.label}: between {time[k]:.10g} s and {time[k + 1]:.10g} s the clock goes on by "
            f"{dt[k]:.6g} s while the platform gimbal turns by {turned:.4g} deg instead of {due:.4g} deg, so "
            "the clock jumps there; correct it, or cut the recording in two"
        )


def check_latitude(rests: Recording, force: Array) -> None:
    """The force of an inertially stable platform circles the Earth's axis at the height of the pole, the latitude."""
    if not rests.kind.stabilised or rests.platform != SPACE_STABLE_INERTIAL or rests.site.latitude is None:
        return
    seen = latitude_seen(force)
    if abs(seen - rests.site.latitude) > WRONG_PLACE:
        raise InputError(
            f"{rests.label}: the force lies at {np.degrees(seen):.3g} deg to the Earth's axis, which is the latitude "
            f"of the place, and [site] says {np.degrees(rests.site.latitude):.3g} deg; correct the latitude, its sign "
            "or its unit"
        )


def latitude_seen(force: Array) -> float:
    """Height [rad] of the forces (n, 3) of an inertially stable platform above the Earth's equator."""
    return float(np.median(np.arcsin(np.clip(force[:, 2] / np.linalg.norm(force, axis=1), -1, 1))))


def check_sidereal(rests: Recording, force: Array) -> None:
    r"""Axes and signs of a triad whose gimbals were not read, against the turn of the Earth; the phase is not known.

    .. math:: f / |f| = (\cos L \cos S_t, \; \cos L \sin S_t, \; \sin L), \qquad \dot S_t = \Omega
    """
    latitude = rests.site.latitude
    if not rests.kind.stabilised or rests.platform != SPACE_STABLE_INERTIAL or latitude is None:
        return
    if EARTH_RATE * np.ptp(rests.time) < LEAST_TURN or np.cos(latitude) < np.sin(LEAST_TURN):
        return

    def fits(change: AxisPermutation) -> bool:
        f = force @ change.matrix.T
        phase = np.unwrap(np.arctan2(f[:, 1], f[:, 0]))
        rate = float(np.polyfit(rests.time - rests.time[0], phase, 1)[0])
        return abs(latitude_seen(f) - latitude) < WRONG_PLACE and abs(rate / EARTH_RATE - 1) < WRONG_RATE

    found = [c for c in PERMUTATIONS if fits(c)]
    if found and found[0] != PERMUTATIONS[0]:
        words = ", or ".join(in_words(c, "accelerometer") for c in found[:TOLD])
        handed = "; as stated they make a left-handed triad" if found[0].handed < 0 else ""
        raise InputError(
            f"{rests.label}: the force does not circle the Earth's axis as it does at this latitude, and it does if "
            f"{words}{handed}; correct [columns]: {remedy(found[0], 'accelerometer')}"
        )


def check_attitude(recording: Recording) -> None:
    """A navigator that is off by many degrees is not navigating: its errors are in another unit."""
    for axis in recording.axes("attitude_error"):
        largest = float(np.max(np.abs(recording.channels["attitude_error", axis])))
        if largest > WRONG_ATTITUDE:
            unit = recording.units.get(("attitude_error", axis), "rad")
            raise InputError(
                f"{recording.label}: the attitude error in {axis} reaches {np.degrees(largest):.3g} deg, read in the "
                f"unit {unit!r}; correct the unit of its column, for example to arcsec"
            )


def _wrapped(angle: Array) -> Array:
    return np.asarray(angle - 2 * np.pi * np.round(angle / (2 * np.pi)))
