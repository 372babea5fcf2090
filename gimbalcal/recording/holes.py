"""Rows in which a value is missing: they are left out, counted, and told of, and never stand for anything."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gimbalcal.errors import InputError, amount
from gimbalcal.number import Array
from gimbalcal.recording.columns import Column
from gimbalcal.recording.header import Header
from gimbalcal.recording.samples import Batch, place

BOOKKEEPING = ("time", "position", "weight")  # a row that lacks one of these cannot be placed, so it is refused
SPARSE = ("attitude",)  # logged less often than the rest: its rows stay without it
MOST = 0.5  # of all rows: beyond, the rows are not what they are taken for
SHOWN = 3  # places that the remark names


class Holes:
    """Takes rows with an empty value out of a stream, and remembers where they stood in the file."""

    def __init__(self, header: Header) -> None:
        self.header = header
        self.columns: tuple[Column, ...] = header.columns
        self.rows = 0  # of the file, so far
        self.left_out: list[Array] = []
        self.empty = {c.name: 0 for c in header.columns}

    def filled(self, stream: Iterable[Batch]) -> Iterator[Batch]:
        """The batches without their rows that lack a value; `InputError` where most rows do."""
        waiting: Batch = {}  # the last batch is let go once all rows are counted
        for batch in stream:
            if waiting and len(next(iter(waiting.values()))):
                yield waiting
            waiting = self._without(batch)
        if (gone := len(self.missing)) > MOST * self.rows:
            raise self._too_many(gone)
        if waiting and len(next(iter(waiting.values()))):
            yield waiting

    def whole(self, values: Array) -> Array:
        """A complete column less the same rows."""
        return np.delete(values, self.missing.astype(np.int64)) if self.left_out else values

    def place(self, start: int, stop: int | None = None) -> str:
        """Where rows `start` up to `stop` of those that are kept stand in the file."""
        last = None if stop is None else self._in_file(stop - 1) + 1
        return place(self.header.samples, self._in_file(start), last, self.header.skip, self.header.named)

    @property
    def missing(self) -> Array:
        """Rows of the file that are left out."""
        return np.concatenate(self.left_out) if self.left_out else np.zeros(0)

    @property
    def kept(self) -> NDArray[np.int64]:
        """Numbers in the file of the rows that are kept."""
        return np.delete(np.arange(self.rows), self.missing.astype(np.int64))

    def remarks(self) -> tuple[str, ...]:
        """How many rows are left out, where they are and which columns lack a value; nothing where none are."""
        gone = self.missing
        if not len(gone):
            return ()
        edges = [0, *(np.flatnonzero(np.diff(gone) > 1) + 1), len(gone)]
        runs = [(int(gone[a]), int(gone[b - 1]) + 1) for a, b in pairwise(edges)]
        told = [place(self.header.samples, *run, self.header.skip, self.header.named) for run in runs[:SHOWN]]
        first, *others = [told[0], *(text.removeprefix(f"{self.header.samples}, ") for text in told[1:])]
        where = ", ".join([first, *others]) + (
            f" and {amount(len(runs) - SHOWN, 'more place')}" if len(runs) > SHOWN else ""
        )
        is_are = "is" if len(gone) == 1 else "are"
        return (f"{where}: {amount(len(gone), 'row')} of {self.rows} {is_are} left out, empty in {self._culprits()}",)

    def _culprits(self) -> str:
        empty = {name: n for name, n in self.empty.items() if n}
        words = [f"{name} ({n})" if len(empty) > 1 else name for name, n in list(empty.items())[:6]]
        return ", ".join(words) + (f" and {len(empty) - 6} more columns" if len(empty) > 6 else "")

    def _too_many(self, gone: int) -> InputError:
        name, most = max(self.empty.items(), key=lambda item: item[1])
        where = f"{self.header.samples}, column {name}"
        if most == self.rows:
            return InputError(f"{where}: no row has a value; leave the column out of [columns]")
        return InputError(
            f"{where}: {most} of {self.rows} rows have no value, and {gone} rows lack one of some column; where "
            "sensors are logged at times of their own, bring them to common rows (a slow thermometer: repeat its last "
            "value), or leave the column out"
        )

    def _without(self, batch: Batch) -> Batch:
        n = len(next(iter(batch.values()), ()))
        empty = {c.name: np.isnan(batch[c.name]) for c in self.columns if np.isnan(batch[c.name].sum())}
        blank = np.all(list(empty.values()), axis=0) if len(empty) == len(self.columns) else np.zeros(n, dtype=bool)
        lacking = blank.copy()
        for c in self.columns:
            if c.name in empty and c.quantity not in (*BOOKKEEPING, *SPARSE):
                lacking |= empty[c.name]
        start, self.rows = self.rows, self.rows + n
        if not lacking.any():
            return batch
        self.left_out.append(start + np.flatnonzero(lacking))
        for name, each in empty.items():
            self.empty[name] += int(each[lacking].sum())
        return {name: x[~lacking] for name, x in batch.items()}

    def _in_file(self, row: int) -> int:
        gone = self.missing
        return row + int(np.searchsorted(gone - np.arange(len(gone)), row, side="right"))
