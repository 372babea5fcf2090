"""Fit of the terms of a mount to the stars of one night or of several together.

Zeros of degrees need a few Gauss-Newton steps. One sigma holds for a star on the sky, in both directions: the stated
`gimbal_angle` noise, or where none is stated what the stars scatter.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gimbalcal.effects import Effect, Parameter
from gimbalcal.errors import InputError, amount
from gimbalcal.estimate.fit import ViewsFit, fit
from gimbalcal.number import Array
from gimbalcal.views.core import View
from gimbalcal.views.pointing import read_axes, starting_zeros

MIN_SIGNAL = 0.01  # prior sigmas over noise: a mount's errors are up to a hundred times the catalogue's scales
MIN_SIGMA_RAD = 1e-9  # rad; stars better than 0.2 mas are made up: their scatter tells no sigma


def fit_terms(
    runs: Sequence[View], wanted: Sequence[Parameter], sigma: float | None = None, absent: Sequence[Effect] = ()
) -> ViewsFit:
    """Fit the terms of a mount to runs with it; sigma [rad] of a star, from the scatter where it is None.

    absent: effects of size zero whose constants are not the catalogue's (the teeth of a worm).
    Raises InputError where there are fewer readings than unknowns, or the steps do not settle.
    """
    stars = sum(len(v) for v in runs)
    if 2 * stars <= len(wanted):
        raise InputError(
            f"{amount(stars, 'star')} cannot tell {amount(len(wanted), 'term')}: observe more, or name fewer --terms"
        )
    axes = read_axes(runs[0].source)
    zeros = dict(zip(axes, starting_zeros(runs[0].source, axes), strict=True))
    start = np.array([zeros.get(p.axis, 0.0) if p.effect == "gimbal_zero" else p.mean for p in wanted])
    views = runs if sigma is None else [_of_noise(v, sigma) for v in runs]
    found = fit(views, wanted, absent, start, min_signal=MIN_SIGNAL, min_excess=MIN_SIGMA_RAD)
    if not found.steps:
        raise InputError(
            f"the terms of {runs[0].title!r} do not settle: star and readout disagree by too much for small errors; "
            "check units, signs and the sense of the axes in [platform]"
        )
    return replace(found, excesses=tuple(np.array([sigma]) for _ in views)) if sigma else found


def _of_noise(v: View, sigma: float) -> View:
    """Return the view with a stated sigma [rad] of a star of weight one."""
    return replace(v, noise=replace(v.noise, sigma=sigma * np.asarray(v.noise.sigma), stated=True))


def weighted(found: ViewsFit) -> tuple[Array, ...]:
    """Return the residual of each star (n, 2) [rad] times the root of its weight: of one sigma for all."""
    return tuple(r / s * found.excess for r, s in zip(found.residual, found.sigma, strict=True))


def square(found: ViewsFit) -> float:
    """Return the weighted sum of squares of the residuals [rad^2]."""
    return float(sum((r**2).sum() for r in weighted(found)))
