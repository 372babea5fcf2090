"""Differences of the terms of a mount between nights: each night alone, against the first, with sigma.

Whether all nights share one model is `estimate.sharing.agreement`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gimbalcal.calibration.provenance import Night, NightTerm
from gimbalcal.effects import Parameter
from gimbalcal.estimate.fit import ViewsFit
from gimbalcal.estimate.pointing.fit import MIN_SIGMA_RAD, fit_terms
from gimbalcal.estimate.sharing import agreement
from gimbalcal.number import Array
from gimbalcal.units import from_si

SIGNIFICANCE = 1e-3  # probability below which nights do not share their terms
MIN_SIGMAS = 3.0  # sigmas; a term that moved by less is not named
MIN_SPARE_DOF = 4  # degrees of freedom that a night has to itself before its terms are told


@dataclass(frozen=True)
class Nights:
    """Fits of each night alone, the probability that all share one set of terms, and the terms that moved."""

    fits: tuple[ViewsFit, ...]
    probability: float
    moved: tuple[tuple[Parameter, int, float, float], ...]  # term, night (from 0), change since the first, its sigma


def by_night(joint: ViewsFit, stated: float | None) -> Nights | None:
    """Fit the nights of a joint fit one by one; None where fewer than two have enough stars. stated: sigma of a star.

    Where no sigma is stated, it is what the nights scatter each by itself: what differs between them is no noise.
    """
    wanted, sigma = joint.solution.parameters, joint.excess
    runs = [v for v in joint.views if len(v.channels) * len(v) >= len(wanted) + MIN_SPARE_DOF]
    if len(runs) < 2:
        return None
    alone = tuple(fit_terms([v], wanted, sigma, joint.absent) for v in runs)
    shared = fit_terms(runs, wanted, sigma, joint.absent).solution
    dof = sum(f.solution.dof for f in alone)
    variance = 1.0 if stated is not None else sum(f.solution.chi2 for f in alone) / max(dof, 1)
    p = agreement(shared, [f.solution for f in alone], variance, np.inf if stated is not None else dof).p_value
    if stated is None:
        own = max(sigma * float(np.sqrt(variance)), MIN_SIGMA_RAD)
        alone = tuple(fit_terms([v], wanted, own, joint.absent) for v in runs)
    return Nights(alone, p, _moved(alone) if p < SIGNIFICANCE else ())


def change(first: ViewsFit, other: ViewsFit) -> tuple[Array, Array]:
    """Return the change of each term since the first night and its sigma, SI."""
    variance = np.diag(first.solution.covariance) + np.diag(other.solution.covariance)
    return other.solution.x - first.solution.x, np.sqrt(variance)


def _moved(alone: Sequence[ViewsFit]) -> tuple[tuple[Parameter, int, float, float], ...]:
    """Terms that stand out, the clearest first, each in the night where it is clearest."""
    best: dict[Parameter, tuple[Parameter, int, float, float]] = {}
    for k, f in enumerate(alone[1:], start=1):
        d, s = change(alone[0], f)
        for p, x, sigma in zip(f.solution.parameters, d, s, strict=True):
            if abs(x) > MIN_SIGMAS * sigma and (p not in best or abs(x) / sigma > abs(best[p][2]) / best[p][3]):
                best[p] = (p, k, float(x), float(sigma))
    return tuple(sorted(best.values(), key=lambda m: -abs(m[2]) / m[3]))


def printed_nights(nights: Nights) -> tuple[Night, ...]:
    """Return each night's terms, and their change since the first with sigma, in printed units."""
    out = []
    for f in nights.fits:
        columns = [f.solution.x, f.solution.sigma, *(() if f is nights.fits[0] else change(nights.fits[0], f))]
        terms = {}
        for p, *row in zip(f.solution.parameters, *columns, strict=True):
            value, sigma, *since = (float(from_si(v, p.unit)) for v in row)
            terms[p.label] = NightTerm(value, sigma, p.unit, *since)
        night, residual = f.views[0], f.residual[0]
        rms = float(from_si(np.sqrt((residual**2).sum() / len(night)), "arcsec"))
        out.append(Night(night.title, float(night.source.time[0]), len(night), rms, terms))
    return tuple(out)
