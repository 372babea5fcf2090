r"""Several minima of one fit: a nuisance that enters by sine and cosine may have a mirror image that fits as well.

A fit is started from several values of such nuisances. Minima are distinct where a parameter moves by more than its
sigma, and a minimum is not excluded while its chi^2 is less than `MAX_RISE` above the least,

.. math:: (\chi^2_k - \chi^2_0) / \max(1, \chi^2_0 / \nu) < 9 .

The data then do not tell which is true. The one of smaller parameters, in prior sigmas, is put first; the others are
reported with it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gimbalcal.calibration.provenance import AlternativeSolution
from gimbalcal.effects import Parameter
from gimbalcal.estimate.fit import LEAST_SIGNAL, ViewsFit, fit
from gimbalcal.number import Array
from gimbalcal.units import from_si
from gimbalcal.views.core import View

MAX_RISE = 9.0  # of chi^2: three sigmas of one parameter


def cost(fitted: ViewsFit) -> float:
    """Return chi^2 of the rows."""
    return float((fitted.whitened[1] ** 2).sum())


def minima(views: Sequence[View], wanted: Sequence[Parameter], starts: Sequence[Array]) -> tuple[ViewsFit, ...]:
    """Return the distinct minima that the rows do not exclude, from several starts (p + m,), the likeliest first."""
    fits = sorted((fit(views, wanted, start=x, min_signal=LEAST_SIGNAL) for x in starts), key=cost)
    dof = sum(r.size for r in fits[0].residual) - len(fits[0].solution.x)
    scale = max(1.0, cost(fits[0]) / max(dof, 1))
    distinct: list[ViewsFit] = []
    for f in fits:
        if f.steps and cost(f) - cost(fits[0]) < MAX_RISE * scale and not any(_same(f, g) for g in distinct):
            distinct.append(f)
    return tuple(sorted(distinct, key=lambda f: cost(f) / scale + _from_prior(f))) or (fits[0],)


def _same(a: ViewsFit, b: ViewsFit) -> bool:
    """Return whether two minima are one but for the noise."""
    return bool(np.all(np.abs(a.x - b.x) <= np.minimum(a.sigmas, b.sigmas)))


def _from_prior(fitted: ViewsFit) -> float:
    """Return the sum of squares of the parameters in units of their prior sigmas."""
    sigma, mean = (np.array([getattr(p, name) for p in fitted.parameters]) for name in ("sigma", "mean"))
    return float((((fitted.x - mean) / sigma) ** 2).sum())


def entries(solutions: Sequence[ViewsFit]) -> tuple[AlternativeSolution, ...] | None:
    """Return the minima behind the first as they stand in calibration.json; None without any."""
    out = [
        AlternativeSolution(
            cost(f) - cost(solutions[0]),
            {p.label: float(from_si(x, p.unit)) for p, x in zip(f.parameters, f.x, strict=True)},
        )
        for f in solutions[1:]
    ]
    return tuple(out) or None


def in_words(solutions: Sequence[ViewsFit], where: Sequence[str]) -> str:
    """Return the sentence on minima behind the first, each with the nuisance it stands for; empty without any."""
    if len(solutions) == 1:
        return ""
    first, each = solutions[0], []
    for f, at in zip(solutions[1:], where[1:], strict=True):
        moved = [i for i in range(len(f.x)) if abs(f.x[i] - first.x[i]) > min(f.sigmas[i], first.sigmas[i])]
        terms = [
            f"{p.label.replace('_', ' ').replace(':', ' ')} {from_si(f.x[i], p.unit):.4g} instead of "
            f"{from_si(first.x[i], p.unit):.4g} {p.unit}"
            for i, p in ((i, f.parameters[i]) for i in moved)
        ]
        each.append(f"{', '.join(terms)} with {at} instead of {where[0]}")
    return (
        f"a mirror solution fits as well: {'; or '.join(each)}; the data do not tell which is true, the one of smaller "
        "biases is written"
    )
