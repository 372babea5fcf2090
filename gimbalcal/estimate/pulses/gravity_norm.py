r"""Sensors in pulses, and accelerometers from rest positions alone: the norm of the force is gravity at any attitude.

Wang et al. (2019), sections 4.1 and 4.3, on arrays of runs. No angle is needed or used. Direction: pulses to force.

.. math:: \min_x \frac12 \sum_i \left( \frac{\|f_i\|^2 - g^2}{2 g \sigma} \right)^2, \qquad
          f_i = C_a^p (K_1 N_i + K_2 N_i^2 + K_3 N_i^3 + \nabla)

Eq. (18) divided by (2 g sigma)^2: the residual is then the misfit of the norm in units of the noise of a position, and
the minimum is the maximum of the likelihood to first order (the unknown direction takes the other two components).

The polynomial models of the paper are those of `Pulses`. Direction: **pulses to force and rate** (a correction).
`physical` turns what was counted into what was there; `counts` is the exact inverse (a corruption). The effects of
`gimbalcal.effects` go the other way, from what is there to what is read; `estimate.gyroscopes.revolutions.as_effects`
converts those of gyroscopes.

.. math::
    f^p &= C_a^p (K_{a1} N + K_{a2} N^2 + K_{a3} N^3 + \nabla)                      & (2)-(5) \\
    \omega^q &= C_g^q (K_{g1} N + K_{g2} N^2 + \varepsilon)                         & (6)-(8)

with elementwise powers and C unit lower triangular: x of the orthogonal frame lies along the first input axis, y in the
plane of the first two. Every array may carry leading dimensions (runs): parameters (..., 3), counts (..., n, 3).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from gimbalcal.inference.ellipsoid import MIN_POINTS, ellipsoid
from gimbalcal.inference.levenberg import LeastSquaresMinimum, covariance_at_minimum, minimise
from gimbalcal.number import Array

MAX_STEPS = 30  # of Newton, from the linear answer


def unit_lower_triangular(E: Array) -> Array:
    """Unit lower-triangular C (..., 3, 3) of Eqs. (5) and (8) from E = (E_yx, E_zx, E_zy), (..., 3)."""
    E = np.asarray(E)
    C = np.zeros((*E.shape[:-1], 3, 3), dtype=E.dtype)
    C[..., 0, 0] = C[..., 1, 1] = C[..., 2, 2] = 1
    C[..., 1, 0], C[..., 2, 0], C[..., 2, 1] = E[..., 0], E[..., 1], E[..., 2]
    return C


def apply_to_vectors(C: Array, v: Array) -> Array:
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
        return apply_to_vectors(unit_lower_triangular(self.E), self.along_axes(N))

    def counts(self, v: Array) -> Array:
        """Force or rate (..., n, 3) in the orthogonal frame to counts [pulse/s]: the exact inverse of `physical`.

        Newton on each axis from the linear answer; stops at a relative step of 1e-15. Raises ValueError where the
        polynomial has no root near the linear one (it folds inside the range).
        """
        u = apply_to_vectors(np.linalg.inv(unit_lower_triangular(self.E)), np.asarray(v))
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


@dataclass(frozen=True)
class PulseFit:
    """Estimates of many runs: `pulses` (r, 3) each, covariance (r, 15, 15) in SI (order K1, K2, K3, bias, E).

    chi2 (r,) of the weighted misfit, converged (r,), steps (r,).
    """

    pulses: Pulses
    covariance: Array
    chi2: Array
    converged: Array
    steps: Array

    @property
    def sigma(self) -> Array:
        """One standard deviation (r, 15): the Cramer-Rao bound at the estimate."""
        return np.asarray(np.sqrt(np.diagonal(self.covariance, axis1=-2, axis2=-1)))


def initial_scale(N: Array, magnitude: float | Array) -> Array:
    r"""Rough linear scale factors (r, 3) from counts N (r, m, 3) whose images all have one magnitude: Eqs. (41), (42).

    The cost is quadratic in the squares of the scale factors: one linear solution is its global minimum. Where a
    square comes out negative (positions that do not turn that axis), the common scale of all axes stands in.
    """
    target = np.broadcast_to(np.asarray(magnitude, dtype=float), N.shape[:-1])
    unit = np.sqrt((N**2).mean((-2, -1), keepdims=True))
    A, b = (N / unit) ** 2, target**2
    AT = np.swapaxes(A, -1, -2)
    # an axis that was never turned must not divide by zero; 1e-15 is below the rounding of any real information
    ridge = 1e-15 * np.trace(AT @ A, axis1=-2, axis2=-1)[:, None, None] * np.eye(3)
    squares = np.linalg.solve(AT @ A + ridge, AT @ b[..., None])[..., 0]
    common = (target**2).sum(-1, keepdims=True) / A.sum((-2, -1))[:, None]
    return np.asarray(np.sqrt(np.where(squares > 0.05 * common, squares, common)) / unit[:, 0])


def accelerometer_pulses(N: Array, gravity: float, sigma: float, order: int = 3) -> PulseFit:
    """Fit Eq. (2) to mean counts N (r, m, 3) [pulse/s] of m rest positions in r runs.

    gravity [m/s^2]; sigma [m/s^2] noise of one position's mean along each axis; order 1, 2 or 3 of the scale polynomial
    (higher terms stay zero). Both starts, Eq. (41) and the ellipsoid, are followed and the lower minimum is kept.
    """
    free = _free_ordinals(order)
    K0 = initial_scale(N, gravity)
    u = N * K0[:, None, :] / gravity  # of order one: the force in g

    def model(x: Array, runs: Array) -> tuple[Array, Array]:
        return _residuals(_with_fixed(x, free), u[runs], sigma / gravity, free)

    plain = np.tile(np.r_[np.ones(3), np.zeros(12)], (len(N), 1))[:, free]
    minimum = minimise(model, plain)
    if N.shape[-2] >= MIN_POINTS:
        second = ellipsoid(u)
        usable = np.isfinite(second).all(-1)
        start = _with_fixed(plain, free)
        start[usable, :3], start[usable, 9:] = second[usable, :3], second[usable, 3:]
        minimum = minimum.better(minimise(model, start[:, free]))
    one = np.ones_like(K0)
    return in_si(minimum, free, [K0, K0**2 / gravity, K0**3 / gravity**2, gravity * one, one])


def _free_ordinals(order: int) -> Array:
    return np.flatnonzero(np.repeat([True, order >= 2, order >= 3, True, True], 3))


def _with_fixed(x: Array, free: Array) -> Array:
    out = np.zeros((*x.shape[:-1], 15))
    out[..., free] = x
    return out


def _residuals(p: Array, u: Array, sigma: float, free: Array) -> tuple[Array, Array]:
    """Misfit of the norm over sigma (r, m) and its derivatives (r, m, q): Eqs. (20)-(25), nothing left out."""
    triad = Pulses.from_vector(p)
    fa = triad.along_axes(u)
    C = unit_lower_triangular(triad.E)
    f = apply_to_vectors(C, fa)
    back = f @ C  # C^T f
    misalignment = np.stack([f[..., 1] * fa[..., 0], f[..., 2] * fa[..., 0], f[..., 2] * fa[..., 1]], axis=-1)
    J = np.concatenate([back * u, back * u**2, back * u**3, back, misalignment], axis=-1) / sigma
    return ((f**2).sum(-1) - 1) / (2 * sigma), J[..., free]


def in_si(minimum: LeastSquaresMinimum, free: Array, units: Sequence[Array]) -> PulseFit:
    """Return a dimensionless fit of the parameters `free` of fifteen in SI per pulse.

    units: of K1, K2, K3, bias and E, (r, 3) each.
    """
    unit = np.concatenate(units, axis=-1)
    full = np.zeros((len(unit), 15, 15))
    full[:, free[:, None], free] = covariance_at_minimum(minimum.jacobian)
    return PulseFit(
        Pulses.from_vector(_with_fixed(minimum.x, free) * unit),
        full * unit[:, :, None] * unit[:, None, :],
        2 * minimum.cost,
        minimum.converged,
        minimum.steps,
    )
