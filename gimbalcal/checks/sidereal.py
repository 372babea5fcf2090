"""Checks of a static run by the turn of the Earth: clock, units, place, axes of a triad without gimbal readouts."""

from __future__ import annotations

import numpy as np

from gimbalcal.checks.check import STATIC, Check, Examined
from gimbalcal.checks.input_errors import PERMUTATIONS, AxisPermutation, permutation_correction, successful_trials
from gimbalcal.earth import EARTH_RATE
from gimbalcal.number import Array
from gimbalcal.platform import SPACE_STABLE_INERTIAL
from gimbalcal.recording.record import FORCE, Recording
from gimbalcal.rotation import within_half_turn

MAX_LATITUDE_ERROR_RAD = np.radians(5.0)  # above any tilt of a level base and of the polar axis, below a wrong sign
MAX_ATTITUDE_ERROR_RAD = np.radians(10.0)
MAX_RATE_ERROR = 0.2  # of the Earth's; a bias of 50 mg changes it by less
MAX_GIMBAL_RATE_ERROR = 0.05  # of the Earth's
MAX_SHOWN = 3  # corrections that the turn of the Earth does not distinguish, the simplest ones
MIN_TURN_RAD = 0.2  # of the Earth, 46 min; and a latitude this far from the pole
CLOCK_JUMP_RAD = np.radians(0.2)  # of the sidereal angle: 48 s; drift and encoder errors stay below arc minutes
PLATFORM = ("gimbal_angle", "platform")


def duration(e: Examined) -> str:
    """Refuse a run of two rows."""
    t = e.recording.time
    return "" if len(t) >= 3 else (
        f"the static run lasts {np.ptp(t):.6g} s, in which the Earth hardly turns; record hours, or correct the unit "
        "of the time"
    )  # fmt: skip


def rate_of_the_platform_gimbal(e: Examined) -> str:
    """Refuse a platform gimbal that does not follow the Earth: the clock or a unit is wrong."""
    time, angle = e.recording.time, e.recording.channels[PLATFORM]
    dt = np.diff(time)
    short = EARTH_RATE * dt < 1.0
    rate = float(np.median((within_half_turn(np.diff(angle)) / dt)[short])) if short.any() else EARTH_RATE
    off = abs(rate / EARTH_RATE - 1)
    if off < MAX_GIMBAL_RATE_ERROR or off * EARTH_RATE * np.ptp(time) < CLOCK_JUMP_RAD:
        return ""
    return (
        f"the platform gimbal turns by {np.degrees(rate) * 3600:.5g} deg/h where the Earth turns by 15.041 "
        "deg/h; correct the unit of the time or of the platform angle, or its sign"
    )


def jumps_of_the_clock(e: Examined) -> str:
    """Refuse a single readout far off its neighbours, or a clock that jumps."""
    time, angle = e.recording.time, e.recording.channels[PLATFORM]
    dt = np.diff(time)
    lag = within_half_turn(np.diff(angle) - EARTH_RATE * dt)
    k = int(np.argmax(np.abs(lag)))
    if abs(lag[k]) <= CLOCK_JUMP_RAD:
        return ""
    returns = np.flatnonzero(np.abs(within_half_turn(lag[1:] + lag[:-1])) < np.abs(lag[1:]) / 10) + 1
    if row := next((int(i) for i in returns if i in (k, k + 1)), 0):
        return (
            f"at {time[row]:.10g} s alone the platform gimbal reads "
            f"{np.degrees(abs(lag[k])):.4g} deg off its neighbours; leave this row out"
        )
    turned, due = np.degrees([within_half_turn(angle[k + 1] - angle[k]), EARTH_RATE * dt[k]])
    return (
        f"between {time[k]:.10g} s and {time[k + 1]:.10g} s the clock goes on by "
        f"{dt[k]:.6g} s while the platform gimbal turns by {turned:.4g} deg instead of {due:.4g} deg, so "
        "the clock jumps there; correct it, or cut the recording in two"
    )


def attitude_errors(e: Examined) -> str:
    """Refuse attitude errors of many degrees: they are in another unit."""
    r = e.recording
    for axis in r.axes("attitude_error"):
        largest = float(np.max(np.abs(r.channels["attitude_error", axis])))
        if largest > MAX_ATTITUDE_ERROR_RAD:
            return (
                f"the attitude error in {axis} reaches {np.degrees(largest):.3g} deg, read in the "
                f"unit {r.units.get(('attitude_error', axis), 'rad')!r}; correct the unit of its column, for example "
                "to arcsec"
            )
    return ""


def axes_against_the_earth(e: Examined) -> str:
    r"""Refuse axes and signs of a triad that do not follow the turn of the Earth, whose phase is unknown.

    .. math:: f / |f| = (\cos L \cos S_t, \; \cos L \sin S_t, \; \sin L), \qquad \dot S_t = \Omega
    """
    latitude, time = e.rests.site.latitude, e.rests.time
    if latitude is None or not _refuse_inertial(e.rests):
        return ""
    if EARTH_RATE * np.ptp(time) < MIN_TURN_RAD or np.cos(latitude) < np.sin(MIN_TURN_RAD):
        return ""

    def misfit(permutation: AxisPermutation) -> float:
        f = permutation_correction(FORCE, permutation).of(FORCE, e.force)
        phase = np.unwrap(np.arctan2(f[:, 1], f[:, 0]))
        rate_error = abs(float(np.polyfit(time - time[0], phase, 1)[0]) / EARTH_RATE - 1)
        return max(abs(latitude_of(f) - latitude) / MAX_LATITUDE_ERROR_RAD, rate_error / MAX_RATE_ERROR)

    fitting = [
        t.candidate for t in successful_trials(PERMUTATIONS, misfit, sufficient=1.0, most=MAX_SHOWN) if t.misfit <= 1
    ]
    if not fitting or fitting[0] == PERMUTATIONS[0]:
        return ""
    words = ", or ".join(p.in_words(FORCE) for p in fitting)
    handed = "; as stated they make a left-handed triad" if fitting[0].handed < 0 else ""
    return (
        f"the force does not circle the Earth's axis as it does at this latitude, and it does if "
        f"{words}{handed}; correct [columns]: {fitting[0].remedy(FORCE)}"
    )


def latitude_of_the_site(e: Examined) -> str:
    """Refuse a latitude that is not the height at which the force circles the Earth's axis."""
    stated, measured = e.rests.site.latitude, latitude_of(e.force)
    if stated is None or not _refuse_inertial(e.rests) or abs(measured - stated) <= MAX_LATITUDE_ERROR_RAD:
        return ""
    return (
        f"the force lies at {np.degrees(measured):.3g} deg to the Earth's axis, which is the latitude "
        f"of the place, and [site] says {np.degrees(stated):.3g} deg; correct the latitude, its sign or its unit"
    )


def latitude_of(force: Array) -> float:
    """Return the height [rad] of the forces (n, 3) of an inertially stable platform above the Earth's equator."""
    return float(np.median(np.arcsin(np.clip(force[:, 2] / np.linalg.norm(force, axis=1), -1, 1))))


def measured_latitude(recording: Recording) -> float | None:
    """Return the latitude [rad] of an inertially stable platform by its forces; None where these do not show it."""
    complete = all((FORCE, a) in recording.channels for a in "xyz")
    return latitude_of(recording.triad(FORCE)) if _refuse_inertial(recording) and complete else None


def excess_rate_of_platform(r: Recording) -> float:
    """Return the share by which the platform gimbal turns faster than the Earth, daily and half-daily errors aside.

    It is 0 where the gimbal was not read, or for less than half a turn.
    """
    angle, phase = r.channels.get(PLATFORM), EARTH_RATE * r.time
    if angle is None or np.ptp(phase) < np.pi:
        return 0.0
    daily = [f(k * angle) for k in (1, 2) for f in (np.cos, np.sin)]
    design = np.stack([phase, np.ones_like(phase), *daily], axis=1)
    return float(np.linalg.lstsq(design, np.unwrap(angle - phase), rcond=None)[0][0])


def _refuse_inertial(recording: Recording) -> bool:
    stated = recording.site.latitude is not None
    return recording.kind.stabilised and stated and recording.platform == SPACE_STABLE_INERTIAL


RUN_CHECKS = (
    Check(duration, STATIC),
    Check(rate_of_the_platform_gimbal, STATIC, ("gimbal_angle:platform",)),
    Check(jumps_of_the_clock, STATIC, ("gimbal_angle:platform",)),
    Check(attitude_errors, STATIC, ("attitude_error",)),
)
FORCE_CHECKS = (
    Check(axes_against_the_earth, STATIC, (f"physical {FORCE}", "no attitude")),
    Check(latitude_of_the_site, STATIC, (f"physical {FORCE}",)),
)
