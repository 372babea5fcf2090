r"""Information of measurements of a few dynamic states about constants, as whitened rows; no physics.

.. math:: x_{k+1} = \Phi_k x_k + \Psi_k \theta + w_k, \qquad z_k = x_k[i] + v_k, \qquad \theta = \text{const}

With the constants known, the innovations of a filter of x alone are white. Their response to the constants is linear,

.. math:: D_{k+1} = (1 - K_k H)(\Phi_k D_k + \Psi_k), \qquad \text{row}_k = s_k^{-1/2} \, H (\Phi_k D_k + \Psi_k) ,

and neither the gain K nor the variance s of an innovation depends on them: each component of z is one whitened row
about theta (Friedland 1969). That is all the information of a filter with the constants among its states, without a
prior, at a cost of m^2 p a step instead of (m + p)^3, in the form needed for null directions and bounds.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gimbalcal.compiled import compiled
from gimbalcal.number import Array


class Innovations(NamedTuple):
    """Rows (K, c, p) about the constants; D (K + 1, m, p): response of x to them; P (K + 1, m, m) of x if known."""

    rows: Array
    D: Array
    P: Array


def innovations(Phi: Array, Psi: Array, Q: Array, index: Array, R: Array, P: Array) -> Innovations:
    """Return the rows of K steps of m states and p constants: transition, then states `index` (c,), variances R (K, c).

    Phi (K, m, m), Psi (K, m, p), Q (K, m, m), P (m, m) at the start, where D is zero.
    """
    K, m, p = Psi.shape
    out = Innovations(np.empty((K, len(index), p)), np.zeros((K + 1, m, p)), np.empty((K + 1, m, m)))
    out.P[0] = P
    arrays = (np.ascontiguousarray(a, dtype=float) for a in (Phi, Psi, Q, R))
    _innovations(*arrays, np.asarray(index, dtype=np.int64), *out)
    return out


@compiled
def _innovations(Phi: Array, Psi: Array, Q: Array, R: Array, index: Array, rows: Array, D: Array, P: Array) -> None:
    K, m, p = Psi.shape
    A, B, T, g = np.empty((m, p)), np.empty((m, m)), np.empty((m, m)), np.empty(m)
    for k in range(K):
        A[:, :] = Psi[k]
        for i in range(m):
            for j in range(m):
                f = Phi[k, i, j]
                if f != 0.0:
                    for c in range(p):
                        A[i, c] += f * D[k, j, c]
        for i in range(m):
            for j in range(m):
                total = 0.0
                for l in range(m):
                    total += Phi[k, i, l] * P[k, l, j]
                T[i, j] = total
        for i in range(m):
            for j in range(i + 1):
                total = Q[k, i, j]
                for l in range(m):
                    total += T[i, l] * Phi[k, j, l]
                B[i, j] = B[j, i] = total
        for c in range(len(index)):
            i = index[c]
            s = B[i, i] + R[k, c]
            for a in range(m):
                g[a] = B[a, i] / s
            for q in range(p):
                rows[k, c, q] = A[i, q] / np.sqrt(s)
            for a in range(m):
                for b in range(a + 1):
                    B[a, b] -= s * g[a] * g[b]
                    B[b, a] = B[a, b]
            for a in range(m):
                if a != i:
                    for q in range(p):
                        A[a, q] -= g[a] * A[i, q]
            keep = 1.0 - g[i]
            for q in range(p):
                A[i, q] *= keep
        D[k + 1] = A
        P[k + 1] = B
