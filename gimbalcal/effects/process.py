"""Noise processes as state-space models that simulator, filter and covariance share.

A process is a zero-mean Gauss-Markov chain x_{k+1} = Phi(h) x_k + w, w ~ N(0, Q(h)), y = H x, x_0 ~ N(0, P_0), where h
is the time between two samples and a move may end the memory. `sample`, `covariance` and everything that whitens or
filters (`inference.noise_processes`) use only these four, so that a simulated record and the covariance that a fit
assumes cannot differ.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from gimbalcal.effects.history import recursion, relaxation
from gimbalcal.number import Array

OCTAVE = np.log(2.0)


@dataclass(frozen=True)
class Process:
    """A noise process; every state is a chain of its own, so Phi, Q and P_0 are diagonals (m,)."""

    id: ClassVar[str] = ""
    unit: ClassVar[str] = ""  # of the first field, for an accelerometer
    sources: ClassVar[tuple[str, ...]] = ()

    def transition(self, h: Array, moved: Array) -> Array:
        """Return Phi (n, m) over steps h (n,) [s]; moved (n,) tells where the platform went to another position."""
        raise NotImplementedError

    def diffusion(self, h: Array, moved: Array) -> Array:
        """Return Q (n, m), the variance that enters over each step."""
        raise NotImplementedError

    def output(self) -> Array:
        """Return H (m,); the states add up where a process does not say otherwise."""
        return np.ones(len(self.initial()))

    def initial(self) -> Array:
        """Return P_0 (m,), the variance of the first state."""
        raise NotImplementedError


@dataclass(frozen=True)
class WhiteNoise(Process):
    r"""Independent errors of each sample.

    .. math:: E[y_i y_j] = \sigma^2 \delta_{ij}

    Source: IEEE Std 528, random noise. Seen by: the scatter within a dwell.
    """

    sigma: float
    id = "white_noise"
    unit = "ug"
    sources = ("ieee528",)

    def transition(self, h: Array, moved: Array) -> Array:
        return np.zeros((len(h), 1)) * moved[:, None]

    def diffusion(self, h: Array, moved: Array) -> Array:
        return np.full((len(h), 1), self.sigma**2) + 0.0 * moved[:, None]

    def initial(self) -> Array:
        return np.array([self.sigma**2])


@dataclass(frozen=True)
class Quantisation(Process):
    r"""The output comes in steps: where the signal crosses many of them, white noise of a twelfth of a step squared.

    .. math:: y = q \, \operatorname{round}(x / q) - x, \qquad \sigma^2 = q^2 / 12

    Source: IEEE Std 1293, quantisation. Magnitude: 0.1 to 1 ug. Seen by: repeated codes.
    """

    q: float
    id = "quantisation"
    unit = "ug"
    sources = ("ieee1293",)

    def rounded(self, x: Array) -> Array:
        """Return the reading in whole steps."""
        return np.asarray(self.q * np.round(x / self.q))

    def transition(self, h: Array, moved: Array) -> Array:
        return WhiteNoise(self.q).transition(h, moved)

    def diffusion(self, h: Array, moved: Array) -> Array:
        return WhiteNoise(self.q / np.sqrt(12)).diffusion(h, moved)

    def initial(self) -> Array:
        return np.array([self.q**2 / 12])


@dataclass(frozen=True)
class RandomWalk(Process):
    r"""The error adds up independent steps: bias random walk, or angle random walk of an integrated rate.

    .. math:: E[(y(t + h) - y(t))^2] = N^2 h

    Source: IEEE Std 952, random walk. Magnitude: 0.2 to 3 ug/sqrt(h), 0.001 deg/sqrt(h). Seen by: slow residuals, in
    competition with every slow effect. N is in SI: per sqrt(s).
    """

    N: float
    id = "random_walk"
    unit = "ug/sqrt(h)"
    sources = ("ieee952",)

    def transition(self, h: Array, moved: Array) -> Array:
        return relaxation(h, None)[:, None] + 0.0 * moved[:, None]

    def diffusion(self, h: Array, moved: Array) -> Array:
        return (self.N**2 * h + 0.0 * moved)[:, None]

    def initial(self) -> Array:
        return np.zeros(1)


@dataclass(frozen=True)
class GaussMarkov(Process):
    r"""An exponentially correlated error.

    .. math:: E[y(t) y(t + h)] = \sigma^2 e^{-|h| / \tau}

    Source: IEEE Std 952, exponentially correlated noise. Seen by: residuals with one corner frequency.
    """

    sigma: float
    tau: float
    id = "gauss_markov"
    unit = "ug"
    sources = ("ieee952", "sarkka2013")

    def transition(self, h: Array, moved: Array) -> Array:
        return relaxation(h, self.tau)[:, None] + 0.0 * moved[:, None]

    def diffusion(self, h: Array, moved: Array) -> Array:
        return (-(self.sigma**2) * np.expm1(-2 * h / self.tau) + 0.0 * moved)[:, None]

    def initial(self) -> Array:
        return np.array([self.sigma**2])


@dataclass(frozen=True)
class Flicker(Process):
    r"""1/f noise, the floor of an Allan deviation, as a sum of Gauss-Markov processes, one per octave of tau.

    .. math:: S(f) = \frac{B^2}{2 \pi} \frac{1}{f} \;(\text{two-sided}), \qquad
              \sigma_{octave}^2 = \frac{B^2 \ln 2}{\pi}

    flat in f S(f) between the corner frequencies of `shortest` and `longest` [s]: within 1 % except for a factor of ten
    at either end, 11 % low at a corner; with processes every three `octaves`, a third as many, within 7 %. Source: IEEE
    Std 952, bias instability: the floor of the Allan deviation is sqrt(2 ln 2 / pi) B = 0.664 B.
    """

    B: float
    shortest: float = 1.0
    longest: float = 86400.0
    octaves: float = 1.0
    id = "flicker"
    unit = "ug"
    sources = ("ieee952",)

    @property
    def taus(self) -> Array:
        """Time constants [s] in steps of an octave, or of `octaves`, to two octaves or more beyond either end."""
        first, last = np.log2(self.shortest) - 2, np.log2(self.longest) + 2
        last = first + self.octaves * np.ceil((last - first) / self.octaves - 1e-9)
        return np.asarray(2.0 ** np.arange(first, last + 1e-9, self.octaves))

    def transition(self, h: Array, moved: Array) -> Array:
        return relaxation(h[:, None], self.taus) + 0.0 * moved[:, None]

    def diffusion(self, h: Array, moved: Array) -> Array:
        return -self.initial() * np.expm1(-2 * h[:, None] / self.taus) + 0.0 * moved[:, None]

    def initial(self) -> Array:
        return np.full(len(self.taus), self.B**2 * self.octaves * OCTAVE / np.pi)


@dataclass(frozen=True)
class SettingError(Process):
    r"""Setting repeatability: each time a gimbal is set, it stops a little off, constant in a dwell, new in the next.

    .. math:: E[y_i y_j] = \sigma^2 [\text{same dwell}]

    Source: Wu et al. (2018), section 4, angle error of a position. Magnitude: 0.3 to 2 arcsec. Seen by: one position,
    three channels, across the force. It limits the effective sample size to the number of positions.
    """

    sigma: float
    id = "setting_error"
    unit = "arcsec"
    sources = ("wu2018",)

    def transition(self, h: Array, moved: Array) -> Array:
        return np.where(moved, 0.0, 1.0)[:, None] + 0.0 * h[:, None]

    def diffusion(self, h: Array, moved: Array) -> Array:
        return np.where(moved, self.sigma**2, 0.0)[:, None] + 0.0 * h[:, None]

    def initial(self) -> Array:
        return np.array([self.sigma**2])


def sample(
    process: Process, rng: np.random.Generator, time: Array, visit: Array | None = None, state: Array | None = None
) -> tuple[Array, Array]:
    """Return one realisation y (n,) at time (n,) [s], and the last state (m,) to continue from.

    With `state` the first sample is one step after that state, with the step of the first two samples.
    """
    h, moved = steps(time, visit)
    Phi, Q = process.transition(h, moved), process.diffusion(h, moved)
    if state is None:
        Phi[0], Q[0], state = 0.0, process.initial(), np.zeros(Phi.shape[1])
    y = np.zeros(len(time))
    last = np.empty(Phi.shape[1])
    for i, H in enumerate(process.output()):
        w = np.sqrt(Q[:, i]) * rng.standard_normal(len(time))
        w[0] += Phi[0, i] * state[i]
        x = recursion(Phi[:, i], w) if np.any(Phi[:, i]) else w
        y += H * x
        last[i] = x[-1]
    return y, last


def covariance(process: Process, time: Array, visit: Array | None = None) -> Array:
    """Return E[y y'] (n, n) at time (n,) [s]."""
    h, moved = steps(time, visit)
    Phi, Q = process.transition(h, moved), process.diffusion(h, moved)
    n = len(time)
    P = np.zeros((n, n))
    for i, H in enumerate(process.output()):
        row, variance = np.zeros(n), process.initial()[i]
        for k in range(n):
            if k:
                variance = Phi[k, i] ** 2 * variance + Q[k, i]
                row = Phi[k, i] * row
            row[k] = variance
            P[k, : k + 1] += H**2 * row[: k + 1]
    return P + np.tril(P, -1).T


def steps(time: Array, visit: Array | None) -> tuple[Array, Array]:
    """Return the time since the sample before (the first: as the second), and whether there was a move in between."""
    h = np.diff(time, prepend=2 * time[0] - time[1]) if len(time) > 1 else np.zeros(1)
    moved = np.zeros(len(time), dtype=bool) if visit is None else np.diff(visit, prepend=visit[0]) != 0
    return h, moved
