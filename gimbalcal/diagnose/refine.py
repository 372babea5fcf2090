r"""Non-linear constants made continuous, and effects that bend with their own size taken at that size.

A grid value close to the best is replaced by finer ones that share its prior, so that a finer search is still paid for.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gimbalcal.diagnose.candidates import Candidate, Library, Variant, constant_fields, limits, scaled_columns
from gimbalcal.diagnose.evidence import SIZE_PRIOR, Projection, Rows, extended, log_bayes, mixed
from gimbalcal.diagnose.observations import Observations, absent_effect, restimulated
from gimbalcal.effects import CATALOGUE, Effect, Stimulus, with_values
from gimbalcal.number import Array

ROUNDS = 3  # refinements of a constant, each narrowing its range fourfold
FINE = 7  # values of a constant in one refinement
CLOSE = 25.0  # nats behind the best within which a cause is worth refining
WHOLE = ("position", "order", "lines", "m")  # constants that count
SIZES = (0.4, 0.7, 1.0, 1.4, 2.0)  # times the size that the tangent finds


def refine(
    o: Observations, library: Library, projections: Sequence[Projection], total: Array, joint: Array, rows: Rows
) -> Library:
    """Add finer values of the non-linear constants around the best of each promising candidate."""
    best = float(total.max())
    if best < 2.0:
        return library
    blocks, candidates, at = [library.X], list(library.candidates), library.X.shape[1]
    for i, c in enumerate(library.candidates):
        if c.rival or total[i] < best - CLOSE - 0.2 * best:
            continue
        p = projections[int(np.argmax(joint[:, i]))]
        made = _narrowed(o, c, p, rows) if _continuous(c) else _relinearised(o, c, p, rows)
        variants = list(c.variants)
        for v, X in made:
            variants.append(replace(v, index=tuple(range(at, at + X.shape[1]))))
            at += X.shape[1]
            blocks.append(X)
        candidates[i] = replace(c, variants=tuple(variants))
    if len(blocks) == 1:
        return library
    return Library(tuple(candidates), np.concatenate(blocks, axis=1))


def _continuous(c: Candidate) -> bool:
    """Whether a constant of the effect can take any value."""
    return any(f.name not in WHOLE for f in constant_fields(c.effect))


def _narrowed(o: Observations, c: Candidate, p: Projection, rows: Rows) -> list[tuple[Variant, Array]]:
    """Finer values of each constant in turn about the best variant; together they carry that variant's prior."""
    score = [_score(p.G[np.ix_(v.index, v.index)], p.b[list(v.index), 0]) for v in c.variants]
    start = c.variants[int(np.argmax(score))]
    here = dict(start.constants)
    fields = [f for f in constant_fields(c.effect) if f.name not in WHOLE]
    ranges = {f.name: _cell(c, f.name, here[f.name]) for f in fields}
    made: list[tuple[Variant, Array]] = []
    best, share = max(score), start.weight
    for _ in range(ROUNDS):
        before = best
        for f in fields:
            low, high = limits(f, o) if f.name != "epoch" else (0.0, float(o.stimulus.time[-1]))
            for value in np.clip(_between(*ranges[f.name], f.name), low, high):
                X = _columns(o, c, {**here, f.name: float(value)})
                ln = _score(*extended(p.node, rows, X))
                made.append((Variant(tuple({**here, f.name: float(value)}.items()), (), share / FINE), X))
                if ln > best:
                    best, here = ln, {**here, f.name: float(value)}
            ranges[f.name] = _shrunk(ranges[f.name], here[f.name])
        share /= 3
        if best - before < 0.3:
            break
    return made


def _cell(c: Candidate, name: str, value: float) -> tuple[float, float]:
    """Neighbouring grid values of one constant."""
    x = np.unique([dict(v.constants)[name] for v in c.variants])
    j = int(np.argmin(np.abs(x - value)))
    return float(x[max(j - 1, 0)]), float(x[min(j + 1, len(x) - 1)])


def _between(low: float, high: float, name: str) -> Array:
    if name in ("tau", "f_0") and low > 0:
        return np.geomspace(low, high, FINE + 2)[1:-1]
    return np.linspace(low, high, FINE + 2)[1:-1]


def _shrunk(cell: tuple[float, float], value: float) -> tuple[float, float]:
    width = (cell[1] - cell[0]) / (FINE + 1)
    return value - width, value + width


def _columns(o: Observations, c: Candidate, constants: dict[str, float]) -> Array:
    return scaled_columns(o, absent_effect(c.effect, o.stimulus, c.source, **constants), c.parameters)


def _score(G: Array, b: Array) -> float:
    return float(mixed(log_bayes(G, b), SIZE_PRIOR))


def _relinearised(o: Observations, c: Candidate, p: Projection, rows: Rows) -> list[tuple[Variant, Array]]:
    """For an effect that bends with its own size: secants at several sizes, the calibration moved along with each."""
    cls = CATALOGUE[c.effect]
    if cls.linear or len(c.parameters) != 1:
        return []
    at = c.variants[0].index[0]
    tangent = float(p.b[at, 0] / max(p.G[at, at], 1e-12)) * c.parameters[0].sigma
    Z, y = o.reduce(o.Z), o.reduce(o.y[:, :, None])[:, 0]
    made, sizes = [], [k * tangent for k in SIZES]
    for n in range(3 * len(SIZES)):
        size = sizes[n]
        s = o.seen[cls.stage]
        X = _secant(o, c, size, s)
        for _ in range(2):
            shift = np.linalg.lstsq(Z, y - X[:, 0] * size / c.parameters[0].sigma, rcond=1e-9)[0]
            s = restimulated(o, shift, cls.stage)
            X = _secant(o, c, size, s)
        made.append((Variant(c.variants[0].constants, (), c.variants[0].weight / len(SIZES)), X))
        if n >= len(SIZES) - 1:
            G, b = extended(p.node, rows, X)
            found = float(b[0] / max(G[0, 0], 1e-12)) * c.parameters[0].sigma
            if abs(found - size) < 0.01 * abs(size) or n == 3 * len(SIZES) - 1:
                break
            sizes.append(found if n > len(SIZES) - 1 else _best_size(p, rows, made, sizes, c))
    return made


def _best_size(
    p: Projection, rows: Rows, made: Sequence[tuple[Variant, Array]], sizes: Sequence[float], c: Candidate
) -> float:
    """Size that the likeliest secant finds."""
    fits = [extended(p.node, rows, X) for _, X in made]
    G, b = fits[int(np.argmax([_score(*f) for f in fits]))]
    del sizes
    return float(b[0] / max(G[0, 0], 1e-12)) * c.parameters[0].sigma


def _secant(o: Observations, c: Candidate, size: float, s: Stimulus) -> Array:
    """Reduced column per prior sigma of the change that this size of the parameter makes."""
    cls, names = CATALOGUE[c.effect], o.stimulus.axis_names
    none: Effect = absent_effect(c.effect, o.stimulus)
    if size == 0:
        return scaled_columns(o, none, c.parameters)
    (made,) = with_values([none], c.parameters, np.array([size]), names)
    added = np.asarray(made.contribution(s)) - np.asarray(none.contribution(s))
    return o.reduce(o.through(cls.stage, added.real)[:, :, None]) / size * c.parameters[0].sigma
