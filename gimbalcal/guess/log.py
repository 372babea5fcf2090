"""A log whose columns nobody described: the columns, and what each of them is taken for."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gimbalcal.number import Array
from gimbalcal.recording.dwell import Dwell
from gimbalcal.recording.record import FORCE, RATE
from gimbalcal.units import to_si


@dataclass(frozen=True)
class Guess:
    """What one column holds, in the terms of recording.toml, and why; the unit may be left open.

    open: whether the unit is the likeliest of several by the numbers alone, so that others may be tried. increments:
    whether the column holds what the quantity added up to since the row before, in its unit times seconds.
    """

    quantity: str
    axis: str
    unit: str
    why: str
    open: bool = False
    increments: bool = False

    @property
    def in_words(self) -> str:
        """Return quantity, axis and unit."""
        return " ".join(filter(None, [self.quantity.replace("_", " "), self.axis, f"[{self.unit}]" * bool(self.unit)]))


@dataclass(frozen=True, eq=False)
class Log:
    """Columns (n,) of a log by name, and the guesses about those that are known."""

    columns: Mapping[str, Array]
    guesses: Mapping[str, Guess]

    def names(self, *quantities: str) -> list[str]:
        """Return the columns of these quantities, in the order of the guesses."""
        return [name for name, g in self.guesses.items() if g.quantity in quantities]

    def values(self, quantity: str) -> list[Array]:
        """Return the columns (n,) of a quantity."""
        return [self.columns[name] for name in self.names(quantity)]

    def has(self, *quantities: str) -> bool:
        """Return whether a column of any of these quantities is known."""
        return bool(self.names(*quantities))

    def has_open_unit(self, quantity: str) -> bool:
        """Return whether the unit of a quantity follows from its numbers alone, and may be another."""
        return any(self.guesses[name].open for name in self.names(quantity))

    @property
    def clock(self) -> str:
        """Return the name of the column of time."""
        return self.names("time")[0]

    @property
    def seconds(self) -> Array:
        """Return the time (n,) [s]."""
        return np.asarray(to_si(self.columns[self.clock], self.guesses[self.clock].unit))

    @property
    def unknown(self) -> dict[str, Array]:
        """Return columns about which there is no guess."""
        return {name: x for name, x in self.columns.items() if name not in self.guesses}

    def including(self, guesses: Mapping[str, Guess], columns: Mapping[str, Array] | None = None) -> Log:
        """Return the log with further or other guesses, and columns."""
        return Log({**self.columns, **(columns or {})}, {**self.guesses, **guesses})

    def preceded_by(self, name: str, guess: Guess, values: Array | None = None) -> Log:
        """Return the log with a guess, and a column if its values are given, before all others."""
        columns = self.columns if values is None else {name: values, **_without(self.columns, name)}
        return Log(columns, {name: guess, **_without(self.guesses, name)})

    def without(self, *quantities: str) -> Log:
        """Return the log without the guesses of these quantities; their columns stay."""
        return replace(self, guesses={n: g for n, g in self.guesses.items() if g.quantity not in quantities})

    def thinned(self, rows: int, most: int) -> Log:
        """Return so many rows, or every `most`-th: means of forces and rates, and the first value of all else."""
        n = len(self.columns[self.clock])
        size = min(-(-n // rows), most)
        if size <= 1:
            return self
        means = {name: _means(self.columns[name], size) for name in self.names(FORCE, RATE)}
        return replace(
            self, columns={name: means.get(name, x[: n // size * size : size]) for name, x in self.columns.items()}
        )

    def shortened(self, dwells: Iterable[Dwell], rows: int) -> Log:
        """Return the log with `rows` rows of each dwell at either end, without those between them and their time."""
        kept = np.ones(len(self.columns[self.clock]), dtype=bool)
        for dwell in dwells:
            kept[dwell.start + rows : dwell.stop - rows] = False
        time = self.columns[self.clock]
        step = np.diff(time, prepend=2 * time[0] - time[1])
        return self.rows(kept).including({}, {self.clock: time[0] + np.cumsum(step[kept]) - step[0]})

    def rows(self, chosen: Array) -> Log:
        """Return some of the rows."""
        return replace(self, columns={name: x[chosen] for name, x in self.columns.items()})


def filled_rows(columns: Sequence[Array]) -> list[Array]:
    """Return columns (n,) at the rows in which all of them have a value."""
    filled = np.logical_and.reduce([np.isfinite(x) for x in columns])
    return list(columns) if np.all(filled) else [x[filled] for x in columns]


def _means(x: Array, size: int) -> Array:
    """Return the means of `size` successive rows of x (n,), those without a value left out."""
    blocks = x[: len(x) // size * size].reshape(-1, size)
    total = sum(blocks.T, start=np.zeros(len(blocks)))  # by columns: rows of a few numbers are slow to add up
    if np.isfinite(total).all():
        return np.asarray(total / size)
    known = np.isfinite(blocks)
    count = known.sum(axis=1)
    total = np.where(known, blocks, 0.0).sum(axis=1)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def _without(mapping: Mapping[str, Any], name: str) -> dict[str, Any]:
    return {key: value for key, value in mapping.items() if key != name}
