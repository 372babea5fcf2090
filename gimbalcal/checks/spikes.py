r"""Spikes: one or two rows that depart from their neighbours and return, a fault of the logger or of the wire.

A row is a spike where a channel differs from the cubic through its four neighbours,

.. math:: d_i = x_i - \tfrac16 (4 x_{i-1} + 4 x_{i+1} - x_{i-2} - x_{i+2}) ,

by more than `MIN_RATIO` times the usual :math:`|d|` about it (the median of `STRETCH` rows), while cubics through other
neighbours predict the same. Two rows side by side are one spike where they are off alike: their mean is compared with
the cubic through the neighbours of both. Motion that a sampler can follow is smooth over seven rows, and a knock
rings: another channel of the triad is shaken by it without a spike of its own.

Both distances follow from one fourth difference, :math:`|d_i| = |\delta^4 x_i| / 6` and
:math:`|\delta^4 x_i + \delta^4 x_{i+1}| / 4`, and neither exceeds :math:`\tfrac32 \max |x_{i+1} - x_i|`. So they are
formed only in stretches with a first difference that is large against the lower quartile of :math:`|d|` in the
recording, below which no stretch counts as quieter, and medians only about rows whose :math:`|d|` exceeds `MIN_RATIO`
times that quartile.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from gimbalcal.number import Array
from gimbalcal.recording.document import MAX_STATED_NUMBER

Rows = NDArray[np.int64]

MIN_RATIO = 40.0  # medians of |d|, 37 sigma of white noise: beyond any noise of a sensor, heavy tails included
MAX_DISTANCE = 1.5 * (1 + 1e-9)  # of |d|, in first differences of the rows about it
MIN_RATIO_SLOW = 20.0  # the same for rows at intervals of seconds, or means, in none of which the unit moves
MAX_RATIO_OTHERS = 10.0  # medians of |d| by which a channel may be off in the row of a spike of another
MAX_SPREAD = 0.2  # of the spike: difference between predictions from different neighbours
STRETCH = 32  # rows
MAX_WIDTH = 2  # rows of one spike
MAX_DIFFERENCE = 0.1  # of the spike, between its two rows: those of a knock differ by more
MAX_STEP = {1: 1.0, 2: 0.5}  # of the spike, by width: step of the level; a third more than a spike of one row, a tenth
NEIGHBOURS = 3  # rows on either side that a spike leaves alone: a knock rings in them
MAX_SHARE = 0.01  # of the rows; what departs more often is no fault of single rows
MAX_SHARE_STILL = 5 * MAX_SHARE  # of the rows with d != 0 where a channel stands still: a spike shows in five rows
MIN_ROWS = 4 * STRETCH
QUARTILE_ROWS = 2048  # rows whose lower quartile is that of the recording
MAX_STEP_FAST_S = 0.1  # a turn in a slower log may be over within a row


def spikes(channels: Mapping[str, Array], slow: bool = False, least: float = 0.0) -> dict[str, NDArray[np.bool_]]:
    """Return the rows (n,) of each channel of a triad in which it has a spike, of up to `MAX_WIDTH` rows.

    A spike may be in one channel or in several; where another channel is shaken without a spike, it is a knock. slow:
    the sampling interval is too long to show the ringing of a knock. least: size of the smallest relevant spike of a
    channel that stands still.
    """
    ratio = MIN_RATIO_SLOW if slow else MIN_RATIO
    out = {name: np.zeros(len(x), dtype=bool) for name, x in channels.items()}
    if not least and not any(_steps_far(x, ratio) for x in channels.values()):
        return out
    inside = {
        name: bool(-MAX_STATED_NUMBER <= x.min() and x.max() <= MAX_STATED_NUMBER)
        for name, x in channels.items()
        if len(x)
    }
    # infinity is refused elsewhere
    channels = {
        n: x if inside.get(n) else np.clip(x, -MAX_STATED_NUMBER, MAX_STATED_NUMBER) for n, x in channels.items()
    }
    steps = {name: _largest_steps(x) for name, x in channels.items()}
    for width in range(1, MAX_WIDTH + 1):
        off = {name: _Departure(x, width, least / MIN_RATIO_SLOW) for name, x in channels.items()}
        candidates = {name: _spikes(x, off[name], off[name].beyond(ratio, steps[name])) for name, x in channels.items()}
        for name, rows in candidates.items():
            kept = rows
            if len(rows) and not slow:
                calm = np.all(
                    [np.isin(rows, candidates[o]) | (off[o].ratio(rows) < MAX_RATIO_OTHERS) for o in off], axis=0
                )
                ends = np.stack([rows, rows + width - 1])
                empty = np.all([x[ends] == 0 for x in channels.values()], axis=(0, 1))  # no sample came: no knock
                kept = rows[calm | empty]
            out[name][kept] = out[name][kept + width - 1] = True
    few = {name: np.count_nonzero(rows) <= MAX_SHARE * len(rows) for name, rows in out.items()}
    return {name: rows & few[name] for name, rows in out.items()}


def predicted_by_neighbours(x: Array, rows: Rows) -> Array:
    """Return rows of x (n,) as the cubic through two neighbours on either side predicts them; none of the outer two.

    Rows side by side are predicted by the neighbours of all; NaN where they are more than `MAX_WIDTH`.
    """
    out = np.full(len(x), np.nan)
    for begin, width in _runs(rows):
        even, odd = _even(x, begin, width, 1, 2), _odd(x, begin, width)
        out[begin + width - 1] = even + odd
        out[begin] = even - odd
    return out[rows]


def reliably_predicted(x: Array, rows: Rows) -> NDArray[np.bool_]:
    """Return whether near and far neighbours predict rows (k,) of x (n,) alike: the motion does not change there."""
    out = np.zeros(len(x), dtype=bool)
    for begin, width in _runs(rows):
        off = _Departure(x, width)
        sure = _spread(x, begin, width) < MAX_RATIO_OTHERS * off.usual(begin)
        out[begin] = out[begin + width - 1] = sure
    return out[rows]


def _steps_far(x: Array, ratio: float) -> bool:
    """Return whether some first difference of x (n,) is so large that |d| may exceed `ratio` times its lower quartile.

    The quartile, by `QUARTILE_ROWS` rows, exceeds what more than three quarters of their |d| exceed.
    """
    if len(x) < 2 * QUARTILE_ROWS:
        return len(x) >= MIN_ROWS
    every = len(x) // QUARTILE_ROWS * STRETCH
    with np.errstate(invalid="ignore"):
        step = np.subtract(x[1:], x[:-1])
        largest = max(float(step.max()), -float(step.min()))
        fourth = np.diff(x[: len(x) // every * every].reshape(-1, every)[:, : STRETCH + 5], 4, axis=1)
        for d in (np.abs(fourth[:, 1:]) / 6, np.abs(fourth[:, 1:] + fourth[:, :-1]) / 4):
            moving = np.count_nonzero(d)
            if not (
                largest == 0 or np.count_nonzero(d * ratio > 1.5 * largest) > 0.75 * moving >= 0.75 * QUARTILE_ROWS / 2
            ):
                return True
    return False


def _largest_steps(x: Array) -> Array:
    """Return the largest first difference of x (n,) from the rows of each stretch to the rows after them."""
    steps = np.zeros(-(-len(x) // STRETCH) * STRETCH)
    if len(x):
        np.abs(np.subtract(x[1:], x[:-1], out=steps[: len(x) - 1]), out=steps[: len(x) - 1])
    while len(steps) * STRETCH > len(x) + STRETCH - 1:
        steps = np.maximum(steps[::2], steps[1::2])
    return steps


def _distances(x: Array, begin: Rows, rows: int, width: int) -> Array:
    """Return |d| (k, rows) of the mean of `width` rows of x (n,) from each of the rows after `begin` (k,).

    It is zero where x does not reach two rows further on either side.
    """
    at = begin[:, None] + np.arange(-2, rows + width + 1)
    fourth = np.diff(x[np.clip(at, 0, len(x) - 1)], 4, axis=1)
    d = np.abs(fourth) / 6 if width == 1 else np.abs(fourth[:, :-1] + fourth[:, 1:]) / 4
    first = at[:, 2 : rows + 2]
    return np.where((first >= 2) & (first < len(x) - 1 - width), d, 0.0)


class _Departure:
    """|d| of the mean of `width` rows from each row of x (n,) on, and its usual size."""

    def __init__(self, x: Array, width: int, least: float = 0.0) -> None:
        n = len(x)
        self.x, self.width, self.stretches = x, width, n // STRETCH
        some = self.of(np.arange(0, self.stretches, max(1, n // QUARTILE_ROWS)))
        some = some[some > 0]
        every = self.of(np.arange(-(-n // STRETCH))) if least or len(some) <= QUARTILE_ROWS / 8 else np.zeros(0)
        some = some if len(some) > QUARTILE_ROWS / 8 else every[every > 0]
        self.resolution = float(np.quantile(some, 0.25)) if len(some) else 0.0  # of readings in steps: a step
        still = least and np.count_nonzero(every) <= MAX_SHARE_STILL * n
        self.fixed, self.least = (least, least) if still else (0.0, max(least, self.resolution))

    def of(self, stretches: Rows) -> Array:
        """Return |d| (k, `STRETCH`) of stretches (k,), the last of which may end in rows that are not there."""
        return _distances(self.x, stretches * STRETCH, STRETCH, self.width)

    def at(self, rows: Rows) -> Array:
        """Return |d| of rows (k,)."""
        return _distances(self.x, rows, 1, self.width)[:, 0]

    def beyond(self, ratio: float, steps: Array) -> Rows:
        """Return the rows whose |d| is more than `ratio` times the usual one; steps: the largest of each stretch."""
        if len(self.x) < MIN_ROWS or not self.least:
            return np.zeros(0, dtype=np.int64)
        limit = ratio * self.least
        far = ~(MAX_DISTANCE * steps <= limit)  # what is no number is not small
        far[1:], far[:-1] = far[1:] | far[:-1], far[:-1] | far[1:]
        stretches = np.flatnonzero(far)
        rows = (stretches[:, None] * STRETCH + np.arange(STRETCH))[self.of(stretches) > limit]
        return rows[self.ratio(rows) > ratio]

    def ratio(self, rows: Rows) -> Array:
        """Return |d| of rows (k,) over its usual size; zero where nothing shows a usual size."""
        if not len(rows) or len(self.x) < MIN_ROWS or not self.least:
            return np.zeros(len(rows))
        return np.asarray(self.at(rows) / (self.fixed or np.maximum(self.usual(rows), self.least)))

    def usual(self, rows: Rows) -> Array:
        """Return the usual |d| about rows (k,): the largest median of three stretches, or the resolution."""
        last = self.stretches - 1
        own, at = np.unique(np.minimum(rows // STRETCH, last), return_inverse=True)
        neighbours = np.clip(own[:, None] + np.arange(-1, 2), 0, last)
        needed, where = np.unique(neighbours, return_inverse=True)
        medians = np.median(self.of(needed), axis=1)[where].reshape(neighbours.shape)
        return np.maximum(medians.max(axis=1)[at], self.resolution)


def _runs(rows: Rows) -> list[tuple[Rows, int]]:
    """Return the first rows of runs, for each length of a run up to `MAX_WIDTH`."""
    begin = rows[np.diff(rows, prepend=-2) > 1]
    length = np.diff(np.searchsorted(rows, begin), append=len(rows))
    return [(begin[length == width], width) for width in range(1, MAX_WIDTH + 1)]


def _even(x: Array, rows: Rows, width: int, near: int, far: int) -> Array:
    """Return the mean of the first and last row of runs from `rows` (k,), by their neighbours near and far."""
    end = rows + width - 1
    h = (width - 1) / 2
    a, b = near + h, far + h
    one, two = ((x[rows - k] + x[end + k]) / 2 for k in (near, far))
    return np.asarray(((b * b - h * h) * one - (a * a - h * h) * two) / (b * b - a * a))


def _odd(x: Array, rows: Rows, width: int) -> Array:
    """Return half the difference between the last and first row of runs, by the odd part of the cubic."""
    h = (width - 1) / 2
    a, b = 1 + h, 2 + h
    one, two = ((x[rows + width - 1 + k] - x[rows - k]) / 2 for k in (1, 2))
    return np.asarray(h * ((b * b - h * h) / a * one - (a * a - h * h) / b * two) / (b * b - a * a))


def _spread(x: Array, rows: Rows, width: int) -> Array:
    """Return the range (k,) of the cubics through two of the three neighbours on either side."""
    pairs = combinations(range(1, NEIGHBOURS + 1), 2)
    return np.ptp(np.stack([_even(x, rows, width, *pair) for pair in pairs]), axis=0)


def _spikes(x: Array, off: _Departure, rows: Rows) -> Rows:
    """Return those of `rows` from which on as many as are off depart from all neighbours alike and return."""
    width, h = off.width, (off.width - 1) / 2
    rows = rows[(rows >= NEIGHBOURS) & (rows < len(x) - NEIGHBOURS - width + 1)]
    last, size = rows + width - 1, off.at(rows)
    step = x[last + 1] - x[rows - 1] - (x[last + NEIGHBOURS] - x[rows - NEIGHBOURS]) * (1 + h) / (NEIGHBOURS + h)
    difference = np.abs((x[last] - x[rows]) / 2 - _odd(x, rows, width))
    alike = (np.abs(step) < MAX_STEP[width] * size) & (difference <= MAX_DIFFERENCE * size)
    return rows[alike & (_spread(x, rows, width) < MAX_SPREAD * size)]
