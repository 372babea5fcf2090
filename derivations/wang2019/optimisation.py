"""Eqs. (36) to (42): the three least-squares problems, the step, and the initial values."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
import sympy as sp

from derivations.verdict import Case, Printed
from derivations.wang2019 import accelerometer, gyroscope
from derivations.wang2019.symbols import BIAS, K1, K2, K3, E, E_yx, E_zx, N, g, square

r = sp.symbols("f_1:4", real=True)
x = sp.Matrix(sp.symbols("x_1:3", real=True))
H = sp.Matrix(2, 2, sp.symbols("H_11 H_12 H_12 H_22", real=True))
gradient = sp.Matrix(sp.symbols("J_1:3", real=True))
beta = sp.Symbol("beta", positive=True)
S, angle = gyroscope.S, gyroscope.angle
ORDER = (*K1, *K2, *K3, *E, *BIAS)  # of (37) to (39)


def damped_step() -> Any:
    """Return the minimum of the quadratic model with the damping added to its diagonal."""
    s = sp.Matrix(sp.symbols("s_1:3", real=True))
    model = (gradient.T * s)[0] + (s.T * (H + beta * sp.diag(H[0, 0], H[1, 1])) * s)[0] / 2
    solution = sp.solve([sp.diff(model, v) for v in s], list(s), dict=True)[0]
    return (x + sp.Matrix([solution[v] for v in s])).applyfunc(sp.together)


def printed_step() -> Any:
    return (x - (H + beta * sp.diag(H[0, 0], H[1, 1])).inv() * gradient).applyfunc(sp.together)


def unknowns(of: Any, given: Sequence[Any]) -> Any:
    """Return the parameters that occur in a cost, but for those given, in the order of (37) to (39)."""
    return sp.Matrix([p for p in ORDER if p in of.free_symbols and p not in given])


def linear_part(of: Any) -> Any:
    """Return the half the square of a misfit in which only the linear scale factors are left."""
    return of.subs(dict.fromkeys((*K2, *K3, *E, *BIAS), 0)) ** 2 / 2


def rough(counts: Any, magnitude: Any) -> Any:
    """Return one term of Eqs. (41) and (42)."""
    return (square([K1[i] * counts[i] for i in range(3)]) - magnitude**2) ** 2 / 2


def gradient_of_rough(K: Any, counts: Any, magnitude: float) -> Any:
    """Return the gradient of Eq. (41) by the scale factors, as numbers."""
    miss = ((counts * K) ** 2).sum(1) - magnitude**2
    return np.array(2 * (miss[:, None] * counts**2).sum(0) * K)


PRINTED = {
    p.item: p
    for p in (
        Printed("Eq. (36)", "min over x_i of 1/2 ||f_i(x)||^2", square(r) / 2),
        Printed(
            "Eq. (37)",
            "x_1 = [K_a1x ... K_a3z E_ayx E_azx nabla_x nabla_y nabla_z]^T",
            sp.Matrix(ORDER),
            garbled="E_azy may have been lost after E_azx: fourteen entries where (2) and the text have fifteen "
            "parameters",
            literal=sp.Matrix([*K1, *K2, *K3, E_yx, E_zx, *BIAS]),
        ),
        Printed(
            "Eq. (38)", "x_2 = [K_g1x K_g1y K_g1z K_g2x K_g2y K_g2z E_gyx E_gzx E_gzy]^T", sp.Matrix([*K1, *K2, *E])
        ),
        Printed("Eq. (39)", "x_3 = [eps_x eps_y eps_z]^T", sp.Matrix(BIAS)),
        Printed("Eq. (40)", "x(k+1) = x(k) - (H(k) + beta(k) diag(H(k)))^-1 J(k)", printed_step()),
        Printed("Eq. (41)", "min 1/2 sum || ||K_a1^0 N_i||^2 - ||G||^2 ||^2", rough(N, g)),
        Printed("Eq. (42)", "min 1/2 sum || ||K_g1^0 N_sum||^2 - ||2 theta||^2 ||^2", rough(S, 2 * angle)),
    )
}


@cache
def cases() -> dict[str, Case]:
    """Return the derived forms of the items."""
    bias_cost = gyroscope.PRINTED["Eq. (35)"].formula  # K1, K2 and E "are estimated in (30)"
    return {
        "Eq. (36)": Case(None, "It is the sum of squares of (18), (30) and (35) as one vector."),
        "Eq. (37)": Case(unknowns(accelerometer.F(), ()), "Tables 2 and 4 give E_azy, and (18) is solved for it."),
        "Eq. (38)": Case(unknowns(gyroscope.norm_of_difference(), ()), "The parameters that occur in (30)."),
        "Eq. (39)": Case(unknowns(bias_cost, (*K1, *K2, *E)), "The parameters of (35) that (30) has not determined."),
        "Eq. (40)": Case(
            damped_step(),
            "The minimum of the damped quadratic model, with J the gradient of the cost as a column: for the "
            "sums of squares of (36), J = J_f^T f and H = J_f^T J_f. The package solves it by QR, without H.",
        ),
        "Eq. (41)": Case(
            linear_part(accelerometer.F()),
            "(18) with the linear scale factors alone. It is quadratic in their squares, so it needs no iteration: "
            "one linear "
            "solution is its global minimum.",
        ),
        "Eq. (42)": Case(
            linear_part(gyroscope.norm_of_difference()), "(30) with the linear scale factors alone; as (41)."
        ),
    }
