"""Fit of the terms of a mount to the stars of one night or of several together.

Zeros of degrees need a few Gauss-Newton steps. One sigma holds for a star on the sky, in both directions: the stated
`gimbal_angle` noise, or where none is stated what the stars scatter.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gimbalcal.calibration.exchange.tpoint_model import term_names
from gimbalcal.effects import CATALOGUE, Effect, Parameter, parameters
from gimbalcal.effects.effect import GIMBALS
from gimbalcal.errors import InputError, number_of
from gimbalcal.estimate.fit import ViewsFit, fit
from gimbalcal.number import Array
from gimbalcal.platform import Platform
from gimbalcal.views.core import View
from gimbalcal.views.pointing import STAGES

MIN_SIGNAL = 0.01  # prior sigmas over noise: a mount's errors are up to a hundred times the catalogue's scales
MIN_SIGMA_RAD = 1e-9  # rad; stars better than 0.2 mas are made up: their scatter tells no sigma
USUAL_TERMS = ("gimbal_zero", "axis_collimation", "gimbal_nonorthogonality", "base_tilt", "tube_flexure")
"""Zeros, collimation, squareness, the tilt of the mount and the sag of the tube: seven terms of a two-axis mount."""


def usual_terms(axes: Sequence[str]) -> tuple[str, ...]:
    """Return the usual terms of a mount with these read axes; those of a single axis are all part of its zero."""
    return USUAL_TERMS if len(axes) > 1 else USUAL_TERMS[:1]


def wanted_parameters(platform: Platform, axes: Sequence[str], terms: Sequence[str]) -> tuple[Parameter, ...]:
    """Return the parameters that terms name, in that order.

    A term is the id of an effect, one axis of it as in "encoder_eccentricity:azimuth", a single parameter as in
    "eccentricity_sin:azimuth", or its name in TPOINT as in "ACES". Raises InputError for anything else.
    """
    every, names = estimable_parameters(platform, axes), term_names(platform)
    out: list[Parameter] = []
    for term in terms:
        chosen = [p for p in every if term in (p.effect, f"{p.effect}:{p.axis}", p.label, names.get(p.label))]
        if not chosen:
            raise InputError(_why_unknown(term, every))
        out += [p for p in chosen if p not in out]
    return tuple(out)


def is_single_term(term: str, platform: Platform, axes: Sequence[str]) -> bool:
    """Return whether a term is one parameter by its own name, not that of its effect, or by its name in TPOINT."""
    labels = [p.label for p in estimable_parameters(platform, axes)]
    own = term in labels and term.partition(":")[0] not in CATALOGUE
    return own or term in (term_names(platform).get(label) for label in labels)


def _why_unknown(term: str, every: Sequence[Parameter]) -> str:
    """Return the reason why a term names none of the parameters that a mount has."""
    effect, _, axis = term.partition(":")
    known = sorted(effects_of_mounts())
    if effect not in known:
        return f"{effect!r} is no effect of a pointing run; there are {', '.join(known)}"
    has = ", ".join(dict.fromkeys(p.axis for p in every if p.effect == effect and p.axis)) or "no axis"
    return f"{effect} has no {f'axis {axis!r}' if axis else 'axis'} on this mount; it has {has}"


def effects_of_mounts() -> list[str]:
    """Return the ids of the effects of pointing runs."""
    return [i for i, cls in CATALOGUE.items() if "pointing" in cls.kinds and cls.stage in STAGES]


def estimable_parameters(platform: Platform, axes: Sequence[str]) -> tuple[Parameter, ...]:
    """Return the parameters of all effects of pointing runs that a mount with these read axes has.

    An axis that is not read has no zero and no squareness of its own, and a turn of the base about the outermost read
    axis is the zero of that axis.
    """
    return tuple(p for effect in effects_of_mounts() for p in _of_effect(platform, axes, effect))


def _of_effect(platform: Platform, axes: Sequence[str], effect: str) -> list[Parameter]:
    cls = CATALOGUE[effect]
    every = parameters(cls, platform.axis_names)
    if all(f.metadata.get("axes") == GIMBALS for f in cls.__dataclass_fields__.values() if "sigma" in f.metadata):
        last = axes[-1] if effect == "gimbal_nonorthogonality" else None  # nothing that is read stands outside it
        return [p for p in every if p.axis in axes and p.axis != last]
    if effect == "base_tilt":
        return [p for p in every if p.axis != _about_outer_axis(platform, axes)]
    return list(every)


def _about_outer_axis(platform: Platform, axes: Sequence[str]) -> str:
    """Return which of north, east, down is nearest to the outermost read axis: a turn about it is that axis' zero."""
    i = platform.axis_names.index(axes[-1])
    outside = Platform(platform.name, platform.axes[i + 1 :]).attitude(np.zeros(len(platform.axes) - i - 1))
    along = outside["xyz".index(platform.axes[i].direction)]
    return ("north", "east", "down")[int(np.argmax(np.abs(along)))]


def fit_terms(
    runs: Sequence[View], wanted: Sequence[Parameter], sigma: float | None = None, absent: Sequence[Effect] = ()
) -> ViewsFit:
    """Fit the terms of a mount to runs with it; sigma [rad] of a star, from the scatter where it is None.

    absent: effects of size zero whose constants are not the catalogue's (the teeth of a worm).
    Raises InputError where there are fewer readings than unknowns, or the steps do not settle.
    """
    stars = sum(len(v) for v in runs)
    if len(runs[0].channels) * stars <= len(wanted):
        raise InputError(
            f"{number_of(stars, 'star')} cannot tell {number_of(len(wanted), 'term')}: observe more, or "
            "name fewer --terms"
        )
    views = (
        runs
        if sigma is None
        else [
            replace(v, noise=replace(v.noise, sigma=sigma * np.asarray(v.noise.sigma), scale_known=True)) for v in runs
        ]
    )
    fitted = fit(
        views, wanted, absent, runs[0].starting_values(wanted), min_signal=MIN_SIGNAL, min_excess=MIN_SIGMA_RAD
    )
    if not fitted.steps:
        raise InputError(
            f"the terms of {runs[0].title!r} do not settle: star and readout disagree by too much for small errors; "
            "check units, signs and the sense of the axes in [platform]"
        )
    return replace(fitted, excesses=tuple(np.array([sigma]) for _ in views)) if sigma else fitted


def weighted_residual(fitted: ViewsFit) -> tuple[Array, ...]:
    """Return the residual of each star (n, C) [rad] times the root of its weight: of one sigma for all."""
    return tuple(r / s * fitted.excess for r, s in zip(fitted.residual, fitted.sigma, strict=True))
