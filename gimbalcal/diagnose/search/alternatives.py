"""What could stand in the place of a cause that was found: its probability, and what it is confounded with."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gimbalcal.diagnose.evidence.free_scale import best_evidence, explained, ground
from gimbalcal.diagnose.evidence.odds import SINGLE, TOGETHER, UNKNOWN
from gimbalcal.diagnose.library.candidates import Candidate
from gimbalcal.diagnose.library.unknown_noise import causes
from gimbalcal.diagnose.rows.views import View
from gimbalcal.diagnose.search.stepwise import Model, priors, refit, single, weighted
from gimbalcal.effects import with_values


@dataclass(frozen=True)
class Judgement:
    """One cause in the final model: its probability among all in its place, sigmas, what it is confounded with."""

    cause: Candidate
    probability: float
    sigma: float
    confounded: tuple[str, ...]


def judged(v: View, end: Model, taken: Candidate) -> Judgement:
    """Take one cause out, the others kept, and ask again which cause belongs there."""
    own = {(p.effect, p.field, p.axis) for p in taken.parameters}
    keep = [i for i, p in enumerate(end.fitted) if (p.effect, p.field, p.axis) not in own]
    mine = [i for i in range(len(end.fitted)) if i not in keep]
    wanted = [end.fitted[i] for i in keep]
    without = refit(v, with_values(end.effects, taken.parameters, np.zeros(len(mine)), v.stimulus.axis_names), wanted)
    known, X = causes(v, without.effects, wanted)
    g = ground(weighted(v, without.r), weighted(v, without.J), weighted(v, X))
    choice, ln = single(g, known)
    prior = priors(v, known)
    shape = np.array([bool(c.rival) for c in known])
    w = ln + prior + np.where(shape, np.log(UNKNOWN), np.log(SINGLE))
    at = next(i for i, c in enumerate(known) if c.key == taken.key)
    near = np.flatnonzero(w > w[at] - 3 * TOGETHER).tolist()
    fits = {i: best_evidence(g, known[i].variants[choice[i]].index) for i in near}
    alike = [i for i, f in fits.items() if f > fits[at] - TOGETHER and not shape[i] and known[i].effect != taken.effect]
    confounded = tuple(dict.fromkeys(known[i].effect for i in sorted(alike, key=lambda i: -fits[i])))
    same = [i for i, c in enumerate(known) if c.effect in (taken.effect, *confounded)]
    probability = float(np.exp(np.logaddexp.reduce(w[same]) - np.logaddexp.reduce(np.append(w, 0.0))))
    memory, scale = ground(weighted(v, end.r), weighted(v, end.J), weighted(v, X[..., :0])).best()
    sigmas = float(np.sqrt(explained(g, known[at].variants[choice[at]].index, memory))) / scale
    return Judgement(taken, probability, sigmas, confounded)
