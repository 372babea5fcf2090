r"""Eqs. (17) to (22): errors of navigation and of the sensors, and the 51 states.

(17) is compared with the equations of `derivations.mechanisation`. (18), (19) are the first order of (3), (12) when
coefficients, rates and forces are counted computed minus true, as the navigation states are in (27). The counts are
near the rates and forces themselves: scale factors and angles are errors of T K, whose nominal is the identity.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import sympy as sp

from derivations import mechanisation as nav
from derivations.cai2016.sensors import AT, column, e_f
from derivations.cai2016.symbols import (
    ALPHA,
    AXES,
    G_matrix,
    accelerometer_axes,
    b_g,
    crossed,
    f,
    omega,
    size_effect,
    squared,
    triad,
)
from derivations.verdict import Case, Printed
from derivations.wang2019.navigation import R_M, R_N, V, earth_rate, h, transport_rate
from derivations.wang2019.navigation import e as step
from derivations.wang2019.symbols import L

dK_G = sp.Matrix(3, 3, lambda i, j: sp.Symbol(f"dK_G{AXES[i]}{AXES[j]}", real=True) if i >= j else 0)
dK_A = sp.Matrix(3, 3, lambda i, j: sp.Symbol(f"dK_A{AXES[i]}{AXES[j]}", real=True))
db_g, db_a, dK_a2, dr = (triad(n) for n in ("db_g", "db_a", "dK_a2", "dr_"))
dG = sp.Matrix(3, 3, sp.symbols([f"dG_{i}{j}" for i in AXES for j in AXES], real=True))
dK_cross = sp.symbols("dK_axy dK_axz dK_ayx dK_ayz dK_azx dK_azy", real=True)
ERRORS = (*[s for s in dK_G if s], *db_g, *dG, *dK_A, *db_a, *dK_a2, *dK_cross, *dr)
da_scale = triad("dK_a")
dALPHA = sp.symbols([f"d{a}" for a in ALPHA], real=True)
d_xz, d_xy, d_yz, d_yx, d_zy, d_zx = dALPHA
M_g = sp.Matrix(3, 3, sp.symbols("M_:3:3", real=True))  # T K less the identity: what has been found so far
NOMINAL_GYRO = (*[s for s in dK_G if s], *db_g, *dG, *M_g, *b_g, *G_matrix, *e_f)

_SMALL: dict[Any, float] = {
    **dict.fromkeys((*[s for s in dK_G if s], *dK_A), 3e-4), **dict.fromkeys(db_g, 2.4e-7),
    **dict.fromkeys(dG, 4.8e-9), **dict.fromkeys(db_a, 2e-4), **dict.fromkeys((*dK_a2, *dK_cross), 3e-4),
    **dict.fromkeys(dr, 0.02 / 9.8), **dict.fromkeys(M_g, 3e-4),
}  # fmt: skip
SIZES = {**AT, **_SMALL}


@cache
def rate_error() -> Any:
    """Return dw^m: (3) with what the computer has, on the counts that (1) makes, less the true rate."""
    true_f, f_error = column(f), column(e_f)
    counts = (sp.eye(3) - M_g) * (column(omega) + column(b_g) + G_matrix * true_f)  # 1 - M inverts 1 + M to first order
    computed = (sp.eye(3) + M_g + dK_G) * counts - column(b_g) - column(db_g)
    computed -= (G_matrix + dG) * (true_f + f_error)
    true = computed.subs(dict.fromkeys((*[s for s in dK_G if s], *db_g, *dG, *e_f), 0))
    return (computed - true).applyfunc(sp.expand)


@cache
def force_error() -> Any:
    """Return df^m through first order: (12) as derived, with what the computer has, less the true force."""
    of = step * column(db_a) + step * squared(f) * column(dK_a2) + step * crossed(f) * column(dK_cross)
    computed = (sp.eye(3) + step * dK_A) * column(f) - of - size_effect(omega) * step * column(dr)
    return computed.diff(step).subs(step, 0)


@cache
def block_of_scale() -> Any:
    """Return the first order of T K about the identity, T the inverse of the axes of (4) turned by small angles."""
    turned = dict(zip(ALPHA, (step * a for a in dALPHA), strict=True))
    axes = accelerometer_axes().subs(turned, simultaneous=True)
    K = sp.eye(3) + step * sp.diag(*da_scale)
    return (K.diff(step) - axes.diff(step)).subs(step, 0)  # of the inverse of a matrix near the identity


def _navigation(gravity_sign: int) -> Any:
    """Return (17) as printed, three equations under one another."""
    phi, dV, f_n = sp.Matrix(nav.PHI), sp.Matrix(nav.DV), sp.Matrix(nav.F_N)
    w_ie, w_en, V_ = earth_rate(), transport_rate(h), sp.Matrix(V)
    moved = dict(zip((*V, *nav.POSITION), (*nav.DV, *nav.DP), strict=True))
    dw_ie, dw_en = (sum((w.diff(s) * d for s, d in moved.items()), sp.zeros(3, 1)) for w in (w_ie, w_en))
    attitude = phi.cross(w_ie + w_en) + dw_ie + dw_en - sp.Matrix(nav.DW)
    velocity = (
        f_n.cross(phi) - (2 * w_ie + w_en).cross(dV) + V_.cross(2 * dw_ie + dw_en) + sp.Matrix(nav.DF)
        + gravity_sign * sp.Matrix(nav.DG)
    )  # fmt: skip
    dL, _, dh = nav.DP
    ground = sp.Matrix([
        nav.DV[1] / (R_M + h) - V[1] * dh / (R_M + h) ** 2,
        nav.DV[0] / ((R_N + h) * sp.cos(L)) + V[0] * sp.sin(L) * dL / ((R_N + h) * sp.cos(L) ** 2)
        - V[0] * dh / ((R_N + h) ** 2 * sp.cos(L)),
        nav.DV[2],
    ])  # fmt: skip
    return attitude.col_join(velocity).col_join(ground)


def _derived_navigation() -> Any:
    """Return the same from the mechanisation; gravity's error counted as the paper's -dg: true minus computed."""
    minus = dict(zip(nav.DG, (-g for g in nav.DG), strict=True))
    return (
        nav.attitude_rate().col_join(nav.velocity_rate().subs(minus, simultaneous=True)).col_join(nav.position_rate())
    )


PRINTED = {
    p.item: p
    for p in (
        Printed(
            "Eq. (17)",
            "phi_dot = phi x w_in + dw_in - C dw_ib; dV_dot = f x phi - (2 w_ie + w_en) x dv + V x (2 dw_ie + dw_en) "
            "+ C df - dg; L_dot, lambda_dot, h_dot",
            _navigation(-1),
        ),
        Printed("Eq. (18)", "dw^m = dK_G w~^m - db_g^m - dG f~^m",
                dK_G * column(omega) - column(db_g) - dG * column(f)),
        Printed(
            "Eq. (19)",
            "df^m = dK_A f~^m - db_a^m - dK_a2 f~^m(2) - dK_cross f~^m(cross) - w~^m(size) dr",
            dK_A * column(f) - column(db_a) - squared(f) * column(dK_a2) - crossed(f) * column(dK_cross)
            - sp.Matrix([[0, omega[1] ** 2, omega[2] ** 2], [omega[0] ** 2, 0, omega[2] ** 2],
                         [omega[0] ** 2, omega[1] ** 2, 0]]) * column(dr),
            carried="(12) has the same form",
        ),
        Printed(
            "Eq. (20)",
            "dK_A = dT_a^m dK_a = [[dK_ax, dalpha_xz, -dalpha_xy], [-dalpha_yz, dK_ay, dalpha_yx], [dalpha_zy, "
            "-dalpha_zx, dK_az]]",
            sp.Matrix([[da_scale[0], d_xz, -d_xy], [-d_yz, da_scale[1], d_yx], [d_zy, -d_zx, da_scale[2]]]),
            garbled="a minus sign reads as an acute accent",
        ),
        Printed("Eq. (21)", "dK_G, dK_A, db_a, db_g, dG, dK_a2, dK_cross, dr do not change", sp.Integer(0)),
        Printed(
            "Eq. (22)",
            "X_51 = [phi, dV, dP, X_KG, db_g, X_KA, db_a, X_G, X_Ka2, X_Kcross, dr]",
            sp.Integer(51),
        ),
    )
}  # fmt: skip


def number_of_states() -> int:
    """Return nine of navigation and every coefficient of (3) and (12), six of the gyroscopes' nine T K being free."""
    return 9 + len(set(ERRORS))


@cache
def cases() -> dict[str, Case]:
    """Return the derived forms of the items."""
    return {
        "Eq. (17)": Case(
            _derived_navigation(),
            "Nine equations, with the radii and gravity held; the sign of dg makes it true minus computed, while "
            "everything else in (27) is computed minus true. F leaves dg out.",
        ),
        "Eq. (18)": Case(
            rate_error(),
            "First order of (3), coefficients counted computed minus true; products of two errors are dropped, {size} "
            "rad/s at the errors of Section 4.1 and 5 deg/s. F14 has db_g with the other sign.",
            small=NOMINAL_GYRO, at=SIZES,
        ),
        "Eq. (19)": Case(
            force_error(),
            "As (12): the arms with reversed sign, each squared rate at the arms of the other two accelerometers. At "
            "5 deg/s and 2 cm that is {size}; F29 has the right form, so (19) is not what the filter has.",
            at=SIZES, unit="ug",
        ),
        "Eq. (20)": Case(
            block_of_scale(),
            "First order of the product T K about the identity, signs included: d stands before the product, for dT dK "
            "would be second order. dK_G likewise, with dgamma in the lower triangle only; F14 has it so.",
        ),
        "Eq. (21)": Case(None, "What is called a constant. A vector of three has 1 x 3 zeros in print."),
        "Eq. (22)": Case(
            sp.Integer(number_of_states()),
            "Nine of navigation, and of the sensors 6 + 3 + 9 (gyroscopes: T K, bias, g-sensitivity) and 9 + 3 + 3 + 6 "
            "+ 3 (accelerometers: T K, bias, squares, products, arms). It stands as a row and is a column.",
        ),
    }  # fmt: skip
