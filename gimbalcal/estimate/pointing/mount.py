"""The calibration of a mount from pointing runs: its terms, what the stars do not determine, and how nights differ."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gimbalcal.calibration import AssumedNoise, Calibration, Provenance, Readout, Residual
from gimbalcal.calibration.exchange.tpoint_model import mount_axes, printed, tpoint_terms
from gimbalcal.errors import amount
from gimbalcal.estimate.extra_effects import NO_EXTENSION, ExtraEffect, extension, extra_effects
from gimbalcal.estimate.fit import ViewsFit
from gimbalcal.estimate.pointing.drift import Nights, by_night, printed_nights
from gimbalcal.estimate.pointing.fit import fit_terms, usual_terms, wanted_parameters
from gimbalcal.estimate.pointing.pattern import far_off, pattern
from gimbalcal.inference.p_value import probability
from gimbalcal.method_table import Request
from gimbalcal.recording import Recording, join
from gimbalcal.units import from_si
from gimbalcal.views.pointing import nights, pointing, read_axes

SIGNIFICANCE = 1e-3  # probability below which chance is not believed
NEGLIGIBLE_EXCESS = 0.1  # relative excess over the stated noise that no user would act on, however significant
MAX_TERMS_NAMED = 3  # terms that an outcome names


def calibrate_mount(request: Request) -> Calibration:
    """Calibrate a mount from pointing runs: the method "pointing"."""
    return pointing_calibration(request.recordings, request.terms, request.more)


def pointing_calibration(
    recordings: Sequence[Recording], terms: Sequence[str] = (), more: Sequence[str] = ()
) -> Calibration:
    """The terms of one mount from runs with it, in any number of files and nights.

    terms: ids of effects, or "id:axis" (default `usual_terms`); more: further ones as `extra_effects` reads them. The
    outcome is a sentence where the stated noise does not explain what is left, or where the nights do not share their
    terms. Raises InputError for recordings of several mounts, without true angles, or with fewer readings than
    unknowns.
    """
    join(recordings)  # refuses runs of different mounts, and one that is given twice
    each = [nights(r) for r in recordings]
    runs = tuple(pointing(night) for own in each for night in own)
    before = [sum(len(n.time) for n in own[:k]) for own in each for k in range(len(own))]
    platform, axes = recordings[0].platform, read_axes(recordings[0])
    held = terms or usual_terms(axes)
    stated = _stated([r.noise.get("gimbal_angle") for r in recordings])
    also = extra_effects(more, recordings, held)
    sizes = tuple(p for e in also for p in wanted_parameters(platform, axes, _named(e)))
    wanted = wanted_parameters(platform, axes, held)
    found = fit_terms(runs, wanted, stated)
    extra = NO_EXTENSION
    if also:
        extra = extension(also, sizes, pointing(join(recordings)).stimulus, found.cost_of_sizes(sizes))
        found = fit_terms(runs, (*wanted, *extra.parameters), stated, extra.effects)
    several = by_night(found, stated)
    latitude = next((r.site.latitude for r in recordings if r.site.latitude is not None), None)
    made = found.calibration(
        "pointing",
        _residual(found),
        outcome=" ".join(filter(None, [_misfit(found, stated), _differ(several)])),
        provenance=Provenance(
            noise=AssumedNoise(
                star_arcsec=float(from_si(found.excess, "arcsec")),
                gimbal_angle_from="residual" if stated is None else "recording.toml",
            ),
            pattern=pattern(found, axes),
            far_off=far_off(found, before),
            stars=sum(len(v) for v in runs),
            mount=mount_axes(recordings[0].platform, latitude),
        ),
        readout=Readout(gimbals=recordings[0].platform.axis_names),
    )
    return extra.complete(_with_names(made, several))


def _named(one: ExtraEffect) -> tuple[str, ...]:
    """Return the terms of an extra effect: the effect, or its axes one by one."""
    return tuple(f"{one.effect}:{axis}" for axis in one.axes) or (one.effect,)


def _with_names(made: Calibration, several: Nights | None) -> Calibration:
    origin = replace(made.provenance, tpoint=printed(tpoint_terms(made)))
    if several is not None:
        origin = replace(origin, nights=printed_nights(several), same_terms_every_night=several.probability)
    return replace(made, provenance=origin)


def _stated(told: Sequence[float | None]) -> float | None:
    """The stated noise of a star [rad] where every header tells it, rms over the runs; else None."""
    known = [s for s in told if s]
    return float(np.sqrt(np.mean(np.square(known)))) if len(known) == len(told) else None


def _residual(found: ViewsFit) -> Residual:
    left = np.concatenate(found.residual)
    rms = {
        " ".join(key): float(v) for key, v in zip(found.views[0].channels, np.sqrt((left**2).mean(axis=0)), strict=True)
    }
    return Residual(found.solution.chi2, found.solution.dof, rms)


def _misfit(found: ViewsFit, stated: float | None) -> str:
    dof = found.solution.dof
    if stated is None or dof <= 0:
        return ""
    ratio = float(np.sqrt(found.solution.chi2 / dof))
    if ratio <= 1 + NEGLIGIBLE_EXCESS or probability(found.solution.chi2, dof) >= SIGNIFICANCE:
        return ""
    return (
        f"what the terms leave is {ratio:.2f} times the stated {from_si(stated, 'arcsec'):.3g} arcsec, more than "
        "chance allows: the mount has a term that is not in the model, or the noise is larger; `gimbalcal diagnose` "
        "tells which."
    )


def _differ(several: Nights | None) -> str:
    if several is None or not several.moved:
        return ""
    words = []
    for p, _, x, s in several.moved[:MAX_TERMS_NAMED]:
        name = p.label.replace(":", " ").replace("_", " ")
        words.append(f"{name} by {from_si(x, p.unit):.3g} +- {from_si(s, p.unit):.2g} {p.unit}")
    return f"the terms differ between {amount(len(several.fits), 'night')}: {', '.join(words)} since the first."
