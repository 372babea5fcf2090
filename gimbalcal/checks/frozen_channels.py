"""Readings that stand still or pile up at a stop."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gimbalcal.number import Array

DISTINCT = 0.9


def steps(pieces: Sequence[Array]) -> tuple[float, int]:
    """The least step between readings that come in pieces, and how many different ones there are.

    No step where hardly two readings are alike, and no number where that shows in one piece.
    """
    levels: Array = np.zeros(0)
    counts: Array = np.zeros(0)
    for x in pieces:
        own, often = np.unique(x, return_counts=True)
        if len(own) > len(x) / 2 and _distinct(own, often):
            return 0.0, 0  # all of 1e8 need not be held against each other
        levels, at = np.unique(np.concatenate([levels, own]), return_inverse=True)
        counts = np.bincount(at, weights=np.concatenate([counts, often.astype(float)])).astype(float)
    if len(levels) < 2 or _distinct(levels, counts):
        return 0.0, len(levels)
    return float(np.diff(levels).min()), len(levels)


def _distinct(levels: Array, counts: Array) -> bool:
    """Whether no two readings are alike, but for those that are stuck, or at one of two stops."""
    others = float(counts.sum() - np.sort(counts)[-2:].sum())
    return len(levels) - 2 >= DISTINCT * others


def piled_up(y: Array) -> Array:
    """The rows where `y` equals its maximum, if they are five times as many as those at any of the next values."""
    top = y.max()
    rows = np.flatnonzero(y == top)
    rest = y[y < top]
    for _ in range(5):
        if not len(rest):
            break
        near = rest.max()
        if 5 * np.count_nonzero(rest == near) >= len(rows):
            return rows[:0]
        rest = rest[rest < near]
    return rows if len(rest) else rows[:0]


def longest_run(pieces: Sequence[Array]) -> tuple[int, int, float]:
    """First row and end of the longest run of equal values, and the mean length of the other runs.

    The values come in pieces that follow each other; a run may go on from one to the next.
    """
    first, stop, runs, n, begun, last = 0, 0, 0, 0, 0, np.nan
    for x in pieces:
        ends = np.flatnonzero(x[1:] != x[:-1]) + 1 + n  # of all runs of the piece but the last
        if n and x[0] != last:
            ends = np.concatenate([[n], ends])
        begins = np.concatenate([[begun], ends]).astype(np.int64)
        n, last, begun, runs = n + len(x), x[-1], int(begins[-1]), runs + len(ends)
        lengths = np.diff(begins, append=n)
        k = int(np.argmax(lengths))
        if lengths[k] > stop - first:
            first, stop = int(begins[k]), int(begins[k] + lengths[k])
    others = (n - (stop - first)) / runs if runs else 1.0
    return first, stop, float(others)
