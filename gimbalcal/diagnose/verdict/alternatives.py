"""What could stand in the place of a cause that was found: its probability, and what it is confounded with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gimbalcal.diagnose.library.candidates import Candidate
from gimbalcal.diagnose.search.likeliest import ranked
from gimbalcal.diagnose.search.ranking import likeliest_variants
from gimbalcal.diagnose.search.refit import Model, projections, refit, weighted
from gimbalcal.diagnose.search.stepwise import bar
from gimbalcal.diagnose.verdict.decide import likeliest, together
from gimbalcal.effects import with_values
from gimbalcal.number import Array
from gimbalcal.views.core import View


@dataclass(frozen=True)
class Judgement:
    """One cause in the final model: its probability among all in its place, sigmas, what it is confounded with."""

    cause: Candidate
    probability: float
    sigma: float
    alike: tuple[Candidate, ...]

    @property
    def confounded(self) -> tuple[str, ...]:
        """Ids of the effects that these rows do not tell from it."""
        return tuple(c.effect for c in self.alike)

    def instead(self, found: Sequence[Candidate]) -> bool:
        """Whether one of those that could stand in its place was found as well: then it stands beside it."""
        return any(
            a.effect == c.effect and set(a.axis.split(", ")) & set(c.axis.split(", "))
            for a in self.alike for c in found if c.key != self.cause.key
        )  # fmt: skip


def judged(v: View, end: Model, taken: Candidate) -> Judgement:
    """Take one cause out, the others kept, and ask again which cause belongs there.

    What another cause would explain beside this one as well does not speak against this one: the two are a pair. Where
    nothing at all is claimed in its place, in noise with a memory, its probability is none: of a hundred causes one
    follows such a noise.
    """
    own = {(p.effect, p.field, p.axis) for p in taken.parameters}
    wanted = [p for p in end.fitted if (p.effect, p.field, p.axis) not in own]
    none = with_values(end.effects, taken.parameters, np.zeros(len(taken.parameters)), v.stimulus.axis_names)
    without = refit(v, none, wanted)
    s = ranked(v, without)
    known = s.library.candidates
    at = next(i for i, c in enumerate(known) if c.key == taken.key)
    alike, probability = together(s, at, (), likeliest(s), s.unknown > 0.5)
    if s.ln_total < bar(v, taken):
        probability = 0.0
    (variant,) = likeliest_variants(s, (at,))
    sigma = _sigmas(v, without, end, s.library.X[..., list(known[at].variants[variant].index)])
    return Judgement(taken, probability, sigma, tuple(known[i] for i in alike))


def _sigmas(v: View, without: Model, end: Model, X: Array) -> float:
    """Significance of columns X (n, C, p) that a model lacks, in the likeliest noise of one that has them."""
    unit = float(np.sqrt(np.mean(weighted(v, end.r) ** 2)))
    left = projections(v, end, X[..., :0], unit=unit)
    k = int(np.argmax([np.log(p.node.prior) + p.log_likelihood()[0] for p in left]))
    taken = projections(v, without, X, unit=unit)[k].explained(range(X.shape[-1]))
    return float(np.sqrt(taken) / left[k].scale.sigma(left[k].misfit[0]))
