r"""From probabilities to a verdict: what is claimed, what stands together, and when nothing is named.

* something is missing only if the Bayes factor for it exceeds 20 and what clean recordings of this very design reach;
* a shape without a cause wins when its probability exceeds one half: then no cause is named by force, unless one
  carries nine tenths of the evidence by itself: then it is named, and the rest beside it as a shape;
* a cause that leaves more than the stated noise is named, but is not sure;
* causes whose evidence, each at its own best size, lies within a factor 20 of the best stand together.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gimbalcal.diagnose.evidence.odds import CLAIM, LIKELY, NEARLY, OUTSIDE, SURE, TOGETHER, UNSURE
from gimbalcal.diagnose.evidence.projection import at_best
from gimbalcal.diagnose.library.candidates import Candidate
from gimbalcal.diagnose.search.ranking import Hypothesis, Ranking, Search, Weighed, given, needed
from gimbalcal.diagnose.wording import NAMED
from gimbalcal.inference.algebra import logsumexp
from gimbalcal.number import Array

Scores = Callable[[Sequence[int]], Array]  # ln evidence (candidates,) at each one's best size, beside these others


@dataclass(frozen=True)
class Decision:
    """Verdict, the hypothesis behind it, for each member the candidates that fit alike, and probabilities."""

    verdict: str
    hypothesis: Hypothesis | None
    confounded: tuple[tuple[int, ...], ...]  # per member, indices of other candidates of other ids
    probability: tuple[float, ...]  # per member, of its set
    shapes: tuple[int, ...] = ()  # rivals that describe what is not explained, best first
    unknown: float = 0.0  # probability that no cause of the catalogue explains it


def decide(s: Search, threshold: float = CLAIM) -> Decision:
    """The verdict of a search; `threshold` is the ln Bayes factor that clean recordings of this design reach."""
    d = judge(s, threshold, lambda beside: likeliest(s, beside))
    if d.hypothesis is None or d.shapes or strained(s, d.hypothesis.members) < CLAIM:
        return d
    return replace(d, probability=tuple(UNSURE * p for p in d.probability))


def unnamed(s: Search) -> Decision:
    """The verdict that no cause of the catalogue explains it, with the shapes that are likeliest."""
    return Decision("unexplained", None, (), (), _shapes(s), s.unknown)


def bar(clean: Array) -> float:
    """ln Bayes factor for a claim: 20 to one, and what 99 % of clean recordings (draws,) of the design stay below."""
    return max(float(CLAIM), float(np.quantile(clean, 0.99)))


def capped(probability: float) -> float:
    """A probability among all causes and shapes that were compared, as it is reported: never more than 90 %."""
    return round(min(probability, 1 - OUTSIDE), 4)


def strained(s: Search, members: Sequence[int]) -> float:
    """ln likelihood that another noise than the stated one gains once these causes are in the model.

    A law much like the truth leaves a rest, and a larger noise takes it up; what was stated does not. The noise may
    well be larger, so the cause stays named, but it is not sure.
    """
    likelihood = []
    for p, ln in zip(s.projections, s.null, strict=True):
        here, total = p, float(ln) - float(np.log(p.node.prior))
        for i in members:
            here, gained = given(here, s.library.candidates[i])
            total += gained
        likelihood.append(total)
    stated = int(np.argmax([p.node.prior for p in s.projections]))
    return max(likelihood) - likelihood[stated]


def judge(s: Ranking, threshold: float, scores: Scores) -> Decision:
    """The verdict on a ranking of hypotheses, of one recording or of several together."""
    if s.ln_total < max(CLAIM, threshold):
        return Decision("adequate", None, (), ())
    candidates = s.library.candidates
    rest = _shapes(s) if s.unknown > 0.5 else ()
    named = (h for h in s.hypotheses if not h.unknown(candidates) and (not rest or len(h.members) == 1))
    known = next(named, None)
    if known is None or (rest and known.ln_bayes < NEARLY * max(h.ln_bayes for h in s.hypotheses)):
        return Decision("unexplained", None, (), (), rest, s.unknown)
    best = _simplest(s, needed(s, known))
    confounded, probability = [], []
    for member in best.members:
        others = tuple(i for i in best.members if i != member)
        alike, share = together(s, member, others, scores(others), bool(rest))
        confounded.append(alike)
        probability.append(share)
    verdict = "not-identifiable" if any(confounded) or min(probability) < SURE / 2 else "missing-physics"
    return Decision(verdict, best, tuple(confounded), tuple(probability), rest, s.unknown)


def together(
    s: Ranking, member: int, others: Sequence[int], scores: Array, with_rest: bool = False
) -> tuple[tuple[int, ...], float]:
    """What stands together with a member beside others, and the probability of these causes in its place."""
    p = s.posterior()
    alike = fits_alike(s, member, others, scores)
    if not with_rest and _share(s, p, (member, *alike)) < SURE:
        alike = _widened(s, p, member, alike, others)
    return alike, _share(s, p, (member, *alike), with_rest)


def _simplest(s: Ranking, best: Hypothesis) -> Hypothesis:
    """One axis instead of all, where the evidence for all is not 20 times larger."""
    c = s.library.candidates
    if len(best.members) != 1 or "," not in c[best.members[0]].axis:
        return best
    same = [h for h in s.hypotheses if len(h.members) == 1 and c[h.members[0]].effect == c[best.members[0]].effect]
    few = [h for h in same if h.ln_bayes > best.ln_bayes - TOGETHER]
    return min(few, key=lambda h: (len(c[h.members[0]].parameters), -h.ln_bayes))


def _shapes(s: Ranking) -> tuple[int, ...]:
    """Rivals by probability."""
    total: dict[int, float] = {}
    for h, w in zip(s.hypotheses, s.posterior(), strict=True):
        for i in h.members:
            if s.library.candidates[i].rival:
                total[i] = total.get(i, 0.0) + float(w)
    return tuple(sorted(total, key=lambda i: -total[i]))


def _share(s: Ranking, p: Array, alike: Sequence[int], with_rest: bool = False) -> float:
    """Probability of all hypotheses that contain one of these causes: without an unknown, or with one beside it.

    A law that leaves a rest may be another law much like it, so with a rest no cause is sure.
    """
    candidates = s.library.candidates
    named = {candidates[i].effect for i in alike}
    axes = {a for i in alike for a in candidates[i].axis.split(", ")}

    def inside(i: int) -> bool:
        return candidates[i].effect in named and bool(axes & set(candidates[i].axis.split(", ")))

    total = sum(w for h, w in zip(s.hypotheses, p, strict=True)
                if (with_rest or not h.unknown(candidates)) and any(inside(i) for i in h.members))  # fmt: skip
    return float(UNSURE * total if with_rest else total)


def fits_alike(s: Ranking, member: int, beside: Sequence[int], scores: Array) -> tuple[int, ...]:
    """Candidates of other ids whose evidence at their own best size is within a factor 20 of this one's."""
    candidates = s.library.candidates
    alike = [
        int(i)
        for i in np.argsort(-scores)
        if scores[i] > scores[member] - TOGETHER and not candidates[i].rival and i not in beside
    ]
    return _distinct(candidates, member, alike)


def _distinct(candidates: Sequence[Candidate], member: int, alike: Sequence[int]) -> tuple[int, ...]:
    """One candidate per id, other than the member's own."""
    out: dict[str, int] = {}
    for i in alike:
        if candidates[i].effect != candidates[member].effect:
            out.setdefault(candidates[i].effect, i)
    return tuple(out.values())


def _widened(s: Ranking, p: Array, member: int, alike: tuple[int, ...], beside: Sequence[int]) -> tuple[int, ...]:
    """Add the next likely causes until the set is sure or has three."""
    candidates = s.library.candidates
    for h, share in zip(s.hypotheses, p, strict=True):
        if share < LIKELY:
            break
        extra = [i for i in h.members if i not in beside]
        if len(h.members) != len(beside) + 1 or h.unknown(candidates) or len(extra) != 1:
            continue
        if len(alike) >= NAMED - 1 or _share(s, p, (member, *alike)) >= SURE:
            break
        alike = (*alike, *_distinct(candidates, member, [i for i in extra if i not in alike]))
        alike = _distinct(candidates, member, alike)
    return alike


def likeliest(s: Weighed, beside: Sequence[int] = ()) -> Array:
    """ln evidence (candidates,) at each one's best size and constants, relative to nothing, noise integrated over."""
    rows = []
    for p, ln in zip(s.projections, s.null, strict=True):
        here, gained = p, 0.0
        for i in beside:
            here, more = given(here, s.library.candidates[i])
            gained += more
        rows.append(at_best(here, s.library.layout) + ln + gained)
    rival = np.array([bool(c.rival) for c in s.library.candidates])
    return np.where(rival, -np.inf, logsumexp(np.stack(rows), axis=0) - logsumexp(s.null))
