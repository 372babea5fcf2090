"""Laws compared alone and together with a known cause, which explains its part while the formula explains the rest.

The cube of a sine is the sine, which eccentricity has, and its third harmonic; no formula of one term is both. Each of
the likeliest known causes is therefore put into the model, and single terms are sought in addition to it:

.. math:: \\ln E = \\ln E_{known} + \\ln E_{law | known}
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gimbalcal.diagnose.evidence.correlated_noise import possible_noises
from gimbalcal.diagnose.evidence.node import Node
from gimbalcal.diagnose.evidence.odds import CLAIM, SEPARATION_EVIDENCE
from gimbalcal.diagnose.evidence.projection import project_all
from gimbalcal.diagnose.laws.law_problems import problem_of_search, problem_of_unit
from gimbalcal.diagnose.laws.law_search import Law, LawProblem, free_numbers, laws_of, weighed_in
from gimbalcal.diagnose.library.candidates import Candidate, Library
from gimbalcal.diagnose.search.fitted_causes import fit_causes
from gimbalcal.diagnose.search.ranking import Hypothesis, Ranking, Search, log_evidence, reduced_rows
from gimbalcal.diagnose.search.refit import with_columns
from gimbalcal.estimate.extra_effects import as_option

COMPARED_CAUSES = 3  # known causes together with which a law is sought
NAME_ODDS = float(np.log(1000.0))  # odds at which a term with a known cause gives way to a formula without


@dataclass(frozen=True)
class LawsGivenCause:
    """Laws by evidence in a problem, and the known cause that is in the model there with its ln evidence; or none.

    searches: those of the views with that cause in their models.
    """

    problem: LawProblem
    laws: Sequence[Law]
    known: Candidate | None = None
    ln_known: float = 0.0
    searches: tuple[Search, ...] = ()

    @property
    def name(self) -> tuple[str, ...]:
        """The known cause as --with takes it."""
        if self.known is None:
            return ()
        return (as_option(self.known.effect, self.known.axis),)

    @property
    def total(self) -> float:
        """ln evidence of the best law and its known cause."""
        return self.ln_known + self.laws[0].evidence if self.laws else -np.inf


def compare_models(
    searches: Sequence[Search], among: Sequence[Sequence[Node]], ranked: Ranking, alone: bool, sigma: float = 1.0
) -> LawsGivenCause | None:
    """Return the laws of one view, or of several of one unit, with the known cause given which they have most evidence.

    among: noises of each recording in which laws are sought; the one in which laws alone have most evidence is used;
    ranked: all hypotheses; alone: without a known cause; sigma: of a row, in the unit of reduced rows. None where
    no addition to a sensor or gimbal shows.
    """

    def joint_problem(own: Sequence[Search], nodes: Sequence[Node]) -> LawProblem | None:
        each = [g for s, node in zip(own, nodes, strict=True) if (g := problem_of_search(s, node, sigma)) is not None]
        return problem_of_unit(each) if len(each) == len(own) else None

    shown = [(g, nodes) for nodes in among if (g := joint_problem(searches, nodes)) is not None]
    if not shown:
        return None
    found = zip(laws_of([g for g, _ in shown]), shown, strict=True)
    laws, (g, nodes) = max(found, key=lambda own: max((law.evidence for law in own[0]), default=-np.inf))
    likely = () if alone else _likely_causes(ranked)
    known = [(h, tuple(with_cause(s, ranked.within(h.members, k)) for k, s in enumerate(searches))) for h in likely]
    problems = [
        (h, with_known, own) for h, with_known in known if (own := joint_problem(with_known, nodes)) is not None
    ]
    of_each = laws_of([own for *_, own in problems], products=False)
    others = [
        LawsGivenCause(own, more, ranked.library.candidates[h.members[0]], h.ln_weight, with_known)
        for (h, with_known, own), more in zip(problems, of_each, strict=True)
    ]
    more = weighed_in(g, [law for other in others for law in other.laws[:1]])
    best = LawsGivenCause(g, sorted([*laws, *more], key=lambda law: -law.evidence), searches=tuple(searches))
    for other in others:
        best = _better_cause(best, other, ranked)
    return best


def _better_cause(best: LawsGivenCause, other: LawsGivenCause, ranked: Ranking) -> LawsGivenCause:
    """Return the other one if its evidence suffices: a known cause is preferred to a longer formula.

    A second known cause has to be likelier, and one that does not shorten the formula has to make it likelier. As for
    every law, the evidence must be near that of the best other hypothesis.
    """
    if not other.laws or other.laws[0].evidence < CLAIM:
        return best
    if other.total < max(h.ln_weight for h in ranked.hypotheses) - SEPARATION_EVIDENCE:
        return best
    shorter = not best.laws or free_numbers(other.laws[0]) < free_numbers(best.laws[0])
    needed = 0.0 if best.known else -NAME_ODDS if shorter else CLAIM
    return other if other.total > best.total + needed else best


def _likely_causes(ranked: Ranking) -> list[Hypothesis]:
    """Return the likeliest known causes, each effect once, except single events."""
    every, out = ranked.library.candidates, dict[str, Hypothesis]()
    for h in ranked.hypotheses:
        c = every[h.members[0]]
        if len(h.members) == 1 and not c.rival and not c.once and h.ln_weight >= CLAIM:
            out.setdefault(c.effect, h)
    return list(out.values())[:COMPARED_CAUSES]


def with_cause(s: Search, members: Sequence[int]) -> Search:
    """Return the search with these causes, at their likeliest constants, in its model and with an empty library."""
    if not members:
        return s
    X = fit_causes(s, members).columns()
    known = s.fit.view.noise.scale_known
    fit = replace(s.fit, jacobian=np.concatenate([s.fit.jacobian, X], axis=2)) if known else with_columns(s.fit, X)
    none = Library((), np.zeros((len(s.rows.Q), 0)))
    # a noise of a search has scales of the channels, which are those of rows by the model without these causes
    nodes = [p.node for p in s.projections] if known else possible_noises(fit)
    rows = reduced_rows(fit, none.X, nodes)
    each = project_all(nodes, rows)
    null, empty = log_evidence(each), np.zeros((len(each), 0))
    return Search(none, (), empty[0], fit, rows, each, null, empty, empty[0])
