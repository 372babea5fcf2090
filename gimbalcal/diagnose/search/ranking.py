r"""The search: singles, refined constants, pairs and thirds, and the unknown alone or with a known cause.

Prior: all causes of the catalogue have equal shares, then their axes; that of a pair is proportional to those of its
causes; the unknown has its own prior. All evidence is relative to "nothing is missing", with the noise integrated over.
"""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from gimbalcal.diagnose.evidence.correlated_noise import possible_noises
from gimbalcal.diagnose.evidence.node import Node
from gimbalcal.diagnose.evidence.odds import (
    CAUSE_AND_SHAPE,
    CLAIM,
    DETECTION_EVIDENCE,
    PAIR,
    SINGLE,
    UNKNOWN,
    USUAL_CAUSE_BONUS,
)
from gimbalcal.diagnose.evidence.projection import (
    Projection,
    ReducedRows,
    append_columns,
    condition_on,
    each_size,
    gather_evidence,
    project_all,
    stacked_rows,
)
from gimbalcal.diagnose.evidence.scale import Free
from gimbalcal.diagnose.evidence.stated_noise import coloured_row_count
from gimbalcal.diagnose.library.assemble import assemble_library as library_of
from gimbalcal.diagnose.library.candidates import Candidate, Layout, Library, SelectedCause
from gimbalcal.diagnose.search.refine import refine_candidates
from gimbalcal.diagnose.search.refit import channels_of
from gimbalcal.effects import CATALOGUE
from gimbalcal.inference.algebra import logsumexp, orthonormal_columns
from gimbalcal.number import Array
from gimbalcal.views.core import Fit

FIRST = 14  # of them
KEEP, KEEP_FEW = 8, 2  # noises over which a second cause is judged, where something is found and where nothing is
ABSENT = -1  # place of a candidate in the library of a view that does not see it
MAX_NATS_BEHIND = 5.0  # nats behind the likeliest scales of channels, within which a second cause is judged at others
MIN_SIGMAS_PER_PRIOR = 0.05  # sigmas per prior sigma: less is not seen by this recording at any plausible size


Factors = tuple[Array, Array, Array]
Gained = Callable[[Sequence[int], Sequence[int], int], Array]
"""ln BF (seconds,) against nothing of some members with each of `seconds`, over so many noises."""


@dataclass(frozen=True)
class Hypothesis:
    """A set of causes, its ln Bayes factor against none, and ln of prior share times that."""

    members: tuple[int, ...]
    ln_bayes: float
    ln_weight: float

    def unknown(self, candidates: Sequence[Candidate]) -> bool:
        """Return whether a shape without a cause is among the members."""
        return any(candidates[i].rival for i in self.members)


def total_weight(hypotheses: Sequence[Hypothesis]) -> float:
    """ln of the weights of some hypotheses together."""
    return float(logsumexp(np.array([h.ln_weight for h in hypotheses]))) if hypotheses else -np.inf


@dataclass(frozen=True)
class Ranking:
    """Candidates, and hypotheses over them, best first, by one view or by several of one unit.

    share: ln prior share (candidates,) of each alone. parts: of several views the search of each; places (candidates,
    views): of each candidate in each library, or `ABSENT`.
    """

    library: Library
    hypotheses: tuple[Hypothesis, ...]
    share: Array
    parts: tuple[Search, ...] = field(default=(), kw_only=True)
    places: Array = field(default_factory=lambda: np.zeros((0, 0), dtype=int), kw_only=True)

    @property
    def searches(self) -> tuple[Search, ...]:
        """The search of each view."""
        return self.parts

    @property
    def place(self) -> Array:
        """The ordinal of each candidate in the library of each view (candidates, views), or `ABSENT`."""
        return self.places

    def within(self, members: Sequence[int], view: int) -> tuple[int, ...]:
        """Return the ordinals of these candidates in the library of one view, without those that it does not see."""
        at = self.place[list(members), view]
        return tuple(int(i) for i in at[at != ABSENT])

    def sees(self, member: int) -> tuple[int, ...]:
        """Return the ordinals of the views that see a candidate."""
        return tuple(int(k) for k in np.flatnonzero(self.place[member] != ABSENT))

    def summed(self, values: Sequence[Array], otherwise: Sequence[Array] | None = None) -> Array:
        """Return values per candidate of each view (C_k, ...) added up over the views (C, ...).

        A view in which a candidate does not act adds its value without it: `otherwise` (...), or zero.
        """
        total = np.zeros((len(self.place), *values[0].shape[1:]))
        for k, v in enumerate(values):
            present = self.place[:, k] != ABSENT
            total[present] += v[self.place[present, k]]
            if otherwise is not None:
                total[~present] += otherwise[k]
        return total

    @property
    def ln_total(self) -> float:
        """ln Bayes factor of "something is missing" against nothing."""
        return total_weight(self.hypotheses)

    @property
    def unknown(self) -> float:
        """Probability that no cause of the catalogue explains all of it, given that something is missing."""
        return float(self.posterior()[[h.unknown(self.library.candidates) for h in self.hypotheses]].sum())

    @property
    def best_known(self) -> Hypothesis | None:
        """The likeliest hypothesis without a shape, if there is one."""
        return next((h for h in self.hypotheses if not h.unknown(self.library.candidates)), None)

    def posterior(self) -> Array:
        """Probability of each hypothesis given that something is missing."""
        w = np.array([h.ln_weight for h in self.hypotheses])
        return np.asarray(np.exp(w - logsumexp(w)))


@dataclass(frozen=True)
class Search(Ranking):
    """The ranking of what a fit of one view may lack, over its noises, with all that it takes to ask further."""

    fit: Fit
    rows: ReducedRows
    projections: tuple[Projection, ...]
    null: Array  # (nodes,) ln prior x likelihood of nothing missing
    joint: Array  # (nodes, candidates) ln prior x likelihood of each alone
    singles: Array  # (candidates,) ln Bayes factors

    @property
    def searches(self) -> tuple[Search, ...]:
        """The search itself."""
        return (self,)

    @property
    def place(self) -> Array:
        """The ordinals of its own candidates (candidates, 1)."""
        return np.arange(len(self.library.candidates))[:, None]

    def columns(self, X: Array) -> Array:
        """Return columns (n, C, p) as reduced rows (R, p) in the unit of this search."""
        return self.fit.reduced(X) / self.rows.unit


def log_priors(candidates: Sequence[Candidate], recording_kind: str = "") -> Array:
    """Return ln prior probability of each candidate among the known (or the unknown) ones, summing to one in each.

    All effects have equal priors except those that every rig of the kind has; half of each prior is for all axes
    together, which are of one make, and half for a single axis.
    """
    together, single = (Counter(c.effect for c in candidates if ("," in c.axis) is wide) for wide in (True, False))
    share = np.array([
        USUAL_CAUSE_BONUS * is_usual(c, recording_kind)
        - np.log((together if "," in c.axis else single)[c.effect])
        - np.log(2) * (together[c.effect] > 0 and single[c.effect] > 0)
        for c in candidates
    ])  # fmt: skip
    rival = np.array([bool(c.rival) for c in candidates])
    for group in (rival, ~rival):
        if group.any():
            share[group] -= logsumexp(share[group])
    return share


def is_usual(c: Candidate, recording_kind: str) -> bool:
    """Return whether every rig of the kind has this, at some size."""
    return not c.rival and recording_kind in CATALOGUE[c.effect].role.textbook_kinds


def without_unclaimed(s: Ranking, best: Hypothesis) -> Hypothesis:
    """Return the hypothesis without members that are not claimed: each must make the others 20 times likelier."""
    for h in sorted(s.hypotheses, key=lambda h: -h.ln_weight):
        if set(h.members) < set(best.members) and h.ln_weight > best.ln_weight - CLAIM:
            return without_unclaimed(s, h)
    return best


def reduced_rows(fit: Fit, X: Array, nodes: Sequence[Node], unit: float = 0.0) -> ReducedRows:
    """Return the model, reduced columns X (R, P) and the data as rows, for these noises.

    Rows are in units of the noise of known scale; where it is not known in units of the rms misfit, or of `unit` [SI],
    and the scale is bounded by the scatter of the samples. Several channels may have scales of their own.
    """
    y, noise = fit.reduced(fit.residual[:, :, None]), fit.view.noise
    if noise.scale_known:
        return stacked_rows(fit.reduced(fit.Z), X, y, coloured_row_count(fit, nodes))
    unit = unit or rms_misfit(fit)
    Q = orthonormal_columns(fit.reduced(fit.jacobian))
    sample = 0.0
    if noise.sample is not None:
        sample = float(np.sqrt(np.mean(fit.view.of_scales().noise.weighted(noise.sample) ** 2))) / unit
        sample /= float(np.exp(np.mean(np.log(noise.scales or 1.0))))  # rows are divided by scales of the channels
    scale = Free(len(y) - Q.shape[1], sample, channels=channels_of(fit.view, unit))
    return stacked_rows(Q, X / unit, y / unit, len(y), scale, unit)


def projections_of(
    fit: Fit, X: Array, memory: bool = True, unit: float = 0.0, layout: Layout | None = None
) -> tuple[Projection, ...]:
    """Return reduced columns X (R, P), of candidates of a layout, beyond a model in each of its noises."""
    every = possible_noises(fit, memory)
    return project_all(every, reduced_rows(fit, X, every, unit), layout=layout)


def rms_misfit(fit: Fit) -> float:
    """Return the root mean square [SI] of what a model leaves of the weighted rows."""
    return max(float(np.sqrt(np.mean(fit.view.noise.weighted(fit.residual) ** 2))), 1e-300)


def search(fit: Fit, candidates: Library | None = None, nodes: Sequence[Node] = ()) -> Search:
    """Rank what may be missing from a model: single causes, and pairs if one is insufficient or none is found.

    The candidates are those of the catalogue and the noises those of the view, if no others are given. In a noise of
    known scale constants are refined here, and candidates that the calibration takes up are left out; else a fit with
    all constants follows each round.
    """
    library, nodes = candidates or library_of(fit), nodes or possible_noises(fit)
    rows = reduced_rows(fit, library.X, nodes)
    projections = project_all(nodes, rows, layout=library.layout)
    if fit.view.noise.scale_known:
        # What the least noise of the grid hides, all of them hide.
        library = _visible_candidates(library, projections[0])
    factors = bayes_factors(projections, library.layout)
    finer = refine_candidates(fit, library, projections, *factors[1:], rows) if fit.view.noise.scale_known else library
    if finer is not library:
        rows = append_columns(rows, library.X, finer.X[:, library.X.shape[1] :])
        projections, library = project_all(nodes, rows, projections), finer
        factors = bayes_factors(projections, library.layout)
    return rank_hypotheses(fit, library, rows, projections, factors)


def rank_hypotheses(
    fit: Fit, library: Library, rows: ReducedRows, projections: tuple[Projection, ...], factors: Factors
) -> Search:
    """Rank single causes, and pairs if one is insufficient or none is found, from the factors of single causes."""
    null, ln, joint = factors
    prior = log_priors(library.candidates, fit.view.kind)
    s = Search(library, (), prior, fit, rows, projections, null, joint, ln)
    floor = float(joint.max() - logsumexp(null)) + float(prior.min())
    hypotheses, share = ranked_hypotheses(library.candidates, ln, prior, floor, partial(evidence_of_sets, s))
    return replace(s, hypotheses=hypotheses, share=share)


def ranked_hypotheses(
    candidates: Sequence[Candidate], ln: Array, prior: Array, floor: float, gained: Gained
) -> tuple[tuple[Hypothesis, ...], Array]:
    """Return singles, pairs and thirds (`promising_pairs`), best first, and ln of the prior share (candidates,) of one.

    ln (candidates,) is the ln Bayes factor of each alone.
    """
    share = prior + np.log([UNKNOWN if c.rival else SINGLE for c in candidates])
    singles = [Hypothesis((i,), float(ln[i]), float(ln[i] + share[i])) for i in range(len(ln))]
    every = singles + promising_pairs(candidates, ln, prior, floor, gained)
    return tuple(sorted(every, key=lambda h: -h.ln_weight)), share


def _visible_candidates(library: Library, p: Projection) -> Library:
    """Return only candidates that the calibration does not absorb at ten times their plausible size."""
    norm = np.sqrt(p.G.diagonal)
    kept = [c for c in library.candidates if max(norm[list(v.index)].max() for v in c.variants) > MIN_SIGMAS_PER_PRIOR]
    return Library(tuple(kept), library.X)


def log_evidence(projections: Sequence[Projection]) -> Array:
    """Return ln of prior x likelihood (nodes,) of each noise where nothing is missing."""
    return np.array([p.log_evidence() for p in projections])


def bayes_factors(projections: Sequence[Projection], layout: Layout) -> Factors:
    """ln weight of no effect per node, ln BF of each candidate, and ln weight per node and candidate."""
    null = log_evidence(projections)
    joint = gather_evidence(projections, layout) + null[:, None]
    return null, logsumexp(joint, axis=0) - logsumexp(null), joint


def promising_pairs(
    candidates: Sequence[Candidate], ln: Array, prior: Array, floor: float, gained: Gained
) -> list[Hypothesis]:
    """Return second causes, known or unknown, for each promising first one, and thirds for the best pair.

    `ln` (candidates,) is the ln Bayes factor of each alone, `prior` (candidates,) its ln share among the known or the
    unknown, `floor` the ln weight, less that of a single cause, that a pair must reach for a third to be tried.
    """
    rival = np.array([bool(c.rival) for c in candidates])
    detected = bool(ln.max() > DETECTION_EVIDENCE)
    known = [int(i) for i in np.argsort(-(ln + prior)) if not rival[i]]
    seconds = [j for j in range(len(candidates)) if detected or not rival[j]]
    best: dict[tuple[int, int], float] = {}
    for i in known[:FIRST] if detected else known:
        values = gained((i,), seconds, KEEP if detected else KEEP_FEW)
        for j, value in zip(seconds, values, strict=True):
            if j != i and not candidates_overlap(candidates, i, j):
                members = (i, j) if rival[j] else (min(i, j), max(i, j))
                best[members] = max(best.get(members, -np.inf), float(value))
    out = []
    for (i, j), value in best.items():
        share = np.log(CAUSE_AND_SHAPE if rival[j] else PAIR * 2) + prior[i] + prior[j]
        out.append(Hypothesis((i, j), value, value + float(share)))
    return out + _promising_thirds(candidates, prior, floor, gained, out) if detected else out


def candidates_overlap(candidates: Sequence[Candidate], i: int, j: int) -> bool:
    """Return whether two candidates are one effect on all its axes and on one of them, or with more and fewer terms."""
    one, other = candidates[i], candidates[j]
    shared = {p.label for p in one.parameters} & {p.label for p in other.parameters}
    return one.effect == other.effect and ("," in one.axis or "," in other.axis or bool(shared))


def _promising_thirds(
    candidates: Sequence[Candidate], prior: Array, floor: float, gained: Gained, hypotheses: Sequence[Hypothesis]
) -> list[Hypothesis]:
    top = max((h for h in hypotheses if not h.unknown(candidates)), key=lambda h: h.ln_weight, default=None)
    if top is None or top.ln_weight < max(floor + np.log(SINGLE), 0.0):
        return []
    ln = gained(top.members, range(len(candidates)), KEEP)
    rival = np.array([bool(c.rival) for c in candidates])
    share = np.where(rival, np.log(CAUSE_AND_SHAPE / 2), np.log(PAIR)) + prior + sum(prior[i] for i in top.members)
    return [
        Hypothesis((*top.members, j), float(ln[j]), float(ln[j] + share[j]))
        for j in range(len(ln))
        if not any(j == i or candidates_overlap(candidates, i, j) for i in top.members)
    ]


def evidence_of_sets(s: Search, members: Sequence[int], seconds: Sequence[int], keep: int) -> Array:
    """ln BF against nothing of `members` with each of `seconds` in turn, over the `keep` weightiest noises."""
    nominal = int(np.argmax([p.node.prior for p in s.projections]))
    weighty = weightiest_noises(s.projections, s.joint[:, members[0]], keep - 1) | {nominal}
    every = itertools.product(sorted(weighty), s.projections[0].scale.looser)
    given, gains = zip(*(given_all(s, k, members, float(s.null[k]), looser) for k, looser in every), strict=True)
    rows = gather_evidence(given, s.library.layout)[:, seconds] + np.array(gains)[:, None]
    return np.asarray(logsumexp(rows, axis=0) - logsumexp(s.null))


def weightiest_noises(projections: Sequence[Projection], ln: Array, keep: int) -> set[int]:
    """Return the ordinals of the `keep` noises of most weight, ln (nodes,); at other scales of channels those close."""
    other = np.array([bool(p.node.scales) for p in projections])
    best = np.argsort(-ln)
    if not other.any():
        return set(best[:keep].tolist())
    return {int(k) for k in best[:keep] if ln[k] > ln[best[0]] - MAX_NATS_BEHIND}


def given_all(s: Search, noise: int, members: Sequence[int], ln: float, looser: int = 0) -> tuple[Projection, float]:
    """Return the projection of a noise with members in the model, and `ln` with the ln BF that they gained."""
    p = s.projections[noise]
    for i in members:
        p, gained = projection_given(p, s.library.candidates[i], looser)
        ln += gained
    return p, ln


def projection_given(p: Projection, c: Candidate, looser: int = 0) -> tuple[Projection, float]:
    """Return the projection with a cause in the model (its best variant and size), and the ln BF it gained.

    With `looser`, a number of steps of size, the ln BF is that of this size alone.
    """
    weight = np.log(np.array([v.weight for v in c.variants]) / c.tried)
    each = each_size(p, np.array([v.index for v in c.variants])) + weight[:, None]
    best = int(np.argmax(logsumexp(each, axis=1)))
    size = min(int(np.argmax(each[best])) + looser, len(p.scale.sizes) - 1)
    ln = float(each[best, size] if looser else logsumexp(each))
    return condition_on(p, np.array(c.variants[best].index), float(p.scale.sizes[size])), ln


def selected_causes(s: Search, members: Sequence[int]) -> tuple[SelectedCause, ...]:
    """Return the members, each with the constants that are likeliest in any one noise, chosen one after the other."""
    every = s.library.candidates
    best: tuple[float, tuple[SelectedCause, ...]] = (-np.inf, ())
    weight = s.joint[:, members[0]] if len(members) and s.joint.size else s.null  # none was ranked
    for k in sorted(weightiest_noises(s.projections, weight, len(s.null))):
        p, null = s.projections[k], s.null[k]
        chosen = [(every[m], every[m].variants[0]) for m in members]
        for _ in range(2):
            for j, (c, _) in enumerate(chosen):
                others = [i for n, (_, variant) in enumerate(chosen) if n != j for i in variant.index]
                chosen[j] = c, c.variants[int(np.argmax([p.explained(v.index, others) for v in c.variants]))]
        index = [i for _, variant in chosen for i in variant.index]
        ln = float(p.scale.gained(p.misfit[0], np.array(p.explained(index)))) + float(null)
        best = max(best, (ln, tuple(chosen)), key=lambda b: b[0])
    return best[1]
