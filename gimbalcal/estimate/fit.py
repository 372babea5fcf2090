r"""Damped Gauss-Newton on linearised rows: estimate, joint covariance, and what the rows do not determine, by name.

.. math:: x_{k+1} = x_k + h \, (\hat x_k - x_k)

with :math:`\hat x_k` the least-squares solution of the rows linearised at x_k. Every linear model of this package takes
h = 1; with a nonlinear constant among the parameters (a time constant, a period) h is halved until chi^2 falls, and the
constant stays within the range that the rows can resolve.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gimbalcal.effects import CATALOGUE, Parameter, Stimulus
from gimbalcal.effects.effect import constants
from gimbalcal.effects.grids import limits
from gimbalcal.inference.information import MIN_SIGNAL_TO_NOISE, Information, Solution, prior, solve
from gimbalcal.number import Array

MAX_STEPS = 30  # 1 arcsec takes 3, 3 degrees 5, a time constant from the next value of its grid 6
MIN_DAMPING = 2.0**-10  # of a step: a shorter one that still raises chi^2 is rounding
TOLERANCE = 1e-3  # sigmas by which the last step may move an estimate
ROUNDING_OF_CHI2 = 1e-9  # share of chi^2 by which rounding may raise it

Linearise = Callable[[Array], Information]
"""Information about all parameters from rows that are linearised at x (p,)."""


@dataclass(frozen=True, eq=False)
class Minimum:
    """The solution of the rows that were linearised last, and the number of steps; 0 where it did not converge."""

    solution: Solution
    steps: int


def gauss_newton(
    linearise: Linearise,
    start: Array,
    bounds: Array | None = None,
    *,
    seen: float = MIN_SIGNAL_TO_NOISE,
    limit: int = MAX_STEPS,
    arrived: Callable[[Array, Array, Solution], bool] | None = None,
    diverged: Callable[[Array], bool] | None = None,
) -> Minimum:
    """Iterate the solution of the linearised rows from `start` (p,) until a step no longer matters.

    bounds (2, p): least and greatest value of each parameter, see `range_of_constants`; None for a model without
    nonlinear constants, whose steps are not damped. seen: as in `solve`. arrived(x, new x, solution): whether a step
    was small enough (default: `TOLERANCE` sigmas); diverged(x): whether to give up.
    """
    arrived = arrived or _small_step
    x, info = start, linearise(start)
    for step in range(1, limit + 1):
        solution = solve_about(info, x, bounds, seen)
        target = solution.x
        if arrived(x, target, solution):
            return Minimum(solution, step)
        if step == limit or (diverged is not None and diverged(target)):
            break
        if bounds is None:
            x, info = target, linearise(target)
        else:
            x, info = _damped(linearise, info, x, target, bounds, seen)
    return Minimum(solution, 0)


def solve_about(
    info: Information, x: Array, bounds: Array | None = None, seen: float = MIN_SIGNAL_TO_NOISE
) -> Solution:
    r"""Return the solution of rows that are linearised at x (p,), nonlinear constants within their bounds (2, p).

    .. math:: \delta c = \left[ (1 - U U^T) R_c \right]^+ (1 - U U^T) z

    is the step of the constants, with U the directions of the rows R that the linear parameters take up (variable
    projection after Kaufman, BIT 15, 1975); these are then solved with the constants held. Directions that the rows do
    not determine are left out on the way alike, and what the rows do not say of a constant leaves it where it is. The
    covariance is that of all parameters together.
    """
    solution = solve(info, seen)
    if bounds is None:
        return solution
    constant = np.isfinite(bounds[0])
    mean, scale = prior(info.parameters)
    R, at = info.rows[:, :-1], ((x - mean) / scale)[constant]
    U, S, _ = np.linalg.svd(R[:, ~constant], full_matrices=False)
    U = U[:, seen <= S]
    free = np.column_stack([R[:, constant], info.rows[:, -1] - R[:, constant] @ at])
    free -= U @ (U.T @ free)
    V, size, Wt = np.linalg.svd(free[:, :-1], full_matrices=False)
    step = Wt.T @ (np.where(size >= seen, 1 / np.maximum(size, seen), 0.0) * (V.T @ free[:, -1]))
    c = np.clip(x[constant] + scale[constant] * step, *bounds[:, constant])
    target = _conditional(info, c, constant, seen)
    return replace(solution, x=target, chi2=chi2(info, target))


def _conditional(info: Information, c: Array, constant: NDArray[np.bool_], seen: float) -> Array:
    """The solution x (p,) with the constants held at c."""
    out = np.zeros(len(constant))
    held = {p: float(v) for p, v in zip(np.array(info.parameters, dtype=object)[constant], c, strict=True)}
    out[constant], out[~constant] = c, solve(info.at(held), seen).x
    return out


def range_of_constants(wanted: Sequence[Parameter], *stimuli: Stimulus) -> Array | None:
    """Least and greatest value (2, p) of each parameter that any of these rows resolve; None without constants."""
    fields = {(p.effect, f.name): f for p in wanted for f in constants(CATALOGUE[p.effect])}
    each = [(p.effect, p.field) for p in wanted]
    if not any(key in fields for key in each):
        return None
    free = (-np.inf, np.inf)
    ranges = [[limits(fields[k], s) if k in fields else free for k in each] for s in stimuli]
    return np.stack([np.min(ranges, axis=0)[:, 0], np.max(ranges, axis=0)[:, 1]])


def chi2(info: Information, x: Array) -> float:
    """Sum of squares of the rows at parameters x (p,), as far as they are linear."""
    mean, scale = prior(info.parameters)
    return float(np.sum((info.rows[:, -1] - info.rows[:, :-1] @ ((x - mean) / scale)) ** 2))


def _small_step(x: Array, target: Array, solution: Solution) -> bool:
    return bool(np.all(np.abs(target - x) <= TOLERANCE * solution.sigma))


def _damped(
    linearise: Linearise, info: Information, x: Array, target: Array, bounds: Array, seen: float
) -> tuple[Array, Information]:
    """A step of the constants towards the target, halved until chi^2 does not rise, and the rows where it ends.

    Everything that is linear follows its constants (variable projection): a curved valley costs no steps.
    """
    before, h, constant = chi2(info, x), 1.0, np.isfinite(bounds[0])
    while True:
        new = np.where(constant, x + h * (target - x), target)
        there = linearise(new)
        new = _conditional(there, new[constant], constant, seen)
        if chi2(there, new) <= before * (1 + ROUNDING_OF_CHI2) or h <= MIN_DAMPING:
            return new, linearise(new)
        h /= 2
