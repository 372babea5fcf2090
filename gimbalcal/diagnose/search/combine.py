r"""Combine the evidence of several recordings of one unit.

.. math:: \ln BF(h) = \sum_k \ln BF_k(h)

Calibration constants, noise and sizes are each recording's own, so that given a hypothesis the recordings are
independent: the Bayes factors of the same hypothesis multiply, and a product of e-values is an e-value. Hypotheses are
the same if effects, mechanisms, axes and covariates are. A recording in which a cause does not act has no evidence on
it: a factor of one.

A single event (a wrong position, a step) belongs to one recording and is absent from the others. A shape without a
cause may belong to one recording, or to all that show it: an effect outside the catalogue recurs with the unit too, and
would otherwise lose to a wrong cause whose evidence accumulates.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from gimbalcal.diagnose.library.candidates import Candidate, Library
from gimbalcal.diagnose.search.ranking import ABSENT, Ranking, Search, evidence_of_sets, log_priors, ranked_hypotheses
from gimbalcal.number import Array


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
    c = Ranking(Library(candidates, np.zeros((0, 0))), (), prior, parts=tuple(searches), places=place)
    ln = c.summed([s.singles for s in searches])
    hypotheses, share = ranked_hypotheses(candidates, ln, prior, float((ln + prior).max()), partial(_with_second, c))
    return replace(c, hypotheses=hypotheses, share=share)


def _with_second(c: Ranking, members: Sequence[int], seconds: Sequence[int], keep: int) -> Array:
    """ln BF (seconds,) against nothing of `members` with each of `seconds`, added up over the recordings."""
    values, without = [], []
    for k, s in enumerate(c.searches):
        mine = c.within(members, k)
        if not mine:
            values.append(s.singles)
            without.append(np.zeros(()))
            continue
        partners = sorted(set(c.within(seconds, k)))
        ln = np.full(len(s.singles), -np.inf)
        ln[partners] = evidence_of_sets(s, mine, partners, keep)
        values.append(ln)
        first, last = mine[:-1], mine[-1:]
        without.append(evidence_of_sets(s, first, last, keep)[0] if first else s.singles[mine[0]])
    return c.summed(values, without)[list(seconds)]
