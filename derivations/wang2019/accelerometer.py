"""Eqs. (17) to (25): the norm as observation, and its sensitivity to each parameter.

At rest the specific force is minus gravity, so its norm is g at any attitude. F = |C_a^p f^a|^2 - g^2 with f^a the
polynomial of Eq. (2); with f^p = C_a^p f^a the derivative by a parameter of axis i is

    dF/dp = 2 (C_a^p^T f^p)_i df^a_i/dp,        dF/dE_jk = 2 f^p_j f^a_k.

The paper drops the misalignment in the first. That is right to first order in E where f^p_i is of the order of g. In a
position with f^p_i = 0 the term that is dropped is all there is, but it is then small against other positions.
"""

from __future__ import annotations

from functools import cache
from itertools import combinations
from typing import Any

import numpy as np
import sympy as sp

from derivations.verdict import Case, Printed
from derivations.wang2019.symbols import (
    BIAS,
    K1,
    K2,
    K3,
    E,
    E_yx,
    E_zx,
    E_zy,
    N,
    fa,
    fp,
    g,
    norm_after_rotation,
    polynomial,
    square,
    triangle,
)  # fmt: skip

G = sp.symbols("G_E G_N G_U", real=True)
theta = sp.Symbol("theta", real=True)  # of gravity from an input axis, in the plane of two
UNKNOWNS = (*K1, *K2, *K3, *BIAS, *E)


def F() -> Any:
    """Return Eq. (19) as a norm."""
    return square(triangle() * polynomial(3)) - g**2


@cache
def derivatives() -> Any:
    """Return all fifteen by the chain rule, in f^p and f^a; each is checked against the derivative of F itself."""
    back = triangle().T * sp.Matrix(fp)
    by = {}
    for i in range(3):
        for n, k in enumerate((K1, K2, K3)):
            by[k[i]] = 2 * back[i] * N[i] ** (n + 1)
        by[BIAS[i]] = 2 * back[i]
    by |= {E_yx: 2 * fp[1] * fa[0], E_zx: 2 * fp[2] * fa[0], E_zy: 2 * fp[2] * fa[1]}
    along = polynomial(3)
    force = triangle() * along
    full = {**dict(zip(fp, force, strict=True)), **dict(zip(fa, along, strict=True))}
    for symbol, short in by.items():
        if sp.expand(short.subs(full) - sp.diff(F(), symbol)) != 0:
            raise ArithmeticError(f"the chain rule and the derivative of F by {symbol} differ")
    return [by[s] for s in UNKNOWNS]


def exact(*wanted: Any) -> Any:
    """Return the column of derivatives by the wanted parameters."""
    return sp.Matrix([derivatives()[UNKNOWNS.index(s)] for s in wanted])


def printed_expansion() -> Any:
    """Return Eq. (19) term by term, as the second line prints it."""
    (Nx, Ny, Nz), (bx, by, bz) = N, BIAS
    x = K1[0] * Nx + K2[0] * Nx**2 + K3[0] * Nx**3 + bx
    y = (
        E_yx * K1[0] * Nx + K1[1] * Ny + E_yx * K2[0] * Nx**2 + K2[1] * Ny**2 + E_yx * K3[0] * Nx**3 + K3[1] * Ny**3
        + E_yx * bx + by
    )  # fmt: skip
    z = (
        E_zx * K1[0] * Nx + E_zy * K1[1] * Ny + K1[2] * Nz + E_zx * K2[0] * Nx**2 + E_zy * K2[1] * Ny**2
        + K2[2] * Nz**2 + E_zx * K3[0] * Nx**3 + E_zy * K3[1] * Ny**3 + K3[2] * Nz**3 + E_zx * bx + E_zy * by + bz
    )  # fmt: skip
    return x**2 + y**2 + z**2 - g**2


def _plain(n: int) -> Any:
    return sp.Matrix([2 * fp[i] * N[i] ** n for i in range(3)])


def faces_and_edges() -> Any:
    """Return the unit vectors of six faces, and of the twelve edges between them."""
    faces = [sign * np.eye(3)[i] for i in range(3) for sign in (1, -1)]
    edges = [(s * np.eye(3)[i] + t * np.eye(3)[j]) / np.sqrt(2) for i, j in ((0, 1), (0, 2), (1, 2)) for s in (1, -1)
             for t in (1, -1)]  # fmt: skip
    return np.array(faces), np.array(edges)


def cost() -> Any:
    """Return one term of the sum of squares: half the square of |f^p|^2 - |G|^2, |G| = g from (17)."""
    return (square(triangle() * polynomial(3)) - norm_after_rotation(sp.Matrix([0, 0, -g]))) ** 2 / 2


def _largest(sensitivity: Any) -> list[Any]:
    """Return the angles in [0, pi) at which the size of a sensitivity is largest: zeros of the slope, compared."""
    slope = sp.trigsimp(sp.diff(sensitivity, theta))
    stationary = sorted(sp.solveset(slope, theta, sp.Interval.Ropen(0, sp.pi)), key=float)
    size = [abs(sensitivity.subs(theta, a)) for a in stationary]
    return [a for a, s in zip(stationary, size, strict=True) if s == max(size)]


def steepest(n: int) -> list[Any]:
    """Return where dF/dp of the own axis, 2 f_x N^n with N along f_x, is largest in size."""
    return _largest(2 * sp.cos(theta) ** (n + 1))


def steepest_pair() -> list[Any]:
    """Return where dF/dE_yx = 2 f_y f_x is largest in size."""
    return _largest(2 * sp.sin(theta) * sp.cos(theta))


@cache
def ranks() -> dict[int, int]:
    """Return how many of the 220 choices of six faces and nine edges have which rank in the fifteen parameters."""
    faces, edges = faces_and_edges()
    out: dict[int, int] = {}
    for chosen in combinations(range(12), 9):
        u = np.concatenate([faces, edges[list(chosen)]])
        x, y, z = u.T
        J = np.column_stack([u**2, u**3, u**4, u, y * x, z * x, z * y])
        rank = int(np.linalg.matrix_rank(J, tol=1e-9))
        out[rank] = out.get(rank, 0) + 1
    return out


PRINTED = {
    p.item: p
    for p in (
        Printed("Eq. (17)", "||f'||^2 = ||G^n||^2", square(G), garbled="f^p reads f'"),
        Printed(
            "Eq. (18)",
            "(not in the scan: the line after 'the nonlinear cost function of accelerometer can be expressed as:')",
            None,
            garbled="the scan shows no formula, only the line after it",
        ),
        Printed("Eq. (19)", "F = (K_a1x N_x + ...)^2 + (E_ayx K_a1x N_x + ...)^2 + (...)^2 - g^2", printed_expansion()),
        Printed(
            "Eq. (20)",
            "dF/dK_a1x = 2 f_x N_x + 2 f_y E_ayx N_x + 2 f_z E_azx N_x ~ 2 f_x N_x",
            sp.Matrix([2 * fp[0] * N[0]]),
        ),
        Printed("Eq. (21)", "dF/dK_a1y = 2 f_y N_y, dF/dK_a1z = 2 f_z N_z", sp.Matrix(_plain(1)[1:])),
        Printed("Eq. (22)", "dF/dK_a2i = 2 f_i N_i^2", _plain(2)),
        Printed("Eq. (23)", "dF/dK_a3i = 2 f_i N_i^3", _plain(3)),
        Printed("Eq. (24)", "dF/dnabla_i = 2 f_i", _plain(0)),
        Printed(
            "Eq. (25)",
            "dF/dE_ayx = 2 f_y f^a_x, dF/dE_azx = 2 f_z f^a_x, dF/dE_azy = 2 f_z f^a_y",
            sp.Matrix([2 * fp[1] * fa[0], 2 * fp[2] * fa[0], 2 * fp[2] * fa[1]]),
        ),
        Printed(
            "Section 4.1, own axis",
            "the sensitivity to linear scale factor, nonlinear scale factors and bias is maximized when the axis is "
            "parallel to the gravity vector",
            sp.Matrix([0] * 4),
        ),
        Printed(
            "Section 4.1, misalignment",
            "the sensitivity to E_ij is maximized at an angle of 45 or 135 deg between the axis and gravity",
            sp.Matrix([sp.pi / 4, 3 * sp.pi / 4]),
        ),
    )
}


@cache
def cases() -> dict[str, Case]:
    """Return the derived forms of the items."""
    at = {**dict.fromkeys(fp, 1.0), **dict.fromkeys(fa, 1.0), **dict.fromkeys(N, 1.0), **dict.fromkeys(E, 5e-4)}
    dropped = (
        "First order in E: 2 f_j E_ji of the other axes is dropped, {size} of the sensitivity at E = 5e-4. The "
        "package keeps it."
    )
    stationary = ranks()
    singular = sum(n for rank, n in stationary.items() if rank < 15)
    return {
        "Eq. (17)": Case(
            norm_after_rotation(-sp.Matrix(G)), "At rest f = -G, and any rotation matrix keeps the norm."
        ),
        "Eq. (18)": Case(
            cost(),
            "By (17), (2), the line that follows it and its sibling (35) it is half the square of (19), summed over "
            "the positions.",
        ),
        "Eq. (19)": Case(F(), "The norm of (2) multiplied out, all 24 terms."),
        "Eq. (20)": Case(
            exact(K1[0]), dropped + " The first equality, before the sign of approximation, is exact.", small=E, at=at,
        ),
        "Eq. (21)": Case(exact(*K1[1:]), dropped + " The last component is exact.", small=E, at=at),
        "Eq. (22)": Case(exact(*K2), dropped, small=E, at=at),
        "Eq. (23)": Case(exact(*K3), dropped, small=E, at=at),
        "Eq. (24)": Case(exact(*BIAS), dropped, small=E, at=at),
        "Eq. (25)": Case(exact(*E), "Exact: only row j of C_a^p holds E_jk."),
        "Section 4.1, own axis": Case(
            sp.Matrix([steepest(n)[0] for n in range(4)]),
            "2 f_x N^n with f_x = g cos theta is extremal, and largest in size, at 0 (and 180 deg), n = 0 to 3. It "
            "makes each sensitivity largest, not the fifteen separable: of the 220 ways to hold six faces and nine of "
            "the twelve edges {singular} have rank 14, and Figure 2, which says which nine, carries no numbers.",
            facts={"singular": singular},
        ),
        "Section 4.1, misalignment": Case(
            sp.Matrix(steepest_pair()), "2 f_y f_x = g^2 sin 2 theta in the plane of the two axes."
        ),
    }  # fmt: skip
