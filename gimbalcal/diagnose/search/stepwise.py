"""Diagnosis of a view: the strongest cause or pair is taken up, everything refitted, and the rest searched again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gimbalcal.diagnose.evidence.odds import CLAIM, OFTEN, SINGLE
from gimbalcal.diagnose.library.assemble import constants_of, library
from gimbalcal.diagnose.library.candidates import Candidate, Variant, layout_of
from gimbalcal.diagnose.search.likeliest import Taken, weigh
from gimbalcal.diagnose.search.ranking import bayes_factors, is_usual, log_priors
from gimbalcal.diagnose.search.refit import projections, refit, start, with_columns, with_constants
from gimbalcal.effects import Effect
from gimbalcal.number import Array
from gimbalcal.pipeline import Tell
from gimbalcal.views.core import Fit, View, absent_effect
from gimbalcal.views.known_attitude import refuse_too_little

MOST = 8  # rounds
EXCHANGE = 1.0  # ln of odds by which another cause must be likelier to take a place
Key = tuple[str, str, str, str]


@dataclass(frozen=True)
class Step:
    """A cause that was taken up, and the model after it."""

    taken: Taken
    model: Fit


@dataclass(frozen=True)
class Course:
    """A finished search: the baseline, the steps from it, and the shapes found in what no cause explains.

    described: the model after the last step with these shapes in it, which is what the data follow.
    standard: what every rig of the kind has, as far as the data support it, where the course began from that.
    """

    start: Fit
    steps: tuple[Step, ...]
    left: tuple[Candidate, ...]
    described: Fit
    standard: tuple[Taken, ...] = ()

    @property
    def end(self) -> Fit:
        """The model after the last step."""
        return self.steps[-1].model if self.steps else self.start


def course(v: View, tell: Tell) -> Course:
    """What is missing from the baseline, by the likelier of two courses: one from it, one from the textbook's model.

    Several causes that share their patterns are not found one after the other: of four terms of a mount, two others
    may explain more than any two of them. What every textbook of such a rig names is therefore tried at once too.
    Nothing is looked for in what is left of numbers without noise.
    """
    first = start(v)
    refuse_too_little(v.title, first.jacobian.reshape(first.residual.size, -1))
    if first.exact:
        return Course(first, (), (), first)
    taken = climbed(v, first, (), tell)
    if not taken:
        return steps_of(v, first, taken)
    found = library(first)
    known, X = found.candidates, found.X
    usual = textbook(v, first, known, X)
    lacking = {c.effect for c, _ in usual} - {c.effect for c, _ in taken}
    standard = pruned(v, first, usual, tell) if lacking else []
    if not standard:
        return steps_of(v, first, taken)
    tell("once more, from what every rig of the kind has")
    other = climbed(v, first, standard, tell)
    share = dict(zip((c.key for c in known), log_priors(known, v.kind).tolist(), strict=True))
    if ln_odds(v, first, other, share) < ln_odds(v, first, taken, share):
        return steps_of(v, first, taken)
    return steps_of(v, first, other, [t for t in standard if t in other])


def climbed(v: View, first: Fit, begun: Sequence[Taken], tell: Tell) -> list[Taken]:
    """Forward in white noise as long as anything is claimed, exchanging what fits better; back in noise with memory.

    Noise with a memory can mimic the first of several causes, not all of them: it is tested in the backward pass. Where
    a sensor may walk alone, forward steps in white noise have been taken before, and come no nearer than that walk.
    """
    taken, keep_usual = list(begun), bool(begun)
    model = take(v, first, taken)
    for _ in range(MOST):
        best = weigh(v, model, memory=bool(v.noise.single_walks))
        if best.ln_total < CLAIM or not best.named:
            break
        tell(f"taken up: {', '.join(c.in_words for c, _ in best.found)}")
        taken = sharpened(v, first, exchanged(v, first, [*taken, *best.found], tell, keep_usual=keep_usual))
        model = take(v, first, taken)
    taken = pruned(v, first, taken, tell)
    taken = exchanged(v, first, taken, tell, memory=True, keep_usual=keep_usual)
    return pruned(v, first, sharpened(v, first, taken), tell)


def sharpened(v: View, first: Fit, taken: Sequence[Taken]) -> list[Taken]:
    """The causes with their continuous constants fitted: between the values of a grid a strong one leaves a rest."""
    made = with_constants(v, take(v, first, taken), {c.effect for c, _ in taken})
    told = {e.id: constants_of(e) for e in made.effects}
    same = [not t.constants or t.constants == told[c.effect] for c, t in taken]
    return [this if kept else (this[0], replace(this[1], constants=told[this[0].effect]))
            for this, kept in zip(taken, same, strict=True)]  # fmt: skip


def textbook(v: View, first: Fit, known: Sequence[Candidate], X: Array) -> list[Taken]:
    """What every textbook of such a rig names and the baseline lacks, on all axes; less what the data speak against.

    In a linear model: of what these rows hardly see a fit finds any size, far from where the model is linear.
    """
    kind = v.kind
    named = [c for c in known if is_usual(c, kind)]
    widest = {c.effect: max((o for o in named if o.effect == c.effect), key=lambda o: len(o.parameters)) for c in named}
    out = [(c, c.variants[0]) for c in widest.values()]
    while out:
        support = []
        for cause, variant in out:
            others = [i for _, other in out if other is not variant for i in other.index]
            beside = with_columns(v, first, X[..., others])
            support.append(factor(v, beside, X[..., list(variant.index)], cause))
        if min(support) > 0:
            break
        del out[int(np.argmin(support))]
    return out


def ln_odds(v: View, first: Fit, taken: Sequence[Taken], share: Mapping[Key, float]) -> float:
    """ln odds of several causes together against none: each by what it adds to those before it, and its prior.

    What every rig of the kind has costs nothing beforehand; `share` is the ln prior share of what shows by itself.
    """
    least = min(share.values())  # some show only beside others
    steps = ordered(v, first, taken)
    before = [first, *(s.model for s in steps)]
    added = [alone(v, m, s.taken) - float(np.log(s.taken[0].tried)) for m, s in zip(before, steps, strict=False)]
    special = [c for c, _ in taken if not is_usual(c, v.kind)]
    return float(sum(added) + sum(share.get(c.key, least) + np.log(SINGLE) for c in special))


def exchanged(
    v: View, first: Fit, taken: Sequence[Taken], tell: Tell, memory: bool = False, keep_usual: bool = False
) -> list[Taken]:
    """Each cause in turn, or each that is not of every rig, gives way if another cause, or two, belong in its place."""
    out = list(taken)
    for cause, variant in taken:
        if (cause, variant) not in out or (is_usual(cause, v.kind) and keep_usual):
            continue
        others = [t for t in out if t[0] != cause]
        best = weigh(v, take(v, first, others), memory, cause)
        if best.lead > EXCHANGE:
            tell(f"{cause.in_words} gives way to {', '.join(c.in_words for c, _ in best.found)}")
            out = [*others, *best.found]
    return out


def pruned(v: View, first: Fit, taken: Sequence[Taken], tell: Tell) -> list[Taken]:
    """The causes taken up, less those that noise with a memory explains as well."""
    out = list(taken)
    while out:
        left = [sharpened(v, first, [t for t in out if t != this]) for this in out]
        rest = [take(v, first, others) for others in left]
        support = [alone(v, m, this) - bar(v, this[0]) for m, this in zip(rest, out, strict=True)]
        if min(support) > 0:
            break
        usual = [is_usual(c, v.kind) for c, _ in out]
        weakest = min((support[i] > 0, usual[i], support[i], i) for i in range(len(out)))[-1]
        tell(f"{out[weakest][0].in_words} is not kept: noise with a memory explains it")
        out = left[weakest]
    return out


def bar(v: View, cause: Candidate) -> float:
    """ln Bayes factor that a cause needs: less for what every unit of the kind has, and its model left out."""
    return float(CLAIM - OFTEN * is_usual(cause, v.kind))


def alone(v: View, without: Fit, this: Taken) -> float:
    """ln Bayes factor of one cause with the others in the model, noise with memory."""
    cause, made = this[0], _made(v, this)
    effects = without.effects if cause.effect in {e.id for e in without.effects} else [*without.effects, made]
    X = v.noise_free(effects).jacobian(cause.parameters) * np.array([p.sigma for p in cause.parameters])
    return factor(v, without, X, cause)


def factor(v: View, without: Fit, X: Array, cause: Candidate) -> float:
    """ln Bayes factor of columns X (n, C, p) of a cause beside a model, noise with memory."""
    one = replace(cause, variants=(Variant((), tuple(range(X.shape[-1]))),), scanned=0)
    return float(bayes_factors(projections(v, without, X), layout_of([one]))[1][0])


def steps_of(v: View, first: Fit, taken: Sequence[Taken], standard: Sequence[Taken] = (), refused: bool = False
             ) -> Course:  # fmt: skip
    """The causes in the order of what each takes away, and the shape of what is left.

    Of what a known cause would explain no shape is told, unless causes have been `refused` already.
    """
    steps, left = ordered(v, first, taken), list[Candidate]()
    described = steps[-1].model if steps else first
    for _ in range(MOST):
        rest = weigh(v, described, memory=True, shape=refused)
        if rest.ln_total < CLAIM or rest.named or (left and rest.ln_bayes < CLAIM):
            break
        left += [c for c, _ in rest.found if c.rival]
        described = with_columns(v, described, rest.columns)
    return Course(first, steps, tuple(left), described, tuple(standard))


def ordered(v: View, first: Fit, taken: Sequence[Taken]) -> tuple[Step, ...]:
    """One step for each cause, the one that takes away most first."""
    left, steps = list(taken), list[Step]()
    while left:
        models = [take(v, first, [*(s.taken for s in steps), t]) for t in left]
        best = int(np.argmin([m.rms for m in models]))
        steps.append(Step(left.pop(best), models[best]))
    return tuple(steps)


def refined(v: View, c: Course) -> Course:
    """The same causes fitted to another view of the same recording."""
    first = start(v)
    steps = ordered(v, first, [s.taken for s in c.steps])
    return Course(first, steps, c.left, steps[-1].model if steps else first, c.standard)


def take(v: View, model: Fit, found: Sequence[Taken]) -> Fit:
    """The model with these causes in it, everything refitted; once for each set of causes."""
    key = model.parameters, frozenset((c.key, variant.constants) for c, variant in found)
    if key not in v.cache:
        v.cache[key] = _taken(v, model, found)
    return v.cache[key]


def _taken(v: View, model: Fit, found: Sequence[Taken]) -> Fit:
    effects = list(model.effects)
    wanted = list(model.parameters)
    for this in found:
        if not this[0].rival and this[0].effect not in {e.id for e in effects}:
            effects.append(_made(v, this))
        wanted += this[0].parameters
    return refit(v, effects, wanted)


def _made(v: View, this: Taken) -> Effect:
    """The effect that a cause is, with its constants and of no size yet."""
    cause, variant = this
    return absent_effect(cause.effect, v.stimulus, cause.source, **dict(variant.constants))
