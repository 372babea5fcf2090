"""Readings that stand still or pile up at a stop."""

from __future__ import annotations

import numpy as np

from gimbalcal.number import Array


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


def longest_run(x: Array) -> tuple[int, int, float]:
    """First row and end of the longest run of equal values, and the mean length of the other runs."""
    edges = np.concatenate([[0], np.flatnonzero(x[1:] != x[:-1]) + 1, [len(x)]])
    lengths = np.diff(edges)
    k = int(np.argmax(lengths))
    others = (len(x) - lengths[k]) / (len(lengths) - 1) if len(lengths) > 1 else 1.0
    return int(edges[k]), int(edges[k + 1]), float(others)
