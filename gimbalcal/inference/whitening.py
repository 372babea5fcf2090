r"""Whitening of rows of several channels by a Kalman filter of coloured states.

.. math:: x_k = \Phi_k x_{k-1} + w_k, \quad w_k \sim (0, Q_k), \qquad y_k = H_k x_k + e_k, \quad e_k \sim (0, I)

The innovations, each by the inverse root of its covariance, are :math:`L^{-1} y` with :math:`V = L L^T`, which is never
formed: the cost is m C a row instead of n C. Source: Sarkka (2013), Eqs. (4.20) to (4.22).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from gimbalcal.inference.noise_processes import Chain
from gimbalcal.number import Array

BATCH_NUMBERS = 2_000_000  # numbers, 16 MB
HIDDEN_VARIANCE = 1e-2  # variance of a mode in that of white noise: it changes ln L by a quarter of its square


class Whitening(NamedTuple):
    """Filter over n rows of C channels and m states: transition, observation, gain, innovation's root and inverse."""

    Phi: Array  # (n, m)
    H: Array  # (n, C, m)
    gain: Array  # (n, m, C)
    root: Array  # (n, C, C) lower triangles
    inverse: Array  # (n, C, C)

    def whiten(self, rows: Array) -> Array:
        """Whiten rows (n C, p) of this covariance."""
        out = np.empty((len(rows), rows.size // len(rows)))
        at = 0
        for part in self.parts(rows):
            out[at : at + len(part)] = part
            at += len(part)
        return out.reshape(rows.shape)

    def parts(self, rows: Array) -> Iterator[Array]:
        """Yield whitened rows in batches of some `BATCH_NUMBERS` numbers."""
        n, m, C = self.gain.shape
        y = rows.reshape(n, C, -1)
        p = y.shape[-1]
        state, after, step = np.zeros((m + C, p)), np.zeros((m + C, p)), max(1, BATCH_NUMBERS // max(C * p, 1))
        for start in range(0, n, step):
            out = np.empty((min(step, n - start), C, p))
            for k, filtered in enumerate(self._of_state_and_row(slice(start, start + step))):
                state[m:] = y[start + k]
                np.matmul(filtered, state, out=after)
                out[k] = after[m:]
                state, after = after, state
            yield out.reshape(len(out) * C, p)

    def _of_state_and_row(self, these: slice) -> Array:
        r"""Return the matrices (n, m + C, m + C) that make of a state and a row the next state and the white row.

        .. math:: x_k = (\Phi - K H \Phi) x_{k-1} + K y_k, \qquad w_k = L^{-1} (y_k - H \Phi x_{k-1})
        """
        Phi, H, gain, inverse = self.Phi[these], self.H[these], self.gain[these], self.inverse[these]
        seen = H * Phi[:, None, :]
        kept = np.eye(Phi.shape[1]) * Phi[:, None, :] - gain @ seen
        return np.concatenate(
            [np.concatenate([kept, gain], axis=2), np.concatenate([-inverse @ seen, inverse], axis=2)], axis=1
        )

    def colour(self, white: Array) -> Array:
        """Colour independent rows (n C, p) of unit variance with this covariance."""
        n, m, C = self.gain.shape
        e, out = white.reshape(n, C, -1), np.empty((n, C, white.size // (n * C)))
        x = np.zeros((m, out.shape[-1]))
        for k in range(n):
            x *= self.Phi[k, :, None]
            innovation = self.root[k] @ e[k]
            out[k] = self.H[k] @ x + innovation
            x += self.gain[k] @ innovation
        return out.reshape(white.shape)

    def of_scale(self, sigma: float) -> Whitening:
        """Return the filter for rows that are `sigma` times as large."""
        return self._replace(root=self.root * sigma, inverse=self.inverse / sigma)

    @property
    def rows(self) -> int:
        """Number of rows of all channels."""
        return int(np.prod(self.root.shape[:2]))

    @property
    def log_determinant(self) -> float:
        """ln |V|."""
        return 2 * float(np.log(np.diagonal(self.root, axis1=1, axis2=2)).sum())


class Modes(NamedTuple):
    r"""Columns of random sizes in addition to the noise of each channel; orthonormal, u (R, m), once it is whitened.

    .. math:: V = L \left(I + u \Lambda u^T\right) L^T, \qquad
        V^{-1/2} = \left(I - u \left(1 - (1 + \Lambda)^{-1/2}\right) u^T\right) L^{-1}
    """

    noise: Chain
    u: Array  # (R, m)
    variance: Array  # (m,), Lambda

    @property
    def rows(self) -> int:
        """Number of rows R of all channels."""
        return len(self.u)

    @property
    def log_determinant(self) -> float:
        """ln |V|."""
        channels = self.rows // self.noise.rows
        return channels * self.noise.log_determinant + float(np.log1p(self.variance).sum())

    def whiten(self, rows: Array) -> Array:
        """Whiten rows (R, p) of this covariance."""
        white = self.noise.whiten(rows)
        less = 1 - 1 / np.sqrt(1 + self.variance)
        return np.asarray(white - self.u @ (less[:, None] * (self.u.T @ white)))


def modes(X: Array, noise: Chain) -> Modes:
    """Return columns X (R, p) of independent sizes of unit variance as modes, except those below the noise."""
    X = noise.whiten(X)
    variance, v = np.linalg.eigh(X.T @ X)
    shown = variance > HIDDEN_VARIANCE
    return Modes(noise, X @ (v[:, shown] / np.sqrt(variance[shown])), variance[shown])


def whitening(Phi: Array, Q: Array, H: Array) -> Whitening:
    """Return the filter of independent states, Phi, Q (n, m), observed by H (n, C, m) in white noise of unit variance.

    The states are zero before the first row: the first Q is their initial variance.
    """
    (whitened,) = whitenings(Phi[None], Q[None], H)
    return whitened


def whitenings(Phi: Array, Q: Array, H: Array) -> list[Whitening]:
    """Return the filters of B sets of states, Phi, Q (B, n, m), of the same observation, all at once."""
    n, C, m = H.shape
    gain, root = np.empty((len(Phi), n, m, C)), np.empty((len(Phi), n, C, C))
    P = np.zeros((len(Phi), m, m))
    for k in range(n):
        P = Phi[:, k, :, None] * P * Phi[:, k, None, :] + Q[:, k, :, None] * np.eye(m)
        PH = P @ H[k].T
        S = H[k] @ PH + np.eye(C)
        root[:, k] = np.linalg.cholesky(S)
        gain[:, k] = np.swapaxes(np.linalg.solve(S, np.swapaxes(PH, -1, -2)), -1, -2)
        P = P - gain[:, k] @ np.swapaxes(PH, -1, -2)
        P = (P + np.swapaxes(P, -1, -2)) / 2
    return [Whitening(Phi[b], H, gain[b], root[b], np.linalg.inv(root[b])) for b in range(len(Phi))]
