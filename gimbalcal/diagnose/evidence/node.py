"""One possible noise of the reduced rows of a view, over a grid of which the diagnosis integrates."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import reduce
from operator import iadd

import numpy as np

from gimbalcal.inference.noise_processes import Cascade, Chain, Noise
from gimbalcal.inference.whitening import Modes, Whitening
from gimbalcal.number import Array

SINGLE_WALK = tuple(np.geomspace(2.5, 250.0, 11).tolist())  # sigmas of a dwell mean, of one sensor over the recording
TRIAD_WALK = (2.0, 6.0, 18.0, 54.0)  # sigmas of all rows, of the likeliest time history of a walk of each sensor
SINGLE_WALK_PRIOR = 0.01  # prior probability of each of these: three times that of a drift of this accelerometer
SINGLE_WALK_PRIOR_AT_REST = 0.003  # that of a drift: in a static run and at rest slow causes resemble it


@dataclass(frozen=True)
class Node:
    """One possible noise: its processes, how they whiten reduced rows, their log determinant and prior probability."""

    name: tuple[tuple[str, float], ...]
    noise: Mapping[str, Noise]  # by quantity, per sigma of a row; that of a gimbal setting in rad
    prior: float
    logdet: float
    inverse_root: Array | Chain | Cascade | Whitening | Modes  # (R,) of a diagonal; of rows of each channel; of all
    fresh: float = 1.0  # share of the variance of a row that the rows before do not hold
    single_walk: str = ""  # axis of the sensor with a random walk of its own, if any
    channels: tuple[Node, ...] = ()  # noises, of which each channel has its own
    scales: tuple[float, ...] = ()  # of the channels against those of the rows, geometric mean one; () where one is all

    @classmethod
    def of_channels(cls, parts: tuple[Node, ...]) -> Node:
        """Return the noise in which each of C channels has its part, a noise of all of them."""
        name = tuple((f"{key} of channel {c}", x) for c, part in enumerate(parts, 1) for key, x in part.name)
        prior, logdet = float(np.prod([p.prior for p in parts])), sum(p.logdet for p in parts) / len(parts)
        return cls(name, {}, prior, logdet, parts[0].inverse_root, channels=parts)

    def of_scales(self, log_scales: Array, log_share: float) -> Node:
        """Return the noise with these ln scales (C,) of its channels, of mean zero, and this share of its prior."""
        scales = tuple(np.exp(log_scales).tolist())
        return replace(self, prior=self.prior * float(np.exp(log_share)), scales=scales)

    def rescaled(self, ratio: Array) -> Node:
        """Return the noise for rows whose channels are divided by scales that are less by a ratio (C,)."""
        return replace(self, scales=tuple((ratio * np.array(self.scales)).tolist())) if self.scales else self

    def whiten(self, rows: Array) -> Array:
        """Reduced rows (R, p) to unit covariance; those beyond the coloured ones have it already."""
        root = self.inverse_root
        if self.scales:
            rows = rows / np.resize(self.scales, len(rows))[:, None]
        if self.channels:
            white = np.empty(rows.shape)
            for c, part in enumerate(self.channels):
                white[c :: len(self.channels)] = part.whiten(rows)[c :: len(self.channels)]
            return white
        if isinstance(root, Chain | Cascade):
            return root.whiten(rows)
        if isinstance(root, Whitening | Modes):
            white = root.whiten(rows[: root.rows])
            return white if root.rows == len(rows) else np.concatenate([white, rows[root.rows :]])
        return np.concatenate([root[:, None] * rows[: len(root)], rows[len(root) :]])

    def products(self, rows: Array, these: Array | slice = slice(None)) -> Array:
        """`these` of W (R, p), whitened rows that are never all there where they are many, with all: (these, p)."""
        root = self.inverse_root
        if isinstance(root, Whitening) and root.rows == len(rows) and not self.scales:
            return np.asarray(reduce(iadd, (W[:, these].T @ W for W in root.parts(rows))))
        W = self.whiten(rows)
        return np.asarray(W[:, these].T @ W)

    def products_of_channels(self, rows: Array, C: int) -> Array:
        """Return products (C, p, p) of whitened rows (n C, p) with each other, those of each channel by themselves."""
        root = self.inverse_root
        parts = root.parts(rows) if isinstance(root, Whitening) else iter((self.whiten(rows),))
        return reduce(iadd, (np.stack([W[c::C].T @ W[c::C] for c in range(C)]) for W in parts))

    def colour(self, white: Array) -> Array:
        """Independent rows (R, p) of unit variance to coloured ones of a stated noise: what `whiten` undoes."""
        root = self.inverse_root
        if isinstance(root, Whitening):
            return root.colour(white)
        scale = np.asarray(root)[:, None]
        return np.concatenate([white[: len(scale)] / scale, white[len(scale) :]])

    @property
    def coloured(self) -> int:
        """The number of reduced rows that are not white: all of a device test, the slowest of a static run."""
        root = self.inverse_root
        return root.rows if isinstance(root, Whitening | Modes) else len(root)
