r"""The evidence for a stated scale of the noise, and for an unknown scale, which is integrated over.

Columns of size s reduce the misfit by `gain`; the misfit is that of the residual, with `dof` degrees of freedom.

.. math:: \ln L = -\tfrac12 (m - gain) \text{ in units of the stated scale}, \qquad
    \ln L = -\tfrac{dof}{2} \ln (m - gain) + \ln \rho(\hat\sigma), \quad \hat\sigma^2 = (m - gain) / dof

The second is the integral of sigma^-dof exp(-m / 2 sigma^2) over ln sigma; rho, the prior density of the scale,
is evaluated at the maximum of the integrand. Sizes are then in prior sigmas per sigma of the noise, and the prior of a
size is that of its value at the estimated sigma.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from gimbalcal.number import Array

SIZES = np.array([0.001, 0.01, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0])  # times the catalogue's prior sigma
SIZE_PRIOR = np.array([0.04, 0.08, 0.15, 0.18, 0.22, 0.15, 0.10, 0.05, 0.03])
# If the noise is not stated, sizes are relative to those of the grade and to the misfit, up to thirty times them. A
# shape of a hundred times the misfit, all but a hundredth of which the calibration absorbs, would fit anything.
NEAR_SIZES = np.array([0.1, 0.3, 1.0, 3.0, 10.0, 30.0])
NEAR_PRIOR = np.array([0.15, 0.2, 0.25, 0.2, 0.12, 0.08])
ANY_SIZE = np.geomspace(1e-4, 1e3, 29)  # fine enough that confounded causes of different plausible sizes fit alike
RATIOS = np.geomspace(1e-3, 1e5, 17)  # prior sigmas per sigma of a noise of any scale
ANY_RATIO = np.geomspace(1e-4, 1e6, 41)
# steps of the ratio, a factor of ten, that a cause may need together with others, which may leave much less noise
SCALE_STEPS_BELOW = 2
WANDERS = 1.0  # mean of ln(noise between rows / scatter of their samples) if positive
OVERRATED_RATIO = 0.3  # the same if negative: the tremor of a hand averages out
MIN_MISFIT_SHARE = 0.003  # of the rms misfit: a cause may take away all but 1 / 300 of it


@dataclass(frozen=True)
class Channels:
    """Channels of rows that may have scales of their own.

    scale: by which the rows of each have been divided, beyond a common unit; sample: rms of a row of each by the
    scatter of its samples, in the unit of rows, empty where it is unknown; max_memory: from row to row, of a noise
    in which they may. In noises with a walk of one sensor, a single channel of large scatter is that sensor.
    """

    scale: tuple[float, ...]
    sample: tuple[float, ...] = ()
    max_memory: float = 1.0

    def alike(self, scales: Sequence[float]) -> bool:
        """Return whether rows of these scales (C,) scatter alike before they were divided."""
        total = np.log(self.scale) + np.log(scales)
        return bool(np.ptp(total) < 1e-9)


def log_density_of_scale(sigma: Array, sample: float, fresh: float = 1.0) -> Array:
    """Return ln of the density of ln(sigma) by the samples, without its norm: see `Free`."""
    above = np.log(sigma / sample)
    return np.asarray(-np.maximum(above, 0.0) / WANDERS - np.maximum(-above - np.log(fresh), 0.0) / OVERRATED_RATIO)


def log_norm(fresh: float) -> float:
    """Return ln of the integral of `log_density_of_scale`."""
    return float(np.log(WANDERS + OVERRATED_RATIO - np.log(fresh)))


@dataclass(frozen=True)
class Stated:
    """A noise whose scale is known: rows are in units of it."""

    channels: ClassVar[None] = None
    sizes: ClassVar[Array] = SIZES
    any_size: ClassVar[Array] = ANY_SIZE
    looser: ClassVar[tuple[int, ...]] = (0,)

    def with_memory(self, _: float) -> Stated:
        """Return the scale in a noise of memory: what was stated is the scatter within a row."""
        return self

    def of_channels(self, _: Sequence[float]) -> Stated:
        """Return the scale itself, which holds for all channels."""
        return self

    def sigma(self, misfit: Array) -> Array:
        """The scale, which does not depend on the misfit (...)."""
        return np.ones_like(misfit)

    def log_likelihood(self, misfit: Array) -> Array:
        """ln L of the remaining misfit (...)."""
        return np.asarray(-0.5 * misfit)

    def gained(self, _: Array, gain: Array) -> Array:
        """ln L gained by a reduction of the misfit by `gain` (...)."""
        return 0.5 * gain

    def log_prior(self, misfit: Array) -> Array:
        """ln of the prior share of each size (..., sizes), at which `misfit` (..., sizes) remains."""
        return np.broadcast_to(np.log(SIZE_PRIOR), misfit.shape)


STATED = Stated()


@dataclass(frozen=True)
class Free:
    r"""A noise of unknown scale, flat in its logarithm; if rows are means, related to the scatter of their samples.

    sample: rms of a row by that scatter, 0 where it is unknown. The noise between rows is of that order, seldom
    smaller, often larger, as sensors wander from rest to rest:

    .. math:: p(\ln\sigma) \propto e^{-\ln(\sigma / s) / 1} \; (\sigma > s), \quad
              e^{-\ln(s / \sigma_0) / 0.3} \; (\sigma_0 < s)

    with sigma_0 = sigma times `fresh`, the share of innovations: the scatter of the samples does not depend on a
    wander.
    """

    dof: int
    sample: float | tuple[float, ...] = 0.0  # of each channel, where they have scales of their own
    fresh: float = 1.0
    channels: Channels | None = None  # that may have scales of their own
    sizes: ClassVar[Array] = RATIOS
    any_size: ClassVar[Array] = ANY_RATIO
    looser: ClassVar[tuple[int, ...]] = (0, SCALE_STEPS_BELOW)

    def with_memory(self, fresh: float) -> Free:
        """Return the scale in a noise in which this share of a row's variance is new."""
        return replace(self, fresh=float(np.sqrt(fresh)))

    def of_channels(self, scales: Sequence[float]) -> Free:
        """Return the scale where each channel has another multiple (C,) of it."""
        if self.channels is None or not self.channels.sample or self.channels.alike(scales):
            return self
        return replace(self, sample=tuple(a / k for a, k in zip(self.channels.sample, scales, strict=True)))

    def sigma(self, misfit: Array) -> Array:
        """The likeliest scale where this misfit (...) is left."""
        dof = max(self.dof, 1)
        return np.sqrt(np.maximum(misfit / dof, MIN_MISFIT_SHARE**2))

    def log_likelihood(self, misfit: Array) -> Array:
        """ln L of the remaining misfit (...), up to a constant."""
        sigma = self.sigma(misfit)
        out = -self.dof * np.log(sigma)
        samples = self.sample if isinstance(self.sample, tuple) else (self.sample,)
        for sample in samples:
            if sample > 0:
                out = out + log_density_of_scale(sigma, sample, self.fresh)
        return np.asarray(out - (len(samples) - 1) * log_norm(self.fresh))

    def gained(self, misfit: Array, gain: Array) -> Array:
        """ln L gained by a reduction of the misfit by `gain` (...)."""
        return self.log_likelihood(misfit - gain) - self.log_likelihood(misfit)

    def log_prior(self, misfit: Array) -> Array:
        """ln of the prior share of each ratio (..., ratios): the density of the size that it is at this scale."""
        size = np.log(self.sizes * self.sigma(misfit))
        with np.errstate(divide="ignore"):
            return np.asarray(np.log(np.interp(size, *_DENSITY, left=0.0, right=0.0) * np.log(RATIOS[1] / RATIOS[0])))


def _density() -> tuple[Array, Array]:
    """Knots of the prior density of ln(size), linear in between, that gives each of NEAR_SIZES its share."""
    x = np.log(NEAR_SIZES)
    x = np.concatenate([[2 * x[0] - x[1]], x, [2 * x[-1] - x[-2]]])
    return x, np.concatenate([[0.0], NEAR_PRIOR / (x[2:] - x[:-2]) * 2, [0.0]])


_DENSITY = _density()
