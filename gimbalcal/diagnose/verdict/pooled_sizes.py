r"""What was found in several recordings, as one size with its uncertainty, and whether the recordings agree on it.

Each recording estimates its own size :math:`x_k` with covariance :math:`C_k`, calibration and noise of its own; a
direction that it cannot observe carries no information.

.. math:: \hat x = (\sum_k C_k^+)^{-1} \sum_k C_k^+ x_k , \qquad
    \chi^2 = \sum_k (x_k - \hat x)^T C_k^+ (x_k - \hat x)

Non-linear constants (lags, periods) belong to the unit: the values are taken at which all recordings together fit best.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gimbalcal.diagnose.evidence.projection import project, projected, rows_like
from gimbalcal.diagnose.library.assemble import columns_at
from gimbalcal.diagnose.library.candidates import Candidate, Library, Variant
from gimbalcal.diagnose.search.combine import CombinedRanking
from gimbalcal.diagnose.search.fitted_causes import FittedCauses, constant_value, fit_causes
from gimbalcal.diagnose.search.ranking import Search, reduced
from gimbalcal.diagnose.verdict.agreement import UNOBSERVABLE, Agreement, inverse_of, mean_of
from gimbalcal.effects import CATALOGUE
from gimbalcal.number import Array

Constants = tuple[tuple[str, float], ...]


@dataclass(frozen=True)
class Part:
    """One recording's share: its search with nothing but the members it sees, their fit, and which members those are.

    Without members, search and fit are those of nothing found.
    """

    search: Search
    fit: FittedCauses
    slots: tuple[int, ...]

    def span(self, slot: int) -> slice:
        """Return the slice of a member's parameters in the fit."""
        counts = [len(c.parameters) for c in self.search.library.candidates]
        j = self.slots.index(slot)
        return slice(sum(counts[:j]), sum(counts[: j + 1]))


def parts(c: CombinedRanking, members: Sequence[int]) -> tuple[Part, ...]:
    """Each recording fitted with the members it sees, their constants common to all."""
    own = [fit_causes(s, c.within(members, k)) for k, s in enumerate(c.searches)]
    common = [_common(c, members, j, own) if _shared(c, m) else None for j, m in enumerate(members)]
    out = []
    for k, s in enumerate(c.searches):
        slots = _slots(c, members, k)
        if not slots:
            out.append(Part(s, own[k], ()))
            continue
        chosen = [_columns(s, own[k], n, common[j]) for n, j in enumerate(slots)]
        small = _only(s, chosen)
        out.append(Part(small, fit_causes(small, range(len(slots))), slots))
    return tuple(out)


def _slots(c: CombinedRanking, members: Sequence[int], recording: int) -> tuple[int, ...]:
    return tuple(j for j, m in enumerate(members) if recording in c.sees(m))


def _shared(c: CombinedRanking, member: int) -> bool:
    """Return whether a cause has constants that several recordings determine."""
    found = c.library.candidates[member]
    return len(c.sees(member)) > 1 and bool(found.variants[0].constants) and CATALOGUE[found.effect].linear


def _common(c: CombinedRanking, members: Sequence[int], j: int, own: Sequence[FittedCauses]) -> Constants:
    """The constants of member j, of all that any recording tried, at which all together fit best."""
    seen = c.sees(members[j])
    tried = list(dict.fromkeys(v.constants for k in seen for v in _candidate(c, members[j], k).variants))
    total = np.zeros(len(tried))
    for k in seen:
        s, n = c.searches[k], _slots(c, members, k).index(j)
        others = [i for o in range(len(own[k].members)) if o != n for i in _index(s, own[k], o)]
        made = [columns_at(s.fit, _candidate(c, members[j], k), constants) for constants in tried]
        X = np.concatenate([s.library.X[:, others], *made], axis=1)
        p = project(own[k].projection.node, rows_like(s.rows, X))
        beside, width = range(len(others)), made[0].shape[1]
        starts = [len(others) + width * i for i in range(len(tried))]
        total += [p.explained(range(at, at + width), beside) / 2 for at in starts]
    return tried[int(np.argmax(total))]


def _candidate(c: CombinedRanking, member: int, recording: int) -> Candidate:
    return c.searches[recording].library.candidates[int(c.place[member, recording])]


def _index(s: Search, f: FittedCauses, n: int) -> tuple[int, ...]:
    return s.library.candidates[f.members[n]].variants[f.variants[n]].index


def _columns(s: Search, f: FittedCauses, n: int, constants: Constants | None) -> tuple[Candidate, Variant, Array]:
    """The n-th fitted cause at the common constants, or as this recording alone has it."""
    found = s.library.candidates[f.members[n]]
    v = found.variants[f.variants[n]]
    if constants is None:
        return found, v, s.library.X[:, list(v.index)]
    return found, Variant(constants, ()), columns_at(s.fit, found, constants)


def _only(s: Search, chosen: Sequence[tuple[Candidate, Variant, Array]]) -> Search:
    """The search with nothing in its library but these."""
    candidates, at = [], 0
    for found, v, X in chosen:
        here = replace(v, index=tuple(range(at, at + X.shape[1])), weight=1.0)
        candidates.append(replace(found, variants=(here,)))
        at += X.shape[1]
    few = Library(tuple(candidates), np.concatenate([X for *_, X in chosen], axis=1))
    nodes = [p.node for p in s.projections]
    rows = reduced(s.fit, few.X, nodes)
    projections = projected(nodes, rows)
    none = np.zeros(len(candidates))
    return replace(
        s, library=few, rows=rows, projections=projections, hypotheses=(),
        joint=np.zeros((len(projections), len(candidates))), singles=none, share=none,
    )  # fmt: skip


def pooled(shares: Sequence[Part], counts: Sequence[int]) -> tuple[Array, Array]:
    """Sizes (p,) of all members, `counts` parameters each, in prior sigmas, and their covariance (p, p)."""
    starts = np.cumsum([0, *counts])
    N, v = np.zeros((starts[-1], starts[-1])), np.zeros(starts[-1])
    for part in shares:
        at = np.array([i for j in part.slots for i in range(starts[j], starts[j + 1])], dtype=int)
        weight = inverse_of(part.fit.covariance)
        N[np.ix_(at, at)] += weight
        v[at] += weight @ part.fit.x
    C = np.linalg.pinv(N, rcond=UNOBSERVABLE, hermitian=True)
    return C @ v, C


def agreement_on_size(shares: Sequence[Part], slot: int) -> Agreement:
    """Return how well the recordings that see a member agree on its size."""
    seen = [(p.fit.x[p.span(slot)], inverse_of(p.fit.covariance[p.span(slot), p.span(slot)]))
            for p in shares if slot in p.slots]  # fmt: skip
    return mean_of(seen)[2]


def common_constants(
    c: CombinedRanking, members: Sequence[int], shares: Sequence[Part], slot: int
) -> tuple[tuple[str, float, float], ...]:
    """Non-linear constants of a member: name, value, and sigma from all recordings that see it."""
    each = []
    if not c.library.candidates[members[slot]].variants[0].constants:
        return ()
    for k, (s, part) in enumerate(zip(c.searches, shares, strict=True)):
        if slot in part.slots:
            n = part.slots.index(slot)
            each.append((part.search.library.candidates[n].variants[0].constants,
                         constant_value(s, fit_causes(s, c.within(members, k)), n)))  # fmt: skip
    out = []
    for n, (name, value) in enumerate(each[0][0]):
        weight = sum(1 / sigma**2 for _, rows in each for _, _, sigma in [rows[n]] if sigma > 0)
        out.append((name, float(value), float(1 / np.sqrt(weight)) if weight > 0 else 0.0))
    return tuple(out)
