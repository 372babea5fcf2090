r"""One accelerometer that wanders: what it is told as, and what it leaves of a cause that would be named without it.

A walk has no law, so that what it explains has no known cause: the verdict is that nothing known explains it, and the
shape a random walk. Where walk and cause are within a factor of 20 of each other both are told: the cause with its
share of

.. math:: P = \frac{L_{cause}}{L_{cause} + L_{walk}},

priors included, and the walk beside it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gimbalcal.diagnose import wording
from gimbalcal.diagnose.answer import Diagnosis
from gimbalcal.diagnose.evidence.noise import LONE_WALK
from gimbalcal.diagnose.evidence.odds import CLAIM
from gimbalcal.diagnose.search.ranking import Search, weighed
from gimbalcal.diagnose.verdict.decide import Decision, decide
from gimbalcal.effects.process import RandomWalk
from gimbalcal.inference.algebra import logsumexp
from gimbalcal.number import Array
from gimbalcal.units import from_si

SHAPE = "a random walk"
AGAIN = "visit the same positions once more: a law of what is logged comes back there, a walk does not"
STEP = float(np.log(LONE_WALK[1] / LONE_WALK[0]))


@dataclass(frozen=True)
class Wander:
    """An accelerometer, its random walk in ug/sqrt(h) with one sigma, and ln of the odds to causes without it.

    ln_total: ln Bayes factor of the walk against nothing, to weigh formulas by.
    """

    axis: str
    walk: float
    sigma: float
    ln_odds: float
    ln_total: float

    @property
    def in_words(self) -> str:
        """What wanders, and how fast."""
        size = f"{wording.digits(self.walk)} +- {wording.digits(self.sigma)} ug/sqrt(h)"
        return f"accelerometer {self.axis} wanders, a random walk of {size}"


def decided(s: Search, held: Search, needed: float) -> tuple[Decision, Wander | None]:
    """The verdict, and the accelerometer that wanders where that has a part in it.

    `held` is the same search where none does, `needed` the ln Bayes factor that clean recordings of this design reach.
    """
    d = decide(s, needed)
    lone = np.array([bool(p.node.alone) for p in s.projections])
    if d.verdict != "adequate" or not lone.any():
        return d, None
    total = float(logsumexp(s.null[lone]) - logsumexp(s.null[~lone]))
    found = _wander(s, lone, total - held.ln_total, total)
    other = decide(held, needed)
    if other.hypothesis is None or found.ln_odds > CLAIM:
        return d, found
    share = 1 / (1 + np.exp(found.ln_odds))
    return replace(
        other, verdict="not-identifiable", probability=tuple(float(share * p) for p in other.probability)
    ), found  # fmt: skip


def steady(s: Search) -> Search:
    """The search in the noises in which no accelerometer wanders alone."""
    kept = np.array([not p.node.alone for p in s.projections])
    if kept.all():
        return s
    projections = tuple(p for p, k in zip(s.projections, kept, strict=True) if k)
    null, joint = s.null[kept], s.joint[kept]
    factors = null, logsumexp(joint, axis=0) - logsumexp(null), joint
    w = weighed(s.library, projections, factors, s.o.kind)
    return replace(s, hypotheses=w.hypotheses, projections=projections, null=w.null, joint=w.joint, singles=w.singles)


def with_wander(made: Diagnosis, wander: Wander, alone: bool = False) -> Diagnosis:
    """The diagnosis, which says that an accelerometer wanders: `alone`, or it may be that as well as what is told."""
    words = f"It may as well be that {wander.in_words}"
    if alone:
        words = f"{wander.in_words[:1].upper()}{wander.in_words[1:]}: no cause and no formula is as likely"
    also = wording.shape(SHAPE, "specific_force", wander.axis)
    return replace(made, unexplained=(also, *made.unexplained), outcome=words, in_words=f"{made.in_words} {words}.")


def _wander(s: Search, lone: Array, ln_odds: float, ln_total: float) -> Wander:
    weight = np.exp(s.null - s.null[lone].max()) * lone
    nodes = [p.node for p in s.projections]
    axis = nodes[int(np.argmax(weight))].alone
    weight = np.array([w * (n.alone == axis) for w, n in zip(weight, nodes, strict=True)])
    weight /= weight.sum()
    size = np.log([sum(p.N for p in n.noise["specific_force"] if isinstance(p, RandomWalk)) + 1e-300 for n in nodes])
    mean = float(weight @ size)
    spread = float(np.sqrt(weight @ (size - mean) ** 2 + STEP**2 / 12))  # of a grid, anywhere between its values
    unit = np.broadcast_to(s.o.sigma, s.o.y.shape)[0, s.o.channels.index(("specific_force", axis))]
    walk = float(from_si(np.exp(mean) * unit, "ug/sqrt(h)"))
    return Wander(axis, walk, spread * walk, ln_odds, ln_total)
