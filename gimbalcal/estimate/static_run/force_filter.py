r"""Calibration by specific-force error: Wu et al. (2018), Eqs. (20)-(27).

.. math:: z = \tfrac12 \left(\left|\hat f/g\right|^2 - 1\right) = H x + v, \qquad
          H = \left[1, \; -f_x, \; -f_y, \; f_x^2 - f_y^2, \; 2 f_x f_y\right] \text{ in units of } g

Differences are *estimate minus true* here, so in true parameters every right-hand side of Eqs. (21)-(25) changes its
sign. Two observations have this mean:

* ``squared_norm``, the paper's z. Squaring makes a mean of the noise, :math:`\tfrac32 (\sigma/g)^2`, 3.9e-7 at
  5e-3 m/s^2: it goes into x1 as a scale-factor error unless sigma is known and it is taken off. It also keeps
  :math:`\tfrac12 |\Delta f|^2`.
* ``projection``, :math:`f^T (\hat f - f)/g^2`, the linear part, which has neither. It is the default.

v is white with variance :math:`(\sigma/g)^2` (the squared norm's is larger by the factor
:math:`1 + \tfrac32 (\sigma/g)^2`). Two roads lead to x: a Kalman filter, sample by sample, and the information form,
which adds up :math:`H^T H` and :math:`H^T z` over rows in any order and any number of pieces. The columns of H are of
order one with a condition below ten, so nothing is lost in the squares.
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

    def plus(self, other: ForceInformation) -> ForceInformation:
        """Both together."""
        return ForceInformation(self.HH + other.HH, self.Hz + other.Hz, self.zz + other.zz, self.rows + other.rows)


def observation_matrix(direction: Array) -> Array:
    """H (n, 5) of Eq. (27) for the ideal specific force in units of g (n, 3)."""
    fx, fy = direction[..., 0], direction[..., 1]
    return np.stack([np.ones_like(fx), -fx, -fy, fx**2 - fy**2, 2 * fx * fy], axis=-1)


def squared_norm(force: Array, gravity: float, sigma: Array | float = 0.0) -> Array:
    """The paper's z (n,), Eq. (20), of the measured force (n, 3) [m/s^2], less the noise mean where sigma is known.

    sigma: one sigma of each axis in these rows [m/s^2], (n,) or one number; zero leaves Eq. (20) as printed.
    """
    return np.asarray(((force**2).sum(axis=-1) / gravity**2 - 1) / 2 - 1.5 * np.square(np.asarray(sigma) / gravity))


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


def kalman(z: Array, H: Array, variance: Array | float, prior_sigma: float = PRIOR_SIGMA) -> ForceState:
    """The same, sample by sample, with filterpy: five constant states, one scalar measurement a row.

    Square-root form: in the usual one, Joseph's included, covariances lose (prior / sigma)^2 of their digits while
    few rows are in, 6e-8 sigma at 6 ug and 1e-3 sigma at 0.1 ug. A row that is NaN was not measured. About 0.1 ms a
    row: for millions of rows take `accumulate`.
    """
    from filterpy.kalman import SquareRootKalmanFilter

    f = SquareRootKalmanFilter(dim_x=5, dim_z=1)
    f.x, f.P = np.zeros((5, 1)), np.eye(5) * prior_sigma**2
    R = np.broadcast_to(np.asarray(variance, dtype=float), z.shape)
    for k in np.flatnonzero(np.isfinite(z)):
        f.R, f.H = R[k].reshape(1, 1), H[k : k + 1]
        f.update(z[k].reshape(1, 1))  # constant states need no predict
    x, P = f.x[:, 0], np.asarray(f.P)
    r = z - H @ x
    return ForceState(x, P, float(np.nansum(r**2 / R)), int(np.isfinite(z).sum()))
