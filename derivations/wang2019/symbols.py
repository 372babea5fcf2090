"""The paper's symbols and the model they stand in, built from the definitions of its frames.

Frames: n east, north, up; a, g input axes; p, q orthogonal, x along the first input axis, y in the plane of the first
two. Direction of the model: pulses to force and rate.
"""

from __future__ import annotations

from typing import Any

import sympy as sp

from derivations.cross import cross

SOURCE = "000"  # of errata.json

AXES = ("x", "y", "z")
N = sp.symbols("N_x N_y N_z", real=True)
K1 = sp.symbols("K1_x K1_y K1_z", positive=True)
K2 = sp.symbols("K2_x K2_y K2_z", real=True)
K3 = sp.symbols("K3_x K3_y K3_z", real=True)
BIAS = sp.symbols("b_x b_y b_z", real=True)
E = sp.symbols("E_yx E_zx E_zy", real=True)
E_yx, E_zx, E_zy = E
g, omega_ie, L = sp.symbols("g omega_ie L", positive=True)
fp = sp.symbols("fp_x fp_y fp_z", real=True)  # components of the force in p
fa = sp.symbols("fa_x fa_y fa_z", real=True)  # along the input axes

# Section 5.1: middle of the drawn ranges, in g and pulses
NOMINAL: dict[Any, float] = {
    **dict.fromkeys(K1, 3e-6), **dict.fromkeys(K2, 5e-15), **dict.fromkeys(K3, 5e-21), **dict.fromkeys(BIAS, 1e-2),
    **dict.fromkeys(E, 5e-4), g: 1.0,
}  # fmt: skip


def triangle(entries: Any = E) -> Any:
    """Return the unit lower-triangular matrix, as Eqs. (5) and (8) print it."""
    yx, zx, zy = entries
    return sp.Matrix([[1, 0, 0], [yx, 1, 0], [zx, zy, 1]])


def polynomial(order: int) -> Any:
    """Return K1 N + K2 N^2 + K3 N^3 + bias through `order`, axis by axis."""
    terms = (K1, K2, K3)[:order]
    return sp.Matrix([sum(k[i] * N[i] ** (n + 1) for n, k in enumerate(terms)) + BIAS[i] for i in range(3)])


def square(v: Any) -> Any:
    """Return the sum of squares of a column."""
    return sum(x**2 for x in v)


def integral(of: Any, first: Any, second: Any, duration: Any) -> Any:
    """Return a polynomial in N integrated over `duration`: N becomes `first`, N^2 `second`, 1 the duration; entry by
    entry.
    """
    by = {tuple(int(i == j) for j in range(3)): first[i] for i in range(3)}
    by |= {tuple(2 * int(i == j) for j in range(3)): second[i] for i in range(3)} | {(0, 0, 0): duration}
    return of.applyfunc(lambda e: sum(c * by[powers] for powers, c in sp.Poly(e, *N).terms()))


def rotation() -> Any:
    """Return any rotation matrix but half a turn, rational in three parameters (Cayley)."""
    p = sp.symbols("p_1:4", real=True)
    v = sp.Matrix(p)
    return ((1 - square(v)) * sp.eye(3) + 2 * v * v.T - 2 * cross(p)) / (1 + square(v))


def norm_after_rotation(v: Any) -> Any:
    """Return |C v|^2 for any rotation C: what is left of the parameters after algebra is derived, not assumed."""
    return sp.cancel(sp.together(square(rotation() * v)))
