r"""Location of the misfit: in known noise a scan over positions, times and covariates, else the shapes that it follows.

Residuals of a known noise are whitened and the calibration is profiled out. The statistic of a cell is the misfit that
its columns could take away, chi^2 with as many degrees of freedom. Cells overlap and are many, so the p-value that
counts is that of the most extreme cell of a clean recording of this very design (Westfall and Young's minimum p), from
simulated scores. In a noise of unknown scale the statistic of a shape is an F ratio.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from gimbalcal.diagnose.evidence.node import Node
from gimbalcal.diagnose.evidence.projection import Projection, ReducedRows, log_bayes
from gimbalcal.diagnose.library.assemble import free_rows, orthonormal_basis
from gimbalcal.diagnose.library.candidates import Candidate
from gimbalcal.diagnose.library.shapes import shapes_of
from gimbalcal.diagnose.result import Mismatch
from gimbalcal.diagnose.search.ranking import projections_of
from gimbalcal.entries import Json
from gimbalcal.inference.algebra import beyond, orthonormal, orthonormal_columns
from gimbalcal.number import Array
from gimbalcal.p_value import chi_square_tail, probability
from gimbalcal.units import from_si
from gimbalcal.views.core import Fit, View
from gimbalcal.words import diagnosis_sentences

DRAWS = 400
CLEAN_PROBABILITY = 1e-4  # probability that a clean recording looks as bad: what leaves less does not explain the data
MAX_CELLS = 6  # cells that are listed, strongest first
WEAK_RATIO = 0.25  # of the strongest statistic: weaker cells see the same mismatch from further away
# of a column's square that the calibration leaves of it: less is rounding of what the model holds
MIN_SQUARE_LEFT = 1e-8
RANK = 1e-8  # of a cell's largest eigenvalue: less is a direction that it does not have
MAX_PATTERN_P = 1e-3  # p-value below which a pattern of the misfit is listed
MAX_PATTERNS = 3  # that are listed, strongest first
CHUNK = 256  # columns that are scanned at a time
WINDOWS = 12  # stretches of time of a static run


@dataclass(frozen=True)
class Cell:
    """One place to look: channel, axis, where in words and numbers."""

    channel: str
    axis: str
    where: Json
    words: str


@dataclass(frozen=True)
class Scan:
    """Cells with their statistics and family-wise p-values; `p_value` is that of the whole scan."""

    cells: tuple[Cell, ...]
    statistic: Array
    p_values: Array

    @property
    def p_value(self) -> float:
        """Probability that a clean recording has an equally extreme cell."""
        return float(self.p_values.min(initial=1.0))


def scan_data(o: Fit, rows: ReducedRows, node: Node, rng: np.random.Generator, explained: Array | None = None) -> Scan:
    """Scan the data (or what `explained` columns (R, p) leave of them) in one noise."""
    Q = rows.Q
    if explained is not None and explained.shape[1]:
        Q = np.concatenate([Q, orthonormal(beyond(Q, explained) / np.abs(explained).max())], axis=1)
    fitted = np.linalg.qr(node.whiten(Q))[0]
    data = beyond(fitted, node.whiten(rows.y[:, :1])), rng.standard_normal((len(Q), DRAWS))
    cells: list[Cell] = []
    scores, ranks = [np.zeros((0, 1 + DRAWS))], [np.zeros(0)]
    for batch, X in _scan_cells(o):
        score, rank = _cell_scores(_cleared_columns(node.whiten(X), fitted), data, len(batch))
        cells += batch
        scores.append(score)
        ranks.append(rank)
    all_scores, dof = np.concatenate(scores), np.concatenate(ranks)
    statistic = all_scores[:, 0]
    tails = chi_square_tail(statistic, dof)
    # of all cells of so many degrees of freedom, the largest statistic has the least tail
    least = np.min([chi_square_tail(all_scores[dof == k, 1:].max(axis=0), k) for k in np.unique(dof)], axis=0)
    family = (1 + (least[None, :] <= tails[:, None]).sum(axis=1)) / (1 + DRAWS)
    # beyond the draws: Sidak's bound over as many independent cells as the simulated minimum behaves like
    effective = max(1.0, float(np.log(0.5) / np.log1p(-np.clip(np.median(least), 1e-12, 0.5))))
    bound = -np.expm1(effective * np.log1p(-np.clip(tails, 0.0, 1 - 1e-15)))
    return Scan(tuple(cells), statistic, np.where(family <= 2 / (1 + DRAWS), np.minimum(bound, family), family))


def _cleared_columns(X: Array, fitted: Array) -> Array:
    """Whitened X (R, p) cleared of orthonormal columns, and zero where nothing but rounding is left."""
    size = (X**2).sum(axis=0)
    for _ in range(2):  # once more for what rounding left
        X = beyond(fitted, X)
    return np.asarray(X * ((X**2).sum(axis=0) > MIN_SQUARE_LEFT * size))


def _cell_scores(X: Array, data: Sequence[Array], cells: int) -> tuple[Array, Array]:
    """Misfit (cells, m) of m columns of white data that each cell's columns, equal parts of X (R, p), take away; ranks.

    X is cleared of the calibration, of which the data may hold any amount.
    """
    b = np.concatenate([X.T @ part for part in data], axis=1).reshape(cells, -1, 1 + DRAWS)
    X = X.reshape(len(X), cells, -1)
    G = np.einsum("rci,rcj->cij", X, X)
    lam = np.linalg.eigvalsh(G)
    rank = (lam > RANK * np.maximum(lam.max(axis=-1, keepdims=True), 1e-12)).sum(axis=-1)
    return np.asarray((b * (np.linalg.pinv(G, rcond=RANK, hermitian=True) @ b)).sum(axis=1)), rank


def _scan_cells(o: Fit) -> Iterator[tuple[list[Cell], Array]]:
    """Cells, and in equal parts their reduced columns (R, p): a few at a time, as of positions there may be many."""
    cells: list[Cell] = []
    columns: list[Array] = []
    for where, words, pattern in _scan_patterns(o):
        w = pattern.shape[1]
        if columns and (w != columns[0].shape[1] // len(o.view.channels) or w * len(cells) >= CHUNK):
            yield cells, np.concatenate(columns, axis=1)
            cells, columns = [], []
        X = np.zeros((*o.residual.shape, w * len(o.view.channels)))
        for k, (channel, axis) in enumerate(o.view.channels):
            X[:, k, w * k : w * (k + 1)] = pattern
            cells.append(Cell(channel, axis, where, words))
        columns.append(o.reduced(X))
    yield cells, np.concatenate(columns, axis=1)


def _scan_patterns(o: Fit) -> Iterator[tuple[Json, str, Array]]:
    """Functions (n, m) of row to be scanned in every channel."""
    s = o.view.stimulus
    t = s.time / s.time[-1]
    if o.view.kind.in_positions:
        for p in np.unique(s.position):
            yield {"positions": [int(p)]}, f"at position {p}", _column(s.position == p)
        start = np.exp(-s.since_move / max(1.0, 0.3 * float(s.since_move.max())))
        yield {"dwell": "start"}, "at the start of each dwell", _column(start)
    else:
        for k in range(WINDOWS):
            low, high = k / WINDOWS, (k + 1) / WINDOWS
            hours = [round(low * s.time[-1] / 3600, 1), round(high * s.time[-1] / 3600, 1)]
            yield {"hours": hours}, f"between {hours[0]:g} and {hours[1]:g} h", _column((t >= low) & (t < high))
        phase = np.arctan2(s.force[:, 1], s.force[:, 0])
        for n, ordinal in ((1, "first"), (2, "second"), (3, "third")):
            basis = np.stack([np.cos(n * phase), np.sin(n * phase)], axis=-1)
            yield {"harmonic": n}, f"at the {ordinal} harmonic of the sidereal turn", basis
        yield from _strongest_periods(o)
    yield {"time": "trend"}, "as a trend in time", _column(t)
    yield {"time": "slow"}, "slowly in time", np.cos(np.pi * np.outer(t, np.arange(1, 6)))
    if s.temperature is not None:
        yield {"covariate": "temperature"}, "with the temperature", _column(s.temperature - s.temperature.mean())
    for name, x in s.covariates.items():
        yield {"covariate": name}, f"with {name}", _column(x - x.mean())


def _strongest_periods(o: Fit) -> list[tuple[Json, str, Array]]:
    """The strongest periods of a static run between two rows and a quarter of the run."""
    s = o.view.stimulus
    n = len(s.time)
    y = o.view.noise.weighted(o.residual[:, :, None])[:, :, 0]
    power = (np.abs(np.fft.rfft(y - y.mean(axis=0), axis=0)) ** 2).sum(axis=1)
    out = []
    for k in np.argsort(-power[4:])[:3] + 4:
        period = n * float(np.median(np.diff(s.time))) / float(k)
        angle = 2 * np.pi * s.time / period
        basis = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        out.append(({"period_min": round(period / 60, 2)}, f"with a period of {period / 60:.3g} min", basis))
    return out


def _column(x: Array) -> Array:
    return np.asarray(x, dtype=float)[:, None]


def scanned_mismatches(s: Scan, at_least: int = 0) -> tuple[Mismatch, ...]:
    """Entries of `mismatch`: the significant cells (and `at_least` so many), positions of one channel joined."""
    order = [int(i) for i in np.argsort(-s.statistic)]
    order.sort(key=lambda i: float(s.p_values[i]))
    strong = WEAK_RATIO * float(s.statistic.max(initial=0.0))
    chosen = [i for n, i in enumerate(order) if (s.p_values[i] < 0.05 and s.statistic[i] > strong) or n < at_least]
    cells: dict[tuple[str, str, str], list[int]] = {}
    for i in chosen:
        c = s.cells[i]
        own = cells.setdefault((c.channel, c.axis, "positions" if "positions" in c.where else c.words), [])
        if not own or "positions" in c.where:
            own.append(i)
    return tuple(_mismatch_entry(s, own) for own in list(cells.values())[:MAX_CELLS])


def _mismatch_entry(s: Scan, own: Sequence[int]) -> Mismatch:
    """One entry: a cell, or several positions of one channel with the statistic of the strongest."""
    first, p_value = s.cells[own[0]], float(s.p_values[own[0]])
    where, words = dict(first.where), first.words
    if len(own) > 1:
        where = {"positions": sorted(p for i in own for p in s.cells[i].where["positions"])}
        words = f"at positions {', '.join(str(p) for p in where['positions'])}"
    in_words = diagnosis_sentences.off_over_scan(first.channel, first.axis, words, p_value)
    return Mismatch(first.channel, first.axis, where, round(float(s.statistic[own[0]]), 2), p_value, in_words)


def view_mismatches(m: Fit, sigma: Array) -> tuple[Mismatch, ...]:
    """Entries of `mismatch`: patterns of the baseline's misfit, or the channel that is off most where it has none."""
    return misfit_patterns(m) or largest_misfit(m, sigma)


def misfit_patterns(m: Fit) -> tuple[Mismatch, ...]:
    """The shapes that the misfit of the baseline follows, strongest first, by an F test each."""
    v, blocks = m.view, list[Array]()
    shapes = shapes_of(v, m.residual, orthonormal_basis(m.jacobian), blocks, free_rows(v, m.parameters))
    X = m.reduced(np.concatenate(blocks, axis=-1))
    white = projections_of(m, X, memory=False)  # in one scale, and in scales of the channels where these may differ
    dof = m.residual.size - orthonormal_columns(m.reduced(m.jacobian)).shape[1]
    out = []
    for c in shapes:
        at = c.variants[0].index
        ln, k = max((_ln_of_any_size(p, at), k) for k, p in enumerate(white))  # the scales that belong to the shape
        ln, likeliest = ln - white[k].log_evidence(), white[k]
        y2, taken = float(likeliest.misfit[0]), likeliest.explained(at)
        free = max(dof - len(at), 1)
        F = (taken / len(at)) / max((y2 - taken) / free, 1e-300)
        p = min(1.0, probability(F * len(at), len(at), free) * len(shapes))
        out.append((ln, F, p, c))
    listed = sorted((t for t in out if t[2] < MAX_PATTERN_P), key=lambda t: -t[0])[:MAX_PATTERNS]
    return tuple(_pattern_entry(m, c, F, p) for _, F, p, c in listed)


def _ln_of_any_size(p: Projection, index: Sequence[int]) -> float:
    """Return ln of prior x likelihood of a noise where the columns are present, at their likeliest size."""
    return p.log_evidence() + float(log_bayes(p, np.array(index), p.scale.any_size).max())


def _pattern_entry(m: Fit, c: Candidate, F: float, p: float) -> Mismatch:
    v = m.view
    if v.added is not None:  # in a sensor, and the rows are what a navigator makes of it
        size = float(from_si(float(np.sqrt(np.mean(m.residual**2))), v.unit))
        rows = _rows_off_most(v, np.abs(v.noise.weighted(m.residual)).max(axis=1))
        words = diagnosis_sentences.follows_sensor(v, c.channel, c.axis, size, c.rival)
        return Mismatch(c.channel, c.axis, _place_of_rows(v, rows), round(F, 2), p, words)
    i, size = _channel(m, c.axis)
    rows = _rows_off_most(v, np.abs(m.residual[:, i]))
    words = diagnosis_sentences.pattern_sentence(v, c.axis, size, c.rival)
    return Mismatch(v.channels[0][0], c.axis, _place_of_rows(v, rows), round(F, 2), p, words)


def largest_misfit(m: Fit, sigma: Array) -> tuple[Mismatch, ...]:
    """Return the channel with the largest misfit of the baseline, relative to the scatter in the end."""
    v, square = m.view, ((m.residual / sigma) ** 2).mean(axis=0)
    axis = v.channels[int(np.argmax(square))][1]
    i, size = _channel(m, axis)
    rows = _rows_off_most(v, np.abs(m.residual[:, i]))
    ratio = float(square[i])
    p = min(1.0, probability(ratio * len(m.residual), len(m.residual)) * len(v.channels))
    words = diagnosis_sentences.largest_misfit_sentence(v, axis, size, float(np.sqrt(ratio)), rows)
    return (Mismatch(v.channels[0][0], axis, _place_of_rows(v, rows), round(ratio, 2), p, words),)


def _rows_off_most(v: View, size: Array) -> Array:
    """Return the rows of the three largest sizes (n,), at most one of each numbered position, star or stretch."""
    order = np.argsort(-size)
    first = slice(None) if v.label is None else np.sort(np.unique(v.label[order], return_index=True)[1])
    return np.asarray(order[first][:3])


def _channel(m: Fit, axis: str) -> tuple[int, float]:
    i = [a for _, a in m.view.channels].index(axis)
    return i, float(from_si(float(np.sqrt(np.mean(m.residual[:, i] ** 2))), m.view.unit))


def _place_of_rows(v: View, rows: Array) -> dict[str, list[float]]:
    if v.label is None:
        return {"time_s": [round(float(x), 3) for x in np.sort(v.time[rows])]}
    return {"positions": [int(k) for k in v.label[rows]]}
