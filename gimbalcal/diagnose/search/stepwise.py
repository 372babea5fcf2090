"""Diagnosis of a view: the strongest cause or pair is taken up, everything refitted, and the rest searched again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gimbalcal.diagnose.evidence.free_scale import Ground, ground, log_evidence
from gimbalcal.diagnose.evidence.odds import CLAIM, PAIR, SINGLE, UNKNOWN
from gimbalcal.diagnose.library.candidates import Candidate, Variant
from gimbalcal.diagnose.library.unknown_noise import causes, unknowns
from gimbalcal.diagnose.rows.observations import absent_effect, refuse_too_little
from gimbalcal.diagnose.rows.views import View
from gimbalcal.diagnose.search.ranking import Hypothesis
from gimbalcal.effects import CATALOGUE, Effect, Parameter, values, with_values
from gimbalcal.number import Array
from gimbalcal.pipeline import Tell

MOST = 8  # rounds
EXCHANGE = 1.0  # ln of odds by which another cause must be likelier to take a place
OFTEN = np.log(10.0)  # how much likelier before any data is what every textbook of such a rig names first
Taken = tuple[Candidate, Variant]
FIRST = 12  # likeliest single causes that are tried with every other; all of them where none is found alone


@dataclass(frozen=True)
class Model:
    """Effects with the parameters that were fitted (p,), their covariance (p, p) in SI, misfit (n, C), columns."""

    effects: tuple[Effect, ...]
    fitted: tuple[Parameter, ...]
    covariance: Array
    r: Array
    J: Array

    @property
    def rms(self) -> float:
        """Root mean square length of a row's misfit, SI."""
        return float(np.sqrt((self.r**2).sum() / len(self.r)))


@dataclass(frozen=True)
class Step:
    """A cause that was taken up, and the model after it."""

    taken: Taken
    model: Model


@dataclass(frozen=True)
class Course:
    """A finished search: the baseline, the steps from it, and the shapes found in what no cause explains."""

    start: Model
    steps: tuple[Step, ...]
    left: tuple[Candidate, ...]

    @property
    def end(self) -> Model:
        """The model after the last step."""
        return self.steps[-1].model if self.steps else self.start


def refit(v: View, effects: Sequence[Effect], wanted: Sequence[Parameter]) -> Model:
    """Gauss-Newton on all wanted parameters; directions that the rows do not see stay where they are."""
    names = v.stimulus.axis_names
    made, scale = tuple(effects), np.array([p.sigma for p in wanted])
    C = np.zeros((len(wanted), len(wanted)))
    for _ in range(6):
        r, J = v.linear(made, wanted)
        n = r.size
        A, y = weighted(v, J).reshape(n, -1) * scale, weighted(v, r).ravel()
        U, S, Vt = np.linalg.svd(A, full_matrices=False)
        b = U.T @ y
        keep = S > 1e-9 * S[0] if len(S) else np.zeros(0, bool)
        noise = np.sqrt(max(float(y @ y - b[keep] @ b[keep]), 0.0) / n)
        keep &= S > 0.01 * noise  # else a prior sigma of the direction moves the rows by less than noise
        step = Vt[keep].T @ (b[keep] / S[keep])
        variance = float(y @ y - b[keep] @ b[keep]) / max(n - int(keep.sum()), 1)
        C = (Vt[keep].T / S[keep] ** 2) @ Vt[keep] * variance + Vt[~keep].T @ Vt[~keep]
        made = with_values(made, wanted, values(made, wanted) + step * scale, names)
        if np.abs(step).max(initial=0.0) < 1e-6:
            break
    r, J = v.linear(made, wanted)
    return Model(made, tuple(wanted), C * np.outer(scale, scale), r, J)


def start(v: View) -> Model:
    """The baseline alone."""
    wanted = tuple(p for i in v.baseline for p in unknowns(v, i))
    return refit(v, with_values((), wanted, np.zeros(len(wanted)), v.stimulus.axis_names), wanted)


def course(v: View, tell: Tell) -> Course:
    """Forward in white noise as long as anything is claimed, exchanging what fits better; back in noise with memory.

    A wandering noise can stand in for the first of several causes, not for all: so it has its say at the end.
    """
    model = first = start(v)
    refuse_too_little(v.recording, first.J.reshape(first.r.size, -1))
    taken: list[Taken] = []
    for _ in range(MOST):
        best = weigh(v, model)
        if best.ln_total < CLAIM or best.strange > 0.5:
            break
        tell(f"taken up: {', '.join(c.label for c, _ in best.found)}; ln Bayes factor {best.ln_bayes:.0f}")
        taken = exchanged(v, first, [*taken, *best.found], tell)
        model = take(v, first, taken)
    taken = pruned(v, first, taken, tell)
    taken = pruned(v, first, exchanged(v, first, taken, tell, memory=True), tell)
    return steps_of(v, first, taken)


def exchanged(v: View, first: Model, taken: Sequence[Taken], tell: Tell, memory: bool = False) -> list[Taken]:
    """Each cause in turn gives way if another cause, or two, belong in its place."""
    out = list(taken)
    for cause, variant in taken:
        if (cause, variant) not in out:
            continue
        others = [t for t in out if t[0] != cause]
        best = weigh(v, take(v, first, others), memory, cause)
        if best.lead > EXCHANGE:
            tell(f"{cause.label} gives way to {', '.join(c.label for c, _ in best.found)}")
            out = [*others, *best.found]
    return out


def pruned(v: View, first: Model, taken: Sequence[Taken], tell: Tell) -> list[Taken]:
    """The causes taken up, less those that noise with a memory explains as well."""
    out = list(taken)
    while out:
        support = [alone(v, take(v, first, [t for t in out if t != this]), this) for this in out]
        weakest = int(np.argmin(support))
        if support[weakest] > CLAIM:
            break
        tell(f"{out[weakest][0].label} is not kept: noise with a memory explains it")
        del out[weakest]
    return out


def alone(v: View, without: Model, this: Taken) -> float:
    """ln Bayes factor of one cause with the others in the model, noise with memory."""
    cause, made = this[0], _made(v, this)
    effects = without.effects if cause.effect in {e.id for e in without.effects} else [*without.effects, made]
    X = v.linear(effects, cause.parameters)[1] * np.array([p.sigma for p in cause.parameters])
    g = ground(weighted(v, without.r), weighted(v, without.J), weighted(v, X))
    return log_evidence(g, range(X.shape[-1]))


def steps_of(v: View, first: Model, taken: Sequence[Taken]) -> Course:
    """The causes in the order of what each takes away, and the shape of what is left."""
    steps = ordered(v, first, taken)
    rest = weigh(v, steps[-1].model if steps else first, memory=True)
    shapes = tuple(c for c, _ in rest.found if c.rival) if rest.ln_total > CLAIM and rest.strange > 0.5 else ()
    return Course(first, steps, shapes)


def ordered(v: View, first: Model, taken: Sequence[Taken]) -> tuple[Step, ...]:
    """One step for each cause, the one that takes away most first."""
    left = list(taken)
    steps: list[Step] = []
    while left:
        models = [take(v, first, [*(s.taken for s in steps), t]) for t in left]
        best = int(np.argmin([m.rms for m in models]))
        steps.append(Step(left.pop(best), models[best]))
    return tuple(steps)


def refined(v: View, c: Course) -> Course:
    """The same causes fitted to another view of the same recording."""
    first = start(v)
    return Course(first, ordered(v, first, [s.taken for s in c.steps]), c.left)


def take(v: View, model: Model, found: Sequence[Taken]) -> Model:
    """The model with these causes in it, everything refitted."""
    effects = list(model.effects)
    wanted = list(model.fitted)
    for this in found:
        if not this[0].rival and this[0].effect not in {e.id for e in effects}:
            effects.append(_made(v, this))
        wanted += this[0].parameters
    return refit(v, effects, wanted)


def _made(v: View, this: Taken) -> Effect:
    """The effect that a cause is, with its constants and of no size yet."""
    cause, variant = this
    return absent_effect(cause.effect, v.stimulus, cause.source, **dict(variant.constants))


def weighted(v: View, r: Array) -> Array:
    """Misfit (n, C, ...) in units in which all rows are equally sure."""
    if v.sigma is None:
        return r
    w = v.sigma.min() / v.sigma
    return np.asarray(r * w.reshape(*w.shape, *([1] * (r.ndim - 2))))


@dataclass(frozen=True)
class Round:
    """What is likeliest to be missing from a model: one cause or two, or a shape."""

    found: tuple[Taken, ...]
    ln_bayes: float  # of these
    ln_total: float  # of anything at all
    strange: float  # probability of a shape without a cause
    lead: float  # ln odds of these to the cause they were held against


def weigh(v: View, model: Model, memory: bool = False, against: Candidate | None = None) -> Round:
    """Compare everything that could be missing, alone and in pairs, in white noise or in noise with memory."""
    known, X = causes(v, model.effects, model.fitted)
    g = ground(weighted(v, model.r), weighted(v, model.J), weighted(v, X), memory)
    choice, ln = single(g, known)
    prior = priors(v, known)
    shape = np.array([bool(c.rival) for c in known])
    weight = ln + prior + np.where(shape, np.log(UNKNOWN), np.log(SINGLE))
    hypotheses = [Hypothesis((i,), float(ln[i]), float(weight[i])) for i in range(len(known))]
    hypotheses += _pairs(g, known, choice, ln, prior)
    w = np.array([h.ln_weight for h in hypotheses])
    total = float(np.logaddexp.reduce(w))
    odd = np.array([any(shape[i] for i in h.members) for h in hypotheses])
    strange = float(np.exp(np.logaddexp.reduce(w[odd]) - total))
    best = hypotheses[int(np.argmax(w if strange > 0.5 else np.where(odd, -np.inf, w)))]
    rival = [float(w) for w, c in zip(weight, known, strict=True) if against and c.key == against.key]
    lead = best.ln_weight - rival[0] if rival and not any(shape[i] for i in best.members) else 0.0
    found = tuple((known[i], known[i].variants[choice[i]]) for i in best.members)
    return Round(found, best.ln_bayes, total, strange, lead)


def single(g: Ground, known: Sequence[Candidate]) -> tuple[list[int], Array]:
    """For each cause its best variant and its ln Bayes factor, the search over variants paid for."""
    choice, out = [], []
    for c in known:
        each = np.array([log_evidence(g, at.index) for at in c.variants])
        choice.append(int(np.argmax(each)))
        out.append(float(np.logaddexp.reduce(each)) - np.log(len(each)))
    return choice, np.array(out)


def priors(v: View, known: Sequence[Candidate]) -> Array:
    """ln prior share of each cause, adding up to one among the effects and among the shapes.

    Effects are alike but for the usual ones; of each, half is for all axes together, which are of one make, and half
    for one of them. Shapes are alike.
    """
    single = {e: sum(c.effect == e and "," not in c.axis for c in known) for e in {c.effect for c in known}}
    several = {c.effect for c in known if "," in c.axis}
    kind = v.recording.kind
    usual = {c.effect for c in known if not c.rival and kind in CATALOGUE[c.effect].usual}
    share = np.array([
        OFTEN * (c.effect in usual) - np.log((2 if c.effect in several else 1) * (1 if "," in c.axis else
                                                                                   single[c.effect]))
        for c in known
    ])  # fmt: skip
    shape = np.array([bool(c.rival) for c in known])
    total = np.where(shape, np.logaddexp.reduce(share[shape]), np.logaddexp.reduce(share[~shape]))
    return np.asarray(share - total)


def _pairs(g: Ground, known: Sequence[Candidate], choice: Sequence[int], ln: Array, prior: Array) -> list[Hypothesis]:
    real = [i for i, c in enumerate(known) if not c.rival]
    order = sorted(real, key=lambda i: -(ln[i] + prior[i]))
    firsts = order[:FIRST] if ln.max() > CLAIM else order
    out: dict[tuple[int, int], Hypothesis] = {}
    for i in firsts:
        for j in real:
            key = (min(i, j), max(i, j))
            if key in out or known[i].effect == known[j].effect:
                continue
            at = known[i].variants[choice[i]].index + known[j].variants[choice[j]].index
            paid = np.log(len(known[i].variants) * len(known[j].variants))
            both = float(log_evidence(g, at) - paid)
            out[key] = Hypothesis(key, both, float(both + np.log(2 * PAIR) + prior[i] + prior[j]))
    return list(out.values())
