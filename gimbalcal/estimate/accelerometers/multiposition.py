r"""Accelerometers from rest in many positions, no angles needed: the norm of the force is gravity at any attitude.

Wang et al. (2019), section 4.1, with the effects of the catalogue instead of one polynomial: every dwell has an
attitude of its own that is not known, and what the three readings of a dwell say beyond that attitude is one number,
the misfit of the norm. Direction: physics to reading, as everywhere in `effects`; `estimate.pulses` is the other one.

Terms beyond bias, scale factor and misalignment are taken up one at a time, the one that predicts left-out positions
best first, and only while the positions support them: a coefficient must stand clear of its sigma (`term_selection`),
and positions left out must be predicted no worse.

Rests may scatter beyond the noise of their means; how far is estimated with the terms, and widens their sigmas.

A term that is declined, as its coefficients do not stand clear of chance, need not be zero. With J and C the whitened
rows of what is estimated and of what is not, r the misfit, and c normal with the usual size of such a unit, what is
known of c after the fit is

.. math:: \Lambda = C^T M C + D^{-2}, \quad M = 1 - J J^+, \qquad
          \langle c c^T \rangle = \Lambda^{-1} + \bar c \bar c^T, \quad \bar c = \Lambda^{-1} C^T M r

and the estimates, whose covariance is P, err by S c with S = P J^T C besides: their covariance grows by
S <c c^T> S^T. Source: Bierman, *Factorization Methods for Discrete Sequential Estimation* (1977), chapter 8 (consider
parameters).
"""

from __future__ import annotations

from collections.abc import Container, Sequence
from dataclasses import replace
from math import nan

import numpy as np

from gimbalcal.calibration import DIRECTION, Calibration, Options, Provenance, Residual, StageResult
from gimbalcal.effects import CATALOGUE, Effect, Parameter, parameters_of_effects, values
from gimbalcal.effects.effect import SENSOR_STAGES, followed_covariate, without_gauge
from gimbalcal.errors import InputError, number_of
from gimbalcal.estimate.accelerometers.fit_summary import assumed_noise, rotations_of_the_triad
from gimbalcal.estimate.accelerometers.position_fit import ATTITUDE, HEADER, SAMPLES
from gimbalcal.estimate.extra_effects import NO_EXTENSION, Extension, ExtraEffect, WhyNotShown
from gimbalcal.estimate.fit import ViewsFit, fit
from gimbalcal.estimate.term_selection import (
    MAX_SCATTER_RATIO,
    Fits,
    needed_significance,
    refusal_sentence,
    select_terms,
)
from gimbalcal.inference.ellipsoid import MIN_POINTS, ellipsoid
from gimbalcal.inference.information import Unobservable
from gimbalcal.number import Array
from gimbalcal.recording import Recording, dwell_means
from gimbalcal.recording.dwell import attitudes
from gimbalcal.recording.noise_levels import resolution
from gimbalcal.recording.record import FORCE
from gimbalcal.views.core import View
from gimbalcal.views.norm import SIX_TERMS, in_noise_of_readings, norm, undetermined_misalignments
from gimbalcal.views.positions import Noise
from gimbalcal.words.naming import list_in_words

LINEAR = ("scale_factor", "bias", "misalignment")
PRIOR_FACTOR = 100.0  # times the prior scale of a navigation platform: low-cost units reach 50 mg, 5 % and 3 deg
MAX_LEVERAGE = 1 - 1e-9  # of a position
UNKNOWN_SCATTER_G = 1e-6  # of gravity, a sample where none is known: far below any rig, the excess takes over
NOTABLE_SIGMAS = 1.0  # by which an omitted term must move an estimate to be worth a word
# x of the orthogonal frame lies along the first input axis, y in the plane of the first two: Eq. (5)


def parameters_of_terms(terms: Sequence[str]) -> tuple[Parameter, ...]:
    """Parameters of the terms; of the six misalignments the three that the norm can see."""
    return tuple(replace(p, sigma=PRIOR_FACTOR * p.sigma) for p in without_gauge(parameters_of_effects(terms)))


def norm_fit(view: View, terms: Sequence[str], extra: Extension = NO_EXTENSION) -> ViewsFit:
    """Fit the terms to the norm of gravity. The scatter beyond the noise of the means is estimated with it."""
    wanted = (*parameters_of_terms(terms), *extra.parameters)
    y, g, m = view.source.triad(FORCE), view.stimulus.gravity, len(view)
    different = attitudes(y)
    if m < len(wanted) or different < min(len(wanted), len(parameters_of_terms(SIX_TERMS))):
        raise InputError(
            f"{view.title!r} holds {number_of(m, 'rest position')} in "
            f"{number_of(different, 'attitude')} for "
            f"{number_of(len(wanted), 'parameter')} ({', '.join(terms)}): hold the unit in more attitudes, "
            "each axis up and down at least"
        )
    least = 0.0 if view.noise.sample is not None else sample_sigma(view)
    return fit([in_noise_of_readings(view)], wanted, extra.effects, _start(y, wanted, g), min_excess=least)


def sample_sigma(view: View) -> float:
    """Return one sigma [m/s^2] of a sample; where none is known, that of a perfect rig."""
    return view.source.sigma("accelerometer") or UNKNOWN_SCATTER_G * view.stimulus.gravity


def left_out_rms(fitted: ViewsFit) -> float:
    """Return the rms misfit [m/s^2] of positions that took no part; nan where one alone determines a parameter."""
    Q = np.linalg.qr(fitted.whitened[0])[0]
    return fitted.left_out_rms if np.all((Q**2).sum(1) < MAX_LEVERAGE) else np.nan


def _start(y: Array, wanted: Sequence[Parameter], g: float) -> Array:
    """Linear start [SI] from the ellipsoid through the readings y (m, 3), turned to the direction of the effects."""
    solution = ellipsoid(y[None] / g)[0] if len(y) >= MIN_POINTS else np.full(9, np.nan)
    if not np.isfinite(solution).all():
        return np.array([q.mean for q in wanted])
    K1, bias, (yx, zx, zy) = solution[:3], solution[3:6], solution[6:]
    start = {("scale_factor", i): K1[i] - 1 for i in range(3)} | {("bias", i): -g * bias[i] / K1[i] for i in range(3)}
    inverse = {"yz": yx, "zy": -(zx - zy * yx), "zx": zy}  # the inverse of Eq. (5), in the betas of Wu et al.'s Eq. (5)
    return np.array(
        [inverse[q.axis] if q.effect == "misalignment" else start.get((q.effect, q.index), q.mean) for q in wanted]
    )


def covariance_of_omitted_terms(fitted: ViewsFit, terms: Sequence[str]) -> Array:
    """Return the increase of the covariance (p, p) of a fit by terms that are omitted from it; zero for none."""
    view, solution, n = fitted.views[0], fitted.solution, len(fitted.solution.parameters)
    omitted = tuple(map(view.grade.usual, parameters_of_effects(terms)))
    if not omitted:
        return np.zeros((n, n))
    every = (*solution.parameters, *omitted)
    both, r = fitted.rows_by(every, values(fitted.effects, every))
    J, C = both[:, :n], both[:, n:]
    Q = np.linalg.qr(J)[0]
    C_left, r_left = C - Q @ (Q.T @ C), r - Q @ (Q.T @ r)
    known = np.linalg.inv(C_left.T @ C_left + np.diag([1 / q.sigma**2 for q in omitted]))
    mean = known @ C_left.T @ r_left
    S = solution.covariance @ J.T @ C
    return np.asarray(S @ (known + np.outer(mean, mean)) @ S.T)


def omitted_terms_in_words(added: Array, covariance: Array) -> str:
    """Describe the largest increase of a sigma as the end of a sentence; empty where it is small."""
    own, more = np.diag(covariance), np.diag(added)
    times = float(np.sqrt(np.max(more / own))) if len(own) else 0.0
    return (
        ""
        if times < NOTABLE_SIGMAS
        else f"; of usual size it moves an estimate by {times:.2g} of its sigma, which is wider for it"
    )


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
    _refuse_undetermined_term(wanted, recording.why_not_shown, "--terms")
    _refuse_undetermined_term(tuple(requested), recording.why_not_shown, "--with")
    base = tuple(t for t in wanted if t in LINEAR) or ("bias",)
    extra = norm_fit(view, base).extension(more) if more else NO_EXTENSION
    further, positions = [t for t in wanted if t not in base], f"{len(view)} positions"
    tried = len(parameters_of_effects(further))

    def attempt(terms: tuple[str, ...], without: ViewsFit) -> ViewsFit | str:
        try:
            fit = norm_fit(view, terms, extra)
        except InputError:
            return f"{terms[-1]} is left out: {positions} are fewer than the parameters it would make"
        clear_of = needed_significance(tried, fit.solution.dof if fit.excess > 0 else np.inf)
        return refusal_sentence(terms[-1], positions, without, fit, "m/s^2", clear_of, left_out=left_out_rms) or fit

    fits, declined = select_terms(base, norm_fit(view, base, extra), further, attempt)
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
    why = f"do not determine that of {list_in_words(none)}" if none else "leave none to test nine terms"
    between = list_in_words(none or ("xy", "xz", "yz"))
    return (
        f"misalignment is left out: {positions} {why}; it takes ten attitudes or more, among them some that lie "
        f"between the faces of {between}, edges up and edges down"
    )


def usual_accelerometers(recording: Recording) -> Calibration:
    """Return the bias, scale factor and misalignment that the attitudes determine, or an ideal triad where none does.

    What gyroscopes at rest say of their bias and temperature asks for the direction of gravity only.
    """
    view = norm(dwell_means(recording))
    if attitudes(view.source.triad(FORCE)) < len(parameters_of_effects(SIX_TERMS)):
        return Calibration.ideal("ideal")
    return multiposition(recording, view.baseline)


def _refuse_undetermined_term(terms: Sequence[str], why_not: WhyNotShown, option: str) -> None:
    """Raises InputError for a term that these positions cannot show; what it offers instead, they can."""
    for term in terms:
        cls = CATALOGUE.get(term)
        if cls is not None and _without_angles(cls):
            if why := why_not(cls):
                raise InputError(f"{option} names {term}, which {why}")
            if option == "--terms" and followed_covariate(cls) == "":
                raise InputError(f"--terms names {term}, which follows a channel: write --with {term}")
        else:
            able = [i for i, c in CATALOGUE.items() if _without_angles(c) and followed_covariate(c) != ""]
            allowed = [i for i in able if not why_not(CATALOGUE[i])]
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
    unobservable += [Unobservable.of(parameters_of_terms([t]), why) for t, why in declined]
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
    outcome = "the fit did not settle: the positions do not determine these terms together"
    if best.steps:
        outcome = scatter_in_words(source.noise, best.excess, own)
        scaled = "; all sigma are scaled to that scatter, and `gimbalcal diagnose` looks for what the model misses"
        outcome += scaled if outcome else ""
    return best.calibration(
        "multiposition",
        Residual(solution.chi2, solution.dof, {FORCE: best.rms}),
        unobservable=(*best.unobservable, *unobservable),
        outcome=outcome,
        provenance=Provenance(recordings=source.source, noise=assumed_noise(noise), options=options),
        stages=tuple(_stage(terms, fitted) for terms, fitted in fits),
    )


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
