r"""Weights of rows with heavy tails, by Huber's M-estimate of a local level.

.. math:: w_i = \min(1, c \, s / |y_i - p(t_i)|), \qquad \sum_i w_i \, (y_i - p(t_i)) \, t_i^k = 0

with p a polynomial in each group of neighbouring rows, so that smooth variations inside a group do not reduce weights.
Weighted means then have the sigma

.. math:: \sigma = K s \, \frac{\sqrt{E \psi^2}}{E \psi'}, \qquad \psi(u) = \max(-c, \min(c, u))

of a plain mean of white noise (E psi^2 over the degrees of freedom besides p; K is Huber's correction for few rows).
A single row, times the root of its weight, has the variance E w u^2: for tails of Student's t with three degrees of
freedom a tenth more, as rows of little weight have larger errors.

Source: Huber, Annals of Statistics 1 (1973) 799, Eqs. (6.5) and (7.3).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.polynomial.legendre import legvander

from gimbalcal.number import Array

CLIP = 2.0  # Huber's constant in sigmas: 99 % efficient on normal samples
ITERATIONS = 20  # reweightings; the level then moves by less than 1e-3 of its own sigma at any tail
ROWS_PER_TERM = 5  # of a polynomial, so that no outlier bends it to itself
DEGREE = 2


class Weighted(NamedTuple):
    """Weights (n, C) of mean one per channel; sigma (C,) of one row for weighted means, and for single rows."""

    weight: Array
    of_means: Array
    of_rows: Array


def huber_weights(y: Array, group: Array, scale: Array) -> Weighted:
    """Return the weights of rows y (n, C) in groups of neighbours.

    group (n,): ordinal of the group of each row, in order; scale (C,): robust sigma of one row.
    """
    weight, taken = np.ones_like(y), 0
    psi2, wu2, inside = np.zeros((3, y.shape[1]))
    first, size = np.unique(group, return_index=True, return_counts=True)[1:]
    for m in np.unique(size):
        rows = first[size == m][:, None] + np.arange(m)  # (g, m)
        P = _polynomials(int(m))
        r = y[rows] / scale
        w = np.ones_like(r)
        for _ in range(ITERATIONS):
            beta = np.linalg.solve(np.einsum("gmc,mp,mq->gcpq", w, P, P), np.einsum("gmc,mp->gcp", w * r, P)[..., None])
            residual = np.abs(r - np.einsum("mp,gcp->gmc", P, beta[..., 0]))
            w = CLIP / np.maximum(residual, CLIP)
        weight[rows] = w
        psi2 += np.square(w * residual).sum(axis=(0, 1))
        wu2 += (w * residual**2).sum(axis=(0, 1))
        inside += (residual < CLIP).sum(axis=(0, 1))
        taken += len(rows) * P.shape[1]
    n, free = len(y), max(len(y) - taken, 1)
    slope, mean = inside / n, weight.mean(axis=0)
    few = 1 + taken / n * (1 - slope) / slope
    return Weighted(weight / mean, few * scale * np.sqrt(psi2 / free) / slope, scale * np.sqrt(wu2 / free / mean))


def _polynomials(m: int) -> Array:
    """Return Legendre polynomials (m, p) over m rows, as many as these determine."""
    t = np.linspace(-1.0, 1.0, m) if m > 1 else np.zeros(1)
    return np.asarray(legvander(t, max(0, min(DEGREE, m // ROWS_PER_TERM - 1))))
