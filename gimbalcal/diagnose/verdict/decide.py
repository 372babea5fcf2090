r"""From probabilities to a verdict: what is claimed, which alternatives are listed, and when nothing is named.

* something is missing only if the Bayes factor for it exceeds 20 and what clean recordings of this very design reach;
* a shape without a cause wins when its probability exceeds one half: then no cause is named, unless one
  carries nine tenths of the evidence by itself: then it is named, and the rest reported as a shape;
* a cause that leaves more than the stated noise is named, but is not sure;
* causes that fit alike are listed together: see `judge_member`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gimbalcal.diagnose.evidence.odds import (
    CLAIM,
    MIN_SHARE_WITH_REST,
    SEPARATION_EVIDENCE,
    SURE_PROBABILITY,
    UNKNOWN_LAW_SHARE,
    UNSURE_FACTOR,
)
from gimbalcal.diagnose.search.ranking import Hypothesis, Ranking, given_all, without_unclaimed
from gimbalcal.diagnose.verdict.judgement import Judgement, best_evidence, judge_member
from gimbalcal.number import Array


@dataclass(frozen=True)
class Decision:
    """Verdict, the hypothesis behind it, and the judgement of each of its members.

    shapes: ordinals of those that describe what is not explained, best first; unknown: probability that no cause of the
    catalogue explains it.
    """

    verdict: str
    hypothesis: Hypothesis | None = None
    judgements: tuple[Judgement, ...] = ()
    shapes: tuple[int, ...] = ()
    unknown: float = 0.0


def decide(s: Ranking, threshold: float = CLAIM) -> Decision:
    """Return the verdict on one recording, or on several together.

    `threshold` is the ln Bayes factor that clean recordings of this design reach.
    """
    if s.ln_total < max(CLAIM, threshold):
        return Decision("adequate")
    candidates = s.library.candidates
    rest = _likely_shapes(s) if s.unknown > 0.5 else ()
    named = (h for h in s.hypotheses if not h.unknown(candidates) and (not rest or len(h.members) == 1))
    known = next(named, None)
    if known is None or (rest and known.ln_bayes < MIN_SHARE_WITH_REST * max(h.ln_bayes for h in s.hypotheses)):
        return Decision("unexplained", shapes=rest, unknown=s.unknown)
    best = _simplest_axes(s, without_unclaimed(s, known))
    judgements = tuple(
        judge_member(s, member, others, best_evidence(s, others), bool(rest))
        for member in best.members
        for others in [tuple(i for i in best.members if i != member)]
    )
    sure = min(j.probability for j in judgements) >= SURE_PROBABILITY / 2 and not any(j.alike for j in judgements)
    d = Decision("missing-physics" if sure else "not-identifiable", best, judgements, rest, s.unknown)
    if rest or noise_gain(s, best.members) < CLAIM:
        return d
    return replace(d, judgements=tuple(replace(j, probability=UNSURE_FACTOR * j.probability) for j in judgements))


def decide_unnamed(s: Ranking) -> Decision:
    """Return the verdict that no cause of the catalogue explains it, with the shapes that are likeliest."""
    return Decision("unexplained", shapes=_likely_shapes(s), unknown=s.unknown)


def claim_threshold(clean: Array) -> float:
    """Return the ln Bayes factor of a claim: 20 to one, and that of 99 % of clean recordings (draws,) of a design."""
    return max(float(CLAIM), float(np.quantile(clean, 0.99)))


def reported_probability(probability: float) -> float:
    """Return a probability among all causes and shapes that were compared as it is reported: never more than 90 %."""
    return round(min(probability, 1 - UNKNOWN_LAW_SHARE), 4)


def noise_gain(s: Ranking, members: Sequence[int]) -> float:
    """Return the ln likelihood that another noise than the stated one gains once these causes are in the model.

    A nearly correct model leaves a residual, which a larger noise variance absorbs; the stated one does not. The noise
    may well be larger, so the cause stays named, but it is not sure. Of several views it is that of the one that gains
    most.
    """
    gains = []
    for one, mine in ((one, s.within(members, k)) for k, one in enumerate(s.searches)):
        prior = np.array([p.node.prior for p in one.projections])
        ln = [given_all(one, k, mine, float(one.null[k]) - float(np.log(prior[k])))[1] for k in range(len(prior))]
        gains.append(max(ln) - ln[int(np.argmax(prior))])
    return max(gains)


def _simplest_axes(s: Ranking, best: Hypothesis) -> Hypothesis:
    """Return one axis instead of all, where the evidence for all is not 20 times larger."""
    c = s.library.candidates
    if len(best.members) != 1 or "," not in c[best.members[0]].axis:
        return best
    same = [h for h in s.hypotheses if len(h.members) == 1 and c[h.members[0]].effect == c[best.members[0]].effect]
    few = [h for h in same if h.ln_bayes > best.ln_bayes - SEPARATION_EVIDENCE]
    return min(few, key=lambda h: (len(c[h.members[0]].parameters), -h.ln_bayes))


def _likely_shapes(s: Ranking) -> tuple[int, ...]:
    """Return the shapes by probability."""
    total: dict[int, float] = {}
    for h, w in zip(s.hypotheses, s.posterior(), strict=True):
        for i in h.members:
            if s.library.candidates[i].rival:
                total[i] = total.get(i, 0.0) + float(w)
    return tuple(sorted(total, key=lambda i: -total[i]))
