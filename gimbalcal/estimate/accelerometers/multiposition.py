r"""Accelerometers from rest in many positions, no angles needed: the norm of the force is gravity at any attitude.

Wang et al. (2019), section 4.1, with the effects of the catalogue instead of one polynomial: every dwell has an
attitude of its own that is not known, and what the three readings of a dwell say beyond that attitude is one number,
the misfit of the norm. Direction: physics to reading, as everywhere in `effects`;
`estimate.pulses.polynomial` is the other one.

Terms beyond bias, scale factor and misalignment are taken up one at a time, the one that predicts left-out positions
best first, and only while the positions support them: a coefficient must stand clear of its sigma (`term_selection`),
and positions left out must be predicted no worse.
"""

from __future__ import annotations

from collections.abc import Container, Sequence
from dataclasses import replace
from math import nan

import numpy as np

from gimbalcal.calibration import DIRECTION, Calibration, Options, Provenance, Residual, StageResult
from gimbalcal.effects import CATALOGUE, Effect
from gimbalcal.effects.effect import SENSOR_STAGES, follows
from gimbalcal.errors import InputError
from gimbalcal.estimate.accelerometers.fit_summary import assumed_noise, rotations_of_the_triad
from gimbalcal.estimate.accelerometers.norm_fit import (
    LINEAR,
    covariance_of_omitted_terms,
    left_out_rms,
    norm_fit,
    omitted_terms_in_words,
    sample_sigma,
    unknowns,
)
from gimbalcal.estimate.accelerometers.position_fit import ATTITUDE, HEADER, SAMPLES
from gimbalcal.estimate.extra_effects import NO_EXTENSION, ExtraEffect, unfit
from gimbalcal.estimate.fit import ViewsFit
from gimbalcal.estimate.term_selection import MAX_SCATTER_RATIO, Fits, coefficients, needed, refusal, selected
from gimbalcal.inference.information import Unobservable
from gimbalcal.recording import Recording, dwell_means
from gimbalcal.recording.noise_levels import resolution
from gimbalcal.recording.record import FORCE
from gimbalcal.views.core import View
from gimbalcal.views.norm import SIX_TERMS, attitudes, norm, undetermined_misalignments
from gimbalcal.views.positions import Noise
from gimbalcal.words.naming import listed

TERMS = (*LINEAR, "scale_nonlinearity", "cubic_nonlinearity")


def multiposition(recording: Recording, terms: Sequence[str] = (), more: Sequence[ExtraEffect] = ()) -> Calibration:
    """Calibrate an accelerometer triad from rest positions of unknown attitude.

    terms: ids of effects that act on the force along an axis (default bias, scale_factor and, where the attitudes
    determine it, misalignment; with it scale_nonlinearity and cubic_nonlinearity). Those that the positions do not
    support are declined with a sentence in `unobservable`; what `more` adds is fitted without being asked. Raises
    InputError for an effect that needs angles, for too few positions, or for no gravity.
    """
    requested = {a.effect for a in more}
    view = norm(dwell_means(recording))  # a rest that a row on the way cuts in two is one
    usual = TERMS if set(view.baseline) == set(LINEAR) else tuple(t for t in LINEAR if t in view.baseline)
    wanted = tuple(t for t in (tuple(dict.fromkeys(terms)) or usual) if t not in requested)
    _check(wanted, recording, "--terms")
    _check(tuple(requested), recording, "--with")
    base = tuple(t for t in wanted if t in LINEAR) or ("bias",)
    extra = norm_fit(view, base).extension(more) if more else NO_EXTENSION
    tried, positions = coefficients(wanted) - coefficients(base), f"{len(view)} positions"

    def attempt(terms: tuple[str, ...], without: ViewsFit) -> ViewsFit | str:
        try:
            fit = norm_fit(view, terms, extra)
        except InputError:
            return f"{terms[-1]} is left out: {positions} are fewer than the parameters it would make"
        clear_of = needed(tried, fit.solution.dof if fit.excess > 0 else np.inf)
        return refusal(terms[-1], positions, without, fit, "m/s^2", clear_of, left_out=left_out_rms) or fit

    fits, declined = selected(base, norm_fit(view, base, extra), [t for t in wanted if t not in base], attempt)
    if not terms and usual != TERMS:
        declined["misalignment"] = _too_few_attitudes(view)
    best = fits[-1][1]
    more_sigma = covariance_of_omitted_terms(best, list(declined))
    wider = omitted_terms_in_words(more_sigma, best.covariance)
    reasons = [(term, why + wider) for term, why in declined.items()]
    own = noise_of_a_mean(view, [resolution(recording.channels[FORCE, a]) for a in "xyz"])
    calibration = _calibration(fits, reasons, own)
    return extra.complete(replace(calibration, covariance=calibration.covariance + more_sigma))


def _too_few_attitudes(view: View) -> str:
    """Explain why misalignment is left out of the usual terms, and what would determine it."""
    y = view.source.triad(FORCE)
    none, positions = undetermined_misalignments(y), f"{len(view)} positions in {attitudes(y)} attitudes"
    why = f"do not determine that of {listed(none)}" if none else "leave none to test nine terms"
    between = listed(none or ("xy", "xz", "yz"))
    return (
        f"misalignment is left out: {positions} {why}; it takes ten attitudes or more, among them some that lie "
        f"between the faces of {between}, edges up and edges down"
    )


def usual_accelerometers(recording: Recording) -> Calibration:
    """Return the bias, scale factor and misalignment that the attitudes determine, or an ideal triad where none does.

    What gyroscopes at rest say of their bias and temperature asks for the direction of gravity only.
    """
    view = norm(dwell_means(recording))
    if attitudes(view.source.triad(FORCE)) < coefficients(SIX_TERMS):
        return Calibration.ideal("ideal")
    return multiposition(recording, view.baseline)


def _check(terms: Sequence[str], recording: Recording, option: str) -> None:
    """Raises InputError for a term that these positions cannot show; what it offers instead, they can."""
    for term in terms:
        cls = CATALOGUE.get(term)
        if cls is not None and _without_angles(cls):
            if why := unfit(cls, recording):
                raise InputError(f"{option} names {term}, which {why}")
            if option == "--terms" and follows(cls) == "":
                raise InputError(f"--terms names {term}, which follows a channel: write --with {term}")
        else:
            able = [i for i, c in CATALOGUE.items() if _without_angles(c) and follows(c) != ""]
            allowed = [i for i in able if not unfit(CATALOGUE[i], recording)]
            raise InputError(
                f"{option} names {term!r}, which is not an effect that rest positions without angles can show; "
                f"choose from {', '.join(allowed)}"
            )


def _without_angles(cls: type[Effect]) -> bool:
    return cls.stage in SENSOR_STAGES and cls.channel == FORCE


def _calibration(fits: Fits, declined: Sequence[tuple[str, str]], own: float) -> Calibration:
    best = fits[-1][1]
    solution, source = best.solution, best.views[0].source
    turned = any(q.effect == "misalignment" for q in best.parameters)
    unobservable = rotations_of_the_triad() if turned else []
    unobservable += [Unobservable.of(unknowns([t]), why) for t, why in declined]
    sample, left_out = sample_sigma(best.views[0]), left_out_rms(best)
    noise = Noise(sample, np.inf, HEADER if "accelerometer" in source.noise else SAMPLES, ATTITUDE)
    counts = best.views[0].readout.accelerometers
    options = Options(
        gravity=source.site.gravity,
        direction=DIRECTION,
        excess_scatter=best.excess,
        excess_over_noise=best.excess / own if own else nan,
        condition=best.condition,
        leave_one_out_rms=left_out,
        declined=dict(declined),
        nominal=None if counts is None else {"scale": counts.scale, "offset": counts.offset},
    )
    return best.calibration(
        "multiposition",
        Residual(solution.chi2, solution.dof, {FORCE: best.rms}),
        unobservable=(*best.unobservable, *unobservable),
        outcome=_outcome(best, own),
        provenance=Provenance(recordings=source.source, noise=assumed_noise(noise), options=options),
        stages=tuple(_stage(terms, fitted) for terms, fitted in fits),
    )  # fmt: skip


def _outcome(best: ViewsFit, own: float) -> str:
    if best.steps == 0:
        return "the fit did not settle: the positions do not determine these terms together"
    words = scatter_in_words(best.views[0].source.noise, best.excess, own)
    scaled = "; all sigma are scaled to that scatter, and `gimbalcal diagnose` looks for what the model misses"
    return words and words + scaled


def _stage(terms: Sequence[str], fitted: ViewsFit) -> StageResult:
    left_out, positions = left_out_rms(fitted), len(fitted.views[0])
    omitted = f", {left_out:.2g} m/s^2 for a position left out" if np.isfinite(left_out) else ""
    words = f"norm of gravity at {positions} positions; condition number {fitted.condition:.0f}{omitted}"
    return fitted.stage(" + ".join(terms), words)


def noise_of_a_mean(view: View, steps: Sequence[float]) -> float:
    """Return the noise [m/s^2] of the mean of a position from that of a sample; 0 where it is unknown.

    Where samples scatter less than a step of the converter, (3,) in the unit of the readings, their mean is no better.
    """
    if not view.source.sigma("accelerometer"):
        return 0.0
    sample, counts = sample_sigma(view), view.readout.accelerometers
    own = sample / float(np.sqrt(np.median(view.source.weight)))
    step = max(np.multiply(steps, counts.scale if counts else 1.0))
    return float(max(own, step / np.sqrt(12))) if sample < step else own


def scatter_in_words(stated: Container[str], excess: float, own: float) -> str:
    """A sentence where positions scatter by `excess` [m/s^2] far beyond `own`, the noise of their means.

    stated: sensors whose noise the header states.
    """
    if not own or excess <= MAX_SCATTER_RATIO * own:
        return ""
    of = "stated noise" if "accelerometer" in stated else "scatter of the samples"
    return (
        f"the positions scatter by {excess:.2g} m/s^2 about the model, {excess / own:.2g} times what the {of} explains "
        f"({own:.2g} m/s^2 for the mean of a position)"
    )
