"""A law beside a known cause: what the catalogue has a name for keeps it, and the formula says the rest.

The cube of a sine is the sine, which eccentricity has, and its third harmonic; no formula of one term is both. Each of
the likeliest known causes is therefore put into the model, and single terms are sought beside it:

.. math:: \\ln E = \\ln E_{known} + \\ln E_{law | known}
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gimbalcal.diagnose.evidence.noise import Node
from gimbalcal.diagnose.evidence.odds import CLAIM, TOGETHER
from gimbalcal.diagnose.evidence.projection import projected
from gimbalcal.diagnose.laws.grounds import ground_of_search, ground_of_view, together
from gimbalcal.diagnose.laws.law_search import Ground, Law, laws_of
from gimbalcal.diagnose.library.candidates import Candidate, Library
from gimbalcal.diagnose.search.combine import CombinedRanking
from gimbalcal.diagnose.search.ranking import Hypothesis, Ranking, Search, Weighed, likeliest_variants, reduced
from gimbalcal.diagnose.search.refit import with_columns
from gimbalcal.diagnose.verdict.fitted_causes import fit_causes
from gimbalcal.diagnose.verdict.verify import physical_columns
from gimbalcal.number import Array
from gimbalcal.views.core import Fit, View

FIRST = 3  # known causes that a law is sought beside
NAMED = float(np.log(1000.0))  # odds at which a formula of one term beside a name gives way to one without


@dataclass(frozen=True)
class Beside:
    """Laws by evidence in a ground, and the known cause that is in the model there with its ln evidence; or none.

    searches: the recordings with that cause in their models; columns: (n, C, p) of it in a view.
    """

    ground: Ground
    laws: Sequence[Law]
    known: Candidate | None = None
    ln_known: float = 0.0
    searches: tuple[Search, ...] = ()
    columns: Array | None = None

    @property
    def name(self) -> tuple[str, ...]:
        """The known cause as --with takes it."""
        if self.known is None:
            return ()
        one = self.known.axis and "," not in self.known.axis
        return (f"{self.known.effect}:{self.known.axis}" if one else self.known.effect,)

    @property
    def total(self) -> float:
        """ln evidence of the best law and what it stands beside."""
        return self.ln_known + self.laws[0].evidence if self.laws else -np.inf


def in_searches(searches: Sequence[Search], nodes: Sequence[Node], ranked: Ranking, alone: bool) -> Beside:
    """Laws of recordings of known attitude, beside the known cause with which they say most; or `alone`."""

    def ground(own: Sequence[Search]) -> Ground:
        return together([ground_of_search(s, node) for s, node in zip(own, nodes, strict=True)])

    best = Beside(g := ground(searches), laws_of(g), searches=tuple(searches))
    for h in () if alone else _likely(ranked):
        member = h.members[0]
        places = [ranked.within((member,), k) if isinstance(ranked, CombinedRanking) else (member,)
                  for k in range(len(searches))]  # fmt: skip
        own = tuple(_with_cause(s, at) for s, at in zip(searches, places, strict=True))
        c = ranked.library.candidates[member]
        best = _better(best, Beside(g := ground(own), laws_of(g, products=False), c, h.ln_weight, own), ranked)
    return best


def in_view(v: View, m: Fit, sigma: Array, left: Weighed, alone: bool) -> Beside | None:
    """The same of a view, beside a model in noise of `sigma` (n, C); `left`: what may be missing. None: no ground."""
    g = ground_of_view(v, m, sigma)
    if g is None:
        return None
    best = Beside(g, laws_of(g))
    for h in () if alone else _likely(left):
        c = left.library.candidates[h.members[0]]
        X = left.library.X[..., list(c.variants[likeliest_variants(left, h.members)[0]].index)]
        if (g := ground_of_view(v, with_columns(v, m, X), sigma)) is not None:
            best = _better(best, Beside(g, laws_of(g, products=False), c, h.ln_weight, columns=X), left)
    return best


def _better(best: Beside, other: Beside, ranked: Ranking) -> Beside:
    """The other one where it says as much: a name is worth more than a formula, another name has to be likelier.

    As every law it has to come near the best of what else was weighed.
    """
    if not other.laws or other.laws[0].evidence < CLAIM:
        return best
    if other.total < max(h.ln_weight for h in ranked.hypotheses) - TOGETHER:
        return best
    return other if other.total > best.total - NAMED * (best.known is None) else best


def _likely(ranked: Ranking) -> list[Hypothesis]:
    """The likeliest known causes, each effect once, without what happens once."""
    every, out = ranked.library.candidates, dict[str, Hypothesis]()
    for h in ranked.hypotheses:
        c = every[h.members[0]]
        if len(h.members) == 1 and not c.rival and not c.once and h.ln_weight >= CLAIM:
            out.setdefault(c.effect, h)
    return list(out.values())[:FIRST]


def _with_cause(s: Search, members: Sequence[int]) -> Search:
    """The search with these causes, at their likeliest constants, as part of its model and nothing in its library."""
    if not members:
        return s
    f = fit_causes(s, members)
    o = replace(s.o, jacobian=np.concatenate([s.o.jacobian, physical_columns(s, f)], axis=2))
    none = Library((), np.zeros((len(o.reduced(o.residual[:, :, None])), 0)))
    nodes = [p.node for p in s.projections]
    rows = reduced(o, none, nodes)
    each = projected(nodes, rows)
    null = np.array([np.log(p.node.prior) + p.log_likelihood()[0] for p in each])
    empty = np.zeros((len(each), 0))
    return replace(s, library=none, hypotheses=(), projections=each, null=null, joint=empty, singles=empty[0],
                   share=empty[0], o=o, rows=rows)  # fmt: skip
