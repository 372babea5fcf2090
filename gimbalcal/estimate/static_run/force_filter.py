r"""Calibration by specific-force error: Wu et al. (2018), Eqs. (20)-(27).

.. math:: z = \tfrac12 \left(\left|\hat f/g\right|^2 - 1\right) = H x + v, \qquad
          H = \left[1, \; -f_x, \; -f_y, \; f_x^2 - f_y^2, \; 2 f_x f_y\right] \text{ in units of } g

Differences are *estimate minus true* here, so in true parameters every right-hand side of Eqs. (21)-(25) changes its
sign. Squaring makes a mean of the noise, :math:`\tfrac32 (\sigma/g)^2`, 3.9e-7 at 5e-3 m/s^2, which goes into x1 as a
scale-factor error; it also keeps :math:`\tfrac12 |\Delta f|^2`. The observation here is the linear part of the same z,
`projection`, :math:`f^T (\hat f - f)/g^2`, which has neither; v is white with variance :math:`(\sigma/g)^2`.

The five states are constants without process noise. The paper runs a Kalman filter over the samples; its last estimate
is that of the information form, which adds up :math:`H^T H` and :math:`H^T z` over rows in any order and any number of
pieces: equal to 1e-9 sigma, and a thousand times faster. So the filter is the oracle of the tests, which run filterpy's
square-root form sample by sample, and no user waits for it. The columns of H are of order one with a condition below
ten, so nothing is lost in the squares.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gimbalcal.number import Array

NAMES = ("x1", "x2", "x3", "x4", "x5")
PRIOR_SIGMA = 1e-2  # no accelerometer of this trade is off by a per cent: says nothing, and keeps the filter proper


class ForceState(NamedTuple):
    """Estimate x (5,) [rad or units of g] and covariance P (5, 5) from `rows` observations; chi2 of their misfit."""

    x: Array
    P: Array
    chi2: float
    rows: int

    @property
    def sigma(self) -> Array:
        """One standard deviation (5,)."""
        return np.sqrt(np.diag(self.P))


class ForceInformation(NamedTuple):
    """Sums over observations, each over its variance: H^T H (5, 5), H^T z (5,), z^2 and their number."""

    HH: Array
    Hz: Array
    zz: float
    rows: int


def observation_matrix(direction: Array) -> Array:
    """H (n, 5) of Eq. (27) for the ideal specific force in units of g (n, 3)."""
    fx, fy = direction[..., 0], direction[..., 1]
    return np.stack([np.ones_like(fx), -fx, -fy, fx**2 - fy**2, 2 * fx * fy], axis=-1)


def projection(departure: Array, direction: Array, gravity: float) -> Array:
    """Linear observation (n,): measured less ideal force (n, 3) [m/s^2] along the ideal direction (n, 3)."""
    return np.asarray((departure * direction).sum(axis=-1) / gravity)


def accumulate(z: Array, H: Array, variance: Array | float) -> ForceInformation:
    """Information of rows z (n,), H (n, 5) with variance (n,) or one number."""
    root = 1 / np.sqrt(np.broadcast_to(np.asarray(variance, dtype=float), z.shape))
    A, b = H * root[:, None], z * root
    return ForceInformation(A.T @ A, A.T @ b, float(b @ b), len(z))


def estimate(total: ForceInformation, prior_sigma: float = PRIOR_SIGMA) -> ForceState:
    """State from accumulated information and a prior of zero mean."""
    P = np.linalg.inv(total.HH + np.eye(5) / prior_sigma**2)
    x = P @ total.Hz
    chi2 = total.zz - 2 * x @ total.Hz + x @ total.HH @ x
    return ForceState(x, (P + P.T) / 2, float(chi2), total.rows)
