"""Levenberg-Marquardt for many small problems at once, as arrays over runs of the same design."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields

import numpy as np

from gimbalcal.number import Array

MIN_RELATIVE_SINGULAR_VALUE = 1e-9  # of columns of length one, of a regular matrix
REJECTED_STEP_DAMPING = 1e-3  # at least, after a rejected step

Model = Callable[[Array, Array], tuple[Array, Array]]
"""(x (r, p), indices of the runs (r,)) to residuals (r, m) and Jacobians (r, m, p)."""


@dataclass(frozen=True)
class LeastSquaresMinimum:
    """Minima of r runs: x (r, p), half the sum of squares (r,), Jacobian (r, m, p), steps (r,), convergence (r,)."""

    x: Array
    cost: Array
    jacobian: Array
    steps: Array
    converged: Array

    def better(self, other: LeastSquaresMinimum) -> LeastSquaresMinimum:
        """Return, run by run, the one with the smaller cost."""
        first = self.cost <= other.cost

        def pick(mine: Array, theirs: Array) -> Array:
            return np.where(first.reshape(-1, *[1] * (mine.ndim - 1)), mine, theirs)

        return LeastSquaresMinimum(*(pick(getattr(self, f.name), getattr(other, f.name)) for f in fields(self)))


def minimise(
    model: Model, x0: Array, tolerance: float = 1e-11, limit: int = 60, gain: float = 0.0, damping: float = 1e-3
) -> LeastSquaresMinimum:
    r"""Minimise the sums of squares of many runs from x0 (r, p), by damped Gauss-Newton steps.

    .. math:: \Delta x = -(J^T J + \lambda\, \mathrm{diag}(J^T J))^{-1} J^T r

    Wang et al. (2019), Eq. (40), solved by QR so that the condition number is not squared. A run has converged when its
    step is below `tolerance` of its length plus one, or lowers the cost by less than the share `gain` of it;
    parameters should be scaled to order one by the caller. `damping` is lambda at the start: less where the model is
    nearly linear; a step that is refused says that it is not.
    """
    x, runs = np.array(x0, dtype=float), np.arange(len(x0))
    r, J = model(x, runs)
    cost = (r**2).sum(-1) / 2
    lam, steps, live = np.full(len(x), damping), np.zeros(len(x), dtype=int), np.ones(len(x), dtype=bool)
    for _ in range(limit):
        a = np.flatnonzero(live)
        if a.size == 0:
            break
        step = _step(r[a], J[a], lam[a])
        r1, J1 = model(x[a] + step, runs[a])
        cost1 = (r1**2).sum(-1) / 2
        small = np.linalg.norm(step, axis=-1) < tolerance * (1 + np.linalg.norm(x[a], axis=-1))
        good = cost1 <= cost[a]
        small |= good & (cost[a] - cost1 < gain * cost[a])
        hit = a[good]
        x[hit], r[hit], J[hit], cost[hit] = (x[a] + step)[good], r1[good], J1[good], cost1[good]
        lam[a] = np.where(good, lam[a] / 10, np.maximum(lam[a] * 10, REJECTED_STEP_DAMPING))
        steps[a] += 1
        # a refused step that is already below the rounding of the cost is arrival, not failure
        live[a] = ~small & (lam[a] < 1e12)
    return LeastSquaresMinimum(x, cost, J, steps, ~live)


def _step(r: Array, J: Array, damping: Array) -> Array:
    """Return the step of Eq. (40) for each run: least squares of [J; sqrt(lambda) D] against [-r; 0]."""
    size = np.sqrt((J**2).sum(-2))
    size = np.where(size > 0, size, 1.0)
    p = J.shape[-1]
    rows = np.concatenate([J / size[:, None, :], np.sqrt(damping)[:, None, None] * np.eye(p)], axis=-2)
    Q, R = np.linalg.qr(rows)
    right = -np.swapaxes(Q[:, : r.shape[-1]], -1, -2) @ r[..., None]
    return np.asarray(np.linalg.solve(R, right)[..., 0] / size)


def covariance_at_minimum(J: Array) -> Array:
    """Return the covariance (r, p, p) of whitened Jacobians (r, m, p) at the minimum; infinite where singular."""
    size = np.sqrt((J**2).sum(-2))
    size = np.where(size > 0, size, 1.0)
    _, S, Vt = np.linalg.svd(J / size[:, None, :], full_matrices=False)
    with np.errstate(divide="ignore"):
        inverse = np.where(MIN_RELATIVE_SINGULAR_VALUE * S[:, :1] < S, 1 / S, np.inf)
    with np.errstate(invalid="ignore"):
        half = np.swapaxes(Vt, -1, -2) * inverse[:, None, :]
        half = np.where(np.isnan(half), 0.0, half) / size[..., None]  # 0 x inf: the direction does not touch it
        return np.asarray(half @ np.swapaxes(half, -1, -2))
