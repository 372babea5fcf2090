r"""How errors grow along a schedule of turns: transitions of the navigation errors, and what each parameter adds.

A unit that stays in its place and is turned there navigates; its velocity is known to be zero, once a second. The
stretches are those of the filter (`navigate.error_growth.transitions`); readings and their derivatives come from the
forward model at the schedule's own motion, as means over each interval. Of a stop one second is like another: nothing
but the attitude counts, so it is computed once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gimbalcal.earth import normal_gravity
from gimbalcal.effects import CATALOGUE, Parameter
from gimbalcal.estimate.systematic.error_model import STATE_SCALE
from gimbalcal.estimate.systematic.filter_pass import POSITION_SIGMA_M, VELOCITY_STATES
from gimbalcal.estimate.systematic.segments import CHANNELS, UPDATE_INTERVAL_S
from gimbalcal.forward import linearise
from gimbalcal.inference.innovations import Innovations, innovations
from gimbalcal.navigate.error_growth import transitions
from gimbalcal.number import Array
from gimbalcal.platform import BENCH
from gimbalcal.recording import Recording, Site
from gimbalcal.recording.kinds import ROTATION
from gimbalcal.schedule.trajectory import Trajectory
from gimbalcal.simulate.turned import nodes, stimulus

TURNING = 20.0  # Hz, intervals of a turn
ATTITUDE = np.deg2rad(1.0)  # one sigma of the attitude at the start
BATCH = 4000  # intervals of which derivatives are held at once


@dataclass(frozen=True)
class Noise:
    """White noise: force [m/s^2/sqrt(Hz)], rate [rad/sqrt(s)], and how still the place is, velocity [m/s]."""

    force: float
    rate: float
    velocity: float = 1e-5


@dataclass(frozen=True, eq=False)
class Stretches:
    """K stretches that end at `time` (K,) [s]: Phi (K, 9, 9), Psi (K, 9, p) per prior sigma, Q (K, 9, 9), scaled."""

    time: Array
    Phi: Array
    Psi: Array
    Q: Array

    def innovations(self, noise: Noise) -> Innovations:
        """What the velocity says about the parameters, in units of their prior sigmas."""
        R = np.full((len(self.time), 3), (noise.velocity / STATE_SCALE[0]) ** 2)
        start = np.repeat([ATTITUDE, noise.velocity, POSITION_SIGMA_M], 3) / STATE_SCALE
        return innovations(self.Phi, self.Psi, self.Q, VELOCITY_STATES, R, np.diag(start**2))


def plan(latitude: float, height: float = 0.0, temperature: float | None = None) -> Recording:
    """A rotation recording without rows, of a place at `latitude` [rad]: what may be logged there."""
    channels = {key: np.zeros(0) for key in CHANNELS}
    if temperature is not None:
        channels["temperature", ""] = np.zeros(0)
    site = Site(latitude, height, float(normal_gravity(latitude, height)))
    return Recording(ROTATION, "the schedule", BENCH, site, {}, np.zeros(0), None, channels)


def stretches(
    path: Trajectory, like: Recording, wanted: Sequence[Parameter], noise: Noise, update: float = UPDATE_INTERVAL_S
) -> Stretches:
    """The stretches of a schedule's motion. `like` says where, and is a recording as the schedule would make one."""
    ends = np.append(np.arange(update, path.duration - 1e-6, update), path.duration)
    starts = np.concatenate([[0.0], ends[:-1]])
    count = np.where(path.moving(starts, ends), np.maximum(np.ceil((ends - starts) * TURNING - 1e-9), 1), 1).astype(int)
    first = np.concatenate([[0], np.cumsum(count)])
    dt = np.repeat((ends - starts) / count, count)
    inside = np.arange(first[-1]) - np.repeat(first[:-1], count) + 1
    end = np.repeat(starts, count) + inside * dt
    mean, D = _readings(path, like, wanted, end, dt)
    q = np.repeat(np.square([noise.force, noise.rate]), 3) / dt[:, None]
    C_bn = path.at(starts)[0]
    made = transitions(
        first, np.ones(len(dt), dtype=bool), dt, mean[:, 3:], mean[:, :3], D, q, C_bn, *_where(like)
    )  # fmt: skip
    return Stretches(
        ends,
        made.Phi * STATE_SCALE / STATE_SCALE[:, None],
        made.Psi / STATE_SCALE[:, None],
        made.Q / STATE_SCALE / STATE_SCALE[:, None],
    )


def _where(like: Recording) -> tuple[float, float, float]:
    assert like.site.latitude is not None  # `plan` sets it
    return like.site.latitude, like.site.height, like.site.gravity


def _readings(
    path: Trajectory, like: Recording, wanted: Sequence[Parameter], end: Array, dt: Array
) -> tuple[Array, Array]:
    """Mean force and rate (n, 6) over intervals, and their derivatives (n, 6, p) per prior sigma."""
    scale = np.array([p.sigma for p in wanted])
    stages = dict.fromkeys(CATALOGUE[p.effect].stage for p in wanted)
    means, derivatives = [], []
    for i in range(0, len(end), BATCH):
        at = nodes(path, end[i : i + BATCH], dt[i : i + BATCH], False)
        zero = {key: np.zeros(len(at.time)) for key in like.channels}
        s = stimulus(path, replace(like, channels=zero, time=at.time, weight=np.ones(len(at.time))), at.time)
        s = s.at(time=at.time)
        means.append(at.means(np.hstack([s.force, s.rate])))
        J = linearise(BENCH, s, (), "rotation", CHANNELS, stages=stages).jacobian(wanted)
        derivatives.append(at.means(J) * scale)
    return np.concatenate(means), np.concatenate(derivatives)
