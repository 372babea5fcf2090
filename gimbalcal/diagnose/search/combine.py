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
from dataclasses import dataclass

import numpy as np

from gimbalcal.diagnose.evidence.odds import DETECTED, SINGLE, UNKNOWN
from gimbalcal.diagnose.library.candidates import Candidate, Library
from gimbalcal.diagnose.search.ranking import Hypothesis, Ranking, Search, beside, log_priors, pairs
from gimbalcal.number import Array

ABSENT = -1
Pairs = dict[tuple[int, ...], dict[int, float]]


@dataclass(frozen=True)
class CombinedRanking(Ranking):
    """A ranking over several searches; `place` (candidates, recordings) is each candidate's index in each, or -1."""

    searches: tuple[Search, ...]
    place: Array
    share: Array  # (candidates,) ln prior share of each alone

    def within(self, members: Sequence[int], recording: int) -> tuple[int, ...]:
        """Indices that these candidates have in the library of one recording, those that it does not see left out."""
        at = self.place[list(members), recording]
        return tuple(int(i) for i in at[at != ABSENT])

    def sees(self, member: int) -> tuple[int, ...]:
        """Recordings that see a candidate."""
        return tuple(int(k) for k in np.flatnonzero(self.place[member] != ABSENT))

    def summed(self, values: Sequence[Array], otherwise: Sequence[Array] | None = None) -> Array:
        """Values per candidate of each recording (C_k, ...) added up over recordings (C, ...).

        A recording that does not see a candidate adds what it says without: `otherwise` (...), or nothing.
        """
        total = np.zeros((len(self.place), *values[0].shape[1:]))
        for k, v in enumerate(values):
            seen = self.place[:, k] != ABSENT
            total[seen] += v[self.place[seen, k]]
            if otherwise is not None:
                total[~seen] += otherwise[k]
        return total


def matched(searches: Sequence[Search]) -> tuple[tuple[Candidate, ...], Array]:
    """All candidates of all recordings, the same ones as one, and where each stands in each library."""
    found: dict[tuple[tuple[str, ...], int], tuple[Candidate, dict[int, int]]] = {}
    for k, s in enumerate(searches):
        for i, c in enumerate(s.library.candidates):
            owners = [k] if c.once else [k, ABSENT] if c.rival else [ABSENT]
            for owner in owners:
                found.setdefault((c.key, owner), (c, {}))[1][k] = i
    kept = [(c, at) for (_, owner), (c, at) in found.items() if not (c.rival and owner == ABSENT and len(at) == 1)]
    place = np.full((len(kept), len(searches)), ABSENT)
    for j, (_, at) in enumerate(kept):
        place[j, list(at)] = list(at.values())
    return tuple(c for c, _ in kept), place


def combine(searches: Sequence[Search]) -> CombinedRanking:
    """Singles, pairs and thirds over all recordings, every pair judged in every recording that sees one of it."""
    candidates, place = matched(searches)
    prior = log_priors(candidates)
    rival = np.array([bool(c.rival) for c in candidates])
    share = np.where(rival, np.log(UNKNOWN), np.log(SINGLE)) + prior
    c = CombinedRanking(Library(candidates, np.zeros((0, 0))), (), tuple(searches), place, share)
    ln = c.summed([s.singles for s in searches])
    own = [{} if ln.max() > DETECTED else _own_pairs(s) for s in searches]

    def gained(members: tuple[int, ...], seconds: Sequence[int], keep: int) -> Array:
        return _with_second(c, members, seconds, keep, own)[list(seconds)]

    found = [Hypothesis((i,), float(ln[i]), float(ln[i] + share[i])) for i in range(len(ln))]
    found += pairs(candidates, ln, prior, float((ln + prior).max()), gained)
    found.sort(key=lambda h: -h.ln_weight)
    return CombinedRanking(c.library, tuple(found), c.searches, place, share)


def _with_second(
    c: CombinedRanking, members: Sequence[int], seconds: Sequence[int], keep: int, own: Sequence[Pairs]
) -> Array:
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
        asked = sorted(set(c.within(seconds, k)))
        ln = np.full(len(s.singles), -np.inf)
        if known := own[k].get(mine):
            ln[list(known)] = list(known.values())
        else:
            ln[asked] = beside(s.projections, s.library, s.null, s.joint, mine, asked, keep)
        values.append(ln)
        without.append(np.asarray(_alone(s, mine, keep)))
    return c.summed(values, without)


def _own_pairs(s: Search) -> Pairs:
    """ln BF of each cause with each other where a recording, showing nothing by itself, has tried them all."""
    out: Pairs = {}
    if s.singles.max() <= DETECTED:
        for h in s.hypotheses:
            if len(h.members) == 2:
                for i, j in (h.members, h.members[::-1]):
                    out.setdefault((i,), {})[j] = h.ln_bayes
    return out


def _alone(s: Search, members: tuple[int, ...], keep: int) -> float:
    """ln BF of these members in one recording."""
    if len(members) == 1:
        return float(s.singles[members[0]])
    return float(beside(s.projections, s.library, s.null, s.joint, members[:-1], members[-1:], keep)[0])
