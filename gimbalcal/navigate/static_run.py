"""Navigation of a static run, with or without a calibration.

The base is at rest, so whatever the navigator computes is error: latitude, longitude, velocity, roll, pitch and yaw,
*navigator minus true*, against a level base that points north. It starts at the known place with the platform turned as
its gimbal reads in the first minutes, receives its height and zero velocity (`Aids`), and computes the attitude from
its vertical, the pole and the gimbal readouts. A calibration first corrects the readings.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from gimbalcal.calibration import Calibration
from gimbalcal.earth import EARTH_RATE, radii
from gimbalcal.errors import InputError
from gimbalcal.forward import navigator_attitude_error
from gimbalcal.kinematics import (
    EQUATORIAL,
    mean_shortening,
    refuse_other_platform,
    required_latitude,
    with_phase_of_force,
)
from gimbalcal.navigate.navigation_errors import CHANNELS, Navigated
from gimbalcal.navigate.space_stable_navigator import (
    Aids,
    InertialSite,
    NavigatorOutput,
    navigate,
    small_error_response,
)
from gimbalcal.number import Array, apply_matrix
from gimbalcal.recording import Recording
from gimbalcal.recording.record import ANGLE, FORCE
from gimbalcal.rotation import frame_rotation

MAX_STEP_S = 10.0  # longer rows and gaps are filled in, as nothing but the Earth turns


def platform_navigated(recording: Recording, calibration: Calibration | None, aids: Aids, label: str) -> Navigated:
    """Return the errors of the navigation of a static run, whose readings a calibration corrects if there is one."""
    refuse(recording)
    run = with_inner(recording)
    run = run if calibration is None else calibration.apply(run)
    g = _navigator_input(run, aids)
    c = navigate(g.time, g.force, g.site, aids)
    own = [x[g.own] for x in (c.time, c.latitude, c.phase, c.height, c.velocity)]
    error = _errors(run, g.site, NavigatorOutput(*own))
    return Navigated(label, run.time - run.time[0], error, horizontal_distance(error, g.site))


def half_difference(pairs: Sequence[tuple[Recording, Recording]], aids: Aids) -> Array:
    """Return half of the difference of the errors (n, 7, p) of each pair of runs of a base at rest, for small errors.

    The differences of all pairs are navigated at once: `space_stable_navigator.small_error_response`.
    """
    refuse(pairs[0][0])
    given = [(_navigator_input(plus, aids), _navigator_input(minus, aids)) for plus, minus in pairs]
    half = np.array([np.angle(np.exp(1j * (a.site.phase - b.site.phase))) / 2 for a, b in given])
    force = np.stack([(a.force - b.force) / 2 for a, b in given], axis=-1)
    one = given[0][0]
    d = small_error_response(one.time, force, half, one.site, aids)

    def moved(k: int, way: int) -> Array:
        site = replace(one.site, phase=given[k][0].site.phase - half[k])
        L, S, v = (way * each[one.own, ..., k] for each in (d.latitude, d.phase, d.velocity))
        t = one.time[one.own]
        output = NavigatorOutput(t, site.latitude + L, site.phase + EARTH_RATE * t + S, site.height + 0 * t, v)
        return _errors(pairs[k][(1 - way) // 2], replace(site, phase=site.phase + way * half[k]), output)

    return np.stack([(moved(k, 1) - moved(k, -1)) / 2 for k in range(len(pairs))], axis=-1)


def _errors(run: Recording, site: InertialSite, output: NavigatorOutput) -> Array:
    """Return the errors (n, 7) at the rows of a run; without readouts of all gimbals the attitude is nan."""
    error = np.full((len(run.time), len(CHANNELS)), np.nan)
    error[:, 0] = output.latitude - site.latitude
    error[:, 1] = output.phase - site.phase - EARTH_RATE * (run.time - run.time[0])
    error[:, 2:4] = output.velocity
    if set(run.platform.axis_names) <= set(run.axes(ANGLE)):
        error[:, 4:] = -navigator_attitude_error(run.platform, output.up, run.angles())
    return error


def horizontal_distance(error: Array, site: InertialSite) -> Array:
    """Return the distance (n,) [m] of the computed position from the true one."""
    M, N = radii(site.latitude)
    north, east = (M + site.height) * error[:, 0], (N + site.height) * np.cos(site.latitude) * error[:, 1]
    return np.asarray(np.hypot(north, east))


def refuse(recording: Recording) -> None:
    """Raise InputError for anything but a static run of a space-stable platform with its force and a latitude."""
    refuse_other_platform(recording)
    if abs(required_latitude(recording.site.latitude)) > np.deg2rad(89):
        raise InputError(f"{recording.title!r} is at a pole, where longitude is undefined")
    if recording.counted(FORCE):
        raise InputError(f"{recording.title!r} reads its force in counts: apply its calibration first")
    recording.triad(FORCE)
    if len(recording.time) < 3:
        raise InputError(f"{recording.title!r} has {len(recording.time)} rows, too few to navigate")


class _NavigatorInput(NamedTuple):
    """Input of a navigator: site, time (m,), force (m, 3), and the indices (n,) of the run's own rows."""

    site: InertialSite
    time: Array
    force: Array
    own: Array


def _navigator_input(run: Recording, aids: Aids) -> _NavigatorInput:
    force = run.triad(FORCE) * (1 + mean_shortening(run)[:, None] * EQUATORIAL)  # means have lost some of a turn
    return _NavigatorInput(_site(run, aids.alignment), *_without_long_steps(run.time - run.time[0], force))


def with_inner(recording: Recording) -> Recording:
    """Add the inner gimbal, whose readout is servoed to zero, so that its zero error can be corrected too."""
    if "inner" not in recording.platform.axis_names or not recording.has(ANGLE):
        return recording
    inner = {(ANGLE, "inner"): np.zeros(len(recording.time))}
    return replace(recording, channels=inner | dict(recording.channels))


def _site(run: Recording, alignment: float) -> InertialSite:
    """Return the true site, with the platform's angle at the first row from its gimbal in the first minutes."""
    phased = run if (ANGLE, "platform") in run.channels else with_phase_of_force(run)
    t = run.time - run.time[0]
    first = t <= alignment
    turned = phased.channels[ANGLE, "platform"][first] - EARTH_RATE * t[first]
    phase = float(np.angle(np.mean(np.exp(1j * turned))))
    return InertialSite(required_latitude(run.site.latitude), run.site.height, run.site.gravity, phase)


def _without_long_steps(time: Array, force: Array) -> tuple[Array, Array, Array]:
    """Return time and force (m, 3) without steps longer than `MAX_STEP_S`, and the indices (n,) of the given rows.

    Between rows the force is interpolated in axes that turn with the Earth, in which it hardly changes.
    """
    gap = np.diff(time)
    usual = min(float(np.median(gap)), MAX_STEP_S)
    pieces = np.maximum(np.ceil(gap / usual - 0.5).astype(int), 1)
    if np.all(pieces == 1):
        return time, force, np.arange(len(time))
    own = np.concatenate([[0], np.cumsum(pieces)])
    t = np.interp(np.arange(own[-1] + 1), own, time)
    still = apply_matrix(frame_rotation("z", EARTH_RATE * time), force)
    still = np.stack([np.interp(t, time, column) for column in still.T], axis=-1)
    return t, apply_matrix(frame_rotation("z", -EARTH_RATE * t), still), own
