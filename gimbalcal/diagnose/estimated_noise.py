"""The diagnosis of one view whose scale of noise is fitted: verdict, findings, and how well the model then fits.

A sensor that may walk alone competes with the causes that are found: where its walk is nearly as likely, the view is
searched once more with that walk among its noises.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from gimbalcal.calibration import Calibration
from gimbalcal.diagnose.answer import Curves, plotted_against
from gimbalcal.diagnose.evidence.channel_scales import likeliest_scales
from gimbalcal.diagnose.evidence.odds import CLAIM, SURE_PROBABILITY
from gimbalcal.diagnose.laws.law_claims import (
    LawSearchResult,
    against_walk,
    causes_replaced_by_a_formula,
    laws_of_view,
    with_heldout,
)
from gimbalcal.diagnose.library.assemble import assemble_library
from gimbalcal.diagnose.result import Shape
from gimbalcal.diagnose.search.ranking import projections_of, rms_misfit
from gimbalcal.diagnose.search.refit import with_constants
from gimbalcal.diagnose.search.relinearise import about_first_cause
from gimbalcal.diagnose.search.sensor_random_walks import wandering_in
from gimbalcal.diagnose.search.stepwise import (
    SearchResult,
    ln_evidence,
    ln_odds,
    log_shares,
    result_of,
    stepwise,
)
from gimbalcal.diagnose.verdict.findings import confirm_causes, drifts_as_one, finding_of_view, judged_in_turn
from gimbalcal.diagnose.verdict.judgement import Judgement
from gimbalcal.diagnose.verdict.mismatch import view_mismatches
from gimbalcal.diagnose.verdict.random_walk import (
    PartOfWalk,
    RandomWalkFinding,
    clearest_walk_of_triad,
    likeliest_walk,
    part_of_walk,
)
from gimbalcal.diagnose.verdict.threshold import detection_limits
from gimbalcal.diagnose.verdict.verify import row_sigma, view_fit
from gimbalcal.diagnose.view_result import ViewDiagnosis, shapes_with_laws
from gimbalcal.effects.effect import constants
from gimbalcal.estimate.extra_effects import as_option
from gimbalcal.estimate.pointing.fit import usual_terms
from gimbalcal.number import Array
from gimbalcal.progress import Progress
from gimbalcal.units import from_si
from gimbalcal.views.core import Fit, View
from gimbalcal.words import diagnosis_sentences, law_sentences

SURE_ODDS = float(np.log(SURE_PROBABILITY / (1 - SURE_PROBABILITY)))  # ln odds of a formula that replaces causes
MIN_SETTINGS = 20  # whose residuals show a correlation
SERIAL_SIGMAS = 5.0  # of a correlation of successive residuals that is none by chance


def select_causes(v: View, progress: Progress) -> SearchResult:
    """Return the causes that a view whose scale of noise is fitted is likeliest to lack, before they are judged."""
    return about_first_cause(stepwise(v, progress), progress)


def diagnose_selected(c: SearchResult, progress: Progress) -> ViewDiagnosis:
    """Return the diagnosis of a view whose scale of noise is fitted, in which one sensor, or a triad, may walk.

    The channels of stars share one scale unless the diagnosis in scales of their own explains them better: then the
    readout of one axis is noisy or set loosely, and in a common scale chance fits of its channel gain more than they
    should, causes in the other less. Mid-search a scale of its own takes what is not explained yet for noise.
    """
    steady = judged_diagnosis(c, progress)
    if c.start.exact:
        return steady
    v, end = c.start.view, c.end
    if v.kind.sighting and not v.noise.of_each_channel and likeliest_scales(end.residual, end.jacobian) is not None:
        progress("once more, as the channels scatter differently")
        own = judged_diagnosis(select_causes(v.of_own_scales(), progress), progress)
        return own if own.ln_evidence() > steady.ln_evidence() + CLAIM else steady
    walking, ln_total, ln_odds = wandering_in(c)
    if not walking.noise.sensors_walk:
        return steady
    walk = _walk_of_sensors(replace(c.start, view=walking), ln_odds, ln_total)
    progress(f"again, as {diagnosis_sentences.walk_in_words(walk).partition(' wander')[0]} may wander")
    again = judged_diagnosis(stepwise(walking, progress), progress)
    part = part_of_walk(ln_odds, bool(again.findings), bool(again.unexplained), bool(steady.findings))
    if part is PartOfWalk.INSTEAD and walking.added is not None:  # noise that every unit has, if not as much
        return replace(again, outcome=diagnosis_sentences.walk_to_state(walk))
    if part is PartOfWalk.INSTEAD:
        return _view_diagnosis(result_of(c.start, (), refused=True), (), progress, walk)
    return (steady if part is PartOfWalk.SHARED else again).with_part_of_walk(replace(walk, part=part))


def judged_diagnosis(c: SearchResult, progress: Progress) -> ViewDiagnosis:
    """Return the diagnosis that a search through a view ends in."""
    c, verdicts = confirm_causes(c, progress)
    by_causes = _view_diagnosis(c, verdicts, progress)
    formulas = partial(_by_formulas, by_causes, c, verdicts, progress) if verdicts and not c.start.exact else None
    return by_causes.tested(formulas)


def _by_formulas(
    by_causes: ViewDiagnosis, c: SearchResult, verdicts: Sequence[Judgement], progress: Progress
) -> tuple[ViewDiagnosis | None, frozenset[str]]:
    """Return the diagnosis by a formula in the place of causes that it is much likelier than, if there are any.

    Together with what else is then stated, the formula also has to be surer than all that is stated with the causes.
    """
    progress("comparing the causes with formulas in what was recorded")
    replaced, doubtful = causes_replaced_by_a_formula(c, [j.cause for j in verdicts])
    names = {cause.key for cause in replaced}
    rest = [this for this in c.causes if this[0].key not in names]
    if not names:
        return None, doubtful
    without = result_of(c.start, rest, [x for x in c.standard if x in rest], refused=True)
    kept = [j for j in verdicts if j.cause.key not in names]
    formulas = _view_diagnosis(without, kept, progress, refused=True).tested(None)
    likelier = formulas.laws and formulas.ln_evidence() > by_causes.ln_evidence() + SURE_ODDS
    return (formulas if likelier else None), doubtful


def _view_diagnosis(
    c: SearchResult, verdicts: Sequence[Judgement], progress: Progress, walk: RandomWalkFinding | None = None,
    refused: bool = False,
) -> ViewDiagnosis:  # fmt: skip
    """Return the diagnosis of a search whose causes have been judged, with formulas for what has no known cause.

    walk: that of a sensor which the formulas compete with; then something is missing even if it has no shape. refused:
    whether a cause has been removed for a formula.
    """
    v = c.start.view
    model = with_constants(c.end, {j.cause.effect for j in verdicts})
    findings = drifts_as_one([finding_of_view(model, j) for j in verdicts])
    shapes = tuple(Shape(f"{s.channel if v.added else v.channels[0][0]} {s.axis}".strip(), s.rival) for s in c.shapes)
    verdict = "adequate"
    if findings:
        verdict = "missing-physics" if any(not f.twins for f in findings) else "not-identifiable"
    elif shapes or walk is not None:
        verdict = "unexplained"
    sigma = row_sigma(c.with_shapes)
    fit, law_search, odds = view_fit(c, sigma), LawSearchResult(), np.inf
    if not c.start.exact and (shapes or not findings or refused):
        progress(law_sentences.SEARCHING)
        of_method = usual_terms(v.stimulus.axis_names) if v.kind.sighting else ()  # which --with does not take
        known = [as_option(f.effect, f.axis) for f in findings if f.effect not in of_method]
        law_search, with_law = laws_of_view(c.missing, sigma, known)
        c_law = replace(c, with_shapes=with_law)
        fit_law = view_fit(c_law, row_sigma(with_law)) if law_search.laws else fit
        if law_search.known and not findings and not refused and walk is None:
            with_known = result_of(c.start, law_search.known, refused=True)
            perhaps = _view_diagnosis(with_known, judged_in_turn(with_known), progress, refused=True).tested(None)
            return replace(perhaps.doubted(perhaps.effects_found), unexplained=shapes)
        law_search = with_heldout(law_search, fit_law)
        if walk is not None:
            advice = diagnosis_sentences.repeat_advice(v.kind.stabilised, by_hand=not v.stimulus.axis_names)
            law_search, odds = against_walk(law_search, walk, advice)
        if law_search.laws:
            c, fit, sigma = c_law, fit_law, row_sigma(with_law)
            shapes = shapes_with_laws(shapes, law_search.laws)
            verdict = "unexplained" if not findings else verdict
        elif findings or verdict == "adequate":
            law_search = LawSearchResult()
    recommend, outcome = law_search.recommend, ""
    if verdict == "adequate" and (serial := serial_correlation(c.end, sigma)):
        verdict, recommend = "unexplained", diagnosis_sentences.REORDER_SETTINGS
        shapes = tuple(Shape(channel, diagnosis_sentences.SERIAL_CORRELATION) for channel in serial)
        outcome = diagnosis_sentences.serial_correlation(v, max(serial.values()), len(sigma) ** -0.5)
    if verdict == "adequate" and not c.start.exact:
        remaining = assemble_library(c.end)
        limits = detection_limits([(remaining.candidates, projections_of(c.end, remaining.X))])
        fit = replace(fit, unseen=limits if remaining.candidates else None)
    if verdict == "adequate":
        outcome = diagnosis_sentences.untested_in_words(v, fit)
    mismatch = () if verdict == "adequate" else view_mismatches(c.start, sigma)
    diagnosis = ViewDiagnosis(
        v, verdict, mismatch, findings, shapes, fit, curves_of(c, sigma), model, laws=law_search.laws,
        recommend=recommend, outcome=outcome, without=partial(calibration_without, model) if v.calibrate else None,
        ln_evidence=partial(_evidence_of_statements, c, law_search),
    )  # fmt: skip
    return diagnosis if walk is None else diagnosis.against_walk(walk, odds)


def _evidence_of_statements(c: SearchResult, law_search: LawSearchResult) -> float:
    """Return ln p(y) of what is stated: the causes of a search and a formula of what they leave, not a shape."""
    share = log_shares(c.start.view, assemble_library(c.start))
    return ln_odds(c.start, c.causes, share) + ln_evidence(c.start) + max(0.0, law_search.ln_total)


def calibration_without(m: Fit, left_out: str) -> Calibration:
    """Return the calibration of the navigator behind a view with the effects of a model, but for one of this id."""
    assert m.view.calibrate is not None
    names = {e.id: {f.name for f in constants(type(e))} for e in m.effects}
    linear = [p for p in m.parameters if p.effect != left_out and p.field not in names[p.effect]]
    return m.view.calibrate([e for e in m.effects if e.id != left_out], linear)


def serial_correlation(m: Fit, sigma: Array) -> dict[str, float]:
    """Return the correlation of successive residuals in `sigma` (n, C) by channel, where settings show one.

    A sensor that is read on and on has noise with a memory, and so has the seeing of a star that is followed. Separate
    settings of an encoder have none: where one resembles the next, something depends on the angle or on time, whether
    or not it is likelier than a noise with a memory. Among white residuals a correlation has a sigma of n^(-1/2).
    """
    v = m.view
    if m.exact or not v.separate_settings or len(m.residual) < MIN_SETTINGS:
        return {}
    r = m.residual / sigma
    each = (r[1:] * r[:-1]).sum(axis=0) / np.maximum((r**2).sum(axis=0), 1e-300)
    limit = SERIAL_SIGMAS * len(r) ** -0.5
    return {" ".join(key): float(x) for key, x in zip(v.channels, each, strict=True) if x > limit}


def _walk_of_sensors(first: Fit, ln_odds: float, ln_total: float) -> RandomWalkFinding:
    """Return the sensor that walks alone in the noises of a view, or the triad that walks, and the size of its walk."""
    unit, bare = rms_misfit(first), np.zeros((first.residual.size, 0))
    each = [p for p in projections_of(first, bare) if p.node.noise]
    ln = np.array([p.log_evidence() for p in each])
    weight, sigma = np.exp(ln - ln.max()), unit * np.array([float(p.scale.sigma(p.misfit[0])) for p in each])
    nodes = [p.node for p in each]
    if first.view.added is not None:
        return clearest_walk_of_triad(nodes, weight, sigma, ln_odds, ln_total)
    own = np.array([n.scales or (1.0,) for n in nodes]) * (first.view.noise.scales or (1.0,))
    of_axis = {axis: sigma * own[:, k % own.shape[1]] for k, axis in enumerate("xyz")}
    return likeliest_walk(nodes, weight, of_axis, first.view.channels[0][0], ln_odds, ln_total)


def curves_of(c: SearchResult, sigma: Array) -> Curves:
    """Return the misfits of a view without and with the findings for a picture, in rows of `sigma` (n, C)."""
    v, n = c.start.view, len(c.start.residual)
    number = np.ones(n) if v.label is None else v.label
    before, after = c.start.residual / sigma, c.with_shapes.residual / sigma
    against = plotted_against(v.stimulus) if len(v.stimulus.time) == n else {}
    in_print = np.asarray(from_si(sigma, v.unit))
    words = tuple(
        v.measurement.channel.format(axis=axis).removeprefix("the ").removeprefix("direction of ")
        for _, axis in v.channels
    )
    return Curves(v.time, number, v.channels, before, after, in_print, (v.unit,) * len(v.channels), against, words)
