"""Rows in which a value is missing or leaps away: left out, counted, and told of, they never stand for anything."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gimbalcal.checks.spikes import MAX_STEP_FAST_S, predicted_by_neighbours, reliably_predicted, spikes
from gimbalcal.errors import InputError, amount
from gimbalcal.number import Array
from gimbalcal.recording.columns import SPARSE, Column
from gimbalcal.recording.header import Header
from gimbalcal.recording.lines import place
from gimbalcal.recording.samples import Batch
from gimbalcal.units import from_si, is_raw, to_si

BOOKKEEPING = ("time", "position", "weight")  # a row that lacks one of these cannot be placed, so it is refused
MOST = 0.5  # of all rows: beyond, the rows are not what they are taken for
LEAPING = {"specific_force": 100.0, "angular_rate": 35.0}  # SI; a reading beyond is no reading at all
STEADY = {"gimbal_angle": np.inf, "attitude_error": np.inf}  # of a static run, where these go on and on as well
HELD = {"gimbal_angle": np.inf}  # of positions, as long as each is held
SETTING, MATTERS = float(to_si(1.0, "arcsec")), 10.0  # usual repeatability [rad]; times it, what shows in a mean of 60
SHOWN = 3  # places that the remark names


class Dropouts:
    """Takes rows with an empty value out of a stream, and remembers where they stood in the file."""

    def __init__(self, header: Header) -> None:
        self.header = header
        self.columns: tuple[Column, ...] = header.columns
        self.rows = 0  # of the file, so far
        self.left_out: list[Array] = []
        self.empty = {c.name: 0 for c in header.columns}
        self.limits = LEAPING | (STEADY if header.kind.stabilised else HELD if header.kind.in_positions else {})
        self.leaps = {c.name: 0 for c in header.columns if c.quantity in self.limits}
        self.leapt: list[Array] = []
        self.filled_in: list[Array] = []

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
        values = values[: self.rows]  # without blank lines at the end
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
        leapt = np.concatenate(self.leapt) if self.leapt else np.zeros(0)
        empty = np.setdiff1d(self.missing, leapt)
        jump = f"where {self._culprits(self.leaps)} leaps away for a row or two and back"
        filled = np.concatenate(self.filled_in) if self.filled_in else np.zeros(0)
        return (
            *self._told(empty, f"left out, empty in {self._culprits(self.empty)}"),
            *self._told(leapt, f"left out, {jump}"),
            *self._told(filled, f"taken from neighbours, {jump}"),
        )

    def _told(self, gone: Array, why: str) -> tuple[str, ...]:
        """A sentence on rows of the file that are not taken as they are."""
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
        return (f"{where}: {amount(len(gone), 'row')} of {self.rows} {is_are} {why}",)

    def _culprits(self, counted: Mapping[str, int]) -> str:
        empty = {name: n for name, n in counted.items() if n}
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
        leaping = self._leaping(batch, ~lacking)
        start, self.rows = self.rows, self.rows + n
        leapt = np.logical_or.reduce([np.zeros(n, dtype=bool), *leaping.values()])
        if leapt.any() and self.header.kind.rotating:  # a navigator has to know every step
            self.filled_in.append(start + np.flatnonzero(leapt))
            batch = dict(batch) | {n: self._bridged(batch, n, ~lacking, found) for n, found in leaping.items()}
        elif leapt.any():
            self.leapt.append(start + np.flatnonzero(leapt))
            lacking |= leapt
        if not lacking.any():
            return batch
        self.left_out.append(start + np.flatnonzero(lacking))
        for name, each in empty.items():
            self.empty[name] += int(each[lacking].sum())
        return {name: x[~lacking] for name, x in batch.items()}

    def _leaping(self, batch: Batch, full: NDArray[np.bool_]) -> dict[str, NDArray[np.bool_]]:
        """Rows by column in which a sensor leaps away, for a row or two, within one position."""
        if self.header.kind.sighting or not self.leaps:
            return {}
        rows = np.flatnonzero(full)
        same, held = np.ones(len(rows), dtype=bool), np.zeros(len(rows), dtype=bool)
        position, clock = self.header.column("position"), self.header.column("time")
        if position is not None and self.header.kind.in_positions and len(rows) > 2:  # a rest may be a row
            p = batch[position.name][rows]
            same[1:-1] = (p[1:-1] == p[:-2]) & (p[1:-1] == p[2:])
            held = p > 0
        step = np.median(np.diff(batch[clock.name][rows])) if clock is not None and len(rows) > 1 else np.inf
        slow = clock is None or float(to_si(float(step), clock.unit)) > MAX_STEP_FAST_S
        over = slow & ~held if self.header.kind.in_positions else np.zeros(len(rows), dtype=bool)
        triads: dict[tuple[str, str], list[str]] = {}
        for c in self.columns:
            if c.name in self.leaps:
                triads.setdefault((c.quantity, c.sensor), []).append(c.name)
        still = slow and self.header.kind.at_rest
        leaping = dict[str, NDArray[np.bool_]]()
        for (quantity, _), names in triads.items():
            if quantity in HELD and self.header.kind.in_positions:
                leaping |= self._in_rests(batch, names, rows, held)
            else:
                leaping |= spikes({n: batch[n][rows] for n in names}, still)
        out = dict[str, NDArray[np.bool_]]()
        for c in self.columns:
            if c.name in self.leaps:
                limit = np.inf if is_raw(c.unit) else from_si(self.limits[c.quantity], c.unit)
                within = np.abs(batch[c.name][rows]) < limit  # what is beyond anything is refused, not left out
                found = leaping[c.name] & same & within & ~(over & (c.quantity == "angular_rate"))
                self.leaps[c.name] += int(np.count_nonzero(found))
                out[c.name] = np.zeros(len(full), dtype=bool)
                out[c.name][rows[found]] = True
        return out

    def _in_rests(
        self, batch: Batch, names: list[str], rows: NDArray[np.int64], held: NDArray[np.bool_]
    ) -> dict[str, NDArray[np.bool_]]:
        """Rows in which a gimbal that is held reads something else; of one on the way nobody knows."""
        position = self.header.column("position")
        if position is None or not held.any():
            return {n: np.zeros(len(rows), dtype=bool) for n in names}
        p = batch[position.name][rows]
        starts = np.flatnonzero(np.diff(p, prepend=-1.0))
        out = dict[str, NDArray[np.bool_]]()
        for n in names:
            unit = next(c.unit for c in self.columns if c.name == n)
            turn, x = float(from_si(2 * np.pi, unit)), batch[n][rows]
            level = np.repeat([np.median(part) for part in np.split(x, starts[1:])], np.diff(starts, append=len(p)))
            told = held & np.isfinite(x) & np.isfinite(level)  # an infinite reading is refused, and by name
            off = np.where(told, x, 0.0) - np.where(told, level, 0.0)
            off = (off + turn / 2) % turn - turn / 2
            least = float(from_si(MATTERS * self.header.noise.get("gimbal_angle", SETTING), unit))
            out |= spikes({n: off}, slow=True, least=least)
        return {n: found & held for n, found in out.items()}

    def _bridged(self, batch: Batch, name: str, full: NDArray[np.bool_], leapt: NDArray[np.bool_]) -> Array:
        """A column with the rows that leapt as their neighbours tell them; `InputError` where these do not agree."""
        rows = np.flatnonzero(leapt[full])
        out, kept = batch[name].copy(), batch[name][full]
        untold = rows[~reliably_predicted(kept, rows)] if len(rows) else rows
        if len(untold):
            row = self.rows - len(full) + int(np.flatnonzero(full)[untold[0]])
            raise InputError(
                f"{place(self.header.samples, row, None, self.header.skip, self.header.named)}, column {name}: "
                f"{kept[untold[0]]:.6g} leaps away for a row or two and back while the motion changes, so that its "
                "neighbours do not tell what it was; correct it, or cut the recording there"
            )
        out[leapt] = predicted_by_neighbours(kept, rows)
        return out

    def _in_file(self, row: int) -> int:
        gone = self.missing
        return row + int(np.searchsorted(gone - np.arange(len(gone)), row, side="right"))
