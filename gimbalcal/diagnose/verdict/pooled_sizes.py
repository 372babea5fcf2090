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
from functools import cached_property

import numpy as np

from gimbalcal.diagnose.evidence.projection import project, projected, rows_like
from gimbalcal.diagnose.library.assemble import columns_at
from gimbalcal.diagnose.library.candidates import Candidate, Constants, Library, Variant
from gimbalcal.diagnose.search.fitted_causes import (
    FittedCauses,
    JointCovariance,
    constant_value,
    fit_causes,
    joint_covariance,
    scaled_inverse,
)
from gimbalcal.diagnose.search.ranking import Ranking, Search, reduced
from gimbalcal.diagnose.verdict.agreement import UNOBSERVABLE, inverse_of, mean_of
from gimbalcal.effects import CATALOGUE
from gimbalcal.estimate.sharing import Agreement
from gimbalcal.number import Array


@dataclass(frozen=True)
class RecordingCauses:
    """The share of one recording: its search, the fit of the members that it sees, and the ordinals of those.

    Where members have constants that are common to several recordings, the search holds nothing but the members it
    sees, at those constants; `alone` is the search with everything, and `own` its fit with constants of its own.
    """

    search: Search
    fit: FittedCauses
    ordinals: tuple[int, ...]
    alone: Search
    own: FittedCauses

    @property
    def causes(self) -> tuple[Candidate, ...]:
        """The members that the recording sees."""
        return tuple(self.search.library.candidates[m] for m in self.fit.members)

    def cause(self, ordinal: int) -> Candidate:
        """Return a member as the recording sees it."""
        return self.causes[self.ordinals.index(ordinal)]

    def span(self, ordinal: int) -> slice:
        """Return the slice of a member's parameters in the fit."""
        counts = [len(c.parameters) for c in self.causes]
        j = self.ordinals.index(ordinal)
        return slice(sum(counts[:j]), sum(counts[: j + 1]))

    def significance(self, ordinal: int) -> float:
        """Return the significance [sigma] of a member beyond all else; zero where it is not seen."""
        return self.fit.significance[self.ordinals.index(ordinal)] if ordinal in self.ordinals else 0.0

    @cached_property
    def joint(self) -> JointCovariance:
        """The covariance of sizes and continuous constants, of which those of each member go by its ordinal."""
        covariance = joint_covariance(self.search, self.fit)
        return replace(covariance, constants=tuple((self.ordinals[n], p) for n, p in covariance.constants))

    def spreads(self, ordinal: int) -> list[float]:
        """Return how far each constant of a member may be off among the values that were tried, SI."""
        return [spread for *_, spread in constant_value(self.alone, self.own, self.ordinals.index(ordinal))]


def causes_by_recording(c: Ranking, members: Sequence[int]) -> tuple[RecordingCauses, ...]:
    """Return each recording fitted with the members it sees, their constants common to all."""
    own = [fit_causes(s, c.within(members, k)) for k, s in enumerate(c.searches)]
    common = [_common(c, members, j, own) if _shared(c, m) else None for j, m in enumerate(members)]
    out = []
    for k, s in enumerate(c.searches):
        ordinals = _slots(c, members, k)
        if all(common[j] is None for j in ordinals):
            out.append(RecordingCauses(s, own[k], ordinals, s, own[k]))
            continue
        small = _only(s, [_columns(s, own[k], n, common[j]) for n, j in enumerate(ordinals)])
        out.append(RecordingCauses(small, fit_causes(small, range(len(ordinals))), ordinals, s, own[k]))
    return tuple(out)


def _slots(c: Ranking, members: Sequence[int], recording: int) -> tuple[int, ...]:
    return tuple(j for j, m in enumerate(members) if recording in c.sees(m))


def _shared(c: Ranking, member: int) -> bool:
    """Return whether a cause has constants that several recordings determine."""
    candidate = c.library.candidates[member]
    return len(c.sees(member)) > 1 and bool(candidate.variants[0].constants) and CATALOGUE[candidate.effect].linear


def _common(c: Ranking, members: Sequence[int], j: int, own: Sequence[FittedCauses]) -> Constants:
    """The constants of member j, of all that any recording tried, at which all together fit best."""
    recordings = c.sees(members[j])
    tried = list(dict.fromkeys(v.constants for k in recordings for v in _candidate(c, members[j], k).variants))
    total = np.zeros(len(tried))
    for k in recordings:
        s, n = c.searches[k], _slots(c, members, k).index(j)
        others = [i for o in range(len(own[k].members)) if o != n for i in _index(s, own[k], o)]
        columns = [columns_at(s.fit, _candidate(c, members[j], k), constants) for constants in tried]
        X = np.concatenate([s.library.X[:, others], *columns], axis=1)
        p = project(own[k].projection.node, rows_like(s.rows, X))
        ordinals, width = range(len(others)), columns[0].shape[1]
        starts = [len(others) + width * i for i in range(len(tried))]
        total += [p.explained(range(at, at + width), ordinals) / 2 for at in starts]
    return tried[int(np.argmax(total))]


def _candidate(c: Ranking, member: int, recording: int) -> Candidate:
    (at,) = c.within((member,), recording)
    return c.searches[recording].library.candidates[at]


def _index(s: Search, f: FittedCauses, n: int) -> tuple[int, ...]:
    return s.library.candidates[f.members[n]].variants[f.variants[n]].index


def _columns(s: Search, f: FittedCauses, n: int, constants: Constants | None) -> tuple[Candidate, Variant, Array]:
    """The n-th fitted cause at the common constants, or as this recording alone has it."""
    candidate = s.library.candidates[f.members[n]]
    v = candidate.variants[f.variants[n]]
    if constants is None:
        return candidate, v, s.library.X[:, list(v.index)]
    return candidate, Variant(constants, ()), columns_at(s.fit, candidate, constants)


def _only(s: Search, chosen: Sequence[tuple[Candidate, Variant, Array]]) -> Search:
    """The search with nothing in its library but these."""
    candidates, at = [], 0
    for candidate, v, X in chosen:
        here = replace(v, index=tuple(range(at, at + X.shape[1])), weight=1.0)
        candidates.append(replace(candidate, variants=(here,)))
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


@dataclass(frozen=True)
class CommonSizes:
    """Causes by all recordings: sizes x (p,) in prior sigmas, constants of each, and the covariance of all in SI."""

    causes: tuple[Candidate, ...]
    x: Array
    constants: tuple[tuple[tuple[str, float, float], ...], ...]
    joint: JointCovariance


def common_sizes(by_recording: Sequence[RecordingCauses], causes: Sequence[Candidate]) -> CommonSizes:
    """Return the sizes of causes at the constants that are common to all recordings, and what these leave open."""
    joint = _joint(by_recording, causes)
    x, _ = pooled(by_recording, [len(c.parameters) for c in causes])
    constants = tuple(_constants(by_recording, j, joint) for j in range(len(causes)))
    return CommonSizes(tuple(causes), x, constants, joint)


def pooled(by_recording: Sequence[RecordingCauses], counts: Sequence[int]) -> tuple[Array, Array]:
    """Return sizes (p,) of all members, `counts` parameters each, in prior sigmas, and their covariance (p, p)."""
    if len(by_recording) == 1:
        return by_recording[0].fit.x, by_recording[0].fit.covariance
    starts = np.cumsum([0, *counts])
    N, v = np.zeros((starts[-1], starts[-1])), np.zeros(starts[-1])
    for part in by_recording:
        at = np.array([i for j in part.ordinals for i in range(starts[j], starts[j + 1])], dtype=int)
        weight = inverse_of(part.fit.covariance)
        N[np.ix_(at, at)] += weight
        v[at] += weight @ part.fit.x
    C = np.linalg.pinv(N, rcond=UNOBSERVABLE, hermitian=True)
    return C @ v, C


def _joint(by_recording: Sequence[RecordingCauses], causes: Sequence[Candidate]) -> JointCovariance:
    """Return the covariance of the sizes and continuous constants of all members, whose information adds."""
    if len(by_recording) == 1:
        return by_recording[0].joint
    starts = np.cumsum([0, *(len(c.parameters) for c in causes)])
    constants = tuple(dict.fromkeys(one for part in by_recording for one in part.joint.constants))
    p = int(starts[-1])
    N = np.zeros((p + len(constants), p + len(constants)))
    for part in by_recording:
        at = [i for j in part.ordinals for i in range(starts[j], starts[j + 1])]
        at += [p + constants.index(one) for one in part.joint.constants]
        N[np.ix_(at, at)] += scaled_inverse(part.joint.covariance)
    return JointCovariance(constants, scaled_inverse(N))


def agreement_on_size(by_recording: Sequence[RecordingCauses], ordinal: int) -> Agreement:
    """Return how well the recordings that see a member agree on its size."""
    sizes = [(p.fit.x[p.span(ordinal)], inverse_of(p.fit.covariance[p.span(ordinal), p.span(ordinal)]))
            for p in by_recording if ordinal in p.ordinals]  # fmt: skip
    return mean_of(sizes)[2]


def _constants(
    by_recording: Sequence[RecordingCauses], ordinal: int, joint: JointCovariance
) -> tuple[tuple[str, float, float], ...]:
    """Return the non-linear constants of a member: name, value and sigma in SI, from all recordings that see it.

    The sigma of a continuous constant is that of the fit with all else, of others that of the values that were tried.
    """
    recordings = [p for p in by_recording if ordinal in p.ordinals]
    first, sigma = recordings[0], joint.sigma_of(ordinal)
    variant = first.cause(ordinal).variants[first.fit.variants[first.ordinals.index(ordinal)]]
    spread = [_sigma_of_mean(each) for each in zip(*(p.spreads(ordinal) for p in recordings), strict=True)]
    return tuple((name, float(x), sigma.get(name, s)) for (name, x), s in zip(variant.constants, spread, strict=True))


def _sigma_of_mean(sigma: Sequence[float]) -> float:
    """Return one sigma of the mean of values with these sigmas, of which those that are zero say nothing."""
    if len(sigma) == 1:
        return sigma[0]
    weight = sum(1 / s**2 for s in sigma if s > 0)
    return float(1 / np.sqrt(weight)) if weight > 0 else 0.0
