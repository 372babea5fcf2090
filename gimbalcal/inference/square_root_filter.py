r"""Square-root Kalman filter of a few dynamic states and many constants; no physics.

.. math:: x_{k+1} = \Phi_k x_k + \Psi_k \theta + d_k + w_k, \qquad \theta = \text{const}, \qquad z_k = x_k[i] + v_k

with x of m numbers and theta of p. The covariance is :math:`P = S S^T` with S upper triangular, x before theta. The
constants have no dynamics, so a step touches the first m rows of S alone, and what is made triangular again is m x 2m:

.. math:: \begin{bmatrix} S_{xx} & S_{x\theta} \\ 0 & S_{\theta\theta} \end{bmatrix} \to
          \begin{bmatrix} [\Phi S_{xx}, Q^{1/2}] & \Phi S_{x\theta} + \Psi S_{\theta\theta} \\ 0 & S_{\theta\theta}
          \end{bmatrix}

Components of z are taken one after the other (Carlson's update). A step costs (m + p)^2 where a dense filter costs its
cube; a square root holds twice the digits of a covariance. Callers scale states to order one (by their prior sigma).
`adjoint` smooths the result.

Source: Carlson, AIAA J. 11 (1973) 1259; Bierman (1977), sections V.3 and X.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gimbalcal.compiled import compiled
from gimbalcal.number import Array

BATCH_STEPS = 10_000  # steps of which products are formed at a time


class Filtered(NamedTuple):
    """K steps of m moving states, p constants and c measured components (NaN in z: not measured, nor in the others)."""

    x: Array  # (K + 1, m) after the measurement that ends each step; first: at the start
    sigma: Array  # (K + 1, m)
    theta: Array  # (K + 1, p)
    theta_sigma: Array  # (K + 1, p)
    innovation: Array  # (K, c) one after the other, so they are independent
    variance: Array  # (K, c) of the innovation
    factor: Array  # (m + p, m + p) S at the end, upper triangular
    gain: Array  # (K, c, m + p)
    cross: Array  # (K + 1, smoothed, m + p) first rows of P at the start and after each step, those to be smoothed
    distance: Array  # (K,) normalised innovation squared of each step, those that the gate left out as well


def filter(  # noqa: A001 - always written with its module's name
    Phi: Array, Psi: Array, root: Array, d: Array, z: Array, index: Array, R: Array,
    x: Array, theta: Array, S: Array, gate: float = np.inf, jump: float = 0.0, smoothed: int | None = None,
) -> Filtered:  # fmt: skip
    """Filter forward over K steps, each a transition, then measurements z (K, c) of the states `index` (c,).

    Phi (K, m, m), Psi (K, m, p), root (K, m, m) of Q, see `roots`, d (K, m); R (K, c) variances; x (m,), theta (p,) and
    S (m + p, m + p) upper triangular at the start. A step whose normalised innovation squared exceeds `gate` is not
    used, and the states that it would have measured get the scatter `jump`, as a knock changes a state permanently.
    smoothed: number of first states for a smoother (default: all).
    """
    K, m, p = len(Phi), len(x), len(theta)
    n, c = m + p, z.shape[1]
    few = m if smoothed is None else smoothed
    out = Filtered(
        np.empty((K + 1, m)), np.empty((K + 1, m)), np.empty((K + 1, p)), np.empty((K + 1, p)), np.full((K, c), np.nan),
        np.full((K, c), np.nan), np.array(S, dtype=float), np.zeros((K, c, n)), np.empty((K + 1, few, n)),
        np.zeros(K),
    )  # fmt: skip
    state = np.concatenate([x, theta])
    arrays = (np.ascontiguousarray(a, dtype=float) for a in (Phi, Psi, root, d, z, R))
    T = np.array(out.factor.T, order="C")
    _filter(*arrays, np.asarray(index, dtype=np.int64), state, T, gate, jump, *out[:6], *out[7:])
    return out._replace(factor=np.ascontiguousarray(T.T))


def roots(Q: Array) -> Array:
    """Return Q^(1/2) (K, m, m); Q may be singular, as noise enters some states through others only.

    The last states may have independent noise (chains of a process), which is not decomposed.
    """
    together = np.any(Q != 0, axis=0) & ~np.eye(Q.shape[1], dtype=bool)
    m = 1 + int(np.max(np.flatnonzero(together.any(axis=0)), initial=0))
    out = np.zeros_like(Q)
    for start in range(0, len(Q), BATCH_STEPS):
        here = slice(start, start + BATCH_STEPS)
        scale = np.sqrt(np.maximum(np.einsum("kii->ki", Q[here]), 1e-300))
        out[here, range(m, Q.shape[1]), range(m, Q.shape[1])] = np.where(scale[:, m:] > 1e-150, scale[:, m:], 0.0)
        scale = scale[:, :m]
        values, vectors = np.linalg.eigh(Q[here, :m, :m] / scale[:, :, None] / scale[:, None, :])
        out[here, :m, :m] = scale[:, :, None] * vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :]
    return out


@compiled
def _filter(
    Phi: Array,
    Psi: Array,
    root: Array,
    d: Array,
    z: Array,
    R: Array,
    index: Array,
    state: Array,
    T: Array,
    gate: float,
    jump: float,
    x: Array,
    sigma: Array,
    theta: Array,
    theta_sigma: Array,
    innovation: Array,
    variance: Array,
    gain: Array,
    cross: Array,
    distance_of: Array,
) -> None:
    # T is S transposed: all inner loops go along its rows, which lets the processor take several numbers at once
    K, m, n, C = Phi.shape[0], Phi.shape[1], len(state), len(index)
    top, W, old, T_old = np.zeros((n, m)), np.zeros((2 * m, m)), np.zeros(n), np.zeros((n, n))
    one, none, zeros, nothing, square = np.eye(m), np.zeros((n - m, m)), np.zeros((m, m)), np.zeros(m), np.zeros(n)
    Phi_k, Psi_k = np.zeros((m, m)), np.zeros((n - m, m))
    _keep_step(0, m, state, T, square, x, sigma, theta, theta_sigma, cross)
    for k in range(K):
        for i in range(m):
            for j in range(m):
                Phi_k[j, i] = Phi[k, i, j]
            for j in range(n - m):
                Psi_k[j, i] = Psi[k, i, j]
        _step(Phi_k, Psi_k, root[k], d[k], m, state, T, top, W)
        if gate < np.inf:
            old[:] = state
            T_old[:, :] = T
        distance = 0.0
        for c in range(C):
            if np.isnan(z[k, c]):
                continue
            i = index[c]
            y = z[k, c] - state[i]
            s = _carlson(T, i, R[k, c], gain[k, c])
            for j in range(n):
                state[j] += gain[k, c, j] * y
            innovation[k, c], variance[k, c] = y, s
            distance += y * y / s
        distance_of[k] = distance
        if distance > gate:
            state[:] = old
            T[:, :] = T_old
            for c in range(C):
                innovation[k, c] = variance[k, c] = np.nan
                zeros[index[c], index[c]] = jump
            if jump > 0:
                _step(one, none, zeros, nothing, m, state, T, top, W)
        _keep_step(k + 1, m, state, T, square, x, sigma, theta, theta_sigma, cross)


@compiled
def _step(Phi: Array, Psi: Array, root: Array, d: Array, m: int, state: Array, T: Array, top: Array, W: Array) -> None:
    """Propagate state and factor over one transition, in place; Phi and Psi are transposed.

    top (n, m) and W (2 m, m) are work space.
    """
    n = len(state)
    for i in range(m):
        total = d[i]
        for j in range(m):
            total += Phi[j, i] * state[j]
        for j in range(m, n):
            total += Psi[j - m, i] * state[j]
        W[0, i] = total
    for i in range(m):
        state[i] = W[0, i]
    for l in range(n):  # along the rows of T, which is lower triangular
        for i in range(m):
            top[l, i] = 0.0
        for j in range(min(m, l + 1)):
            a = T[l, j]
            for i in range(m):
                top[l, i] += Phi[j, i] * a
        for j in range(m, l + 1):
            a = T[l, j]
            for i in range(m):
                top[l, i] += Psi[j - m, i] * a
    for i in range(m):  # upside down, so that what Householder leaves is upper triangular the right way round
        for j in range(m):
            W[j, m - 1 - i] = top[j, i]
            W[m + j, m - 1 - i] = root[i, j]
    _triangularise(W)
    for j in range(m):
        for i in range(m):
            T[j, i] = W[m - 1 - j, m - 1 - i] if j >= i else 0.0
    for j in range(m, n):
        for i in range(m):
            T[j, i] = top[j, i]


@compiled
def _triangularise(W: Array) -> None:
    """Reduce W (r, m) to the triangle of its QR, in place, by Householder's reflections."""
    r, m = W.shape
    for c in range(m):
        norm = 0.0
        for i in range(c, r):
            norm += W[i, c] * W[i, c]
        if norm == 0.0:
            continue
        alpha = -np.copysign(np.sqrt(norm), W[c, c])
        first = W[c, c] - alpha
        size = norm - alpha * W[c, c]  # half the squared length of the reflection's vector
        for j in range(c + 1, m):
            total = first * W[c, j]
            for i in range(c + 1, r):
                total += W[i, c] * W[i, j]
            total /= size
            W[c, j] -= total * first
            for i in range(c + 1, r):
                W[i, j] -= total * W[i, c]
        W[c, c] = alpha
        for i in range(c + 1, r):
            W[i, c] = 0.0


@compiled
def _keep_step(
    k: int, m: int, state: Array, T: Array, square: Array, x: Array, sigma: Array, theta: Array, theta_sigma: Array,
    cross: Array,
) -> None:  # fmt: skip
    n, smoothed = len(state), cross.shape[1]
    square[:] = 0.0
    cross[k] = 0.0
    for l in range(n):
        for i in range(l + 1):
            square[i] += T[l, i] * T[l, i]
        for i in range(min(smoothed, l + 1)):
            a = T[l, i]
            for j in range(l + 1):
                cross[k, i, j] += a * T[l, j]
    for i in range(n):
        if i < m:
            x[k, i], sigma[k, i] = state[i], np.sqrt(square[i])
        else:
            theta[k, i - m], theta_sigma[k, i - m] = state[i], np.sqrt(square[i])


@compiled
def _carlson(T: Array, i: int, r: float, gain: Array) -> float:
    """Update T after a measurement of state i with variance r, and the gain; return the innovation's variance."""
    n = T.shape[0]
    total = r
    for j in range(n):
        gain[j] = 0.0
    for l in range(i, n):
        a = T[l, i]
        after = total + a * a
        beta = np.sqrt(total * after)
        keep, take = total / beta, a / beta
        total = after
        for j in range(l + 1):
            old = T[l, j]
            T[l, j] = keep * old - take * gain[j]
            gain[j] += a * old
    for j in range(n):
        gain[j] /= total
    return total
