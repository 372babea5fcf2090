r"""Inertial sensors read in pulses: the polynomial models of Wang et al. (2019), from pulses to physics.

Direction: **pulses to force and rate** (a correction). `physical` turns what was counted into what was there;
`counts` is the exact inverse (a corruption). The effects of `gimbalcal.effects` go the other way, from what is there to
what is read; `estimate.gyroscopes.revolutions.as_effects` converts those of gyroscopes.

.. math::
    f^p &= C_a^p (K_{a1} N + K_{a2} N^2 + K_{a3} N^3 + \nabla)                      & (2)-(5) \\
    \omega^q &= C_g^q (K_{g1} N + K_{g2} N^2 + \varepsilon)                         & (6)-(8)

with elementwise powers and C unit lower triangular: x of the orthogonal frame lies along the first input axis, y in the
plane of the first two. Every array may carry leading dimensions (runs): parameters (..., 3), counts (..., n, 3).
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

from gimbalcal.number import Array

MAX_STEPS = 30  # of Newton, from the linear answer


def lower(E: Array) -> Array:
    """Unit lower-triangular C (..., 3, 3) of Eqs. (5) and (8) from E = (E_yx, E_zx, E_zy), (..., 3)."""
    E = np.asarray(E)
    C = np.zeros((*E.shape[:-1], 3, 3), dtype=E.dtype)
    C[..., 0, 0] = C[..., 1, 1] = C[..., 2, 2] = 1
    C[..., 1, 0], C[..., 2, 0], C[..., 2, 1] = E[..., 0], E[..., 1], E[..., 2]
    return C


def along(C: Array, v: Array) -> Array:
    """C (..., 3, 3) applied to vectors (..., n, 3)."""
    return np.asarray(v @ np.swapaxes(C, -1, -2))


@dataclass(frozen=True)
class Pulses:
    """A triad in pulses per second: K1 [SI/pulse], K2 [SI/pulse^2], K3 [SI/pulse^3], bias [SI], E [rad]; (..., 3) each.

    SI is m/s^2 for accelerometers and rad/s for gyroscopes (K3 is zero there, Eq. (6) has no cubic term).
    """

    K1: Array
    K2: Array
    K3: Array
    bias: Array
    E: Array

    @classmethod
    def from_vector(cls, x: Array) -> Pulses:
        """Return the triad of x (..., 15) in the order K1, K2, K3, bias, E."""
        return cls(*np.split(np.asarray(x), 5, axis=-1))

    def vector(self) -> Array:
        """(..., 15) in the order K1, K2, K3, bias, E."""
        return np.concatenate([getattr(self, f.name) for f in fields(self)], axis=-1)

    def along_axes(self, N: Array) -> Array:
        """The bracket of Eqs. (2) and (6): counts N (..., n, 3) to SI along the input axes."""
        K1, K2, K3, b = (np.asarray(k)[..., None, :] for k in (self.K1, self.K2, self.K3, self.bias))
        return np.asarray(((K3 * N + K2) * N + K1) * N + b)

    def physical(self, N: Array) -> Array:
        """Counts N (..., n, 3) [pulse/s] to force [m/s^2] or rate [rad/s] in the orthogonal frame."""
        return along(lower(self.E), self.along_axes(N))

    def counts(self, v: Array) -> Array:
        """Force or rate (..., n, 3) in the orthogonal frame to counts [pulse/s]: the exact inverse of `physical`.

        Newton on each axis from the linear answer; stops at a relative step of 1e-15. Raises ValueError where the
        polynomial has no root near the linear one (it folds inside the range).
        """
        u = along(np.linalg.inv(lower(self.E)), np.asarray(v))
        K1, K2, K3 = (np.asarray(k)[..., None, :] for k in (self.K1, self.K2, self.K3))
        N = (u - np.asarray(self.bias)[..., None, :]) / K1
        for _ in range(MAX_STEPS):
            slope = (3 * K3 * N + 2 * K2) * N + K1
            if np.any(slope * np.sign(K1) <= 0):
                raise ValueError("the scale polynomial folds inside the measured range: no unique count")
            step = (self.along_axes(N) - u) / slope
            N = N - step
            if np.all(np.abs(step) <= 1e-15 * np.abs(N) + 1e-300):  # one unit in the last place
                break
        return np.asarray(N)


def truncated(pulses: Pulses, order: int) -> Pulses:
    """Return the triad with scale terms above `order` (1, 2 or 3) set to zero."""
    return replace(
        pulses,
        K2=pulses.K2 if order >= 2 else 0 * pulses.K2,
        K3=pulses.K3 if order >= 3 else 0 * pulses.K3,
    )
