r"""False rates, which a gyroscope reads in addition to the true rate; one law per effect, strapdown or on a platform.

In a strapdown unit the false rate adds to the reading, omega + delta omega (`gyroscope`, stage GYROSCOPE). A platform
stabilised by gyroscopes is turned by its loop until they read zero, so it turns at the negative of the false rate
(`drift_of_platform`, stage PLATFORM):

.. math:: 0 = \omega + \delta\omega \;\Rightarrow\; \varphi = -\int \delta\omega \, dt

The coefficients of a platform are those of its drift, as the literature states them: the negatives of what its
gyroscopes would read in a strapdown unit. All laws return (n, 3) [rad/s].
"""

from __future__ import annotations

import numpy as np

from gimbalcal.earth import SOLAR_RATE
from gimbalcal.effects.accelerometer import cross_forces
from gimbalcal.effects.effect import Stimulus
from gimbalcal.number import Array, apply_matrix, cos, sin


def constant_rate(epsilon: Array, s: Stimulus) -> Array:
    """Return the bias: epsilon (3,) [rad/s]."""
    return np.asarray(epsilon + 0 * s.rate)


def by_force(G: Array, s: Stimulus) -> Array:
    """Return the rate by mass unbalance or stress: sum_j G_ij f_j with G (9,) row by row [rad/s per m/s^2]."""
    return apply_matrix(np.reshape(G, (3, 3)), s.force)


def by_force_products(E: Array, s: Stimulus) -> Array:
    """Return the rate of a suspension of unequal compliance: E_i f_j f_k, E (3,) [rad/s per (m/s^2)^2]."""
    fj, fk = cross_forces(s.force)
    return np.asarray(E * fj * fk)


def by_temperature(epsilon_T: Array, s: Stimulus) -> Array:
    """Return the bias that follows the temperature: epsilon_T (T - T_0) with epsilon_T (3,) [rad/s per degC]."""
    return np.asarray(epsilon_T * s.temperature_excess()[..., None])


def by_solar_day(A: Array, B: Array, s: Stimulus) -> Array:
    """Return the bias that follows the solar day: A sin(omega_d t) + B cos(omega_d t) with A, B (3,) [rad/s]."""
    phase = (SOLAR_RATE * s.time)[..., None]
    return np.asarray(A * sin(phase) + B * cos(phase))
