r"""Differences of the terms of a mount between nights: each night alone, against the first, with sigma.

All nights share one model if what they leave together is no more than what they leave apart,

.. math:: F = \frac{(S_{together} - \sum_k S_k) / q}{\sum_k S_k / \nu} \sim F(q, \nu), \qquad
          \chi^2 = (S_{together} - \sum_k S_k) / \sigma^2 \sim \chi^2(q)

where the noise is estimated or stated; q and nu are the degrees of freedom of the difference and of what is left.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from gimbalcal.effects import Parameter
from gimbalcal.estimate.pointing.fit import MIN_SIGMA_RAD, Fit, fit
from gimbalcal.inference.p_value import probability
from gimbalcal.number import Array
from gimbalcal.units import from_si

SIGNIFICANCE = 1e-3  # probability below which nights do not share their terms
MIN_SIGMAS = 3.0  # sigmas; a term that moved by less is not named
MIN_SPARE_DOF = 4  # degrees of freedom that a night has to itself before its terms are told


@dataclass(frozen=True)
class Nights:
    """Fits of each night alone, the probability that all share one set of terms, and the terms that moved."""

    fits: tuple[Fit, ...]
    probability: float
    moved: tuple[tuple[Parameter, int, float, float], ...]  # term, night (from 0), change since the first, its sigma


def by_night(together: Fit, sigma: float | None) -> Nights | None:
    """The nights of a fit, each alone; None where fewer than two have enough stars. sigma: the stated one."""
    wanted, free = together.solution.parameters, len(together.solution.parameters) + MIN_SPARE_DOF
    runs = [r for r in together.runs if 2 * len(r.time) >= free]
    if len(runs) < 2:
        return None
    alone = tuple(fit([r], wanted, sigma or together.sigma, together.absent) for r in runs)
    left, ranks = sum(f.square for f in alone), sum(_seen(f) for f in alone)
    nu = 2 * sum(len(r.time) for r in runs) - ranks
    if sigma is None:  # what differs between nights is no noise of theirs
        apart = max(float(np.sqrt(left / max(nu, 1))), MIN_SIGMA_RAD)
        alone = tuple(fit([r], wanted, apart, together.absent) for r in runs)
    common = together if len(runs) == len(together.runs) else fit(runs, wanted, sigma, together.absent)
    gain = max(common.square - left, 0.0)
    shared, variance = ranks - _seen(common), sigma**2 if sigma is not None else left / max(nu, 1)
    p = probability(gain / variance, shared, nu if sigma is None else np.inf) if variance > 0 else 1.0
    return Nights(alone, p, _moved(alone) if p < SIGNIFICANCE else ())


def _seen(f: Fit) -> int:
    """Return the number of directions that the stars determine."""
    return len(f.solution.parameters) - len(f.solution.unobservable)


def change(first: Fit, other: Fit) -> tuple[Array, Array]:
    """Change of each term since the first night and its sigma, SI."""
    variance = np.diag(first.solution.covariance) + np.diag(other.solution.covariance)
    return other.solution.x - first.solution.x, np.sqrt(variance)


def _moved(alone: Sequence[Fit]) -> tuple[tuple[Parameter, int, float, float], ...]:
    """Terms that stand out, the clearest first, each in the night where it is clearest."""
    best: dict[Parameter, tuple[Parameter, int, float, float]] = {}
    for k, f in enumerate(alone[1:], start=1):
        d, s = change(alone[0], f)
        for p, x, sigma in zip(f.solution.parameters, d, s, strict=True):
            if abs(x) > MIN_SIGMAS * sigma and (p not in best or abs(x) / sigma > abs(best[p][2]) / best[p][3]):
                best[p] = (p, k, float(x), float(sigma))
    return tuple(sorted(best.values(), key=lambda m: -abs(m[2]) / m[3]))


def record(nights: Nights) -> list[dict[str, Any]]:
    """Each night's terms, and their change since the first with sigma, in printed units."""
    out = []
    for f in nights.fits:
        d, s = change(nights.fits[0], f)
        rows = {}
        for i, p in enumerate(f.solution.parameters):
            row = {"value": f.solution.x[i], "sigma": f.solution.sigma[i]}
            row |= {} if f is nights.fits[0] else {"change": d[i], "change_sigma": s[i]}
            rows[p.label] = {k: float(from_si(v, p.unit)) for k, v in row.items()} | {"unit": p.unit}
        n = len(f.runs[0].time)
        rms = float(from_si(np.sqrt((f.residuals[0] ** 2).sum() / n), "arcsec"))
        title, start = f.runs[0].title, float(f.runs[0].time[0])
        out.append({"title": title, "start_s": start, "stars": n, "rms_arcsec": rms, "terms": rows})
    return out
