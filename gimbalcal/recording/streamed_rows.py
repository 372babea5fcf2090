"""Keep streamed rows: all of them, the mean of each block of time, or means over rests."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from gimbalcal.number import Array


class AllRows:
    """Keeps every row of the stream in one array of each column: `expected` rows, or as many more as come.

    A first batch of all of them is kept as it is. whole: the column of whole numbers.
    """

    def __init__(self, expected: int = 0, whole: str | None = None) -> None:
        self.expected, self.whole = expected, whole
        self.columns: dict[str, Array] = {}
        self.rows = 0

    def add(self, batch: Mapping[str, Array], begins: Array) -> None:
        """Take in a batch."""
        after = self.rows + len(begins)
        for name, x in batch.items():
            if name not in self.columns and after >= self.expected:
                self.columns[name] = x
                continue
            if name not in self.columns:
                self.columns[name] = np.empty(max(self.expected, after), np.int64 if name == self.whole else np.float64)
            column = self.columns[name]
            if len(column) < after:
                if not column.flags.owndata:
                    column = self.columns[name] = column.copy()
                column.resize(after + after // 2, refcheck=False)
            column[self.rows : after] = x
        self.rows = after

    def table(self) -> dict[str, Array]:
        """Return all columns, whole."""
        return {name: x if len(x) == self.rows else x[: self.rows] for name, x in self.columns.items()}


class Blocks:
    """Means over blocks of `length` (in the unit of the `time` column), weighted by the `weight` column if any.

    A block ends where ``floor((t - t0) / length)`` changes; t0 is the last row that began anew (after a gap, in
    another position), so that no block reaches across one. `turns` gives the size of a full turn for columns that
    are angles: these are unwrapped before the mean and end near the first reading of their block, so that 359 and
    1 deg average to 360, not 180.
    """

    def __init__(self, length: float, time: str, weight: str | None, turns: Mapping[str, float]) -> None:
        self.length, self.time, self.weight, self.turns = length, time, weight, turns
        self.t0 = 0.0
        self.last: dict[str, float] = {}  # last unwrapped reading of each angle
        self.index = 0.0
        self.sums: dict[str, list[Array]] = {}

    def add(self, batch: Mapping[str, Array], begins: Array) -> None:
        """Take in a batch."""
        if not len(begins):
            return
        new = self._new(batch, begins)
        edges = np.flatnonzero(new)
        joined = not new[0] and bool(self.sums)
        edges = edges if new[0] else np.concatenate([[0], edges])
        weight = batch[self.weight] if self.weight else None
        for name, x in batch.items():
            self._sum(name, self._unwrapped(name, x), edges, weight, joined)
            if name in self.turns:
                self._append(f"first {name}", x[edges], joined, lambda old, _new: old)
        total = np.add.reduceat(weight, edges) if weight is not None else np.diff(np.append(edges, len(begins)))
        self._append("", total.astype(float), joined, lambda old, new: old + new)

    def _new(self, batch: Mapping[str, Array], begins: Array) -> Array:
        """Return which rows of a batch begin a block."""
        return self._changes(batch[self.time], begins)

    def _changes(self, t: Array, begins: Array) -> Array:
        """Return where the next block begins by a growing clock t, or where a row begins anew."""
        index = np.floor((t - self._starts(t, begins)) / self.length)
        new = begins.copy()
        new[0] |= index[0] != self.index
        new[1:] |= index[1:] != index[:-1]
        self.index = float(index[-1])
        return new

    def _starts(self, t: Array, begins: Array) -> Array:
        """Return the time of the last row that began anew, for each row."""
        if not self.sums:
            self.t0 = float(t[0])
        if not begins.any():
            return np.asarray(self.t0)
        last = np.maximum.accumulate(np.where(begins, np.arange(len(t)), -1))
        t0 = np.where(last >= 0, t[last], self.t0)
        self.t0 = float(t0[-1])
        return t0

    def _sum(self, name: str, x: Array, edges: Array, weight: Array | None, joined: bool) -> None:
        total = np.add.reduceat(x if weight is None else x * weight, edges)
        self._append(name, total, joined, lambda old, new: old + new)

    def _append(self, name: str, values: Array, joined: bool, join: Callable[[float, float], float]) -> None:
        parts = self.sums.setdefault(name, [])
        if joined:
            parts[-1][-1] = join(parts[-1][-1], values[0])
            values = values[1:]
        if len(values):
            parts.append(values)

    def _unwrapped(self, name: str, x: Array) -> Array:
        if name not in self.turns:
            return x
        turn = self.turns[name]
        last = self.last.get(name, float(x[0]))
        if turns := np.round((last - x[0]) / turn):
            x = x + turn * turns
        if max(float(x.max()), last) - min(float(x.min()), last) > turn / 2:
            x = np.unwrap(np.concatenate([[last], x]), period=turn)[1:]
        self.last[name] = float(x[-1])
        return x

    def table(self) -> dict[str, Array]:
        """One row per block; the key ``""`` holds the weight."""
        joined = {name: np.concatenate(parts) for name, parts in self.sums.items()}
        weight = joined.pop("")
        means = {name: total / weight for name, total in joined.items() if not name.startswith("first ")}
        for name, turn in self.turns.items():
            means[name] += turn * np.round((joined[f"first {name}"] - means[name]) / turn)
        if self.weight:
            means[self.weight] = weight
        return means | {"": weight}


class Rests(Blocks):
    """Means over `rows` consecutive rows of each rest; its first and last row, and each on the way, as they are.

    On the way the position is 0; a turn goes from the last row of a rest to the first of the next.
    """

    def __init__(self, rows: int, position: str, weight: str | None, turns: Mapping[str, float]) -> None:
        super().__init__(rows, "", weight, turns)
        self.position = position
        self.rows, self.alone = 0, False  # rows so far, and whether the last of them stands by itself
        self.last_row: Mapping[str, Array] = {}  # the last row, which is that of a rest or not
        self.last_begins = np.zeros(0, dtype=bool)

    def add(self, batch: Mapping[str, Array], begins: Array) -> None:
        """Take in a batch."""
        if not len(begins):
            return
        begins = np.concatenate([self.last_begins, begins])
        if self.last_row:
            batch = {name: np.concatenate([self.last_row[name], x]) for name, x in batch.items()}
        self.last_row, self.last_begins = {name: x[-1:] for name, x in batch.items()}, begins[-1:]
        self._take({name: x[:-1] for name, x in batch.items()}, begins[:-1], begins[1:])

    def table(self) -> dict[str, Array]:
        """One row per block; the key ``""`` holds the weight."""
        if self.last_row:
            self._take(self.last_row, self.last_begins, np.ones(1, dtype=bool))
            self.last_row = {}
        return super().table()

    def _take(self, batch: Mapping[str, Array], begins: Array, ends: Array) -> None:
        self.ends = ends  # which rows are followed by one that begins anew
        super().add(batch, begins)

    def _new(self, batch: Mapping[str, Array], begins: Array) -> Array:
        row = np.arange(self.rows, self.rows + len(begins), dtype=float)
        self.rows += len(begins)
        alone = begins | self.ends | (batch[self.position] == 0)
        after = np.concatenate([[self.alone], alone[:-1]])
        self.alone = bool(alone[-1])
        return self._changes(row, begins) | alone | after
