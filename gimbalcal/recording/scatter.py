r"""White noise of one sample, from what neighbouring samples do.

.. math:: \sigma^2 = \frac{1}{20} \left\langle (x_{i+3} - 3 x_{i+2} + 3 x_{i+1} - x_i)^2 \right\rangle

The third difference of a slow signal vanishes (a sidereal wave of 1 g sampled each minute leaves 1e-7 g of it), that
of white noise has variance (1 + 9 + 9 + 1) sigma^2. Differences are never taken across a gap or a change of position.
Source: von Neumann et al., Ann. Math. Statist. 12 (1941) 153, for the first difference; higher orders by the same
argument.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from gimbalcal.number import Array
from gimbalcal.recording.record import ANGLES, Key

ENOUGH = 8192
"""Rows of each batch that are looked at: sigma to better than 1 % from the first batch."""


class Scatter:
    """Pooled scatter of some channels over batches."""

    def __init__(self, names: tuple[str, ...], turns: Mapping[str, float]) -> None:
        self.turns = turns  # columns that are angles, and the size of a full turn
        self.squares = dict.fromkeys(names, 0.0)
        self.count = 0

    def add(self, batch: Mapping[str, Array], begins: Array, weight: Array, still: Array) -> None:
        """Take in a batch; `begins` marks rows that do not continue the row before, `still` those that count."""
        begins, still, weight = begins[:ENOUGH], still[:ENOUGH], weight[:ENOUGH]
        if len(begins) < 4:
            return
        broken = begins[1:-2] | begins[2:-1] | begins[3:] | ~still[:-3]
        good = ~broken
        self.count += int(np.count_nonzero(good))
        root = np.sqrt(weight[:-3])
        for name in self.squares:
            x = batch[name][:ENOUGH]
            third = (x[3:] - x[:-3]) - 3 * (x[2:-1] - x[1:-2])
            if name in self.turns:
                third -= self.turns[name] * np.round(third / self.turns[name])
            self.squares[name] += float(np.sum((third * root)[good] ** 2))

    def sigma(self) -> dict[str, float]:
        """One sigma by channel; empty where no four rows followed each other."""
        if not self.count:
            return {}
        return {name: float(np.sqrt(total / (20 * self.count))) for name, total in self.squares.items()}


def pooled(time: Array, position: Array | None, channels: Mapping[Key, Array]) -> dict[Key, float]:
    """Scatter of rows that are in memory, one sigma by channel, from the rows at rest."""
    n = len(time)
    begins = np.zeros(n, dtype=bool) if position is None else np.diff(position, prepend=position[:1]) != 0
    still = np.ones(n, dtype=bool) if position is None else position > 0
    keys = {" ".join(key): key for key in channels}
    turns = {name: 2 * np.pi for name, key in keys.items() if key[0] in ANGLES}
    scatter = Scatter(tuple(keys), turns)
    for start in range(0, n, ENOUGH):
        rows = slice(start, start + ENOUGH)
        batch = {name: channels[key][rows] for name, key in keys.items()}
        scatter.add(batch, begins[rows], np.ones(len(time[rows])), still[rows])
    return {keys[name]: sigma for name, sigma in scatter.sigma().items()}
