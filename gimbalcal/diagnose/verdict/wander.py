r"""One sensor that wanders: what it is told as, and what it leaves of a cause that would be named without it.

A walk has no law, so that what it explains has no known cause: the verdict is that nothing known explains it, and the
shape a random walk. Where walk and cause are within a factor of 20 of each other both are told: the cause with its
share of

.. math:: P = \frac{L_{cause}}{L_{cause} + L_{walk}},

priors included, and the walk beside it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gimbalcal.diagnose import wording
from gimbalcal.diagnose.answer import Diagnosis
from gimbalcal.diagnose.evidence.noise import LONE_WALK, Node
from gimbalcal.diagnose.evidence.odds import CLAIM
from gimbalcal.diagnose.result import Shape
from gimbalcal.diagnose.search.ranking import Search, weighed
from gimbalcal.diagnose.verdict.decide import Decision, decide
from gimbalcal.effects.process import RandomWalk
from gimbalcal.inference.algebra import logsumexp
from gimbalcal.number import Array
from gimbalcal.units import from_si

SHAPE = "a random walk"
AGAIN = "visit the same positions once more: a law of what is logged comes back there, a walk does not"
LONGER = "let the run go on as long again: a law of what is logged goes on as it began, a walk does not"
HAND = "take the same rests once more: a law of what is logged comes back there, a walk does not"
SENSOR = {"specific_force": ("accelerometer", "ug/sqrt(h)"), "angular_rate": ("gyroscope", "deg/h/sqrt(h)")}
STEP = float(np.log(LONE_WALK[1] / LONE_WALK[0]))


@dataclass(frozen=True)
class Wander:
    """A sensor, its random walk with one sigma in the unit of `SENSOR`, and ln of the odds to causes without it.

    ln_total: ln Bayes factor of the walk against nothing, to weigh formulas by.
    """

    axis: str
    walk: float
    sigma: float
    ln_odds: float
    ln_total: float
    quantity: str = "specific_force"

    @property
    def in_words(self) -> str:
        """What wanders, and how fast."""
        sensor, unit = SENSOR[self.quantity]
        size = f"{wording.digits(self.walk)} +- {wording.digits(self.sigma)} {unit}"
        return f"{sensor} {self.axis} wanders, a random walk of {size}"

    @property
    def shape(self) -> Shape:
        """As an entry of `unexplained`."""
        return wording.shape(SHAPE, self.quantity, self.axis)

    def told(self, alone: bool) -> str:
        """A sentence that it wanders: `alone`, or it may be that as well as what is told."""
        if not alone:
            return f"It may as well be that {self.in_words}"
        return f"{self.in_words[:1].upper()}{self.in_words[1:]}: no cause and no formula is as likely"

    def shared(self, probability: float) -> float:
        """What it leaves of the probability of a cause."""
        return float(probability / (1 + np.exp(self.ln_odds)))


def decided(s: Search, held: Search, needed: float) -> tuple[Decision, Wander | None]:
    """The verdict, and the accelerometer that wanders where that has a part in it.

    `held` is the same search where none does, `needed` the ln Bayes factor that clean recordings of this design reach.
    """
    d = decide(s, needed)
    lone = np.array([bool(p.node.alone) for p in s.projections])
    if d.hypothesis is not None or not lone.any():
        return d, None
    total = float(logsumexp(s.null[lone]) - logsumexp(s.null[~lone]))
    weight = np.exp(s.null - s.null[lone].max()) * lone
    found = wander([p.node for p in s.projections], weight, _units(s), "specific_force", total - held.ln_total, total)
    if d.verdict != "adequate":  # a shape beside a walk, or instead of it
        return (replace(d, verdict="adequate"), found) if found.ln_odds > CLAIM else (d, None)
    other = decide(held, needed)
    if other.hypothesis is None or found.ln_odds > CLAIM:
        return d, found
    shared = tuple(found.shared(p) for p in other.probability)
    return replace(other, verdict="not-identifiable", probability=shared), found


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


def once_more(kind: str, by_hand: bool = False) -> str:
    """What tells a walk from what has a law, in a recording of this kind."""
    return LONGER if kind == "static-run" else HAND if by_hand else AGAIN


def with_wander(made: Diagnosis, wander: Wander, alone: bool = False) -> Diagnosis:
    """The diagnosis, which says that a sensor wanders: `alone`, or it may be that as well as what is told."""
    words = wander.told(alone)
    unexplained = (wander.shape, *made.unexplained)
    return replace(made, unexplained=unexplained, outcome=words, in_words=f"{made.in_words} {words}.")


def wander(
    nodes: Sequence[Node], weight: Array, units: Mapping[str, Array], quantity: str, ln_odds: float, ln_total: float
) -> Wander:
    """The likeliest sensor to walk alone in noises of this weight (nodes,), and its size.

    units: of the noise in each of the nodes (nodes,), SI, by axis.
    """
    axis = nodes[int(np.argmax(weight))].alone
    weight = np.array([w * (n.alone == axis) for w, n in zip(weight, nodes, strict=True)])
    weight = weight / weight.sum()
    walks = [sum(p.N for p in n.noise.get(quantity, ()) if isinstance(p, RandomWalk)) for n in nodes]
    size = np.log(np.array(walks) * units[axis] + 1e-300)
    mean = float(weight @ size)
    spread = float(np.sqrt(weight @ (size - mean) ** 2 + STEP**2 / 12))  # of a grid, anywhere between its values
    walk = float(from_si(np.exp(mean), SENSOR[quantity][1]))
    return Wander(axis, walk, spread * walk, ln_odds, ln_total, quantity)


def _units(s: Search) -> dict[str, Array]:
    """One sigma of a row of each accelerometer, which is the unit of every noise of the search."""
    sigma = np.broadcast_to(s.o.sigma, s.o.y.shape)[0]
    own = {axis: k for k, (quantity, axis) in enumerate(s.o.channels) if quantity == "specific_force"}
    return {axis: np.full(len(s.projections), sigma[k]) for axis, k in own.items()}
