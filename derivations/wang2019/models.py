"""Eqs. (1) to (8): the problem and the two sensor models.

The only geometry is Eqs. (5) and (8). With x_p along the first input axis and y_p in the plane of the first two, the
unit input axes are the rows of

    C_p^a = [[1, 0, 0], [s, sqrt(1 - s^2), 0], [t, u, sqrt(1 - t^2 - u^2)]]

and C_a^p is its inverse (the input axes are not orthogonal): lower triangular, with a diagonal that differs from one in
second order. A diagonal on the right is a scale factor, so K1, K2, K3 and the bias take it: with scale terms of the
orthogonal frame Eq. (5) is exact, with those of the sensor itself it is the first order.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import sympy as sp

from derivations.verdict import Case, Printed, truncate
from derivations.wang2019.symbols import E, E_yx, E_zx, E_zy, N, polynomial, triangle

v = sp.Matrix(sp.symbols("v_x v_y v_z", real=True))


def input_axes() -> Any:
    """Return C_p^a from unit input axes whose leaning is -E to first order."""
    return sp.Matrix(
        [
            [1, 0, 0],
            [-E_yx, sp.sqrt(1 - E_yx**2), 0],
            [-E_zx, -E_zy, sp.sqrt(1 - E_zx**2 - E_zy**2)],
        ]
    )


@cache
def orthogonalised() -> Any:
    """Return C_a^p, the inverse, through second order in the leaning."""
    return truncate(input_axes().inv(), E, 2)


def elementwise(n: int) -> Any:
    """Return what the words under (2) and (6) say: each element of N times itself, n factors."""
    return sp.diag(*N) ** (n - 1) * sp.Matrix(N)


PRINTED = {
    p.item: p
    for p in (
        Printed("Eq. (1)", "min over x in R^n of f(x)", sp.Symbol("f(x)")),
        Printed(
            "Eq. (2)",
            "f^p = C_a^p (K_a1 N^a + K_a2 N^a(2) + K_a3 N^a(3) + nabla^a) + v^p",
            triangle() * polynomial(3) + v,
        ),
        Printed("Eq. (3)", "N^a(2) = [(N_x^a)^2 (N_y^a)^2 (N_z^a)^2]^T", sp.Matrix([x**2 for x in N])),
        Printed("Eq. (4)", "N^a(3) = [(N_x^a)^3 (N_y^a)^3 (N_z^a)^3]^T", sp.Matrix([x**3 for x in N])),
        Printed("Eq. (5)", "C_a^p = [[1, 0, 0], [E_ayx, 1, 0], [E_azx, E_azy, 1]]", triangle()),
        Printed(
            "Eq. (6)",
            "omega_iq^q = C_g^q (K_g1 N^g + K_g2 N^g(2) + epsilon^g + v^g)",
            triangle() * (polynomial(2) + v),
        ),
        Printed("Eq. (7)", "N^g(2) = [(N_x^g)^2 (N_y^g)^2 (N_z^g)^2]^T", sp.Matrix([x**2 for x in N])),
        Printed("Eq. (8)", "C_g^q = [[1, 0, 0], [E_gyx, 1, 0], [E_gzx, E_gzy, 1]]", triangle()),
    )
}


@cache
def cases() -> dict[str, Case]:
    """Return the derived forms of the items."""
    leaning = dict.fromkeys(E, 5e-4)  # section 5.1
    triangular = Case(
        orthogonalised(),
        "Lower triangular by the choice of the frame; the diagonal of the exact inverse is 1 + E^2/2, {size} at "
        "E = 5e-4. As a diagonal on the right it is a common factor of K1, K2, K3 and bias of an axis, so "
        "the model with (5) is exact for scale terms that are meant with it.",
        small=E,
        at=leaning,
    )
    return {
        "Eq. (1)": Case(None, "It is the problem in its general form."),
        "Eq. (2)": Case(
            None,
            "It is the model, pulses to force. The noise stands in p here and along the axes in (6): for equal white "
            "noise on the axes the difference is of the order of E times the noise.",
        ),
        "Eq. (3)": Case(elementwise(2), "The words below (2), square of each element: diag(N) N."),
        "Eq. (4)": Case(elementwise(3), "The words below (2), cube of each element: diag(N)^2 N."),
        "Eq. (5)": triangular,
        "Eq. (6)": Case(None, "It is the model, pulses to rate."),
        "Eq. (7)": Case(elementwise(2), "The words below (6), square of each element: diag(N) N."),
        "Eq. (8)": triangular,
    }
