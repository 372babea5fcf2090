r"""The space-stable mechanisation: where a platform that does not turn thinks it is.

Gyroscopes hold the platform, so its axes *are* an inertial frame: x and y span the equator, z is the pole. Nothing has
to be rotated. Force is added to gravitation, twice integrated, and the result is a place among the stars:

.. math:: \ddot r = f + G(r), \qquad
          G(r) = -g(L, h) \, u + \Omega \times (\Omega \times r), \qquad
          u = (\cos L \cos S, \; \cos L \sin S, \; \sin L)

with u the upward normal of the ellipsoid below r, L its latitude and S its angle from x. Longitude is what S has gained
on the turning Earth, velocity is :math:`v - \Omega \times r`, and the vertical -u together with the pole gives the
attitude of the base through the gimbals. G is gravity less the centrifugal force that it contains.

A small error of place tilts u, so that gravity pulls it back: the loop swings with Schuler's 84.4 min, its plane turns
as Foucault's pendulum does, and what the sensors misread is in the platform's axes, so that it swings around the base
once a day. Upwards gravity pushes away instead, hence the height is held by an external one; the swing is damped by an
external velocity (of a log, or zero on a still base):

.. math:: \dot r &= v - c_1 (h - h_{ext}) u \\
          \dot v &= f + G - c_2 (h - h_{ext}) u - 2 \zeta \omega_s (v_h - v_{ext}) .

Source: Britting (1971), chapter 6; Wu et al. (2018), section 5.2; constants of WGS-84.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import atan2, cos, sin, sqrt

import numpy as np

from gimbalcal.compiled import interpreted_first
from gimbalcal.earth import E2, EARTH_RATE, FLATTENING, SEMI_MAJOR_AXIS, normal_gravity, radii
from gimbalcal.number import Array
from gimbalcal.rotation import frame_rotation

MAX_STEP_RATIO = 0.2  # step over the time constant of the height's loop beyond which it is not followed
MIN_COMPILED_ROWS = 200_000  # rows, which Python does in the time that loading the machine code takes
DERIVATIVE_STEPS = np.repeat([100.0, 0.1, 0.1], 3)  # m, m/s, m/s^2: steps of a derivative, 1e-9 of which is rounding
MICROSECOND = 6  # decimals: rows are alike whose lengths differ by less


@dataclass(frozen=True)
class InertialSite:
    """A still base: latitude [rad], height [m], gravity [m/s^2], and S [rad] of its meridian at the first row."""

    latitude: float
    height: float
    gravity: float
    phase: float


@dataclass(frozen=True)
class Aids:
    """External references: `damping` of the swing, of critical (0: none), and time constant [s] of the height's loop.

    velocity (2,) or (n, 2) [m/s] north and east, and height (n,) above the site [m], are what the references say.
    alignment: time [s] at the beginning in which the attitude is found: 0.04" of readouts of 1" at 1 Hz.
    """

    damping: float = 0.5
    height_s: float = 100.0
    velocity: Array | tuple[float, float] = (0.0, 0.0)
    height: Array | float = 0.0
    alignment: float = 600.0


@dataclass(frozen=True)
class NavigatorOutput:
    """Output of the navigator at n rows: time [s], latitude, S [rad], height [m]; velocity (n, 2) north, east [m/s]."""

    time: Array
    latitude: Array
    phase: Array
    height: Array
    velocity: Array

    @property
    def up(self) -> Array:
        """The computed vertical, upwards, in platform axes (n, 3)."""
        c = np.cos(self.latitude)
        return np.stack([c * np.cos(self.phase), c * np.sin(self.phase), np.sin(self.latitude)], axis=-1)


def schuler_rate(site: InertialSite) -> float:
    r"""Return the angular frequency :math:`\omega_s = \sqrt{g / \sqrt{(M + h)(N + h)}}` of the swing [rad/s]."""
    M, N = radii(site.latitude)
    return float(np.sqrt(site.gravity / np.sqrt((M + site.height) * (N + site.height))))


USUAL = Aids()
UNDAMPED = Aids(damping=0.0)  # of a strapdown unit, as the papers navigate it


def navigate(
    time: Array, force: Array, site: InertialSite, aids: Aids = USUAL, start: tuple[float, float] = (0.0, 0.0)
) -> NavigatorOutput:
    """Navigate from a known place with the specific force (n, 3) [m/s^2] in platform axes, at rest when it begins.

    A row stands for the time up to halfway to its neighbours. At 100 Hz or by the minute, it is all the same, as only
    the Earth turns. Leapfrog: half a step on, the push of the whole row, half a step on; second order, and without
    damping it keeps the energy of the swing. start (2,) [m/s]: error of the velocity north and east at first. Raises
    ValueError for rows too widely spaced for the height's loop.
    """
    time, force = np.asarray(time, dtype=float), np.ascontiguousarray(force, dtype=float)
    step = _interval_lengths(time)
    if step.max() > MAX_STEP_RATIO * aids.height_s:
        raise ValueError(f"steps up to {step.max():g} s need `height_s` of {step.max() / MAX_STEP_RATIO:g} s or more")
    n = len(time)
    first = site.phase - EARTH_RATE * step[0] / 2  # where the first row begins
    v_ref = np.ascontiguousarray(np.broadcast_to(np.asarray(aids.velocity, dtype=float), (n, 2)))
    h_ref = np.ascontiguousarray(np.broadcast_to(site.height + np.asarray(aids.height, dtype=float), (n,)))
    r, v = _at_rest(site, first)
    v += _north_east(site.latitude, first).T @ np.asarray(start)
    out = np.empty((n, 5))
    _run_loop(step, force, r, v, *_loop_constants(site, aids), v_ref, h_ref, out)
    return NavigatorOutput(time, out[:, 0], np.unwrap(out[:, 1]), out[:, 2], out[:, 3:])


def small_error_response(time: Array, force: Array, phase: Array, site: InertialSite, aids: Aids) -> NavigatorOutput:
    r"""Return the navigation errors of a stationary base for small errors of force (n, 3, p) [m/s^2] and of S at first
    (p,) [rad].

    In Earth-fixed axes the errors propagate from row to row by a transition that depends on the length of the row only,

    .. math:: x_{k+1} = A x_k + B f_k, \qquad o_k = C x_k + D f_k ,

    x being place and velocity (6, p), o what the navigator says, and A to D the derivative of its own row: p errors at
    once. Returns latitude, S and height (n, p), velocity (n, 2, p).
    """
    step = _interval_lengths(np.asarray(time, dtype=float))
    begin = np.cumsum(step) - step - step[0] / 2
    lengths, which = np.unique(np.round(step, MICROSECOND), return_inverse=True)
    slopes = [_step_derivative(float(h), site, aids) for h in lengths]
    f = frame_rotation("z", site.phase + EARTH_RATE * begin) @ force
    now, out = np.zeros((9, len(phase))), np.empty((len(step), 5, len(phase)))
    r, v = _at_rest(site, 0.0)
    now[:6] = np.array([-r[1], r[0], 0.0, -v[1], v[0], 0.0])[:, None] * phase
    for k, m in enumerate(which):
        now[6:] = f[k]
        then = slopes[m] @ now
        now[:6], out[k] = then[:6], then[6:]
    return NavigatorOutput(time, out[:, 0], out[:, 1], out[:, 2], out[:, 3:])


def _step_derivative(step: float, site: InertialSite, aids: Aids) -> Array:
    """Return the derivative (11, 9) of place and velocity after a row, and of what it says, by place, velocity before
    and force.

    The base is at S = 0 in the axes before the row, and in those after it.
    """
    turn, towards = EARTH_RATE * step, np.array([np.cos(site.latitude), 0.0, np.sin(site.latitude)])
    force = site.gravity * frame_rotation("z", -turn / 2) @ towards
    still, loops = np.concatenate([*_at_rest(site, 0.0), force]), _loop_constants(site, aids)

    def row(given: Array) -> Array:
        r, v, f = given.reshape(3, 3)
        out = np.empty((1, 5))
        after = _run_loop(np.array([step]), f[None], r, v, *loops, np.zeros((1, 2)), np.array([site.height]), out)
        return np.concatenate([after, out[0]])

    slope = np.stack([(row(still + e) - row(still - e)) / (2 * e.sum()) for e in np.diag(DERIVATIVE_STEPS)], axis=-1)
    slope[:6] = (frame_rotation("z", turn) @ slope[:6].reshape(2, 3, 9)).reshape(6, 9)
    return np.asarray(slope)


def _loop_constants(site: InertialSite, aids: Aids) -> tuple[Array, float, float, float]:
    """Return gravity with its slopes, the damping rate and both rates of the height loop, as `run_loop` takes them."""
    towards_pole, upwards = _gravity_slopes(site)
    gravity = np.array([site.gravity, site.latitude, towards_pole, site.height, upwards])
    # critically damped, gravity's own slope made up for
    return gravity, 2 * aids.damping * schuler_rate(site), 2 / aids.height_s, 1 / aids.height_s**2 - upwards


def _interval_lengths(time: Array) -> Array:
    """Return the time (n,) [s] that each row stands for: up to halfway to its neighbours, the ends as long as next to
    them.
    """
    edges = (time[1:] + time[:-1]) / 2
    ends = 2 * time[0] - edges[0], 2 * time[-1] - edges[-1]
    return np.diff(np.concatenate([[ends[0]], edges, [ends[1]]]))


def _gravity_slopes(site: InertialSite) -> tuple[float, float]:
    """Return the slope of gravity with latitude [m/s^2/rad] and with height [1/s^2], of the ellipsoid's."""
    L, h, scale = site.latitude, site.height, site.gravity / float(normal_gravity(site.latitude, site.height))
    by_latitude = normal_gravity(L + 1e-4, h) - normal_gravity(L - 1e-4, h)
    by_height = normal_gravity(L, h + 100.0) - normal_gravity(L, h - 100.0)
    return scale * float(by_latitude) / 2e-4, scale * float(by_height) / 200.0


def _at_rest(site: InertialSite, phase: float) -> tuple[Array, Array]:
    """Return the position (3,) [m] and velocity (3,) [m/s] of the still base in platform axes."""
    s, c, N = np.sin(site.latitude), np.cos(site.latitude), radii(site.latitude)[1]
    across = (N + site.height) * c
    r = np.array([across * np.cos(phase), across * np.sin(phase), (N * (1 - E2) + site.height) * s])
    return r, EARTH_RATE * np.array([-r[1], r[0], 0.0])


def _north_east(latitude: float, phase: float) -> Array:
    """Return the north and east (2, 3) in platform axes."""
    s, c = np.sin(latitude), np.cos(latitude)
    return np.array([[-s * np.cos(phase), -s * np.sin(phase), c], [-np.sin(phase), np.cos(phase), 0.0]])


@interpreted_first(MIN_COMPILED_ROWS)
def _run_loop(
    step: Array, force: Array, r: Array, v: Array, gravity: Array, damping: float, c1: float, c2: float, v_ref: Array,
    h_ref: Array, out: Array,
) -> tuple[float, ...]:  # fmt: skip
    """Return the loop over all rows; out (n, 5): latitude, S, height, velocity north and east in the middle of each
    row.

    Returns place and velocity (6,) after the last one.
    """
    a, b = SEMI_MAJOR_AXIS, SEMI_MAJOR_AXIS * (1 - FLATTENING)
    x, y, z = r
    vx, vy, vz = v
    for k in range(len(step)):
        h = step[k]
        x, y, z = x + vx * h / 2, y + vy * h / 2, z + vz * h / 2
        # the Earth's turn makes an arc of this tangent: 12 m in a minute. Place below by Bowring's formula
        turn = (EARTH_RATE * h) ** 2
        p = sqrt(x * x + y * y) * (1 - turn / 8)
        beta = atan2(z * a, p * b)
        L = atan2(z + E2 / (1 - E2) * b * sin(beta) ** 3, p - E2 * a * cos(beta) ** 3)
        S = atan2(y, x)
        sL, cL, sS, cS = sin(L), cos(L), sin(S), cos(S)
        # height, half of the row's fall towards its reference done: an implicit step
        off = (p * cL + z * sL - a * sqrt(1 - E2 * sL * sL) - h_ref[k]) / (1 + c1 * h / 2)
        height, fall = h_ref[k] + off, c1 * off * h / 2
        x, y, z = x - fall * cL * cS, y - fall * cL * sS, z - fall * sL
        # force and gravitation; the height's loop pulls along the vertical
        g = gravity[0] + gravity[2] * (L - gravity[1]) + gravity[4] * (height - gravity[3]) + c2 * off
        spin = EARTH_RATE**2 * (1 - turn / 6)  # from the tangent to the mean over the arc
        ax = force[k, 0] - g * cL * cS - spin * x
        ay = force[k, 1] - g * cL * sS - spin * y
        az = force[k, 2] - g * sL
        # velocity over ground in the middle of the row, and what its reference takes off: implicit as well
        wx, wy, wz = vx + ax * h / 2 + EARTH_RATE * y, vy + ay * h / 2 - EARTH_RATE * x, vz + az * h / 2
        north, east = -sL * (cS * wx + sS * wy) + cL * wz, cS * wy - sS * wx
        dn = -damping * h * (north - v_ref[k, 0]) / (1 + damping * h / 2)
        de = -damping * h * (east - v_ref[k, 1]) / (1 + damping * h / 2)
        vx += ax * h - sL * cS * dn - sS * de
        vy += ay * h - sL * sS * dn + cS * de
        vz += az * h + cL * dn
        out[k, 0], out[k, 1], out[k, 2], out[k, 3], out[k, 4] = L, S, height, north + dn / 2, east + de / 2
        x, y, z = x + vx * h / 2 - fall * cL * cS, y + vy * h / 2 - fall * cL * sS, z + vz * h / 2 - fall * sL
    return x, y, z, vx, vy, vz
