"""Rows in which a value is missing or a spike stands: they are left out or filled, counted, and named in a remark."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gimbalcal.checks.spikes import MAX_STEP_FAST_S, predicted_by_neighbours, reliably_predicted, spikes
from gimbalcal.errors import InputError, number_of
from gimbalcal.number import Array
from gimbalcal.recording.columns import SPARSE, Column
from gimbalcal.recording.header import Header
from gimbalcal.recording.lines import rows_in_words
from gimbalcal.recording.noise_levels import SETTING_SIGMA_RAD
from gimbalcal.recording.samples import Batch
from gimbalcal.units import from_si, is_raw

Mask = NDArray[np.bool_]
Masks = dict[str, Mask]

BOOKKEEPING = ("time", "position", "weight")  # a row that lacks one of these cannot be placed, so it is refused
MAX_SHARE_MISSING = 0.5  # of all rows: beyond, the rows are not what they are taken for
MAX_SPIKE = {"specific_force": 100.0, "angular_rate": 35.0}  # SI; a reading beyond is refused, not left out
SPIKES_OF_A_RUN = {"gimbal_angle": np.inf, "attitude_error": np.inf}  # of a static run these go on and on as well
SPIKES_OF_DWELLS = {"gimbal_angle": np.inf}  # of positions, as long as each is held
RELEVANT_SIGMAS = 10.0  # of the repeatability: what shows in a mean of 60
MAX_PLACES, MAX_COLUMNS = 3, 6  # that a remark names


class Dropouts:
    """Take rows with an empty value or a spike out of a stream, and remember where they stood in the file."""

    def __init__(self, header: Header) -> None:
        self.header = header
        self.columns: tuple[Column, ...] = header.columns
        self.rows = 0  # of the file, so far
        of_kind = SPIKES_OF_A_RUN if header.kind.stabilised else SPIKES_OF_DWELLS if header.kind.in_positions else {}
        self.limits = MAX_SPIKE | of_kind
        self.checked = () if header.kind.sighting else tuple(c for c in header.columns if c.quantity in self.limits)
        self.empty_values = {c.name: 0 for c in header.columns}
        self.spikes = {c.name: 0 for c in self.checked}
        # rows of the file: left out, those of them for a spike, and those filled in
        self.left_out, self.left_out_spikes, self.filled_in = list[Array](), list[Array](), list[Array]()

    def filled(self, stream: Iterable[Batch]) -> Iterator[Batch]:
        """Yield the batches without their rows that lack a value; `InputError` where most rows do."""
        waiting: Batch = {}  # the last batch goes on once all rows are counted
        for batch in stream:
            if waiting and len(next(iter(waiting.values()))):
                yield waiting
            waiting = self._complete(batch)
        if (missing := len(self.missing)) > MAX_SHARE_MISSING * self.rows:
            raise self._too_many(missing)
        if waiting and len(next(iter(waiting.values()))):
            yield waiting

    def whole(self, values: Array) -> Array:
        """Return a complete column less the same rows."""
        values = values[: self.rows]  # without blank lines at the end
        return np.delete(values, self.missing) if self.left_out else values

    def place(self, start: int, stop: int | None = None) -> str:
        """Return where rows `start` up to `stop` of those that are kept stand in the file."""
        last = None if stop is None else self._in_file(stop - 1) + 1
        return self._place(self._in_file(start), last)

    @property
    def missing(self) -> NDArray[np.int64]:
        """Return rows of the file that are left out."""
        return _joined_arrays(self.left_out)

    @property
    def kept(self) -> NDArray[np.int64]:
        """Return numbers in the file of the rows that are kept."""
        return np.delete(np.arange(self.rows), self.missing)

    def remarks(self) -> tuple[str, ...]:
        """Return how many rows are left out or filled in, where they are and why; nothing where none are."""
        spiked, spike = (
            _joined_arrays(self.left_out_spikes),
            f"where {_columns_with_counts(self.spikes)} leaps away for a row or two and back",
        )
        groups = (
            (np.setdiff1d(self.missing, spiked), f"left out, empty in {_columns_with_counts(self.empty_values)}"),
            (spiked, f"left out, {spike}"),
            (_joined_arrays(self.filled_in), f"taken from neighbours, {spike}"),
        )
        return tuple(self._remark(rows, why) for rows, why in groups if len(rows))

    def _remark(self, rows: NDArray[np.int64], why: str) -> str:
        """Return a sentence on rows of the file that are not used as they are."""
        edges = [0, *(np.flatnonzero(np.diff(rows) > 1) + 1), len(rows)]
        runs = [(int(rows[a]), int(rows[b - 1]) + 1) for a, b in pairwise(edges)]
        first, *others = [self._place(*run) for run in runs[:MAX_PLACES]]
        where = ", ".join([first, *(text.removeprefix(f"{self.header.samples}, ") for text in others)])
        more = f" and {number_of(len(runs) - MAX_PLACES, 'more place')}" if len(runs) > MAX_PLACES else ""
        is_are = "is" if len(rows) == 1 else "are"
        return f"{where}{more}: {number_of(len(rows), 'row')} of {self.rows} {is_are} {why}"

    def _too_many(self, missing: int) -> InputError:
        name, most = max(self.empty_values.items(), key=lambda item: item[1])
        where = f"{self.header.samples}, column {name}"
        if most == self.rows:
            return InputError(f"{where}: no row has a value; leave the column out of [columns]")
        return InputError(
            f"{where}: {most} of {self.rows} rows have no value, and {missing} rows lack one of some column; where "
            "sensors are logged at times of their own, bring them to common rows (a slow thermometer: repeat its last "
            "value), or leave the column out"
        )

    def _complete(self, batch: Batch) -> Batch:
        """Return a batch without rows that lack a value; spikes are left out, or filled in for a navigator."""
        n = len(next(iter(batch.values()), ()))
        empty = {c.name: np.isnan(batch[c.name]) for c in self.columns if np.isnan(batch[c.name].sum())}
        lacking = np.all(list(empty.values()), axis=0) if len(empty) == len(self.columns) else np.zeros(n, dtype=bool)
        for c in self.columns:
            if c.name in empty and c.quantity not in (*BOOKKEEPING, *SPARSE):
                lacking |= empty[c.name]
        by_column = self._find_spikes(batch, np.flatnonzero(~lacking) if lacking.any() else np.arange(n))
        start, self.rows = self.rows, self.rows + n
        spiked = np.logical_or.reduce([np.zeros(n, dtype=bool), *by_column.values()])
        if spiked.any() and self.header.kind.rotating:  # a navigator has to know every step
            self.filled_in.append(start + np.flatnonzero(spiked))
            batch = dict(batch) | {name: self._filled(batch, name, ~lacking, rows) for name, rows in by_column.items()}
        elif spiked.any():
            self.left_out_spikes.append(start + np.flatnonzero(spiked))
            lacking |= spiked
        if not lacking.any():
            return batch
        self.left_out.append(start + np.flatnonzero(lacking))
        for name, each in empty.items():
            self.empty_values[name] += int(each[lacking].sum())
        return {name: x[~lacking] for name, x in batch.items()}

    def _find_spikes(self, batch: Batch, rows: NDArray[np.int64]) -> Masks:
        """Return the rows by column in which a sensor has a spike, within one position; `rows` of the batch are full.

        Columns without a spike are not there.
        """
        kind, position, clock = self.header.kind, self.header.column("position"), self.header.column("time")
        n = len(next(iter(batch.values()), ()))
        if not self.checked:
            return {}
        full = batch if len(rows) == n else {name: x[rows] for name, x in batch.items()}
        longer = np.diff(full[clock.name]) > from_si(MAX_STEP_FAST_S, clock.unit) if clock is not None else np.ones(1)
        slow = len(rows) < 2 or bool(np.count_nonzero(longer) > len(longer) / 2)
        p = full[position.name] if position is not None and kind.in_positions else np.zeros(0)
        candidates = Masks()
        for quantity, sensor in dict.fromkeys((c.quantity, c.sensor) for c in self.checked):
            triad = [c for c in self.checked if (c.quantity, c.sensor) == (quantity, sensor)]
            if quantity in SPIKES_OF_DWELLS and kind.in_positions:
                candidates |= self._in_dwells(full, triad, p)
            else:
                candidates |= spikes({c.name: full[c.name] for c in triad}, slow and kind.at_rest)
        out = Masks()
        for c in self.checked:
            if not candidates[c.name].any():
                continue
            limit = np.inf if is_raw(c.unit) else from_si(self.limits[c.quantity], c.unit)
            own = candidates[c.name] & (np.abs(full[c.name]) < limit)
            if len(p) > 2:  # a rest may be a row
                own[1:-1] &= (p[1:-1] == p[:-2]) & (p[1:-1] == p[2:])
            if slow and kind.in_positions and c.quantity == "angular_rate":
                own &= p > 0 if len(p) > 2 else False  # a turn may be over within a row
            self.spikes[c.name] += int(np.count_nonzero(own))
            out[c.name] = np.zeros(n, dtype=bool)
            out[c.name][rows[own]] = True
        return out

    def _in_dwells(self, full: Batch, gimbals: list[Column], p: Array) -> Masks:
        """Return the rows in which a gimbal that is held in positions p (n,) reads something else.

        On the way, where the position is 0, nothing is known.
        """
        at_rest = p > 0
        if len(p) <= 2 or not at_rest.any():
            return {c.name: np.zeros(len(full[c.name]), dtype=bool) for c in gimbals}
        starts = np.flatnonzero(np.diff(p, prepend=-1.0))
        out = Masks()
        for c in gimbals:
            turn, x = float(from_si(2 * np.pi, c.unit)), full[c.name]
            level = np.repeat([np.median(part) for part in np.split(x, starts[1:])], np.diff(starts, append=len(p)))
            finite = at_rest & np.isfinite(x) & np.isfinite(level)  # an infinite reading is refused, and by name
            off = np.where(finite, x, 0.0) - np.where(finite, level, 0.0)
            off = (off + turn / 2) % turn - turn / 2
            sigma = self.header.noise.get("gimbal_angle", SETTING_SIGMA_RAD)
            out |= spikes({c.name: off}, slow=True, least=float(from_si(RELEVANT_SIGMAS * sigma, c.unit)))
        return {name: spiked & at_rest for name, spiked in out.items()}

    def _filled(self, batch: Batch, name: str, full: Mask, spiked: Mask) -> Array:
        """Return a column with its spikes as neighbours predict them; `InputError` where these do not agree."""
        rows = np.flatnonzero(spiked[full])
        out, kept = batch[name].copy(), batch[name][full]
        unsure = rows[~reliably_predicted(kept, rows)] if len(rows) else rows
        if len(unsure):
            row = self.rows - len(full) + int(np.flatnonzero(full)[unsure[0]])
            raise InputError(
                f"{self._place(row)}, column {name}: "
                f"{kept[unsure[0]]:.6g} leaps away for a row or two and back while the motion changes, so that its "
                "neighbours do not show what it was; correct it, or cut the recording there"
            )
        out[spiked] = predicted_by_neighbours(kept, rows)
        return out

    def _place(self, start: int, stop: int | None = None) -> str:
        return rows_in_words(self.header.samples, start, stop, self.header.skip, self.header.named)

    def _in_file(self, row: int) -> int:
        missing = self.missing
        return row + int(np.searchsorted(missing - np.arange(len(missing)), row, side="right"))


def _joined_arrays(parts: list[Array]) -> NDArray[np.int64]:
    return np.concatenate(parts).astype(np.int64) if parts else np.zeros(0, dtype=np.int64)


def _columns_with_counts(counts: Mapping[str, int]) -> str:
    """Return the columns that have any, with their counts where there are several."""
    some = {name: n for name, n in counts.items() if n}
    words = [f"{name} ({n})" if len(some) > 1 else name for name, n in list(some.items())[:MAX_COLUMNS]]
    return ", ".join(words) + (f" and {len(some) - MAX_COLUMNS} more columns" if len(some) > MAX_COLUMNS else "")
