r"""Whitening and spectrum of noise, from the Phi, Q, H, P_0 of its processes.

A noise is a tuple of independent processes that add up, :math:`V = \sum_p E[y_p y_p^T]`. A process of one state is a
chain, whose precision is bidiagonal twice over,

.. math:: V^{-1} = L^T L, \qquad (L y)_k = (y_k - \Phi_k y_{k-1}) / \sqrt{Q_k}

so that whitening costs one product per row. Source: Sarkka (2013), Eqs. (4.1) and (6.5).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from gimbalcal.effects.process import Process
from gimbalcal.number import Array

Noise = tuple[Process, ...]


def one_sigma(noise: Sequence[Process]) -> float:
    """Return one standard deviation of the first row."""
    return float(np.sqrt(sum(p.output() ** 2 @ p.initial() for p in noise)))


class Chain(NamedTuple):
    """A process of one state over n rows: transition from the row before, and new variance."""

    Phi: Array  # (n,), the first unused
    Q: Array  # (n,), the first that of the first row

    @property
    def rows(self) -> int:
        """Number of rows n."""
        return len(self.Q)

    def whiten(self, rows: Array) -> Array:
        """Whiten rows (n, ...), or (n C, ...) of C channels, each of this covariance."""
        y, Phi, Q = rows.reshape(self.rows, -1), self.Phi[1:, None], self.Q[1:, None]
        white = np.concatenate([y[:1] / np.sqrt(self.Q[0]), (y[1:] - Phi * y[:-1]) / np.sqrt(Q)])
        return white.reshape(rows.shape)

    @property
    def log_determinant(self) -> float:
        """ln |V|."""
        return float(np.log(self.Q).sum())

    @property
    def precision(self) -> tuple[Array, Array]:
        """Diagonal (n,) and first off-diagonal (n - 1,) of V^-1."""
        diagonal = 1 / self.Q
        diagonal[:-1] += self.Phi[1:] ** 2 / self.Q[1:]
        return diagonal, -self.Phi[1:] / self.Q[1:]


class Cascade(NamedTuple):
    """Two processes of one state, the first driven by the second: noise of second order, of two memories."""

    driven: Chain
    driving: Chain

    @property
    def rows(self) -> int:
        """Number of rows n."""
        return self.driven.rows

    def whiten(self, rows: Array) -> Array:
        """Whiten rows (n, ...), or (n C, ...) of C channels, each of this covariance."""
        return self.driving.whiten(self.driven.whiten(rows))

    @property
    def log_determinant(self) -> float:
        """ln |V|."""
        return self.driven.log_determinant + self.driving.log_determinant


def chain(process: Process, time: Array) -> Chain:
    """Return the chain of a process of one state that began, with its P_0, one median step before the first row.

    This has no effect on a stationary process; a random walk is zero there. Raises ValueError for more states.
    """
    h = np.append(np.median(np.diff(time)) if len(time) > 1 else 0.0, np.diff(time))
    still = np.zeros(len(time), dtype=bool)
    Phi, Q, H = process.transition(h, still), process.diffusion(h, still), process.output()
    if len(H) > 1:
        raise ValueError(f"`process` must have one state, {process.id} has {len(H)}")
    Q = Q[:, 0] * H[0] ** 2
    Q[0] += Phi[0, 0] ** 2 * process.initial()[0] * H[0] ** 2
    return Chain(Phi[:, 0], Q)


def spectrum(noise: Sequence[Process], step: float, angle: Array) -> Array:
    r"""Return the variance (k,) of modes cos(angle (j + 1/2)), j = 0, 1, ..., of rows every `step` [s], angle [rad].

    .. math:: S(\theta) = \sum \frac{H^2 Q}{1 + \Phi^2 - 2 \Phi \cos\theta}

    over all states. In a long run the orthonormal cosine transform makes stationary noise independent from mode to
    mode, and a random walk with free ends exactly so in a run of any length.
    """
    h, still = np.array([step]), np.zeros(1, dtype=bool)
    total = np.zeros(len(angle))
    for process in noise:
        terms = zip(process.transition(h, still)[0], process.diffusion(h, still)[0], process.output(), strict=True)
        for Phi, Q, H in terms:
            total += H**2 * Q / (1 + Phi**2 - 2 * Phi * np.cos(angle))
    return total
