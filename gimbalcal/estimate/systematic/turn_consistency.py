r"""Compare each turn of the gyroscopes with gravity before and after it: initial scale factors, and lost samples.

A turn carries the vertical from f_1 to f_2 by C, the product of what the gyroscopes read; errors M of the triad add

.. math:: \delta\phi = \sum_t C_t M \omega_t \, \Delta t ,

observable across f_2 alone. One matrix M (3, 3) explains all turns of any unit; a turn that it does not explain lost
samples, exceeded the gyroscopes' range, or was no turn of this unit.
"""

from __future__ import annotations

import numpy as np

from gimbalcal.errors import InputError, amount
from gimbalcal.navigate.strapdown import carried
from gimbalcal.number import Array
from gimbalcal.rotation import cross_matrix
from gimbalcal.views.segments import Segments

EDGE_INTERVALS = 5  # of a stop on each side of a turn, some seconds: longer, the Earth turns the vertical
SCALE_ERROR_SIGMA = 0.05  # of an element of M
MAX_TURN_RESIDUAL_DEG = 1.0  # where all other turns are right
OUTLIER_RATIO = 8.0  # to the median over turns
MIN_TURNS = 4  # for one of them to be an outlier
MAX_ITERATIONS = 4
NONLINEAR_SCALE_ERROR = 0.02  # beyond, the navigator is not linear from the start
MIN_DRIFT_RATIO = 10.0  # to the median over turns: errors of the sensors are alike in all of them
MIN_SPEED_M_S, MIN_DISTANCE_M = 0.2, 0.5  # less than this is a lever arm, or a hand


def gyro_scale_errors(segments: Segments, u: Array) -> Array:
    """Return large scale errors of the gyroscopes (3,) from forces and rates (n, 6); small ones as zero.

    Raises InputError for single turns that no errors of the gyroscopes explain.
    """
    last = int(segments.stop.max())
    spans = [(segments.of_stop(k), segments.of_stop(k + 1)) for k in range(last)]
    spans = [(a, b) for a, b in spans if b.start > a.stop]
    M = np.zeros((3, 3))
    if len(spans) < MIN_TURNS:
        return np.diag(M)
    for _ in range(MAX_ITERATIONS):
        residuals, J = zip(*(_turn(segments, u, a, b, M) for a, b in spans), strict=True)
        y, A = np.array(residuals), np.array(J)
        dM, remaining = _robust_step(y, A, M)
        M = M + dM
        if np.abs(dM).max() < 1e-3:
            break
    size = np.degrees(np.linalg.norm(remaining, axis=1))
    outlier = size > max(MAX_TURN_RESIDUAL_DEG, OUTLIER_RATIO * float(np.median(size)))
    if outlier.any() and np.count_nonzero(outlier) <= len(size) / 4:
        a, b = spans[int(np.argmax(size))]
        t = [segments.rows.time[a.stop - 1], segments.rows.time[b.start]]
        others = amount(len(size) - int(outlier.sum()), "other turn")
        raise InputError(
            f"{segments.rows.label}: between {t[0]:.6g} and {t[1]:.6g} s gravity turns by {size.max():.2g} "
            f"deg more or less than the gyroscopes say, which tell the {others} to {np.median(size):.2g} "
            "deg; samples were lost there, or wrong; cut the recording there and give the longer part"
        )
    return np.where(np.abs(np.diag(M)) > NONLINEAR_SCALE_ERROR, np.diag(M), 0.0)


def _turn(segments: Segments, u: Array, a: slice, b: slice, M: Array) -> tuple[Array, Array]:
    """Return the angle (3,) [rad] by which a turn with rates (1 + M) w misses gravity, and its Jacobian (3, 9)."""
    before, after = (
        slice(max(a.start, a.stop - EDGE_INTERVALS), a.stop),
        slice(b.start, min(b.stop, b.start + EDGE_INTERVALS)),
    )
    level = (u[before, 3:].mean(axis=0) + u[after, 3:].mean(axis=0)) / 2
    w = u[a.stop : b.start, 3:] - level
    dt = segments.dt[a.stop : b.start]
    C = carried(dt, w + w @ M.T)
    turned = np.swapaxes(C[-1], 0, 1) @ C  # from each moment's axes to those after the turn
    angle = w * dt[:, None]
    J = np.einsum("tij,tk->ijk", (turned[:-1] + turned[1:]) / 2, angle).reshape(3, 9)
    f = [x / np.linalg.norm(x) for x in (u[before, :3].mean(axis=0), u[after, :3].mean(axis=0))]
    predicted = np.swapaxes(C[-1], 0, 1) @ f[0]
    across = cross_matrix(f[1])
    # the unit turns, the vertical turns the other way: gravity is predicted too far by f x phi
    return np.cross(f[1], predicted), -across @ across @ J


def _robust_step(y: Array, A: Array, M: Array) -> tuple[Array, Array]:
    """Return the least-squares step (3, 3) of M for angles (m, 3), outliers weighed down, and the residuals (m, 3)."""
    step, residual = np.zeros(9), y
    for _ in range(20):
        size = np.linalg.norm(residual, axis=1)
        scale = max(float(np.median(size)), 1e-6)
        w = np.repeat(1 / np.maximum(size, scale), 3)[:, None] ** 0.5 / scale**0.5
        rows = np.concatenate([A.reshape(-1, 9) * w, np.eye(9) / SCALE_ERROR_SIGMA])
        right = np.concatenate([y.reshape(-1) * w[:, 0], -M.reshape(-1) / SCALE_ERROR_SIGMA])
        step = np.linalg.lstsq(rows, right, rcond=None)[0]
        residual = y - A @ step
    return step.reshape(3, 3), residual


def refuse_carried(segments: Segments, drift: Array) -> None:
    """Raise InputError for a turn with a velocity that no other has; drift (K, 3) [m/s]: velocity gained per stretch.

    A unit that is carried speeds up and slows down again; the part of its velocity that persists is a tilt.
    """
    turning = segments.stop < 0
    if not turning.any():
        return
    usual = float(np.median(np.linalg.norm(drift[turning], axis=1)))
    for leg in np.split(np.arange(len(turning)), np.flatnonzero(np.diff(segments.stop)) + 1):
        if not turning[leg[0]] or leg[0] == 0 or leg[-1] == len(turning) - 1:
            continue
        most = float(np.linalg.norm(drift[leg], axis=1).max())
        t = segments.time[[leg[0], leg[-1] + 1]]
        length = np.diff(segments.time)[leg][:, None]
        v = np.cumsum(drift[leg], axis=0)
        v -= v[-1] * np.cumsum(length, axis=0) / length.sum()
        speed, distance = (float(np.linalg.norm(x, axis=-1).max()) for x in (v, np.cumsum(v * length, axis=0)))
        if most > MIN_DRIFT_RATIO * usual and speed > MIN_SPEED_M_S and distance > MIN_DISTANCE_M:
            raise InputError(
                f"{segments.rows.label}: between {t[0]:.6g} and {t[1]:.6g} s the unit was carried away: its "
                f"accelerometers tell of {speed:.2g} m/s and {distance:.2g} m, which no other turn has; systematic "
                "calibration is for a unit that stays in its place, so cut the recording there and give the longer part"
            )
