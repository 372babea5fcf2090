"""One round of a search: what is likeliest to be missing from a model, a known cause, two of them, or a shape."""

from __future__ import annotations

from dataclasses import dataclass

from gimbalcal.diagnose.evidence.odds import CLAIM
from gimbalcal.diagnose.library.assemble import library
from gimbalcal.diagnose.library.candidates import Candidate, Variant
from gimbalcal.diagnose.search.ranking import Weighed, bayes_factors, likeliest_variants, total, weighed
from gimbalcal.diagnose.search.refit import projections
from gimbalcal.number import Array
from gimbalcal.views.core import Fit, View

Taken = tuple[Candidate, Variant]


@dataclass(frozen=True)
class Round:
    """What is likeliest to be missing from a model: one cause or two, or a shape."""

    found: tuple[Taken, ...]
    ln_bayes: float  # of these
    ln_total: float  # of anything at all
    named: bool  # whether these are known causes
    columns: Array  # (n, C, q) of these
    lead: float  # ln odds of these to the cause they were held against


def ranked(v: View, model: Fit, memory: bool = True) -> Weighed:
    """Everything that could be missing from a model, alone and beside others."""
    found = library(model)
    p = projections(v, model, found.X, memory)
    return weighed(found, p, bayes_factors(p, found.layout), v.kind)


def weigh(v: View, model: Fit, memory: bool = False, against: Candidate | None = None, shape: bool = False
          ) -> Round:  # fmt: skip
    """What is likeliest to be missing from a model, in white noise or in noise with memory: causes, or a `shape`.

    Causes are taken up where by themselves they are likelier than a shape by itself, several of them at the odds of a
    claim: together they may mimic what one shape says. Beside a shape almost any cause seems needed, as it resembles a
    part of what the shape only sketches.
    """
    s = ranked(v, model, memory)
    every = s.library.candidates
    shapes = [h for h in s.hypotheses if all(every[i].rival for i in h.members)]
    known = [
        h for h in s.hypotheses if not h.unknown(every) and len({every[i].effect for i in h.members}) == len(h.members)
    ]
    several = bool(known) and len(known[0].members) > 1  # none is left where everything that could be is taken up
    named = not (shape and shapes) and total(known) > total(shapes) + CLAIM * several
    best = known[0] if named else shapes[0]
    rival = [h.ln_weight for h in known if against and any(every[i].key == against.key for i in h.members)]
    lead = best.ln_weight - max(rival) if rival and named else 0.0
    variants = [every[i].variants[n] for i, n in zip(best.members, likeliest_variants(s, best.members), strict=True)]
    found = tuple((every[i], variant) for i, variant in zip(best.members, variants, strict=True))
    columns = s.library.X[..., [k for variant in variants for k in variant.index]]
    return Round(found, best.ln_bayes, s.ln_total, named, columns, lead)
