r"""White noise of one sample, from what neighbouring samples do.

.. math:: \sigma^2 = \frac{1}{20} \left\langle (x_{i+3} - 3 x_{i+2} + 3 x_{i+1} - x_i)^2 \right\rangle

The third difference of a slow signal vanishes (a sidereal wave of 1 g sampled each minute leaves 1e-7 g of it), that
of white noise has variance (1 + 9 + 9 + 1) sigma^2. Differences are never taken across a gap or a change of position.
Source: von Neumann et al., Ann. Math. Statist. 12 (1941) 153, for the first difference; higher orders by the same
argument.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import comb

import numpy as np

from gimbalcal.number import Array
from gimbalcal.recording.record import ANGLES, Key

ENOUGH = 8192
"""Rows of each batch that are looked at: sigma to better than 1 % from the first batch."""


def differences(x: Array, begins: Array, weight: Array, order: int = 3, turn: float | Array = np.inf) -> Array:
    """Return differences (m, C) of rows x (n, C) that follow each other, scaled to the noise of one raw sample.

    begins (n,): the row does not continue the one before; weight (n,): raw samples behind each row; turn, (C,) or for
    all: size of a full turn of angles that may jump by one, infinite of others.
    """
    d = np.diff(x, order, axis=0)
    if np.isfinite(turn).any():
        jumps = np.round(d / turn)
        d = d - np.multiply(turn, jumps, out=np.zeros_like(d), where=jumps != 0)
    m = len(d)
    whole, variance = np.ones(m, dtype=bool), np.zeros(m)
    for j in range(order + 1):
        variance += comb(order, j) ** 2 / weight[j : j + m]
        whole &= ~begins[j : j + m] if j else True
    return np.asarray(d[whole] / np.sqrt(variance[whole])[:, None])


def white_sigma(x: Array, begins: Array, weight: Array) -> Array:
    """One sigma (C,) of one raw sample of rows x (n, C); 0 where no row follows another.

    From third differences; where no position has four rows from second ones, where none has three from first ones.
    """
    for order in (3, 2, 1):
        d = differences(x, begins, weight, order)
        if len(d):
            return np.asarray(np.sqrt(np.mean(d**2, axis=0)))
    return np.zeros(x.shape[1])


class Scatter:
    """Pooled scatter of C channels over batches; turn (C,): size of a full turn of an angle, infinite of others."""

    def __init__(self, turn: Array) -> None:
        self.turn, self.squares, self.count = turn, np.zeros(len(turn)), 0

    def add(self, x: Sequence[Array], begins: Array, weight: Array, still: Array) -> None:
        """Take in channels (n,) each; `begins`: rows that do not continue the row before, `still`: those at rest."""
        if len(begins) < 4 or not len(x):
            return
        first = slice(ENOUGH)
        rows = np.stack([channel[first] for channel in x], axis=1)
        third = differences(rows, begins[first] | ~still[first], weight[first], turn=self.turn)
        self.squares += np.sum(third**2, axis=0)
        self.count += len(third)

    def sigma(self) -> list[float]:
        """Return one sigma by channel; none where no four rows followed each other."""
        return np.sqrt(self.squares / self.count).tolist() if self.count else []


def pooled(
    time: Array, position: Array | None, channels: Mapping[Key, Array], weight: Array | None = None
) -> dict[Key, float]:
    """Return the scatter of rows that are in memory, one sigma of a raw sample by channel, from the rows at rest.

    weight (n,): raw samples behind each row, one where it is left out.
    """
    n = len(time)
    weight = np.ones(n) if weight is None else weight
    p = np.ones(n) if position is None else position
    begins, still = np.diff(p, prepend=p[:1]) != 0, p > 0
    scatter = Scatter(np.array([2 * np.pi if quantity in ANGLES else np.inf for quantity, _ in channels]))
    for start in range(0, n, ENOUGH):
        rows = slice(start, start + ENOUGH)
        scatter.add([x[rows] for x in channels.values()], begins[rows], weight[rows], still[rows])
    return dict(zip(channels, scatter.sigma(), strict=False))
