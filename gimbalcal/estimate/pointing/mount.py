"""The calibration of a mount from pointing runs: its terms, what the stars do not determine, and how nights differ."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from math import sqrt

import numpy as np

from gimbalcal.calibration import AssumedNoise, Calibration, Provenance, Residual
from gimbalcal.calibration.exchange.tpoint_model import mount_axes, printed, tpoint_terms
from gimbalcal.calibration.provenance import Night, NightTerm
from gimbalcal.effects import Parameter
from gimbalcal.effects.effect import order_of
from gimbalcal.errors import InputError, number_of
from gimbalcal.estimate.extra_effects import NO_EXTENSION, extension, extra_effects
from gimbalcal.estimate.fit import ViewsFit
from gimbalcal.estimate.pointing.fit import (
    MIN_SIGMA_RAD,
    estimable_parameters,
    fit_terms,
    is_single_term,
    usual_terms,
    wanted_parameters,
)
from gimbalcal.estimate.pointing.pattern import clearest_pattern, far_off
from gimbalcal.estimate.pointing.term_tests import term_tests
from gimbalcal.estimate.sharing import agreement_test
from gimbalcal.inference.information import chi2_about_mean
from gimbalcal.method_table import Request
from gimbalcal.number import Array
from gimbalcal.p_value import SIGNIFICANCE, is_explained_by_chance, probability
from gimbalcal.recording import Recording, join
from gimbalcal.units import from_si
from gimbalcal.views.core import View
from gimbalcal.views.pointing import pointing, read_axes, split_nights

MIN_SIGMAS = 3.0  # a term that moved by less since the first night is not named
MIN_SPARE_DOF = 4  # degrees of freedom that a night has to itself before its terms are reported
NEGLIGIBLE_EXCESS = 0.1  # relative excess over the stated noise that no user would act on, however significant
MAX_TERMS_NAMED = 3  # terms that an outcome names


def calibrate_mount(request: Request) -> Calibration:
    """Calibrate a mount from pointing runs: the method "pointing"."""
    return pointing_calibration(request.recordings, request.terms, request.more, request.without)


def pointing_calibration(
    recordings: Sequence[Recording], terms: Sequence[str] = (), more: Sequence[str] = (), without: Sequence[str] = ()
) -> Calibration:
    """Return the terms of one mount from runs with it, in any number of files and nights.

    terms: as `wanted_parameters` reads them (default `usual_terms`); more: further ones, or effects with constants as
    `extra_effects` reads them; without: terms to omit. The outcome is a sentence where the stated noise does not
    explain what is left, or where the nights do not share their terms. Raises InputError for recordings of several
    mounts, without true angles, with fewer readings than unknowns, or without a term that is not in the model.
    """
    join(recordings)  # refuses runs of different mounts, and one that is given twice
    each = [split_nights(r) for r in recordings]
    runs = tuple(pointing(night) for own in each for night in own)
    _refuse_other_axes(runs)
    before = [sum(len(n.time) for n in own[:k]) for own in each for k in range(len(own))]
    platform, axes = recordings[0].platform, read_axes(recordings[0])
    single = [word for word in more if is_single_term(word, platform, axes)]
    chosen = terms or usual_terms(axes)
    stated = _stated_star_noise([r.noise.get("gimbal_angle") for r in recordings])
    also = extra_effects([word for word in more if word not in single], recordings, chosen)
    follows = all(v.noise.own_memories for v in runs)  # stars show the first term of a series alone

    def shown(p: Parameter) -> bool:
        return follows or order_of(p) == 1

    def of_terms(names: Sequence[str]) -> tuple[Parameter, ...]:
        return tuple(filter(shown, wanted_parameters(platform, axes, names)))

    wanted = _without_omitted(_with_added(of_terms(chosen), of_terms(single)), of_terms(without))
    axes_of = [tuple(f"{e.effect}:{axis}" for axis in e.axes) or (e.effect,) for e in also]
    sizes = tuple(p for names in axes_of for p in of_terms(names))
    fitted = fit_terms(runs, wanted, stated)
    extra = NO_EXTENSION
    if also:
        extra = extension(also, sizes, pointing(join(recordings)).stimulus, fitted.cost_of_sizes(sizes))
        fitted = fit_terms(runs, (*wanted, *extra.parameters), stated, extra.effects)
    several = by_night(fitted, stated)
    latitude = next((r.site.latitude for r in recordings if r.site.latitude is not None), None)
    residual, stars = _residual(fitted), sum(len(v) for v in runs)
    free, on_sky = stars - len(fitted.parameters), sqrt(sum(v**2 for v in residual.rms.values()))
    calibration = fitted.calibration(
        "pointing",
        residual,
        outcome=" ".join(filter(None, [_misfit(fitted, stated), _nights_differ(several)])),
        provenance=Provenance(
            noise=AssumedNoise(
                star_arcsec=float(from_si(fitted.excess, "arcsec")),
                gimbal_angle_from="residual" if stated is None else "recording.toml",
            ),
            pattern=clearest_pattern(fitted, axes),
            far_off=far_off(fitted, before),
            stars=stars,
            population_sd_arcsec=float(from_si(on_sky, "arcsec")) * sqrt(stars / free) if free > 0 else None,
            term_tests=term_tests(fitted, [*filter(shown, estimable_parameters(platform, axes))], stated is not None),
            mount=mount_axes(recordings[0].platform, latitude),
        ),
    )
    names = [tpoint_terms(calibration)]
    if terms or more or without:
        with suppress(InputError):  # the stars may be too few for the usual terms
            usual = fit_terms(runs, of_terms(usual_terms(axes)), stated)
            names.append(tpoint_terms(usual.calibration("pointing", residual, provenance=calibration.provenance)))
    origin = replace(calibration.provenance, tpoint=printed(*names))
    if several is not None:
        origin = replace(origin, nights=printed_nights(several), same_terms_every_night=several.probability)
    return extra.complete(replace(calibration, provenance=origin))


def _with_added(wanted: Sequence[Parameter], added: Sequence[Parameter]) -> tuple[Parameter, ...]:
    """Return the parameters with those that are added. Raises InputError for one that is among them."""
    if present := [p.label for p in added if p in wanted]:
        raise InputError(f"--with {', '.join(present)}: in the model of this method anyway; leave it out")
    return (*wanted, *added)


def _without_omitted(wanted: Sequence[Parameter], omitted: Sequence[Parameter]) -> tuple[Parameter, ...]:
    """Return the parameters without those that are omitted. Raises InputError for one that is not among them."""
    if absent := [p.label for p in omitted if p not in wanted]:
        has = ", ".join(p.label for p in wanted)
        raise InputError(f"--without {', '.join(absent)}: not in the model, which has {has}")
    if len(omitted) == len(wanted):
        raise InputError("--without omits every term of the model: keep one of them")
    return tuple(p for p in wanted if p not in omitted)


def _stated_star_noise(values: Sequence[float | None]) -> float | None:
    """The stated noise of a star [rad] where every header states it, rms over the runs; else None."""
    known = [s for s in values if s]
    return float(np.sqrt(np.mean(np.square(known)))) if len(known) == len(values) else None


def _refuse_other_axes(runs: Sequence[View]) -> None:
    """Raise InputError where some runs have no readout of an axis that others have, as nights of a drive not guided."""
    fewer, more = (end(runs, key=lambda v: len(v.channels)) for end in (min, max))
    if len(fewer.channels) < len(more.channels):
        few, many = (" and ".join(axis for _, axis in v.channels) for v in (fewer, more))
        raise InputError(
            f"{fewer.title!r} has readings of pointing {few} alone, and {more.title!r} of pointing {many}; calibrate "
            "them one at a time"
        )


def _residual(fitted: ViewsFit) -> Residual:
    residual = np.concatenate(fitted.residual)
    each = np.sqrt((residual**2).mean(axis=0))
    rms = {" ".join(key): float(v) for key, v in zip(fitted.views[0].channels, each, strict=True)}
    return Residual(fitted.solution.chi2, fitted.solution.dof, rms)


def _misfit(fitted: ViewsFit, stated: float | None) -> str:
    dof = fitted.solution.dof
    if stated is None or dof <= 0:
        return ""
    ratio = float(np.sqrt(fitted.solution.chi2 / dof))
    if ratio <= 1 + NEGLIGIBLE_EXCESS or is_explained_by_chance(fitted.solution.chi2, dof):
        return ""
    return (
        f"what the terms leave is {ratio:.2f} times the stated {from_si(stated, 'arcsec'):.3g} arcsec, more than "
        "chance allows: the mount has a term that is not in the model, or the noise is larger; `gimbalcal diagnose` "
        "tells which."
    )


def _nights_differ(several: Nights | None) -> str:
    if several is None or several.probability >= SIGNIFICANCE:
        return ""
    if not several.moved:
        return f"the terms differ between {number_of(len(several.fits), 'night')}, no single one by three sigma."
    words = []
    for p, x, s in several.moved[:MAX_TERMS_NAMED]:
        name = p.label.replace(":", " ").replace("_", " ")
        words.append(f"{name} by {from_si(x, p.unit):.3g} +- {from_si(s, p.unit):.2g} {p.unit}")
    return f"the terms differ between {number_of(len(several.fits), 'night')}: {', '.join(words)} since the first."


@dataclass(frozen=True)
class Nights:
    """Fits of each night alone, the probability that all share one set of terms, and the terms that moved."""

    fits: tuple[ViewsFit, ...]
    probability: float
    moved: tuple[tuple[Parameter, float, float], ...]  # term, change since the first night, its sigma


def by_night(joint: ViewsFit, stated: float | None) -> Nights | None:
    """Fit the nights of a joint fit one by one; None where fewer than two have enough stars. stated: sigma of a star.

    If no sigma is stated, it is the scatter within each night: differences between nights are not noise. The
    frames of a mount that tracks are correlated, and its axes scatter unequally: then each night has its own noise.
    """
    wanted, sigma = joint.solution.parameters, joint.excess
    runs = [v for v in joint.views if len(v.channels) * len(v) >= len(wanted) + MIN_SPARE_DOF]
    if len(runs) < 2:
        return None
    if stated is None and all(v.noise.own_memories for v in runs):
        alone = tuple(fit_terms([v], wanted, absent=joint.absent) for v in runs)
        if not any(f.unobservable for f in alone):
            x, covariance = (np.array([getattr(f, name) for f in alone]) for name in ("x", "covariance"))
            p = probability(chi2_about_mean(x, covariance), x[1:].size)
            return Nights(alone, p, _moved_terms(alone) if p < SIGNIFICANCE else ())
    alone = tuple(fit_terms([v], wanted, sigma, joint.absent) for v in runs)
    shared = fit_terms(runs, wanted, sigma, joint.absent).solution
    dof = sum(f.solution.dof for f in alone)
    variance = 1.0 if stated is not None else sum(f.solution.chi2 for f in alone) / max(dof, 1)
    p = agreement_test(shared, [f.solution for f in alone], variance, np.inf if stated is not None else dof).p_value
    if stated is None:
        own = max(sigma * float(np.sqrt(variance)), MIN_SIGMA_RAD)
        alone = tuple(fit_terms([v], wanted, own, joint.absent) for v in runs)
    return Nights(alone, p, _moved_terms(alone) if p < SIGNIFICANCE else ())


def change_between_nights(first: ViewsFit, other: ViewsFit) -> tuple[Array, Array]:
    """Return the change of each term since the first night and its sigma, SI."""
    variance = np.diag(first.covariance) + np.diag(other.covariance)
    return other.x - first.x, np.sqrt(variance)


def _moved_terms(alone: Sequence[ViewsFit]) -> tuple[tuple[Parameter, float, float], ...]:
    """Terms that stand out, the clearest first, each in the night where it is clearest."""
    changes = [change_between_nights(alone[0], f) for f in alone[1:]]
    every = [(p, float(d[i]), float(s[i])) for i, p in enumerate(alone[0].solution.parameters) for d, s in changes]
    clearest: dict[Parameter, tuple[Parameter, float, float]] = {}
    for change in sorted(every, key=lambda c: -abs(c[1]) / c[2]):
        clearest.setdefault(change[0], change)
    return tuple(c for c in clearest.values() if abs(c[1]) > MIN_SIGMAS * c[2])


def printed_nights(nights: Nights) -> tuple[Night, ...]:
    """Return each night's terms, and their change since the first with sigma, in printed units."""
    out = []
    for f in nights.fits:
        columns = [f.x, f.sigmas, *(() if f is nights.fits[0] else change_between_nights(nights.fits[0], f))]
        terms = {}
        for p, *row in zip(f.solution.parameters, *columns, strict=True):
            value, sigma, *since = (float(from_si(v, p.unit)) for v in row)
            terms[p.label] = NightTerm(value, sigma, p.unit, *since)
        night, residual = f.views[0], f.residual[0]
        rms = float(from_si(np.sqrt((residual**2).sum() / len(night)), "arcsec"))
        out.append(Night(night.title, float(night.source.time[0]), len(night), rms, terms))
    return tuple(out)
