r"""Initial alignment before calibration: level from gravity, north from the Earth's rate at all stops.

In axes carried along by the gyroscopes (inertial ones, up to the errors of the triad) the Earth's rate e is the same
vector at all stops, and a bias is not, because the unit is turned:

.. math:: \bar\omega_i = b + C_i \, e

over all stops i, with C_i from the integrated rates less b, iterated until b converges. So the bias does not enter the
heading, as it does at a single stop, where 0.1 deg/h of bias is half a degree of heading.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gimbalcal.earth import EARTH_RATE, rate_at
from gimbalcal.errors import InputError
from gimbalcal.navigate.strapdown import carried
from gimbalcal.number import Array
from gimbalcal.rotation import exponential
from gimbalcal.views.segments import Segments

MAX_ITERATIONS = 6
LEVEL_SIGMA_RAD = np.radians(1.0)  # at the start
HEADING_SIGMA_RANGE_RAD = np.radians(1.0), np.radians(60.0)  # at the start
NEGLIGIBLE_BIAS_EARTH_RATES = (
    3.0  # times the Earth's rate: gyroscopes that read less at rest have no bias worth the name
)
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
    latitude = segments.rows.site.latitude
    assert latitude is not None
    dt = _with_pauses(segments)
    w = np.sqrt(weight)[:, None] / segments.sigma[3:]
    for _ in range(MAX_ITERATIONS):
        C = carried(dt, u[:, 3:] - b)
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
    latitude = segments.rows.site.latitude
    assert latitude is not None
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
    latitude = segments.rows.site.latitude
    assert latitude is not None
    earth = rate_at(latitude)
    dt = _with_pauses(segments)
    C = carried(dt, u[:, 3:] - start.bias)
    t = np.concatenate([[0.0], np.cumsum(dt)])
    C = exponential(earth * t[:, None]) @ start.C_bn @ C
    angle = np.concatenate([[0.0], np.cumsum(np.linalg.norm(u[:, 3:] - start.bias, axis=1) * dt)])[segments.first]
    turn, out, last = np.eye(3), np.empty((len(segments.first), 3, 3)), 0
    stop = np.append(segments.stop, segments.stop[-1])
    for k in range(len(out)):
        new = k < len(segments.stop) and stop[k] >= 0 and (k == 0 or stop[k - 1] != stop[k])
        if new:
            mine = segments.of_stop(int(stop[k]))
            tilt = _tilt(turn @ C[(mine.start + mine.stop) // 2] @ u[mine, :3].mean(axis=0))
            if k:
                part = (angle[last:k] - angle[last]) / max(angle[k] - angle[last], 1e-9)
                out[last:k] = exponential(-part[:, None] * tilt) @ out[last:k]
            turn = exponential(-tilt) @ turn
        out[k] = turn @ C[segments.first[k]]
        last = k if stop[k] >= 0 else last
    for pause in np.flatnonzero(segments.pauses):
        out[pause + 1] = out[pause]
    return out


def _tilt(force: Array) -> Array:
    """Return the smallest rotation vector (3,) [rad] that turns a force (3,) upwards."""
    unit, up = force / np.linalg.norm(force), np.array([0.0, 0.0, -1.0])
    axis = np.cross(unit, up)
    sine = float(np.linalg.norm(axis))
    return np.zeros(3) if sine < 1e-12 else axis / sine * np.arctan2(sine, float(unit @ up))
