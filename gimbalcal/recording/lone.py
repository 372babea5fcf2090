r"""Single rows that leap away and back: a fault of the logger or the wire, below what is physically impossible.

A row is one where a channel differs from the cubic through its four neighbours,

.. math:: d_i = x_i - \tfrac16 (4 x_{i-1} + 4 x_{i+1} - x_{i-2} - x_{i+2}) ,

by more than `LEAP` times what it usually does among the rows about it (median of |d| in stretches of `STRETCH`), while
cubics through other neighbours tell the same. Motion that a sampler can follow is smooth over seven rows, and a knock
rings: a channel beside it that is shaken without leaping shows one.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from gimbalcal.number import Array

LEAP = 40.0  # medians of |d|, 37 sigma of white noise: no noise of a sensor, heavy tails included
SLOW = 20.0  # the same where rows are seconds apart, or means, and none of them moves
ALONE = 10.0  # medians of |d| that an axis may be off in the same row that does not leap itself
AGREE = 0.2  # of the leap, by which what other neighbours tell may differ
STRETCH = 32  # rows
SIDES = 3  # rows on either side that see nothing of it: a knock rings in them
MOST = 0.01  # of the rows; what leaps more often is no fault of single rows
FEWEST = 4 * STRETCH
FASTEST = 0.1  # s; a turn of a slower log may be over in a row


def lone(channels: Mapping[str, Array], slow: bool = False) -> dict[str, NDArray[np.bool_]]:
    """Rows (n,) in which a channel of a triad leaps away, alone or with others that leap too; a knock shakes some.

    slow: rows are so far apart that none of them shows how a knock rings.
    """
    leaps, beyond = {}, {}
    for name, x in channels.items():
        leaps[name], beyond[name] = _leaps(x, SLOW if slow else LEAP)
    if slow:
        return leaps
    clean = np.all([leaps[name] | (x < ALONE) for name, x in beyond.items()], axis=0)
    clean |= np.all([x == 0 for x in channels.values()], axis=0)  # a sample that was not there, and no knock
    return {name: found & clean for name, found in leaps.items()}


def told_by_neighbours(x: Array, rows: NDArray[np.int64]) -> Array:
    """What the cubic through two neighbours on either side says of rows of x (n,); these are none of the outer two."""
    return np.asarray((4 * (x[rows - 1] + x[rows + 1]) - x[rows - 2] - x[rows + 2]) / 6)


def surely_told(x: Array, rows: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Whether neighbours near and far tell rows (k,) of x (n,) alike, to what they usually do: no ramp begins there."""
    return np.asarray(_spread(x, rows) < ALONE * _level(_off(x))[rows])


def _off(x: Array) -> Array:
    """|d| of each row (n,), zero at the ends."""
    d = np.zeros(len(x))
    d[2:-2] = np.abs(x[2:-2] - told_by_neighbours(x, np.arange(2, len(x) - 2)))
    return d


def _level(d: Array) -> Array:
    """What |d| (n,) usually is among the rows about each."""
    n, some = len(d), d[d > 0]
    least = float(np.quantile(some, 0.25)) if len(some) else 0.0  # of readings in steps: a step
    whole = n // STRETCH * STRETCH
    usual = np.median(d[:whole].reshape(-1, STRETCH), axis=1)
    around = np.maximum(usual, np.maximum(np.r_[usual[:1], usual[:-1]], np.r_[usual[1:], usual[-1:]]))
    return np.maximum(np.r_[np.repeat(around, STRETCH), np.full(n - whole, around[-1])], least)


def _spread(x: Array, rows: NDArray[np.int64]) -> Array:
    """By how much the cubics through two of the three neighbours on either side differ at rows (k,)."""
    one, two, three = ((x[rows - k] + x[rows + k]) / 2 for k in range(1, SIDES + 1))
    return np.ptp(np.stack([(4 * one - two) / 3, (9 * one - three) / 8, (9 * two - 4 * three) / 5]), axis=0)


def _leaps(x: Array, least_leap: float) -> tuple[NDArray[np.bool_], Array]:
    """Rows of x (n,) that leap away from their neighbours, none where many do, and |d| over its usual size."""
    n = len(x)
    out, beyond = np.zeros(n, dtype=bool), np.zeros(n)
    if n < FEWEST or not np.any(d := _off(x)):
        return out, beyond
    beyond = d / _level(d)
    rows = np.flatnonzero(beyond > least_leap)
    rows = rows[(rows >= SIDES) & (rows < n - SIDES)]
    step = x[rows + 1] - x[rows - 1] - (x[rows + SIDES] - x[rows - SIDES]) / SIDES
    rows = rows[np.abs(step) < d[rows]]  # where the level steps it is a third more
    out[rows[_spread(x, rows) < AGREE * d[rows]]] = True
    return (out if np.count_nonzero(out) <= MOST * n else np.zeros(n, dtype=bool)), beyond
