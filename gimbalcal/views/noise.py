"""What the noise of the rows of a view may be."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gimbalcal.number import Array

SingleWalk = tuple[str, float, float, float]
"""Axis of a sensor that walks alone, size of its walk, memory and share of what all sensors wander beside it."""


@dataclass(frozen=True, eq=False)
class NoiseModel:
    """Noise whose scale nobody states: it is integrated over, and so is its correlation from row to row.

    sigma (n, C): what the samples say of one row against another, where they do; sample (n, C): what their scatter
    alone makes of a row, which bounds the scale; wander (n, C, m): how what m sensors wander from row to row shows in
    the rows, of unit length; single_walks: sensors that may walk alone.
    """

    sigma: Array | None = None
    sample: Array | None = None
    wander: Array | None = None
    single_walks: tuple[SingleWalk, ...] = ()

    def weighted(self, X: Array) -> Array:
        """Return rows (n, C, ...) in units in which all of them are equally sure; the surest stay as they are."""
        if self.sigma is None:
            return X
        weight = self.sigma.min() / self.sigma
        return np.asarray(X * weight.reshape(*weight.shape, *([1] * (X.ndim - 2))))

    def weight(self, shape: tuple[int, int]) -> Array:
        """Return the weights (n, C) of `weighted` for rows of this shape."""
        return np.ones(shape) if self.sigma is None else self.sigma.min() / self.sigma


def of_channels(n: int, C: int) -> Array:
    """Return how a wander of each channel by itself shows in n rows, (n, C, C)."""
    return np.asarray(np.broadcast_to(np.eye(C), (n, C, C)))
