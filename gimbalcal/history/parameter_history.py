r"""History of one parameter over the calibrations of a unit: constant or drift, jumps, scatter beyond the sigmas.

Over K calibrations a parameter is a constant or, from three of them on, a line in time (with a step where a
jump explains more than a drift), and a scatter tau beyond the stated sigmas, by repeatability from one switching-on to
the next, such that

.. math:: \sum_k \frac{(x_k - \hat x(t_k))^2}{\sigma_k^2 + \tau^2} = K - q .

Where a line, a step or one outlier explains the whole history, the best of them is taken, with a penalty of 2 ln of the
number of its possible places; each is fitted to all values.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from gimbalcal.earth import SOLAR_DAY, YEAR
from gimbalcal.effects import Parameter
from gimbalcal.number import Array

SIGNIFICANCE = 0.01  # false-alarm probability over all parameters and steps together
MAX_JUMPS = 2  # of one parameter
MIN_VALUES = 4  # to recognise an outlier
CLEAR_SIGMAS = 3.0  # of a change that a new calibration would show


@dataclass(frozen=True, eq=False)
class ParameterHistory:
    """One parameter over the calibrations that hold it: times (k,) [s] since the first, values and sigmas (k,) in SI.

    rate and rate_sigma [SI per s] are NaN where fewer than three calibrations, or no time between them, tell a drift;
    scatter is tau; jumps and outliers are places in `at`, which counts the calibrations, and `sizes` how large each of
    both is, with its sigma; drifts: whether the rate is more than chance makes of so many parameters; due is when it
    will have moved by what is allowed, on the clock of `time`, NaN without a drift.
    """

    parameter: Parameter
    at: tuple[int, ...]
    time: Array
    value: Array
    sigma: Array
    scatter: float
    rate: float
    rate_sigma: float
    jumps: tuple[int, ...]
    outliers: tuple[int, ...]
    sizes: tuple[tuple[float, float], ...]
    drifts: bool
    due: float

    @property
    def moved(self) -> bool:
        """Return whether its changes exceed the sigmas."""
        return bool(self.jumps or self.outliers or self.drifts or self.has_excess_scatter)

    @property
    def has_excess_scatter(self) -> bool:
        """Return whether it varies between calibrations by far more than the sigmas, without a pattern."""
        return bool(self.scatter > CLEAR_SIGMAS * np.median(self.sigma)) and not self.jumps and not self.outliers

    @property
    def clear(self) -> float:
        """Return the largest change between successive calibrations, or the drift, in sigmas."""
        steps = np.abs(np.diff(self.value)) / np.hypot(self.sigma[1:], self.sigma[:-1])
        return float(max(steps.max(), abs(self.rate) / self.rate_sigma if self.rate_sigma > 0 else 0.0))


def parameter_history(
    p: Parameter, at: Sequence[int], time: Array, x: Array, sigma: Array, tried: int, independent: Sequence[bool],
    allowed: float,
) -> ParameterHistory:  # fmt: skip
    """Return the history of a parameter with estimates x (k,) and sigma (k,) [SI] at `time` (k,) [s].

    at: indices of the calibrations; tried: number of steps tested over all parameters; independent (calibrations - 1,):
    whether each calibration is of other recordings than the one before; allowed: allowed change before it is due [SI],
    three sigmas of the last where that is not finite.
    """
    from scipy.special import ndtri

    t = time - time[0]
    clear, sure = (-float(ndtri(SIGNIFICANCE / 2 / n)) for n in (tried, max(1.0, tried / (len(at) - 1))))
    independent_pairs = [all(independent[a:b]) for a, b in pairwise(at)]
    line = len(at) > 2 and np.ptp(t) > SOLAR_DAY  # no drift is estimated within a day
    constant = np.ones((len(t), 1))
    design = np.concatenate([constant, t[:, None] / YEAR], axis=1) if line else constant
    explained = _explained_by_jumps(design, x, sigma, clear, independent_pairs) if len(at) >= MIN_VALUES else None
    if explained is not None:
        jumps, off, shapes = explained
        design = np.concatenate([design, shapes], axis=1)
    else:
        jumps, off = _one_by_one(design, x, sigma, clear, independent_pairs)
        design = _with_step(design, x, sigma, jumps)
    tau, beta, C = _fit_with_scatter(design, x, sigma)
    rate, rate_sigma = (beta[1] / YEAR, float(np.sqrt(C[1, 1])) / YEAR) if line else (np.nan, np.nan)
    drifts = bool(abs(rate) > max(CLEAR_SIGMAS, sure) * rate_sigma)
    if drifts and explained is None:  # what is drift is no jump
        still = np.abs(np.diff(x) - rate * np.diff(t)) / np.hypot(sigma[1:], sigma[:-1])
        jumps = tuple(k for k in jumps if still[k - 1] > clear)
    if len(jumps) > MAX_JUMPS:  # what jumps each time scatters
        jumps = ()
    allowed = allowed if np.isfinite(allowed) else CLEAR_SIGMAS * float(sigma[-1])
    due = float(time[-1] + allowed / abs(rate)) if drifts else np.nan
    if explained is None:
        sizes = _jump_sizes(x, sigma, jumps, off)
    else:
        A = design if drifts or not line else np.delete(design, 1, axis=1)
        sizes = _sizes_of(A, x, sigma, len(jumps) + len(off))
    return ParameterHistory(p, tuple(at), t, x, sigma, tau, rate, rate_sigma, jumps, off, sizes, drifts, due)


def _one_by_one(
    A: Array, x: Array, sigma: Array, clear: float, independent_pairs: Sequence[bool]
) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Return significant jumps between successive values, and outliers, about columns A (k, q)."""
    step = np.abs(np.diff(x)) / np.hypot(sigma[1:], sigma[:-1])
    jumps = tuple(k for k, (s, ok) in enumerate(zip(step, independent_pairs, strict=True), start=1) if ok and s > clear)
    off = _unpredicted_values(A, x, sigma, clear)
    back = {k + 1 for k in jumps if k in off and k + 1 in jumps and (x[k] - x[k - 1]) * (x[k + 1] - x[k]) < 0}
    return tuple(k for k in jumps if not {k, k + 1} & back), off  # there and back again is one value that is off


def _explained_by_jumps(
    A: Array, x: Array, sigma: Array, clear: float, independent_pairs: Sequence[bool]
) -> tuple[tuple[int, ...], tuple[int, ...], Array] | None:
    """Return jumps, outliers and their columns where a line and a few of them explain all; else None.

    A (k, q) are a constant and, where time tells one, a line. One after the other the one is taken that explains most,
    a step or a value from `clear` sigmas on; where more than two of a kind would be taken, none explains it. The first
    and the last value are explained from a step by nothing, and count as one.
    """
    from scipy.special import chdtri

    K = np.arange(len(x))
    where = [k for k, ok in enumerate(independent_pairs, start=1) if ok], K[1:-1].tolist()
    names = [("line", 0)] * (A.shape[1] - 1) + [
        (change, k) for change, at in zip(("jump", "off"), where, strict=True) for k in at
    ]
    shapes = [A[:, 1:], np.array(where[0])[None] <= K[:, None], np.array(where[1])[None] == K[:, None]]
    columns = np.concatenate([np.reshape(s, (len(x), -1)).astype(float) for s in shapes], axis=1)
    least = np.array([CLEAR_SIGMAS**2 if change == "line" else clear**2 for change, _ in names])
    places = np.array([1 if change == "line" else len(where[change == "off"]) for change, _ in names])
    taken: list[int] = []
    while names:
        gain = _chi2_reductions(np.concatenate([A[:, :1], columns[:, taken]], axis=1), columns, x, sigma)
        best = int(np.argmax(np.where(gain > least, gain - 2 * np.log(places), -np.inf)))
        if gain[best] <= least[best]:
            break
        taken.append(best)
        kinds = [names[i][0] for i in taken]
        if max(kinds.count("jump"), kinds.count("off")) > MAX_JUMPS or len(taken) + A.shape[1] > len(x) - 2:
            return None
    residual = _chi2(np.concatenate([A[:, :1], columns[:, taken]], axis=1), x, sigma)
    if residual > chdtri(max(len(x) - 1 - len(taken), 1), SIGNIFICANCE):
        return None
    jumps, off = (sorted(i for i in taken if names[i][0] == change) for change in ("jump", "off"))
    return tuple(names[i][1] for i in jumps), tuple(names[i][1] for i in off), columns[:, [*jumps, *off]]


def _chi2_reductions(A: Array, columns: Array, x: Array, sigma: Array) -> Array:
    """Return the reduction of chi^2 by each of some columns (k, c) besides A (k, q); zero for columns in A."""
    w = 1 / sigma
    Q = np.linalg.qr(A * w[:, None])[0]
    C = columns * w[:, None]
    own, r = C - Q @ (Q.T @ C), w * x - Q @ (Q.T @ (w * x))
    size = (own**2).sum(0)
    constant = size < 1e-12 * (C**2).sum(0)
    return np.asarray(np.where(constant, 0.0, (own.T @ r) ** 2 / np.where(constant, 1.0, size)))


def _sizes_of(A: Array, x: Array, sigma: Array, n: int) -> tuple[tuple[float, float], ...]:
    """Return sizes and sigmas of the last n columns of A (k, q), jumps and outliers."""
    _, beta, C = _fit_with_scatter(A, x, sigma)
    return tuple((float(b), float(np.sqrt(v))) for b, v in zip(beta[-n:], np.diag(C)[-n:], strict=True)) if n else ()


def _jump_sizes(x: Array, sigma: Array, jumps: Sequence[int], off: Sequence[int]) -> tuple[tuple[float, float], ...]:
    """Return sizes and sigmas of jumps, from the values on both sides, and of outliers, from all others."""
    pairs = [((float(x[k - 1]), float(sigma[k - 1])), (float(x[k]), float(sigma[k]))) for k in jumps]
    pairs += [(_weighted_mean(np.delete(x, k), np.delete(sigma, k)), (float(x[k]), float(sigma[k]))) for k in off]
    return tuple((after - before, float(np.hypot(s, t))) for (before, s), (after, t) in pairs)


def _weighted_mean(x: Array, sigma: Array) -> tuple[float, float]:
    """Return the weighted mean of values x (k,) and its sigma."""
    w = sigma**-2
    return float(w @ x / w.sum()), float(1 / np.sqrt(w.sum()))


def _with_step(A: Array, x: Array, sigma: Array, jumps: Sequence[int]) -> Array:
    """Add a step at the best jump to columns A (k, q), where that explains more than a drift."""
    if not 0 < len(jumps) <= MAX_JUMPS or len(x) < A.shape[1] + 2:
        return A
    steps = [(np.arange(len(x)) >= k).astype(float)[:, None] for k in jumps]
    residual = [_chi2(np.concatenate([A[:, :1], s], axis=1), x, sigma) for s in steps]
    if min(residual) >= _chi2(A, x, sigma):
        return A
    return np.concatenate([A, steps[int(np.argmin(residual))]], axis=1)


def _chi2(A: Array, x: Array, sigma: Array) -> float:
    w = 1 / sigma
    Q = np.linalg.qr(A * w[:, None])[0]
    return float((((w * x) - Q @ (Q.T @ (w * x))) ** 2).sum())


def _fit_with_scatter(A: Array, x: Array, sigma: Array) -> tuple[float, Array, Array]:
    """Return tau, estimates and covariance of x (k,) by columns A (k, q), with tau for a chi^2 of its dof."""

    def fit(tau: float) -> tuple[float, Array, Array]:
        w = 1 / np.hypot(sigma, tau)
        Q, R = np.linalg.qr(A * w[:, None])
        beta = np.linalg.solve(R, Q.T @ (w * x))
        inverse = np.linalg.inv(R)
        return float(((w * (x - A @ beta)) ** 2).sum()), beta, inverse @ inverse.T

    dof = len(x) - A.shape[1]
    low, high = 0.0, float(np.ptp(x))
    if dof > 0 and fit(0.0)[0] > dof:
        for _ in range(40):
            middle = (low + high) / 2
            low, high = (middle, high) if fit(middle)[0] > dof else (low, middle)
    else:
        high = 0.0
    return (high, *fit(high)[1:])


def _unpredicted_values(A: Array, x: Array, sigma: Array, clear: float) -> tuple[int, ...]:
    """Return the indices of values that the others do not predict; none below four values."""
    out: list[int] = []
    if len(x) < MIN_VALUES or _chi2(A, x, sigma) < clear**2:  # one value that is off by so much makes it larger
        return ()
    for k in range(len(x)):
        rest = np.arange(len(x)) != k
        tau, beta, C = _fit_with_scatter(A[rest], x[rest], sigma[rest])
        spread = np.sqrt(sigma[k] ** 2 + tau**2 + A[k] @ C @ A[k])
        if abs(x[k] - A[k] @ beta) > clear * spread:
            out.append(k)
    return tuple(out)
