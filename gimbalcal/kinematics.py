r"""From a recording to what its hardware experienced: the `Stimulus` that every effect reads.

A stimulus is the truth as far as it is known, and three functions say how far that is:

* `stimulus_from_angles`: the gimbals, or the Earth's turn in a static run, tell the force; no sensor is asked;
* `stimulus_from_truth`: the caller knows force and rate (a simulator, a calibrated reading, a unit at rest);
* `stimulus_from_readings`: what the sensors read stands in where nothing else tells.

Ideal here means of a perfect platform, on a level base that points north in a static run:

.. math:: f^p = -g \, C_b^p(\text{readout}) \, (0, 0, 1)^T \quad \text{or} \quad
          f^p = g \, (\cos S_t \cos L, \; \sin S_t \cos L, \; \sin L)^T .
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gimbalcal.earth import EARTH_RATE
from gimbalcal.effects import Stimulus
from gimbalcal.errors import InputError
from gimbalcal.number import Array, apply_matrix, cos, sin
from gimbalcal.recording import Recording, dwells

DOWN = np.array([0.0, 0.0, 1.0])
EQUATORIAL = np.array([1.0, 1.0, 0.0])  # the part of an inertially fixed platform's force that turns with the Earth


def stimulus_from_angles(recording: Recording) -> Stimulus:
    """Return the stimulus according to the gimbals, or to the Earth's turn in a static run; nothing is turning.

    Raises InputError for a unit without gimbals.
    """
    force = ideal_force(recording, recording.angles())
    return stimulus_from_truth(recording, force, np.zeros_like(force))


def stimulus_from_readings(recording: Recording) -> Stimulus:
    """Return the stimulus of a recording, with readings in place of the truth where no gimbal determines it.

    These are the force of a unit without gimbals and the rate wherever gyroscopes were logged. An effect evaluated
    there is off by the product of itself and the error of the reading; `correction` iterates that away.
    """
    force = ideal_force(recording, recording.angles()) if recording.platform.axes else recording.triad("specific_force")
    rate = recording.triad("angular_rate") if recording.has("angular_rate") else np.zeros_like(force)
    return stimulus_from_truth(recording, force, rate)


def stimulus_from_truth(recording: Recording, force: Array, rate: Array) -> Stimulus:
    """Return the stimulus where force (n, 3) [m/s^2] and angular rate (n, 3) [rad/s] are known.

    Of the recording only time, gimbal readouts, positions and environment are used.
    """
    n = recording.time.shape[0]
    readout = recording.angles()
    position = recording.position if recording.position is not None else np.ones(n, dtype=int)
    visit, since = np.zeros(n, dtype=int), np.asarray(recording.time - recording.time[0], dtype=float)
    visits = dwells(recording) if recording.position is not None else ()
    for i, d in enumerate(visits):
        visit[d.start :] = i
        since[d.start :] = recording.time[d.start :] - recording.time[d.start]
    starts = [d.start for d in visits] or [0]  # a unit that is never at rest has none
    attitudes = recording.platform.attitudes(readout)
    return Stimulus(
        time=recording.elapsed,
        running=recording.time - recording.time[0] if recording.restarts else None,
        readout=readout,
        angle=readout,
        force=force,
        gravity=recording.site.gravity,
        visit=visit,
        position=position,
        since_move=since,
        move_force=_last_move(force, starts, visit, 1),
        move_angle=_last_move(readout, starts, visit, 1),
        earlier_move_force=_last_move(force, starts, visit, 2),
        rate=rate,
        axis_names=recording.platform.axis_names,
        latitude=recording.site.latitude,
        true_angle=_true_angle(recording),
        temperature=recording.channels.get(("temperature", "")),
        covariates={axis: v for (quantity, axis), v in recording.channels.items() if quantity == "covariate"},
        axis_directions=tuple(axis.direction for axis in recording.platform.axes),
        sense=recording.platform.sense,
        attitude=_ideal_attitude(recording, readout, attitudes),
        duration=recording.duration,
        load=np.stack([apply_matrix(C, DOWN) for C in attitudes], axis=1) if attitudes else np.zeros((n, 0, 3)),
    )


def _ideal_attitude(recording: Recording, readout: Array, attitudes: Sequence[Array]) -> Array | None:
    """Return C_np (n, 3, 3) of a perfect platform on a level base to the north; None for a unit without gimbals.

    attitudes: of each of its axes by the readouts.
    """
    if not recording.platform.axes:
        return None
    if recording.kind.stabilised:
        return navigation_to_platform(sidereal_phase(recording, readout), required_latitude(recording.site.latitude))
    return attitudes[0]


def ideal_force(recording: Recording, readout: Array) -> Array:
    """Return the specific force in platform axes (n, 3) [m/s^2] of a perfect platform, from readouts or from the
    Earth's turn.

    Raises InputError for a unit without gimbals, whose force no angle tells.
    """
    if not recording.platform.axes:
        raise InputError(
            f"{recording.title!r} was recorded on {recording.platform.name!r}, which has no gimbals, so no angle tells "
            "the force; name the platform it stood on, with its readouts"
        )
    if recording.kind.stabilised:
        phase = sidereal_phase(recording, readout)
        return recording.site.gravity * _inertial_direction(phase, required_latitude(recording.site.latitude))
    return -recording.site.gravity * apply_matrix(recording.platform.attitude(readout), DOWN)


def _true_angle(recording: Recording) -> Array | None:
    if not recording.has("true_angle"):
        return None
    angles = {axis: recording.channels["true_angle", axis] for axis in recording.axes("true_angle")}
    return recording.platform.angles(angles, recording.time.shape)


def lost_to_averaging(recording: Recording, force: Array) -> Array:
    """Return what means over blocks lose of the ideal force (n, 3) of a static run, whose equatorial part turns."""
    return mean_shortening(recording)[:, None] * force * EQUATORIAL


def mean_shortening(recording: Recording) -> Array:
    r"""Return 1 - kappa (n,) of rows that are means of m samples at intervals h; zero for single samples.

    .. math:: \overline{\cos S_t} = \kappa \cos S_t(\bar t), \qquad
              \kappa = \frac{\sin(m \Omega h / 2)}{m \sin(\Omega h / 2)}

    8e-7 for a minute: five sigma of a day's scale factors.
    """
    m, time = recording.weight, recording.time
    h = 2 * np.diff(time) / (m[1:] + m[:-1])
    half = EARTH_RATE * float(np.median(h)) / 2 if len(h) else 0.0
    kappa = np.sin(m * half) / (m * np.sin(half)) if half else np.ones_like(m)
    return np.asarray(1 - kappa)


def sidereal_phase(recording: Recording, readout: Array) -> Array:
    """Return S_t (n,) [rad]: Earth rate x time, plus the circular mean of the platform gimbal's readout less that."""
    refuse_other_platform(recording)
    turned = EARTH_RATE * (recording.time - recording.time[0])
    offset = readout[:, recording.platform.axis_names.index("platform")] - turned
    return np.asarray(turned + np.angle(np.mean(np.exp(1j * offset))))


def refuse_other_platform(recording: Recording) -> None:
    """Raise InputError for a static run of anything but a platform that stays at rest in inertial space."""
    if "platform" not in recording.platform.axis_names:
        raise InputError(
            f"{recording.title!r} is a static run of {recording.platform.name!r}, and only a space-stable platform, "
            "whose gimbal `platform` turns with the Earth, stays at rest in inertial space; give another kind"
        )


def with_phase_of_force(recording: Recording) -> Recording:
    """Return the recording with a platform gimbal made from the direction of the force in the equatorial plane."""
    f = recording.triad("specific_force")
    return recording.with_channels({("gimbal_angle", "platform"): np.arctan2(f[:, 1], f[:, 0])})


def _last_move(x: Array, starts: Sequence[int], visit: Array, lag: int) -> Array:
    """Return the change of x over the slew `lag` slews before each row; zero before that many slews happened."""
    step = np.diff(x[list(starts)], axis=0, prepend=x[:1])
    before = np.concatenate([np.zeros_like(step[: lag - 1]), step])[: len(step)]
    return np.asarray(before[visit])


def required_latitude(latitude: float | None) -> float:
    """Return the latitude [rad] of the site. Raises InputError where the recording does not give it."""
    if latitude is None:
        raise InputError("a static run needs `latitude` in [site] of recording.toml: the Earth turns below it")
    return latitude


def _inertial_direction(phase: Array, latitude: float) -> Array:
    """Return unit specific force of an inertially fixed platform (n, 3): Wu et al. (2018), Eq. (19)."""
    along = np.cos(latitude) * np.ones_like(phase)
    return np.stack([cos(phase) * along, sin(phase) * along, np.sin(latitude) * np.ones_like(phase)], axis=-1)


def navigation_to_platform(phase: Array, latitude: float) -> Array:
    """Return C_np (n, 3, 3) of a perfect inertially fixed platform: Wu et al. (2018), Eq. (18)."""
    st, ct, sL, cL = sin(phase), cos(phase), np.sin(latitude), np.cos(latitude)
    one = np.ones_like(phase)
    rows = [[-ct * sL, -st, -ct * cL], [-st * sL, ct, -st * cL], [cL * one, 0 * one, -sL * one]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
