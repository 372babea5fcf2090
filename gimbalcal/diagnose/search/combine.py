r"""Combine the evidence of several recordings of one unit.

.. math:: \ln BF(h) = \sum_k \ln BF_k(h)

Calibration constants, noise and sizes are each recording's own, so that given a hypothesis the recordings are
independent: the Bayes factors of the same hypothesis multiply, and a product of e-values is an e-value. Hypotheses are
the same if effects, mechanisms, axes and covariates are. A recording that cannot see a cause says nothing of it: a
factor of one.

What happens once (a wrong position, a step) belongs to one recording and says nothing is missing in the others. A shape
without a cause may belong to one, or to all that show it: what no catalogue holds comes back with the unit too, and
would otherwise lose to a wrong cause whose evidence accumulates.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gimbalcal.diagnose.evidence.odds import DETECTION_EVIDENCE
from gimbalcal.diagnose.library.candidates import Candidate, Library
from gimbalcal.diagnose.search.ranking import ABSENT, Ranking, Search, evidence_beside, log_priors, ranked_hypotheses
from gimbalcal.number import Array

Pairs = dict[tuple[int, ...], dict[int, float]]


def matched_candidates(searches: Sequence[Search]) -> tuple[tuple[Candidate, ...], Array]:
    """All candidates of all recordings, the same ones as one, and where each stands in each library."""
    groups: dict[tuple[tuple[str, ...], int], tuple[Candidate, dict[int, int]]] = {}
    for k, s in enumerate(searches):
        for i, c in enumerate(s.library.candidates):
            owners = [k] if c.once else [k, ABSENT] if c.rival else [ABSENT]
            for owner in owners:
                groups.setdefault((c.key, owner), (c, {}))[1][k] = i
    kept = [(c, at) for (_, owner), (c, at) in groups.items() if not (c.rival and owner == ABSENT and len(at) == 1)]
    place = np.full((len(kept), len(searches)), ABSENT)
    for j, (_, at) in enumerate(kept):
        place[j, list(at)] = list(at.values())
    return tuple(c for c, _ in kept), place


def combine_rankings(searches: Sequence[Search]) -> Ranking:
    """Rank singles, pairs and thirds over all views, every pair judged in every view that sees one of it.

    The ranking of one view is its own search.
    """
    if len(searches) == 1:
        return searches[0]
    candidates, place = matched_candidates(searches)
    prior = log_priors(candidates)
    c = Ranking(Library(candidates, np.zeros((0, 0))), (), prior, views=tuple(searches), places=place)
    ln = c.summed([s.singles for s in searches])
    own = [{} if ln.max() > DETECTION_EVIDENCE else _own_pairs(s) for s in searches]

    def gained(members: Sequence[int], seconds: Sequence[int], keep: int) -> Array:
        return _with_second(c, members, seconds, keep, own)[list(seconds)]

    hypotheses, share = ranked_hypotheses(candidates, ln, prior, float((ln + prior).max()), gained)
    return replace(c, hypotheses=hypotheses, share=share)


def _with_second(c: Ranking, members: Sequence[int], seconds: Sequence[int], keep: int, own: Sequence[Pairs]) -> Array:
    """ln BF (candidates,) against nothing of `members` with each of `seconds`, added up over the recordings.

    What a recording has judged already is taken from `own`.
    """
    values, without = [], []
    for k, s in enumerate(c.searches):
        mine = c.within(members, k)
        if not mine:
            values.append(s.singles)
            without.append(np.zeros(()))
            continue
        partners = sorted(set(c.within(seconds, k)))
        ln = np.full(len(s.singles), -np.inf)
        if known := own[k].get(mine):
            ln[list(known)] = list(known.values())
        else:
            ln[partners] = evidence_beside(s, mine, partners, keep)
        values.append(ln)
        without.append(np.asarray(_evidence_in_one(s, mine, keep)))
    return c.summed(values, without)


def _own_pairs(s: Search) -> Pairs:
    """ln BF of each cause with each other where a recording, showing nothing by itself, has tried them all."""
    out: Pairs = {}
    if s.singles.max() <= DETECTION_EVIDENCE:
        for h in s.hypotheses:
            if len(h.members) == 2:
                for i, j in (h.members, h.members[::-1]):
                    out.setdefault((i,), {})[j] = h.ln_bayes
    return out


def _evidence_in_one(s: Search, members: tuple[int, ...], keep: int) -> float:
    """ln BF of these members in one recording."""
    if len(members) == 1:
        return float(s.singles[members[0]])
    return float(evidence_beside(s, members[:-1], members[-1:], keep)[0])
