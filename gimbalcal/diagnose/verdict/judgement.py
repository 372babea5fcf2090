"""Alternatives to a claimed cause: the causes that fit alike, and the probability of all of them.

Causes whose evidence, each at its own best size, lies within a factor 20 of the best are alternatives. A set that is
not sure is widened by the next likely causes to at most three.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gimbalcal.diagnose.evidence.odds import (
    MIN_WIDENING_PROBABILITY,
    SEPARATION_EVIDENCE,
    SURE_PROBABILITY,
    UNSURE_FACTOR,
)
from gimbalcal.diagnose.evidence.projection import Projection, any_size, by_size, project
from gimbalcal.diagnose.library.assemble import every_number
from gimbalcal.diagnose.library.candidates import Candidate
from gimbalcal.diagnose.search.ranking import (
    Ranking,
    Search,
    given_all,
    projections_of,
    reduced_rows,
    rms_misfit,
    search,
    selected_causes,
    weightiest_noises,
)
from gimbalcal.diagnose.search.refit import refit
from gimbalcal.diagnose.search.stepwise import needed_evidence
from gimbalcal.effects import CATALOGUE, with_values
from gimbalcal.inference.algebra import logsumexp
from gimbalcal.number import Array
from gimbalcal.views.core import Fit
from gimbalcal.words.diagnosis_sentences import MAX_ALTERNATIVES

CENTRAL_INTERVAL = (0.16, 0.84)  # shares of the evidence below the ends of the interval of one sigma


@dataclass(frozen=True)
class Judgement:
    """A claimed cause, the probability of it and of those that fit alike, and its significance [sigma].

    significance: beyond all else in the model; None where it is that of the fit of the causes. spread: one sigma of a
    whole number that was scanned, over all numbers and terms by their evidence; 0 for a cause without one.
    """

    cause: Candidate
    probability: float
    alike: tuple[Candidate, ...]
    significance: float | None = None
    spread: float = 0.0

    @property
    def confounded(self) -> tuple[str, ...]:
        """Ids of the effects that these rows do not distinguish from it."""
        return tuple(c.effect for c in self.alike)

    def instead(self, candidates: Sequence[Candidate]) -> bool:
        """Return whether one of those that fit alike was found as well: then both are causes."""
        return any(
            a.effect == c.effect and a.axes & c.axes
            for a in self.alike for c in candidates if c.key != self.cause.key
        )  # fmt: skip


def judge_member(s: Ranking, member: int, others: Sequence[int], scores: Array, with_rest: bool) -> Judgement:
    """Return what fits alike in the place of a member given the others, and the probability of all of these causes.

    scores (candidates,): `best_evidence` given the others; with_rest: a shape is claimed as well.
    """
    p, candidates = s.posterior(), s.library.candidates
    alike = fits_alike(s, member, others, scores)
    if not with_rest and _probability_of_any(s, p, (member, *alike)) < SURE_PROBABILITY:
        alike = _widen_alternatives(s, p, member, alike, others)
    probability = _probability_of_any(s, p, (member, *alike), with_rest)
    return Judgement(candidates[member], probability, tuple(candidates[i] for i in alike))


def _probability_of_any(s: Ranking, p: Array, alike: Sequence[int], with_rest: bool = False) -> float:
    """Return the probability of all hypotheses that contain one of these causes: without a shape, or with one.

    A law that leaves a residual may be another law much like it, so with a residual no cause is sure.
    """
    candidates = s.library.candidates
    named = {candidates[i].effect for i in alike}
    axes = {a for i in alike for a in candidates[i].axes}

    def inside(i: int) -> bool:
        return candidates[i].effect in named and bool(axes & candidates[i].axes)

    total = sum(w for h, w in zip(s.hypotheses, p, strict=True)
                if (with_rest or not h.unknown(candidates)) and any(inside(i) for i in h.members))  # fmt: skip
    return float(UNSURE_FACTOR * total if with_rest else total)


def fits_alike(s: Ranking, member: int, others: Sequence[int], scores: Array) -> tuple[int, ...]:
    """Return the candidates of other ids whose evidence at their own best size is within a factor 20 of this one's."""
    candidates = s.library.candidates
    alike = [
        int(i)
        for i in np.argsort(-scores)
        if scores[i] > scores[member] - SEPARATION_EVIDENCE and not candidates[i].rival and i not in others
    ]
    return _distinct_candidates(candidates, member, alike)


def _distinct_candidates(candidates: Sequence[Candidate], member: int, alike: Sequence[int]) -> tuple[int, ...]:
    """Return one candidate per id, other than the member's own."""
    out: dict[str, int] = {}
    for i in alike:
        if candidates[i].effect != candidates[member].effect:
            out.setdefault(candidates[i].effect, i)
    return tuple(out.values())


def _widen_alternatives(
    s: Ranking, p: Array, member: int, alike: tuple[int, ...], others: Sequence[int]
) -> tuple[int, ...]:
    """Add the next likely causes until the set is sure or has three."""
    candidates = s.library.candidates
    for h, share in zip(s.hypotheses, p, strict=True):
        if share < MIN_WIDENING_PROBABILITY:
            break
        extra = [i for i in h.members if i not in others]
        if len(h.members) != len(others) + 1 or h.unknown(candidates) or len(extra) != 1:
            continue
        if len(alike) >= MAX_ALTERNATIVES - 1 or _probability_of_any(s, p, (member, *alike)) >= SURE_PROBABILITY:
            break
        alike = (*alike, *_distinct_candidates(candidates, member, [i for i in extra if i not in alike]))
        alike = _distinct_candidates(candidates, member, alike)
    return alike


def best_evidence(s: Ranking, others: Sequence[int] = ()) -> Array:
    """Return ln evidence (candidates,) of each known cause at its best size, given others, relative to nothing.

    The size is common to several recordings.
    """
    one = s.searches[0] if len(s.searches) == 1 else None
    ln = _evidence_of_common_size(s, others) if one is None else _evidence_of_any_size(one, others)
    return np.where([bool(c.rival) for c in s.library.candidates], -np.inf, ln)


def _evidence_of_any_size(s: Search, others: Sequence[int]) -> Array:
    """Return the same of one recording, noise integrated over."""
    rows = []
    for k in sorted(weightiest_noises(s.projections, np.maximum(s.joint.max(axis=1), s.null), len(s.null))):
        here, gained = given_all(s, k, others, 0.0)
        rows.append(by_size(here, s.library.layout).max(axis=1) + s.null[k] + gained)
    return np.asarray(logsumexp(np.stack(rows), axis=0) - logsumexp(s.null))


def _evidence_of_common_size(c: Ranking, others: Sequence[int]) -> Array:
    """Return the same of several recordings, at the best plausible size common to all.

    With independent sizes a cause could be strong in one recording and absent from the next.
    """
    values, without = [], []
    for k, s in enumerate(c.searches):
        rows, base = [], []
        for noise, ln in enumerate(s.null):
            here, gained = given_all(s, noise, c.within(others, k), float(ln))
            rows.append(by_size(here, s.library.layout) + gained)
            base.append(gained)
        values.append(logsumexp(np.stack(rows), axis=0) - logsumexp(s.null))
        without.append(logsumexp(np.array(base)) - logsumexp(s.null))
    return np.asarray(c.summed(values, without).max(axis=1))


def judged_without(end: Fit, taken: Candidate) -> Judgement:
    """Return the judgement of one cause from the view searched again without it, the others kept in the model.

    What another cause would explain in addition to this one as well is no evidence against this one: the two are a
    pair. Where nothing at all is claimed in its place, in correlated noise, its probability is zero: one of a hundred
    causes fits such a noise by chance.
    """
    own = {p.label for p in taken.parameters}
    wanted = [p for p in end.parameters if p.label not in own]
    names = end.view.stimulus.axis_names
    none = with_values(end.effects, taken.parameters, np.zeros(len(taken.parameters)), names)
    number = every_number(end.view, CATALOGUE[taken.effect])[0]
    if number and taken.effect not in {p.effect for p in wanted}:  # it is open again
        none = tuple(e for e in none if e.id != taken.effect)
    without = refit(end.view, none, wanted)
    s = search(without)
    known = s.library.candidates
    at = _least_cause_that_holds(taken, known)
    j = judge_member(s, at, (), best_evidence(s), s.unknown > 0.5)
    probability = 0.0 if s.ln_total < needed_evidence(end, taken) else j.probability
    ((_, variant),) = selected_causes(s, (at,))
    sigma = _significance(without, end, s.library.X[:, list(variant.index)])
    return Judgement(taken, probability, j.alike, sigma, spread_of_number(s, known[at]) if number else 0.0)


def _least_cause_that_holds(taken: Candidate, known: Sequence[Candidate]) -> int:
    """Return the ordinal of the known cause with all axes of this one and the fewest others: itself where known.

    Two axes are one cause where the third was in the model, which may have been removed since.
    """

    def holds(c: Candidate) -> bool:
        same = (c.effect, c.source, c.mechanism) == (taken.effect, taken.source, taken.mechanism)
        return same and taken.axes <= c.axes

    return min((i for i, c in enumerate(known) if holds(c)), key=lambda i: len(known[i].axes))


def spread_of_number(s: Search, cause: Candidate) -> float:
    """Return one sigma of the whole number of a cause that was scanned: half of the central interval of 68 %.

    Several peaks of a scan may explain a misfit alike, as the teeth of a worm and three times as many, so that the
    curvature at one of them underestimates it. The number is the same for all terms of a series.
    """
    values, ln = list[float](), list[float]()
    for c in s.library.candidates:
        if c.effect == cause.effect and c.axis == cause.axis and c.source == cause.source:
            each = np.array([v.index for v in c.variants])
            nodes = zip(s.projections, s.null, strict=True)
            joint = logsumexp(np.stack([any_size(p, each) + null for p, null in nodes]), axis=0)
            ln += (joint + np.log([v.weight for v in c.variants])).tolist()
            values += [v.constants[-1][1] for v in c.variants]
    order = np.argsort(values)
    share = np.exp(np.array(ln) - max(ln))[order]
    below = np.cumsum(share) - share / 2
    low, high = np.interp(np.array(CENTRAL_INTERVAL) * share.sum(), below, np.array(values)[order])
    return float(high - low) / 2


def _significance(without: Fit, end: Fit, X: Array) -> float:
    """Return the significance of reduced columns X (R, p) that a model lacks, in the likeliest noise with them."""
    unit = rms_misfit(end)
    best = max(projections_of(end, X[:, :0], unit=unit), key=Projection.log_evidence)
    rows = reduced_rows(without, X, (best.node,), unit)
    # without the cause the rows have been divided by other scales of the channels
    other = np.array(end.view.noise.scales or 1.0) / np.array(without.view.noise.scales or 1.0)
    taken = project(best.node.rescaled(other), rows).explained(range(X.shape[-1]))
    return float(np.sqrt(taken) / best.scale.sigma(best.misfit[0]))
