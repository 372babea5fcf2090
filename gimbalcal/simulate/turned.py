r"""What a unit reads while a schedule turns it: exactly, as means over each sampling interval.

Attitude, rate and acceleration are known in closed form at every instant, so a reading

.. math:: \bar y_i = \frac{1}{h} \int_{t_i - h}^{t_i} y(t) \, dt

needs only a quadrature: three points of Gauss between the corners of a ramp, where the acceleration jumps, which is
exact to the sixth order in the angle turned in a step; one point at rest, where nothing changes but the environment.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from gimbalcal.earth import normal_gravity, radii, rate_at
from gimbalcal.effects import Stimulus
from gimbalcal.effects.process import GaussMarkov, sample
from gimbalcal.errors import InputError
from gimbalcal.kinematics import DOWN, required_latitude, stimulus_from_truth
from gimbalcal.number import Array, apply_matrix
from gimbalcal.recording import Recording, Site
from gimbalcal.rotation import exponential
from gimbalcal.schedule import ROTATIONS, Move, RotationSchedule
from gimbalcal.schedule.commands import standing_attitude
from gimbalcal.schedule.drive import Drive
from gimbalcal.schedule.file import read_rotation
from gimbalcal.schedule.trajectory import Motion, Swing, trajectory
from gimbalcal.simulate.scenario import ScheduleSection

QUIVER_PERIOD_S = 0.2  # s
MIN_INTERVAL_S = 1e-9  # s; pieces of an interval are longer
GAUSS_LEGENDRE = np.polynomial.legendre.leggauss(3)


@dataclass(frozen=True, eq=False)
class Nodes:
    """Instants (N,) [s] at which n readings are evaluated, in order; weight (N,) of each, first (n,) node of a row."""

    time: Array
    weight: Array
    first: Array

    def means(self, values: Array) -> Array:
        """Return means over the rows' intervals (n, ...) of what was evaluated at the nodes (N, ...)."""
        weight = self.weight.reshape(-1, *[1] * (values.ndim - 1))
        return np.asarray(np.add.reduceat(weight * values, self.first, axis=0))


def nodes(path: Motion, time: Array, interval: float | Array, instant: bool) -> Nodes:
    """Return where to evaluate the readings of rows that end at `time` (n,) [s], after an interval [s]."""
    n = len(time)
    interval = np.broadcast_to(interval, (n,))
    if instant:
        return Nodes(time, np.ones(n), np.arange(n))
    start = time - interval
    corner = path.corners
    row = np.searchsorted(time, corner)  # the row in whose interval a corner lies
    inside = row < n
    inside[inside] &= corner[inside] > start[row[inside]]
    begin = np.concatenate([start, corner[inside]])
    owner = np.concatenate([np.arange(n), row[inside]])
    order = np.lexsort((begin, owner))
    begin, owner = begin[order], owner[order]
    end = np.where(np.append(owner[1:], n) == owner, np.append(begin[1:], 0.0), time[owner])
    long = end - begin > MIN_INTERVAL_S  # a corner at the end of a row leaves nothing of it, but for rounding
    begin, end, owner = begin[long], end[long], owner[long]
    middle, half = (begin + end) / 2, (end - begin) / 2
    whole = np.bincount(owner, end - begin, n)
    x, w = GAUSS_LEGENDRE
    moving = path.moving(begin, end)
    count = np.where(moving, len(x), 1)
    at = np.cumsum(count) - count
    out = Nodes(
        np.repeat(middle, count), np.repeat(2 * half / whole[owner], count), at[np.searchsorted(owner, np.arange(n))]
    )
    for j, (xj, wj) in enumerate(zip(x, w, strict=True)):
        k = at[moving] + j
        out.time[k] += half[moving] * xj
        out.weight[k] *= wj / 2
    return out


def stimulus(path: Motion, like: Recording, time: Array) -> Stimulus:
    """Return the stimulus at `time` (N,) [s] of the recording's clock; `like` holds the environment there."""
    C_bn, own, slope = path.at(time)
    C_nb = np.swapaxes(C_bn, -1, -2)
    if isinstance(path, Drive):
        force, frame = _driven_force_and_rate(path, like.site.gravity, time)
    else:
        force, frame = -like.site.gravity * DOWN, rate_at(required_latitude(like.site.latitude))
    turning = apply_matrix(C_nb, frame)
    like = replace(like, time=time, weight=np.ones(len(time)))
    s = stimulus_from_truth(like, apply_matrix(C_nb, force), own + turning)
    return s.at(rate_slope=slope - np.cross(own, turning))  # the rate of the frame turns in the axes of the unit


def _driven_force_and_rate(path: Drive, gravity: float, time: Array) -> tuple[Array, Array]:
    """Return force (N, 3) [m/s^2] of a vehicle and the rate (N, 3) [rad/s] of north, east, down along its way."""
    (v, dv), (L, _, h) = path.motion(time), path.place(time).T
    M, N = radii(L)
    earth = rate_at(L)
    over = np.stack([v[:, 1] / (N + h), -v[:, 0] / (M + h), -v[:, 1] * np.tan(L) / (N + h)], axis=-1)
    g = gravity + normal_gravity(L, h) - normal_gravity(path.latitude, path.height)
    return dv + np.cross(2 * earth + over, v) - g[:, None] * DOWN, earth + over


def schedule_of(motion: ScheduleSection) -> RotationSchedule:
    """Return the schedule that a scenario names, points to or holds, with the scenario's own rate, ramp and stop."""
    if motion.name:
        schedule = ROTATIONS[motion.name]
    elif motion.file:
        schedule = read_rotation(motion.file)
    else:
        moves = tuple(Move(m.axis, m.angle, m.rate, m.stop) for m in motion.moves)
        schedule = _moves_to_start(motion.start or {"x": "east", "y": "north", "z": "up"}, moves)
    return replace(
        schedule,
        moves=motion.sweeps * schedule.moves,
        rate=schedule.rate if motion.slew_rate is None else motion.slew_rate,
        ramp=schedule.ramp if motion.ramp is None else motion.ramp,
        stop=schedule.stop if motion.dwell is None else motion.dwell,
    )


def true_trajectory(motion: ScheduleSection, setting: float, rng: np.random.Generator, site: Site) -> Motion:
    """Return the trajectory as it truly is: the start a little off, and each axis set with an error at every stop."""
    tilt = motion.start_sigma * rng.standard_normal(3)
    if motion.drive is not None:
        d = motion.drive
        latitude = required_latitude(site.latitude)
        return Drive(d.speed, d.leg, d.pitch, d.rest, motion.duration, latitude, site.height)
    if motion.swing is not None:
        swings = (motion.swing.heading, motion.swing.pitch, motion.swing.roll)
        size, pace = (
            np.array([0.0 if s is None else getattr(s, n) for s in swings]) for n in ("amplitude", "frequency")
        )
        start = motion.start or {"x": "north", "y": "east", "z": "down"}
        return Swing(size, pace, exponential(-tilt) @ standing_attitude(_moves_to_start(start).start), motion.duration)
    schedule = schedule_of(motion)
    off = dict.fromkeys((m.axis for m in schedule.moves), 0.0)
    error = np.zeros(len(schedule.moves))
    for i, move in enumerate(schedule.moves):  # an axis that is set anew forgets how it was set before
        new = setting * float(rng.standard_normal())
        error[i], off[move.axis] = new - off[move.axis], new
    return trajectory(schedule, tilt, error)


def quivering_force(
    path: Motion, time: Array, step: float, sigma: float, rng: np.random.Generator, states: dict[tuple[str, str], Array]
) -> Array:
    """Return the force (n, 3) [m/s^2] of a place that quivers, velocity one `sigma` [m/s]; block after block.

    Velocities at the ends of rows are `QUIVER_PERIOD_S` long alike, so after a second they are independent. Their
    differences add less to mean forces than the errors of the sensors.
    """
    if not sigma:
        return np.zeros((len(time), 3))
    v = np.empty((len(time) + 1, 3))
    for i, axis in enumerate("xyz"):
        key = ("quiver", axis)
        v[0, i] = states.get(key, np.zeros(1))[0]
        v[1:, i], states[key] = sample(GaussMarkov(sigma, QUIVER_PERIOD_S), rng, time, state=states.get(key))
    C_bn = path.at(time - step / 2)[0]
    return np.asarray(np.einsum("nji,nj->ni", C_bn, np.diff(v, axis=0) / step))


def _moves_to_start(start: Mapping[str, str], moves: tuple[Move, ...] = ()) -> RotationSchedule:
    """Return the moves of a unit whose axes point where the scenario says at the start."""
    try:
        return RotationSchedule("scenario", (start["x"], start["y"], start["z"]), moves)
    except (KeyError, ValueError) as error:
        raise InputError(f"schedule.start: {error}") from None
