r"""Error model of a planned calibration by turns: transitions of the navigation errors, and response to parameters.

A unit that stays in its place and is turned there navigates; its velocity is known to be zero, once a second. The
stretches are those of the filter (`navigate.error_growth.transitions`); readings and their derivatives come from the
forward model at the schedule's own motion, as means over each interval. During a stop only the attitude matters, so one
interval a second is enough.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gimbalcal.earth import normal_gravity
from gimbalcal.effects import Parameter
from gimbalcal.errors import InputError
from gimbalcal.estimate.systematic.error_model import STATE_SCALE, velocity_variance
from gimbalcal.estimate.systematic.filter_pass import POSITION_SIGMA_M, VELOCITY_STATES
from gimbalcal.estimate.systematic.state_lists import states
from gimbalcal.forward import linearise
from gimbalcal.inference.information import Information, information
from gimbalcal.inference.innovations import Innovations, innovations
from gimbalcal.navigate.error_growth import transitions
from gimbalcal.number import Array
from gimbalcal.platform import BENCH
from gimbalcal.recording import Recording, Site
from gimbalcal.recording.kinds import ROTATION
from gimbalcal.schedule import RotationSchedule
from gimbalcal.schedule.trajectory import Trajectory, trajectory
from gimbalcal.simulate.turned import nodes, stimulus
from gimbalcal.units import to_si
from gimbalcal.views.segments import CHANNELS, UPDATE_INTERVAL_S

TURN_INTERVAL_RATE_HZ = 20.0
INITIAL_ATTITUDE_SIGMA_RAD = np.deg2rad(1.0)
UNKNOWN_VELOCITY_M_S = 1e3  # one sigma, of a unit in the hand while it is turned
BATCH_INTERVALS = 4000  # whose derivatives are held at once


@dataclass(frozen=True)
class TurningNoise:
    """White noise of force [m/s^2/sqrt(Hz)] and rate [rad/sqrt(s)], and sigma of the place's velocity [m/s].

    velocity_in_turns: the same while the unit turns, if it differs.
    """

    force: float
    rate: float
    velocity: float = 1e-5
    velocity_in_turns: float | None = None


@dataclass(frozen=True, eq=False)
class StretchModel:
    """K stretches that end at `time` (K,) [s]: Phi (K, 9, 9), Psi (K, 9, p) per prior sigma, Q (K, 9, 9), scaled."""

    time: Array
    Phi: Array
    Psi: Array
    Q: Array

    def innovations(self, noise: TurningNoise, moving: NDArray[np.bool_] | None = None) -> Innovations:
        """Return the information of the velocity about the parameters, in units of their prior sigmas.

        moving (K,): stretches in which the unit turns, where the velocity is known differently there.
        """
        velocity = np.full(len(self.time), noise.velocity)
        if moving is not None and noise.velocity_in_turns is not None:
            velocity[moving] = noise.velocity_in_turns
        R = velocity_variance(velocity)
        start = np.repeat([INITIAL_ATTITUDE_SIGMA_RAD, noise.velocity, POSITION_SIGMA_M], 3) / STATE_SCALE
        return innovations(self.Phi, self.Psi, self.Q, VELOCITY_STATES, R, start)


@dataclass(frozen=True, eq=False)
class TurningExperiment:
    """A unit to be turned in its place, the parameters that are estimated, and the noise.

    recording: a rotation recording without rows, which holds the place and the channels that are logged.
    """

    recording: Recording
    wanted: tuple[Parameter, ...]
    noise: TurningNoise

    def stretches(
        self, path: Trajectory, update: float = UPDATE_INTERVAL_S, readings: tuple[Array, Array] | None = None
    ) -> StretchModel:
        """Return the error model of a motion, the velocity known every `update` [s].

        readings: `mean_readings` of its intervals, where they are known.
        """
        ends = np.append(np.arange(update, path.duration - 1e-6, update), path.duration)
        starts = np.concatenate([[0.0], ends[:-1]])
        pieces = np.maximum(np.ceil((ends - starts) * TURN_INTERVAL_RATE_HZ - 1e-9), 1)
        count = np.where(path.moving(starts, ends), pieces, 1).astype(int)
        first = np.concatenate([[0], np.cumsum(count)])
        dt = np.repeat((ends - starts) / count, count)
        inside = np.arange(first[-1]) - np.repeat(first[:-1], count) + 1
        mean, D = readings or self.mean_readings(path, np.repeat(starts, count) + inside * dt, dt)
        q = np.repeat(np.square([self.noise.force, self.noise.rate]), 3) / dt[:, None]
        site = self.recording.site
        assert site.latitude is not None  # `turning_experiment` sets it
        growth = transitions(
            first, np.ones(len(dt), dtype=bool), dt, mean[:, 3:], mean[:, :3], D, q, path.at(starts)[0],
            site.latitude, site.height, site.gravity,
        )  # fmt: skip
        scale = STATE_SCALE[:, None]
        return StretchModel(ends, growth.Phi * STATE_SCALE / scale, growth.Psi / scale, growth.Q / STATE_SCALE / scale)

    def information(self, schedule: RotationSchedule) -> Information:
        """Return the information of a schedule about the parameters, the velocity known every second."""
        rows = self._rows(schedule) / np.array([p.sigma for p in self.wanted])
        return information(rows, np.zeros(len(rows)), self.wanted)

    def sigma(self, schedule: RotationSchedule) -> Array:
        """Return the Cramer-Rao sigmas (p,) of a schedule in prior sigmas, the velocity known every second."""
        return cramer_rao_sigmas(self._rows(schedule))

    def _rows(self, schedule: RotationSchedule) -> Array:
        rows = self.stretches(trajectory(schedule)).innovations(self.noise).rows
        return rows.reshape(-1, len(self.wanted))

    def mean_readings(self, path: Trajectory, end: Array, dt: Array) -> tuple[Array, Array]:
        """Return mean force and rate (n, 6) over intervals, and their derivatives (n, 6, p) per prior sigma."""
        scale = np.array([p.sigma for p in self.wanted])
        means, derivatives = [], []
        for i in range(0, len(end), BATCH_INTERVALS):
            at = nodes(path, end[i : i + BATCH_INTERVALS], dt[i : i + BATCH_INTERVALS], False)
            n = len(at.time)
            zero = {key: np.zeros(n) for key in self.recording.channels}
            s = stimulus(path, replace(self.recording, channels=zero, time=at.time, weight=np.ones(n)), at.time)
            s = s.at(time=at.time)
            means.append(at.means(np.hstack([s.force, s.rate])))
            J = linearise(BENCH, s, (), ROTATION.name, CHANNELS).jacobian(self.wanted)
            derivatives.append(at.means(J) * scale)
        return np.concatenate(means), np.concatenate(derivatives)


def cramer_rao_sigmas(rows: Array) -> Array:
    """Return the sigmas (p,) in prior sigmas of whitened, prior-scaled rows (m, p) and the prior."""
    return np.sqrt(np.diag(np.linalg.inv(np.eye(rows.shape[1]) + rows.T @ rows)))


def turning_experiment(
    latitude: float, state_list: str, rate_noise: float = 0.002, force_noise: float = 5.0, velocity: float = 1e-5
) -> TurningExperiment:
    """Return the experiment at `latitude` [deg] on the states `state_list` (`state_lists.states`).

    rate_noise [deg/sqrt(h)], force_noise [ug/sqrt(Hz)], velocity [m/s]: one sigma of that of the place. Raises
    InputError for a pole, and for states that do not exist.
    """
    if not abs(latitude) < 90:
        raise InputError(f"--latitude must be between -90 and 90 deg, got {latitude:g}")
    recording = rotation_at_place(np.deg2rad(latitude))
    noise = TurningNoise(to_si(force_noise, "ug/sqrt(Hz)"), to_si(rate_noise, "deg/sqrt(h)"), velocity)
    return TurningExperiment(recording, states(state_list, recording.why_not_shown), noise)


def rotation_at_place(latitude: float, height: float = 0.0) -> Recording:
    """Return a rotation recording without rows, of a place at `latitude` [rad] and `height` [m]."""
    site = Site(latitude, height, float(normal_gravity(latitude, height)))
    channels = {key: np.zeros(0) for key in CHANNELS}
    return Recording(ROTATION, "the schedule", BENCH, site, {}, np.zeros(0), None, channels)
