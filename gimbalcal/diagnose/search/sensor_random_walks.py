r"""Random walks larger than any noise of the grid: the walk competes with the causes that would be named instead.

Where channels are sensors, a single one has a walk; in the innovations of a navigator all sensors of a triad do. A walk
is stochastic and has no column. The calibration absorbs its slow part: twelve cosines, the first twelve terms of its
series, explain only half of the remainder. It is therefore a covariance among the noises: a cause is then
claimed against it as against any noise, and the sigmas of sizes include its contribution.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gimbalcal.diagnose.evidence.correlated_noise import SINGLE_WALKS, TRIAD_WALKS, possible_noises
from gimbalcal.diagnose.evidence.node import Node
from gimbalcal.diagnose.evidence.odds import CLAIM
from gimbalcal.diagnose.evidence.projection import project, rows_like
from gimbalcal.diagnose.evidence.stated_noise import single_walks_of_stated_noise
from gimbalcal.diagnose.library.assemble import assemble_library
from gimbalcal.diagnose.search.ranking import Search, projections_of, search
from gimbalcal.diagnose.search.stepwise import SearchResult, ln_odds, log_shares
from gimbalcal.effects.process import RandomWalk
from gimbalcal.inference.algebra import logsumexp
from gimbalcal.number import Array
from gimbalcal.views.core import View

MAX_WALK_NOISES = 12  # the likeliest of these noises: each takes as long as one of the grid
MAX_NATS_BEHIND = 5.0  # nats behind the likeliest within which they count


def likely_wandering_noises(s: Search) -> tuple[Node, ...]:
    """Return the noises with a walk of a single accelerometer of at least 1/20 of the evidence found, likeliest first.

    If nothing was found in a static run, those 20 times as likely as all noises without one together are returned, if a
    walk is needed at all; a wander between positions is reported by the calibration. If walks of all accelerometers
    are likelier, none is returned, and the residual is described by a shape.
    """
    walking = s.ln_total >= CLAIM
    if not walking and (not s.fit.view.kind.stabilised or not _all_walk(s)):
        return ()
    nodes = single_walks_of_stated_noise(s.fit)
    ln = noise_weights(s, nodes)
    alone = np.array([bool(n.single_walk) for n in nodes])
    if not alone.any() or (not alone.all() and logsumexp(ln[~alone]) > logsumexp(ln[alone])):
        return ()
    others = np.append(s.null, ln[~alone])
    if walking and logsumexp(ln) - logsumexp(s.null) < s.ln_total - CLAIM:
        return ()
    if not walking and logsumexp(ln[alone]) - logsumexp(others) < CLAIM:
        return ()
    return tuple(nodes[k] for k in likeliest_walks(ln))


def _all_walk(s: Search) -> bool:
    """Return whether noises in which all accelerometers walk are likelier than those in which none does."""
    walk = np.array([
        any(q.N > 0 for q in p.node.noise["specific_force"] if isinstance(q, RandomWalk)) for p in s.projections
    ])  # fmt: skip
    return bool(walk.any() and logsumexp(s.null[walk]) > logsumexp(s.null[~walk]))


def likeliest_walks(ln: Array) -> list[int]:
    """Ordinals of the noises that count, by ln prior x likelihood (nodes,) of each."""
    return [int(k) for k in np.argsort(-ln)[:MAX_WALK_NOISES] if ln[k] > ln.max() - MAX_NATS_BEHIND]


def noise_weights(s: Search, nodes: Sequence[Node]) -> Array:
    """ln prior x likelihood (nodes,) of nothing missing in these noises."""
    none = np.zeros((len(s.rows.Q), 0))
    bare = {low: rows_like(s.rows, none, low) for low in {n.coloured for n in nodes}}
    return np.array([np.log(n.prior) + project(n, bare[n.coloured]).log_likelihood()[0] for n in nodes])


def wandering_in(c: SearchResult) -> tuple[View, float, float]:
    """Return the view with likely random walks of sensors among its noises, and two ln odds of such a walk.

    They are those of single sensors, or of whole triads behind the rows of a navigator.

    A walk is likely if its evidence is within a factor of 20 of that of the causes that were found or, where none was,
    20 times that of all other noises. The odds are those of a walk to no walk, and to all causes that were found.
    """
    v = c.start.view
    if not v.sensors_may_walk:
        return v, -np.inf, -np.inf
    with_walks = replace(c.start, view=with_walks_of_sensors(v))
    every = projections_of(with_walks, np.zeros((c.start.residual.size, 0)))
    names = {n.name: k for k, n in enumerate(possible_noises(with_walks))}  # at whatever scales of the channels
    ln = np.full(len(names), -np.inf)
    for p in every:
        ln[names[p.node.name]] = np.logaddexp(ln[names[p.node.name]], p.log_evidence())
    walking = np.array([bool(n.noise) for n in possible_noises(with_walks)])
    total = float(logsumexp(ln[walking]) - logsumexp(ln[~walking]))
    causes = found_in(c)
    odds = total - causes
    if total < (causes - CLAIM if causes >= CLAIM else CLAIM):
        return v, total, odds
    return with_walks_of_sensors(v, likeliest_walks(ln[walking])), total, odds


def with_walks_of_sensors(v: View, kept: Sequence[int] | None = None) -> View:
    """Return the view with random walks of sensors among its noises, all or those `kept` by their ordinals."""
    ordinals = range(len(SINGLE_WALKS if v.added is None else TRIAD_WALKS)) if kept is None else kept
    if v.added is None:
        noise = replace(v.noise, single_walks=tuple(SINGLE_WALKS[k] for k in ordinals))
    else:
        noise = replace(v.noise, triad_walks=tuple(TRIAD_WALKS[k] for k in ordinals))
    return replace(v, noise=noise, cache={})


def found_in(c: SearchResult) -> float:
    """Return the ln Bayes factor of all that a search found, and of what its last model leaves, against nothing."""
    if not c.steps:
        return c.missing.ln_total
    known = assemble_library(c.start)
    named = ln_odds(c.start, c.causes, log_shares(c.start.view, known))
    return max(search(c.start, known).ln_total, named + max(c.missing.ln_total, 0.0))
