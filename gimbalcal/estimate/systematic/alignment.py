r"""Where a unit points before anything is calibrated: level from gravity, north from the Earth's rate at every stop.

In axes that the gyroscopes carry along (inertial ones, up to the errors of the triad) the Earth's rate e is one vector
for all stops, and a bias is not, because the unit is turned:

.. math:: \bar\omega_i = b + C_i \, e

over all stops i, with C_i from the integrated rates less b, and as often as b still moves. So north does not take the
bias for the Earth, as a single stop does: 0.1 deg/h of bias is half a degree of heading.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gimbalcal.earth import EARTH_RATE, rate_at
from gimbalcal.errors import InputError
from gimbalcal.estimate.systematic.segments import Segments
from gimbalcal.navigate.strapdown import carried
from gimbalcal.number import Array
from gimbalcal.rotation import exponential

MAX_ITERATIONS = 6
LEVEL_SIGMA_RAD = np.radians(1.0)  # one sigma of the level at the start
HEADING_SIGMA_RANGE_RAD = np.radians(1.0), np.radians(60.0)  # one sigma of the heading: at least, at most
NEGLIGIBLE_BIAS_EARTH_RATES = (
    3.0  # times the Earth's rate: gyroscopes that read less at rest have no bias worth the name
)
BIAS_SIGMA_RAD_S = np.radians([1.0, 1000.0]) / 3600  # rad/s, one sigma of the bias of such a triad, and of any other
LATITUDE_TOLERANCE_RAD = np.radians(3.0)  # what the latitude may be off; 5 sigma of what gyroscopes see beside
FAINT_EARTH_RATES = 0.1  # of the Earth's rate: gyroscopes that see less of it, and could, had it taken off
EARTH_RATE_TOLERANCE = 0.5  # of the Earth's rate: what it may be off where gyroscopes that see it are to be believed


@dataclass(frozen=True)
class Alignment:
    """C_bn (3, 3) at the start, one sigma (3,) [rad] of it about north, east, down, and the bias (3,) [rad/s]."""

    C_bn: Array
    sigma: Array
    bias: Array


def align(segments: Segments, u: Array) -> Alignment:
    """Attitude at the start from force and rate (n, 6). Raises InputError where the Earth's rate is not to be found."""
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
        # what is left to the bias, from where it is: all of it if no stop tells
        rows = np.concatenate([(A * w[..., None]).reshape(-1, 6), np.eye(3, 6) / likely])
        right = np.concatenate([((mean[:, 3:] - b) * w).reshape(-1), np.zeros(3)])
        x, *_ = np.linalg.lstsq(rows, right, rcond=None)
        b = b + x[:3]
        if np.abs(x[:3]).max() < 1e-3 * EARTH_RATE:
            break
    middle = float(segments.rows.time[(stops[0].start + stops[0].stop) // 2] - segments.time[0])
    down = -at[0] @ mean[0, :3] / np.linalg.norm(mean[0, :3])
    left = right - rows @ x
    P = np.linalg.inv(rows.T @ rows) * max(1.0, float(left @ left) / max(len(left) - 6, 1))
    return _from_vectors(segments, down, middle, b, x[3:], float(np.sqrt(P[range(3, 6), range(3, 6)].max())))


def _from_vectors(segments: Segments, down: Array, after: float, b: Array, earth: Array, sigma: float) -> Alignment:
    latitude = segments.rows.site.latitude
    assert latitude is not None
    if np.linalg.norm(earth) < 2 * EARTH_RATE:  # the vertical at the start: the Earth has turned it since
        down = exponential(earth * after) @ down
    level = earth - down * (down @ earth)
    heading = float(np.clip(3 * sigma / (EARTH_RATE * np.cos(latitude)), *HEADING_SIGMA_RANGE_RAD))
    off = abs(np.linalg.norm(earth) / EARTH_RATE - 1)
    if heading < HEADING_SIGMA_RANGE_RAD[1] and off > EARTH_RATE_TOLERANCE + 3 * sigma / EARTH_RATE:
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
    seen = np.arcsin(np.clip(-float(down @ earth) / np.linalg.norm(earth), -1, 1))
    if abs(seen - latitude) > LATITUDE_TOLERANCE_RAD + 5 * sigma / EARTH_RATE:
        raise InputError(
            f"{segments.rows.label}: turned through its stops, the gyroscopes see the Earth's axis "
            f"{np.degrees(seen):.1f} deg above the horizon, and [site] says latitude {np.degrees(latitude):.1f} deg; "
            "correct one of the two"
        )
    if heading >= HEADING_SIGMA_RANGE_RAD[1]:  # nothing tells north: any heading, and the filter finds what it can
        level = np.eye(3)[np.argmin(np.abs(down))]
        level = level - down * (down @ level)
    north = level / np.linalg.norm(level)
    C = np.stack([north, np.cross(down, north), down])
    return Alignment(C, np.array([LEVEL_SIGMA_RAD, LEVEL_SIGMA_RAD, heading]), b)


def _with_pauses(segments: Segments) -> Array:
    """Lengths (n,) [s] of the intervals, pauses of the clock added to what follows: the Earth went on turning."""
    dt = segments.dt.copy()
    for k in np.flatnonzero(segments.pauses):
        dt[segments.first[k]] += segments.time[k + 1] - segments.time[k]
    return dt


def attitudes(segments: Segments, u: Array, start: Alignment) -> Array:
    """First guess C_bn (K + 1, 3, 3) at every update: the carried attitude, made level again at each stop.

    What a turn was off by, it was off by in proportion to the angle turned, as a wrong scale factor makes it.
    """
    latitude = segments.rows.site.latitude
    assert latitude is not None
    earth = rate_at(latitude)
    dt = _with_pauses(segments)
    C = carried(dt, u[:, 3:] - start.bias)
    t = np.concatenate([[0.0], np.cumsum(dt)])
    C = exponential(earth * t[:, None]) @ start.C_bn @ C
    went = np.concatenate([[0.0], np.cumsum(np.linalg.norm(u[:, 3:] - start.bias, axis=1) * dt)])[segments.first]
    turn, out, left = np.eye(3), np.empty((len(segments.first), 3, 3)), 0
    stop = np.append(segments.stop, segments.stop[-1])
    for k in range(len(out)):
        new = k < len(segments.stop) and stop[k] >= 0 and (k == 0 or stop[k - 1] != stop[k])
        if new:
            mine = segments.of_stop(int(stop[k]))
            off = _off_level(turn @ C[(mine.start + mine.stop) // 2] @ u[mine, :3].mean(axis=0))
            if k:
                part = (went[left:k] - went[left]) / max(went[k] - went[left], 1e-9)
                out[left:k] = exponential(-part[:, None] * off) @ out[left:k]
            turn = exponential(-off) @ turn
        out[k] = turn @ C[segments.first[k]]
        left = k if stop[k] >= 0 else left
    for pause in np.flatnonzero(segments.pauses):
        out[pause + 1] = out[pause]
    return out


def _off_level(force: Array) -> Array:
    """The smallest rotation vector (3,) [rad] that makes a force (3,) point up."""
    unit, up = force / np.linalg.norm(force), np.array([0.0, 0.0, -1.0])
    axis = np.cross(unit, up)
    sine = float(np.linalg.norm(axis))
    return np.zeros(3) if sine < 1e-12 else axis / sine * np.arctan2(sine, float(unit @ up))
