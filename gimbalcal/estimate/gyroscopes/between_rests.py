r"""Gyroscopes from turns between rests, with the direction of gravity as the only reference.

A unit in the hand, no table: the calibrated accelerometers say where down is before and after each turn, the
gyroscopes what happened between,

.. math:: \hat f_{i+1} = \prod_k \exp(-[\omega_k \Delta t \times]) \, \hat f_i, \qquad y = h(\omega)

(Tedaldi et al. 2014). Direction: physics to reading; the rates are solved from the readings for any effects of the
gyroscope stage, and derivatives are exact. The frame is that of the accelerometers, so the six misalignments hold the
rotation between the triads too. The Earth's rate is left out: 15 deg/h, below what a hand-turned unit can see.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from gimbalcal.calibration import DIRECTION, Calibration, Counts, Options, Provenance, Readout, Residual
from gimbalcal.effects import CATALOGUE, Effect, Parameter, parameters, parameters_of_effects, with_values
from gimbalcal.effects.baseline_effects import GYROSCOPE_INPUT_TERMS
from gimbalcal.effects.effect import GYROSCOPE_STAGES, lacking_quantity
from gimbalcal.effects.gyroscope import rate_matrix
from gimbalcal.errors import InputError
from gimbalcal.estimate.accelerometers.fit_summary import joined_sentences
from gimbalcal.estimate.extra_effects import NO_EXTENSION, Extension, ExtraEffect, extension
from gimbalcal.estimate.fit import ViewsFit
from gimbalcal.estimate.gyroscopes.residual_checks import (
    astray_in_words,
    rests_in_words,
    singular_in_words,
    sizes_in_words,
    turns_in_words,
    undetermined_in_words,
)
from gimbalcal.estimate.gyroscopes.rest_and_turn_fits import (
    BIAS,
    G_SENSITIVITY,
    by_motion,
    determined_parameters,
    fit_rests,
    fit_turns,
    level_of,
    levelled_by,
    rests_joined_by_turns,
)
from gimbalcal.estimate.gyroscopes.revolutions import euler_angles
from gimbalcal.estimate.term_selection import Fits, needed_significance, refusal_sentence, select_terms
from gimbalcal.inference.algebra import block_diagonal
from gimbalcal.inference.information import Unobservable
from gimbalcal.number import Array
from gimbalcal.recording import Recording
from gimbalcal.units import from_si
from gimbalcal.views.core import View
from gimbalcal.views.turns import Turns, gravity_after_turns, turns_between_rests

LINEAR = GYROSCOPE_INPUT_TERMS
HARDLY_SHOWN = "the turns hardly show it"
FURTHER_TERMS = ("gyro_scale_nonlinearity", "gyro_scale_asymmetry", "gyro_scale_temperature", G_SENSITIVITY)


def gyroscopes_between_rests(
    recording: Recording, accelerometers: Calibration, terms: Sequence[str] = (), more: Sequence[ExtraEffect] = ()
) -> Calibration:
    """Calibrate gyroscopes against accelerometers from a recording of rests with turns between them.

    terms: gyroscope effects other than the bias (default: scale factor, misalignment, and of scale nonlinearity,
    asymmetry, temperature and g-sensitivity what the recording supports); the others are declined with a
    sentence, all of them if no errors of the gyroscopes explain the turns; a term that is truly zero is added once in
    200 calibrations (`term_selection`). The g-sensitivity comes from the rests. What `more` adds is fitted in
    any case, at rest or on the way. Raises InputError where there are too few turns or no rates, or turns that give
    counts no size.
    """
    requested, further = (
        {a.effect for a in more},
        [t for t in FURTHER_TERMS if not lacking_quantity(CATALOGUE[t], recording.has)],
    )
    wanted = tuple(t for t in (tuple(dict.fromkeys(terms)) or (*LINEAR, *further)) if t not in requested)
    for t in wanted:
        _refuse_term(t, lacking_quantity(CATALOGUE[t], recording.has) if t in CATALOGUE else "", recording.title)
    turns = turns_between_rests(recording, accelerometers)
    terms_moving = tuple(t for t in wanted if t != G_SENSITIVITY)
    base = tuple(t for t in terms_moving if t in LINEAR) or terms_moving[:1]
    tried = len(parameters_of_effects(t for t in wanted if t not in base))
    still = rests_joined_by_turns(recording, accelerometers, turns)
    extra = _extension(more, still, turns, base)
    at_rest, moving = by_motion(extra, still)
    level, why = level_of(still, G_SENSITIVITY in wanted, tried, at_rest)
    turns = levelled_by(level, turns)
    further = [t for t in terms_moving if t not in base]
    fits, declined, doubt, undetermined = Fits(), dict[str, str](), list[str](), list[Parameter]()
    if base or moving.parameters:
        own = determined_parameters(turns, base)
        undetermined = [p for p in parameters_of_effects(base) if p not in own]
        linear = fit_turns(turns, own, moving)
        doubt = [] if moving.parameters else singular_in_words(linear.condition) or astray_in_words(turns, linear.rms)
        if doubt and turns.scale != 1.0:
            raise InputError(f"{doubt[0]}; nor do they show what a count of the rates is")
        if doubt:  # a size would mean nothing
            declined = {t: f"{t} is left out: {doubt[0]}" for t in terms_moving}
        else:
            fits, declined = select_terms(
                base,
                linear,
                further,
                lambda terms, without: _attempt_terms(turns, terms, without, tried, moving),
            )
    if why:
        declined[G_SENSITIVITY] = why
    sentences = rests_in_words(level) + doubt
    if fits:
        taken_up, fit = fits[-1]
        fit = fit.with_fixed_nuisances([gravity_after_turns(turns, fit.effects)])
        fits[-1] = taken_up, fit
        sentences += singular_in_words(fit.condition) or (
            turns_in_words(turns, level.residual[0], fit.rms)
            + sizes_in_words(turns, fit)
            + undetermined_in_words(undetermined)
        )
    calibration = _calibration(level, fits, declined, undetermined if fits else (), turns.scale)
    calibration = replace(calibration, outcome=joined_sentences(sentences))
    return extra.complete(calibration)


def _extension(more: Sequence[ExtraEffect], still: View, turns: Turns, base: tuple[str, ...]) -> Extension:
    """The extra effects, with constants that start where rests and turns together fit best."""
    if not more:
        return NO_EXTENSION
    sizes = tuple(p for e in more for p in e.parameters(()))

    def misfit(effects: Sequence[Effect]) -> float:
        at_rest, moving = by_motion(Extension(tuple(effects), sizes), still)
        rest = fit_rests(still, (BIAS,), at_rest)
        total = float(((rest.residual[0] / np.asarray(still.noise.sigma)) ** 2).sum())
        if moving.parameters:
            turned = fit_turns(turns, parameters_of_effects(base), moving)
            total += turned.residual[0].size * float(np.log(turned.rms**2))  # of rows whose scale is not known
        return total

    return extension(more, sizes, still.stimulus, misfit)


def _refuse_term(term: str, missing: str, title: str) -> None:
    """Raise InputError for a term that turns between rests cannot show, or not without the channel that is missing."""
    if term not in CATALOGUE or CATALOGUE[term].stage not in GYROSCOPE_STAGES or term == BIAS:
        raise InputError(f"--terms names {term!r}, which is not a gyroscope effect that turns between rests can show")
    if missing:
        raise InputError(f"--terms names {term}, which needs the channel {missing}; {title!r} has none")


def _attempt_terms(
    turns: Turns, terms: tuple[str, ...], without: ViewsFit, tried: int, extra: Extension
) -> ViewsFit | str:
    """The fit with the last of the terms, or why the turns do not support it."""
    own = [p for p in determined_parameters(turns, terms) if p.effect == terms[-1]]
    if not own:
        return f"{terms[-1]} is left out: {HARDLY_SHOWN}"
    before = [p for p in without.parameters if p not in extra.parameters]
    try:
        fit = fit_turns(turns, (*before, *own), extra)
    except InputError as problem:
        return f"{terms[-1]} is left out: {problem}"
    sigma, clear_of = np.maximum(fit.sigmas, fit.left_out[1]), needed_significance(tried, _degrees_of_freedom(fit))
    return refusal_sentence(terms[-1], f"{len(fit.residual[0])} turns", without, fit, "rad", clear_of, sigma) or fit


def _degrees_of_freedom(fit: ViewsFit) -> int:
    return fit.residual[0].size - len(fit.x)


def _calibration(
    level: ViewsFit, fits: Fits, declined: dict[str, str], undetermined: Sequence[Parameter], scale: float
) -> Calibration:
    fit = fits[-1][1] if fits else None
    wanted = (*level.parameters, *(fit.parameters if fit else ()))
    x = np.concatenate([level.x, fit.x if fit else np.zeros(0)])
    source = level.views[0].source
    nominal = {"scale": scale} if scale != 1.0 else None
    options = Options(direction=DIRECTION, declined=declined, frame="accelerometers", nominal=nominal)
    rms = {"rate_at_rest": level.rms}
    if fit:
        turn = tuple(float(from_si(a, "arcsec")) for a in _inter_triad(dict(zip(fit.parameters, fit.x, strict=True))))
        options = replace(options, condition=fit.condition, leave_one_out_rms=fit.left_out_rms, inter_triad_arcsec=turn)
        rms["gravity_direction"] = fit.rms
    readout = Readout(gyroscopes=Counts((scale,) * 3) if scale != 1.0 else None, gimbals=source.platform.axis_names)
    stages = tuple(
        f.stage(
            " + ".join(terms),
            f"gravity after {len(f.residual[0])} turns; condition number {f.condition:.0f}, {f.left_out_rms:.2g} rad "
            "for a turn left out",
        )
        for terms, f in fits
    )
    dof = _degrees_of_freedom(fit or level)
    return Calibration(
        "turns", with_values((*level.effects, *(fit.effects if fit else ())), wanted, x), wanted,
        block_diagonal([f.covariance for f in (level, fit) if f]),
        (
            *(Unobservable.of([p], HARDLY_SHOWN) for p in undetermined),
            *(Unobservable.of(parameters(CATALOGUE[t]), why) for t, why in declined.items()),
        ),
        Residual(float(dof), dof, rms),
        provenance=Provenance(recordings=source.source, options=options),
        stages=stages,
        readout=readout,
    )  # fmt: skip


def _inter_triad(own: Mapping[Parameter, float]) -> Array:
    """alpha, beta, gamma [rad] of C_p^q, Eq. (43): the rotation that is left when Eq. (8) has taken the triangle."""
    M = rate_matrix(*(np.array([own.get(p, 0.0) for p in parameters(CATALOGUE[i])]) for i in LINEAR))
    # omega^p = M^-1 y = C_q^p (C_g^q K) y: orthogonal times lower triangular, by QR of the matrix read backwards
    Q, R = np.linalg.qr(np.linalg.inv(M)[:, ::-1])
    C_pq = (Q * np.sign(np.diag(R)))[:, ::-1]
    return euler_angles(C_pq.T)
