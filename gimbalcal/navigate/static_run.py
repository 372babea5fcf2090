"""A static run navigated: what a still base seems to do, without a calibration and with each of several.

The base stands still, so whatever the navigator says is error: latitude, longitude, velocity, roll, pitch and yaw,
*navigator minus true*, against a level base that points north. It starts at the known place with the platform turned as
its gimbal reads in the first minutes, is told the height and that it does not move (`Aids`), and makes the attitude
from its computed vertical, the pole and the gimbal readouts. A calibration first turns the readings into those of
perfect sensors on a perfect mount.
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
    refuse_other_platform,
    required_latitude,
    shortening,
    with_phase_of_force,
)
from gimbalcal.navigate.navigation_errors import CHANNELS, Navigated
from gimbalcal.navigate.space_stable import Aids, Course, Site, deviation, navigate
from gimbalcal.number import Array, apply_matrix
from gimbalcal.recording import Recording
from gimbalcal.recording.record import ANGLE, FORCE
from gimbalcal.rotation import frame_rotation

STEP = 10.0  # s, the longest step; longer rows and gaps are filled in, as nothing but the Earth turns


def platform_navigated(recording: Recording, calibration: Calibration | None, aids: Aids, label: str) -> Navigated:
    """Errors of the navigation of a static run, corrected by a calibration first where there is one."""
    refuse(recording)
    run = with_inner(recording)
    run = run if calibration is None else calibration.apply(run)
    site, course = course_of(run, aids)
    error = _errors(run, site, course)
    return Navigated(label, run.time - run.time[0], error, horizontal(error, site))


def half_apart(pairs: Sequence[tuple[Recording, Recording]], aids: Aids) -> Array:
    """Half of what the errors (n, 7, p) of each two runs differ by that are a still base's but for small errors.

    What is navigated is their difference, of all pairs at once: `space_stable.deviation`.
    """
    refuse(pairs[0][0])
    given = [(_given(plus, aids), _given(minus, aids)) for plus, minus in pairs]
    half = np.array([np.angle(np.exp(1j * (a.site.phase - b.site.phase))) / 2 for a, b in given])
    force = np.stack([(a.force - b.force) / 2 for a, b in given], axis=-1)
    one = given[0][0]
    d = deviation(one.time, force, half, one.site, aids)

    def moved(k: int, way: int) -> Array:
        site = replace(one.site, phase=given[k][0].site.phase - half[k])
        L, S, v = (way * each[one.own, ..., k] for each in (d.latitude, d.phase, d.velocity))
        t = one.time[one.own]
        course = Course(t, site.latitude + L, site.phase + EARTH_RATE * t + S, site.height + 0 * t, v)
        return _errors(pairs[k][(1 - way) // 2], replace(site, phase=site.phase + way * half[k]), course)

    return np.stack([(moved(k, 1) - moved(k, -1)) / 2 for k in range(len(pairs))], axis=-1)


def _errors(run: Recording, site: Site, course: Course) -> Array:
    """What is off (n, 7) at the rows of a run; without readouts of all gimbals its attitude is not a number."""
    error = np.full((len(run.time), len(CHANNELS)), np.nan)
    error[:, 0] = course.latitude - site.latitude
    error[:, 1] = course.phase - site.phase - EARTH_RATE * (run.time - run.time[0])
    error[:, 2:4] = course.velocity
    if set(run.platform.axis_names) <= set(run.axes(ANGLE)):
        error[:, 4:] = -navigator_attitude_error(run.platform, course.up, run.angles())
    return error


def horizontal(error: Array, site: Site) -> Array:
    """Distance (n,) [m] of the computed place from the true one."""
    M, N = radii(site.latitude)
    north, east = (M + site.height) * error[:, 0], (N + site.height) * np.cos(site.latitude) * error[:, 1]
    return np.asarray(np.hypot(north, east))


def refuse(recording: Recording) -> None:
    """Raise InputError for anything but a static run of a space-stable platform with its force and a latitude."""
    refuse_other_platform(recording)
    if abs(required_latitude(recording.site.latitude)) > np.deg2rad(89):
        raise InputError(f"{recording.title!r} stands at a pole, where there is no longitude")
    if recording.counted(FORCE):
        raise InputError(f"{recording.title!r} reads its force in counts: apply its calibration first")
    recording.triad(FORCE)
    if len(recording.time) < 3:
        raise InputError(f"{recording.title!r} has {len(recording.time)} rows, too few to navigate")


def course_of(run: Recording, aids: Aids) -> tuple[Site, Course]:
    """What the navigator says at the rows of a run, and where it truly stands."""
    g = _given(run, aids)
    c = navigate(g.time, g.force, g.site, aids)
    return g.site, Course(c.time[g.own], c.latitude[g.own], c.phase[g.own], c.height[g.own], c.velocity[g.own])


class _Given(NamedTuple):
    """What a navigator is given: where it stands, time (m,), force (m, 3); which of these rows (n,) are the run's."""

    site: Site
    time: Array
    force: Array
    own: Array


def _given(run: Recording, aids: Aids) -> _Given:
    force = run.triad(FORCE) * (1 + shortening(run)[:, None] * EQUATORIAL)  # means have lost some of a turn
    return _Given(_site(run, aids.alignment), *_filled(run.time - run.time[0], force))


def with_inner(recording: Recording) -> Recording:
    """The recording with the inner gimbal, whose readout is servoed to zero, so that its zero can be taken off too."""
    if "inner" not in recording.platform.axis_names or not recording.has(ANGLE):
        return recording
    inner = {(ANGLE, "inner"): np.zeros(len(recording.time))}
    return replace(recording, channels=inner | dict(recording.channels))


def _site(run: Recording, alignment: float) -> Site:
    """The true place, and how the platform is turned at the first row by what its gimbal reads in the first minutes."""
    phased = run if (ANGLE, "platform") in run.channels else with_phase_of_force(run)
    t = run.time - run.time[0]
    first = t <= alignment
    turned = phased.channels[ANGLE, "platform"][first] - EARTH_RATE * t[first]
    phase = float(np.angle(np.mean(np.exp(1j * turned))))
    return Site(required_latitude(run.site.latitude), run.site.height, run.site.gravity, phase)


def _filled(time: Array, force: Array) -> tuple[Array, Array, Array]:
    """Time, force (m, 3) without steps longer than `STEP`, and which of these rows (n,) are those that were given.

    Between rows the force is a straight line in axes that turn with the Earth, in which it hardly moves.
    """
    gap = np.diff(time)
    usual = min(float(np.median(gap)), STEP)
    pieces = np.maximum(np.ceil(gap / usual - 0.5).astype(int), 1)
    if np.all(pieces == 1):
        return time, force, np.arange(len(time))
    own = np.concatenate([[0], np.cumsum(pieces)])
    t = np.interp(np.arange(own[-1] + 1), own, time)
    still = apply_matrix(frame_rotation("z", EARTH_RATE * time), force)
    still = np.stack([np.interp(t, time, column) for column in still.T], axis=-1)
    return t, apply_matrix(frame_rotation("z", -EARTH_RATE * t), still), own
