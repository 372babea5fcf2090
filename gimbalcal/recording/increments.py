r"""Increments over the interval that ends at each row become what they are the mean of: force and rate.

.. math:: f_i = \frac{\Delta v_i}{t_i - t_{i-1}}, \qquad \omega_i = \frac{\Delta\theta_i}{t_i - t_{i-1}} ,

once, while they are read, so that every method gets the same quantities. The interval before the first row, and before
a row behind a pause, is the usual one: what was summed while nothing was logged is lost with its rows.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace

import numpy as np

from gimbalcal.checks.dropouts import Dropouts
from gimbalcal.number import Array
from gimbalcal.recording.columns import RATE_OF, Column
from gimbalcal.recording.dwell import MISSED_ROW_STEPS
from gimbalcal.recording.header import Header
from gimbalcal.recording.samples import Batch
from gimbalcal.units import to_si


class Increments:
    """Divides increments by their intervals as the rows go by, and remembers the intervals [s]."""

    def __init__(self, header: Header, dropouts: Dropouts) -> None:
        self.dropouts, self.given = dropouts, header
        self.names = [c.name for c in header.columns if c.quantity in RATE_OF]
        self.header = replace(header, columns=tuple(map(_mean, header.columns)))
        self.usual, self.last = 0.0, np.nan
        self.intervals: list[Array] = []

    def rates(self, stream: Iterable[Batch]) -> Iterator[Batch]:
        """Yield the batches with means over the interval in place of increments."""
        clock = self.given.column("time")
        for batch in stream:
            if clock is None or not self.names or not len(batch[clock.name]):
                yield batch
                continue
            dt = self._interval(to_si(batch[clock.name], clock.unit))
            self.intervals.append(dt)
            yield {name: x / dt if name in self.names else x for name, x in batch.items()}

    def _interval(self, time: Array) -> Array:
        dt, self.usual = intervals(time, self.last, self.usual)
        self.last = float(time[-1])
        return dt

    @property
    def interval(self) -> Array:
        """Return the interval (n,) [s] that ends at each row so far."""
        return np.concatenate(self.intervals)

    def on_clock(self, table: dict[str, Array], time: Array) -> None:
        """Correct the means in `table` where their rows turn out to belong to other times (n,) [s]."""
        if self.names:
            before, self.last = self.interval, np.nan
            after = self._interval(time)
            for name in self.names:
                table[name] = table[name] * before / after

    def whole(self, column: Callable[[str], Array]) -> Callable[[str], Array]:
        """Return a function that converts one complete column, as it stands in the file."""

        def converted(name: str) -> Array:
            values = column(name)
            if name not in self.names:
                return values
            dt = np.ones(len(values))
            dt[self.dropouts.kept] = self.interval
            return values / dt

        return converted


def intervals(time: Array, last: float = np.nan, usual: float = 0.0) -> tuple[Array, float]:
    """Return the interval (n,) [s] that ends at each row of a clock (n,) [s], and the usual one.

    last: the time of the row before the first one, if any. usual: that of the rows before these, 0 where none are.
    """
    dt, step = np.diff(time, prepend=last), np.diff(time)
    if not usual:
        usual = float(np.median(step)) if len(step) else 1.0
    if not usual > 0:  # a clock too coarse to distinguish rows
        usual = max(float(time[-1] - time[0]) / max(len(step), 1), np.finfo(float).tiny)
    # a regular clock stays one, so that equal increments stay equal: a frozen channel, the steps of a converter
    rounding = 8 * np.finfo(float).eps * np.abs(time)
    own = (dt > 0) & (dt < MISSED_ROW_STEPS * usual) & (np.abs(dt - usual) > rounding)
    return np.where(own, dt, usual), usual


def _mean(column: Column) -> Column:
    if column.quantity not in RATE_OF:
        return column
    unit = "m/s^2" if column.unit == "m/s" else f"{column.unit}/s"
    return replace(column, quantity=RATE_OF[column.quantity], unit=unit, increments=True)
