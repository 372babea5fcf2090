r"""One pass of filter and smoother about a reference that starts anew, at rest and in its place, at each update.

The reference of stretch k starts from the attitude C_k, not moving; where it ends, less where the next one starts, is a
known defect d_k of the linear error model,

.. math:: x_{k+1} = \Phi_k x_k + \Psi_k \, \delta\theta + d_k + w_k, \qquad 0 = v_{k+1} + \text{noise},

so that a run of any length stays linear (multiple shooting): the vertical channel has no time to run away, and the next
pass starts from smoothed attitudes. Passes end where nothing moves: products of two errors are then in the solution.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gimbalcal.calibration.sound import no_number
from gimbalcal.earth import rate_at
from gimbalcal.effects import Effect, Parameter
from gimbalcal.estimate.systematic.alignment import Alignment
from gimbalcal.estimate.systematic.course import Course
from gimbalcal.estimate.systematic.seen import WIDE, informed, inverse
from gimbalcal.estimate.systematic.sensors import sensitivity
from gimbalcal.estimate.systematic.wander import beside, chains
from gimbalcal.inference import adjoint, beside_constants
from gimbalcal.inference.beside_constants import Filtered
from gimbalcal.inference.information import solve
from gimbalcal.navigate.error_growth import NAV, transitions
from gimbalcal.navigate.strapdown import carried
from gimbalcal.number import Array
from gimbalcal.recording.plausible_run import named
from gimbalcal.rotation import cross_matrix, exponential

ROWS = 20_000  # intervals at a time: what a column of them takes stays below 50 MB
STATE = np.repeat([1e-3, 1e-3, 1e-3], 3)  # rad, m/s, m: scale of the navigation states
PLACE = 1e-3  # m, one sigma of the place at the start
UNMOVED = np.radians(0.5 / 3600)  # rad, what the attitude may change while the clock pauses in a stop
VELOCITY = np.arange(3, 6)
JUMP = 1.0  # m/s, what a knock may do to the velocity: the navigator starts anew with it
GATE = 50.0  # normalised innovation squared of three components: by chance once in 1e10 updates


class Linear(NamedTuple):
    """The error model of K stretches in units of `STATE` and of the prior sigmas: Phi (K, m, m), Psi (K, m, p),

    Q (K, m, m) and defects d (K, m) of the nine navigation states and the chains of biases that wander.
    """

    Phi: Array
    Psi: Array
    Q: Array
    d: Array


@dataclass(frozen=True, eq=False)
class Pass:
    """What one pass found about its reference: correction and sigma of the parameters (p,), in SI, and the run.

    held (p,): the correction in which what is not seen keeps its prior mean; all else goes with it. sigma (p,) of it.
    """

    step: Array
    held: Array
    sigma: Array
    factor: Array  # (p, p) lower triangular, of the covariance in units of the parameters' prior sigmas
    attitude: Array  # (3, 3) covariance of the attitude at the start [rad^2]
    drift: Array  # (K, 3) velocity that a reference gains in each stretch, from rest [m/s]
    filtered: Filtered  # without gains and covariances, which the smoother has used, and with the last constants alone
    smoothed: Array  # (K + 1, 3) errors of the attitude [rad]
    about: Linear
    calibrated: Filtered  # of the navigator whose sensors are corrected: its innovations are what evidence goes by


def one_pass(
    course: Course, wanted: Sequence[Parameter], effects: Sequence[Effect], u: Array, C: Array, start: Alignment,
    prior: Array, left_out: NDArray[np.bool_], near: Linear | None = None, known: Array | None = None,
) -> Pass:  # fmt: skip
    """Filter and smooth about the effects, what was there (n, 6) and the attitudes C (K + 1, 3, 3).

    prior (p,): mean of the parameters before, less their present values; left_out (K,): updates that are not believed;
    near: an error model about values so near that only the defects are another's; known (p, p): upper triangular
    factor of what their covariance was before, in prior sigmas (default: nothing was known).
    """
    try:
        about = linear(course, wanted, effects, u, C) if near is None else near._replace(d=defects(course, u, C, near))
    except np.linalg.LinAlgError:  # constants so far away that a reading no longer tells what it was of
        raise no_number(named(course.rows), "what a reading tells of the constants") from None
    Phi, Psi, Q, d = about
    m = Phi.shape[1]
    scale, wander = np.array([p.sigma for p in wanted]), chains(course)
    x = np.concatenate([rotation_vector(start.C_bn @ C[0].T), np.zeros(6)]) / STATE
    x = np.concatenate([x, np.zeros(len(wander))])
    first = np.concatenate([prior / scale, x[:3]])
    S, R = _scatter(course, start.sigma, len(wanted), known), _of_rest(course, len(Phi))
    z = np.where(course.believed[:, None], 0.0, np.full((len(Phi), 3), np.nan))
    loose = _knocked(Q, left_out)
    kept = np.where(left_out[:, None], np.nan, z)
    filtered = beside_constants.filter(Phi, Psi, loose, d, kept, VELOCITY, R, x, first, S, smoothed=3)
    del loose  # of a day 60 MB
    found, own = filtered.theta[-1], filtered.factor[m:, m:]
    if not (np.isfinite(found).all() and np.isfinite(own).all()):
        raise no_number(named(course.rows), "what the filter holds of the constants")
    step, factor = found[:-3] * scale, np.asarray(np.linalg.qr(own[:-3].T, mode="r")).T
    held, one = step, np.linalg.norm(factor, axis=1) * scale
    after = np.zeros(m + len(found))
    if known is None:
        solution = solve(informed(wanted, factor, step - prior, scale))
        held, one = prior + solution.x, solution.sigma
        root = inverse(factor)
        after[m:-3] = root.T @ (root @ ((step - held) / scale))
    smoothed = adjoint.smooth(Phi, Psi, VELOCITY, filtered, after) * STATE[:3]
    gone = np.empty((0, *filtered.gain.shape[1:]))  # what a smoother alone needs is a quarter of a gigabyte of a day
    filtered = filtered._replace(gain=gone, cross=gone, theta=filtered.theta[-1:].copy())
    # the same navigator with its sensors as they were found, nothing left to learn about them
    found = found - own @ (own.T @ after[m:])
    none, S0 = np.zeros((len(Phi), m, 0)), np.diag(_sigma(course, start.sigma))
    calibrated = beside_constants.filter(
        Phi, none, Q, d + Psi @ found, z, VELOCITY, R, x, found[:0], S0, GATE, JUMP / STATE[3], 0
    )
    return Pass(
        step, held, one, factor, own[-3:] @ own[-3:].T * STATE[0] ** 2,
        d[:, 3:6] * STATE[3], filtered, smoothed, about, calibrated,
    )  # fmt: skip


def attitude_covariance(course: Course, last: Pass, left_out: NDArray[np.bool_], constants: Array) -> Array:
    """Covariance (K + 1, 3, 3) [rad^2] of the smoothed attitudes (Cai et al. 2016, Eq. (15)), north, east, down.

    constants (p, p): covariance of the parameters in prior sigmas, what is not seen with its prior; the attitude at the
    start goes with them and has a scatter of its own.
    """
    Phi, Psi, Q, d = last.about
    m, p = Phi.shape[1], len(constants)
    whole = np.asarray(np.linalg.qr(last.filtered.factor[m:, m:].T, mode="r")).T
    values, vectors = np.linalg.eigh(constants)
    root = np.zeros((p + 3, p + 3))
    root[:p, :p] = vectors * np.sqrt(np.maximum(values, 0.0))
    root[p:, :p] = whole[p:, :p] @ inverse(whole[:p, :p]) @ root[:p, :p]
    root[p:, p:] = whole[p:, p:]
    loose = _knocked(Q, left_out)
    S = np.diag(_sigma(course, np.zeros(3)))
    R, z = _of_rest(course, len(Phi)), np.where(np.isnan(last.filtered.innovation), np.nan, 0.0)
    x, none = np.zeros(m), np.zeros((len(Phi), m, 0))
    known = beside_constants.filter(Phi, none, loose, 0 * d, z, VELOCITY, R, x, x[:0], S, smoothed=3)
    before = np.zeros((m, p + 3))
    before[range(3), range(p, p + 3)] = 1.0
    return adjoint.covariance(Phi, Psi, VELOCITY, known, before, root) * STATE[0] ** 2


def for_smoother(course: Course, last: Pass, start: Alignment, left_out: NDArray[np.bool_]) -> Filtered:
    """What a pass that began with no knowledge of the constants lets go of: its gains and covariances, errors zero."""
    Phi, Psi, Q, d = last.about
    S, R = _scatter(course, start.sigma, len(last.step)), _of_rest(course, len(Phi))
    z = np.where(np.isnan(last.filtered.innovation), np.nan, 0.0)
    x, theta = np.zeros(Phi.shape[1]), np.zeros(Psi.shape[2])
    return beside_constants.filter(Phi, Psi, _knocked(Q, left_out), 0 * d, z, VELOCITY, R, x, theta, S, smoothed=3)


def _sigma(course: Course, attitude: Array) -> Array:
    """One sigma (m,) of the moving states at the start in units of the states, that of the attitude (3,) in rad."""
    wander = chains(course)
    before = np.concatenate([attitude, np.full(3, course.velocity), np.full(3, PLACE)]) / STATE
    return np.concatenate([before, np.sqrt(wander.P_0) / wander.scale])


def _scatter(course: Course, attitude: Array, p: int, known: Array | None = None) -> Array:
    """Upper triangular factor of the covariance at the start: moving states, p constants, and the attitude as it was.

    known (p, p): that of the constants (default: nothing is known). The attitude at the start is a constant too.
    """
    sigma = _sigma(course, attitude)
    m = len(sigma)
    S = np.diag(np.concatenate([sigma, np.full(p, WIDE), sigma[:3]]))
    if known is not None:
        S[m:-3, m:-3] = known
    S[range(3), range(3)], S[range(3), range(-3, 0)] = 0.0, sigma[:3]
    return S


def _of_rest(course: Course, K: int) -> Array:
    """Variances (K, 3) of the velocity, which is zero, in units of the states."""
    return np.full((K, 3), course.velocity**2) / STATE[VELOCITY] ** 2


def _knocked(Q: Array, left_out: NDArray[np.bool_]) -> Array:
    """Q with what a knock may do to the velocity where an update is not believed."""
    if not left_out.any():
        return Q
    loose = Q.copy()
    loose[np.ix_(left_out, VELOCITY, VELOCITY)] += (JUMP / STATE[3]) ** 2 * np.eye(3)
    return loose


def linear(course: Course, wanted: Sequence[Parameter], effects: Sequence[Effect], u: Array, C: Array) -> Linear:
    """The error model about the effects, what was there (n, 6) and the attitudes C (K + 1, 3, 3).

    The attitude at the start is a constant too, so that its covariance is known in the end: three more, the last ones.
    """
    scale, p = np.array([p.sigma for p in wanted]), len(wanted) + 3
    expected, wander = felt(course, u, C), chains(course)

    def answer(groups: slice) -> Array:
        D = sensitivity(course.groups, effects, wanted, expected, groups) * scale
        return np.concatenate([D, np.zeros((len(D), 6, 3)), added(len(D), len(wander))], axis=2)

    Phi, Psi, Q, d = answering(course, u, C, answer, p + added(0, len(wander)).shape[2])
    return Linear(*beside(Phi, Psi[:, :, :p], Q, d, Psi[:, :, p:], wander))


def added(n: int, chains: int) -> Array:
    """What a unit added to each of the six readings takes from force and rate (n, 6, 6); nothing asked, (n, 6, 0)."""
    return np.tile(-np.eye(6), (n, 1, 1))[:, :, : 6 if chains else 0]


def defects(course: Course, u: Array, C: Array, near: Linear) -> Array:
    """Where the reference of each stretch ends, less where the next one starts (K, m), in units of `STATE`."""
    d = np.zeros_like(near.d)
    d[:, :NAV] = answering(course, u, C, lambda groups: np.zeros((groups.stop - groups.start, 6, 0)), 0)[3]
    return d


def felt(course: Course, u: Array, C: Array) -> Array:
    """Force and rate (g, 6) of each group of intervals, without the noise of what was read: see `_expected`."""
    begin = np.flatnonzero(np.diff(course.group, prepend=-1))
    return np.add.reduceat(_expected(course, u, C), begin) / np.diff(begin, append=len(u))[:, None]


def answering(
    course: Course, u: Array, C: Array, answer: Callable[[slice], Array], p: int
) -> tuple[Array, Array, Array, Array]:
    """Phi, Psi (K, 9, p), Q and defects d, in units of `STATE`; `answer` gives D (m, 6, p) of a slice of groups."""
    K = len(course.stop)
    Phi, Psi, Q = np.empty((K, NAV, NAV)), np.empty((K, NAV, p)), np.empty((K, NAV, NAV))
    d = np.empty((K, NAV))
    site = course.rows.site
    assert site.latitude is not None
    q = course.sigma**2 / course.rows.weight[:, None]
    q[:, :3] += _unseen(course, u)[:, None] ** 2
    at = 0
    while at < K:
        end = int(np.searchsorted(course.first, course.first[at] + ROWS, side="right")) - 1
        end = min(max(end, at + 1), K)
        rows = slice(int(course.first[at]), int(course.first[end]))
        before = max(rows.start - 1, 0)  # coning looks at the interval before
        few = slice(before, rows.stop)
        groups = slice(int(course.group[before]), int(course.group[rows.stop - 1]) + 1)
        made = transitions(
            course.first[at : end + 1] - before, course.joined[few], course.dt[few], u[few, 3:], u[few, :3],
            answer(groups), q[few], C[at:end], site.latitude,
            site.height, site.gravity, course.group[few] - groups.start,
        )  # fmt: skip
        F = made.Phi.copy()  # attitude to velocity and place by what gravity did: noise would seem to show the heading
        F[:, 3:6, :3] += cross_matrix(made.velocity)
        F[:, 6:, :3] += cross_matrix(made.displacement)
        Phi[at:end], Q[at:end] = F * STATE / STATE[:, None], made.Q / STATE / STATE[:, None]
        Psi[at:end] = made.Psi / STATE[:, None]
        d[at:end, :3] = rotation_vector(made.C_bn @ np.swapaxes(C[at + 1 : end + 1], -1, -2))
        d[at:end, 3:6], d[at:end, 6:] = made.velocity, made.displacement
        at = end
    for k in np.flatnonzero(course.pauses):
        Phi[k, 3:6, 3:6] = 0.0
        Q[k, :3, :3] = (UNMOVED / STATE[0]) ** 2 * np.eye(3)
        Q[k, 3:6, 3:6] = (course.velocity / STATE[3]) ** 2 * np.eye(3)
    return Phi, Psi, Q, d / STATE


def _unseen(course: Course, u: Array) -> Array:
    """What the mean force (n,) [m/s^2] of an interval may be off, in the axes of its beginning, where a ramp begins.

    Sculling takes the rate to be linear over two intervals. Where it bends within one, by the second difference b of
    its means, the tilt that the force is turned by is off by b dt / 24 to b dt / 12, on the mean.
    """
    bend = np.zeros(len(u))
    bend[1:-1] = np.linalg.norm(np.diff(u[:, 3:], 2, axis=0), axis=1)
    bend = np.maximum(bend, np.maximum(np.roll(bend, 1), 0.0))  # the interval after it goes by the same slope
    turning = (course.stop < 0)[np.repeat(np.arange(len(course.stop)), np.diff(course.first))]
    return np.where(turning, course.rows.site.gravity * bend * course.dt / 12, 0.0)


def _expected(course: Course, u: Array, C: Array) -> Array:
    """Force and rate (n, 6) of a unit in its place with attitudes C at the updates, without the noise of what was read.

    Sensitivities at noisy readings would let a scale factor explain the noise: of an axis that has not yet been loaded
    it has nothing else to go by. Turning, the rates stand as they are.
    """
    site = course.rows.site
    assert site.latitude is not None
    earth = rate_at(site.latitude)
    force, rate = _in_body(course, u, C, np.array([[0.0, 0.0, -site.gravity], earth]))
    at_rest = (course.stop >= 0)[np.repeat(np.arange(len(course.stop)), np.diff(course.first))]
    return np.concatenate([force, np.where(at_rest[:, None], rate, u[:, 3:])], axis=1)


def in_body(course: Course, u: Array, C: Array, v: Array) -> Array:
    """A vector v (3,) in north, east, down as the axes of the unit see it in each group of intervals (g, 3)."""
    begin = np.flatnonzero(np.diff(course.group, prepend=-1))
    return np.asarray(
        np.add.reduceat(_in_body(course, u, C, v[None])[0], begin) / np.diff(begin, append=len(u))[:, None]
    )


def _in_body(course: Course, u: Array, C: Array, v: Array) -> Array:
    """Vectors v (m, 3) in north, east, down in the axes of the unit, in the middle of each interval (m, n, 3)."""
    stretch = np.repeat(np.arange(len(course.stop)), np.diff(course.first))
    went = carried(course.dt, u[:, 3:])
    begun = C[:-1] @ np.swapaxes(went[course.first[:-1]], -1, -2)
    went[:-1] += went[1:]
    went *= 0.5
    return np.stack([np.einsum("ni,nij->nj", (x @ begun)[stretch], went[:-1]) for x in v])


def rotation_vector(R: Array) -> Array:
    """phi (..., 3) [rad] of rotations exp([phi x]) (..., 3, 3) by less than half a turn."""
    v = np.stack([R[..., 2, 1] - R[..., 1, 2], R[..., 0, 2] - R[..., 2, 0], R[..., 1, 0] - R[..., 0, 1]], -1) / 2
    sine = np.linalg.norm(v, axis=-1, keepdims=True)
    angle = np.arctan2(sine, (np.trace(R, axis1=-2, axis2=-1)[..., None] - 1) / 2)
    return np.asarray(np.where(sine > 1e-9, v * angle / np.where(sine > 1e-9, sine, 1.0), v))


def turned(C: Array, phi: Array) -> Array:
    """exp([phi x]) C for attitudes C (K, 3, 3) and errors phi (K, 3) [rad]."""
    return np.asarray(exponential(-phi) @ C)
