"""Where a law is sought: the sensors and gimbals whose additions the rows of a view show."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from gimbalcal.diagnose.evidence.node import Node
from gimbalcal.diagnose.evidence.projection import project, rows_like
from gimbalcal.diagnose.laws.law_search import STAGE, LawProblem, Place
from gimbalcal.diagnose.laws.variables import joined_variables, variables
from gimbalcal.diagnose.library.candidates import Candidate, Library, layout_of
from gimbalcal.diagnose.library.shapes import MIN_TRAVEL_RAD, RIVAL_SIGMA, unknown_shape
from gimbalcal.diagnose.search.ranking import Search, bayes_factors
from gimbalcal.effects import Stage
from gimbalcal.inference.algebra import beyond, block_diagonal, orthonormal
from gimbalcal.number import Array
from gimbalcal.views.core import Fit

STRETCHES = 300  # in which a run, or a table, is looked at first
SIX_SENSOR_STRETCHES = 150  # the same of six sensors at once


def equal_stretches(n: int, most: int = STRETCHES, group: Array | None = None) -> Array:
    """Return ordinals (n,) of at most so many equal stretches, divided further where one group (n,) of rows ends.

    A stretch that holds rows of two rates of a table has the mean of a law at both, which is that of neither.
    """
    equal = np.arange(n) * min(n, most) // n
    if group is None or len(group) != n or np.count_nonzero(np.diff(group)) > most:
        return equal
    return np.cumsum((np.diff(equal, prepend=0) != 0) | (np.diff(group, prepend=group[:1]) != 0))


def problem_of_search(s: Search, node: Node, sigma: float) -> LawProblem | None:
    """Return the sensors and gimbals whose additions the rows of a search show, in its likeliest noise; or None.

    sigma: of a row, in the unit of reduced rows.
    """
    places = _places(s.fit)
    if not places:
        return None
    Q, y = orthonormal(node.whiten(s.rows.Q)), node.whiten(s.rows.y[:, :1])[:, 0] * (s.rows.unit / sigma)
    n, C = s.fit.residual.shape
    size = RIVAL_SIGMA if s.fit.view.noise.scale_known else s.fit.rms / np.sqrt(C)

    def evidence(sets: Sequence[Array]) -> Array:
        X, of = _side_by_side([s.columns(size * unit_rms(X)) for X in sets])
        rows = rows_like(s.rows, X)
        return bayes_factors([project(p.node, rows) for p in s.projections], layout_of(of))[1]

    return LawProblem(places, lambda X: node.whiten(s.fit.reduced(X)) / sigma, Q, beyond(Q, y), evidence, (n, C))


def _places(fit: Fit) -> list[Place]:
    """Return sensors and gimbals whose additions a view shows: in its channels, or in a navigator's behind them."""
    v = fit.view
    if v.added is not None:
        s, block = v.stimulus, equal_stretches(len(v.stimulus.time), SIX_SENSOR_STRETCHES)
        sensors = [(q, a, partial(v.added, q, a)) for q in v.measurement.acts_on for a in "xyz"]
        return [Place(q, a, variables(s), s, block, columns) for q, a, columns in sensors]
    rows, out, n = fit.rows, list[Place](), len(v)
    for quantity, stage in STAGE.items():
        if quantity not in v.measurement.acts_on or stage not in rows.seen:
            continue
        s, gimbals = rows.seen[stage], stage is Stage.ENCODER
        instants = len(s.instants())
        means = len(s.time) == len(rows.sensitivity(stage)) and len(s.time) % n == 0
        of_row = instants * len(s.time) // n if means else 1  # a turn is no mean of its steps
        block = np.repeat(v.noise.block, instants)
        if not len(block):
            block = equal_stretches(instants * len(s.time), group=np.repeat(v.groups, of_row))
        names = v.stimulus.axis_names if gimbals else tuple("xyz")
        # the norm of the force shows each accelerometer, gravity after a turn each gyroscope
        own = {a for q, a in v.channels if q == quantity and a in names} or set(names)
        for i, axis in enumerate(names):
            if axis in own and not (gimbals and np.ptp(v.stimulus.readout[:, i]) <= MIN_TRAVEL_RAD):
                columns = partial(rows.added_at_instants, stage, i)
                out.append(Place(quantity, axis, variables(s), s, block, columns, of_row))
    return out


def problem_of_unit(each: Sequence[LawProblem]) -> LawProblem:
    """Several recordings of one unit as one: a law has one form and one set of constants in all of them.

    Calibration and noise are each recording's own, so rows stand one after the other and Bayes factors multiply. A
    recording that has no such output, or in which such a gimbal stands still, says nothing of a law there.
    """
    if len(each) == 1:
        return each[0]
    at = list(itertools.accumulate((g.shape[0] * g.shape[1] for g in each), initial=0))
    keys = dict.fromkeys((p.channel, p.axis) for g in each for p in g.places)
    places = [_joined_place(each, channel, axis) for channel, axis in keys]

    def parts(X: Array) -> list[Array]:
        own = zip(each, itertools.pairwise(at), strict=True)
        return [X[i:j].reshape(*g.shape, X.shape[-1]) for g, (i, j) in own]

    def whiten(X: Array) -> Array:
        return np.concatenate([g.whiten(own) for g, own in zip(each, parts(X), strict=True)])

    def evidence(sets: Sequence[Array]) -> Array:
        own = zip(*map(parts, sets), strict=True)
        return np.asarray(sum(g.evidence(list(X)) for g, X in zip(each, own, strict=True)))

    Q = block_diagonal([g.Q for g in each])
    return LawProblem(places, whiten, Q, np.concatenate([g.y for g in each]), evidence, (at[-1], 1), parts)


def _joined_place(each: Sequence[LawProblem], channel: str, axis: str) -> Place:
    """One output or gimbal of all recordings that have it."""
    own = {k: p for k, g in enumerate(each) for p in g.places if (p.channel, p.axis) == (channel, axis)}
    first = next(iter(own.values()))
    ends = list(itertools.accumulate((len(p.block) for p in own.values()), initial=0))
    span = dict(zip(own, itertools.pairwise(ends), strict=True))
    last = list(itertools.accumulate((int(p.block[-1]) + 1 for p in own.values()), initial=0))
    block = np.concatenate([p.block + offset for p, offset in zip(own.values(), last, strict=False)])

    def columns(X: Array) -> Array:
        blocks = [own[k].columns(X[slice(*span[k])]) if k in own else np.zeros((*g.shape, X.shape[1]))
                for k, g in enumerate(each)]  # fmt: skip
        return np.concatenate([A.reshape(-1, 1, X.shape[1]) for A in blocks])

    shared = joined_variables([variables(p.stimulus, still=True) for p in own.values()])
    instants = first.instants if len({p.instants for p in own.values()}) == 1 else 1
    return Place(channel, axis, shared, first.stimulus, block, columns, instants)


def unit_rms(X: Array) -> Array:
    """Columns (n, C, m) of rms one in the channel that shows them most; none where nothing does."""
    rms = np.sqrt((X**2).mean(axis=0)).max(axis=0)
    return np.asarray(X / np.where(rms > 0, rms, np.inf))


def _side_by_side(sets: Sequence[Array]) -> tuple[Array, list[Candidate]]:
    """Columns of all sets (..., P), and each set as what may be missing."""
    blocks = list[Array]()
    laws = [unknown_shape(blocks, "law", "", "a law", [X]) for X in sets]
    return np.concatenate(blocks, axis=-1), laws


def with_law(s: Search, columns: Array) -> tuple[Search, Array, Array]:
    """The search with one law in the place of the library, its columns (n, C, m) as scaled, and their scale (m,)."""
    scaled = RIVAL_SIGMA * unit_rms(columns)
    reduced = s.fit.reduced(scaled)
    _, (law,) = _side_by_side([reduced])
    rows = rows_like(s.rows, reduced)
    each = tuple(project(p.node, rows) for p in s.projections)
    size = np.abs(columns).max(axis=(0, 1))
    scale = np.abs(scaled).max(axis=(0, 1)) / np.where(size > 0, size, np.inf)
    return replace(s, library=Library((law,), reduced), hypotheses=(), projections=each, rows=rows), scaled, scale
