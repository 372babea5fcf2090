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
    Phi: Array, Psi: Array, Q: Array, d: Array, z: Array, index: Array, R: Array,
    x: Array, theta: Array, S: Array, gate: float = np.inf, jump: float = 0.0, smoothed: int | None = None,
) -> Filtered:  # fmt: skip
    """Filter forward over K steps, each a transition, then measurements z (K, c) of the states `index` (c,).

    Phi (K, m, m), Psi (K, m, p), Q (K, m, m), d (K, m); R (K, c) variances; x (m,), theta (p,) and S (m + p, m + p)
    upper triangular at the start. A step whose normalised innovation squared exceeds `gate` is not used, and the states
    that it would have measured get the scatter `jump`, as a knock changes a state permanently. smoothed: number of
    first states for a smoother (default: all).
    """
    K, m, p = len(Phi), len(x), len(theta)
    n, c = m + p, z.shape[1]
    root, few = _roots(Q), m if smoothed is None else smoothed
    out = Filtered(
        np.empty((K + 1, m)), np.empty((K + 1, m)), np.empty((K + 1, p)), np.empty((K + 1, p)), np.full((K, c), np.nan),
        np.full((K, c), np.nan), np.array(S, dtype=float), np.zeros((K, c, n)), np.empty((K + 1, few, n)),
        np.zeros(K),
    )  # fmt: skip
    state = np.concatenate([x, theta])
    arrays = (np.ascontiguousarray(a, dtype=float) for a in (Phi, Psi, root, d, z, R))
    _filter(*arrays, np.asarray(index, dtype=np.int64), state, gate, jump, *out)
    return out


def _roots(Q: Array) -> Array:
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
    gate: float,
    jump: float,
    x: Array,
    sigma: Array,
    theta: Array,
    theta_sigma: Array,
    innovation: Array,
    variance: Array,
    S: Array,
    gain: Array,
    cross: Array,
    distance_of: Array,
) -> None:
    K, m, n, C = Phi.shape[0], Phi.shape[1], len(state), len(index)
    top, W, old, S_old = np.zeros((m, n)), np.zeros((2 * m, m)), np.zeros(n), np.zeros((n, n))
    one, none, zeros, nothing = np.eye(m), np.zeros((m, n - m)), np.zeros((m, m)), np.zeros(m)
    _keep(0, m, state, S, x, sigma, theta, theta_sigma, cross)
    for k in range(K):
        _step(Phi[k], Psi[k], root[k], d[k], m, state, S, top, W)
        old[:] = state
        S_old[:, :] = S
        distance = 0.0
        for c in range(C):
            if np.isnan(z[k, c]):
                continue
            i = index[c]
            y = z[k, c] - state[i]
            s = _carlson(S, i, R[k, c], gain[k, c])
            for j in range(n):
                state[j] += gain[k, c, j] * y
            innovation[k, c], variance[k, c] = y, s
            distance += y * y / s
        distance_of[k] = distance
        if distance > gate:
            state[:] = old
            S[:, :] = S_old
            for c in range(C):
                innovation[k, c] = variance[k, c] = np.nan
                zeros[index[c], index[c]] = jump
            if jump > 0:
                _step(one, none, zeros, nothing, m, state, S, top, W)
        _keep(k + 1, m, state, S, x, sigma, theta, theta_sigma, cross)


@compiled
def _step(Phi: Array, Psi: Array, root: Array, d: Array, m: int, state: Array, S: Array, top: Array, W: Array) -> None:
    """Propagate state and factor over one transition, in place; top (m, n) and W (2 m, m) are work space."""
    n = len(state)
    for i in range(m):
        total = d[i]
        for j in range(m):
            total += Phi[i, j] * state[j]
        for j in range(m, n):
            total += Psi[i, j - m] * state[j]
        W[0, i] = total
        for l in range(n):
            top[i, l] = 0.0
        for j in range(m):  # along the rows of S, which is upper triangular
            a = Phi[i, j]
            for l in range(j, n):
                top[i, l] += a * S[j, l]
        for j in range(m, n):
            a = Psi[i, j - m]
            for l in range(j, n):
                top[i, l] += a * S[j, l]
    for i in range(m):
        state[i] = W[0, i]
    for i in range(m):  # upside down, so that what Householder leaves is upper triangular the right way round
        for j in range(m):
            W[j, m - 1 - i] = top[i, j]
            W[m + j, m - 1 - i] = root[i, j]
    _triangular(W)
    for i in range(m):
        for j in range(m):
            S[i, j] = W[m - 1 - j, m - 1 - i] if j >= i else 0.0
        for j in range(m, n):
            S[i, j] = top[i, j]


@compiled
def _triangular(W: Array) -> None:
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
def _keep(
    k: int, m: int, state: Array, S: Array, x: Array, sigma: Array, theta: Array, theta_sigma: Array, cross: Array
) -> None:
    n = len(state)
    for i in range(n):
        if i < m:
            x[k, i] = state[i]
        total = 0.0
        for l in range(i, n):
            total += S[i, l] * S[i, l]
        if i < m:
            sigma[k, i] = np.sqrt(total)
        else:
            theta[k, i - m] = state[i]
            theta_sigma[k, i - m] = np.sqrt(total)
    for i in range(cross.shape[1]):
        for j in range(n):
            total = 0.0
            for l in range(max(i, j), n):
                total += S[i, l] * S[j, l]
            cross[k, i, j] = total


@compiled
def _carlson(S: Array, i: int, r: float, gain: Array) -> float:
    """Update S after a measurement of state i with variance r, and the gain; return the innovation's variance."""
    n = S.shape[0]
    total = r
    for j in range(n):
        gain[j] = 0.0
    for l in range(i, n):
        a = S[i, l]
        after = total + a * a
        beta = np.sqrt(total * after)
        keep, take = total / beta, a / beta
        total = after
        for j in range(l + 1):
            old = S[j, l]
            S[j, l] = keep * old - take * gain[j]
            gain[j] += a * old
    for j in range(n):
        gain[j] /= total
    return total
