r"""Damped Gauss-Newton on linearised rows: estimate, joint covariance, and what the rows do not determine, by name.

.. math:: x_{k+1} = x_k + h \, (\hat x_k - x_k)

with :math:`\hat x_k` the least-squares solution of the rows linearised at x_k. Every linear model of this package takes
h = 1; with a nonlinear constant among the parameters (a time constant, a period) h is halved until chi^2 falls, and the
constant stays within the range that the rows can resolve.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gimbalcal.effects import CATALOGUE, Effect, Parameter, Stimulus, values, with_values
from gimbalcal.effects.effect import constants
from gimbalcal.effects.grids import limits
from gimbalcal.estimate.extra_effects import Cost, columns_of_sizes
from gimbalcal.inference.information import MIN_SIGNAL_TO_NOISE, Information, Solution, information, prior, solve
from gimbalcal.number import Array
from gimbalcal.views.core import View

MAX_STEPS = 30  # 1 arcsec takes 3, 3 degrees 5, a time constant from the next value of its grid 6
MIN_DAMPING = 2.0**-10  # of a step: a shorter one that still raises chi^2 is rounding
TOLERANCE = 1e-3  # sigmas by which the last step may move an estimate
ROUNDING_OF_CHI2 = 1e-9  # share of chi^2 by which rounding may raise it
MAX_SCALE_ROUNDS = 8  # fits, each in the noise that the one before leaves
SCALE_TOLERANCE = 1e-6  # relative change of the excess sigma at which the rounds end
SIGNIFICANT_EXCESS = 3.0  # sigmas of chi^2 above its degrees of freedom, below which the known noise explains the rows
MIN_RELATIVE_SIGNAL = 1e-8  # singular value over the largest, below which rounding speaks

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
    damped: bool = False,
) -> Minimum:
    """Iterate the solution of the linearised rows from `start` (p,) until a step no longer matters.

    bounds (2, p): least and greatest value of each parameter, see `range_of_constants`; None for a model without
    nonlinear constants, whose steps are not damped. seen: as in `solve`. arrived(x, new x, solution): whether a step
    was small enough (default: `TOLERANCE` sigmas); diverged(x): whether to give up; damped: halve steps that raise
    chi^2 without nonlinear constants, too.
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
            x, info = _halved(linearise, info, x, target) if damped else (target, linearise(target))
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


@dataclass(frozen=True, eq=False)
class ViewsFit:
    """Fit of views that share all parameters: effects with the estimates, and the solution.

    excess: sigma [SI] beyond the known noise of the rows, in units of `NoiseModel.parts_of_variance`; steps: 0 where
    the fit did not converge; min_signal: as in `solve`.
    """

    views: tuple[View, ...]
    absent: tuple[Effect, ...]  # the effects that the fit began with, before their parameters were estimated
    effects: tuple[Effect, ...]
    solution: Solution
    excess: float
    steps: int
    min_signal: float = MIN_SIGNAL_TO_NOISE

    @property
    def sigma(self) -> tuple[Array, ...]:
        """One sigma (n, C) of each row, SI."""
        return tuple(_sigma(v, self.excess) for v in self.views)

    @cached_property
    def residual(self) -> tuple[Array, ...]:
        """Read minus predicted (n, C), SI."""
        return tuple(v.evaluate(self.effects).residual for v in self.views)

    @cached_property
    def whitened(self) -> tuple[Array, Array]:
        """Jacobian (q, p) and misfit (q,) of all rows about the estimate, in units of their noise."""
        return whitened(self.views, self.effects, self.solution.parameters, self.excess)

    def cost_of_sizes(self, sizes: Sequence[Parameter]) -> Cost:
        """Return chi^2 as a function of absent effects whose `sizes` are free in addition to what was fitted."""
        J, r = self.whitened
        rows = [(v.evaluate(self.effects), sigma[..., None]) for v, sigma in zip(self.views, self.sigma, strict=True)]
        wanted, r = (*self.solution.parameters, *sizes), r + J @ self.solution.x

        def cost(effects: Sequence[Effect]) -> float:
            parts = (columns_of_sizes(each, effects, sizes) / sigma for each, sigma in rows)
            X = np.concatenate([J, np.concatenate([part.reshape(-1, len(sizes)) for part in parts])], axis=1)
            return solve(information(X, r, wanted), self.min_signal).chi2

        return cost


@dataclass(frozen=True, eq=False)
class Others:
    """What other recordings tell of parameters: information linearised at effects, and what their rows experienced."""

    about: Callable[[Sequence[Effect]], Information]
    stimuli: tuple[Stimulus, ...]


def fit(
    views: Sequence[View], wanted: Sequence[Parameter], absent: Sequence[Effect] = (), start: Array | None = None, *,
    min_signal: float = MIN_SIGNAL_TO_NOISE, min_excess: float = 0.0, others: Others | None = None,
) -> ViewsFit:  # fmt: skip
    r"""Fit parameters that all views share, and the excess of their noise where it is not stated.

    .. math:: \sum_i \frac{r_i^2}{\sigma_i^2 + w_i \sigma_e^2} = \nu

    determines the excess sigma_e of rows with a known variance sigma_i^2 (that of their samples, or zero), nu being
    the degrees of freedom; a known noise is only widened where chi^2 is not due to chance. absent: effects that the
    fit begins with, their constants among them; start (p,): where the iteration begins (default: at these effects).
    others: what other recordings tell, as a function of the effects; their parameters come first.
    """
    every = tuple(wanted) if others is None else tuple(dict.fromkeys((*others.about(absent).parameters, *wanted)))
    bounds = range_of_constants(every, *(v.stimulus for v in views), *(others.stimuli if others else ()))
    x = values(absent, every) if start is None else start
    names = views[0].stimulus.axis_names
    shapes = [(len(v), len(v.channels)) for v in views]
    parts = [v.noise.parts_of_variance(shape) for v, shape in zip(views, shapes, strict=True)]
    known, shape = (np.concatenate([part[k].ravel() for part in parts]) for k in (0, 1))

    def about(x: Array, excess: float) -> Information:
        effects = with_values(absent, every, x, names)
        info = information_of(views, effects, wanted, excess)
        return info if others is None else others.about(effects) + info

    def widened(x: Array, excess: float) -> float:
        """Return the excess that the rows leave if nothing holds the parameters."""
        if not np.any(shape > 0):
            return excess
        J, r = whitened(views, with_values(absent, every, x, names), wanted, excess)
        unit = J / (np.linalg.norm(J, axis=0) + 1e-300)
        best, _, rank, _ = np.linalg.lstsq(unit, r, rcond=MIN_RELATIVE_SIGNAL)
        r, dof, free = r - unit @ best, len(r) - int(rank), shape > 0
        if excess == 0 and r @ r <= dof + SIGNIFICANT_EXCESS * np.sqrt(2 * dof):
            return excess
        w = np.where(free, shape, 1.0)
        own = np.where(free, known / w, np.inf)
        return max(excess_sigma(r * np.sqrt((known + shape * excess**2) / w), own, max(dof, 1)), min_excess)

    excess = 0.0 if known.all() else widened(x, 1.0)
    for _ in range(MAX_SCALE_ROUNDS):
        found = gauss_newton(lambda x: about(x, excess), x, bounds, seen=min_signal, damped=True)  # noqa: B023
        x, new = found.solution.x, widened(found.solution.x, excess)
        if not found.steps or abs(new - excess) <= SCALE_TOLERANCE * excess:
            break
        excess = new
    effects = with_values(absent, every, x, names)
    return ViewsFit(tuple(views), tuple(absent), effects, found.solution, excess, found.steps, min_signal)


def information_of(
    views: Sequence[View], effects: Sequence[Effect], wanted: Sequence[Parameter], excess: float = 0.0
) -> Information:
    """Return the information of views about the wanted parameters, linearised at effects; values are full ones."""
    J, r = whitened(views, effects, wanted, excess)
    return information(J, r + J @ values(effects, wanted), wanted)


def whitened(
    views: Sequence[View], effects: Sequence[Effect], wanted: Sequence[Parameter], excess: float = 0.0
) -> tuple[Array, Array]:
    """Return Jacobian (q, p) and misfit (q,) of the rows of views about effects, in units of their noise."""
    J, r = [], []
    for v in views:
        rows, sigma = v.evaluate(effects), _sigma(v, excess)
        J.append((rows.jacobian(wanted) / sigma[..., None]).reshape(-1, len(wanted)))
        r.append((rows.residual / sigma).ravel())
    return np.concatenate(J), np.concatenate(r)


def _sigma(v: View, excess: float) -> Array:
    known, shape = v.noise.parts_of_variance((len(v), len(v.channels)))
    return np.asarray(np.sqrt(known + shape * excess**2))


def excess_sigma(r: Array, own: Array, dof: int) -> float:
    """Return the excess sigma at which the sum of r^2 / (own + excess^2) is dof; 0 where the variance `own` explains r.

    Rows of infinite variance take no part.
    """
    if not np.any(own):
        return float(np.sqrt((r**2).sum() / dof))
    low, high = 0.0, float(np.sqrt((r**2).sum()))
    for _ in range(60):
        mid = (low + high) / 2
        low, high = (mid, high) if (r**2 / (own + mid**2)).sum() > dof else (low, mid)
    return high if (r**2 / own).sum() > dof else 0.0


def _small_step(x: Array, target: Array, solution: Solution) -> bool:
    return bool(np.all(np.abs(target - x) <= TOLERANCE * solution.sigma))


def _halved(linearise: Linearise, info: Information, x: Array, target: Array) -> tuple[Array, Information]:
    """A step towards the target, halved until chi^2 does not rise, and the rows where it ends."""
    before, h = chi2(info, x), 1.0
    while True:
        new = x + h * (target - x)
        there = linearise(new)
        if chi2(there, new) <= before * (1 + ROUNDING_OF_CHI2) or h <= MIN_DAMPING:
            return new, there
        h /= 2


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
