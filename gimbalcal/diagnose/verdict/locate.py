r"""Where the mismatch is, in a known noise: residuals scanned over places, times and covariates.

Residuals are whitened and the calibration is profiled out. The statistic of a cell is the misfit that its columns could
take away, chi^2 with as many degrees of freedom. Cells overlap and are many, so the p-value that counts is that of the
most extreme cell of a clean recording of this very design (Westfall and Young's minimum p), from simulated scores.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from gimbalcal.diagnose.evidence.noise import Node
from gimbalcal.diagnose.evidence.projection import ReducedRows, project, rows_like
from gimbalcal.diagnose.rows.observations import Observations
from gimbalcal.inference.algebra import eigh, orthonormal
from gimbalcal.number import Array

DRAWS = 400
LISTED = 6  # cells that are listed, strongest first
WEAK = 0.25  # of the strongest statistic: weaker cells see the same mismatch from further away
HELD = 1e-8  # of a column's square that the calibration leaves of it: less is rounding of what the model holds
WINDOWS = 12  # stretches of time of a static run


@dataclass(frozen=True)
class Cell:
    """One place to look: channel, axis, where in words and numbers, and the columns it occupies in the scan."""

    channel: str
    axis: str
    where: Mapping[str, Any]
    words: str
    index: tuple[int, ...]


@dataclass(frozen=True)
class Scan:
    """Cells with their statistics and family-wise p-values; `p_value` is that of the whole scan."""

    cells: tuple[Cell, ...]
    statistic: Array
    p_values: Array

    @property
    def p_value(self) -> float:
        """Probability that a clean recording looks as bad somewhere."""
        return float(self.p_values.min(initial=1.0))


def scan(
    o: Observations, rows: ReducedRows, node: Node, rng: np.random.Generator, explained: Array | None = None
) -> Scan:
    """Scan the data (or what is left beside `explained` columns (R, p)) in one noise."""
    cells, X = _cells(o)
    if explained is not None and explained.shape[1]:
        rows = _beside(rows, explained)
    p = project(node, rows_like(rows, X))
    shown = np.diag(p.G) > HELD * (node.whiten(X) ** 2).sum(axis=0)
    G = p.G * np.outer(shown, shown)
    statistic = np.array([_score(G, p.b[:, :1], c.index)[0] for c in cells])
    dof = np.array([_rank(G, c.index) for c in cells])
    lam, V = eigh(G)
    drawn = V @ (np.sqrt(np.maximum(lam, 0.0))[:, None] * rng.standard_normal((len(lam), DRAWS)))
    clean = np.stack([_score(G, drawn, c.index) for c in cells])
    tails, clean_tails = _tail(statistic, dof), _tail(clean, dof[:, None])
    least = clean_tails.min(axis=0)
    family = (1 + (least[None, :] <= tails[:, None]).sum(axis=1)) / (1 + DRAWS)
    # beyond the draws: Sidak's bound over as many independent cells as the simulated minimum behaves like
    effective = max(1.0, float(np.log(0.5) / np.log1p(-np.clip(np.median(least), 1e-12, 0.5))))
    bound = -np.expm1(effective * np.log1p(-np.clip(tails, 0.0, 1 - 1e-15)))
    return Scan(tuple(cells), statistic, np.where(family <= 2 / (1 + DRAWS), np.minimum(bound, family), family))


def _beside(rows: ReducedRows, X: Array) -> ReducedRows:
    """Rows whose calibration also holds these columns."""
    Q = np.concatenate([rows.Q, orthonormal((X - rows.Q @ (rows.Q.T @ X)) / np.abs(X).max())], axis=1)
    y = rows.y - Q @ (Q.T @ rows.y)
    return ReducedRows(rows.low, rows.high, Q.shape[1], rows.P, Q, y)


def _tail(statistic: Array, dof: Array) -> Array:
    from scipy.special import gammaincc

    return np.asarray(np.where(dof > 0, gammaincc(np.maximum(dof, 1) / 2, statistic / 2), 1.0))


def _score(G: Array, b: Array, index: Sequence[int]) -> Array:
    at = np.array(index)
    C = np.linalg.pinv(G[np.ix_(at, at)], rcond=1e-8, hermitian=True)
    return np.asarray(np.einsum("im,ij,jm->m", b[at], C, b[at]))


def _rank(G: Array, index: Sequence[int]) -> int:
    at = np.array(index)
    lam = np.linalg.eigvalsh(G[np.ix_(at, at)])
    return int((lam > 1e-8 * max(float(lam.max(initial=0.0)), 1e-12)).sum())


def _cells(o: Observations) -> tuple[list[Cell], Array]:
    cells: list[Cell] = []
    columns: list[Array] = []
    for where, words, basis in _patterns(o):
        for k, (channel, axis) in enumerate(o.channels):
            X = np.zeros((*o.y.shape, basis.shape[1]))
            X[:, k] = basis
            at = tuple(range(len(columns), len(columns) + basis.shape[1]))
            columns += list(o.reduce(X).T)
            cells.append(Cell(channel, axis, where, words, at))
    return cells, np.stack(columns, axis=-1)


def _patterns(o: Observations) -> list[tuple[dict[str, Any], str, Array]]:
    """Functions (n, m) of row to be scanned in every channel."""
    s = o.stimulus
    t = s.time / s.time[-1]
    out: list[tuple[dict[str, Any], str, Array]] = []
    if o.kind == "multi-position":
        out += [({"positions": [int(p)]}, f"at position {p}", _column(s.position == p)) for p in np.unique(s.position)]
        start = np.exp(-s.since_move / max(1.0, 0.3 * float(s.since_move.max())))
        out.append(({"dwell": "start"}, "at the start of each dwell", _column(start)))
    else:
        for k in range(WINDOWS):
            low, high = k / WINDOWS, (k + 1) / WINDOWS
            hours = [round(low * s.time[-1] / 3600, 1), round(high * s.time[-1] / 3600, 1)]
            window = _column((t >= low) & (t < high))
            out.append(({"hours": hours}, f"between {hours[0]:g} and {hours[1]:g} h", window))
        phase = np.arctan2(s.force[:, 1], s.force[:, 0])
        for n in (1, 2, 3):
            basis = np.stack([np.cos(n * phase), np.sin(n * phase)], axis=-1)
            out.append(({"harmonic": n}, f"at the {_ordinal(n)} harmonic of the sidereal turn", basis))
        out += _lines(o)
    out.append(({"time": "trend"}, "as a trend in time", _column(t)))
    out.append(({"time": "slow"}, "slowly in time", np.cos(np.pi * np.outer(t, np.arange(1, 6)))))
    if s.temperature is not None:
        warmth = _column(s.temperature - s.temperature.mean())
        out.append(({"covariate": "temperature"}, "with the temperature", warmth))
    for name, x in s.covariates.items():
        out.append(({"covariate": name}, f"with {name}", _column(x - x.mean())))
    return out


def _lines(o: Observations) -> list[tuple[dict[str, Any], str, Array]]:
    """The strongest periods of a static run between two rows and a quarter of the run."""
    s = o.stimulus
    n = len(s.time)
    y = o.single(o.y[:, :, None])[:, :, 0]
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


def _ordinal(n: int) -> str:
    return {1: "first", 2: "second", 3: "third"}[n]


def mismatches(s: Scan, at_least: int = 0) -> tuple[dict[str, Any], ...]:
    """Entries of `mismatch`: the significant cells (and `at_least` so many), positions of one channel joined."""
    order = [int(i) for i in np.argsort(-s.statistic)]
    order.sort(key=lambda i: float(s.p_values[i]))
    strong = WEAK * float(s.statistic.max(initial=0.0))
    chosen = [i for n, i in enumerate(order) if (s.p_values[i] < 0.05 and s.statistic[i] > strong) or n < at_least]
    out: dict[tuple[str, str, str], dict[str, Any]] = {}
    for i in chosen:
        c = s.cells[i]
        key = (c.channel, c.axis, "positions" if "positions" in c.where else c.words)
        if key in out:
            out[key]["where"]["positions"] = sorted([*out[key]["where"]["positions"], *c.where["positions"]])
            continue
        out[key] = {
            "channel": c.channel, "axis": c.axis, "where": dict(c.where), "words": c.words,
            "statistic": round(float(s.statistic[i]), 2), "p_value": float(s.p_values[i]),
        }  # fmt: skip
    return tuple(_sentence(m) for m in list(out.values())[:LISTED])


def _sentence(m: dict[str, Any]) -> dict[str, Any]:
    words = m.pop("words")
    places = m["where"].get("positions")
    if places and len(places) > 1:
        words = f"at positions {', '.join(str(p) for p in places)}"
    p = "p < 1e-6" if m["p_value"] < 1e-6 else f"p = {m['p_value']:.1g}"
    channel = m["channel"].replace("_", " ").capitalize()
    m["in_words"] = f"{channel} {m['axis']} is off {words} ({p} over the whole scan)"
    return m
