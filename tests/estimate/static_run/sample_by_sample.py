"""Section 5.1 of Wu et al. (2018) as printed: the squared norm, and a Kalman filter over the samples by filterpy."""

from __future__ import annotations

import numpy as np

from gimbalcal.estimate.static_run.force_filter import PRIOR_SIGMA, ForceState
from gimbalcal.number import Array


def squared_norm(force: Array, gravity: float, sigma: Array | float = 0.0) -> Array:
    """The paper's z (n,), Eq. (20), of the measured force (n, 3) [m/s^2], less the noise mean where sigma is known.

    sigma: one sigma of each axis in these rows [m/s^2], (n,) or one number; zero leaves Eq. (20) as printed.
    """
    return np.asarray(((force**2).sum(axis=-1) / gravity**2 - 1) / 2 - 1.5 * np.square(np.asarray(sigma) / gravity))


def kalman(z: Array, H: Array, variance: Array | float, prior_sigma: float = PRIOR_SIGMA) -> ForceState:
    """State x1 ... x5, sample by sample: five constant states, one scalar measurement z = H x + v a row.

    Square-root form: in the usual one, Joseph's included, covariances lose (prior / sigma)^2 of their digits while
    few rows are in, 6e-8 sigma at 6 ug and 1e-3 sigma at 0.1 ug. A row that is NaN was not measured. About 0.1 ms a
    row.
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
