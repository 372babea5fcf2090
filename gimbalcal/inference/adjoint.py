r"""Smoother for `square_root_filter` by backward adjoint variables, without inverting a covariance; no physics.

.. math:: \tilde\lambda_k = (1 - K h)^T \hat\lambda_k - h^T y / s, \qquad
          \hat\lambda_{k-1} = F_k^T \tilde\lambda_k, \qquad x_{k|n} = x_k - P_k \hat\lambda_k

with innovation y, its variance s and gain K of each measured component. It is the smoother of Rauch, Tung and Striebel
(Cai et al. 2016, Eqs. (13) and (15)) in another order of the same sums, at the cost of a product of a matrix and a
vector a step. Constants keep the last filtered value and covariance; so a state at the start whose covariance is wanted
(an attitude) is carried as a constant.

Covariances of the dynamic states are computed in two parts, because of a wide prior minus nearly all of it no digits
would be left: with the constants known, and the contribution of their covariance,

.. math:: P_{k|n} = P_k - P_k \hat\Lambda_k P_k + T_k P_{\theta\theta} T_k^T, \qquad
          \tilde\Lambda_k = (1 - K h)^T \hat\Lambda_k (1 - K h) + h^T h / s, \qquad
          T_k = D_k - P_k \hat\mu_k

with P_k, K and s of the dynamic states alone; D_k is the response of these to the constants as they are filtered, and
mu their adjoint variables, with the response of y to the constants in place of y.
Source: Bierman (1977), section X (modified Bryson-Frazier smoother).
"""

from __future__ import annotations

import numpy as np

from gimbalcal.compiled import compiled
from gimbalcal.inference.square_root_filter import BATCH_STEPS, Filtered
from gimbalcal.number import Array


def smooth(Phi: Array, Psi: Array, index: Array, filtered: Filtered, after: Array | None = None) -> Array:
    r"""Return the first states (K + 1, smoothed) from all measurements, from a result of `square_root_filter.filter`.

    after (m + p,): adjoint variables at the end, of other information: :math:`P_{\theta\theta}^{-1}
    (\hat\theta - \theta^*)` of constants that are held at theta* (default: nothing).
    Raises ValueError for a `filtered` without its gains, which the kernel would read out of bounds.
    """
    if len(filtered.gain) != len(Phi) or len(filtered.cross) != len(Phi) + 1:
        raise ValueError(f"the filter's {len(filtered.gain)} gains do not belong to {len(Phi)} steps")
    out = np.empty(filtered.cross.shape[:2])
    last = np.zeros(filtered.cross.shape[2]) if after is None else np.array(after, dtype=float)
    _smooth(
        np.ascontiguousarray(Phi), np.ascontiguousarray(Psi), np.asarray(index, dtype=np.int64), filtered.x,
        filtered.innovation, filtered.variance, filtered.gain, filtered.cross, last, out,
    )  # fmt: skip
    return out


def covariance(Phi: Array, Psi: Array, index: Array, known: Filtered, before: Array, constants: Array) -> Array:
    """Return the covariance (K + 1, smoothed, smoothed) of the first states from all measurements.

    known: result of `square_root_filter.filter` of the dynamic states alone, with the constants known; before (m, p):
    response of the states at the start to the constants; constants (p, q): a square root of the constants'
    covariance after all measurements.
    """
    few = known.cross.shape[1]
    out = np.empty((len(known.cross), few, few))
    innovation, answers = innovation_response(Phi, Psi, index, known.innovation, known.gain, few, before)
    Phi, index = np.ascontiguousarray(Phi), np.asarray(index, dtype=np.int64)
    _covariance(Phi, index, innovation, known.variance, known.gain, known.cross, out, answers)
    del innovation  # as large as the answers
    for start in range(0, len(out), BATCH_STEPS):
        T = answers[start : start + BATCH_STEPS] @ constants
        out[start : start + BATCH_STEPS] += T @ np.swapaxes(T, -1, -2)
    return out


def innovation_response(
    Phi: Array, Psi: Array, index: Array, measured: Array, gain: Array, states: int = 0, before: Array | None = None
) -> tuple[Array, Array]:
    """Return the responses to constants of the innovations (K, c, p) and of the first filtered `states` (K + 1, s, p).

    measured (K, c): not a number where the filter left a component out, as is the response there; gain (K, c, m) of
    the moving states; before (m, p): their response at the start (default: none).
    """
    K, m, p = Psi.shape
    innovation, answers = np.full((K, len(index), p), np.nan), np.empty((K + 1, states, p))
    arrays = (np.ascontiguousarray(a, dtype=float) for a in (Phi, Psi))
    D = np.zeros((m, p)) if before is None else np.array(before, dtype=float)
    _responses(*arrays, np.asarray(index, dtype=np.int64), measured, gain, D, innovation, answers)
    return innovation, answers


@compiled
def _responses(
    Phi: Array, Psi: Array, index: Array, measured: Array, gain: Array, D: Array, innovation: Array, answers: Array
) -> None:
    """Compute the response to constants of each innovation (K, c, p), and of the first filtered states."""
    few, m, p = answers.shape[1], D.shape[0], D.shape[1]
    F = np.empty((m, p))
    for k in range(len(Phi) + 1):
        for a in range(few):
            for q in range(p):
                answers[k, a, q] = D[a, q]
        if k == len(Phi):
            break
        for a in range(m):
            for q in range(p):
                F[a, q] = Psi[k, a, q]
            for b in range(m):
                f = Phi[k, a, b]
                if f != 0.0:
                    for q in range(p):
                        F[a, q] += f * D[b, q]
        D[:, :] = F
        for c in range(len(index)):
            if np.isnan(measured[k, c]):
                continue
            for q in range(p):
                innovation[k, c, q] = -D[index[c], q]
            for a in range(m):
                for q in range(p):
                    D[a, q] += gain[k, c, a] * innovation[k, c, q]


@compiled
def _covariance(
    Phi: Array, index: Array, innovation: Array, variance: Array, gain: Array, cross: Array, out: Array, answers: Array
) -> None:
    """Compute both parts; `answers`: D_k in, T_k out."""
    K, m, p = Phi.shape[0], Phi.shape[1], innovation.shape[2]
    few, T, went = cross.shape[1], np.zeros((m, m)), np.zeros((m, p))
    L, mu, row, along = np.zeros((m, m)), np.zeros((m, p)), np.zeros(m), np.zeros(p)
    for k in range(K, -1, -1):
        for i in range(few):
            for a in range(m):
                row[a] = 0.0
            for b in range(m):
                for a in range(m):
                    row[a] += cross[k, i, b] * L[b, a]
                for q in range(p):
                    answers[k, i, q] -= cross[k, i, b] * mu[b, q]
            for j in range(few):
                total = cross[k, i, j]
                for a in range(m):
                    total -= row[a] * cross[k, j, a]
                out[k, i, j] = total
        if k == 0:
            break
        for c in range(len(index) - 1, -1, -1):
            if np.isnan(variance[k - 1, c]):
                continue
            h, s, twice = index[c], variance[k - 1, c], 0.0
            for q in range(p):
                along[q] = innovation[k - 1, c, q] / s
            for a in range(m):
                row[a] = 0.0
            for b in range(m):
                g = gain[k - 1, c, b]
                for q in range(p):
                    along[q] += g * mu[b, q]
                for a in range(m):
                    row[a] += g * L[b, a]
            for q in range(p):
                mu[h, q] -= along[q]
            for a in range(m):
                twice += row[a] * gain[k - 1, c, a]
            for a in range(m):
                L[h, a] -= row[a]
                L[a, h] -= row[a]
            L[h, h] += twice + 1 / s
        for a in range(m):  # F^T mu, and L F
            for q in range(p):
                went[a, q] = 0.0
            for b in range(m):
                f, total = Phi[k - 1, b, a], 0.0
                if f != 0.0:
                    for q in range(p):
                        went[a, q] += f * mu[b, q]
                for l in range(m):
                    total += L[a, l] * Phi[k - 1, l, b]
                T[a, b] = total
        mu[:, :] = went
        for a in range(m):
            for b in range(m):
                total = 0.0
                for l in range(m):
                    total += Phi[k - 1, l, a] * T[l, b]
                L[a, b] = total


@compiled
def _smooth(
    Phi: Array, Psi: Array, index: Array, x: Array, innovation: Array, variance: Array, gain: Array, cross: Array,
    adjoint: Array, out: Array,
) -> None:  # fmt: skip
    K, m, n = Phi.shape[0], Phi.shape[1], cross.shape[2]
    before = np.zeros(n)
    for k in range(K, -1, -1):
        for i in range(cross.shape[1]):
            total = x[k, i]
            for a in range(n):
                total -= cross[k, i, a] * adjoint[a]
            out[k, i] = total
        if k == 0:
            break
        for c in range(len(index) - 1, -1, -1):
            if np.isnan(innovation[k - 1, c]):
                continue
            along = innovation[k - 1, c] / variance[k - 1, c]
            for a in range(n):
                along += gain[k - 1, c, a] * adjoint[a]
            adjoint[index[c]] -= along
        for a in range(n):
            total = adjoint[a] if a >= m else 0.0
            for i in range(m):
                total += (Phi[k - 1, i, a] if a < m else Psi[k - 1, i, a - m]) * adjoint[i]
            before[a] = total
        for a in range(n):
            adjoint[a] = before[a]
