r"""Eqs. (23) to (27): the 51-state filter, block by block of F.

The blocks of navigation are derivatives of the mechanisation with radii and gravity held (`derivations.mechanisation`,
where they are checked again in numbers on WGS-84). Those of the sensors are derivatives of C times (18), (19) as
derived: the paper says that F follows "by the above Equations (17)-(19)".

A state's sign is a convention, but one filter has one: `feedback` finds the sign with which each state, as F has it,
must be fed back so that what the computer uses moves towards the truth.
"""

from __future__ import annotations

from functools import cache
from math import pi
from typing import Any

import numpy as np
import sympy as sp

from derivations import mechanisation as nav
from derivations.cai2016 import error_model as model
from derivations.cai2016.sensors import e_f
from derivations.cai2016.symbols import G_matrix, b_g, crossed, f, omega, squared, triad
from derivations.cross import cross
from derivations.verdict import AGREES, Case, Printed
from derivations.wang2019.navigation import R_M, R_N, V, e, h
from derivations.wang2019.symbols import L, omega_ie

C = sp.Matrix(3, 3, sp.symbols("c_:3:3", real=True))
V_E, V_N, V_U = V
s, c, t = sp.sin(L), sp.cos(L), sp.sin(L) / sp.cos(L)
RM, RN = R_M + h, R_N + h
X_KG = [model.dK_G[i, j] for j in range(3) for i in range(j, 3)]  # column by column, as F14 has them
X_KA = [model.dK_A[i, j] for j in range(3) for i in range(3)]
u_g, u_a = triad("u_g"), triad("u_a")
AT_SEA: dict[Any, float] = {  # what sizes are quoted for: 10 m/s north-east, 30 deg north
    V_E: 10.0, V_N: 10.0, V_U: 0.0, L: pi / 6, h: 0.0, R_M: 6351377.0, R_N: 6383480.0, omega_ie: nav.OMEGA,
    **dict.fromkeys(f, 1.0), **dict.fromkeys(omega, 0.0873), **dict.fromkeys(C, 0.0),
    **{C[i, i]: 1.0 for i in range(3)}, **dict(zip(nav.F_N, (0.0, 0.0, 9.8), strict=True)),
}  # fmt: skip


def _cross_rows(force: Any) -> Any:
    """Return (3, 9) a force once in each row: what multiplies G_xx, G_xy ... G_zz."""
    return sp.Matrix(3, 9, lambda i, j: force[j - 3 * i] if 0 <= j - 3 * i < 3 else 0)


def _squares() -> Any:
    x, y, z = (w**2 for w in omega)
    return sp.diag(y + z, x + z, x + y)


def _scale_columns(size: int) -> list[Any]:
    """Return columns of C (omega_j) e_i for the free elements of T K, as F14 prints them."""
    return [C[:, i] * omega[j] for j in range(3) for i in range(j, size)]


ONE_U = omega_ie * s + V_E * t / RN
ONE_N = omega_ie * c + V_E / RN
F11 = sp.Matrix([[0, ONE_U, -ONE_N], [-ONE_U, 0, -V_N / RM], [ONE_N, V_N / RM, 0]])
F12 = sp.Matrix([[0, -1 / RM, 0], [1 / RN, 0, 0], [t / RN, 0, 0]])
F13 = sp.Matrix([
    [0, 0, V_N / RM**2], [omega_ie * s, 0, -V_E / RN**2], [omega_ie * c + V_E / c**2 / RN, 0, -V_E * t / RN**2],
])  # fmt: skip
F21 = sp.Matrix([[0, -nav.F_N[2], nav.F_N[1]], [nav.F_N[2], 0, -nav.F_N[0]], [-nav.F_N[1], nav.F_N[0], 0]])
TWO_U = 2 * omega_ie * s + V_E * t / RN
F22 = sp.Matrix([
    [(V_N * t - V_U) / RN, TWO_U, -(2 * omega_ie * c + V_E / RN)],
    [-TWO_U, -V_U / RM, -V_N / RM],
    [2 * (omega_ie * c + V_E / RN), 2 * V_N / RM, 0],
])  # fmt: skip
F23 = sp.Matrix([
    [2 * omega_ie * (V_U * s + V_N * c) + V_E * V_N / RN / c**2, 0, (V_E * V_U - V_E * V_N * t) / RN**2],
    [-(2 * V_E * omega_ie * c + V_E**2 / RN / c**2), 0, V_N * V_U / RM**2 + V_E**2 * t / RN**2],
    [-2 * V_E * omega_ie * s, 0, -(V_N**2) / RM**2 + V_E**2 / RN**2],
])  # fmt: skip
F32 = sp.Matrix([[0, 1 / RM, 0], [1 / c / RM, 0, 0], [0, 0, 1]])
F33 = sp.Matrix([[0, 0, -V_N / RM**2], [V_E * t / c / RN, 0, -V_E / c / RN**2], [0, 0, 0]])
F14 = -sp.Matrix.hstack(*_scale_columns(3), C)
F16 = C * _cross_rows(f)
F25 = sp.Matrix.hstack(*(C * x for x in f), C)
F27, F28, F29 = C * squared(f), C * crossed(f), C * _squares()

BLOCKS = {"F11": F11, "F12": F12, "F13": F13, "F21": F21, "F22": F22, "F23": F23, "F32": F32, "F33": F33}
SENSORS = {"F14": F14, "F16": F16, "F25": F25, "F27": F27, "F28": F28, "F29": F29}
WIDTHS = (3, 3, 3, 9, 12, 9, 3, 6, 3)  # of F's columns as printed
GROUPS = ("K_G", "b_g", "G", "K_A", "b_a", "K_a2", "K_cross")  # that (27) feeds back
WITH_27 = "(27) feeds it back with the same sign"


@cache
def derived_sensors() -> dict[str, Any]:
    """Return the sensor blocks from (18), (19) as derived; first order, the counts standing for rate and force."""
    at_truth = dict.fromkeys((*model.M_g, *b_g, *G_matrix, *e_f), 0)
    rate, force = -C * model.rate_error().subs(at_truth), C * model.force_error()

    def by(of: Any, *states: Any) -> Any:
        return of.jacobian(sp.Matrix(states)).subs(dict.fromkeys(model.ERRORS, 0)).applyfunc(sp.expand)

    return {
        "F14": by(rate, *X_KG, *model.db_g),
        "F16": by(rate, *model.dG),
        "F25": by(force, *X_KA, *model.db_a),
        "F27": by(force, *model.dK_a2),
        "F28": by(force, *model.dK_cross),
        "F29": by(force, *model.dr),
    }


def feedback(blocks: dict[str, Any]) -> Any:
    """Return (7,) sign with which each state of `GROUPS` must be added to what the computer uses, given F's own signs.

    (18), (19) count computed minus true, so where F's column has their sign the truth is the computed value minus the
    state, and plus it where F's column has the other.
    """
    derived = derived_sensors()
    columns = {"K_G": ("F14", 0), "b_g": ("F14", 6), "G": ("F16", 0), "K_A": ("F25", 0), "b_a": ("F25", 9),
               "K_a2": ("F27", 0), "K_cross": ("F28", 0)}  # fmt: skip
    signs = []
    for name in GROUPS:
        block, j = columns[name]
        same = blocks[block][:, j] == derived[block][:, j]
        signs.append(-1 if same else 1)
    return sp.Matrix(signs)


def left_out() -> dict[str, float]:
    """Return entries of the full linearisation on WGS-84 that F does not have, at rest at 30 deg: value in SI by
    place.
    """
    at, force = [0, 0, 0, pi / 6, 0, 0], [0, 0, float(nav.gravity(pi / 6, 0.0))]
    extra = (nav.linearised(at, force, held=False) - nav.linearised(at, force))[:, :9]
    names = ("phi_E", "phi_N", "phi_U", "V_E", "V_N", "V_U", "L", "lambda", "h")
    return {
        f"{names[i]} by {names[j]}": float(extra[i, j]) for i, j in zip(*np.nonzero(abs(extra) > 1e-15), strict=True)
    }


def numerically(at: Any, force: Any) -> float:
    """Return the largest relative difference between the derived blocks and complex steps of the mechanisation, radii
    held.
    """
    R = nav.radii(at[3])
    values = dict(zip((*V, *nav.POSITION, *nav.F_N, R_M, R_N, omega_ie), (*at, *force, *R, nav.OMEGA), strict=True))
    F = nav.linearised(at, force)
    worst = 0.0
    for name, block in nav.blocks().items():
        i, j = 3 * int(name[1]) - 3, 3 * int(name[2]) - 3
        ours, wanted = np.array(block.subs(values).evalf(), float), F[i : i + 3, j : j + 3]
        size = np.where(wanted == 0, max(abs(wanted).max(), 1e-30), abs(wanted))
        worst = max(worst, float((abs(ours - wanted) / size).max()))
    return worst


def _print(name: str, scan: str, F: Any, carried: str = "") -> Printed:
    return Printed(f"Eq. (23), {name}", scan, F, carried=carried)


PRINTED = {
    p.item: p
    for p in (
        Printed("Eq. (23)", "X_dot = F X + G u, F of 3 + 3 + 3 + 9 + 12 + 9 + 3 + 6 + 3 columns", sp.Matrix(WIDTHS)),
        _print("F11", "0, w_ie sin L + V_E/(R_N+h) tan L, -(w_ie cos L + V_E/(R_N+h)); ...", F11),
        _print("F12", "-1/(R_M+h); 1/(R_N+h); tan L/(R_N+h)", F12),
        _print("F13", "V_N/(R_M+h)^2; w_ie sin L, -V_E/(R_N+h)^2; w_ie cos L + V_E sec^2 L/(R_N+h), ...", F13),
        _print("F14", "-C [w_x I_3, [0; I_2] w_y, [0; 0; 1] w_z, I_3]", F14, WITH_27),
        _print("F16", "C diag(f^T, f^T, f^T)", F16),
        _print("F21", "0, -f_U, f_N; f_U, 0, -f_E; -f_N, f_E, 0", F21),
        _print("F22", "...; -(2 w_ie sin L + V_E/(R_N+h) tan L), -V_U/(R_M+h), -V_N/(R_M+h); ...", F22),
        _print("F23", "...; -2 V_E w_ie sin L, 0, -V_N^2/(R_M+h)^2 + V_E^2/(R_N+h)^2", F23),
        _print("F25", "C [f_x I_3, f_y I_3, f_z I_3, I_3]", F25, WITH_27),
        _print("F27", "C diag(f_x^2, f_y^2, f_z^2)", F27, WITH_27),
        _print("F28", "C [f_x f_y, f_x f_z, 0 ...; ...]", F28, WITH_27),
        _print("F29", "C diag(w_y^2 + w_z^2, w_x^2 + w_z^2, w_x^2 + w_y^2)", F29),
        _print("F32", "1/(R_M+h); sec L/(R_M+h); 1", F32),
        _print("F33", "-V_N/(R_M+h)^2; V_E tan L sec L/(R_N+h), -V_E sec L/(R_N+h)^2", F33),
        Printed("Eq. (24)", "G = [-C, 0; 0, C; 0_45x3, 0_45x3]",
                sp.diag(-C, C).col_join(sp.zeros(45, 6))),
        Printed("Eq. (25)", "Z = V~^n - V_obv = H X + v", sp.Matrix(nav.DV)),
        Printed("Eq. (26)", "H = [0_3x3, I_3, 0_3x45]", sp.Matrix.hstack(sp.zeros(3), sp.eye(3), sp.zeros(3, 45))),
        Printed(
            "Eq. (27)",
            "K_G = K_G~ + dK_G, b_g = b_g~ + db_g, G = G~ + dG, K_A = K_A~ + dK_A, b_a = b_a~ + db_a, K_a2 = K_a2~ + "
            "dK_a2, K_cross = K_cross~ + dK_cross",
            sp.Matrix([1] * 7),
        ),
        Printed(
            "Eq. (27), navigation", "C = (I + [phi x]) C~, V = V~ - dV, L = L~ - dL, lambda = lambda~ - dlambda, h = "
            "h~ - dh", sp.Matrix([1, -1, -1, -1, -1]),
        ),
    )
}  # fmt: skip


def fed_back_navigation() -> Any:
    """Return (5,) signs: D = 1 - [phi x] is undone by 1 + [phi x] to first order; the others are computed minus
    true.
    """
    D = sp.eye(3) - e * cross(nav.PHI)
    for sign in (1, -1):
        if ((sp.eye(3) + sign * e * cross(nav.PHI)) * D).diff(e).subs(e, 0) == sp.zeros(3):
            return sp.Matrix([sign, -1, -1, -1, -1])
    raise ArithmeticError("no sign undoes the attitude error")


def _bias_column(name: str) -> str:
    return (
        f"The column of {name} has the sign of (27), where the truth is the computed value plus the state, not of the "
        "equation it is said to follow from. The others of this block have that equation's sign."
    )


def _reading(name: str) -> tuple[str, Any, str] | None:
    """Return the sign with which some constants are counted in a block; where the paper contradicts it is (27)."""
    states = {"F14": "db_g", "F25": "db_a", "F27": "dK_a2", "F28": "dK_cross"}.get(name)
    if states is None:
        return None
    last = 3 if name in ("F14", "F25") else 0

    def counted(derived: Any) -> Any:
        n = derived.cols
        signs = [-1 if not last or j >= n - last else 1 for j in range(n)]
        return derived * sp.diag(*signs)

    return f"that {states} counts true minus computed here, which is held against (27) and not again", counted, AGREES


@cache
def cases() -> dict[str, Case]:
    """Return the derived forms of the items."""
    if numerically([70.0, -40.0, 5.0, 0.6, 1.1, 300.0], [0.4, -0.7, 9.7]) > 1e-12:
        raise ArithmeticError("the derived blocks and complex steps of the mechanisation differ")
    derived, extra = nav.blocks() | derived_sensors(), left_out()
    at_sea = "A slip in one entry: {slip}. {size} at 10 m/s at 30 deg."
    words = {
        "F11": "-[w_in x].", "F12": "Derivatives of the transport rate.",
        "F13": "The Earth's rate north, w_ie cos L, falls with latitude: the entry is -w_ie sin L. {size} rad/s per "
               "rad of latitude, at rest as well.",
        "F21": "[f x].",
        "F22": f"{at_sea} At rest nothing is left of the slip.",
        "F23": f"{at_sea} Both centripetal terms fall with height; at rest nothing is left of the slip. Gravity is "
               "held: its fall with height, {vertical:.1e} 1/s^2 (last entry), and with latitude, {along:.2g} m/s^2 "
               "per rad, are left out with dg, which measured velocities forgive.",
        "F32": "Longitude turns with the radius of the prime vertical, as (17) has it: {slip}. {size} 1/m.",
        "F33": "Derivatives of the last three of (17).",
        "F14": _bias_column("db_g"), "F25": _bias_column("db_a"),
        "F16": "-C times -G's part of (18).",
        "F27": "Sign of (27), not of (19): the truth is the computed value plus the state.",
        "F28": "Sign of (27), not of (19): the truth is the computed value plus the state. Its products are right.",
        "F29": "By (9) to (11), with dr computed minus true. It contradicts the sign and the matrix of (12), (19).",
    }  # fmt: skip
    facts = {"vertical": extra["V_U by h"], "along": extra["V_U by L"]}
    radii = ((R_M, R_N),)
    out = {
        "Eq. (23)": Case(
            sp.Matrix([3, 3, 3, len(X_KG) + 3, len(X_KA) + 3, len(model.dG), 3, len(model.dK_cross), 3]),
            "Widths of the blocks in the order of (22): 51 columns; 51 rows by 3 + 3 + 3 + 9 + 33.",
        )
    }
    for name in (*BLOCKS, *SENSORS):
        sized = name in ("F22", "F23")
        out[f"Eq. (23), {name}"] = Case(
            derived[name], words[name], at=AT_SEA if name in BLOCKS else None, symbols=radii,
            factors=(sp.Integer(2),), facts=facts,
            sweep=({}, {V_E: 10.0}) if sized else ({},), reading=_reading(name),
        )  # fmt: skip
    order = ["Eq. (23)", *sorted(k for k in out if "," in k)]
    out = {k: out[k] for k in order}
    needed = feedback(SENSORS)
    out |= {
        "Eq. (24)": Case(
            sp.diag(-C, C).col_join(sp.zeros(51 - 6, 6)),
            "Noise is added to the readings by (1), (4), so to the computed rate and force; -C, C as with (17).",
        ),
        "Eq. (25)": Case(None, "Velocity as computed less that observed, for a unit that stays where it is. Off the "
                         "table's axes it does not: l away it has the velocity w x l, 1.7 mm/s at 5 deg/s and 2 cm."),
        "Eq. (26)": Case(
            sp.Matrix(nav.DV).jacobian(sp.Matrix([*nav.PHI, *nav.DV, *nav.DP, *sp.symbols("x_10:52")])),
            "Derivative of (25) by the 51 states.",
        ),
        "Eq. (27)": Case(
            needed,
            "With F's own signs the truth is computed {signs}. As printed, what the filter finds of K_G, G and K_A is "
            "added where it must be taken off, so the next round has twice the error; with (18), (19) all seven would "
            "be minus. dr is not fed back in print.",
            facts={"signs": ", ".join(f"{'+' if x > 0 else '-'} {n}" for n, x in zip(GROUPS, needed, strict=True))},
        ),
        "Eq. (27), navigation": Case(
            fed_back_navigation(), "(1 + [phi x]) (1 - [phi x]) = 1 to first order; all else is computed minus true."
        ),
    }  # fmt: skip
    return out
