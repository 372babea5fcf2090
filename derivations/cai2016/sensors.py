r"""Eqs. (1) to (12): what the sensors read, and the same solved for rate and force.

(1), (4) and the arms of Section 2.3 are the model; (2), (3), (5), (6), (12) are solutions of it, "ignoring the high
order terms". Each is derived exactly and compared: bias, noise, g-sensitivity, angles and products of forces count as
small, and so does the error of a measured force in one of those terms. What is compared is the *correction*, the
solution less K N, so that a wrong sign in it is one of first order and no approximation.

With m from the gyroscope axes by the stated rotations, C_m^g has the axes as rows and w^m = (C_m^g)^-1 w^g.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import sympy as sp

from derivations.cai2016.symbols import (
    ALPHA,
    GAMMA,
    G_matrix,
    K_a,
    K_a2,
    K_cross,
    K_g,
    N_a,
    N_g,
    T_a,
    T_g,
    accelerometer_axes,
    b_a,
    b_g,
    centripetal,
    crossed,
    f,
    gyro_axes,
    omega,
    omega_t,
    r,
    size_effect,
    squared,
    triad,
    v_a,
    v_g,
)
from derivations.verdict import ARCSEC, Case, Printed, truncate

e_f = triad("e_f")  # error of a measured force
f_before, f_first = triad("f_n1_"), triad("f_0_")  # (8): f_(n-1) and f_(0)
column = sp.Matrix
SMALL_GYRO = (*b_g, *v_g, *G_matrix, *GAMMA, *e_f)
SMALL_ACC = (*b_a, *v_a, *K_a2, *K_cross, *ALPHA, *e_f)
f_t = [true + error for true, error in zip(f, e_f, strict=True)]
GRAVITY, TURN = 9.8, 0.0872664626  # m/s^2; 5 deg/s in rad/s
# Section 4.1, forces in g: what a size is quoted for
AT: dict[Any, float] = {
    **dict.fromkeys((*K_g, *K_a), 1.0), **dict.fromkeys((*N_g, *omega, *omega_t), TURN),
    **dict.fromkeys((*N_a, *f, *f_first), 1.0), **dict.fromkeys(f_before, 1 - 9e-4),
    **dict.fromkeys((*b_a, *e_f), 3e-4),
    **dict.fromkeys(b_g, 2.4e-7), **dict.fromkeys((*v_g, *v_a), 0.0), **dict.fromkeys(G_matrix, 4.8e-9),
    **dict.fromkeys((*K_a2, *K_cross), 3e-4), **dict.fromkeys((*GAMMA, *ALPHA), 180 * ARCSEC),
    **dict.fromkeys(r, 0.02 / GRAVITY),
}  # fmt: skip


def _diag(scale: Any, counts: Any) -> Any:
    return column([k * n for k, n in zip(scale, counts, strict=True)])


def rate(T: Any, of: Any) -> Any:
    """Return w^m - K_g N_g with the axes T and a force in the g-sensitivity."""
    return (T - sp.eye(3)) * _diag(K_g, N_g) - column(b_g) - column(v_g) - G_matrix * column(of)


def force(T: Any, of: Any) -> Any:
    """Return f^m - K_a N_a with the axes T and a force in the products."""
    linear = (T - sp.eye(3)) * _diag(K_a, N_a) - column(b_a) - column(v_a)
    return linear - squared(of) * column(K_a2) - crossed(of) * column(K_cross)


@cache
def exact_rate() -> Any:
    """Return w^m - K_g N_g from (1): the axes inverted; bias, noise and G counted in m, as (3) does. Through second
    order.
    """
    return rate(truncate(gyro_axes(), GAMMA, 2).inv().applyfunc(lambda x: truncate(x, GAMMA, 2)), f)


@cache
def exact_force() -> Any:
    """Return f^m - K_a N_a from (4) likewise, the products taken of the true force."""
    C = truncate(accelerometer_axes(), ALPHA, 2) - sp.eye(3)
    T = truncate(sp.eye(3) - C + C * C, ALPHA, 2)  # the inverse through second order
    return force(T, f)


@cache
def printed_size() -> Any:
    """Return (3, 3) below (12)."""
    x, y, z = omega_t
    return sp.Matrix([[0, y**2, z**2], [x**2, 0, z**2], [x**2, y**2, 0]])


def _one(*terms: Any) -> Any:
    """Return the correction of one sensor."""
    return sp.Matrix([-sum(terms)])


K_xx, K_xy, K_xz = K_a2[0], K_cross[0], K_cross[1]
PRINTED = {
    p.item: p
    for p in (
        Printed("Eq. (1)", "K_gx N_gx = w_x + b_gx + v_gx + G_xx f_x + G_xy f_y + G_xz f_z", sp.Integer(0)),
        Printed(
            "Eq. (2)",
            "w~_x = K_gx N_gx - b_gx - v_gx - G_xx f~_x - G_xy f~_y - G_xz f~_z",
            _one(b_g[0], v_g[0], *(g * x for g, x in zip(G_matrix[:3], f_t, strict=True))),
        ),
        Printed("Eq. (3)", "w~^m = T_g^m K_g N_g - b_g^m - v_g^m - G f~^m, T_g^m triangular", rate(T_g(), f_t)),
        Printed(
            "Eq. (4)", "K_ax N_ax = f_x + b_ax + v_ax + K_axx f_x^2 + K_axy f_x f_y + K_axz f_x f_z", sp.Integer(0)
        ),
        Printed(
            "Eq. (5)",
            "f~_x = K_ax N_ax - b_ax - v_ax - K_axx f~_x^2 - K_axy f~_x f~_y - K_axz f~_x f~_z",
            _one(b_a[0], v_a[0], K_xx * f_t[0] ** 2, K_xy * f_t[0] * f_t[1],
                         K_xz * f_t[0] * f_t[2]),
        ),
        Printed(
            "Eq. (6)", "f~^m = T_a^m K_a N_a - b_a^m - v_a^m - K_a2 f~^m(2) - K_cross f~^m(cross)", force(T_a(), f_t),
        ),
        Printed("Eq. (7)", "f~_(0)^m = T_a^m K_a N_a - b_a^m", T_a() * _diag(K_a, N_a) - column(b_a)),
        Printed(
            "Eq. (8)",
            "f~_(n) = f~_(n-1) - K_a2 f~_(n-1)^(2) - K_cross f~_(n-1)^(cross)",
            column(f_before) - squared(f_before) * column(K_a2) - crossed(f_before) * column(K_cross),
        ),
        Printed("Eq. (9)", "a_x = -(w_y^2 + w_z^2) r_x", column([-(omega[1] ** 2 + omega[2] ** 2) * r[0]])),
        Printed("Eq. (10)", "a_y = -(w_x^2 + w_z^2) r_y", column([-(omega[0] ** 2 + omega[2] ** 2) * r[1]])),
        Printed("Eq. (11)", "a_z = -(w_x^2 + w_y^2) r_z", column([-(omega[0] ** 2 + omega[1] ** 2) * r[2]])),
        Printed(
            "Eq. (12)",
            "f~^m = ... - w~^m(size) r, w~^m(size) = [[0, w_y^2, w_z^2], [w_x^2, 0, w_z^2], [w_x^2, w_y^2, 0]]",
            force(T_a(), f) - printed_size() * column(r),
            carried="(19) has the same sign",
        ),
    )
}  # fmt: skip


def iterations(printed: bool, n: int, read: float = 1.0, K: float = 3e-4) -> float:
    """Return the force after n rounds of (8) for a single accelerometer that reads f + K f^2 = `read`, in g."""
    first = now = read
    for _ in range(n):
        now = (now if printed else first) - K * now**2
    return now


def left_over(printed: bool, n: int) -> float:
    """Return what f + K f^2 still misses after n rounds, in g: 300 ug/g^2 at one g."""
    now = iterations(printed, n)
    return abs(now + 3e-4 * now**2 - 1.0)


@cache
def cases() -> dict[str, Case]:
    """Return the derived forms of the items."""
    second = (
        "Solved for the true {of}. The measured force stands for the true one in small terms{axes}: {{size}}.{more}"
    )
    axes = ", and the triangle for the inverse of the axes"
    accelerations = centripetal(omega, r)
    twice = (left_over(True, 2), left_over(True, 10), left_over(False, 3))
    arms = "w x (w x r) along the arm, which lies on the sensor's own axis: w' x r has no part there."
    return {
        "Eq. (1)": Case(None, "The model of a gyroscope. The package's gyro_bias and gyro_g_sensitivity_rate have "
                        "these signs: they are added to the reading."),
        "Eq. (2)": Case(
            _one(b_g[0], v_g[0], *(G_matrix[0, :] * column(f))),
            second.format(of="rate", axes="", more=" A computer has no noise to subtract; v stays in the result."),
            small=SMALL_GYRO, at=AT,
        ),
        "Eq. (3)": Case(
            exact_rate(),
            second.format(of="rate", axes=axes, more=" Each gamma turns an input axis into its axis of m, so it is "
                          "minus the beta of the package's gyro_misalignment."),
            small=SMALL_GYRO, at=AT,
        ),
        "Eq. (4)": Case(None, "The model of an accelerometer. The package's bias, quadratic_nonlinearity and "
                        "cross_coupling have these signs."),
        "Eq. (5)": Case(
            _one(b_a[0], v_a[0], K_xx * f[0] ** 2, K_xy * f[0] * f[1], K_xz * f[0] * f[2]),
            second.format(of="force", axes="", more=""), small=SMALL_ACC, at=AT, unit="ug",
        ),
        "Eq. (6)": Case(
            exact_force(),
            second.format(of="force", axes=axes, more=" Squares and products are rows in print; they are columns."),
            small=SMALL_ACC, at=AT, unit="ug",
        ),
        "Eq. (7)": Case(None, "Where the iteration starts: (6) without its products."),
        "Eq. (8)": Case(
            column(f_first) - squared(f_before) * column(K_a2) - crossed(f_before) * column(K_cross),
            "(6) is solved by putting the last force into its products and subtracting them from f_(0). As printed "
            "they are subtracted from the last force, again in every round: what (6) misses is {two:.0f} ug after two "
            "rounds and {ten:.0f} ug after ten at 300 ug/g^2 and 1 g; as derived {good:.1g} g are left after three.",
            repairs=(("f_(0) instead of the first f_(n-1)", _from_the_first),), at=AT, unit="ug",
            facts={"two": twice[0] * 1e6, "ten": twice[1] * 1e6, "good": twice[2]},
        ),
        "Eq. (9)": Case(column([accelerations[0]]).subs({r[1]: 0, r[2]: 0}).applyfunc(sp.expand), arms),
        "Eq. (10)": Case(column([accelerations[1]]).subs({r[0]: 0, r[2]: 0}).applyfunc(sp.expand), arms),
        "Eq. (11)": Case(column([accelerations[2]]).subs({r[0]: 0, r[1]: 0}).applyfunc(sp.expand), arms),
        "Eq. (12)": Case(
            force(T_a(), f) - size_effect(omega_t) * column(r),
            "(9) to (11) are added to the readings, so (12) must take them off: + diag(w_y^2 + w_z^2, ...) r. In print "
            "the sign is reversed and the squares multiply the arms of the other two accelerometers; F29 has the right "
            "matrix.",
            at=AT, unit="ug",
        ),
    }  # fmt: skip


def _from_the_first(printed: Any) -> Any:
    """Return (8) with f_(0) in place of the force that is corrected."""
    return printed - column(f_before) + column(f_first)
