"""The verdict of several recordings of one unit: the bar that clean ones set together, and what stands together."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gimbalcal.diagnose.evidence.projection import Projection, log_bayes
from gimbalcal.diagnose.evidence.scale import ANY_SIZE
from gimbalcal.diagnose.library.candidates import Candidate
from gimbalcal.diagnose.search.combine import CombinedRanking
from gimbalcal.diagnose.search.ranking import given
from gimbalcal.diagnose.verdict.decide import Decision, judge
from gimbalcal.diagnose.verdict.threshold import anything, clean_singles
from gimbalcal.inference.algebra import logsumexp
from gimbalcal.number import Array


def clean_together(c: CombinedRanking, rng: np.random.Generator) -> tuple[Array, tuple[Array, ...]]:
    """ln Bayes factors of "something is missing" on simulated clean recordings: together, and of each alone."""
    drawn = [clean_singles(s, rng) for s in c.searches]
    alone = tuple(anything(d, s.share) for d, s in zip(drawn, c.searches, strict=True))
    return anything(c.summed(drawn), c.share), alone


def decide_together(c: CombinedRanking, threshold: float) -> Decision:
    """The verdict of all recordings; `threshold` is the ln Bayes factor that clean ones reach together."""
    return judge(c, threshold, lambda others: likeliest_together(c, others))


def likeliest_together(c: CombinedRanking, others: Sequence[int]) -> Array:
    """ln evidence (candidates,) at each one's best plausible size, the same in all recordings, beside the others.

    A size of its own in each would excuse a cause for being strong in one recording and absent from the next.
    """
    values, without = [], []
    for k, s in enumerate(c.searches):
        rows, base = [], []
        for p, ln in zip(s.projections, s.null, strict=True):
            here, gained = p, float(ln)
            for i in c.within(others, k):
                here, more = given(here, s.library.candidates[i])
                gained += more
            rows.append(_by_size(here, s.library.candidates) + gained)
            base.append(gained)
        values.append(logsumexp(np.stack(rows), axis=0) - logsumexp(s.null))
        without.append(logsumexp(np.array(base)) - logsumexp(s.null))
    best = c.summed(values, without).max(axis=1)
    return np.where([bool(x.rival) for x in c.library.candidates], -np.inf, best)


def _by_size(p: Projection, candidates: Sequence[Candidate]) -> Array:
    """ln Bayes factor (candidates, sizes) of each known cause at its best constants."""
    out = np.zeros((len(candidates), len(ANY_SIZE)))
    for i, c in enumerate(candidates):
        if not c.rival:
            at = np.array([v.index for v in c.variants])
            out[i] = log_bayes(p, at, ANY_SIZE).max(axis=0)
    return out
