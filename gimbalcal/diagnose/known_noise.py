r"""Diagnosis of forces at known attitude in a noise of known scale: one recording, or several of one unit.

view 1 ──> search ─┐                                     ┌─> verify, locate ─┐
view 2 ──> search ─┴─> combine ──> decide ──> joint fit ─┴─> verify, locate ─┴─> one diagnosis

Of one recording the combined ranking is its own search, and the joint fit is its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from gimbalcal.calibration import Calibration
from gimbalcal.diagnose.answer import Curves, in_print, plotted_against
from gimbalcal.diagnose.evidence.correlated_noise import possible_noises
from gimbalcal.diagnose.evidence.odds import CLAIM
from gimbalcal.diagnose.evidence.stated_noise import scale_to_scatter
from gimbalcal.diagnose.laws.law_claims import (
    MIN_EXPLAINED,
    LawSearchResult,
    beyond_walk,
    law_beyond_shapes,
    law_of_misfit,
    leave_more_than_noise,
)
from gimbalcal.diagnose.library.assemble import assemble_library
from gimbalcal.diagnose.result import (
    Evidence,
    FitSummary,
    Mismatch,
    RecordingFit,
    SeparateVerdict,
    Shape,
    StatedNoiseFit,
)
from gimbalcal.diagnose.search.combine import combine_rankings
from gimbalcal.diagnose.search.fitted_causes import fit_causes
from gimbalcal.diagnose.search.ranking import Ranking, Search, search
from gimbalcal.diagnose.search.refit import fit_baseline
from gimbalcal.diagnose.search.relinearise import about_causes, about_settings
from gimbalcal.diagnose.search.sensor_random_walks import likely_wandering_noises
from gimbalcal.diagnose.verdict.agreement import ConstantsAgreement
from gimbalcal.diagnose.verdict.decide import Decision, claim_threshold, decide_unnamed, noise_gain
from gimbalcal.diagnose.verdict.findings import findings_of_recordings
from gimbalcal.diagnose.verdict.joint_fit import JointFit, RecordingPart, joint_fit, parts_of
from gimbalcal.diagnose.verdict.mismatch import CLEAN_PROBABILITY, MAX_CELLS, Scan, scan_data, scanned_mismatches
from gimbalcal.diagnose.verdict.random_walk import (
    PartOfWalk,
    RandomWalkFinding,
    decide_with_walk,
    without_single_walks,
)
from gimbalcal.diagnose.verdict.threshold import clean_evidence, detection_limits
from gimbalcal.diagnose.verdict.verify import known_noise_shifts, residual_rows, verify
from gimbalcal.diagnose.view_result import Contradiction, ViewDiagnosis, shapes_with_laws
from gimbalcal.number import Array
from gimbalcal.progress import Progress
from gimbalcal.views.core import Fit, View, effects_of_another_day
from gimbalcal.words import diagnosis_sentences, law_sentences
from gimbalcal.words.naming import without_underscores

MAX_CHI2_TO_LINEARISE = 100.0  # reduced chi^2 above which rows are linearised about nominal constants


@dataclass(frozen=True)
class SeparateDecision:
    """What one recording by itself would have said: its verdict, a walk of one sensor, and the bar it is held to."""

    decision: Decision
    walk: RandomWalkFinding | None
    needed: float


@dataclass(frozen=True)
class RecordingAnswer:
    """One recording in the common answer: its part of the fit, where it is off before, its numbers and residuals."""

    part: RecordingPart
    before: Scan
    fit: StatedNoiseFit
    curves: Curves


@dataclass(frozen=True)
class _Case:
    """What the recordings of a unit say by themselves and jointly, before anything is reported.

    clean (draws,): evidence of simulated clean recordings of these designs; alone: of several recordings; known: the
    calibration that the diagnosis started from.
    """

    clean: Array
    alone: tuple[SeparateDecision, ...]
    known: Calibration | None
    rng: np.random.Generator
    seed: int
    progress: Progress


def diagnose_known_noise(
    views: Sequence[View], known: Calibration | None, seed: int, progress: Progress
) -> ViewDiagnosis:
    """Diagnose the forces, or what else is read, of one unit whose attitude and noise are known in every view.

    known: a calibration to start from.
    """
    rng, searches = np.random.default_rng(seed), []
    for k, v in enumerate(views):
        if len(views) > 1:
            progress(f"recording {k + 1} of {len(views)}: {v.title}")
        searches.append(compare_causes(v, known, progress))
    if len(views) > 1:
        progress("adding up the evidence of all recordings")
    c = combine_rankings(searches)
    progress("sending simulated clean recordings of this design through the same comparison")
    clean, each = clean_evidence(c, rng)
    without_walks = without_single_walks(c)
    d, walk = decide_with_walk(c, without_walks, claim_threshold(clean))
    alone = [
        SeparateDecision(*decide_with_walk(s, without_single_walks(s), claim_threshold(x)), claim_threshold(x))
        for s, x in (zip(searches, each, strict=True) if len(views) > 1 else ())
    ]
    case = _Case(clean, tuple(alone), known, rng, seed, progress)
    if walk is not None and walk.part is PartOfWalk.INSTEAD:  # unless a deterministic law is as probable as the walk
        none, law, odds = beyond_walk(without_walks, walk, seed, progress)
        return _view_diagnosis(case, without_walks, none, law).against_walk(walk, odds)
    if d.verdict == "adequate" and (law := law_beyond_shapes(c, claim_threshold(clean), seed, progress)).laws:
        return _view_diagnosis(case, c, replace(decide_unnamed(c), shapes=()), law)
    diagnosis = _view_diagnosis(case, c, d)
    formulas = partial(_by_formulas, case, c, d, diagnosis.fit) if walk is None else None
    return diagnosis.tested(formulas).with_part_of_walk(walk)


def _by_formulas(case: _Case, c: Ranking, d: Decision, fit: FitSummary) -> tuple[ViewDiagnosis | None, frozenset[str]]:
    """Return the diagnosis by a formula where causes leave something, and the ids of doubtful effects."""
    assert isinstance(fit, StatedNoiseFit)
    assert d.hypothesis is not None
    members = d.hypothesis.members
    contradicted = fit.predicts_worse or fit.scan_p_after < CLEAN_PROBABILITY or noise_gain(c, members) >= CLAIM
    if not contradicted and not leave_more_than_noise(c, members):
        return None, frozenset()
    none = decide_unnamed(c)
    law = law_of_misfit(c, none, case.seed, case.progress, instead=members)
    if law.laws:
        return _view_diagnosis(case, c, none, law), frozenset()
    doubtful = law.formula_is_likelier or (contradicted and fit.explained < MIN_EXPLAINED)
    return None, frozenset(c.library.candidates[m].effect for m in members) if doubtful else frozenset()


def compare_causes(view: View, known: Calibration | None, progress: Progress) -> Search:
    """Compare every cause of the catalogue with what the baseline of a view leaves."""
    progress(f"fitting the model: {', '.join(without_underscores(i) for i in view.baseline)} (another: --baseline)")
    start = effects_of_another_day(known, view.baseline)
    o = scale_to_scatter(fit_baseline(view, start))
    nominal = o.view.kind.stabilised and _baseline_misfit(o) > MAX_CHI2_TO_LINEARISE
    if nominal:
        o = scale_to_scatter(fit_baseline(view, start, steps=0))
    o = about_settings(o)
    progress("comparing every cause of the catalogue, alone and in pairs")
    every = assemble_library(o)
    s = search(o, every)
    if nominal:
        progress("again, about the constants that belong to what was found")
        o = about_causes(s)
        every = assemble_library(o)
        s = search(o, every)
    if more := likely_wandering_noises(s):
        who = f"accelerometer {more[0].single_walk}" if more[0].single_walk else "all accelerometers"
        progress(f"again, as {who} may wander")
        s = search(o, every, (*possible_noises(o), *more))
    return s


def _baseline_misfit(o: Fit) -> float:
    """Reduced chi^2 of the baseline alone."""
    Z, y = o.reduced(o.Z), o.reduced(o.residual[:, :, None])
    residual = y - Z @ np.linalg.lstsq(Z, y, rcond=1e-9)[0]
    return float((residual**2).sum() / max(len(y) - Z.shape[1], 1))


def _view_diagnosis(case: _Case, c: Ranking, d: Decision, law: LawSearchResult | None = None) -> ViewDiagnosis:
    """Return the diagnosis that a decision makes: findings, shapes or a law, the fit with them, and the calibration."""
    members = d.hypothesis.members if d.hypothesis else ()
    causes = [c.library.candidates[m] for m in members]
    case.progress("locating the mismatch and checking held-out data")
    joint = joint_fit(parts_of(c, members), causes)
    answers = tuple(_recording_answer(c, d, k, joint, case.rng) for k in range(len(joint.parts)))
    lead = min(range(len(answers)), key=lambda k: (answers[k].before.p_value, -answers[k].before.statistic.max()))
    mismatch = () if d.verdict == "adequate" else _mismatch_of_recordings(answers, lead)
    named = findings_of_recordings(c, d, joint)
    shapes = tuple(_shape_without_cause(c, i) for i in d.shapes[:3])
    law = law or law_of_misfit(c, d, case.seed, case.progress)
    answers = _with_law(answers, law)
    fitted = _mean_fit(answers, lead)
    if d.verdict == "adequate":
        fitted = replace(fitted, unseen=detection_limits([(s.library.candidates, s.projections) for s in c.searches]))
    case.progress("the model with what was found, as a calibration")
    diagnosis = ViewDiagnosis(
        c.searches[lead].fit.view, d.verdict, mismatch, named, shapes_with_laws(shapes, law.laws), fitted,
        answers[lead].curves,
        calibration=joint.calibration(case.known), laws=law.laws, recommend=law.recommend,
        outcome=law.position_outliers, evidence=_evidence_of_ranking(c, d, case.clean),
        together=tuple(s.fit.view for s in c.searches),
        without=lambda effect: joint.without(effect).calibration(case.known),
    )  # fmt: skip
    return diagnosis if joint.between is None else _of_several(diagnosis, case, c, answers, joint.between)


def _of_several(
    diagnosis: ViewDiagnosis, case: _Case, c: Ranking, answers: Sequence[RecordingAnswer], between: ConstantsAgreement
) -> ViewDiagnosis:
    """Return the diagnosis with what each recording says by itself, and how well they agree on the constants."""
    rows = tuple(_recording_entry(c, k, *both) for k, both in enumerate(zip(answers, case.alone, strict=True)))
    sizes = [f.agreement.in_words for f in diagnosis.findings if f.agreement and f.agreement.in_words]
    only = _shown_by_one(c, case.alone) if diagnosis.verdict == "adequate" else ()
    differing = (Shape("all", "constants that differ between the recordings"),)
    contradictions = (
        Contradiction(between.in_words, differing),
        Contradiction(diagnosis_sentences.CONTRADICTED if only else "", only),
    )
    return replace(
        diagnosis, fit=replace(diagnosis.fit, recordings=rows, constants=between),
        contradictions=tuple(x for x in contradictions if x.in_words),
        remarks=(*sizes, diagnosis_sentences.separate_verdicts(rows)),
        recommend=diagnosis.recommend or law_sentences.DIAGNOSE_SEPARATELY * bool(between.in_words),
    )  # fmt: skip


def _evidence_of_ranking(c: Ranking, d: Decision, clean: Array) -> Evidence:
    """Return the evidence of a ranking and of simulated clean recordings (draws,)."""
    return Evidence(
        ln_bayes_factor=round(c.ln_total, 3),
        ln_bayes_factor_needed=round(claim_threshold(clean), 3),
        false_alarm_rate_simulated=float(np.mean(clean >= CLAIM)),
        causes_compared=len({x.key for x in c.library.candidates if not x.rival}),
        excess_kurtosis=round(max(s.fit.view.noise.kurtosis for s in c.searches), 3),
        probability_unknown=round(d.unknown, 4),
    )


def _recording_answer(c: Ranking, d: Decision, k: int, joint: JointFit, rng: np.random.Generator) -> RecordingAnswer:
    """Return where a recording is off before anything is added, the numbers of its fit, and its residuals."""
    part = joint.parts[k]
    s, f = part.search, part.fit
    with_shape = f
    if not d.hypothesis and (shapes := c.within(d.shapes, k)):
        with_shape = fit_causes(s, shapes[:1])  # which says what noise the shape leaves
    physical, node = f.columns(part.constants), with_shape.projection.node
    before = scan_data(s.fit, s.rows, node, rng)
    after = scan_data(s.fit, s.rows, node, rng, s.fit.reduced(physical)) if f.index else before
    fitted = verify(f if f.index else with_shape, physical, before.p_value, after.p_value)
    fitted = replace(fitted, calibration_moved=known_noise_shifts(f) if f.index else ())
    v = s.fit.view
    remainder, rest = residual_rows(s.fit, physical @ joint.sizes(part))
    sigma, units = in_print(v.channels, np.broadcast_to(s.fit.sigma, remainder.shape))
    against = plotted_against(v.stimulus)
    curves = Curves(v.stimulus.time, v.stimulus.position, v.channels, remainder, rest, sigma, units, against)
    return RecordingAnswer(part, before, fitted, curves)


def _with_law(answers: tuple[RecordingAnswer, ...], law: LawSearchResult) -> tuple[RecordingAnswer, ...]:
    """Return the answers with what a law that no catalogue holds, if there is one, makes of their numbers."""
    each = zip(answers, law.each, strict=True) if law.each else ()
    corrected = (replace(x, fit=law.summary(x.fit), curves=replace(x.curves, after=r)) for x, (law, r) in each)
    return tuple(corrected) or answers


def _mismatch_of_recordings(answers: Sequence[RecordingAnswer], lead: int) -> tuple[Mismatch, ...]:
    """Return where each recording is off, the one that is off most first."""
    out = []
    for k in sorted(range(len(answers)), key=lambda k: k != lead):
        for m in scanned_mismatches(answers[k].before, at_least=int(k == lead)):
            words = diagnosis_sentences.in_recording(k + 1, m.in_words)
            out.append(replace(m, recording=k + 1, in_words=words) if len(answers) > 1 else m)
    return tuple(out[:MAX_CELLS])


def _shape_without_cause(c: Ranking, i: int) -> Shape:
    """Return a shape without a cause; of several recordings, with those that show it."""
    of = c.library.candidates[i]
    channel = f"{of.channel} {of.axis}".strip()
    if len(c.searches) == 1:
        return Shape(channel, of.rival)
    ordinals = [k + 1 for k in c.sees(i)]
    where = f"recording {ordinals[0]}" if len(ordinals) == 1 else "every recording that could show it"
    return Shape(f"{channel} of {where}", of.rival, recordings=tuple(ordinals))


def _mean_fit(answers: Sequence[RecordingAnswer], lead: int) -> StatedNoiseFit:
    """Return the numbers of all recordings; noise and calibration are those of the recording that is off most."""
    if len(answers) == 1:
        return answers[0].fit
    rows, constants = np.array([x.part.search.rows.Q.shape for x in answers]).T
    causes = np.array([len(x.part.fit.index) for x in answers])

    def mean(what: str, weight: Array) -> float:
        return float(np.average([getattr(x.fit, what) for x in answers], weights=weight))

    def least(p: Sequence[float]) -> float:  # of so many scans
        return float(-np.expm1(len(p) * np.log1p(-min(*p, 1 - 1e-15))))

    return replace(
        answers[lead].fit,
        chi2_reduced_before=mean("chi2_reduced_before", rows - constants),
        chi2_reduced_after=mean("chi2_reduced_after", rows - constants - causes),
        heldout_before=mean("heldout_before", rows),
        heldout_after=mean("heldout_after", rows),
        scan_p_before=least([x.fit.scan_p_before for x in answers]),
        scan_p_after=least([x.fit.scan_p_after for x in answers]),
        heldout_by=" and ".join(dict.fromkeys(x.fit.heldout_by for x in answers)),
    )


def _recording_entry(c: Ranking, k: int, x: RecordingAnswer, alone: SeparateDecision) -> RecordingFit:
    """Return one recording in `fit`: what it is, its numbers, and what it alone would have said."""
    s = c.searches[k]
    walks = alone.walk is not None and alone.walk.part is PartOfWalk.INSTEAD
    verdict = "unexplained" if walks else alone.decision.verdict
    separate = SeparateVerdict(verdict, _verdict_in_words(alone), round(s.ln_total, 3), round(alone.needed, 3))
    return RecordingFit(k + 1, s.fit.view.title, s.fit.view.kind, x.fit, separate)


def _verdict_in_words(alone: SeparateDecision) -> str:
    """Return the verdict on one recording by itself in a few words."""
    d = alone.decision
    causes = [(j.cause.effect, j.cause.axis, j.confounded) for j in d.judgements]
    return diagnosis_sentences.separate_verdict(d.verdict, causes, alone.walk)


def _shown_by_one(c: Ranking, each: Sequence[SeparateDecision]) -> tuple[Shape, ...]:
    """Return, as shapes, what recordings show by themselves beyond the odds that one of so many shows it by chance."""
    odds = float(np.log(len(each)))
    return tuple(
        Shape(f"recording {k + 1}", _verdict_in_words(alone), (k + 1,))
        for k, alone in enumerate(each)
        if alone.decision.verdict != "adequate" and c.searches[k].ln_total > alone.needed + odds
    )
