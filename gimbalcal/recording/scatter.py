"""The scatter of a recording while it is read: white noise of a raw sample by channel, from the rows at rest."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from gimbalcal.inference.white_noise import scaled_differences
from gimbalcal.number import Array
from gimbalcal.recording.record import ANGLES, Key

ENOUGH = 8192
"""Rows of each batch that are looked at: sigma to better than 1 % from the first batch."""


class Scatter:
    """Pooled scatter of C channels over batches; turn (C,): size of a full turn of an angle, infinite of others."""

    def __init__(self, turn: Array) -> None:
        self.turn, self.squares, self.count = turn, np.zeros(len(turn)), 0

    def add(self, x: Sequence[Array], begins: Array, weight: Array, still: Array) -> None:
        """Take in channels (n,) each; `begins`: rows that do not continue the row before, `still`: those at rest."""
        if len(begins) < 4 or not len(x):
            return
        first = slice(ENOUGH)
        third = scaled_differences([c[first] for c in x], begins[first] | ~still[first], weight[first], turn=self.turn)
        self.squares += [float(d @ d) for d in third]
        self.count += len(third[0])

    def sigma(self) -> list[float]:
        """Return one sigma by channel; none where no four rows followed each other."""
        return np.sqrt(self.squares / self.count).tolist() if self.count else []


def pooled_scatter(
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
