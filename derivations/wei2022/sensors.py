r"""Eqs. (1) to (8): errors of the sensors by definition, and what they add to the readings.

The equations carry no numbers in the scan; they are counted, and the text's "formula (24)" is the twenty-fourth. Their
minus signs are lost throughout, and roots and fraction bars (see `kalman`).

(7), (8): a reading is (1 + dK + dA) of the input and the constant, so it errs by the constant and (dK + dA) times the
input, exactly.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import sympy as sp

from derivations.verdict import Case, Printed
from derivations.wei2022.symbols import dA_a, dA_g, dK_a, dK_g, epsilon, f, installation_a, installation_g, nabla, omega

column = sp.Matrix


def _printed(constant: Any, diagonal: Any, off_diagonal: Any, true: Any) -> Any:
    """Return the constant plus the single matrix of (7) or (8) times the true input."""
    rows = [[diagonal[i] if i == j else off_diagonal.get((i, j), 0) for j in range(3)] for i in range(3)]
    return column(constant) + sp.Matrix(rows) * column(true)


_G = dict(zip(((1, 0), (2, 0), (2, 1)), dA_g, strict=True))
_A = dict(zip(((1, 0), (2, 0), (0, 1), (2, 1), (0, 2), (1, 2)), dA_a, strict=True))
ZERO = sp.Integer(0)
PRINTED = {
    p.item: p
    for p in (
        Printed("Eq. (1)", "epsilon = [epsilon_x epsilon_y epsilon_z]^T", ZERO),
        Printed("Eq. (2)", "nabla = [nabla_x nabla_y nabla_z]^T", ZERO, garbled="nabla is lost"),
        Printed("Eq. (3)", "dK_g = diag(dK_gx, dK_gy, dK_gz)", ZERO),
        Printed("Eq. (4)", "dK_a = diag(dK_ax, dK_ay, dK_az)", ZERO),
        Printed("Eq. (5)", "dA_g = [[0, 0, 0], [dA_gyx, 0, 0], [dA_gzx, dA_gzy, 0]]", installation_g()),
        Printed("Eq. (6)", "dA_a = [[0, dA_axy, dA_axz], [dA_ayx, 0, dA_ayz], [dA_azx, dA_azy, 0]]", ZERO),
        Printed(
            "Eq. (7)", "dw_ib^b = eps + [[dK_gx, 0, 0], [dA_gyx, dK_gy, 0], [dA_gzx, dA_gzy, dK_gz]] w_ib^b",
            _printed(epsilon, dK_g, _G, omega),
        ),
        Printed(
            "Eq. (8)",
            "df_ib^b = nabla + [[dK_ax, dA_axy, dA_axz], [dA_ayx, dK_ay, dA_ayz], [dA_azx, dA_azy, dK_az]] f",
            _printed(nabla, dK_a, _A, f), garbled="nabla is lost",
        ),
    )
}  # fmt: skip


def too_much(constant: Any, scale: Any, installation: Any, true: Any) -> Any:
    """Return the reading less true input."""
    return (sp.eye(3) + sp.diag(*scale) + installation) * column(true) + column(constant) - column(true)


def rate_error() -> Any:
    """Return dw_ib^b."""
    return too_much(epsilon, dK_g, installation_g(), omega)


def force_error() -> Any:
    """Return df_ib^b."""
    return too_much(nabla, dK_a, installation_a(), f)


@cache
def free_angles() -> Any:
    """Return Eq. (5) from the frame: x_p along the x gyroscope, y_p in the plane of x and y gyroscope. First order.

    The input axes are the rows of 1 + dA; x_p = x_g makes row one zero, and y_g has no part across the plane of x_p
    and y_p.
    """
    any_ = sp.Matrix(3, 3, lambda i, j: 0 if i == j else sp.Symbol(f"dA_g{'xyz'[i]}{'xyz'[j]}", real=True))
    x_g, y_g = (sp.eye(3) + any_)[0, :].T, (sp.eye(3) + any_)[1, :].T
    across = sp.Matrix([0, 0, 1])
    conditions = [*(x_g - sp.Matrix([1, 0, 0])), y_g.dot(across)]
    solution = sp.solve([c for c in conditions if c != 0], dict=True)[0]
    return any_.subs(solution)


@cache
def cases() -> dict[str, Case]:
    """Return the derived forms of the items."""
    signs = "added to the reading. The package's scale factors have the other sign, SF - 1 with true = SF x reading"
    return {
        "Eq. (1)": Case(None, "A reading at no input."),
        "Eq. (2)": Case(None, "A reading at no input."),
        "Eq. (3)": Case(None, f"Ratio of output to input less one, {signs}."),
        "Eq. (4)": Case(None, f"Ratio of output to input less one, {signs}."),
        "Eq. (5)": Case(free_angles(), "The frame of Section 2.2, x along the x gyroscope and y in the plane of x and "
                        "y gyroscope, leaves three of six."),
        "Eq. (6)": Case(None, "All six are left, since the frame is that of the gyroscopes."),
        "Eq. (7)": Case(rate_error(), "Reading less input, exactly."),
        "Eq. (8)": Case(force_error(), "Reading less input, exactly."),
    }  # fmt: skip
