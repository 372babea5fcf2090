r"""How the errors of a navigator that stays in its place grow, and what its sensors add, from interval to interval.

Errors are true minus reference, :math:`C_{true} = e^{[\phi \times]} C_b^n`, position in metres:

.. math::
    \dot\phi &= -\omega_{in} \times \phi - \delta\omega_{in} + C_b^n \, \delta\omega \\
    \delta\dot v &= -f^n \times \phi - (2 \omega_{ie} + \omega_{en}) \times \delta v
                    + v \times (2 \delta\omega_{ie} + \delta\omega_{en}) + \delta g + C_b^n \, \delta f, \qquad
    \delta\dot r = \delta v

Source: Cai et al. (2016), Eq. (17), there in east, north, up.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gimbalcal.compiled import compiled
from gimbalcal.earth import EARTH_RATE
from gimbalcal.navigate.strapdown import advance, contiguous, gravity_polynomials, radii
from gimbalcal.number import Array

NAV = 9  # attitude, velocity, position


class Transitions(NamedTuple):
    """Transitions of errors over K stretches of intervals, and the end of the reference of each.

    Transition Phi (K, 9, 9), response Psi (K, 9, p) to parameters, noise Q (K, 9, 9); C_bn (K, 3, 3), velocity (K, 3)
    [m/s] and displacement (K, 3) [m] north, east, down at the end.
    """

    Phi: Array
    Psi: Array
    Q: Array
    C_bn: Array
    velocity: Array
    displacement: Array


def transitions(
    first: Array, joined: Array, dt: Array, rate: Array, force: Array, D: Array, q: Array, C_bn: Array,
    latitude: float, height: float, gravity: float, group: Array | None = None,
) -> Transitions:  # fmt: skip
    """Return the error transitions over K stretches of intervals, each from rest at one place with attitude C_bn[k] (K,
    3, 3).

    first (K + 1,) index of the first interval of each stretch, and of the end; joined (n,): the interval continues the
    one before; dt, rate, force as in `strapdown`; D (g, 6, p): force and rate, true minus reference, per unit of each
    parameter, of g groups of intervals; group (n,): the one that each belongs to (default: each is its own); q (n, 6):
    variance of the mean force and rate of each interval, or of none where Q is not wanted; gravity at the place
    [m/s^2].
    """
    K, p = len(C_bn), D.shape[2]
    shapes = ((K, NAV, NAV), (K, NAV, p), (K, NAV, NAV), (K, 3, 3), (K, 3), (K, 3))
    out = Transitions(*(np.zeros(shape) for shape in shapes))
    place = np.array([*gravity_polynomials(latitude, height, gravity), latitude, height])
    arrays = contiguous(dt, rate, force, D, q, C_bn)
    group = np.arange(len(dt)) if group is None else group
    whole = (np.asarray(x, dtype=dtype) for x, dtype in ((first, np.int64), (joined, np.bool_), (group, np.int64)))
    _transitions(*whole, *arrays, place, *out)
    return out


@compiled
def _transitions(
    first: Array,
    joined: Array,
    group: Array,
    dt: Array,
    rate: Array,
    force: Array,
    D: Array,
    q: Array,
    start: Array,
    place: Array,
    Phi: Array,
    Psi: Array,
    Q: Array,
    C_end: Array,
    v_end: Array,
    p_end: Array,
) -> None:
    n_p = D.shape[2]
    sL, cL = np.sin(place[3]), np.cos(place[3])
    RM, RN = radii(sL, place[4])
    # at rest: Earth rate, what velocity and latitude do to the rates of the frame, and gravity over the place
    earth = EARTH_RATE * cL, -EARTH_RATE * sL, 1 / RM, 1 / RN, sL / cL / RN, place[1] / RM, place[2]
    C, mid, v, p = np.empty((3, 3)), np.empty((3, 3)), np.zeros(3), np.zeros(3)
    # over a group of intervals: M, a row for each error at its beginning and each reading; over the stretch: X
    M, X, T, x = np.zeros((NAV + 6, NAV)), np.zeros((NAV, NAV + n_p)), np.zeros((NAV, NAV + n_p)), np.zeros(NAV)
    none = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(len(start)):
        C[:] = start[k]
        v[:] = 0.0
        p[0], p[1], p[2] = place[3], 0.0, place[4]
        M[:], X[:] = 0.0, 0.0
        N = Q[k]
        for i in range(NAV):
            M[i, i] = X[i, i] = 1.0
        for j in range(first[k], first[k + 1]):
            h = dt[j]
            mid[:] = C
            f = advance(C, v, p, dt, rate, force, j, joined[j] and j > 0, place)
            for i in range(3):
                for l in range(3):
                    mid[i, l] = h * (mid[i, l] + C[i, l]) / 2
            for c in range(NAV):
                _advance_errors(M[c], none, f, h, earth)
            for c in range(6):
                _advance_errors(M[NAV + c], _contribution_of_reading(mid, c), f, h, earth)
            if len(q):
                for c in range(NAV):  # S N, then (S N) S^T
                    for i in range(NAV):
                        x[i] = N[i, c]
                    _advance_errors(x, none, f, h, earth)
                    for i in range(NAV):
                        N[i, c] = x[i]
                for c in range(NAV):
                    _advance_errors(N[c], none, f, h, earth)
                for c in range(6):  # and the noise of the six channels
                    x[:] = 0.0
                    _advance_errors(x, _contribution_of_reading(mid, c), f, h, earth)
                    for i in range(NAV):
                        for l in range(NAV):
                            N[i, l] += q[j, c] * x[i] * x[l]
            if j + 1 == first[k + 1] or group[j + 1] != group[j]:
                _pass_group(M, D[group[j]], X, T)
                M[:] = 0.0
                for i in range(NAV):
                    M[i, i] = 1.0
        for i in range(NAV):
            for c in range(NAV):
                Phi[k, i, c] = X[i, c]
            for c in range(n_p):
                Psi[k, i, c] = X[i, NAV + c]
            for c in range(i):
                N[i, c] = N[c, i] = (N[i, c] + N[c, i]) / 2
        C_end[k], v_end[k] = C, v
        p_end[k, 0], p_end[k, 1], p_end[k, 2] = (p[0] - place[3]) * RM, p[1] * RN * cL, place[4] - p[2]


@compiled
def _pass_group(M: Array, D: Array, X: Array, T: Array) -> None:
    """Carry the responses X (9, 9 + p) of a stretch over a group, in place; M (15, 9): over the group alone.

    D (6, p) of the group; T (9, 9 + p) is work space.
    """
    for i in range(NAV):
        for c in range(X.shape[1]):
            total = 0.0
            for l in range(NAV):
                total += M[l, i] * X[l, c]
            T[i, c] = total
        for c in range(D.shape[1]):
            total = 0.0
            for l in range(6):
                total += M[NAV + l, i] * D[l, c]
            T[i, NAV + c] += total
    X[:] = T


@compiled
def _contribution_of_reading(turn: Array, c: int) -> tuple[float, ...]:
    """Return what a unit of force (c < 3) or rate adds to attitude and velocity, in n; turn: C_bn times the step."""
    if c < 3:
        return 0.0, 0.0, 0.0, turn[0, c], turn[1, c], turn[2, c]
    return turn[0, c - 3], turn[1, c - 3], turn[2, c - 3], 0.0, 0.0, 0.0


@compiled
def _advance_errors(x: Array, e: tuple[float, ...], f: tuple[float, ...], h: float, earth: tuple[float, ...]) -> None:
    """Advance the navigation errors x (9,) over an interval at rest, in place, to second order.

    e (6,): angle and velocity that errors of the sensors add; f (3,): velocity that the force gained in h [s].
    F11 ... F33 of Cai et al. (2016), Eqs. (23), in north, east, down.
    """
    wn, wd, by_n, by_e, by_t, g_n, g_h = earth
    a, b, c = x[0], x[1], x[2]
    dn, dd = wd * by_n * x[6], -wn * by_n * x[6]  # the Earth's rate by latitude: Omega (-sin L, 0, -cos L)
    # -omega x phi - (transport by velocity) - (Earth rate by latitude) + sensors
    ra = h * (wd * b - by_e * x[4] - dn) + e[0]
    rb = h * (wn * c - wd * a + by_n * x[3]) + e[1]
    rc = h * (-wn * b + by_t * x[4] - dd) + e[2]
    ma, mb, mc = a + ra / 2, b + rb / 2, c + rc / 2
    va = -(f[1] * mc - f[2] * mb) + h * 2 * wd * x[4] + e[3]
    vb = -(f[2] * ma - f[0] * mc) + h * 2 * (wn * x[5] - wd * x[3]) + e[4]
    vc = -(f[0] * mb - f[1] * ma) - h * 2 * wn * x[4] + h * (g_n * x[6] - g_h * x[8]) + e[5]
    x[6] += h * (x[3] + va / 2)
    x[7] += h * (x[4] + vb / 2)
    x[8] += h * (x[5] + vc / 2)
    x[3] += va
    x[4] += vb
    x[5] += vc
    x[0] += ra
    x[1] += rb
    x[2] += rc
