"""Stepwise search of a view of unknown noise scale: select the strongest cause or pair, refit all, search again."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gimbalcal.diagnose.evidence.correlated_noise import possible_noises
from gimbalcal.diagnose.evidence.odds import CLAIM, SINGLE, USUAL_CAUSE_BONUS
from gimbalcal.diagnose.evidence.scale import NEAR_PRIOR, NEAR_SIZES, Free
from gimbalcal.diagnose.library.assemble import assemble_library, constants_of
from gimbalcal.diagnose.library.candidates import Candidate, Library, SelectedCause, Variant
from gimbalcal.diagnose.search.ranking import (
    Search,
    bayes_factors,
    is_usual,
    log_priors,
    projections_of,
    rms_misfit,
    search,
    selected_causes,
    total_weight,
)
from gimbalcal.diagnose.search.refit import (
    refit,
    refuse_too_little,
    start_with_baseline,
    with_columns,
    with_constants,
)
from gimbalcal.inference.algebra import logsumexp
from gimbalcal.number import Array
from gimbalcal.progress import Progress
from gimbalcal.views.core import Fit, View

MAX_ROUNDS = 8
RANK = 1e-12  # of the information about a parameter of the baseline: less is rounding
NEAR = 5.0  # ln of odds behind the likeliest, within which rivals are fitted, and must then be ahead
SWAP = 1.0  # ln of odds by which another cause must be likelier to take a place
Key = tuple[str, str, str, str]


@dataclass(frozen=True)
class Step:
    """A selected cause, and the model that holds it and all causes before it."""

    cause: SelectedCause
    model: Fit


@dataclass(frozen=True)
class SearchResult:
    """A finished search: the baseline, the causes selected in order, and the shapes of what no cause explains.

    with_shapes: the model after the last step with these shapes, which describes the data. standard: the effects of
    every rig of the kind that the data support, if the search began with them. rest: the ranking of what the model
    after the last step may lack, if it was computed.
    """

    start: Fit
    steps: tuple[Step, ...]
    shapes: tuple[Candidate, ...]
    with_shapes: Fit
    standard: tuple[SelectedCause, ...] = ()
    rest: Search | None = None

    @property
    def missing(self) -> Search:
        """The ranking of what the model after the last step may lack, in all noises."""
        return search(self.end) if self.rest is None else self.rest

    @property
    def end(self) -> Fit:
        """The model after the last step."""
        return self.steps[-1].model if self.steps else self.start

    @property
    def causes(self) -> list[SelectedCause]:
        """The selected causes in the order of what each explains."""
        return [s.cause for s in self.steps]


@dataclass(frozen=True)
class Round:
    """What is likeliest to be missing from a model: one cause or two, or a shape.

    named: whether these are known causes; ln_odds_over: of these over the cause that they were compared with.
    """

    causes: tuple[SelectedCause, ...]
    ln_bayes: float  # of these
    ln_total: float  # of anything at all
    named: bool
    ln_odds_over: float


def stepwise(v: View, progress: Progress) -> SearchResult:
    """Search for what the baseline lacks, from the baseline and from the textbook's model, and return the likelier.

    Several causes with similar patterns are not found by stepwise selection: of four terms of a mount, two others may
    explain more than any two of them. The terms that textbooks name for such a rig are therefore also tried together.
    Data without noise are not searched.
    """
    first = start_with_baseline(v)
    refuse_too_little(v.title, first.jacobian.reshape(first.residual.size, -1))
    if first.exact:
        return SearchResult(first, (), (), first)
    return result_of(first, *likeliest_selection(first, progress))


def likeliest_selection(first: Fit, progress: Progress) -> tuple[list[SelectedCause], list[SelectedCause]]:
    """Return the likeliest selection of causes from several starts, and what of the textbook's model is in it.

    As long as other causes are not in the model, a strong cause in one channel is taken for the noise of this channel,
    and the first of several may not be detected. Where channels have scales of their own, what is selected if all of
    them scatter alike is therefore a start too. At equal odds what every rig of the kind has is preferred.
    """
    known = assemble_library(first)
    share = log_shares(first.view, known)
    selected, standard = forward_select(first, (), progress), list[SelectedCause]()
    if selected:
        usual = textbook_causes(first, known)
        lacking = {c.effect for c, _ in usual} - {c.effect for c, _ in selected}
        if begun := backward_eliminate(first, usual, progress) if lacking else []:
            progress("once more, from what every rig of the kind has")
            other = forward_select(first, begun, progress, keep_usual=True)
            if ln_odds(first, other, share) > ln_odds(first, selected, share) - SWAP:
                selected, standard = other, [c for c in begun if c in other]
    if first.view.noise.own_memories:
        return selected, standard
    if first.view.noise.scales or with_causes(first, selected).view.noise.scales:
        progress("once more, as if all channels scattered alike")
        begun, begun_standard = likeliest_selection(start_with_baseline(first.view.of_one_scale()), progress)
        if {c.key for c, _ in begun} - {c.key for c, _ in selected}:
            other = forward_select(first, begun, progress, keep_usual=bool(begun_standard))
            if ln_odds(first, other, share) > ln_odds(first, selected, share) + SWAP:
                selected, standard = other, [c for c in begun_standard if c in other]
    return selected, standard


def forward_select(
    first: Fit, begun: Sequence[SelectedCause], progress: Progress, keep_usual: bool = False
) -> list[SelectedCause]:
    """Select causes in white noise as long as any is claimed, swap what fits better, eliminate in correlated noise.

    Correlated noise can mimic the first of several causes, not all of them, so it enters in the elimination. Where a
    sensor may walk by itself, steps in white noise were taken before, and the walk is among the noises from the start.
    """
    selected = list(begun)
    model = with_causes(first, selected)
    for _ in range(MAX_ROUNDS):
        best = likeliest_missing(model, memory=first.view.noise.sensors_walk or first.view.noise.own_memories)
        if best.ln_total < CLAIM or not best.named:
            break
        progress(f"selected: {', '.join(c.in_words for c, _ in best.causes)}")
        selected = refine_constants(
            first, swap_causes(first, [*selected, *best.causes], progress, keep_usual=keep_usual)
        )
        model = with_causes(first, selected)
    selected = backward_eliminate(first, selected, progress)
    selected = swap_causes(first, selected, progress, memory=True, keep_usual=keep_usual)
    return backward_eliminate(first, refine_constants(first, selected), progress)


def refine_constants(first: Fit, selected: Sequence[SelectedCause]) -> list[SelectedCause]:
    """Fit the continuous constants: constants on the grid leave visible residuals for strong causes."""
    fitted = with_constants(with_causes(first, selected), {c.effect for c, _ in selected})
    value = {e.id: constants_of(e) for e in fitted.effects}
    return [
        (c, v) if not v.constants or v.constants == value[c.effect] else (c, replace(v, constants=value[c.effect]))
        for c, v in selected
    ]


def textbook_causes(first: Fit, known: Library) -> list[SelectedCause]:
    """Return what every textbook of such a rig names and the baseline lacks, on all axes, as far as data support it.

    The fit is linear: parameters that the rows hardly determine may take any size, beyond the range of linearity.
    """
    named = [c for c in known.candidates if is_usual(c, first.view.kind)]
    widest = {c.effect: max((o for o in named if o.effect == c.effect), key=lambda o: len(o.parameters)) for c in named}
    out = [(c, c.variants[0]) for c in widest.values()]
    while out:
        support = []
        for cause, variant in out:
            others = [i for _, other in out if other is not variant for i in other.index]
            without = with_columns(first, first.expanded(known.X[:, others]))
            support.append(ln_bayes(without, known.X[:, list(variant.index)], cause))
        if min(support) > 0:
            break
        del out[int(np.argmin(support))]
    return out


def log_shares(v: View, known: Library) -> dict[Key, float]:
    """Return ln of the prior share of each candidate of a library among the known ones."""
    return dict(zip((c.key for c in known.candidates), log_priors(known.candidates, v.kind).tolist(), strict=True))


def ln_odds(first: Fit, selected: Sequence[SelectedCause], share: Mapping[Key, float]) -> float:
    """Return ln odds of several causes together against none.

    Effects of every rig of the kind have no prior penalty; `share` is the ln prior of the others.
    """
    least = min(share.values())  # some show only together with others
    special = [c for c, _ in selected if not is_usual(c, first.view.kind)]
    prior = sum(share.get(c.key, least) + np.log(SINGLE) for c in special) - sum(np.log(c.tried) for c, _ in selected)
    return float(prior) + ln_evidence(with_causes(first, selected)) - ln_evidence(first)


def ln_evidence(m: Fit) -> float:
    r"""Return ln p(y) of a model at its minimum, scale and noise integrated over, up to a constant of the baseline.

    .. math:: p(y) = \sum_V p(V) \, \tfrac12 \Gamma(\nu / 2) \, (\pi m)^{-\nu / 2} |V|^{-1/2} |J^T V^{-1} J|^{-1/2}
        N(\hat x; 0, S + C)

    m is the misfit in a noise V, J (n C, q) has all columns, nu = n C - rank J. The parameters of the baseline have a
    flat prior. The others, in prior sigmas, are estimated as x with covariance C; each effect has a size s of its own
    in S = s^2 I, mixed over its prior.
    """
    unit, names = rms_misfit(m), [p.effect for p in m.parameters]
    each, Z = projections_of(m, np.zeros((m.residual.size, 0)), unit=unit), m.reduced(m.Z) / unit
    G, scale = Z.T @ Z, each[0].scale
    G += RANK * np.diag(1 + np.diag(G))
    assert isinstance(scale, Free)
    C, S = np.linalg.inv(G) * (m.residual.size / scale.dof), np.zeros(len(names))
    x = m.x / np.array([p.sigma for p in m.parameters])
    ln = float(logsumexp(np.array([p.log_evidence() for p in each])) - np.linalg.slogdet(G)[1] / 2)
    for effect in dict.fromkeys(name for name in names if name not in m.view.baseline):
        at = [i for i, name in enumerate(names) if name == effect]
        own = [ln_normal(x[at], C[np.ix_(at, at)] + s**2 * np.eye(len(at))) for s in NEAR_SIZES] + np.log(NEAR_PRIOR)
        best = int(np.argmax(own))
        S[at] = NEAR_SIZES[best] ** 2
        ln += float(logsumexp(own) - own[best] + np.log(NEAR_PRIOR[best]))
    ln += ln_normal(x[S > 0], (C + np.diag(S))[np.ix_(S > 0, S > 0)])
    ln -= m.residual.size * math.log(unit) + len(m.residual) * float(np.log(m.view.noise.scales or 1.0).sum())
    return ln + math.lgamma(scale.dof / 2) - scale.dof / 2 * math.log(math.pi * scale.dof)


def ln_normal(x: Array, C: Array) -> float:
    """Return ln of the normal density of x (p,) with mean zero and covariance C (p, p)."""
    return float(-(x @ np.linalg.solve(C, x) + np.linalg.slogdet(2 * np.pi * C)[1]) / 2)


def swap_causes(
    first: Fit, selected: Sequence[SelectedCause], progress: Progress, memory: bool = False, keep_usual: bool = False
) -> list[SelectedCause]:
    """Replace each cause in turn, or each that not every rig has, by another or by two that are likelier there."""
    out = list(selected)
    for cause, variant in selected:
        if (cause, variant) not in out or (is_usual(cause, first.view.kind) and keep_usual):
            continue
        others = [c for c in out if c[0] != cause]
        model = with_causes(first, others)
        s = search(model, nodes=possible_noises(model, memory))
        best = likeliest_after_refit(first, others, s, likeliest_round(s, cause), cause)
        (same, other), *more = best.causes
        if same.key == cause.key and same.scanned and not more:  # another peak of a scan, given these others
            out = [*others, (cause, other)]
        elif best.ln_odds_over > SWAP:
            progress(f"{cause.in_words} is replaced by {', '.join(c.in_words for c, _ in best.causes)}")
            out = [*others, *best.causes]
    return out


def likeliest_after_refit(
    first: Fit, others: Sequence[SelectedCause], s: Search, best: Round, against: Candidate
) -> Round:
    """Return the best round, or of single causes a near rival that is ahead by as much once both are fitted.

    The ranking is linear about a model without the cause. A cause of an impossible size may lead there, and only a fit
    shows the size that it takes: scale factors of 66 % for two axes that are not parallel.
    """
    every = s.library.candidates
    known = [h for h in s.hypotheses if not h.unknown(every)]
    near = [h for h in known if len(h.members) == 1 and h.ln_weight > known[0].ln_weight - NEAR]
    if not best.named or len(best.causes) > 1 or len(near) < 2:
        return best
    causes = [selected_causes(s, h.members) for h in near]
    ln_weight = [
        h.ln_weight - h.ln_bayes + ln_evidence(with_causes(first, [*others, *these]))
        for h, these in zip(near, causes, strict=True)
    ]
    top = int(np.argmax(ln_weight))
    if ln_weight[top] - ln_weight[0] <= NEAR:
        return best
    same = [w for w, these in zip(ln_weight, causes, strict=True) if against.key in {c.key for c, _ in these}]
    return replace(best, causes=causes[top], ln_odds_over=ln_weight[top] - max(same) if same else best.ln_odds_over)


def backward_eliminate(first: Fit, selected: Sequence[SelectedCause], progress: Progress) -> list[SelectedCause]:
    """Remove, the weakest first, the causes that correlated noise explains as well."""
    kind, out = first.view.kind, list(selected)
    while out:
        others = [refine_constants(first, [c for c in out if c != this]) for this in out]
        support = [
            evidence_for(with_causes(first, rest), this) - needed_evidence(first, this[0])
            for rest, this in zip(others, out, strict=True)
        ]
        if min(support) > 0:
            break
        weakest = min((support[i] > 0, is_usual(out[i][0], kind), support[i], i) for i in range(len(out)))[-1]
        progress(f"{out[weakest][0].in_words} is not kept: correlated noise explains it")
        out = others[weakest]
    return out


def needed_evidence(fit: Fit, cause: Candidate) -> float:
    """Return the ln Bayes factor that a cause needs: less for what every unit of the kind has and its model lacks."""
    return float(CLAIM - USUAL_CAUSE_BONUS * is_usual(cause, fit.view.kind))


def evidence_for(without: Fit, selected: SelectedCause) -> float:
    """Return the ln Bayes factor of one cause with the others in the model, in correlated noise."""
    cause, variant = selected
    effect = cause.absent(without.view.stimulus, variant.constants)
    effects = without.effects if cause.effect in {e.id for e in without.effects} else [*without.effects, effect]
    X = without.view.noise_free(effects).jacobian(cause.parameters) * np.array([p.sigma for p in cause.parameters])
    return ln_bayes(without, without.reduced(X), cause)


def ln_bayes(without: Fit, X: Array, cause: Candidate) -> float:
    """Return the ln Bayes factor of reduced columns X (R, p) of a cause beyond a model, in correlated noise."""
    one = replace(cause, variants=(Variant((), tuple(range(X.shape[-1]))),), scanned=0)
    layout = Library((one,), X).layout
    return float(bayes_factors(projections_of(without, X, layout=layout), layout)[1][0])


def result_of(
    first: Fit, selected: Sequence[SelectedCause], standard: Sequence[SelectedCause] = (), refused: bool = False
) -> SearchResult:
    """Order the causes by what each explains, and describe what they leave by shapes.

    A residual that a known cause would explain has no shape, unless causes have been `refused` already.
    """
    steps, shapes = order_by_explanation(first, selected), list[Candidate]()
    with_shapes = steps[-1].model if steps else first
    missing = rest = search(with_shapes)
    while len(shapes) < MAX_ROUNDS:
        best = likeliest_round(missing, shape=refused)
        if best.ln_total < CLAIM or best.named or (shapes and best.ln_bayes < CLAIM):
            break
        shapes += [c for c, _ in best.causes if c.rival]
        columns = [k for _, variant in best.causes for k in variant.index]
        with_shapes = with_columns(with_shapes, with_shapes.expanded(missing.library.X[:, columns]))
        missing = search(with_shapes)
    return SearchResult(first, steps, tuple(shapes), with_shapes, tuple(standard), rest)


def likeliest_missing(model: Fit, memory: bool = False) -> Round:
    """Return what is likeliest to be missing from a model, in white or in correlated noise: causes, or a shape."""
    return likeliest_round(search(model, nodes=possible_noises(model, memory)))


def likeliest_round(s: Search, against: Candidate | None = None, shape: bool = False) -> Round:
    """Return what is likeliest to be missing by a search: causes, or a `shape`.

    Causes are selected where by themselves they are likelier than a shape by itself, several of them at the odds of a
    claim: together they may mimic one shape. With a shape in the model almost any cause seems needed, as it resembles a
    part of the residual that the shape describes only roughly.
    """
    every = s.library.candidates
    shapes = [h for h in s.hypotheses if all(every[i].rival for i in h.members)]
    known = [
        h for h in s.hypotheses if not h.unknown(every) and len({every[i].effect for i in h.members}) == len(h.members)
    ]
    several = bool(known) and len(known[0].members) > 1  # there is none where everything that could be is in the model
    named = not (shape and shapes) and total_weight(known) > total_weight(shapes) + CLAIM * several
    best = known[0] if named else shapes[0]
    rival = [h.ln_weight for h in known if against and any(every[i].key == against.key for i in h.members)]
    over = best.ln_weight - max(rival) if rival and named else 0.0
    return Round(selected_causes(s, best.members), best.ln_bayes, s.ln_total, named, over)


def order_by_explanation(first: Fit, selected: Sequence[SelectedCause]) -> tuple[Step, ...]:
    """Return one step for each cause, the one that explains most first."""
    rest, steps = list(selected), list[Step]()
    while rest:
        models = [with_causes(first, [*(s.cause for s in steps), c]) for c in rest]
        best = int(np.argmin([m.scatter for m in models]))
        steps.append(Step(rest.pop(best), models[best]))
    return tuple(steps)


def with_causes(model: Fit, selected: Sequence[SelectedCause]) -> Fit:
    """Return the model with these causes in it, everything refitted; each set of causes is fitted once."""
    if not selected:
        return model
    these, v = frozenset((c.key, c.parameters, variant.constants) for c, variant in selected), model.view
    cache, key = v.cache, (v.noise.one_scale, model.parameters, these)
    if key not in cache:
        effects, wanted = list(model.effects), list(model.parameters)
        for cause, variant in selected:
            if not cause.rival and cause.effect not in {e.id for e in effects}:
                effects.append(cause.absent(v.stimulus, variant.constants))
            wanted += cause.parameters
        cache[key] = refit(v, effects, wanted)
    return cache[key]
