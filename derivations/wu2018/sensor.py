"""Eqs. (6) to (9): what the accelerometers read, and how the reading is turned back into force.

Along its own axis an accelerometer reads SF^-1 times the force there, plus a bias, plus a term quadratic in its own
bias-free output:

    f^a = SF^-1 C_p^a f^p + b + K (f^a - b)^2                  (square element by element)

The equation is implicit in f^a. Solved for f^p it is linear, so Eq. (8) is its exact inverse, with C_a^p the inverse of
C_p^a (not its transpose, the a axes are not orthogonal). Eq. (7) is the same with K = 0, and at rest f^p = -g^p.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import sympy as sp

from derivations.verdict import AGREES, Case, Printed
from derivations.wu2018.frames import platform_to_accelerometers
from derivations.wu2018.symbols import BETA

SF = sp.symbols("SF_x SF_y SF_z", positive=True)
b = sp.symbols("b_x b_y b_z", real=True)
K = sp.symbols("K_x K_y K_z", real=True)
f_a = sp.symbols("f^a_x f^a_y f^a_z", real=True)
f_p = sp.symbols("f^p_x f^p_y f^p_z", real=True)
f_n = sp.symbols("f^n_x f^n_y f^n_z", real=True)
g_p = sp.symbols("g^p_x g^p_y g^p_z", real=True)
SF_hat = sp.symbols("SFhat_x SFhat_y SFhat_z", positive=True)
b_hat = sp.symbols("bhat_x bhat_y bhat_z", real=True)
BETA_HAT = sp.symbols("betahat_xy betahat_xz betahat_yz betahat_yx betahat_zx betahat_zy", real=True)

C_pa = platform_to_accelerometers()
C_pa_hat = C_pa.subs(dict(zip(BETA, BETA_HAT, strict=True)))


def balance(output: Any, force: Any) -> Any:
    """Return the output minus model, Eq. (6): zero for the output a force produces."""
    out, bias = sp.Matrix(output), sp.Matrix(b)
    linear = sp.diag(*SF).inv() * C_pa * sp.Matrix(force)
    square = sp.Matrix([k * x**2 for k, x in zip(K, out - bias, strict=True)])
    return out - linear - bias - square


def linear_output(force: Any) -> Any:
    """Return the output without the quadratic term."""
    return sp.diag(*SF).inv() * C_pa * sp.Matrix(force) + sp.Matrix(b)


def solved_for_force() -> Any:
    """Return f^p from f^a: the linear system of Eq. (6) solved for the three components."""
    solution = sp.solve(list(balance(f_a, f_p)), f_p, dict=True)[0]
    return sp.Matrix([solution[x] for x in f_p])


def printed_inverse(C: Any, scale: Any, bias: Any, nonlinearity: Any) -> Any:
    """Return C_a^p SF (f^a - b - K (f^a - b)^2) as Eqs. (8) and (9) write it."""
    y = sp.Matrix(f_a) - sp.Matrix(bias)
    square = sp.Matrix([k * x**2 for k, x in zip(nonlinearity, y, strict=True)])
    return C.inv() * sp.diag(*scale) * (y - square)


PRINTED = {
    p.item: p
    for p in (
        Printed(
            "Eq. (6)",
            "f^n = SF^-1 C_p^a C_b^p C_n^b f^n + delta b + K_nl (f^n - delta b)^2",
            balance(f_a, f_p),
            garbled="the scan shows f^n for the output, left and in the square, and may have read a as n",
            literal=balance(f_n, f_p),
        ),
        Printed(
            "Eq. (7)",
            "f^a = SF^-1 C^a_nu g^rho + delta b",
            linear_output(g_p),
            garbled="C_p^a g^p reads C^a_nu g^rho",
            carried="the next sentence calls C_p^a g^p the gravity vector sensed by the accelerometer",
        ),
        Printed(
            "Eq. (8)",
            "f^p = C_a^p SF (f^a - delta b - K_nl (f^a - delta b)^2)",
            printed_inverse(C_pa, SF, b, K),
        ),
        Printed(
            "Eq. (9)",
            "f_hat^p = C_hat_a^p SF_hat (f^a - delta b_hat)",
            printed_inverse(C_pa_hat, SF_hat, b_hat, (0, 0, 0)),
        ),
    )
}

NOMINAL = {**dict.fromkeys(SF, 1.0), **dict.fromkeys((*b, *K), 0.0), **dict.fromkeys(BETA, 0.0)}
DOWN_UP = tuple(
    {
        **dict(zip(f_n, (0, 0, -1), strict=True)),
        **dict.fromkeys((*f_a, *f_p, *g_p), 0.0),
        f_a[2]: -z,
        f_p[2]: -z,
        g_p[2]: z,
    }
    for z in (1, -1)
)


@cache
def cases() -> dict[str, Case]:
    """Return the derived forms of the items."""
    estimated = dict(zip((*SF, *b, *K, *BETA), (*SF_hat, *b_hat, 0, 0, 0, *BETA_HAT), strict=True))
    force = solved_for_force()
    held_up = [-x for x in g_p]
    return {
        "Eq. (6)": Case(
            balance(f_a, f_p),
            "With f^a, as in (8), it is right: the linear term's C_b^p C_n^b f^n is f^p. Taken literally the z output "
            "at position 7 is off by {size}.",
            at=NOMINAL,
            sweep=DOWN_UP,
            unit="g",
        ),
        "Eq. (7)": Case(
            linear_output(held_up),
            "At rest the sensor feels f^p = -g^p, by (1) and (6). The sign is a convention: (7) agrees where outputs "
            "count along gravity, as the sentence after it says, and (6) where they count along the force; "
            "between both conventions every output differs by 2 g.",
            reading=(
                "that the outputs of (7) count along gravity, unlike those of (6)",
                lambda d: d.subs({x: -x for x in g_p}, simultaneous=True),
                AGREES,
            ),
            at=NOMINAL,
            sweep=DOWN_UP,
            unit="g",
            repairs=(("g^p for -g^p", lambda f: f.subs({x: -x for x in g_p}, simultaneous=True)),),
        ),
        "Eq. (8)": Case(
            force,
            "The exact inverse of (6), C_a^p being the inverse (not the transpose) of C_p^a.",
        ),
        "Eq. (9)": Case(
            force.subs(estimated),
            "(8) at the coarse estimates, which have K_nl = 0.",
        ),
    }
