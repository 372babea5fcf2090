r"""One pass of filter and smoother about a reference that starts anew, at rest and in its place, at each update.

The reference of stretch k starts from the attitude C_k, not moving; where it ends, less where the next one starts, is a
known defect d_k of the linear error model,

.. math:: x_{k+1} = \Phi_k x_k + \Psi_k \, \delta\theta + d_k + w_k, \qquad 0 = v_{k+1} + \text{noise},

so that a run of any length stays linear (multiple shooting): the vertical channel has no time to diverge, and the next
pass starts from smoothed attitudes. When passes have converged, products of two errors are part of the solution.

A pass works with a prior so wide that it has no influence. An unobservable combination then comes out as noise over
next to nothing, many times the size of any sensor error; a reference that went there would leave the range in which the
model is linear, and spoil what is observable too. So the reference goes to the estimate theta* in which such
combinations keep their prior mean, and the attitudes follow,

.. math:: x_{k|n}(\theta^*) = x_{k|n} + P_{x \theta} P_{\theta\theta}^{-1} (\theta^* - \hat\theta) .
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gimbalcal.calibration.content_checks import not_finite
from gimbalcal.effects import Effect, Parameter
from gimbalcal.estimate.systematic.alignment import Alignment
from gimbalcal.estimate.systematic.error_model import (
    STATE_SCALE,
    ErrorModel,
    bias_processes,
    error_model,
    reference_defects,
    velocity_variance,
)
from gimbalcal.inference import adjoint, square_root_filter
from gimbalcal.inference.information import Information, solve
from gimbalcal.inference.square_root_filter import Filtered
from gimbalcal.number import Array
from gimbalcal.rotation import rotation_vector
from gimbalcal.views.segments import Segments

WIDE_PRIOR_SIGMAS = 100.0  # times the catalogue's prior, which then has no influence
POSITION_SIGMA_M = 1e-3  # at the start
VELOCITY_STATES = np.arange(3, 6)
JUMP_SIGMA_M_S = 1.0  # of the velocity after a knock, with which the navigator starts anew
CURVE_POINTS = 120  # at which estimates and sigmas are kept over time
GATE_NIS = 50.0  # normalised innovation squared of three components: by chance once in 1e10 updates


@dataclass(frozen=True, eq=False)
class Pass:
    """Result of one pass: correction and sigma of the parameters (p,) about the reference, in SI, and the navigation.

    step (p,): the correction without the prior; regularised_step (p,): the one in which unobservable combinations keep
    their prior mean, with its sigma (p,); all other results go with it.
    """

    step: Array
    regularised_step: Array
    sigma: Array
    factor: Array  # (p, p) lower triangular, of the covariance in units of the parameters' prior sigmas
    attitude: Array  # (3, 3) covariance of the attitude at the start [rad^2]
    drift: Array  # (K, 3) velocity that a reference gains in each stretch, from rest [m/s]
    filtered: Filtered  # without the smoother's gains and covariances, and with the last constants alone
    estimates: Array  # (j, p) of the filter at `curve_points`, without the prior, less its mean, in SI
    smoothed: Array  # (K + 1, 3) errors of the attitude [rad]
    model: ErrorModel
    calibrated: Filtered  # of the navigator with calibrated sensors, whose innovations are tested


def filter_and_smooth(
    segments: Segments, wanted: Sequence[Parameter], effects: Sequence[Effect], u: Array, C: Array, start: Alignment,
    prior: Array, excluded: NDArray[np.bool_], frozen: ErrorModel | None = None, known: Array | None = None,
) -> Pass:  # fmt: skip
    """Filter and smooth about the effects, the motion u (n, 6) and the attitudes C (K + 1, 3, 3).

    prior (p,): mean of the parameters before, less their present values; excluded (K,): updates that are not used;
    frozen: an error model about values so near that only the defects differ; known (p, p): upper triangular factor of
    the prior covariance in prior sigmas (default: nothing is known). Raises InputError for results that are no numbers.
    """
    try:
        model = (
            error_model(segments, wanted, effects, u, C)
            if frozen is None
            else frozen._replace(d=reference_defects(segments, u, C, frozen))
        )
    except np.linalg.LinAlgError:  # at constants so far away that readings can no longer be inverted
        raise not_finite(segments.rows.label, "what a reading tells of the constants") from None
    m, scale = model.Phi.shape[1], np.array([p.sigma for p in wanted])
    x = initial_errors(segments, start, C)
    theta = np.concatenate([prior / scale, x[:3]])
    S = _initial_factor(segments, start.sigma, len(wanted), known)
    z = np.where(segments.believed[:, None], 0.0, np.full((len(model.Phi), 3), np.nan))
    jumping = model._replace(root=with_velocity_jumps(model.root, excluded))
    filtered = filter_velocities(segments, jumping, np.where(excluded[:, None], np.nan, z), x, theta, S)
    constants, own = filtered.theta[-1], filtered.factor[m:, m:]
    if not (np.isfinite(constants).all() and np.isfinite(own).all()):
        raise not_finite(segments.rows.label, "what the filter holds of the constants")
    estimates = filtered.theta[curve_points(len(z)), :-3] * scale - prior
    step, factor = constants[:-3] * scale, np.asarray(np.linalg.qr(own[:-3].T, mode="r")).T
    regularised, sigma = step, np.linalg.norm(factor, axis=1) * scale
    after = np.zeros(m + len(constants))
    if known is None:
        solution = solve(data_information(wanted, factor, step - prior, scale))
        regularised, sigma = prior + solution.x, solution.sigma
        root = inverse_factor(factor)
        after[m:-3] = root.T @ (root @ ((step - regularised) / scale))
    smoothed = adjoint.smooth(model.Phi, model.Psi, VELOCITY_STATES, filtered, after) * STATE_SCALE[:3]
    released = np.empty((0, *filtered.gain.shape[1:]))  # only the smoother needs them: a quarter of a gigabyte a day
    filtered = filtered._replace(gain=released, cross=released, theta=filtered.theta[-1:].copy())
    # the same navigator with its sensors calibrated
    constants = constants - own @ (own.T @ after[m:])
    corrected = model._replace(Psi=np.zeros((len(z), m, 0)), d=model.d + model.Psi @ constants)
    calibrated = filter_velocities(
        segments, corrected, z, x, constants[:0], np.diag(initial_sigma(segments, start.sigma)), 0, GATE_NIS
    )
    return Pass(
        step, regularised, sigma, factor, own[-3:] @ own[-3:].T * STATE_SCALE[0] ** 2,
        model.d[:, 3:6] * STATE_SCALE[3], filtered, estimates, smoothed, model, calibrated,
    )  # fmt: skip


def curve_points(updates: int) -> NDArray[np.int64]:
    """Return the ordinals of the instants at which results over time are kept; 0 is the start, k is after update k."""
    return np.unique(np.linspace(0, updates, CURVE_POINTS).astype(np.int64))


def filter_velocities(
    segments: Segments, model: ErrorModel, z: Array, x: Array, theta: Array, S: Array, smoothed: int = 3,
    gate: float = np.inf,
) -> Filtered:  # fmt: skip
    """Filter the velocities z (K, 3) of a unit in its place; beyond the gate the velocity starts anew."""
    Phi, Psi, root, d = model
    jump = JUMP_SIGMA_M_S / STATE_SCALE[3] if np.isfinite(gate) else 0.0
    R = velocity_variance(segments.velocity)
    return square_root_filter.filter(Phi, Psi, root, d, z, VELOCITY_STATES, R, x, theta, S, gate, jump, smoothed)


def attitude_covariance(segments: Segments, last: Pass, excluded: NDArray[np.bool_], constants: Array) -> Array:
    """Return the covariance (K + 1, 3, 3) [rad^2] of the smoothed attitudes, north, east, down.

    constants (p, p): covariance of the parameters in prior sigmas, unobservable combinations with their prior; the
    attitude at the start goes with them and has a scatter of its own. Source: Cai et al. (2016), Eq. (15).
    """
    Phi, Psi = last.model.Phi, last.model.Psi
    m, p = Phi.shape[1], len(constants)
    whole = np.asarray(np.linalg.qr(last.filtered.factor[m:, m:].T, mode="r")).T
    values, vectors = np.linalg.eigh(constants)
    root = np.zeros((p + 3, p + 3))
    root[:p, :p] = vectors * np.sqrt(np.maximum(values, 0.0))
    root[p:, :p] = whole[p:, :p] @ inverse_factor(whole[:p, :p]) @ root[:p, :p]
    root[p:, p:] = whole[p:, p:]
    known = _without_errors(
        segments, last, excluded, np.zeros((len(Phi), m, 0)), np.diag(initial_sigma(segments, np.zeros(3)))
    )
    initial = np.zeros((m, p + 3))
    initial[range(3), range(p, p + 3)] = 1.0
    return adjoint.covariance(Phi, Psi, VELOCITY_STATES, known, initial, root) * STATE_SCALE[0] ** 2


def smoother_inputs(segments: Segments, last: Pass, start: Alignment, excluded: NDArray[np.bool_]) -> Filtered:
    """Return the gains and covariances that a pass without knowledge of the constants has released, errors zero."""
    S = _initial_factor(segments, start.sigma, len(last.step))
    return _without_errors(segments, last, excluded, last.model.Psi, S)


def _without_errors(segments: Segments, last: Pass, excluded: NDArray[np.bool_], Psi: Array, S: Array) -> Filtered:
    """Filter as the last pass did, with all errors zero."""
    root, d = with_velocity_jumps(last.model.root, excluded), 0 * last.model.d
    z = np.where(np.isnan(last.filtered.innovation), np.nan, 0.0)
    x, theta = np.zeros(Psi.shape[1]), np.zeros(Psi.shape[2])
    return filter_velocities(segments, last.model._replace(Psi=Psi, root=root, d=d), z, x, theta, S)


def initial_errors(segments: Segments, start: Alignment, C: Array) -> Array:
    """Return the moving states (m,) at the start, in units of the states, of a reference that starts from C[0]."""
    attitude = rotation_vector(start.C_bn @ C[0].T)
    navigation = np.concatenate([attitude, np.zeros(6)]) / STATE_SCALE
    return np.concatenate([navigation, np.zeros(len(bias_processes(segments)))])


def initial_sigma(segments: Segments, attitude: Array) -> Array:
    """Return one sigma (m,) of the moving states at the start, in units of the states; attitude: its (3,) in rad."""
    processes = bias_processes(segments)
    navigation = np.concatenate([attitude, *np.full((3, 2), [segments.velocity[0], POSITION_SIGMA_M]).T]) / STATE_SCALE
    return np.concatenate([navigation, np.sqrt(processes.P_0) / processes.scale])


def _initial_factor(segments: Segments, attitude: Array, p: int, known: Array | None = None) -> Array:
    """Return the upper triangular factor of the initial covariance: moving states, p constants, initial attitude.

    known (p, p): that of the constants (default: nothing is known). The attitude at the start is a constant too.
    """
    sigma = initial_sigma(segments, attitude)
    m = len(sigma)
    S = np.diag(np.concatenate([sigma, np.full(p, WIDE_PRIOR_SIGMAS), sigma[:3]]))
    if known is not None:
        S[m:-3, m:-3] = known
    S[range(3), range(3)], S[range(3), range(-3, 0)] = 0.0, sigma[:3]
    return S


def with_velocity_jumps(root: Array, excluded: NDArray[np.bool_]) -> Array:
    """Return the roots of Q with the scatter of a knock in the velocity of the excluded updates."""
    if not excluded.any():
        return root
    Q = root[excluded] @ np.swapaxes(root[excluded], -1, -2)
    Q[:, VELOCITY_STATES, VELOCITY_STATES] += (JUMP_SIGMA_M_S / STATE_SCALE[3]) ** 2
    out = root.copy()
    out[excluded] = square_root_filter.roots(Q)
    return out


def data_information(
    wanted: Sequence[Parameter], factor: Array, x: Array, scale: Sequence[float] | Array
) -> Information:
    """Return the information of the data alone, from a pass that estimated x (p,) [SI] with prior sigmas scale (p,).

    factor (p, p), lower triangular: P = S S^T includes the prior of width w = `WIDE_PRIOR_SIGMAS`, so the singular
    values s of S^-1 become sqrt(s^2 - 1 / w^2).
    """
    _, s, Vt = np.linalg.svd(inverse_factor(factor))
    s = np.sqrt(np.maximum(s**2 - WIDE_PRIOR_SIGMAS**-2, 0.0))
    J = s[:, None] * Vt * (np.array([p.sigma for p in wanted]) / scale)
    return Information(tuple(wanted), np.column_stack([J, s * (Vt @ (x / scale))]), len(wanted))


def inverse_factor(factor: Array) -> Array:
    """Return S^-1 of a lower triangular S (p, p)."""
    from scipy.linalg import solve_triangular

    return np.asarray(solve_triangular(factor, np.eye(len(factor)), lower=True))
