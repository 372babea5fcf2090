r"""The course of one parameter over the calibrations of a unit: constant or a drift, jumps, scatter beyond the sigmas.

Over K calibrations a parameter is a constant or, from three of them on, a line in time (with a step where a
jump explains more than a drift), and a scatter tau beyond the stated sigmas, as a unit is never twice the same after it
was switched off, found so that

.. math:: \sum_k \frac{(x_k - \hat x(t_k))^2}{\sigma_k^2 + \tau^2} = K - q .
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from gimbalcal.effects import Parameter
from gimbalcal.number import Array

YEAR, DAY = 365.25 * 86400.0, 86400.0  # s; within a day no drift is told
SURPRISE = 0.01  # chance, over all parameters and steps together, that a difference is called a jump where none is
MOST_JUMPS = 2  # of one parameter
FEWEST = 4  # values, of which one can be off the others
CLEAR = 3.0  # sigmas by which a drift is called one, and a change that a new calibration would show


@dataclass(frozen=True, eq=False)
class Course:
    """One parameter over the calibrations that hold it: times (k,) [s] since the first, values and sigmas (k,) in SI.

    rate and rate_sigma [SI per s] are NaN where fewer than three calibrations, or no time between them, tell a drift;
    scatter is tau; jumps and outliers are places in `at`, which counts the calibrations; due is when it will have
    moved by what is allowed, on the clock of `time`, NaN without a drift.
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
    due: float

    @property
    def drifts(self) -> bool:
        """Whether the drift stands clear of its sigma."""
        return bool(abs(self.rate) > CLEAR * self.rate_sigma)

    @property
    def moved(self) -> bool:
        """Whether it did anything that its sigmas do not allow."""
        return bool(self.jumps or self.outliers or self.drifts or self.scatters)

    @property
    def scatters(self) -> bool:
        """Whether it varies from calibration to calibration by far more than the sigmas say, without a pattern."""
        return bool(self.scatter > CLEAR * np.median(self.sigma)) and not self.jumps and not self.outliers

    @property
    def clear(self) -> float:
        """The largest change from one calibration to the next, or the drift, in sigmas."""
        steps = np.abs(np.diff(self.value)) / np.hypot(self.sigma[1:], self.sigma[:-1])
        return float(max(steps.max(), abs(self.rate) / self.rate_sigma if self.rate_sigma > 0 else 0.0))


def course(
    p: Parameter, at: Sequence[int], time: Array, x: Array, sigma: Array, tried: int, independent: Sequence[bool],
    allowed: float,
) -> Course:  # fmt: skip
    """The course of a parameter whose estimates x (k,) with sigma (k,) [SI] were made at `time` (k,) [s].

    at: which calibrations these are; tried: how many steps are looked at in all parameters together; independent
    (calibrations - 1,): whether each calibration is of other recordings than the one before; allowed: how far it may
    move before it is due [SI], three sigmas of the last where that is not finite.
    """
    from scipy.special import ndtri

    t = time - time[0]
    clear = -float(ndtri(SURPRISE / 2 / tried))
    step = np.abs(np.diff(x)) / np.hypot(sigma[1:], sigma[:-1])
    apart = [all(independent[a:b]) for a, b in pairwise(at)]
    jumps = tuple(k for k, (s, ok) in enumerate(zip(step, apart, strict=True), start=1) if ok and s > clear)
    line = len(at) > 2 and np.ptp(t) > DAY
    design = np.stack([np.ones(len(t)), t / YEAR], axis=1) if line else np.ones((len(t), 1))
    off = _outliers(design, x, sigma, clear)
    back = {k + 1 for k in jumps if k in off and k + 1 in jumps and (x[k] - x[k - 1]) * (x[k + 1] - x[k]) < 0}
    jumps = tuple(k for k in jumps if not {k, k + 1} & back)  # there and back again is one value that is off
    design = _with_step(design, x, sigma, jumps)
    tau, beta, C = _fitted(design, x, sigma)
    rate, rate_sigma = (beta[1] / YEAR, float(np.sqrt(C[1, 1])) / YEAR) if line else (np.nan, np.nan)
    if line and abs(rate) > CLEAR * rate_sigma:  # what is drift is no jump
        still = np.abs(np.diff(x) - rate * np.diff(t)) / np.hypot(sigma[1:], sigma[:-1])
        jumps = tuple(k for k in jumps if still[k - 1] > clear)
    if len(jumps) > MOST_JUMPS:  # what jumps each time scatters
        jumps = ()
    allowed = allowed if np.isfinite(allowed) else CLEAR * float(sigma[-1])
    due = float(time[-1] + allowed / abs(rate)) if line and abs(rate) > CLEAR * rate_sigma else np.nan
    return Course(p, tuple(at), t, x, sigma, tau, rate, rate_sigma, jumps, off, due)


def _with_step(A: Array, x: Array, sigma: Array, jumps: Sequence[int]) -> Array:
    """Columns A (k, q) with a step at the jump that leaves least, where that explains more than a drift does."""
    if not 0 < len(jumps) <= MOST_JUMPS or len(x) < A.shape[1] + 2:
        return A
    steps = [(np.arange(len(x)) >= k).astype(float)[:, None] for k in jumps]
    left = [_chi2(np.concatenate([A[:, :1], s], axis=1), x, sigma) for s in steps]
    if min(left) >= _chi2(A, x, sigma):
        return A
    return np.concatenate([A, steps[int(np.argmin(left))]], axis=1)


def _chi2(A: Array, x: Array, sigma: Array) -> float:
    w = 1 / sigma
    Q = np.linalg.qr(A * w[:, None])[0]
    return float((((w * x) - Q @ (Q.T @ (w * x))) ** 2).sum())


def _fitted(A: Array, x: Array, sigma: Array) -> tuple[float, Array, Array]:
    """tau, estimates and their covariance of x (k,) by columns A (k, q), such that chi^2 is its degrees of freedom."""

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


def _outliers(A: Array, x: Array, sigma: Array, clear: float) -> tuple[int, ...]:
    """Places of values that the others, by themselves consistent, do not predict; none below four values."""
    out: list[int] = []
    if len(x) < FEWEST or _chi2(A, x, sigma) < clear**2:  # one value that is off by so much makes it larger
        return ()
    for k in range(len(x)):
        rest = np.arange(len(x)) != k
        tau, beta, C = _fitted(A[rest], x[rest], sigma[rest])
        spread = np.sqrt(sigma[k] ** 2 + tau**2 + A[k] @ C @ A[k])
        if abs(x[k] - A[k] @ beta) > clear * spread:
            out.append(k)
    return tuple(out)
