r"""Strapdown navigation in north, east, down: a loop over every sample, compiled by numba.

Readings are means over intervals; with rate and force linear in time through the means of two intervals, rotation
vector and velocity of the second one are, in the axes of its beginning,

.. math::
    \varphi &= \alpha + k \, a_0 \times a, \qquad \alpha = a \, \Delta t, \quad \beta = c \, \Delta t \\
    u &= \beta + \tfrac{1 - \cos\varphi}{\varphi^2} \varphi \times \beta
         + \tfrac{1}{\varphi^2} (1 - \tfrac{\sin\varphi}{\varphi}) \varphi \times (\varphi \times \beta)
         + k (a_0 \times c + c_0 \times a), \qquad k = \frac{\Delta t^3}{6 (\Delta t_0 + \Delta t)}

(coning and sculling; a, c mean rate and force, index 0 the interval before). The mechanisation is

.. math::
    C_b^n \leftarrow e^{-[\zeta \times]} C_b^n e^{[\varphi \times]}, \quad \zeta = (\omega_{ie} + \omega_{en}) \Delta t,
    \qquad \dot v = f^n + g^n - (2 \omega_{ie} + \omega_{en}) \times v

with the turn of the frame within the interval, zeta x (u / 2 + ...), to second order.

Source: Savage, J. Guidance 21 (1998) 19 and 208.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gimbalcal.compiled import compiled
from gimbalcal.earth import E2, EARTH_RATE, SEMI_MAJOR_AXIS, normal_gravity
from gimbalcal.number import Array


class StrapdownStates(NamedTuple):
    """States before the first and after each of n intervals.

    C_bn (n + 1, 3, 3) body to navigation, velocity (n + 1, 3) north, east, down [m/s], position (n + 1, 3): latitude,
    longitude [rad], height [m].
    """

    C_bn: Array
    velocity: Array
    position: Array


def strapdown(dt: Array, rate: Array, force: Array, C_bn: Array, velocity: Array, position: Array) -> StrapdownStates:
    """Navigate over n intervals dt (n,) [s] with mean rates (n, 3) [rad/s] and forces (n, 3) [m/s^2] in body axes.

    From C_bn (3, 3), velocity (3,) and position (3,), as in `StrapdownStates`, in normal gravity.
    """
    place = gravity_polynomials(float(position[0]), float(position[2]), None)
    n = len(dt)
    out = StrapdownStates(np.empty((n + 1, 3, 3)), np.empty((n + 1, 3)), np.empty((n + 1, 3)))
    out.C_bn[0], out.velocity[0], out.position[0] = C_bn, velocity, position
    _navigate(*contiguous(dt, rate, force), place, *out)
    return out


def aided_strapdown(
    dt: Array, rate: Array, force: Array, C_bn: Array, position: Array, every: Array, damping: float,
    height_loop: float, gravity: float | None = None, velocity: Array | None = None, reference: Array | None = None,
) -> StrapdownStates:  # fmt: skip
    r"""Navigate as `strapdown`, the height held by an external one and the swing damped by an external velocity.

    .. math:: \dot h &= -v_D - c_1 (h - h_{ext}), \qquad
              \dot v = \ldots + c_2 (h - h_{ext}) e_D - 2 \zeta \omega_s (v_h - v_{ext})

    with c_1 and c_2 of a critically damped loop of time constant `height_loop` [s], gravity's own slope made up for;
    damping: 2 zeta omega_s [1/s]. velocity (3,) at the start (default: at rest); reference (n, 3) is what the external
    ones say: velocity north and east, height (default: it stays where it is). Returned are the states before the first
    interval and after those of `every` (m,), in order.
    """
    place = gravity_polynomials(float(position[0]), float(position[2]), gravity)
    n, m = len(dt), len(every)
    out = StrapdownStates(np.empty((m + 1, 3, 3)), np.empty((m + 1, 3)), np.empty((m + 1, 3)))
    out.C_bn[0], out.velocity[0], out.position[0] = C_bn, np.zeros(3) if velocity is None else velocity, position
    still = np.broadcast_to(np.array([0.0, 0.0, position[2]]), (n, 3))
    loop = np.array([damping, 2 / height_loop, 1 / height_loop**2 - place[2]])
    readings = contiguous(dt, rate, force, still if reference is None else reference)
    _navigate_aided(*readings, place, loop, np.asarray(every, dtype=np.int64), *out)
    return out


def integrated_attitudes(dt: Array, rate: Array) -> Array:
    """Return attitudes (n + 1, 3, 3) from body axes to those in which they began, from mean rates (n, 3) [rad/s]
    alone.
    """
    out = np.empty((len(dt) + 1, 3, 3))
    _carry_attitudes(*contiguous(dt, rate), out)
    return out


def contiguous(*arrays: Array) -> list[Array]:
    """Return arrays as the kernels want them: of float64, without gaps."""
    return [np.ascontiguousarray(x, dtype=float) for x in arrays]


def gravity_polynomials(latitude: float, height: float, gravity: float | None) -> Array:
    """Return the normal gravity as polynomials for the kernels: (g, dg/dlatitude, dg/dheight, latitude, height) where
    one is.
    """
    g = float(normal_gravity(latitude, height)) if gravity is None else gravity
    d = 1e-4, 10.0  # rad, m; differences of a smooth function
    by_latitude = float(normal_gravity(latitude + d[0], height) - normal_gravity(latitude - d[0], height)) / (2 * d[0])
    by_height = float(normal_gravity(latitude, height + d[1]) - normal_gravity(latitude, height - d[1])) / (2 * d[1])
    return np.array([g, by_latitude, by_height, latitude, height])


@compiled
def _navigate(dt: Array, rate: Array, force: Array, place: Array, C: Array, v: Array, p: Array) -> None:
    C1, v1, p1 = C[0].copy(), v[0].copy(), p[0].copy()
    for k in range(len(dt)):
        advance(C1, v1, p1, dt, rate, force, k, k > 0, place)
        C[k + 1], v[k + 1], p[k + 1] = C1, v1, p1


@compiled
def _navigate_aided(
    dt: Array, rate: Array, force: Array, reference: Array, place: Array, loop: Array, every: Array, C: Array, v: Array,
    p: Array,
) -> None:  # fmt: skip
    C1, v1, p1 = C[0].copy(), v[0].copy(), p[0].copy()
    m = 0
    for k in range(len(dt)):
        advance(C1, v1, p1, dt, rate, force, k, k > 0, place)
        h = dt[k]
        gain = loop[0] * h / (1 + loop[0] * h)  # implicit, as a stiff loop may be faster than a row
        v1[0] -= gain * (v1[0] - reference[k, 0])
        v1[1] -= gain * (v1[1] - reference[k, 1])
        off = (p1[2] - reference[k, 2]) / (1 + loop[1] * h)
        p1[2] = reference[k, 2] + off
        v1[2] += loop[2] * off * h
        if m < len(every) and every[m] == k:
            m += 1
            C[m], v[m], p[m] = C1, v1, p1


@compiled
def _carry_attitudes(dt: Array, rate: Array, C: Array) -> None:
    now = np.eye(3)
    C[0] = now
    for k in range(len(dt)):
        h = dt[k]
        ax, ay, az = rate[k, 0] * h, rate[k, 1] * h, rate[k, 2] * h
        if k:
            c = h * h / (6 * (dt[k - 1] + h))
            ox, oy, oz = rate[k - 1, 0] * c, rate[k - 1, 1] * c, rate[k - 1, 2] * c
            ax, ay, az = ax + oy * az - oz * ay, ay + oz * ax - ox * az, az + ox * ay - oy * ax
        s1, s2, _ = _rotation_series(ax * ax + ay * ay + az * az)
        _turn_right(now, ax, ay, az, s1, s2)
        C[k + 1] = now


@compiled
def advance(
    C: Array, v: Array, p: Array, dt: Array, rate: Array, force: Array, k: int, joined: bool, place: Array
) -> tuple[float, float, float]:
    """Return one interval: C, v, p (latitude, longitude, height) in place; returns the velocity that force made, in
    n.
    """
    h = dt[k]
    ax, ay, az = rate[k, 0] * h, rate[k, 1] * h, rate[k, 2] * h
    bx, by, bz = force[k, 0] * h, force[k, 1] * h, force[k, 2] * h
    sx = sy = sz = 0.0
    if joined:
        c = h * h / (6 * (dt[k - 1] + h))
        ox, oy, oz = rate[k - 1, 0] * c, rate[k - 1, 1] * c, rate[k - 1, 2] * c
        ux, uy, uz = force[k - 1, 0] * c, force[k - 1, 1] * c, force[k - 1, 2] * c
        sx = oy * bz - oz * by + uy * az - uz * ay
        sy = oz * bx - ox * bz + uz * ax - ux * az
        sz = ox * by - oy * bx + ux * ay - uy * ax
        ax, ay, az = ax + oy * az - oz * ay, ay + oz * ax - ox * az, az + ox * ay - oy * ax
    t = ax * ax + ay * ay + az * az
    s1, s2, s3 = _rotation_series(t)  # sin x / x, (1 - cos x) / x^2, (1 - sin x / x) / x^2
    xx, xy, xz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    yx, yy, yz = ay * xz - az * xy, az * xx - ax * xz, ax * xy - ay * xx
    wx, wy, wz = bx + 2 * xx / 3, by + 2 * xy / 3, bz + 2 * xz / 3  # what the turn of the frame acts on
    bx, by, bz = bx + s2 * xx + s3 * yx + sx, by + s2 * xy + s3 * yy + sy, bz + s2 * xz + s3 * yz + sz
    fn = C[0, 0] * bx + C[0, 1] * by + C[0, 2] * bz
    fe = C[1, 0] * bx + C[1, 1] * by + C[1, 2] * bz
    fd = C[2, 0] * bx + C[2, 1] * by + C[2, 2] * bz
    # velocity and place in the middle: taken at the beginning, the swing would grow by omega_s^2 h / 4 a second
    L, height = p[0], p[2] - v[2] * h / 2
    RM, RN = radii(np.sin(L), height)
    L += v[0] * h / (2 * RM)
    sL, cL = np.sin(L), np.cos(L)
    g = place[0] + place[1] * (L - place[3]) + place[2] * (height - place[4])
    ie_n, ie_d = EARTH_RATE * cL, -EARTH_RATE * sL
    en_n, en_e, en_d = v[1] / RN, -v[0] / RM, -v[1] * sL / (cL * RN)
    zn, ze, zd = (ie_n + en_n) * h, en_e * h, (ie_d + en_d) * h
    kn, ke, kd = 2 * ie_n + en_n, en_e, 2 * ie_d + en_d
    vn = v[0] + (fn - (ze * fd - zd * fe) / 2 - (ke * v[2] - kd * v[1]) * h) / 2
    ve = v[1] + (fe - (zd * fn - zn * fd) / 2 - (kd * v[0] - kn * v[2]) * h) / 2
    vd = v[2] + (fd - (zn * fe - ze * fn) / 2 - (kn * v[1] - ke * v[0]) * h + g * h) / 2
    # the frame: Earth rate and transport rate
    en_n, en_e, en_d = ve / RN, -vn / RM, -ve * sL / (cL * RN)
    zn, ze, zd = (ie_n + en_n) * h, en_e * h, (ie_d + en_d) * h
    # - zeta x w / 2 + zeta x (zeta x w) / 6
    un = C[0, 0] * wx + C[0, 1] * wy + C[0, 2] * wz
    ue = C[1, 0] * wx + C[1, 1] * wy + C[1, 2] * wz
    ud = C[2, 0] * wx + C[2, 1] * wy + C[2, 2] * wz
    un, ue, ud = un - (ze * ud - zd * ue) / 3, ue - (zd * un - zn * ud) / 3, ud - (zn * ue - ze * un) / 3
    fn, fe, fd = fn - (ze * ud - zd * ue) / 2, fe - (zd * un - zn * ud) / 2, fd - (zn * ue - ze * un) / 2
    kn, ke, kd = 2 * ie_n + en_n, en_e, 2 * ie_d + en_d
    dn = fn - (ke * vd - kd * ve) * h
    de = fe - (kd * vn - kn * vd) * h
    dd = fd - (kn * ve - ke * vn) * h + g * h
    p[0] += (v[0] + dn / 2) * h / RM
    p[1] += (v[1] + de / 2) * h / (RN * cL)
    p[2] -= (v[2] + dd / 2) * h
    v[0] += dn
    v[1] += de
    v[2] += dd
    _turn_right(C, ax, ay, az, s1, s2)
    t = zn * zn + ze * ze + zd * zd
    s1, s2, s3 = _rotation_series(t)
    _turn_left(C, -zn, -ze, -zd, s1, s2)
    return fn, fe, fd


@compiled
def _rotation_series(t: float) -> tuple[float, float, float]:
    if t < 0.02:  # the next terms are below 1e-17
        s1 = 1 - t / 6 * (1 - t / 20 * (1 - t / 42 * (1 - t / 72)))
        s2 = 0.5 * (1 - t / 12 * (1 - t / 30 * (1 - t / 56 * (1 - t / 90))))
        s3 = (1 - t / 20 * (1 - t / 42 * (1 - t / 72 * (1 - t / 110)))) / 6
        return s1, s2, s3
    x = np.sqrt(t)
    s1 = np.sin(x) / x
    return s1, (1 - np.cos(x)) / t, (1 - s1) / t


@compiled
def _turn_right(C: Array, x: float, y: float, z: float, s1: float, s2: float) -> None:
    """Replace C by C exp([(x, y, z) x]): rows of C are vectors turned by minus the angle."""
    for i in range(3):
        a, b, c = C[i, 0], C[i, 1], C[i, 2]
        ux, uy, uz = b * z - c * y, c * x - a * z, a * y - b * x  # row x phi
        wx, wy, wz = uy * z - uz * y, uz * x - ux * z, ux * y - uy * x
        C[i, 0], C[i, 1], C[i, 2] = a + s1 * ux + s2 * wx, b + s1 * uy + s2 * wy, c + s1 * uz + s2 * wz


@compiled
def _turn_left(C: Array, x: float, y: float, z: float, s1: float, s2: float) -> None:
    """Replace C by exp([(x, y, z) x]) C: columns of C turned by the angle."""
    for j in range(3):
        a, b, c = C[0, j], C[1, j], C[2, j]
        ux, uy, uz = y * c - z * b, z * a - x * c, x * b - y * a
        wx, wy, wz = y * uz - z * uy, z * ux - x * uz, x * uy - y * ux
        C[0, j], C[1, j], C[2, j] = a + s1 * ux + s2 * wx, b + s1 * uy + s2 * wy, c + s1 * uz + s2 * wz


@compiled
def radii(sL: float, height: float) -> tuple[float, float]:
    """Return `earth.radii` plus the height [m], for kernels, which keep their helpers with them; sL: sine of the
    latitude.
    """
    w2 = 1 - E2 * sL * sL
    RN = SEMI_MAJOR_AXIS / np.sqrt(w2)
    return RN * (1 - E2) / w2 + height, RN + height
