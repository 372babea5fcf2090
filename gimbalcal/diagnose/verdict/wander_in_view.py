"""What one view says, a sensor that wanders alone among its noises where that may stand in the place of causes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gimbalcal.diagnose.evidence.odds import CLAIM
from gimbalcal.diagnose.search.lone_walk import wandering_in
from gimbalcal.diagnose.search.refit import Model, projections, weighted
from gimbalcal.diagnose.search.stepwise import course, steps_of
from gimbalcal.diagnose.verdict.decide import capped
from gimbalcal.diagnose.verdict.told import Told, told_as, told_of
from gimbalcal.diagnose.verdict.wander import Wander, once_more, wander
from gimbalcal.effects import CATALOGUE
from gimbalcal.pipeline import Tell
from gimbalcal.views.core import View


def looked_at(v: View, tell: Tell) -> Told:
    """What a course through a view says; anew with one sensor that may walk alone, where that is nearly as likely."""
    c = course(v, tell)
    told = told_of(v, c, tell)
    if c.start.exact:
        return told
    walking, ln_total, ln_odds = wandering_in(v, c)
    if not walking.noise.single_walks:
        return told
    found = _sensor(walking, c.start, ln_odds, ln_total)
    tell(f"again, as {found.in_words.partition(' wanders')[0]} may wander")
    again = told_of(walking, course(walking, tell), tell)
    if again.findings and ln_odds > CLAIM:  # a cause beside the walk; a course in time may be the walk itself
        drifts = any(CATALOGUE[f.effect].role.time_drift for f in again.findings)
        return _with(replace(again, verdict="not-identifiable") if drifts else again, found, alone=False)
    if again.findings or (again.unexplained and ln_odds < CLAIM):
        return again
    if told.findings and ln_odds < CLAIM:
        shared = tuple(replace(f, probability=capped(found.shared(f.probability))) for f in told.findings)
        return _with(replace(told, verdict="not-identifiable", findings=shared), found, alone=False)
    none = steps_of(v, c.start, (), refused=True)
    bare = told_as(v, none, (), tell, lacking=True)
    likelier = max((law.evidence for law in bare.laws), default=-np.inf) - ln_total
    if likelier > CLAIM:  # a walk has no formula
        return bare
    once = once_more(v.kind, by_hand=not v.stimulus.axis_names)
    if likelier < -CLAIM:
        bare = replace(told_as(v, none, (), tell, lacking=True, formulas=False), recommend=bare.recommend or once)
    return _with(bare, found, alone=likelier < -CLAIM)


def _with(told: Told, found: Wander, alone: bool) -> Told:
    return replace(told, unexplained=(found.shape, *told.unexplained), outcome=found.told(alone))


def _sensor(v: View, first: Model, ln_odds: float, ln_total: float) -> Wander:
    """Which sensor wanders in the noises of a view, and by how much."""
    unit = float(np.sqrt(np.mean(weighted(v, first.r) ** 2)))
    each = [p for p in projections(v, first, np.zeros((*first.r.shape, 0))) if p.node.alone]
    ln = np.array([np.log(p.node.prior) + p.log_likelihood()[0] for p in each])
    sigma = unit * np.array([float(p.scale.sigma(p.misfit[0])) for p in each])
    nodes = [p.node for p in each]
    return wander(nodes, np.exp(ln - ln.max()), dict.fromkeys("xyz", sigma), v.channels[0][0], ln_odds, ln_total)
