r"""The search: singles, refined constants, pairs and thirds, and the unknown alone or beside a known cause.

Prior: the causes of the catalogue share alike, then their axes; pairs share what single causes share; the unknown has a
part of its own. Everything is relative to "nothing is missing", noise integrated over.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gimbalcal.diagnose.candidates import Candidate, Library, Variant, constant_fields, limits, scaled_columns
from gimbalcal.diagnose.evidence import Projection, Rows, best_size, condition, gather, project, stack
from gimbalcal.diagnose.noise import Node, coloured
from gimbalcal.diagnose.observations import Observations, absent_effect
from gimbalcal.effects import CATALOGUE, parameters, with_values
from gimbalcal.number import Array

SINGLE, PAIR, UNKNOWN, BESIDE = 0.65, 0.15, 0.10, 0.10  # prior shares, given that something is missing
FIRST = 14  # known causes that are tried with a second one, when one alone is found
ROUNDS = 2  # refinements of a non-linear constant, each narrowing its range fourfold
VISIBLE = 0.05  # sigmas per prior sigma: less is not seen by this recording at any plausible size
CLOSE = 25.0  # nats behind the best within which a cause is worth refining


@dataclass(frozen=True)
class Hypothesis:
    """A set of causes, its ln Bayes factor against none, and ln of prior share times that."""

    members: tuple[int, ...]
    ln_bayes: float
    ln_weight: float

    def unknown(self, candidates: Sequence[Candidate]) -> bool:
        """Whether a shape without a cause is among the members."""
        return any(candidates[i].rival for i in self.members)


@dataclass(frozen=True)
class Search:
    """All hypotheses, best first, with what is needed to look at them again."""

    o: Observations
    library: Library
    rows: Rows
    projections: tuple[Projection, ...]
    hypotheses: tuple[Hypothesis, ...]
    null: Array  # (nodes,) ln prior x likelihood of nothing missing
    singles: Array  # (candidates,) ln Bayes factors

    @property
    def ln_total(self) -> float:
        """ln Bayes factor of "something is missing" against nothing."""
        return float(_logsumexp(np.array([h.ln_weight for h in self.hypotheses])))

    def posterior(self) -> Array:
        """Probability of each hypothesis given that something is missing."""
        w = np.array([h.ln_weight for h in self.hypotheses])
        return np.asarray(np.exp(w - _logsumexp(w)))


def _logsumexp(x: Array, axis: int | None = None) -> Array:
    from scipy.special import logsumexp

    return np.asarray(logsumexp(x, axis=axis))


def log_priors(candidates: Sequence[Candidate]) -> Array:
    """ln prior share of each candidate among the known (or among the unknown), summing to one in each."""
    families: dict[str, int] = {}
    for c in candidates:
        families[c.effect] = families.get(c.effect, 0) + 1
    known = len({c.effect for c in candidates if not c.rival})
    unknown = len({c.effect for c in candidates if c.rival})
    return np.array([-np.log(families[c.effect] * (unknown if c.rival else known)) for c in candidates])


def prepare(o: Observations, library: Library, nodes: Sequence[Node]) -> tuple[Rows, tuple[Projection, ...]]:
    """Rows and one projection per noise node."""
    rows = stack(o.reduce(o.Z), library.X, o.reduce(o.y[:, :, None]), coloured(o))
    return rows, tuple(project(n, rows) for n in nodes)


def search(o: Observations, library: Library, nodes: Sequence[Node]) -> Search:
    """Singles, refinement, then pairs where a single cause is found wanting or none is found."""
    rows, projections = prepare(o, library, nodes)
    library = _visible(library, projections[0])
    null, ln, joint = _singles(projections, library.candidates)
    finer = refine(o, library, projections, null, joint)
    if finer is not library:
        library = finer
        rows, projections = prepare(o, library, nodes)
        null, ln, joint = _singles(projections, library.candidates)
    prior = log_priors(library.candidates)
    rival = np.array([bool(c.rival) for c in library.candidates])
    share = np.where(rival, np.log(UNKNOWN), np.log(SINGLE)) + prior
    found = [Hypothesis((i,), float(ln[i]), float(ln[i] + share[i])) for i in range(len(ln))]
    found += pairs(projections, library.candidates, null, joint, prior)
    found.sort(key=lambda h: -h.ln_weight)
    return Search(o, library, rows, projections, tuple(found), null, ln)


def _visible(library: Library, p: Projection) -> Library:
    """Only candidates of which the calibration leaves something at ten times their plausible size."""
    left = np.sqrt(np.diag(p.G))
    kept = [c for c in library.candidates if max(left[list(v.index)].max() for v in c.variants) > VISIBLE]
    return Library(tuple(kept), library.X)


def _singles(projections: Sequence[Projection], candidates: Sequence[Candidate]) -> tuple[Array, Array, Array]:
    """ln weight of no effect per node, ln BF of each candidate, and ln weight per node and candidate."""
    null = np.array([np.log(p.node.prior) + p.log_likelihood()[0] for p in projections])
    joint = gather(projections, candidates) + null[:, None]
    return null, _logsumexp(joint, axis=0) - _logsumexp(null), joint


def pairs(
    projections: Sequence[Projection], candidates: Sequence[Candidate], null: Array, joint: Array, prior: Array
) -> list[Hypothesis]:
    """Second causes, known or unknown, beside each promising first one; thirds beside the best pair."""
    rival = np.array([bool(c.rival) for c in candidates])
    total = _logsumexp(joint, axis=0) - _logsumexp(null)
    known = [int(i) for i in np.argsort(-(total + prior)) if not rival[i]]
    detected = total.max() > np.log(100.0)
    firsts = known[:FIRST] if detected else known
    best: dict[tuple[int, ...], float] = {}
    keep = 8 if detected else 2
    seconds = np.arange(len(candidates)) if detected else np.flatnonzero(~rival)
    for i in firsts:
        for j, ln in zip(seconds, _beside(projections, candidates, null, joint, (i,), seconds, keep), strict=True):
            if j != i and not _same(candidates, i, j):
                members = (i, int(j)) if rival[j] else (min(i, int(j)), max(i, int(j)))
                best[members] = max(best.get(members, -np.inf), float(ln))
    out = []
    for members, ln in best.items():
        i, j = members
        share = np.log(BESIDE if rival[j] else PAIR * 2) + prior[i] + prior[j]
        out.append(Hypothesis(members, ln, ln + share))
    return out + _thirds(projections, candidates, null, joint, prior, out, rival) if detected else out


def _same(candidates: Sequence[Candidate], i: int, j: int) -> bool:
    return candidates[i].effect == candidates[j].effect and ("," in candidates[i].axis or "," in candidates[j].axis)


def _thirds(
    projections: Sequence[Projection], candidates: Sequence[Candidate], null: Array, joint: Array, prior: Array,
    found: Sequence[Hypothesis], rival: Array,
) -> list[Hypothesis]:  # fmt: skip
    known = [h for h in found if not h.unknown(candidates)]
    if not known:
        return []
    top = max(known, key=lambda h: h.ln_weight)
    if top.ln_weight < max(float(joint.max() - _logsumexp(null)) + np.log(SINGLE) + float(prior.min()), 0.0):
        return []
    ln = _beside(projections, candidates, null, joint, top.members, np.arange(len(candidates)), 8)
    share = np.where(rival, np.log(BESIDE / 2), np.log(PAIR)) + prior + sum(prior[i] for i in top.members)
    return [
        Hypothesis((*top.members, j), float(ln[j]), float(ln[j] + share[j]))
        for j in range(len(ln))
        if not any(j == i or _same(candidates, i, j) for i in top.members)
    ]


def _beside(
    projections: Sequence[Projection], candidates: Sequence[Candidate], null: Array, joint: Array,
    members: tuple[int, ...], seconds: Array, keep: int,
) -> Array:  # fmt: skip
    """ln BF against nothing of `members` with each of `seconds` in turn, over the `keep` weightiest noises."""
    nominal = int(np.argmax([p.node.prior for p in projections]))
    weighty = set(np.argsort(-joint[:, members[0]])[: keep - 1].tolist()) | {nominal}
    chosen = [candidates[j] for j in seconds]
    rows = []
    for k in sorted(weighty):
        p, ln = projections[k], float(null[k])
        for i in members:
            p, gained = given(p, candidates[i])
            ln += gained
        rows.append(gather([p], chosen)[0] + ln)
    return np.asarray(_logsumexp(np.stack(rows), axis=0) - _logsumexp(null))


def given(p: Projection, c: Candidate) -> tuple[Projection, float]:
    """The projection with a cause in the model (its best variant and size), and the ln BF it gained."""
    from gimbalcal.diagnose.evidence import SIZE_PRIOR, log_bayes, mixed

    scores = []
    for v in c.variants:
        at = np.array(v.index)
        scores.append(float(mixed(log_bayes(p.G[np.ix_(at, at)], p.b[at, 0]), SIZE_PRIOR)) + np.log(v.weight))
    best = np.array(c.variants[int(np.argmax(scores))].index)
    ln = float(_logsumexp(np.array(scores)) - np.log(sum(v.weight for v in c.variants)))
    return condition(p, best, best_size(p.G[np.ix_(best, best)], p.b[best, 0])), ln


# --- continuous constants ---------------------------------------------------------------------------------------------


def refine(
    o: Observations, library: Library, projections: Sequence[Projection], null: Array, joint: Array
) -> Library:
    """Add finer values of the non-linear constants around the best of each promising candidate."""
    total = _logsumexp(joint, axis=0) - _logsumexp(null)
    best = total.max()
    if best < 2.0:
        return library
    blocks, candidates, changed = [library.X], list(library.candidates), False
    at = library.X.shape[1]
    for i, c in enumerate(library.candidates):
        if c.rival or total[i] < best - CLOSE - 0.2 * best:
            continue
        k = int(np.argmax(joint[:, i]))
        made = _narrowed(o, c, projections[k]) if _continuous(c) else _relinearised(o, c, projections[k])
        if made:
            variants, new = made
            for v, X in zip(variants[len(variants) - len(new) :], new, strict=True):
                variants[variants.index(v)] = replace(v, index=tuple(range(at, at + X.shape[1])))
                at += X.shape[1]
                blocks.append(X)
            candidates[i], changed = replace(c, variants=tuple(variants)), True
    return Library(tuple(candidates), np.concatenate(blocks, axis=1)) if changed else library


def _continuous(c: Candidate) -> bool:
    """Whether exactly one constant of the effect can take any value."""
    names = [f.name for f in constant_fields(c.effect)]
    return len(names) == 1 and names[0] not in ("position", "order", "lines", "m") and len(c.variants) > 1


def _narrowed(o: Observations, c: Candidate, p: Projection) -> tuple[list[Variant], list[Array]] | None:
    """Replace the grid cell of the best value by nine values, twice; each carries its share of the cell's prior."""
    (field,) = constant_fields(c.effect)
    low, high = limits(field, o) if field.name != "epoch" else (0.0, float(o.stimulus.time[-1]))
    x = np.array([v.constants[0][1] for v in c.variants])
    score = np.array([_score(p, p.G[np.ix_(v.index, v.index)], p.b[list(v.index), 0]) for v in c.variants])
    log = low > 0 and field.name != "period"
    kept, new_x, new_X = list(c.variants), np.zeros(0), list[Array]()
    best = int(np.argmax(score))
    around = (x[max(best - 1, 0)], x[min(best + 1, len(x) - 1)])
    cell = c.variants[best].weight
    for _ in range(ROUNDS):
        fine = np.geomspace(*around, 11)[1:-1] if log else np.linspace(*around, 11)[1:-1]
        fine = np.clip(fine, low, high)
        new_X = [_columns(o, c, float(v)) for v in fine]
        fits = np.array([_score(p, *_fresh(o, p, X)) for X in new_X])
        j = int(np.argmax(fits))
        new_x, cell = fine, cell if _ == 0 else cell * 2 / 10
        around = (fine[max(j - 1, 0)], fine[min(j + 1, 8)])
        if np.ptp(fits[max(j - 1, 0) : j + 2]) < 0.3:
            break
    variants = [replace(v, weight=v.weight) for k, v in enumerate(kept) if k != best]
    fine_variants = [Variant(((field.name, float(v)),), (), 2 * cell / 9) for v in new_x]
    return variants + [kept[best]] + fine_variants, new_X


def _columns(o: Observations, c: Candidate, value: float) -> Array:
    (field,) = constant_fields(c.effect)
    return scaled_columns(o, absent_effect(c.effect, o.stimulus, **{field.name: value}), c.parameters)


def _fresh(o: Observations, p: Projection, X: Array) -> tuple[Array, Array]:
    """Gram matrix and scores of columns that are not in the library yet, at one noise."""
    rows = stack(o.reduce(o.Z), X, o.reduce(o.y[:, :, None]), coloured(o))
    q = project(p.node, rows)
    return q.G, q.b[:, 0]


def _score(p: Projection, G: Array, b: Array) -> float:
    del p
    from gimbalcal.diagnose.evidence import SIZE_PRIOR, log_bayes, mixed

    return float(mixed(log_bayes(G, b), SIZE_PRIOR))


def _relinearised(o: Observations, c: Candidate, p: Projection) -> tuple[list[Variant], list[Array]] | None:
    """For an effect that bends with its own size: the secant at the fitted size instead of the tangent at none."""
    cls = CATALOGUE[c.effect]
    if cls.linear or len(c.parameters) != 1:
        return None
    at = list(c.variants[0].index)
    size = float(p.b[at[0], 0] / max(p.G[at[0], at[0]], 1e-12)) * c.parameters[0].sigma
    X = np.zeros(0)
    for _ in range(3):
        X = _secant(o, c, size)
        G, b = _fresh(o, p, X)
        size = float(b[0] / max(G[0, 0], 1e-12)) * c.parameters[0].sigma
    v = c.variants[0]
    return [v, Variant(v.constants, (), v.weight)], [X]


def _secant(o: Observations, c: Candidate, size: float) -> Array:
    """Reduced column per prior sigma of the change that this size of the parameter makes."""
    if size == 0:
        return scaled_columns(o, absent_effect(c.effect, o.stimulus), c.parameters)
    cls, names, s = CATALOGUE[c.effect], o.stimulus.axis_names, o.seen[CATALOGUE[c.effect].stage]
    none = absent_effect(c.effect, o.stimulus)
    (made,) = with_values([none], c.parameters, np.array([size]), names)
    added = np.asarray(made.contribution(s)) - np.asarray(none.contribution(s))
    assert parameters(cls, names)
    return o.reduce(o.through(cls.stage, added)[:, :, None]) / size * c.parameters[0].sigma
