r"""What is known before the first pass: level, north, large scale errors of the gyroscopes, and turns that are none.

Level comes from gravity, north from the Earth's rate at all stops.

In axes carried along by the gyroscopes (inertial ones, up to the errors of the triad) the Earth's rate e is the same
vector at all stops, and a bias is not, because the unit is turned:

.. math:: \bar\omega_i = b + C_i \, e

over all stops i, with C_i from the integrated rates less b, iterated until b converges. So the bias does not enter the
heading, as it does at a single stop, where 0.1 deg/h of bias is half a degree of heading.

Each turn of the gyroscopes is compared with gravity before and after it. A turn carries the vertical from f_1 to f_2 by
C, the product of what the gyroscopes read; errors M of the triad add

.. math:: \delta\phi = \sum_t C_t M \omega_t \, \Delta t ,

observable across f_2 alone. One matrix M (3, 3) explains all turns of any unit; a turn that it does not explain lost
samples, exceeded the gyroscopes' range, or was no turn of this unit.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gimbalcal.earth import EARTH_RATE, rate_at
from gimbalcal.errors import InputError, number_of
from gimbalcal.navigate.strapdown import integrated_attitudes
from gimbalcal.number import Array
from gimbalcal.rotation import cross_matrix, exponential
from gimbalcal.views.segments import Segments

MAX_ITERATIONS = 6
LEVEL_SIGMA_RAD = np.radians(1.0)  # at the start
HEADING_SIGMA_RANGE_RAD = np.radians(1.0), np.radians(60.0)  # at the start
# times the Earth's rate: gyroscopes that read less at rest have no bias worth the name
NEGLIGIBLE_BIAS_EARTH_RATES = 3.0
BIAS_SIGMA_RAD_S = np.radians([1.0, 1000.0]) / 3600  # rad/s, one sigma of the bias of such a triad, and of any other
LATITUDE_TOLERANCE_RAD = np.radians(3.0)  # besides 5 sigma of the observed latitude
FAINT_EARTH_RATES = 0.1  # below, the Earth's rate was subtracted from the readings
EARTH_RATE_TOLERANCE = 0.5  # relative, besides 3 sigma


@dataclass(frozen=True)
class Alignment:
    """C_bn (3, 3) at the start, one sigma (3,) [rad] of it about north, east, down, and the bias (3,) [rad/s].

    latitude [rad]: height of the Earth's axis above the horizon by gravity and the Earth's rate, with its sigma [rad].
    """

    C_bn: Array
    sigma: Array
    bias: Array
    latitude: float
    latitude_sigma: float


def align(segments: Segments, u: Array) -> Alignment:
    """Return the alignment from force and rate (n, 6). Raises InputError where the Earth's rate is not observed."""
    stops = [segments.of_stop(k) for k in range(int(segments.stop.max()) + 1)]
    weight = np.array([segments.rows.weight[s].sum() for s in stops])
    mean = np.array([np.average(u[s], axis=0, weights=segments.rows.weight[s]) for s in stops])
    slow = np.linalg.norm(mean[:, 3:], axis=1).max() < NEGLIGIBLE_BIAS_EARTH_RATES * EARTH_RATE
    b = np.zeros(3) if slow else np.average(mean[:, 3:], axis=0, weights=weight)
    likely = BIAS_SIGMA_RAD_S[0] if slow else BIAS_SIGMA_RAD_S[1]
    dt = _with_pauses(segments)
    w = np.sqrt(weight)[:, None] / segments.sigma[3:]
    for _ in range(MAX_ITERATIONS):
        C = integrated_attitudes(dt, u[:, 3:] - b)
        at = np.array([C[(s.start + s.stop) // 2] for s in stops])
        A = np.concatenate([np.broadcast_to(np.eye(3), at.shape), np.swapaxes(at, -1, -2)], axis=2)
        # prior of the step of the bias, for directions that the stops do not observe
        rows = np.concatenate([(A * w[..., None]).reshape(-1, 6), np.eye(3, 6) / likely])
        right = np.concatenate([((mean[:, 3:] - b) * w).reshape(-1), np.zeros(3)])
        x, *_ = np.linalg.lstsq(rows, right, rcond=None)
        b = b + x[:3]
        if np.abs(x[:3]).max() < 1e-3 * EARTH_RATE:
            break
    middle = float(segments.rows.time[(stops[0].start + stops[0].stop) // 2] - segments.time[0])
    down = -at[0] @ mean[0, :3] / np.linalg.norm(mean[0, :3])
    residual = right - rows @ x
    P = np.linalg.inv(rows.T @ rows) * max(1.0, float(residual @ residual) / max(len(residual) - 6, 1))
    return _from_vectors(segments, down, middle, b, x[3:], float(np.sqrt(P[range(3, 6), range(3, 6)].max())))


def _from_vectors(segments: Segments, down: Array, after: float, b: Array, earth: Array, sigma: float) -> Alignment:
    """Return the alignment from the vertical `after` [s] and the Earth's rate with its sigma, in initial body axes."""
    latitude = segments.latitude
    if np.linalg.norm(earth) < 2 * EARTH_RATE:  # the vertical at the start: the Earth has turned it since
        down = exponential(earth * after) @ down
    level = earth - down * (down @ earth)
    heading = float(np.clip(3 * sigma / (EARTH_RATE * np.cos(latitude)), *HEADING_SIGMA_RANGE_RAD))
    difference = abs(np.linalg.norm(earth) / EARTH_RATE - 1)
    if heading < HEADING_SIGMA_RANGE_RAD[1] and difference > EARTH_RATE_TOLERANCE + 3 * sigma / EARTH_RATE:
        ratio = np.linalg.norm(earth) / EARTH_RATE
        likely = (
            "its rate was taken off, by a navigator or a dead band about zero; log what the gyroscopes read"
            if ratio < FAINT_EARTH_RATES
            else "check the order, signs and unit of their columns, and the latitude"
        )
        raise InputError(
            f"{segments.rows.label}: turned through its stops, the gyroscopes see a rate of {ratio:.3g} times the "
            f"Earth's that turns with them; {likely}"
        )
    observed = float(np.arcsin(np.clip(-float(down @ earth) / np.linalg.norm(earth), -1, 1)))
    if abs(observed - latitude) > LATITUDE_TOLERANCE_RAD + 5 * sigma / EARTH_RATE:
        raise InputError(
            f"{segments.rows.label}: turned through its stops, the gyroscopes see the Earth's axis "
            f"{np.degrees(observed):.1f} deg above the horizon, and [site] says latitude {np.degrees(latitude):.1f} "
            "deg; correct one of the two"
        )
    if (
        heading >= HEADING_SIGMA_RANGE_RAD[1]
    ):  # no information on north: an arbitrary heading for the filter to start from
        level = np.eye(3)[np.argmin(np.abs(down))]
        level = level - down * (down @ level)
    north = level / np.linalg.norm(level)
    C = np.stack([north, np.cross(down, north), down])
    levels = np.array([LEVEL_SIGMA_RAD, LEVEL_SIGMA_RAD, heading])
    return Alignment(C, levels, b, observed, sigma / EARTH_RATE)


def _with_pauses(segments: Segments) -> Array:
    """Return the lengths (n,) [s] of the intervals, each pause of the clock added to the interval after it."""
    dt = segments.dt.copy()
    for k in np.flatnonzero(segments.pauses):
        dt[segments.first[k]] += segments.time[k + 1] - segments.time[k]
    return dt


def attitudes(segments: Segments, u: Array, start: Alignment) -> Array:
    """Return initial attitudes C_bn (K + 1, 3, 3) at every update: integrated rates, levelled at each stop.

    The error of a turn is distributed in proportion to the angle turned, as of a scale factor.
    """
    earth = rate_at(segments.latitude)
    dt = _with_pauses(segments)
    C = integrated_attitudes(dt, u[:, 3:] - start.bias)
    t = np.concatenate([[0.0], np.cumsum(dt)])
    C = exponential(earth * t[:, None]) @ start.C_bn @ C
    angle = np.concatenate([[0.0], np.cumsum(np.linalg.norm(u[:, 3:] - start.bias, axis=1) * dt)])[segments.first]
    turn, out, last = np.eye(3), np.empty((len(segments.first), 3, 3)), 0
    stop = np.append(segments.stop, segments.stop[-1])
    for k in range(len(out)):
        new = k < len(segments.stop) and stop[k] >= 0 and (k == 0 or stop[k - 1] != stop[k])
        if new:
            mine = segments.of_stop(int(stop[k]))
            tilt = _levelling_rotation(turn @ C[(mine.start + mine.stop) // 2] @ u[mine, :3].mean(axis=0))
            if k:
                part = (angle[last:k] - angle[last]) / max(angle[k] - angle[last], 1e-9)
                out[last:k] = exponential(-part[:, None] * tilt) @ out[last:k]
            turn = exponential(-tilt) @ turn
        out[k] = turn @ C[segments.first[k]]
        last = k if stop[k] >= 0 else last
    for pause in np.flatnonzero(segments.pauses):
        out[pause + 1] = out[pause]
    return out


def _levelling_rotation(force: Array) -> Array:
    """Return the smallest rotation vector (3,) [rad] that turns a force (3,) upwards."""
    unit, up = force / np.linalg.norm(force), np.array([0.0, 0.0, -1.0])
    axis = np.cross(unit, up)
    sine = float(np.linalg.norm(axis))
    return np.zeros(3) if sine < 1e-12 else axis / sine * np.arctan2(sine, float(unit @ up))


EDGE_INTERVALS = 5  # of a stop on each side of a turn, some seconds: longer, the Earth turns the vertical
SCALE_ERROR_SIGMA = 0.05  # of an element of M
MAX_TURN_RESIDUAL_DEG = 1.0  # where all other turns are right
OUTLIER_RATIO = 8.0  # to the median over turns
MIN_TURNS = 4  # for one of them to be an outlier
MAX_SCALE_ITERATIONS = 4
NONLINEAR_SCALE_ERROR = 0.02  # beyond, the navigator is not linear from the start
CLOCK_ERROR = 5e-3  # beyond, turns by a wrong clock show the Earth's axis at another latitude
MAX_DIFFERENCE = 0.1  # of the scale errors of a triad that have one cause
MIN_DRIFT_RATIO = 10.0  # to the median over turns: errors of the sensors are alike in all of them
MIN_SPEED_M_S, MIN_DISTANCE_M = 0.2, 0.5  # less than this is a lever arm, or a hand


def gyro_scale_errors(segments: Segments, u: Array) -> Array:
    """Return large scale errors of the gyroscopes (3,), and those of a wrong clock, from forces and rates (n, 6).

    Others are returned as zero. Raises InputError for single turns that no errors of the gyroscopes explain.
    """
    last = int(segments.stop.max())
    spans = [(segments.of_stop(k), segments.of_stop(k + 1)) for k in range(last)]
    spans = [(a, b) for a, b in spans if b.start > a.stop]
    M = np.zeros((3, 3))
    if len(spans) < MIN_TURNS:
        return np.diag(M)
    for _ in range(MAX_SCALE_ITERATIONS):
        residuals, J = zip(*(_missed_gravity_angle(segments, u, a, b, M) for a, b in spans), strict=True)
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
        others = number_of(len(size) - int(outlier.sum()), "other turn")
        raise InputError(
            f"{segments.rows.label}: between {t[0]:.6g} and {t[1]:.6g} s gravity turns by {size.max():.2g} "
            f"deg more or less than the gyroscopes say, which tell the {others} to {np.median(size):.2g} "
            "deg; samples were lost there, or wrong; cut the recording there and give the longer part"
        )
    sizes = np.diag(M)
    return sizes if of_the_clock(sizes) else np.where(np.abs(sizes) > NONLINEAR_SCALE_ERROR, sizes, 0.0)


def of_the_clock(scale_errors: Array) -> bool:
    """Return whether scale errors (3,) of gyroscopes are large and alike, as those of a wrong clock."""
    sizes = np.abs(scale_errors)
    return bool(sizes.min() > CLOCK_ERROR and np.ptp(scale_errors) <= MAX_DIFFERENCE * sizes.max())


def _missed_gravity_angle(segments: Segments, u: Array, a: slice, b: slice, M: Array) -> tuple[Array, Array]:
    """Return the angle (3,) [rad] by which a turn with rates (1 + M) w misses gravity, and its Jacobian (3, 9)."""
    before, after = (
        slice(max(a.start, a.stop - EDGE_INTERVALS), a.stop),
        slice(b.start, min(b.stop, b.start + EDGE_INTERVALS)),
    )
    level = (u[before, 3:].mean(axis=0) + u[after, 3:].mean(axis=0)) / 2
    w = u[a.stop : b.start, 3:] - level
    dt = segments.dt[a.stop : b.start]
    C = integrated_attitudes(dt, w + w @ M.T)
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
