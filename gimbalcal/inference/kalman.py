r"""Linear Kalman filter and Rauch-Tung-Striebel smoother as two pure functions; no physics in here.

.. math:: x_k = \Phi_k x_{k-1} + w_k, \; w_k \sim N(0, Q_k) \qquad z_k = H_k x_k + v_k, \; v_k \sim N(0, R_k)

The given x, P describe the state *at* the first measurement: there is no propagation before it, and ``Phi[k]``,
``Q[k]`` lead from row k - 1 to row k (``Phi[0]``, ``Q[0]`` are not used). Every matrix may be constant or carry a
leading axis of n rows. A component of z that is NaN was not measured: it is left out, nothing else changes.

The correction is in Joseph form; the smoother solves with the predicted covariance scaled to a unit diagonal and never
takes a pseudo-inverse: in SI units accelerometer states span ten decades, and a cut-off in those is a wrong answer.

Source: Simon (2006), Eqs. (5.16)-(5.19) and (9.135)-(9.139); Rauch, Tung and Striebel (1965).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from gimbalcal.number import Array


class Filtered(NamedTuple):
    """Filter history over n rows of m measurements of p states."""

    x: Array  # (n, p) estimate after row k
    P: Array  # (n, p, p) its covariance
    x_prior: Array  # (n, p) estimate before row k
    P_prior: Array  # (n, p, p)
    Phi: Array  # (n, p, p) transition into row k
    Q: Array  # (n, p, p) noise of it
    innovation: Array  # (n, m) z - H x_prior; NaN where nothing was measured
    S: Array  # (n, m, m) covariance of the innovation
    log_likelihood: float  # of all rows, natural logarithm


class Smoothed(NamedTuple):
    """Estimates (n, p) and covariances (n, p, p) of every row from all rows."""

    x: Array
    P: Array


def filter(  # noqa: A001 - always written kalman.filter
    z: ArrayLike, H: ArrayLike, R: ArrayLike, Phi: ArrayLike, Q: ArrayLike, x: ArrayLike, P: ArrayLike
) -> Filtered:
    """Forward pass over measurements z (n, m), or (n,) of one instrument.

    H (m, p), R (m, m), Phi (p, p), Q (p, p), each optionally (n, ...); x (p,), P (p, p) at the first row.
    """
    z = np.asarray(z, dtype=float)
    z = z[:, None] if z.ndim == 1 else z
    state, covariance = np.asarray(x, dtype=float), np.asarray(P, dtype=float)
    n, m, p = len(z), z.shape[1], state.size
    H, R = _rows(H, (n, m, p)), _rows(R, (n, m, m))
    Phi, Q = _rows(Phi, (n, p, p)), _rows(Q, (n, p, p))
    history = Filtered(
        np.empty((n, p)), np.empty((n, p, p)), np.empty((n, p)), np.empty((n, p, p)),
        Phi, Q, np.empty((n, m)), np.empty((n, m, m)), 0.0,
    )  # fmt: skip
    logs = np.zeros(n)
    for k in range(n):
        if k:
            state, covariance = Phi[k] @ state, Phi[k] @ covariance @ Phi[k].T + Q[k]
        history.x_prior[k], history.P_prior[k] = state, covariance
        history.innovation[k] = z[k] - H[k] @ state
        history.S[k] = H[k] @ covariance @ H[k].T + R[k]
        state, covariance, logs[k] = update(state, covariance, z[k], H[k], R[k])
        history.x[k], history.P[k] = state, covariance
    return history._replace(log_likelihood=float(logs.sum()))


def update(x: Array, P: Array, z: Array, H: Array, R: Array) -> tuple[Array, Array, float]:
    """One measurement z (m,) = H x + v: posterior x, P (Joseph form) and the log-likelihood of z."""
    seen = ~np.isnan(z)
    if not seen.any():
        return x, P, 0.0
    z, H, R = z[seen], H[seen], R[np.ix_(seen, seen)]
    S = H @ P @ H.T + R
    K = np.linalg.solve(S, H @ P).T
    innovation = z - H @ x
    keep = np.eye(x.size) - K @ H
    _, log_determinant = np.linalg.slogdet(S)
    misfit = innovation @ np.linalg.solve(S, innovation)
    log_likelihood = -0.5 * (misfit + log_determinant + z.size * np.log(2 * np.pi))
    return x + K @ innovation, keep @ P @ keep.T + K @ R @ K.T, float(log_likelihood)


def smooth(filtered: Filtered) -> Smoothed:
    """Backward pass (Rauch-Tung-Striebel): every row's estimate from all rows."""
    x, P = filtered.x.copy(), filtered.P.copy()
    for k in range(len(x) - 2, -1, -1):
        Phi, predicted = filtered.Phi[k + 1], filtered.P_prior[k + 1]
        gain = _smoother_gain(P[k], Phi, predicted, filtered.Q[k + 1])
        x[k] += gain @ (x[k + 1] - filtered.x_prior[k + 1])
        P[k] += gain @ (P[k + 1] - predicted) @ gain.T
    return Smoothed(x, (P + np.swapaxes(P, -1, -2)) / 2)


def _smoother_gain(P: Array, Phi: Array, predicted: Array, Q: Array) -> Array:
    """P Phi^T predicted^-1, written Phi^-1 (1 - Q predicted^-1) where Phi can be inverted.

    The two are equal; the second is exact for states that do not move, whose covariance may have any condition.
    """
    sigma = np.sqrt(np.diag(P))
    if np.all(sigma > 0) and np.linalg.cond(Phi * sigma / sigma[:, None]) < 1e6:
        return np.asarray(np.linalg.solve(Phi, np.eye(len(P)) - _divide(Q, predicted)))
    return _divide(P @ Phi.T, predicted)


def _divide(A: Array, P: Array) -> Array:
    """A P^-1 for a covariance P, solved at unit diagonal; a state known exactly (zero variance) takes no part."""
    sigma = np.sqrt(np.diag(P))
    live = sigma > 0
    out = np.zeros_like(A)
    s = sigma[live]
    correlation = P[np.ix_(live, live)] / np.outer(s, s)
    out[:, live] = np.linalg.solve(correlation, (A[:, live] / s).T).T / s
    return out


def _rows(matrix: ArrayLike, shape: tuple[int, int, int]) -> Array:
    """A matrix, or one per row, as a stack of that shape; a scalar stands for a 1 x 1."""
    matrix = np.asarray(matrix, dtype=float)
    matrix = matrix.reshape(1, 1) if matrix.ndim == 0 else matrix
    if matrix.shape not in (shape, shape[1:]):
        raise ValueError(f"expected a matrix of shape {shape[1:]} or a stack {shape}, got {matrix.shape}")
    return np.broadcast_to(matrix, shape)
