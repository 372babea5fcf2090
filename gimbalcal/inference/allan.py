r"""Allan variance of readings at rest, and the coefficients of noise with their covariance.

From means :math:`\bar y` over m neighbouring samples, everywhere in every stretch (overlapping),

.. math:: \sigma^2(\tau) = \tfrac12 \langle (\bar y_{k+m} - \bar y_k)^2 \rangle, \quad \tau = m \tau_0, \qquad
          \sigma^2(\tau) = \frac{N^2}{\tau} + \frac{2 \ln 2}{\pi} B^2 + \frac{K^2 \tau}{3}

with white noise N, bias instability B (the floor of the curve is 0.664 B) and random walk K, of spectra N^2,
B^2 / (2 pi f) and (K / 2 pi f)^2. Values at neighbouring tau share their rows: their covariance follows from the
spectra, with z_m the summands of one tau,

.. math:: \mathrm{cov}(\sigma^2_a, \sigma^2_b) = \frac{2}{M_a M_b} \sum_{j, k} c_{ab}^2(j - k), \qquad
          c_{ab}(d) = \frac{1}{2 \pi} \int H_a \bar H_b S \, e^{i \theta d} \, d\theta ,

and weighs the fit of N^2, B^2, K^2, none of which is below zero. Source: IEEE Std 952-1997, Annex C; Percival and
Guttorp, Wavelets in Geophysics (1994) 325, for the covariance.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from gimbalcal.inference.algebra import nonnegative_least_squares
from gimbalcal.number import Array
from gimbalcal.p_value import probability

MIN_ROWS = 32  # of a stretch
MIN_STRETCH_TAUS = 4  # length of a stretch over the longest tau
MIN_SAMPLES_OF_TAU = 8  # to which the shorter tau is thinned to compute a covariance
INDEPENDENT_OCTAVES = 8  # between two tau that are taken as independent (Parzen's taper keeps C positive)
TERMS = 3  # white noise, bias instability, random walk
MIN_LIKELIHOOD_RATIO = 9.0  # of -2 ln likelihood of a coefficient, three sigmas; below, only its limit is stated
MIN_RATIO_OF_MODEL = 4.0  # two sigmas; below, it is omitted: one that is omitted moves the others by as many sigmas
ITERATIONS = 12  # of weights and solution
MIN_TAUS = 4  # of a fit
VIBRATION_SIGMAS = 3.0  # above the law at omitted tau, which a filter does not explain
MAX_FILTER_RATIO = 2.0  # of omitted variances over those behind a filter of one pole
MAX_DISCREPANCY = 3.0  # relative sigma of a variance about the law
DISCREPANCY_STEPS = 14
MIN_P_VALUE = 1e-3  # below, the short tau do not follow the law, behind a filter for instance


class AllanCurve(NamedTuple):
    """Allan variance at tau (P,) [s], from stretches of so many rows at intervals tau_0."""

    tau: Array  # (P,)
    variance: Array  # (P,) square of the unit of the readings
    lengths: Array  # (S,) rows
    step: float  # s


class AllanFit(NamedTuple):
    """N^2, B^2, K^2 (3,) with their covariance (3, 3), zero of one that is not significant; 95 % limits `most` (3,).

    spread (P,): one sigma of each variance of the curve; first: index of the first tau that was used.
    """

    square: Array
    covariance: Array
    most: Array
    spread: Array
    first: int
    chi2: float
    dof: int

    @property
    def p_value(self) -> float:
        """Probability that noise alone leaves at least this chi^2."""
        return probability(self.chi2, self.dof)


def allan_curve(x: Array, stretches: Sequence[slice], step: float) -> AllanCurve:
    """Return the overlapping Allan variance of readings x (n,), one per `step` [s], pooled over stretches."""
    lengths = np.array([s.stop - s.start for s in stretches])
    count = int(np.log2(lengths.max() // MIN_STRETCH_TAUS)) + 1
    squares, number = np.zeros(count), np.zeros(count)
    for s in stretches:
        total = np.concatenate([[0.0], np.cumsum(x[s] - x[s].mean())])
        for k in range(count):
            m = 2**k
            if len(total) <= 2 * m:
                break
            z = (total[2 * m :] - 2 * total[m:-m] + total[: -2 * m]) / m
            squares[k] += z @ z / 2
            number[k] += len(z)
    return AllanCurve(step * 2.0 ** np.arange(count), squares / number, lengths, step)


def allan_law(tau: Array) -> Array:
    """Return the Allan variance (P, 3) of white noise, bias instability and random walk of size one."""
    return np.stack([1 / tau, np.full(len(tau), 2 * np.log(2) / np.pi), tau / 3], axis=-1)


def covariance(c: AllanCurve, square: Array) -> Array:
    """Return the covariance (P, P) of the curve's variances for noise N^2, B^2, K^2 (3,)."""
    return np.asarray(
        np.einsum("abij,i,j->ab", _covariance_forms(tuple(map(int, c.lengths)), c.step, len(c.tau)), square, square)
    )


@lru_cache(maxsize=8)
def _covariance_forms(lengths: tuple[int, ...], step: float, size: int) -> Array:
    """Return the covariances (P, P, 3, 3) as forms of the squares of the noise, which depend on the stretches alone."""
    out = np.zeros((size, size, TERMS, TERMS))
    known, many = np.unique(lengths, return_counts=True)
    for i in range(size):
        for j in range(i, min(size, i + INDEPENDENT_OCTAVES)):
            d = (j - i) / INDEPENDENT_OCTAVES
            overlap = 1 - 6 * d**2 * (1 - d) if d <= 0.5 else 2 * (1 - d) ** 3
            out[i, j] = out[j, i] = overlap * _covariance_form(2**i, 2**j, known, many, step)
    return out


def _covariance_form(a: int, b: int, lengths: Array, many: Array, step: float) -> Array:
    """Return the form (3, 3) of the covariance of the variances at a and b samples, a up to b."""
    block = max(1, a // MIN_SAMPLES_OF_TAU)
    a, b, step = a // block, b // block, block * step
    longest = int(lengths.max()) // block
    n = 1 << int(np.ceil(np.log2(min(16 * b, 2 * longest))))
    angle = 2 * np.pi * np.arange(n // 2 + 1) / n
    angle[0] = 1e-4 / n  # the walk has no power at none, but a limit
    turn = np.exp(-1j * angle)
    H = [(1 - turn**m) ** 2 / ((1 - turn) * m * np.sqrt(2)) for m in (a, b)]
    S = np.stack([np.full(len(angle), 1 / step), 1 / angle, step / angle**2])
    shared = np.fft.irfft(H[0] * H[1].conj() * S, n)
    lag = np.concatenate([np.arange(n // 2 + 1), np.arange(n // 2 + 1 - n, 0)])
    Ma, Mb = (np.maximum(lengths // block - 2 * m + 1, 0) for m in (a, b))
    pairs = np.zeros(n)
    for count, one, other in zip(many, Ma, Mb, strict=True):
        pairs += count * np.maximum(np.minimum(one - np.maximum(lag, 0), other + np.minimum(lag, 0)), 0)
    return np.asarray(2 * (shared * pairs) @ shared.T / (int(many @ Ma) * int(many @ Mb)))


def fit(c: AllanCurve) -> AllanFit:
    """Fit the coefficients of a curve, without short tau that a filter has put below white noise.

    Where nothing follows the law, as no instrument follows three terms over many octaves to a part in a thousand, every
    tau scatters about it by a further share of its variance, the same for all, that the residuals show: the sharply
    determined short tau then do not decide the long ones.
    """
    whole = _fit(c, 0)
    if whole.p_value > MIN_P_VALUE:
        return whole
    for first in range(1, len(c.tau) - MIN_TAUS + 1):
        part = _fit(c, first)
        filtered = part.covariance[0, 0] > 0 and _behind_a_filter(c, allan_law(c.tau) @ part.square, part.spread, first)
        if part.p_value > MIN_P_VALUE and filtered:
            return part
    low, high = 0.0, MAX_DISCREPANCY
    for _ in range(DISCREPANCY_STEPS):
        middle = (low + high) / 2
        wide = _fit(c, 0, middle)
        low, high = (middle, high) if wide.chi2 > wide.dof else (low, middle)
    return _fit(c, 0, high)._replace(chi2=whole.chi2, dof=whole.dof)


def _behind_a_filter(c: AllanCurve, model: Array, spread: Array, first: int) -> bool:
    r"""Return whether the tau before the first one used lie as low below the law as behind a low-pass filter.

    .. math::

        \sigma^2(\tau) = \frac{N^2}{\tau} \left[ 1 - \frac{T}{2 \tau} (3 - 4 e^{-\tau / T} + e^{-2 \tau / T}) \right]

    of one pole, with the time constant T of the longest tau at which less than half is left. A steeper filter leaves
    less still; a curve that goes on rising towards short tau is another noise: white noise far below the law, say, up
    to where something shakes the unit now and then. The sigma of what is left is as small as that itself.
    """
    tau, ratio, sure = c.tau[:first], c.variance[:first] / model[:first], VIBRATION_SIGMAS * spread[:first]
    allowed = np.ones(first)
    if (less := np.flatnonzero(ratio < 0.5)).size:
        x = tau[:, None] / (np.geomspace(1e-2, 1e2, 401) * tau[less[-1]])
        passed = 1 - (3 - 4 * np.exp(-x) + np.exp(-2 * x)) / (2 * x)
        T = int(np.argmin(np.abs(passed[less[-1]] - ratio[less[-1]])))
        allowed = np.minimum(MAX_FILTER_RATIO * passed[:, T], 1.0)
    return bool(np.all(ratio <= allowed * (1 + sure / model[:first])))


def _fit(c: AllanCurve, first: int, discrepancy: float = 0.0) -> AllanFit:
    """Fit tau from `first` on, each with a further relative sigma of its variance."""
    active = [0, 1, 2]
    square, C, surprise = _weighted(c, first, active, discrepancy)
    A = _whitened_rows(c, first, C, active)[0]
    most = square + 1.645 * np.sqrt(np.diag(np.linalg.inv(A.T @ A)))
    while len(active) > 1:
        without = {k: _weighted(c, first, [i for i in active if i != k], discrepancy) for k in active}
        least = min(without, key=lambda k: without[k][2])
        if without[least][2] > surprise + MIN_RATIO_OF_MODEL:
            break
        active.remove(least)
        square, C, surprise = without[least]
    A, y = _whitened_rows(c, first, C, active)
    V = np.zeros((TERMS, TERMS))
    V[np.ix_(active, active)] = np.linalg.inv(A.T @ A)
    for k in active if len(active) > 1 else ():
        if without[k][2] <= surprise + MIN_LIKELIHOOD_RATIO:
            V[k] = V[:, k] = 0.0
    residual = y - A @ square[active]
    return AllanFit(square, V, most, np.sqrt(np.diag(C)), first, float(residual @ residual), len(y) - len(active))


def _weighted(c: AllanCurve, first: int, active: Sequence[int], discrepancy: float) -> tuple[Array, Array, float]:
    """Return squares (3,) weighted with the covariance that they imply, that covariance, and -2 ln likelihood."""
    A = allan_law(c.tau)
    square = np.zeros(TERMS)
    square[list(active)] = nonnegative_least_squares(
        A[first:, active] / c.variance[first:, None], np.ones(len(A) - first)
    )[0]
    for turn in range(ITERATIONS):
        C = covariance(c, square) + np.diag((discrepancy * c.variance) ** 2)
        rows, y = _whitened_rows(c, first, C, active)
        new = np.zeros(TERMS)
        new[list(active)], residual = nonnegative_least_squares(rows, y)
        move = np.max(np.abs(A @ (new - square)) / (A @ square))
        square = new if turn == 0 else (square + new) / 2  # half steps oscillate less
        if move < 1e-3:
            break
    return square, C, residual**2 + float(np.linalg.slogdet(C[first:, first:])[1])


def _whitened_rows(c: AllanCurve, first: int, C: Array, active: Sequence[int]) -> tuple[Array, Array]:
    """Return the law (P, terms) and the curve (P,) whitened by the covariance."""
    L = np.linalg.cholesky(C[first:, first:])
    rows = np.linalg.solve(L, allan_law(c.tau)[first:][:, list(active)])
    return rows, np.linalg.solve(L, c.variance[first:])
