r"""Smoother to `beside_constants`: adjoint variables run backwards, and no covariance is inverted; no physics.

.. math:: \tilde\lambda_k = (1 - K h)^T \hat\lambda_k - h^T y / s, \qquad
          \hat\lambda_{k-1} = F_k^T \tilde\lambda_k, \qquad x_{k|n} = x_k - P_k \hat\lambda_k

with innovation y, its variance s and gain K of each measured component. It is the smoother of Rauch, Tung and Striebel
(Cai et al. 2016, Eq. (13)) in another order of the same sums, at the cost of a product of a matrix and a vector a step.
Of constants the last filtered value and covariance stand; so a state at the start whose covariance is wanted (an
attitude) is carried as a constant. Source: Bierman (1977), section X (modified Bryson-Frazier smoother).
"""

from __future__ import annotations

import numpy as np

from gimbalcal.compiled import compiled
from gimbalcal.inference.beside_constants import Filtered
from gimbalcal.number import Array


def smooth(Phi: Array, Psi: Array, index: Array, filtered: Filtered, after: Array | None = None) -> Array:
    r"""The first moving states (K + 1, smoothed) from all measurements, from what `beside_constants.filter` left.

    after (m + p,): adjoint variables at the end, of what is known beside: :math:`P_{\theta\theta}^{-1}
    (\hat\theta - \theta^*)` of constants that are held at theta* (default: nothing).
    """
    out = np.empty(filtered.cross.shape[:2])
    last = np.zeros(filtered.cross.shape[2]) if after is None else np.array(after, dtype=float)
    _smooth(
        np.ascontiguousarray(Phi), np.ascontiguousarray(Psi), np.asarray(index, dtype=np.int64), filtered.x,
        filtered.innovation, filtered.variance, filtered.gain, filtered.cross, last, out,
    )  # fmt: skip
    return out


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
