"""What could stand in the place of a cause that was found: its probability, and what it is confounded with."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from gimbalcal.diagnose.evidence.free_scale import Ground, best_evidence, explained
from gimbalcal.diagnose.evidence.odds import SINGLE, TOGETHER, UNKNOWN
from gimbalcal.diagnose.library.candidates import Candidate
from gimbalcal.diagnose.library.unknown_noise import causes
from gimbalcal.diagnose.rows.views import View
from gimbalcal.diagnose.search.refit import Model, evidence, refit
from gimbalcal.diagnose.search.stepwise import priors, single
from gimbalcal.effects import with_values
from gimbalcal.number import Array

Key = tuple[str, str, str, str]


@dataclass(frozen=True)
class Judgement:
    """One cause in the final model: its probability among all in its place, sigmas, what it is confounded with."""

    cause: Candidate
    probability: float
    sigma: float
    confounded: tuple[str, ...]


def still_wanted(v: View, end: Model) -> dict[Key, float]:
    """ln posterior weight of each cause beside all that were taken up, not below zero: these are no alternatives."""
    known, X = causes(v, end.effects, end.fitted)
    return {c.key: max(0.0, float(w)) for c, w in zip(known, _weights(v, known, evidence(v, end, X))[1], strict=True)}


def _weights(v: View, known: Sequence[Candidate], g: Ground) -> tuple[list[int], Array]:
    """Best variant of each cause, and its ln posterior weight."""
    choice, ln = single(g, known)
    shape = np.array([bool(c.rival) for c in known])
    return choice, ln + priors(v, known) + np.where(shape, np.log(UNKNOWN), np.log(SINGLE))


def judged(v: View, end: Model, taken: Candidate, wanted_still: Mapping[Key, float]) -> Judgement:
    """Take one cause out, the others kept, and ask again which cause belongs there.

    What another cause would explain beside this one as well speaks for that cause, not against this one: its weight is
    what it gains by standing alone.
    """
    own = {(p.effect, p.field, p.axis) for p in taken.parameters}
    keep = [i for i, p in enumerate(end.fitted) if (p.effect, p.field, p.axis) not in own]
    mine = [i for i in range(len(end.fitted)) if i not in keep]
    wanted = [end.fitted[i] for i in keep]
    without = refit(v, with_values(end.effects, taken.parameters, np.zeros(len(mine)), v.stimulus.axis_names), wanted)
    known, X = causes(v, without.effects, wanted)
    g = evidence(v, without, X)
    choice, w = _weights(v, known, g)
    shape = np.array([bool(c.rival) for c in known])
    at = next(i for i, c in enumerate(known) if c.key == taken.key)
    w = w - np.array([wanted_still.get(c.key, 0.0) for c in known])
    near = np.flatnonzero(w > w[at] - 3 * TOGETHER).tolist()
    fits = {i: best_evidence(g, known[i].variants[choice[i]].index) for i in near}
    alike = [i for i, f in fits.items() if f > fits[at] - TOGETHER and not shape[i] and known[i].effect != taken.effect]
    confounded = tuple(dict.fromkeys(known[i].effect for i in sorted(alike, key=lambda i: -fits[i])))
    same = [i for i, c in enumerate(known) if c.effect in (taken.effect, *confounded)]
    probability = float(np.exp(np.logaddexp.reduce(w[same]) - np.logaddexp.reduce(np.append(w, 0.0))))
    memory, scale = evidence(v, end, X[..., :0]).best()
    sigmas = float(np.sqrt(explained(g, known[at].variants[choice[at]].index, memory))) / scale
    return Judgement(taken, probability, sigmas, confounded)
