r"""The contribution of correlated noise to the covariance of a fit to independent rows.

.. math:: \hat x = G J^T r, \qquad P = G + G J^T (\bar V - I) J G, \qquad \bar V = \sum_k p_k \, s_k^2 \, V_k

with rows J, r in units of their scatter and G the covariance for independent rows. The estimate is unbiased in any
noise; only its covariance depends on it. Each channel has a noise of its own,

.. math:: V = (1 - a) I + a K, \quad K_{ij} = \rho^{|i - j|}, \qquad
          s^2 = \frac{r^T V^{-1} r}{r_0^T r_0} \quad \text{at the minimum in each noise},

of a probability p that is its prior times the restricted likelihood with the scale integrated out; Q spans the
combinations of columns that the channel itself determines, nu is the number of its rows less those of Q:

.. math:: -2 \ln L = \nu \ln(r^T V^{-1} r) + \ln|V| + \ln|Q^T V^{-1} Q| .

Source: White, *Econometrica* 48 (1980) 817, with the covariance of the noise from Harville, *JASA* 72 (1977) 320.
"""

from __future__ import annotations

from itertools import product

import numpy as np

from gimbalcal.effects.process import GaussMarkov, WhiteNoise
from gimbalcal.inference.coloured import MIN_CHI2, least_squares
from gimbalcal.number import Array

MEMORY = (0.3, 0.6, 0.8, 0.9, 0.96, 0.99)  # from row to row
SHARE = (0.4, 0.9)  # of the variance; the remainder is white
WHITE = (WhiteNoise(1.0),)
NOISES = {
    (rho, a): (WhiteNoise(np.sqrt(1 - a)), GaussMarkov(np.sqrt(a), -1 / np.log(rho)))
    for rho, a in product(MEMORY, SHARE)
}
PRIOR_WHITE = 0.5  # probability that rows do not remember each other
MIN_TIMES = 5.0  # that the rows outlast the memory: a longer one is a constant of this recording
MIN_DOF = 5.0  # of a channel: fewer show no memory
MIN_SHARE = 1e-3  # root of a channel's share of the information; of what it knows less, other channels tell it


def added_by_memory(J: Array, r: Array, G: Array) -> Array:
    """Return what is added to the covariance G (p, p) by the memory of one channel's rows, J (n, p) and r (n,)."""
    n, scale = len(r), np.sqrt(np.diag(G))
    scale = np.where(scale > 0, scale, 1.0)
    size, V = np.linalg.eigh(G / np.outer(scale, scale))
    U, S, _ = np.linalg.svd(J @ (scale[:, None] * V * np.sqrt(np.maximum(size, 0.0))), full_matrices=False)
    Q = U[:, S > MIN_SHARE]
    dof = n - Q.shape[1]
    noises = {(rho, a): noise for (rho, a), noise in NOISES.items() if -np.log(rho) * n > MIN_TIMES}
    if dof < MIN_DOF or not noises or not Q.shape[1]:
        return np.zeros(G.shape)
    fits = [least_squares(np.arange(float(n)), Q, r[:, None], np.ones(n), noise) for noise in (WHITE, *noises.values())]
    chi2 = np.maximum([float(f.chi2[0]) for f in fits], MIN_CHI2)
    ln = -(dof * np.log(chi2) + np.array([f.log_determinant for f in fits])) / 2
    p = np.exp(ln - ln.max()) * np.append(PRIOR_WHITE, np.full(len(noises), (1 - PRIOR_WHITE) / len(noises)))
    X, p, ratio = J @ G, p[1:] / p.sum(), chi2[1:] / chi2[0]
    out = np.zeros(X.shape)
    for (rho, a), weight, s2 in zip(noises, p, ratio, strict=True):
        kernel = rho ** np.arange(n)
        ring = np.concatenate([kernel, [0.0], kernel[:0:-1]])
        KX = np.fft.irfft(np.fft.rfft(ring)[:, None] * np.fft.rfft(X, 2 * n, axis=0), 2 * n, axis=0)[:n]
        out += weight * ((s2 * (1 - a) - 1) * X + s2 * a * KX)
    return np.asarray(X.T @ out)
