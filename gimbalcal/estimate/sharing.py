r"""Agreement of recordings in the parameters that they share.

Information about shared parameters is added (`Information.__add__`, which unites equal parameters). What chi^2 rises by
when K recordings share them tells whether they may,

.. math:: \Delta = \chi^2_{shared} - \sum_k \chi^2_k \sim s^2 \chi^2(q), \qquad q = \nu_{shared} - \sum_k \nu_k ,

q being the number of combinations that more than one recording determines and s^2 a factor of the noise, which is one
where it is stated. Where s^2 is estimated from nu degrees of freedom, Delta / (q s^2) is an F variate of q and nu.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gimbalcal.calibration import Calibration
from gimbalcal.effects import Parameter
from gimbalcal.inference.information import Information, Solution, solve
from gimbalcal.inference.p_value import probability
from gimbalcal.number import Array
from gimbalcal.units import from_si

SIGNIFICANCE = 0.01  # probability that any of several recordings of a unit is said not to agree where all do


@dataclass(frozen=True)
class Agreement:
    """Rise of chi^2, in units of the noise, by sharing parameters, and how many combinations are shared."""

    rise: float
    combinations: int
    p_value: float


def agreement(shared: Solution, alone: Sequence[Solution], variance: float = 1.0, dof: float = np.inf) -> Agreement:
    """Test whether recordings agree; variance: factor of their stated noise, estimated from `dof` (inf: known)."""
    rise = max(shared.chi2 - sum(s.chi2 for s in alone), 0.0)
    rise = rise / variance if variance > 0 else 0.0
    combinations = shared.dof - sum(s.dof for s in alone)
    return Agreement(rise, combinations, probability(rise, combinations, dof) if combinations > 0 else 1.0)


def information_of(made: Calibration, wanted: Sequence[Parameter]) -> Information:
    """Return what a calibration tells of some of its parameters, whatever the others are."""
    at = [made.parameters.index(p) for p in wanted]
    sigma = made.sigmas[at]
    root = np.linalg.inv(np.linalg.cholesky(made.covariance[np.ix_(at, at)] / np.outer(sigma, sigma)))
    scale = np.array([p.sigma for p in wanted])
    mean = np.array([p.mean for p in wanted])
    rows = np.column_stack([root * (scale / sigma), root @ ((made.values[at] - mean) / sigma)])
    return Information(tuple(wanted), rows, len(at))


def largest_difference(own: Solution, others: Solution) -> str:
    """Describe the parameter in which two estimates differ by most sigmas."""
    return largest_in_words(own.parameters, own.x - others.x, np.hypot(own.sigma, others.sigma))


def largest_in_words(parameters: Sequence[Parameter], difference: Array, sigma: Array) -> str:
    """Describe the largest of differences (p,), SI, over their sigma (p,)."""
    i = int(np.argmax(np.abs(difference) / sigma))
    p = parameters[i]
    size, one = (float(f"{from_si(float(v), p.unit):.3g}") for v in (difference[i], sigma[i]))
    return f"most in {p.label}, by {size:+g} +- {one:g} {p.unit}"


def difference_of(own: Information, others: Information, dof: float) -> tuple[Agreement, str]:
    """Compare one recording with others, their noise estimated from `dof`; also describe the largest difference."""
    alone = solve(own), solve(others)
    return agreement(solve(own + others), alone, dof=dof), largest_difference(*alone)
