"""Eqs. (43) to (45): rotations between the triads and the turntable.

All three print the same product Ry(gamma) Rx(beta) Rz(alpha). C_p^q turns one orthogonal frame into another: three
angles are right. The a and g axes are not orthogonal: C_a^r = C_p^r C_a^p has the triangle of Eq. (5) in it, six
numbers, and the E of Table 4 (up to 13.3e-4 = 4.6 arcmin) are as large as the angles (up to 7.5 arcmin). Nothing is
linearised; what no three angles can reach is the distance to the nearest rotation.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import sympy as sp

from derivations.verdict import Case, Printed
from derivations.wang2019.symbols import E, triangle

a, b, c = sp.symbols("alpha beta gamma", real=True)
ANGLES = (a, b, c)
ARCMIN = 2.908882086657216e-4


def product() -> Any:
    """Return the ry(gamma) Rx(beta) Rz(alpha), frame rotations."""
    Ry = sp.Matrix([[sp.cos(c), 0, -sp.sin(c)], [0, 1, 0], [sp.sin(c), 0, sp.cos(c)]])
    Rx = sp.Matrix([[1, 0, 0], [0, sp.cos(b), sp.sin(b)], [0, -sp.sin(b), sp.cos(b)]])
    Rz = sp.Matrix([[sp.cos(a), sp.sin(a), 0], [-sp.sin(a), sp.cos(a), 0], [0, 0, 1]])
    return Ry * Rx * Rz


def printed() -> Any:
    ca, sa, cb, sb, cc, sc = sp.cos(a), sp.sin(a), sp.cos(b), sp.sin(b), sp.cos(c), sp.sin(c)
    return sp.Matrix(
        [
            [ca * cc - sa * sb * sc, cc * sa + ca * sb * sc, -cb * sc],
            [-cb * sa, ca * cb, sb],
            [ca * sc + cc * sa * sb, sa * sc - ca * cc * sb, cb * cc],
        ]
    )


@cache
def with_triangle() -> Any:
    """Return C_a^r, exact."""
    return product() * triangle()


def out_of_reach(angles: Any, leaning: Any) -> float:
    """Return largest element of C_a^r less the nearest rotation [rad]: what three angles leave, whatever they are."""
    at = dict(zip((*ANGLES, *E), (*angles, *leaning), strict=True))
    C = np.array(with_triangle().subs(at).evalf(20).tolist(), dtype=float)
    U, _, Vt = np.linalg.svd(C)
    return float(np.abs(C - U @ Vt).max())


PRINTED = {
    p.item: p
    for p in (
        Printed("Eq. (43)", "C_p^q = [[cos a1 cos c1 - sin a1 sin b1 sin c1, ...], ...]", printed()),
        Printed("Eq. (44)", "C_a^r = the same with alpha_2, beta_2, gamma_2", printed()),
        Printed("Eq. (45)", "C_g^r = the same with alpha_3, beta_3, gamma_3", printed()),
    )
}


@cache
def cases() -> dict[str, Case]:
    """Return the derived forms of the items."""
    why = (
        "A rotation with three angles cannot turn axes that are not orthogonal: the triangle of Eq. ({eq}) is "
        "missing on the "
        "right, {{size}} rad, as large as the angles themselves. Chosen best, three angles still leave {{left:.2g}} "
        "arcmin of Table 4's leaning. Method 1, which uses it, therefore has no misalignment and leaves that error in."
    )
    table_4 = {"Eq. (44)": (-7.48, -0.69, -7.36, 4.24e-4, 3.21e-4, 1.75e-4),
               "Eq. (45)": (5.97, -0.026, -3.77, 3.58e-4, 13.30e-4, -2.09e-4)}  # fmt: skip
    out = {
        "Eq. (43)": Case(
            product(), "Ry(gamma) Rx(beta) Rz(alpha): gamma about y, beta about x, alpha about z.",
        )
    }  # fmt: skip
    for item, eq in (("Eq. (44)", 5), ("Eq. (45)", 8)):
        values = table_4[item]
        at = dict(zip(ANGLES, (v * ARCMIN for v in values[:3]), strict=True)) | dict(zip(E, values[3:], strict=True))
        remaining = out_of_reach([v * ARCMIN for v in values[:3]], values[3:]) / ARCMIN
        out[item] = Case(with_triangle(), why.format(eq=eq), at=at, facts={"left": remaining})
    return out
