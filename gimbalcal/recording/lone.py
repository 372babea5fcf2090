r"""Single rows that leap away and back: a fault of the logger or the wire, below what is physically impossible.

A row is one where a channel differs from the mean of its two neighbours,

.. math:: d_i = x_i - (x_{i-1} + x_{i+1}) / 2 ,

by more than `LEAP` times what it usually does among the rows about it (median of |d| in stretches of `STRETCH`), while
the neighbours agree with each other, and so do pairs of rows further out. Motion that a sampler can follow is smooth
over three rows, and a knock rings.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from gimbalcal.number import Array

LEAP = 40.0  # medians of |d|, 33 sigma of white noise: no noise of a sensor, heavy tails included
ALONE = 10.0  # medians of |d| that the other axes may be off in the same row
AGREE = 0.2  # of the leap, by which the neighbours may differ
STRETCH = 32  # rows
SIDES = 3  # rows on either side that see nothing of it: a knock rings in them
MOST = 0.01  # of the rows; what leaps more often is no fault of single rows
FEWEST = 4 * STRETCH
FASTEST = 0.1  # s; a turn of a slower log may be over in a row


def lone(channels: Mapping[str, Array]) -> dict[str, NDArray[np.bool_]]:
    """Rows (n,) in which a channel of a triad leaps away, and it alone: a knock is felt along several axes."""
    leaps, beyond = {}, {}
    for name, x in channels.items():
        leaps[name], beyond[name] = _leaps(x)
    return {
        name: found & np.all([x < ALONE for other, x in beyond.items() if other != name] or [found], axis=0)
        for name, found in leaps.items()
    }


def _leaps(x: Array) -> tuple[NDArray[np.bool_], Array]:
    """Rows of x (n,) that leap away from their neighbours, none where many do, and |d| over its usual size."""
    n = len(x)
    out, beyond = np.zeros(n, dtype=bool), np.zeros(n)
    if n < FEWEST:
        return out, beyond
    d = np.abs(x[1:-1] - (x[:-2] + x[2:]) / 2)
    some = d[d > 0]
    if not len(some):
        return out, beyond
    least = float(np.quantile(some, 0.25))  # of readings in steps: a step
    whole = len(d) // STRETCH * STRETCH
    usual = np.median(d[:whole].reshape(-1, STRETCH), axis=1)
    around = np.maximum(usual, np.maximum(np.r_[usual[:1], usual[:-1]], np.r_[usual[1:], usual[-1:]]))
    level = np.maximum(np.r_[np.repeat(around, STRETCH), np.full(len(d) - whole, around[-1])], least)
    beyond[1:-1] = d / level
    rows = np.flatnonzero((beyond[1:-1] > LEAP) & (np.abs(x[2:] - x[:-2]) < AGREE * d)) + 1
    rows = rows[(rows >= SIDES) & (rows < n - SIDES)]
    pairs = np.stack([(x[rows - k] + x[rows + k]) / 2 for k in range(1, SIDES + 1)])
    out[rows[np.ptp(pairs, axis=0) < AGREE * d[rows - 1]]] = True
    return (out if np.count_nonzero(out) <= MOST * n else np.zeros(n, dtype=bool)), beyond
