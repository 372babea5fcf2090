r"""Calibration by specific-force error: Wu et al. (2018), Eqs. (20)-(27).

.. math:: z = \tfrac12 \left(\left|\hat f/g\right|^2 - 1\right) = H x + v, \qquad
          H = \left[1, \; -f_x, \; -f_y, \; f_x^2 - f_y^2, \; 2 f_x f_y\right] \text{ in units of } g

Differences are *estimate minus true* here, so in true parameters every right-hand side of Eqs. (21)-(25) changes its
sign. Squaring makes a mean of the noise, :math:`\tfrac32 (\sigma/g)^2`, 3.9e-7 at 5e-3 m/s^2, which goes into x1 as a
scale-factor error; it also keeps :math:`\tfrac12 |\Delta f|^2`. The linear part of the same z is `projection`,
:math:`f^T (\hat f - f)/g^2`, which has neither; v is white with variance :math:`(\sigma/g)^2`.

The five states are constants without process noise. `kalman` is the filter of the paper, filterpy's square-root form
over minute means of Eq. (20): it shows how the states converge. Its last estimate is that of the information form,
`estimate_state`, which adds up :math:`H^T H` and :math:`H^T z` over rows in any order: of the same observations equal
to 1e-9 sigma, and a thousand times faster. The information form takes the projection and serves the combined
coefficients; `convergence_history` runs the filter and holds its end against it. The columns of H are of
order one with a condition below ten, so nothing is lost in the squares.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gimbalcal.calibration import StageHistory, StageResult
from gimbalcal.number import Array

MEAN_S = 60.0  # of the rows that the filter takes: minute means
MAX_HISTORY = 240  # rows of the record
MAX_DISAGREEMENT = 0.01  # sigma, of filter and closed form less the squares of Eq. (20): less with means over a minute
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


def observation_matrix(direction: Array) -> Array:
    """H (n, 5) of Eq. (27) for the ideal specific force in units of g (n, 3)."""
    fx, fy = direction[..., 0], direction[..., 1]
    return np.stack([np.ones_like(fx), -fx, -fy, fx**2 - fy**2, 2 * fx * fy], axis=-1)


def projection(departure: Array, direction: Array, gravity: float) -> Array:
    """Linear observation (n,): measured less ideal force (n, 3) [m/s^2] along the ideal direction (n, 3)."""
    return np.asarray((departure * direction).sum(axis=-1) / gravity)


def estimate_state(z: Array, H: Array, variance: Array | float) -> ForceState:
    """Return the state by the information form from rows z (n,), H (n, 5) with variance (n,) or one number."""
    root = 1 / np.sqrt(np.broadcast_to(np.asarray(variance, dtype=float), z.shape))
    A, b = H * root[:, None], z * root
    P = np.linalg.inv(A.T @ A + np.eye(5) / PRIOR_SIGMA**2)
    x = P @ (A.T @ b)
    return ForceState(x, (P + P.T) / 2, float(((b - A @ x) ** 2).sum()), len(z))


def squared_norm(force: Array, gravity: float, sigma: Array | float = 0.0) -> Array:
    """Return the paper's z (n,), Eq. (20), of the measured force (n, 3) [m/s^2], less the noise mean where known.

    sigma: one sigma of each axis in these rows [m/s^2], (n,) or one number; zero leaves Eq. (20) as printed.
    """
    return np.asarray(((force**2).sum(axis=-1) / gravity**2 - 1) / 2 - 1.5 * np.square(np.asarray(sigma) / gravity))


def kalman(z: Array, H: Array, variance: Array | float) -> tuple[ForceState, Array, Array]:
    """Return the state x1 ... x5, row by row: five constant states, one scalar measurement z = H x + v a row.

    Returns the last state, and estimates and sigmas (m, 5) after each of the m measured rows. Square-root form: in the
    usual one, Joseph's included, covariances lose (prior / sigma)^2 of their digits while few rows are in, 6e-8 sigma
    at 6 ug and 1e-3 sigma at 0.1 ug. A row that is NaN was not measured. About 0.1 ms a row.
    """
    from filterpy.kalman import SquareRootKalmanFilter

    f = SquareRootKalmanFilter(dim_x=5, dim_z=1)
    f.x, f.P = np.zeros((5, 1)), np.eye(5) * PRIOR_SIGMA**2
    R = np.broadcast_to(np.asarray(variance, dtype=float), z.shape)
    rows = np.flatnonzero(np.isfinite(z))
    x, sigma = np.empty((len(rows), 5)), np.empty((len(rows), 5))
    for i, k in enumerate(rows):
        f.R, f.H = R[k].reshape(1, 1), H[k : k + 1]
        f.update(z[k].reshape(1, 1))  # constant states need no predict
        x[i], sigma[i] = f.x[:, 0], np.sqrt(np.diag(f.P))
    last, r = f.x[:, 0], z - H @ f.x[:, 0]
    return ForceState(last, np.asarray(f.P), float(np.nansum(r**2 / R)), len(rows)), x, sigma


def minute_means(time: Array, z: Array, H: Array, variance: Array) -> tuple[Array, Array, Array, Array]:
    """Return time (m,) of the end, z (m,), H (m, 5) and variance (m,) of the weighted means of the rows of a minute."""
    minute = np.floor((time - time[0]) / MEAN_S).astype(int)
    _, first = np.unique(minute, return_index=True)
    weight = np.add.reduceat(1 / variance, first)
    last = np.append(first[1:], len(time)) - 1
    means = (np.add.reduceat(x / variance[:, None], first) / weight[:, None] for x in (z[:, None], H))
    mean_z, mean_H = means
    return time[last], mean_z[:, 0], mean_H, 1 / weight


def convergence_history(time: Array, departure: Array, direction: Array, sigma: Array, gravity: float) -> StageResult:
    """Run the paper's filter over minute means, and hold its end against the closed form.

    time (n,) [s]; departure (n, 3), measured less ideal force, and sigma (n, 3) of each row [m/s^2]; direction (n, 3),
    ideal force in g. The filter takes Eq. (20) less its noise mean, the closed form its linear part: they differ by the
    squares of the departures, whose share is computed; a difference beyond it is a disagreement, and said to be one.
    """
    H = observation_matrix(direction)
    variance = ((direction * sigma / gravity) ** 2).sum(axis=1)
    noise = np.sqrt((sigma**2).sum(axis=1) / 3)
    z = squared_norm(gravity * direction + departure, gravity, noise)
    when, mean, mean_H, mean_variance = minute_means(time, z, H, variance)
    end, x, sigmas = kalman(mean, mean_H, mean_variance)
    closed = estimate_state(projection(departure, direction, gravity), H, variance)
    squares = estimate_state(z - projection(departure, direction, gravity), H, variance).x
    difference = (end.x - closed.x) / closed.sigma
    beyond = np.abs(difference - squares / closed.sigma)
    worst, minutes = int(np.argmax(np.abs(difference))), float(np.median(np.diff(when))) / 60
    words = (
        f"five states of Eq. (20) over {end.rows} means of {minutes:.3g} min, Eqs. (26)-(27); the end of the filter "
        f"differs from the closed form by at most {np.abs(difference[worst]):.2g} of a sigma ({NAMES[worst]})"
    )
    if beyond.max() > MAX_DISAGREEMENT:
        words += (
            f", and {NAMES[int(np.argmax(beyond))]} by {beyond.max():.2g} of a sigma more than the squares of Eq. (20) "
            "explain: filter and closed form disagree"
        )
    else:
        words += ", which the squares in Eq. (20) explain"
    keep = np.unique(np.linspace(0, len(when) - 1, MAX_HISTORY).round().astype(int))
    rms = float(np.sqrt(np.mean((mean - mean_H @ end.x) ** 2)) * gravity)
    name = "system level: Kalman filter on the specific-force error"
    history = StageHistory(when[keep] - time[0], x[keep], sigmas[keep])
    return StageResult(name, NAMES, end.x, end.sigma, rms, words, history)
