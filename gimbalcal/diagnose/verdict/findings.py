"""Findings: the selected causes that are confirmed, with their sizes and advice on how to separate them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gimbalcal.diagnose.evidence.odds import CLAIM, MIN_WIDENING_PROBABILITY
from gimbalcal.diagnose.library.candidates import Candidate, SelectedCause
from gimbalcal.diagnose.result import Estimate, Finding, RecordingSize, SizeAgreement
from gimbalcal.diagnose.search.ranking import Ranking, is_usual
from gimbalcal.diagnose.search.refit import constants_with_sigma
from gimbalcal.diagnose.search.stepwise import (
    Key,
    SearchResult,
    likeliest_missing,
    likeliest_round,
    result_of,
    with_causes,
)
from gimbalcal.diagnose.verdict.agreement import disagreement_sentence
from gimbalcal.diagnose.verdict.decide import Decision, reported_probability
from gimbalcal.diagnose.verdict.joint_fit import JointFit
from gimbalcal.diagnose.verdict.judgement import Judgement, judged_without
from gimbalcal.diagnose.verdict.separation import advise_manoeuvre
from gimbalcal.diagnose.verdict.verify import held_out_misfit, row_sigma
from gimbalcal.effects import CATALOGUE, Parameter
from gimbalcal.effects.effect import constants
from gimbalcal.effects.sensor_grades import most_of_any_unit
from gimbalcal.errors import InputError
from gimbalcal.inference.algebra import beyond, orthonormal_columns
from gimbalcal.inference.information import keeps_prior
from gimbalcal.number import Array
from gimbalcal.progress import Progress
from gimbalcal.views.core import Fit
from gimbalcal.words.diagnosis_sentences import cause_in_words, separation_advice
from gimbalcal.words.naming import without_underscores

SERIES = 3.0  # times the whole misfit, that one of several causes may be
IMPOSSIBLE_SIGMAS = 3.0  # by which an impossible size exceeds
IMPOSSIBLE_RATIO = 10.0  # times the limit of every grade: a poor unit exceeds the limit itself
SHOWN, HIDDEN = 5.0, 3.0  # sigmas of a parameter that differs from zero, and of one that may be zero


def confirm_causes(c: SearchResult, progress: Progress) -> tuple[SearchResult, list[Judgement]]:
    """Remove causes that something else is likelier to be, and select that in their place; judge those that remain.

    If the replacement has been refused as well, the misfit is described by a shape, as it exceeds the noise.
    """
    refused: set[Key] = set()
    kept: list[SelectedCause] | None = None
    if c.start.exact:
        return c, []
    if not c.steps and not c.shapes:
        c = _search_with_replacement(c, (), refused, progress)
    while True:
        oversized, why = cancelling_causes(c), "larger than the whole misfit, as terms of a series"
        if not oversized:
            oversized, why = impossible_causes(c), f"more than {IMPOSSIBLE_RATIO:g} times the limit of every grade"
        if oversized:
            progress(f"{', '.join(cause.label for cause, _ in oversized)}: {why}")
            refused |= {cause.key for cause, _ in oversized}
            c = _search_with_replacement(c, [cause for cause in c.causes if cause not in oversized], refused, progress)
            continue
        progress("comparing each cause with what else could stand in its place")
        try:
            verdicts = judged_in_turn(c)
        except InputError:  # without one of its causes the model has no inverse: keep what stood before this search
            if kept is None:
                raise
            c, kept = result_of(c.start, kept, refused=True), None
            continue
        kind = c.start.view.kind  # of causes that are equally poor, what every rig has goes last
        least = min(verdicts, key=lambda j: (j.probability, is_usual(j.cause, kind)), default=None)
        if least is not None and least.probability < MIN_WIDENING_PROBABILITY:
            refusal, why = least.cause, "another cause or correlated noise is likelier"
        elif worse := worsening_cause(c, verdicts):
            refusal, why = worse, "held-out rows are predicted better without it"
        else:
            return c, verdicts
        progress(f"{refusal.in_words} is not named: {why}")
        refused.add(refusal.key)
        kept = [cause for cause in c.causes if cause[0] is not refusal]
        c = _search_with_replacement(c, kept, refused, progress)


def worsening_cause(c: SearchResult, verdicts: Sequence[Judgement]) -> Candidate | None:
    """Return the cause without which held-out rows are predicted best, or None if each improves their prediction.

    Where each of several causes improves the prediction given the others, but all of them together predict worse than
    the baseline, it is the least probable one.
    """
    sigma = row_sigma(c.end)

    def misfit(m: Fit) -> float:
        return float(np.mean(held_out_misfit(m, sigma) ** 2))

    if not c.causes:
        return None
    each = [misfit(with_causes(c.start, [o for o in c.causes if o is not this])) for this in c.causes]
    whole = misfit(c.end)
    if min(each) < whole:
        return c.causes[int(np.argmin(each))][0]
    if misfit(c.start) < whole:
        return min(verdicts, key=lambda j: j.probability).cause
    return None


def _search_with_replacement(
    c: SearchResult, kept: Sequence[SelectedCause], refused: set[Key], progress: Progress
) -> SearchResult:
    """Return the search with these causes and what is likeliest with them, unless that has been refused."""
    as_before = list(kept) == c.causes
    best = likeliest_round(c.missing) if as_before else likeliest_missing(with_causes(c.start, kept), memory=True)
    new = best.causes if best.ln_total >= CLAIM and best.named else ()
    if new and not refused & {cause.key for cause, _ in new}:
        progress(f"selected: {', '.join(cause.in_words for cause, _ in new)}")
        kept = [*kept, *new]
    elif as_before and not refused:
        return c
    return result_of(c.start, kept, [cause for cause in c.standard if cause in kept], refused=bool(refused))


def cancelling_causes(c: SearchResult) -> list[SelectedCause]:
    """Return causes that not every rig has, each of them much larger than the misfit that all of them explain together.

    A few arcsec of an unknown law are also the difference of a hundred of one pattern and of a similar one: terms of a
    series, not causes. Contributions are compared without the part that the baseline absorbs.
    """
    m, Q = c.end, orthonormal_columns(c.end.reduced(c.start.jacobian))
    x, out = m.x, []
    for cause, variant in (this for this in c.causes if not is_usual(this[0], m.view.kind)):
        own = {p.label for p in cause.parameters}
        at = [i for i, p in enumerate(m.parameters) if p.label in own]
        added = m.reduced((m.jacobian[..., at] @ x[at])[..., None])[:, 0]
        misfit = m.reduced(c.start.residual[..., None])
        if np.linalg.norm(beyond(Q, added)) > SERIES * np.linalg.norm(misfit):
            out.append((cause, variant))
    return out


def impossible_causes(c: SearchResult) -> list[SelectedCause]:
    """Return causes of a size far beyond that of a unit of any grade: a fit that needs such a size lacks another law.

    Where the attitude changes by a few degrees from row to row, a memory of half the force fits the misfit of |f|.
    """
    m, excess = c.end, np.abs(c.end.x) - IMPOSSIBLE_SIGMAS * c.end.sigmas
    duration_s = float(np.ptp(m.view.stimulus.time))
    beyond = {
        p.label
        for p, x in zip(m.parameters, excess, strict=True)
        if x > IMPOSSIBLE_RATIO * most_of_any_unit(p, duration_s)
    }
    return [this for this in c.causes if beyond & {p.label for p in this[0].parameters}]


def judged_in_turn(c: SearchResult) -> list[Judgement]:
    """Judge each cause among its alternatives: what every rig has with the like of it, what is special with all.

    What every rig has is judged with all as well where one of its alternatives was selected: that explains its own part
    of the misfit, and a set that it belongs to would be as likely as that part is clear.
    """
    if not c.steps:
        return []
    selected = [cause for cause, _ in c.causes]
    among = with_causes(c.start, c.standard)
    first = [judged_without(among, cause[0]) if cause in c.standard else None for cause in c.causes]
    return [judged_without(c.end, cause) if j is None or j.instead(selected) else j
            for j, cause in zip(first, selected, strict=True)]  # fmt: skip


def finding_of_view(m: Fit, j: Judgement) -> Finding:
    """Return the finding of a cause of a view, with its sizes and constants from a model that has both fitted."""
    e, own = j.cause.effect, {p.label for p in j.cause.parameters}
    names = {f.name for f in constants(CATALOGUE[e])}
    constant = [p.effect == e and p.field in names for p in m.parameters]
    silent = keeps_prior(m.parameters, np.where(constant, 0.0, m.x), m.sigmas)
    each = zip(m.parameters, m.x, m.sigmas, silent, strict=True)
    estimates = [(p, Estimate.of(p, x, s)) for p, x, s, at_prior in each if not at_prior]
    rows = [r for p, r in estimates if p.label in own]
    rows += [replace(r, name=p.field, axis="") for p, r in estimates if p.effect == e and p.field in names]
    rows += [
        replace(Estimate.of(p, x, max(s, j.spread)), name=p.field, axis="")
        for p, x, s in constants_with_sigma(m, e)  # whole numbers, which no fit moves
    ]
    axis = j.cause.axis if m.view.added is None else _sensor_element(j.cause.axis, rows)
    return _finding_entry(j, axis, j.significance or 0.0, rows, _advice_of_cards(j))


def findings_of_recordings(c: Ranking, d: Decision, joint: JointFit) -> tuple[Finding, ...]:
    """Return what is named: effect, axis, probability, significance, sizes, what fits alike and how to separate it.

    With several recordings, the size by each is given in addition to the common one.
    """
    out = []
    for ordinal, j in enumerate(d.judgements):
        rows = _estimates(j.cause.parameters, *joint.size(ordinal))
        rows += [replace(Estimate.of(p, x, s), name=p.field, axis="") for p, x, s in joint.chosen_constants(ordinal)]
        significance = float(np.sqrt(sum(p.significance(ordinal) ** 2 for p in joint.parts)))
        named = _finding_entry(j, _axes_of(j), significance, rows, _separating_experiment(c, d, joint, ordinal))
        if len(joint.parts) > 1:
            a, words = joint.agreement_on(ordinal), cause_in_words(named.effect, named.axis)
            agree = SizeAgreement(round(a.rise, 3), a.combinations, a.p_value, disagreement_sentence(a, words))
            named = replace(named, recordings=_sizes_by_recording(joint, ordinal), agreement=agree)
        out.append(named)
    return tuple(out)


def _sizes_by_recording(joint: JointFit, ordinal: int) -> tuple[RecordingSize, ...]:
    """Return the size that each recording gives a cause."""
    out = []
    wanted = joint.causes[ordinal].parameters
    for k, part in enumerate(joint.parts):
        if ordinal in part.ordinals:
            rows = _estimates(wanted, *joint.size_by(k, ordinal))
            out.append(RecordingSize(k + 1, round(part.significance(ordinal), 2), tuple(rows)))
    return tuple(out)


def _separating_experiment(c: Ranking, d: Decision, joint: JointFit, ordinal: int) -> str:
    """Return what would separate a cause from the one most like it, in the recording that shows it best."""
    for fits in d.judgements[ordinal].alike[:1]:
        alike = next(i for i, one in enumerate(c.library.candidates) if one is fits)
        both = [k for k in c.sees(alike) if ordinal in joint.parts[k].ordinals]
        for k in sorted(both, key=lambda k: -joint.parts[k].significance(ordinal))[:1]:
            part, s = joint.parts[k], c.searches[k]
            cause = part.fit.causes[part.ordinals.index(ordinal)]
            size = joint.size(ordinal)[0] / np.array([p.sigma for p in cause[0].parameters])
            (at,) = c.within((alike,), k)
            other = s.library.candidates[at]
            a = advise_manoeuvre(s.fit, cause, size, other)
            return separation_advice(
                a.words, a.hours, a.ln_bayes, without_underscores(cause[0].effect), without_underscores(other.effect)
            )
    return ""


def _finding_entry(j: Judgement, axis: str, significance: float, estimates: Sequence[Estimate], advice: str) -> Finding:
    """Return the finding of a claimed cause on an axis: sizes, what fits alike, and how to separate them."""
    probability = reported_probability(j.probability)
    return Finding(j.cause.effect, axis, probability, round(significance, 2), tuple(estimates), j.confounded, advice)


def _axes_of(j: Judgement) -> str:
    """Return the axes of a claimed cause and of those that fit alike, "x / y"."""
    axes = list(dict.fromkeys(c.axis for c in [j.cause, *j.alike] if c.axis))
    return " / ".join(a for n, a in enumerate(axes) if not any(a in b for b in axes[:n]))


def _sensor_element(axis: str, rows: Sequence[Estimate]) -> str:
    """Sensor and partner, "xz", where of a sensor's several parameters one alone differs from zero."""
    shown = [str(r.axis) for r in rows if abs(r.value) > SHOWN * r.sigma]
    vague = any(HIDDEN * r.sigma < abs(r.value) <= SHOWN * r.sigma for r in rows)
    return shown[0] if len(shown) == 1 and not vague and len(axis) == 1 and shown[0].startswith(axis) else axis


def _advice_of_cards(j: Judgement) -> str:
    """Return the conditions under which only one of two effects acts, by the cards of the effects."""
    if not j.confounded:
        return ""

    def seen(effect: str) -> str:
        card = " ".join((CATALOGUE[effect].__doc__ or "").split())
        after = card.partition("Seen by: ")[2]
        return after.partition(". ")[0].strip(". ")

    others = "; ".join(f"{without_underscores(t)} by {seen(t)}" for t in j.confounded[:3])
    return f"{without_underscores(j.cause.effect)} is seen by {seen(j.cause.effect)}; {others}."


def _estimates(parameters: Sequence[Parameter], x: Array, sigma: Array) -> list[Estimate]:
    """Return parameters as printed, from values and sigmas (p,) in SI; without those that nothing shows."""
    silent = keeps_prior(parameters, x, sigma)
    return [
        Estimate.of(p, *both) for p, *both, at_prior in zip(parameters, x, sigma, silent, strict=True) if not at_prior
    ]


def drifts_as_one(findings: Sequence[Finding]) -> tuple[Finding, ...]:
    """Return the findings with several time histories of one bias merged: however described, they are one drift."""
    out: list[Finding] = []
    for f in findings:
        same = next((i for i, first in enumerate(out) if _same_drift(first, f)), None)
        if same is None:
            out.append(f)
            continue
        first = out[same]
        twins = dict.fromkeys([*first.twins, f.effect, *f.twins])
        out[same] = replace(
            first,
            parameters=(*first.parameters, *f.parameters),
            twins=tuple(t for t in twins if t != first.effect),
            separate_by=first.separate_by or f.separate_by,
        )
    return tuple(out)


def _same_drift(first: Finding, second: Finding) -> bool:
    one, other = CATALOGUE[first.effect], CATALOGUE[second.effect]
    shared = set(first.axis.split(", ")) & set(second.axis.split(", "))
    return one.role.time_drift and other.role.time_drift and one.stage is other.stage and bool(shared)
