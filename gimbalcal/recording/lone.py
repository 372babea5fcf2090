r"""Rows that leap away and back, one or two of them: a fault of the logger or the wire, below what is impossible.

A row is one where a channel differs from the cubic through its four neighbours,

.. math:: d_i = x_i - \tfrac16 (4 x_{i-1} + 4 x_{i+1} - x_{i-2} - x_{i+2}) ,

by more than `LEAP` times what it usually does among the rows about it (median of |d| in stretches of `STRETCH`), while
cubics through other neighbours tell the same. Two rows side by side are one leap where they are off alike: their mean
is held against the cubic through the neighbours of both. Motion that a sampler can follow is smooth over seven rows,
and a knock rings: a channel beside it that is shaken without leaping shows one.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from gimbalcal.number import Array

LEAP = 40.0  # medians of |d|, 37 sigma of white noise: no noise of a sensor, heavy tails included
SLOW = 20.0  # the same where rows are seconds apart, or means, and none of them moves
ALONE = 10.0  # medians of |d| that an axis may be off in the same row that does not leap itself
AGREE = 0.2  # of the leap, by which what other neighbours tell may differ
STRETCH = 32  # rows
WIDEST = 2  # rows of one leap
ALIKE = 0.1  # of the leap, by which two rows may be off differently: those of a knock do
STEPS = {
    1: 1.0,
    2: 0.5,
}  # of the leap, by which the level may step: a third more than a leap of one row, a tenth of two
SIDES = 3  # rows on either side that see nothing of it: a knock rings in them
MOST = 0.01  # of the rows; what leaps more often is no fault of single rows
STILL = 5 * MOST
FEWEST = 4 * STRETCH
HUGE = 1e100  # beyond any reading in any unit
FASTEST = 0.1  # s; a turn of a slower log may be over in a row


def lone(channels: Mapping[str, Array], slow: bool = False, least: float = 0.0) -> dict[str, NDArray[np.bool_]]:
    """Rows (n,) in which a channel of a triad leaps away, alone or with others that leap too; a knock shakes some.

    `WIDEST` side by side are one leap. least: the size of one that matters where a channel does not move at all.

    slow: rows are so far apart that none of them shows how a knock rings.
    """
    channels = {name: np.clip(x, -HUGE, HUGE) for name, x in channels.items()}  # what is infinite is refused elsewhere
    out = {name: np.zeros(len(x), dtype=bool) for name, x in channels.items()}
    zero = np.all([x == 0 for x in channels.values()], axis=0)  # a sample that was not there, and no knock
    for width in range(1, WIDEST + 1):
        beyond = {name: _beyond(x, width, least / SLOW) for name, x in channels.items()}
        leaps = {name: _leaps(x, beyond[name] > (SLOW if slow else LEAP), width) for name, x in channels.items()}
        clean = np.all([leaps[name] | (far < ALONE) for name, far in beyond.items()], axis=0)
        clean |= zero & np.roll(zero, 1 - width)
        for name, found in leaps.items():
            rows = np.flatnonzero(found & (clean | slow))
            out[name][rows] = out[name][rows + width - 1] = True
    few = {name: np.count_nonzero(found) <= MOST * len(found) for name, found in out.items()}
    return {name: found & few[name] for name, found in out.items()}


def told_by_neighbours(x: Array, rows: NDArray[np.int64]) -> Array:
    """What the cubic through two neighbours on either side says of rows of x (n,); these are none of the outer two.

    Rows side by side are told by the neighbours of all, NaN where they are more than `WIDEST`.
    """
    out = np.full(len(x), np.nan)
    for begin, width in _runs(rows):
        even, odd = _between(x, begin, width, 1, 2), _odd(x, begin, width)
        out[begin + width - 1] = even + odd
        out[begin] = even - odd
    return out[rows]


def surely_told(x: Array, rows: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Whether neighbours near and far tell rows (k,) of x (n,) alike, to what they usually do: no ramp begins there."""
    out = np.zeros(len(x), dtype=bool)
    for begin, width in _runs(rows):
        sure = _spread(x, begin, width) < ALONE * _level(_off(x, width))[begin]
        out[begin] = out[begin + width - 1] = sure
    return out[rows]


def _runs(rows: NDArray[np.int64]) -> list[tuple[NDArray[np.int64], int]]:
    """Where rows begin of which so many stand side by side, up to `WIDEST`."""
    begin = rows[np.diff(rows, prepend=-2) > 1]
    length = np.diff(np.searchsorted(rows, begin), append=len(rows))
    return [(begin[length == width], width) for width in range(1, WIDEST + 1)]


def _between(x: Array, rows: NDArray[np.int64], width: int, near: int, far: int) -> Array:
    """Mean of the first and last of so many rows from each of `rows` (k,), by neighbours near and far on either side.

    The even part of the cubic, at half a width from the middle.
    """
    h = (width - 1) / 2
    a, b = near + h, far + h
    one, two = ((x[rows - k] + x[rows + width - 1 + k]) / 2 for k in (near, far))
    return np.asarray(((b * b - h * h) * one - (a * a - h * h) * two) / (b * b - a * a))


def _odd(x: Array, rows: NDArray[np.int64], width: int) -> Array:
    """Half of what the last of so many rows is more than the first, by the odd part of the cubic."""
    h = (width - 1) / 2
    a, b = 1 + h, 2 + h
    one, two = ((x[rows + width - 1 + k] - x[rows - k]) / 2 for k in (1, 2))
    return np.asarray(h * ((b * b - h * h) / a * one - (a * a - h * h) / b * two) / (b * b - a * a))


def _off(x: Array, width: int = 1) -> Array:
    """|d| of so many rows from each on (n,), zero at the ends."""
    d = np.zeros(len(x))
    rows = np.arange(2, len(x) - 1 - width)
    d[rows] = np.abs((x[rows] + x[rows + width - 1]) / 2 - _between(x, rows, width, 1, 2))
    return d


def _level(d: Array) -> Array:
    """What |d| (n,) usually is among the rows about each."""
    n, some = len(d), d[d > 0]
    least = float(np.quantile(some, 0.25)) if len(some) else 0.0  # of readings in steps: a step
    whole = n // STRETCH * STRETCH
    usual = np.median(d[:whole].reshape(-1, STRETCH), axis=1)
    around = np.maximum(usual, np.maximum(np.r_[usual[:1], usual[:-1]], np.r_[usual[1:], usual[-1:]]))
    return np.maximum(np.r_[np.repeat(around, STRETCH), np.full(n - whole, around[-1])], least)


def _spread(x: Array, rows: NDArray[np.int64], width: int) -> Array:
    """By how much the cubics through two of the three neighbours on either side differ at rows (k,)."""
    return np.ptp(np.stack([_between(x, rows, width, *two) for two in combinations(range(1, SIDES + 1), 2)]), axis=0)


def _beyond(x: Array, width: int, least: float = 0.0) -> Array:
    """|d| of so many rows from each of x (n,) on, over its usual size; zero where nothing tells that."""
    if len(x) < FEWEST or not np.any(d := _off(x, width)):
        return np.zeros(len(x))
    if least and np.count_nonzero(d) <= STILL * len(d):  # but for leaps, which show in five rows each
        return d / least
    return d / np.maximum(_level(d), least)


def _leaps(x: Array, far: NDArray[np.bool_], width: int) -> NDArray[np.bool_]:
    """Rows of x (n,), of those that are far off, from which on so many leap away from their neighbours and back."""
    h, out = (width - 1) / 2, np.zeros(len(x), dtype=bool)
    rows = np.flatnonzero(far)
    rows = rows[(rows >= SIDES) & (rows < len(x) - SIDES - width + 1)]
    last, d = rows + width - 1, _off(x, width)[rows] if len(rows) else np.zeros(0)
    step = x[last + 1] - x[rows - 1] - (x[last + SIDES] - x[rows - SIDES]) * (1 + h) / (SIDES + h)
    unlike = np.abs((x[last] - x[rows]) / 2 - _odd(x, rows, width))
    told = (np.abs(step) < STEPS[width] * d) & (unlike <= ALIKE * d) & (_spread(x, rows, width) < AGREE * d)
    out[rows[told]] = True
    return out
