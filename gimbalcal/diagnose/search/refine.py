r"""Non-linear constants made continuous, and effects that bend with their own size taken at that size.

Finer values are put around the best of the grid and together weigh as much as it does: the search is still paid for.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gimbalcal.diagnose.evidence.projection import Projection, ReducedRows, any_size, project, rows_like
from gimbalcal.diagnose.library.assemble import columns_at
from gimbalcal.diagnose.library.candidates import Candidate, Library, Variant, appended_to
from gimbalcal.effects import CATALOGUE, Effect, Stimulus, with_values
from gimbalcal.effects.effect import constants
from gimbalcal.effects.grids import Constant, kind, limits, values_between
from gimbalcal.number import Array
from gimbalcal.views.core import Fit, absent_effect

ROUNDS = 6  # refinements of a constant, each narrowing its range fourfold
FLAT_NATS = 1.0  # nats between the best and the worst value of a refinement: these are closer than half a sigma then
FINE_VALUES = 7  # values of a constant in one refinement
MAX_NATS_BEHIND = 25.0  # nats behind the best within which a cause is worth refining
SECANTS = 8  # steps of size and calibration together; they settle in three or four
BRANCHES = 3  # positions at which the sign of a force may turn out to be the other one


def refine_candidates(
    o: Fit, library: Library, projections: Sequence[Projection], total: Array, joint: Array, rows: ReducedRows
) -> Library:
    """Add finer values of the non-linear constants around the best of each promising candidate."""
    best = float(total.max())
    if best < 2.0:
        return library
    stated = max(projections, key=lambda p: p.node.prior)  # a larger noise would hide that a law is on a wrong branch
    blocks, candidates = [library.X], list(library.candidates)
    for i, c in enumerate(library.candidates):
        if c.rival or total[i] < best - MAX_NATS_BEHIND - 0.2 * best:
            continue
        p = projections[int(np.argmax(joint[:, i]))]
        refined = _narrowed_values(o, c, p, rows) if _continuous_constants(c) else _relinearised_candidate(o, c, stated)
        finer = (replace(v, index=tuple(appended_to(blocks, X))) for v, X in refined)
        candidates[i] = replace(c, variants=(*c.variants, *finer))
    if len(blocks) == 1:
        return library
    return Library(tuple(candidates), np.concatenate(blocks, axis=1))


def _continuous_constants(c: Candidate) -> list[Constant]:
    """Constants of the effect that can take any value."""
    return [f for f in constants(CATALOGUE[c.effect]) if not kind(f).counts]


def _narrowed_values(o: Fit, c: Candidate, p: Projection, rows: ReducedRows) -> list[tuple[Variant, Array]]:
    """Finer values of each constant in turn about the best variant; as heavy together as it, then a third of that."""
    score = any_size(p, np.array([v.index for v in c.variants]))
    start = c.variants[int(np.argmax(score))]
    here = dict(start.constants)
    fields = _continuous_constants(c)
    ranges = {f.name: _neighbouring_values(c, f.name, here[f.name]) for f in fields}
    refined: list[tuple[Variant, Array]] = []
    best, share = float(max(score)), start.weight
    for _ in range(ROUNDS):
        flat = True
        for f in fields:
            tried = []
            for value in np.clip(
                values_between(f, *ranges[f.name], FINE_VALUES + 2)[1:-1], *limits(f, o.view.stimulus)
            ):
                there = {**here, f.name: float(value)}
                X = columns_at(o, c, tuple(there.items()))
                ln = float(any_size(project(p.node, rows_like(rows, X)), np.arange(X.shape[1])))
                refined.append((Variant(tuple(there.items()), (), share / FINE_VALUES), X))
                tried.append(ln)
                if ln > best:
                    best, here = ln, there
            ranges[f.name] = _shrink_cell(ranges[f.name], here[f.name])
            flat = flat and float(np.ptp(tried or [0.0])) < FLAT_NATS
        share /= 3
        if flat:
            break
    return refined


def _neighbouring_values(c: Candidate, name: str, value: float) -> tuple[float, float]:
    """Neighbouring grid values of one constant."""
    x = np.unique([dict(v.constants)[name] for v in c.variants])
    j = int(np.argmin(np.abs(x - value)))
    return float(x[max(j - 1, 0)]), float(x[min(j + 1, len(x) - 1)])


def _shrink_cell(cell: tuple[float, float], value: float) -> tuple[float, float]:
    width = (cell[1] - cell[0]) / (FINE_VALUES + 1)
    return value - width, value + width


def _relinearised_candidate(o: Fit, c: Candidate, p: Projection) -> list[tuple[Variant, Array]]:
    """For an effect that bends with its own size: secants at the size and calibration that fit best with it.

    Near null, small angles decide the sign of a force, and with it the branch of a law such as a dead zone: angles of
    the sensor's insides too, of which the calibration knows nothing. So each position where the sign is in doubt is
    also tried with the other one; all branches that were tried share the prior.
    """
    if CATALOGUE[c.effect].linear or len(c.parameters) != 1:
        return []
    Z, y = (p.node.whiten(o.reduced(A)) for A in (o.Z, o.residual[:, :, None]))
    at = c.variants[0].index[0]
    tangent = float(p.b[at, 0] / max(p.G.diagonal[at], 1e-12)) * c.parameters[0].sigma
    if tangent == 0.0:
        return []
    best = _fit_by_secants(o, c, p, Z, y, tangent, frozenset())
    if best is None:
        return []
    tried = [best]
    for _ in range(BRANCHES):
        bent = [_fit_by_secants(o, c, p, Z, y, best.size, best.flipped | {i}) for i in best.doubtful - best.flipped]
        more = [b for b in bent if b is not None]
        tried += more
        better = min(more, key=lambda b: b.misfit, default=best)
        if better.misfit > best.misfit - 1.0:
            break
        best = better
    return [(Variant(c.variants[0].constants, (), 1.0, b.column), o.reduced(b.column[:, :, None])) for b in tried]


@dataclass(frozen=True)
class _Bent:
    """A branch: misfit, size (SI), positions with the sign flipped and with it in doubt, secant (n, C)."""

    misfit: float
    size: float
    flipped: frozenset[int]
    doubtful: frozenset[int]
    column: Array


def _fit_by_secants(
    o: Fit, c: Candidate, p: Projection, Z: Array, y: Array, size: float, flipped: frozenset[int]
) -> _Bent | None:
    """Size and calibration fitted together by secants, the force at some positions held on the other side of null.

    None where the size runs off to where the law has no numbers.
    """
    sigma, stage = c.parameters[0].sigma, CATALOGUE[c.effect].stage
    s = o.rows.seen[stage]
    for _ in range(SECANTS):
        column = _secant_column(o, c, size, _other_side(s, c.axis, flipped, size))
        if not np.isfinite(column).all():
            return None
        A = np.concatenate([Z, p.node.whiten(o.reduced(column[:, :, None]))], axis=1)
        x = np.linalg.lstsq(A, y[:, 0], rcond=1e-9)[0]
        root = float(x[-1]) * sigma
        if root == 0.0 or abs(root - size) < 0.01 * abs(size):
            break
        size, s = root, o.view.evaluate(o.shifted_effects(x[:-1])).seen[stage]
    return _Bent(float(((y[:, 0] - A @ x) ** 2).sum()), size, flipped, _doubtful_positions(s, c.axis, size), column)


def _doubtful_positions(s: Stimulus, axis: str, size: float) -> frozenset[int]:
    """Positions at which the force along an axis is within three sizes of null."""
    inside = np.abs(s.force[:, "xyz".index(axis)]) < 3 * abs(size) if axis in "xyz" else np.zeros(len(s.time), bool)
    return frozenset(int(i) for i in np.unique(s.position[inside]))


def _other_side(s: Stimulus, axis: str, flipped: frozenset[int], size: float) -> Stimulus:
    """The stimulus with the force along one axis beyond null at some positions."""
    if not flipped:
        return s
    force, i = s.force.copy(), "xyz".index(axis)
    there = np.isin(s.position, list(flipped))
    force[there, i] = -np.sign(force[there, i]) * np.maximum(np.abs(force[there, i]), abs(size))
    return s.at(force=force)


def _secant_column(o: Fit, c: Candidate, size: float, s: Stimulus) -> Array:
    """Column (n, C) per prior sigma of the change that this size of the parameter makes."""
    cls, names = CATALOGUE[c.effect], o.view.stimulus.axis_names
    none: Effect = absent_effect(c.effect, o.view.stimulus)
    (sized,) = with_values([none], c.parameters, np.array([size]), names)
    added = np.asarray(sized.contribution(s)) - np.asarray(none.contribution(s))
    return o.rows.through(cls.stage, added.real) / size * c.parameters[0].sigma
