r"""One pass of filter and smoother about a reference that starts anew, at rest and in its place, at each update.

The reference of stretch k starts from the attitude C_k, not moving; where it ends, less where the next one starts, is a
known defect d_k of the linear error model,

.. math:: x_{k+1} = \Phi_k x_k + \Psi_k \, \delta\theta + d_k + w_k, \qquad 0 = v_{k+1} + \text{noise},

so that a run of any length stays linear (multiple shooting): the vertical channel has no time to run away, and the next
pass starts from smoothed attitudes. Passes end where nothing moves: products of two errors are then in the solution.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gimbalcal.calibration.sound import no_number
from gimbalcal.effects import Effect, Parameter
from gimbalcal.estimate.systematic.alignment import Alignment
from gimbalcal.estimate.systematic.course import Course
from gimbalcal.estimate.systematic.error_model import STATE, Linear, defects, linear
from gimbalcal.estimate.systematic.seen import WIDE, informed, inverse
from gimbalcal.estimate.systematic.wander import chains
from gimbalcal.inference import adjoint, beside_constants
from gimbalcal.inference.beside_constants import Filtered
from gimbalcal.inference.information import solve
from gimbalcal.number import Array
from gimbalcal.recording.plausible_run import named
from gimbalcal.rotation import rotation_vector

PLACE = 1e-3  # m, one sigma of the place at the start
VELOCITY = np.arange(3, 6)
JUMP = 1.0  # m/s, what a knock may do to the velocity: the navigator starts anew with it
GATE = 50.0  # normalised innovation squared of three components: by chance once in 1e10 updates


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
    scale, x = np.array([p.sigma for p in wanted]), errors_at_start(course, start, C)
    first = np.concatenate([prior / scale, x[:3]])
    S, R = _scatter(course, start.sigma, len(wanted), known), of_rest(course, len(Phi))
    z = np.where(course.believed[:, None], 0.0, np.full((len(Phi), 3), np.nan))
    loose = knocked(Q, left_out)
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
    none, S0 = np.zeros((len(Phi), m, 0)), np.diag(sigma_at_start(course, start.sigma))
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
    loose = knocked(Q, left_out)
    S = np.diag(sigma_at_start(course, np.zeros(3)))
    R, z = of_rest(course, len(Phi)), np.where(np.isnan(last.filtered.innovation), np.nan, 0.0)
    x, none = np.zeros(m), np.zeros((len(Phi), m, 0))
    known = beside_constants.filter(Phi, none, loose, 0 * d, z, VELOCITY, R, x, x[:0], S, smoothed=3)
    before = np.zeros((m, p + 3))
    before[range(3), range(p, p + 3)] = 1.0
    return adjoint.covariance(Phi, Psi, VELOCITY, known, before, root) * STATE[0] ** 2


def for_smoother(course: Course, last: Pass, start: Alignment, left_out: NDArray[np.bool_]) -> Filtered:
    """What a pass that began with no knowledge of the constants lets go of: its gains and covariances, errors zero."""
    Phi, Psi, Q, d = last.about
    S, R = _scatter(course, start.sigma, len(last.step)), of_rest(course, len(Phi))
    z = np.where(np.isnan(last.filtered.innovation), np.nan, 0.0)
    x, theta = np.zeros(Phi.shape[1]), np.zeros(Psi.shape[2])
    return beside_constants.filter(Phi, Psi, knocked(Q, left_out), 0 * d, z, VELOCITY, R, x, theta, S, smoothed=3)


def errors_at_start(course: Course, start: Alignment, C: Array) -> Array:
    """The moving states (m,) at the start, in units of the states, where the reference starts from C[0]."""
    turned = rotation_vector(start.C_bn @ C[0].T)
    return np.concatenate([np.concatenate([turned, np.zeros(6)]) / STATE, np.zeros(len(chains(course)))])


def sigma_at_start(course: Course, attitude: Array) -> Array:
    """One sigma (m,) of the moving states at the start in units of the states, that of the attitude (3,) in rad."""
    wander = chains(course)
    before = np.concatenate([attitude, np.full(3, course.velocity), np.full(3, PLACE)]) / STATE
    return np.concatenate([before, np.sqrt(wander.P_0) / wander.scale])


def _scatter(course: Course, attitude: Array, p: int, known: Array | None = None) -> Array:
    """Upper triangular factor of the covariance at the start: moving states, p constants, and the attitude as it was.

    known (p, p): that of the constants (default: nothing is known). The attitude at the start is a constant too.
    """
    sigma = sigma_at_start(course, attitude)
    m = len(sigma)
    S = np.diag(np.concatenate([sigma, np.full(p, WIDE), sigma[:3]]))
    if known is not None:
        S[m:-3, m:-3] = known
    S[range(3), range(3)], S[range(3), range(-3, 0)] = 0.0, sigma[:3]
    return S


def of_rest(course: Course, K: int) -> Array:
    """Variances (K, 3) of the velocity, which is zero, in units of the states."""
    return np.full((K, 3), course.velocity**2) / STATE[VELOCITY] ** 2


def knocked(Q: Array, left_out: NDArray[np.bool_]) -> Array:
    """Q with what a knock may do to the velocity where an update is not believed."""
    if not left_out.any():
        return Q
    loose = Q.copy()
    loose[np.ix_(left_out, VELOCITY, VELOCITY)] += (JUMP / STATE[3]) ** 2 * np.eye(3)
    return loose
