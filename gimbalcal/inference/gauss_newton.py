r"""Damped Gauss-Newton on linearised rows: the estimate with its joint covariance.

.. math:: x_{k+1} = x_k + h \, (\hat x_k - x_k)

with :math:`\hat x_k` the least-squares solution of the rows linearised at x_k. Every linear model of this package takes
h = 1; with a nonlinear constant among the parameters (a time constant, a period) h is halved until chi^2 falls, from
four times that of the step before on, and the constant stays within the range that the rows can resolve. After a short
step by which chi^2 hardly falls, the tolerance is that of late steps, since rounding may be all that is left. After
several of them in a row the iteration ends without having converged: the model does not describe such rows, as those of
an angle of the wrong sign.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gimbalcal.inference.information import Information, Solution, prior, solve
from gimbalcal.number import Array

MAX_STEPS = 30  # 1 arcsec takes 3, 3 degrees 5, a time constant from the next value of its grid 6
MAX_QUADRATIC_STEPS = 10  # after which a step that lowers chi^2 by no more than rounding is the last
GROWTH_OF_DAMPING = 4.0  # of the share h from one step to the first trial of the next
MIN_DAMPING = 2.0**-10  # of a step: a shorter one that still raises chi^2 is rounding
AT_END = 1e-9  # share of the range of a constant: nearer to an end it is there
ROUNDING_OF_CHI2 = 1e-9  # share of chi^2 by which rounding may raise it
SHORT_STEP = 2.0**-5  # share of a step: a shorter one follows rows that bend far more than their derivatives say
MIN_FALL = 1e-3  # of chi^2 by a short step
MAX_STALLED_STEPS = 3  # short steps in a row by which chi^2 falls less

Linearise = Callable[[Array], Information]
"""Information about all parameters from rows that are linearised at x (p,)."""


@dataclass(frozen=True, eq=False)
class Minimum:
    """Where an iteration ended: the information of the rows linearised last, at x (p,), and its solution.

    steps: how many it took; 0 where it did not converge.
    """

    solution: Solution
    x: Array
    information: Information
    steps: int


def gauss_newton(
    linearise: Linearise, x: Array, bounds: Array | None, seen: float, damped: bool,
    arrived: Callable[[int, Array, Solution], bool], diverged: Callable[[Array], bool],
) -> Minimum:  # fmt: skip
    """Return the minimum that is reached from x (p,) on.

    bounds (2, p): least and greatest value of each parameter, see `views.core.range_of_constants`; None for a model
    without nonlinear constants, whose steps are halved where they raise chi^2 only if `damped`. seen: as in `solve`.
    arrived(ordinal, x, solution): whether the step from x was small enough, which after `MAX_QUADRATIC_STEPS` may mean
    less; diverged(x): whether to give up.
    """
    info = linearise(x)
    if damped or bounds is not None:  # else every step that returns what rows do not determine to its prior is halved
        start, x = x, _undetermined_at_prior(info, x, bounds, seen)
        info = info if x is start else linearise(x)
    stalled, h = 0, 1.0
    for step in range(1, MAX_STEPS + 1):
        solution = solve_about(info, x, bounds, seen)
        # after a short step that gained nothing, convergence is no longer quadratic either
        ordinal = step + MAX_QUADRATIC_STEPS * (stalled > 0)
        if arrived(ordinal, x, solution) or (ordinal > MAX_QUADRATIC_STEPS and _is_rounding(info, x, solution.x)):
            return Minimum(solution, x, info, step)
        if step == MAX_STEPS or stalled == MAX_STALLED_STEPS or diverged(solution.x):
            break
        if damped or bounds is not None:
            before = chi2(info, x)
            x, info, h = _damped_step(linearise, info, x, solution.x, bounds, seen, min(1.0, GROWTH_OF_DAMPING * h))
            stalled = stalled + 1 if h < SHORT_STEP and chi2(info, x) > (1 - MIN_FALL) * before else 0
        else:
            x, info = solution.x, linearise(solution.x)
    return Minimum(solution, x, info, 0)


def solve_about(info: Information, x: Array, bounds: Array | None, seen: float) -> Solution:
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
    room = (bounds[:, constant] - x[constant]) / scale[constant]
    c = x[constant] + scale[constant] * _step_within(room, free[:, :-1], free[:, -1], seen)
    target = _conditional_solution(info, np.clip(c, *bounds[:, constant]), constant, seen)
    return replace(solution, x=target, chi2=chi2(info, target))


def _step_within(room: Array, A: Array, z: Array, seen: float) -> Array:
    """Return the step (q,) of constants that solves A step = z by least squares, within the room (2, q) to their ends.

    A (R, q) and z (R,) are in units of noise; seen: as in `solve`. A constant that is at its end and would leave it
    stays there, and the others are solved without it. The step is then shortened as a whole: chi^2 falls in its
    direction, and need not do so where each constant is clipped by itself.
    """
    moves = np.ones(A.shape[1], dtype=bool)
    while True:
        V, size, Wt = np.linalg.svd(A[:, moves], full_matrices=False)
        step = np.zeros(len(moves))
        step[moves] = Wt.T @ (np.where(size >= seen, 1 / np.maximum(size, seen), 0.0) * (V.T @ z))
        end = np.where(step < 0, *room)
        leaves = moves & (step != 0) & (np.abs(end) <= AT_END * np.ptp(room, axis=0))
        if not leaves.any():
            break
        moves &= ~leaves
    share = np.divide(end, step, out=np.ones_like(step), where=step != 0)
    return step * min(1.0, float(share.min(initial=1.0)))


def _conditional_solution(info: Information, c: Array, constant: NDArray[np.bool_], seen: float) -> Array:
    """The solution x (p,) with the constants held at c."""
    out = np.zeros(len(constant))
    known = {p: float(v) for p, v in zip(np.array(info.parameters, dtype=object)[constant], c, strict=True)}
    out[constant], out[~constant] = c, solve(info.at(known), seen).x
    return out


def chi2(info: Information, x: Array) -> float:
    """Sum of squares of the rows at parameters x (p,), as far as they are linear."""
    mean, scale = prior(info.parameters)
    return float(np.sum((info.rows[:, -1] - info.rows[:, :-1] @ ((x - mean) / scale)) ** 2))


def _is_rounding(info: Information, x: Array, target: Array) -> bool:
    """Return whether a step from x to a target (p,) lowers chi^2 by no more than the rounding of its rows does.

    Rows of numbers that were made without noise hold nothing else about what they do not determine.
    """
    before = chi2(info, x)
    rounding = float(np.finfo(float).eps * info.count**0.5 * np.linalg.norm(info.rows[:, -1]))
    return before - chi2(info, target) <= (2 * before**0.5 + rounding) * rounding


def _damped_step(
    linearise: Linearise, info: Information, x: Array, target: Array, bounds: Array | None, seen: float, h: float
) -> tuple[Array, Information, float]:
    """Return where a step h towards the target ends that is halved until chi^2 does not rise, the rows there, and h.

    Of a model with constants these alone take the step, and everything that is linear follows them (variable
    projection): a curved valley costs no steps.
    """
    before = chi2(info, x)
    constant = np.ones(len(x), dtype=bool) if bounds is None else np.isfinite(bounds[0])
    while True:
        new = np.where(constant, x + h * (target - x), target)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):  # a step may leave the range of a model
            there = linearise(new)
        finite = bool(np.isfinite(there.rows).all())
        if finite and bounds is not None:
            new = _conditional_solution(there, new[constant], constant, seen)
        if finite and (chi2(there, new) <= before * (1 + ROUNDING_OF_CHI2) or h <= MIN_DAMPING):
            return new, there if bounds is None else linearise(new), h
        if h <= MIN_DAMPING:
            return x, info, h
        h /= 2


def _undetermined_at_prior(info: Information, x: Array, bounds: Array | None, seen: float) -> Array:
    """Return x (p,) with those directions of the linear parameters at their prior that the rows do not determine."""
    mean, scale = prior(info.parameters)
    linear = np.ones(len(x), dtype=bool) if bounds is None else ~np.isfinite(bounds[0])
    _, S, Vt = np.linalg.svd(info.rows[:, :-1][:, linear], full_matrices=False)
    if linear.sum() == np.count_nonzero(seen <= S):
        return x
    kept, out = Vt[seen <= S], (x - mean) / scale
    out[linear] = kept.T @ (kept @ out[linear])
    return np.asarray(mean + scale * out)
