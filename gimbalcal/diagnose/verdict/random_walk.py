r"""A random walk of a single sensor, and the probability, given this alternative, of a cause that would be named.

A walk has no law, so what it explains has no known cause: the verdict is `unexplained`, and the shape a random walk.
Where walk and cause are within a factor of 20 of each other both are reported: the cause with its share of

.. math:: P = \frac{L_{cause}}{L_{cause} + L_{walk}},

priors included, and the walk as another explanation.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from gimbalcal.diagnose.evidence.node import SINGLE_WALK, TRIAD_WALK, Node
from gimbalcal.diagnose.evidence.odds import CLAIM
from gimbalcal.diagnose.result import Shape
from gimbalcal.diagnose.search.combine import combine_rankings
from gimbalcal.diagnose.search.ranking import Ranking, Search, rank_hypotheses
from gimbalcal.diagnose.verdict.decide import Decision, decide
from gimbalcal.effects.process import RandomWalk
from gimbalcal.inference.algebra import logsumexp
from gimbalcal.number import Array
from gimbalcal.units import from_si

SHAPE = "a random walk"
UNITS = {"specific_force": "ug/sqrt(h)", "angular_rate": "deg/h/sqrt(h)"}  # of print
STEP, STEP_OF_TRIADS = (float(np.log(grid[1] / grid[0])) for grid in (SINGLE_WALK, TRIAD_WALK))


class PartOfWalk(Enum):
    """The part that the random walk of one sensor has in a verdict."""

    NONE = "the causes or the shape are kept without it"
    ADDITIONAL = "the causes are kept, and the walk is reported in addition"
    SHARED = "a cause that is named without it is about as likely"
    INSTEAD = "no cause is as likely; it competes with formulas"


@dataclass(frozen=True)
class RandomWalkFinding:
    """A sensor, its random walk with one sigma in its unit of print, and ln of the odds to causes without it.

    ln_total: ln Bayes factor of the walk against nothing, to weigh formulas by; part: that of the walk in the verdict.
    """

    axis: str
    walk: float
    sigma: float
    ln_odds: float
    ln_total: float
    quantity: str = "specific_force"
    recording: int = 0  # the number of the one of several that shows it, else 0
    part: PartOfWalk = PartOfWalk.NONE

    @property
    def unit(self) -> str:
        """The unit of the walk in print."""
        return UNITS[self.quantity]

    @property
    def shape(self) -> Shape:
        """The walk as an entry of `unexplained`."""
        channel = f"{self.quantity} {self.axis}".strip()
        if not self.recording:
            return Shape(channel, SHAPE)
        return Shape(f"{channel} of recording {self.recording}", SHAPE, recordings=(self.recording,))

    def share_of(self, probability: float) -> float:
        """Return the probability of a cause given the walk as an alternative."""
        return float(probability / (1 + np.exp(self.ln_odds)))


def part_of_walk(ln_odds: float, named: bool, shaped: bool, named_without: bool) -> PartOfWalk:
    """Return the part of a walk with these ln odds to all that is found without it.

    named, shaped: whether causes or a shape are claimed in noises with the walk; named_without: causes in the others.
    """
    if named or (shaped and ln_odds <= CLAIM):
        return PartOfWalk.ADDITIONAL if named and ln_odds > CLAIM else PartOfWalk.NONE
    return PartOfWalk.SHARED if named_without and ln_odds <= CLAIM else PartOfWalk.INSTEAD


def decide_with_walk(s: Ranking, without_walks: Ranking, needed: float) -> tuple[Decision, RandomWalkFinding | None]:
    """Return the verdict, and the accelerometer with a random walk if that is a part of it.

    `without_walks` is the same search, or those of several recordings, without such noises; `needed` the ln Bayes
    factor that clean recordings of this design reach.
    """
    d = decide(s, needed)
    walk = None if d.hypothesis is not None else single_walk(s, without_walks)
    if walk is None:
        return d, None
    other = decide(without_walks, needed)
    part = part_of_walk(walk.ln_odds, False, d.verdict != "adequate", other.hypothesis is not None)
    walk = replace(walk, part=part)
    if part is PartOfWalk.SHARED:
        return replace(other, verdict="not-identifiable"), walk
    return (d, None) if part is PartOfWalk.NONE else (replace(d, verdict="adequate"), walk)


def single_walk(s: Ranking, without_walks: Ranking) -> RandomWalkFinding | None:
    """Return the likeliest walk of a single accelerometer; of several recordings that of the one which shows it most.

    Walks of several recordings are independent, so that their ln Bayes factors add up.
    """
    shown = {k: walk for k, one in enumerate(s.searches) if (walk := _walk_in(one)) is not None}
    if not shown:
        return None
    k, clearest = max(shown.items(), key=lambda item: item[1].ln_total)
    if len(s.searches) == 1:
        return replace(clearest, ln_odds=clearest.ln_total - without_walks.ln_total)
    total = sum(max(w.ln_total, 0.0) for w in shown.values())
    return replace(clearest, ln_total=total, ln_odds=total - without_walks.ln_total, recording=k + 1)


def _walk_in(s: Search) -> RandomWalkFinding | None:
    """Return the likeliest walk of a single accelerometer in one recording; its odds are those to nothing."""
    single = np.array([bool(p.node.single_walk) for p in s.projections])
    if not single.any():
        return None
    total = float(logsumexp(s.null[single]) - logsumexp(s.null[~single]))
    weight = np.exp(s.null - s.null[single].max()) * single
    nodes = [p.node for p in s.projections]
    return likeliest_walk(nodes, weight, _accelerometer_units(s), "specific_force", total, total)


def without_single_walks(s: Ranking) -> Ranking:
    """Return the ranking in the noises without a random walk of a single accelerometer."""
    each = [_in_common_noises(one) for one in s.searches]
    return s if all(a is b for a, b in zip(each, s.searches, strict=True)) else combine_rankings(each)


def _in_common_noises(s: Search) -> Search:
    """Return the search in the noises without a random walk of a single accelerometer."""
    kept = np.array([not p.node.single_walk for p in s.projections])
    if kept.all():
        return s
    projections = tuple(p for p, k in zip(s.projections, kept, strict=True) if k)
    null, joint = s.null[kept], s.joint[kept]
    factors = null, logsumexp(joint, axis=0) - logsumexp(null), joint
    return rank_hypotheses(s.fit, s.library, s.rows, projections, factors)


def clearest_walk_of_triad(
    nodes: Sequence[Node], weight: Array, sigma: Array, ln_odds: float, ln_total: float
) -> RandomWalkFinding:
    """Return the walk of the triad that shows it most, in noises of this weight (nodes,) in which triads walk.

    sigma (nodes,): of a row in each of the noises, in which walks are counted.
    """
    shares = {
        quantity: np.array([w * (quantity in n.noise) for w, n in zip(weight, nodes, strict=True)])
        for quantity in UNITS
    }
    quantity = max(UNITS, key=lambda q: float(shares[q].sum()))
    walk = likeliest_walk(nodes, shares[quantity], {"": sigma}, quantity, ln_odds, ln_total, STEP_OF_TRIADS)
    return replace(walk, axis="x, y, z")


def likeliest_walk(
    nodes: Sequence[Node], weight: Array, units: Mapping[str, Array], quantity: str, ln_odds: float, ln_total: float,
    step: float = STEP,
) -> RandomWalkFinding:  # fmt: skip
    """Return the sensor that most likely has a walk in noises of this weight (nodes,), and the size of its walk.

    units: of the noise in each of the nodes (nodes,), SI, by axis; step: ln of the ratio of successive sizes.
    """
    axis = nodes[int(np.argmax(weight))].single_walk
    weight = np.array([w * (n.single_walk == axis) for w, n in zip(weight, nodes, strict=True)])
    weight = weight / weight.sum()
    walks = [sum(p.N for p in n.noise.get(quantity, ()) if isinstance(p, RandomWalk)) for n in nodes]
    size = np.log(np.array(walks) * units[axis] + 1e-300)
    mean = float(weight @ size)
    spread = float(np.sqrt(weight @ (size - mean) ** 2 + step**2 / 12))  # of a grid, anywhere between its values
    walk = float(from_si(np.exp(mean), UNITS[quantity]))
    return RandomWalkFinding(axis, walk, spread * walk, ln_odds, ln_total, quantity)


def _accelerometer_units(s: Search) -> dict[str, Array]:
    """One sigma of a row of each accelerometer, which is the unit of every noise of the search."""
    sigma = np.broadcast_to(s.fit.sigma, s.fit.residual.shape)[0]
    own = {axis: k for k, (quantity, axis) in enumerate(s.fit.view.channels) if quantity == "specific_force"}
    return {axis: np.full(len(s.projections), sigma[k]) for axis, k in own.items()}
