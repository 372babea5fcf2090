"""What the noise of the rows of a view may be, and the map by which rows of slow physics are reduced without loss."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from gimbalcal.number import Array

SingleWalk = tuple[str, float, float, float]
"""Axis of the sensor with a random walk, size of the walk, memory and share of the additional wander of all sensors."""
TriadWalks = tuple[float, ...]
"""Memory from row to row, and size of the walk of each sensor of each triad."""


@dataclass(frozen=True, eq=False)
class NoiseModel:
    r"""Noise of n rows of C channels: white with a scale that is known, or that is integrated over, and correlated.

    Scale known: sigma (C,) [SI] is one sigma of a row, weights (n, C), of mean one, are those of samples with heavy
    tails, of excess kurtosis `kurtosis`; scatter (C,) is that of the rows in units of the stated sigma, where there are
    rows enough. Rows are reduced without loss for slow physics: a dwell to the means of a few blocks, `block` (n,)
    being the ordinal of that of each row; without blocks, each channel to its orthonormal cosine transform, in which
    white noise stays white and a random walk becomes diagonal: rows follow one another evenly, and what varies from one
    to the next is noise.

    Else: sigma (n, C) is what the samples say of one row against another, where they do; sample (n, C) what their
    scatter alone makes of a row, which bounds the scale; wander (n, C, m) how what m sensors wander from row to row
    shows in the rows, of unit length; single_walks and triad_walks are random walks that one sensor may take, or all of
    a triad; scales are the sigmas of the channels beyond these, the least being one, where channels scatter
    differently. `of_each_channel`: the diagnosis weighs one scale of all channels against one of each, and an estimate
    has an excess of each. It is set for the axes of gyroscopes, of which one may scatter thirty times as much as
    another, and of a mount that tracks, where one axis has the errors of the drive; the two channels of stars all over
    the sky share most terms of a mount, and there own scales name causes that one scale denies, some of them wrongly,
    unless the whole diagnosis is likelier in them.
    """

    sigma: Array | None = None
    sample: Array | None = None
    wander: Array | None = None
    single_walks: tuple[SingleWalk, ...] = ()
    triad_walks: tuple[TriadWalks, ...] = ()
    scale_known: bool = False  # by the header, by samples inside dwells or by a fit
    block: Array = field(default_factory=lambda: np.zeros(0, dtype=int))
    of_each_channel: bool = False  # whether each channel has a scale of its own where none is known
    own_memories: bool = False  # whether each channel has a memory of its own: they are smooth from row to row
    scales: tuple[float, ...] = ()
    one_scale: bool = False  # of all channels, as one of them shows no noise
    weights: Array | None = None
    kurtosis: float = 0.0
    scatter: Array | None = None

    @property
    def sensors_walk(self) -> bool:
        """Return whether random walks of sensors are among the noises."""
        return bool(self.single_walks or self.triad_walks)

    @property
    def in_blocks(self) -> bool:
        """Return whether rows of a known scale are reduced to the means of blocks, not to their cosine transform."""
        return bool(len(self.block))

    @property
    def starts(self) -> Array:
        """First row of each block."""
        return np.flatnonzero(np.diff(self.block, prepend=-1))

    def parts_of_variance(self, shape: tuple[int, int]) -> tuple[Array, Array]:
        """Return the known variance (n, C) of rows, SI, and the shape (n, C) of what is added to it times excess^2.

        Nothing is added to a noise of known scale; beyond their samples all rows scatter alike; where nothing is known
        of the scale, sigma tells how rows scatter against each other.
        """
        zero, sigma = np.zeros(shape), 1.0 if self.sigma is None else self.sigma
        if self.scale_known:
            return zero + sigma**2, zero
        return (zero, zero + sigma**2) if self.sample is None else (self.sample**2 + zero, zero + 1.0)

    def scaled(self, X: Array) -> Array:
        """Return rows (n, C, ...) in units of a noise of known scale, else as they are."""
        return X / self.sigma.reshape(-1, *([1] * (X.ndim - 2))) if self.scale_known and self.sigma is not None else X

    def weighted(self, X: Array) -> Array:
        """Return rows (n, C, ...) such that white noise has the same variance in all of them: times `weight`."""
        if self.weights is None and (self.scale_known or self.sigma is None) and not self.scales:
            return X
        weight = self.weight((X.shape[0], X.shape[1]))
        return np.asarray(X * weight.reshape(*weight.shape, *([1] * (X.ndim - 2))))

    def weight(self, shape: tuple[int, int]) -> Array:
        """Return the weights (n, C) of `weighted` for rows of this shape; the surest has one if no scale is known."""
        if self.scale_known:
            return np.ones(shape) if self.weights is None else np.sqrt(self.weights)
        weight = np.ones(shape) if self.sigma is None else self.sigma.min() / self.sigma
        return weight / np.array(self.scales) if self.scales else weight

    def reduced(self, X: Array) -> Array:
        """Return columns (n, C, p) as rows (R, p): weighted block means times the root of their count, or transformed.

        Where the scale is not known they are the weighted rows themselves.
        """
        n, C, p = X.shape
        if not self.scale_known:
            return self.weighted(X).reshape(n * C, p)
        if not self.in_blocks:
            from scipy.fft import dct

            return np.asarray(dct(self.weighted(X), axis=0, norm="ortho")).reshape(n * C, p)
        starts = self.starts
        count = np.diff(np.append(starts, n))
        if self.weights is None:
            total = np.add.reduceat(X, starts, axis=0) / np.sqrt(count)[:, None, None]
        else:
            share = np.sqrt(count)[:, None] / np.add.reduceat(self.weights, starts, axis=0)
            total = np.add.reduceat(X * self.weights[:, :, None], starts, axis=0) * share[:, :, None]
        return np.asarray(total.reshape(len(count) * C, p))


def of_channels(n: int, C: int) -> Array:
    """Return how a wander of each channel by itself shows in n rows, (n, C, C)."""
    return np.asarray(np.broadcast_to(np.eye(C), (n, C, C)))
