r"""The linear error model of each stretch, from one update to the next, about a reference that starts there at rest.

The reference of stretch k starts from the attitude C_k, not moving; where it ends, less where the next one starts, is a
known defect d_k of the model,

.. math:: x_{k+1} = \Phi_k x_k + \Psi_k \, \delta\theta + d_k + w_k .

Coloured noise that `[noise]` of a recording states is more states. A chain of a process (`effects.process`) adds its
value x to the readings of one channel: over a stretch its mean, :math:`\tfrac{1}{2} (1 + \Phi) x`, as a constant
addition to the reading, and at the end it moves on, :math:`x \to \Phi(h_k) x + w_k, \; w_k \sim N(0, Q(h_k))`.

Force and rate u behind the readings y = h(u, theta), both triads in one vector, and their sensitivity D to each
parameter are those of the inverted sensor model,

.. math:: u = h^{-1}(y, \theta), \qquad D = \frac{\partial u}{\partial \theta}
          = -\left(\frac{\partial h}{\partial u}\right)^{-1} \frac{\partial h}{\partial \theta}

so that the coupling of any effect into the filter is its own contribution, and a state is added by its name alone.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from gimbalcal.earth import rate_at
from gimbalcal.effects import Effect, Parameter
from gimbalcal.effects.effect import Stimulus
from gimbalcal.forward import linearise, predict, wanted_channels
from gimbalcal.inference.square_root_filter import roots
from gimbalcal.kinematics import stimulus_from_truth
from gimbalcal.navigate.error_growth import NAV, transitions
from gimbalcal.navigate.strapdown import integrated_attitudes
from gimbalcal.number import Array, complex_step
from gimbalcal.platform import BENCH
from gimbalcal.recording import Recording
from gimbalcal.recording.noise_levels import header_coloured_noise
from gimbalcal.rotation import cross_matrix, exponential, rotation_vector
from gimbalcal.views.segments import CHANNELS, Segments

MAX_ITERATIONS, CONVERGED_RESIDUAL = 40, 1e-13  # each multiplies the residual by the sensors' errors, 5 % at most
DIVERGENCE_RATIO = 10.0  # to the smallest residual
KIND = "rotation"


def invert_readings(segments: Segments, effects: Sequence[Effect], start: Array | None = None) -> Array:
    """Return force and rate (n, 6) behind the mean readings, by iteration from `start` (default: the readings).

    Where the iteration diverges (a latency of more than a step), the nearest iterate is returned.
    """
    y = segments.readings
    u = y if start is None else start
    s = stimulus_from_truth(segments.rows, u[:, :3], u[:, 3:])
    size = np.abs(y).max(axis=0)
    nearest, best = np.inf, u
    for _ in range(MAX_ITERATIONS):
        step = _read(s, effects, u)
        np.subtract(y, step, out=step)
        residual = float((np.abs(step).max(axis=0) / np.where(size > 0, size, 1.0)).max())
        if not residual < DIVERGENCE_RATIO * nearest:
            return best
        nearest, best = min((nearest, best), (residual, u), key=lambda each: each[0])
        u = u + step
        if residual <= CONVERGED_RESIDUAL:
            break
    return u


def sensitivity(
    recording: Recording, effects: Sequence[Effect], wanted: Sequence[Parameter], u: Array, rows: slice
) -> Array:
    """Return D (m, 6, p) of some rows of a recording of means, about the effects and the motion u (g, 6)."""
    few = slice(max(rows.start - 1, 0), rows.stop + 1)  # slopes look at the neighbours
    s = stimulus_from_truth(recording.select(few), u[few, :3], u[few, 3:])
    s = s.at(time=recording.time[few] - recording.time[0], rate_slope=s.turning_faster())
    J = linearise(BENCH, s, effects, KIND, CHANNELS).jacobian(wanted)
    if any(np.any(np.asarray(v) != 0) for e in effects for v in vars(e).values()):
        # matrices near 1: a product with their inverses takes a third of the time of `solve`, with 51 columns each
        J = np.linalg.inv(complex_step(lambda x: _read(s, effects, x), u[few])) @ J
    return -J[rows.start - few.start : rows.stop - few.start]


def reading_jacobian(s: Stimulus, effects: Sequence[Effect]) -> Array:
    """Return the derivative (n, 6, 6) of the readings by force and rate, for a stimulus."""
    return complex_step(lambda x: _read(s, effects, x), np.concatenate([s.force, s.rate], axis=1))


def _read(s: Stimulus, effects: Sequence[Effect], u: Array) -> Array:
    # all six readings by force and rate, where latencies and lever arms couple rows and triads: no stage of `Rows`
    s = s.at(force=u[:, :3], rate=u[:, 3:])
    return wanted_channels(BENCH, predict(BENCH, s, effects, KIND), CHANNELS)


BATCH_INTERVALS = 20_000  # intervals at a time: what a column of them takes stays below 50 MB
STATE_SCALE = np.repeat([1e-3, 1e-3, 1e-3], 3)  # rad, m/s, m: scale of the navigation states
SHORTEST_PERIOD_S = 2.0  # flicker of shorter periods is below the white noise of any instrument
PAUSE_ATTITUDE_SIGMA_RAD = np.radians(0.5 / 3600)  # of the attitude over a pause of the clock in a stop


class ErrorModel(NamedTuple):
    """The error model of K stretches in units of `STATE_SCALE` and of the prior sigmas.

    Phi (K, m, m), Psi (K, m, p), root (K, m, m) of Q and defects d (K, m) of the nine navigation states and the chains
    of coloured noise.
    """

    Phi: Array
    Psi: Array
    root: Array
    d: Array


def error_model(
    segments: Segments, wanted: Sequence[Parameter], effects: Sequence[Effect], u: Array, C: Array
) -> ErrorModel:
    """Return the error model about the effects, the motion u (n, 6) and the attitudes C (K + 1, 3, 3).

    The attitude at the start is carried as three more constants, the last ones, so that its final covariance is known.
    """
    scale, p = np.array([p.sigma for p in wanted]), len(wanted) + 3
    expected, processes = expected_readings(segments, u, C), bias_processes(segments)
    per_reading = 6 if len(processes) else 0  # a unit added to each reading, which the chains need

    def response(groups: slice) -> Array:
        D = np.zeros((groups.stop - groups.start, 6, p + per_reading))
        if wanted:
            D[:, :, : len(wanted)] = sensitivity(segments.groups, effects, wanted, expected, groups) * scale
        D[:, :, p:] = -np.eye(6)[:, :per_reading]
        return D

    Phi, Psi, Q, d = stretch_model(segments, u, C, response, p + per_reading)
    Phi, Psi, Q, d = append_chains(Phi, Psi[:, :, :p], Q, d, Psi[:, :, p:], processes)
    return ErrorModel(Phi, Psi, roots(Q), d)


def reference_defects(segments: Segments, u: Array, C: Array, frozen: ErrorModel) -> Array:
    """Return where each stretch's reference ends, less where the next one starts (K, m), in units of `STATE_SCALE`."""
    d = np.zeros_like(frozen.d)
    d[:, :NAV] = stretch_model(segments, u, C, lambda groups: np.zeros((groups.stop - groups.start, 6, 0)), 0)[3]
    return d


def expected_readings(segments: Segments, u: Array, C: Array) -> Array:
    """Return noiseless force and rate (g, 6) of each group of intervals, in its place with attitudes C at the updates.

    With sensitivities at noisy readings a scale factor would explain the noise, as on an axis that has not been loaded
    yet nothing else determines it. While turning, the measured rates are used.
    """
    begin = np.flatnonzero(np.diff(segments.group, prepend=-1))
    still = np.array([[0.0, 0.0, -segments.rows.site.gravity], rate_at(segments.latitude)])
    force, rate = _in_body(segments, u, C, still)
    at_rest = (segments.stop >= 0)[np.repeat(np.arange(len(segments.stop)), np.diff(segments.first))]
    expected = np.concatenate([force, np.where(at_rest[:, None], rate, u[:, 3:])], axis=1)
    return np.add.reduceat(expected, begin) / np.diff(begin, append=len(u))[:, None]


def stretch_model(
    segments: Segments, u: Array, C: Array, response: Callable[[slice], Array], p: int
) -> tuple[Array, Array, Array, Array]:
    """Return Phi, Psi (K, 9, p), Q and defects d of the navigation states, in units of `STATE_SCALE`.

    response: of force and rate to the p constants, D (g, 6, p) of a slice of groups of intervals. Without constants
    the defects alone are wanted, and Q stays zero.
    """
    K = len(segments.stop)
    Phi, Psi, Q = np.empty((K, NAV, NAV)), np.empty((K, NAV, p)), np.empty((K, NAV, NAV))
    d = np.empty((K, NAV))
    site = segments.rows.site
    q = segments.sigma**2 / segments.rows.weight[:, None]
    q[:, :3] += _sculling_error(segments, u)[:, None] ** 2
    at = 0
    while at < K:
        end = int(np.searchsorted(segments.first, segments.first[at] + BATCH_INTERVALS, side="right")) - 1
        end = min(max(end, at + 1), K)
        rows = slice(int(segments.first[at]), int(segments.first[end]))
        before = max(rows.start - 1, 0)  # coning looks at the interval before
        few = slice(before, rows.stop)
        groups = slice(int(segments.group[before]), int(segments.group[rows.stop - 1]) + 1)
        motion = transitions(
            segments.first[at : end + 1] - before, segments.joined[few], segments.dt[few], u[few, 3:], u[few, :3],
            response(groups), q[few if p else slice(0)], C[at:end], segments.latitude,
            site.height, site.gravity, segments.group[few] - groups.start,
        )  # fmt: skip
        # attitude to velocity and place by what gravity did: noise would seem to show the heading
        F = motion.Phi.copy()
        F[:, 3:6, :3] += cross_matrix(motion.velocity)
        F[:, 6:, :3] += cross_matrix(motion.displacement)
        Phi[at:end], Q[at:end] = F * STATE_SCALE / STATE_SCALE[:, None], motion.Q / STATE_SCALE / STATE_SCALE[:, None]
        Psi[at:end] = motion.Psi / STATE_SCALE[:, None]
        d[at:end, :3] = rotation_vector(motion.C_bn @ np.swapaxes(C[at + 1 : end + 1], -1, -2))
        d[at:end, 3:6], d[at:end, 6:] = motion.velocity, motion.displacement
        at = end
    for k in np.flatnonzero(segments.pauses):
        Phi[k, 3:6, 3:6] = 0.0
        Q[k, :3, :3] = (PAUSE_ATTITUDE_SIGMA_RAD / STATE_SCALE[0]) ** 2 * np.eye(3)
        Q[k, 3:6, 3:6] = np.diag(velocity_variance(segments.velocity[k]))
    return Phi, Psi, Q, d / STATE_SCALE


def velocity_variance(velocity: Array) -> Array:
    """Return the variances (..., 3) of velocities measured with sigmas (...) [m/s], in squares of `STATE_SCALE`."""
    return (np.asarray(velocity)[..., None] / STATE_SCALE[3:6]) ** 2


def _sculling_error(segments: Segments, u: Array) -> Array:
    """Return the error of the mean force (n,) [m/s^2] of an interval, in the axes of its beginning, at rate changes.

    Sculling takes the rate to be linear over two intervals. Where its slope changes within one, by the second
    difference b of its means, the tilt that rotates the force is off by b dt / 24 to b dt / 12, on the mean.
    """
    bend = np.zeros(len(u))
    bend[1:-1] = np.linalg.norm(np.diff(u[:, 3:], 2, axis=0), axis=1)
    bend = np.maximum(bend, np.maximum(np.roll(bend, 1), 0.0))  # the interval after it goes by the same slope
    turning = (segments.stop < 0)[np.repeat(np.arange(len(segments.stop)), np.diff(segments.first))]
    return np.where(turning, segments.rows.site.gravity * bend * segments.dt / 12, 0.0)


def _in_body(segments: Segments, u: Array, C: Array, v: Array) -> Array:
    """Return vectors v (m, 3), in north, east, down, in the axes of the unit in mid-interval (m, n, 3)."""
    stretch = np.repeat(np.arange(len(segments.stop)), np.diff(segments.first))
    turn = integrated_attitudes(segments.dt, u[:, 3:])
    start = C[:-1] @ np.swapaxes(turn[segments.first[:-1]], -1, -2)
    turn[:-1] += turn[1:]
    turn *= 0.5
    return np.stack([np.einsum("ni,nij->nj", (x @ start)[stretch], turn[:-1]) for x in v])


def rotated(C: Array, phi: Array) -> Array:
    """Return exp([phi x]) C for attitudes C (K, 3, 3) and errors phi (K, 3) [rad]."""
    return np.asarray(exponential(-phi) @ C)


@dataclass(frozen=True, eq=False)
class BiasProcesses:
    """c chains in SI that follow the navigation states.

    channel (c,): the reading that each adds to; Phi, Q (K, c) over each stretch; P_0 (c,) at the start; scale (c,):
    their size by the end of the recording.
    """

    channel: Array
    Phi: Array
    Q: Array
    P_0: Array
    scale: Array

    def __len__(self) -> int:
        return len(self.channel)


def bias_processes(segments: Segments) -> BiasProcesses:
    """Return the chains of all six channels; none where the header states white noise alone."""
    h = np.diff(segments.time)
    moved = np.zeros(len(h), dtype=bool)
    stated = header_coloured_noise(segments.rows, SHORTEST_PERIOD_S, float(h.sum()))
    parts = [(i, process) for i, (quantity, _) in enumerate(CHANNELS) for process in stated.get(quantity, ())]
    channel = np.concatenate([np.zeros(0, dtype=int), *(np.full(len(p.output()), i) for i, p in parts)])
    H = np.concatenate([np.zeros(0), *(p.output() for _, p in parts)])
    Phi = np.concatenate([np.zeros((len(h), 0)), *(p.transition(h, moved) for _, p in parts)], axis=1)
    Q = np.concatenate([np.zeros((len(h), 0)), *(p.diffusion(h, moved) for _, p in parts)], axis=1) * H**2
    P_0 = np.concatenate([np.zeros(0), *(p.initial() for _, p in parts)]) * H**2
    return BiasProcesses(channel.astype(int), Phi, Q, P_0, np.sqrt(P_0 + Q.sum(axis=0)))


def append_chains(
    Phi: Array, Psi: Array, Q: Array, d: Array, additions: Array, processes: BiasProcesses
) -> tuple[Array, Array, Array, Array]:
    """Append the chains to an error model of m states: Phi (K, m + c, m + c), Psi, Q, d.

    additions (K, m, 6): response of the states to a constant addition to each reading over a stretch.
    """
    K, m, c = len(Phi), Phi.shape[1], len(processes)
    if not c:
        return Phi, Psi, Q, d
    own, none = np.arange(m, m + c), np.zeros((K, c))
    F, N = np.zeros((K, m + c, m + c)), np.zeros((K, m + c, m + c))
    F[:, :m, :m], N[:, :m, :m] = Phi, Q
    F[:, :m, m:] = additions[:, :, processes.channel] * ((1 + processes.Phi) / 2 * processes.scale)[:, None]
    F[:, own, own] = processes.Phi
    N[:, own, own] = processes.Q / processes.scale**2
    return F, np.concatenate([Psi, np.zeros((K, c, Psi.shape[2]))], axis=1), N, np.concatenate([d, none], axis=1)
