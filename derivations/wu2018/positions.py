r"""Section 3: what the eighteen positions of Table 1 determine, and what the two halves of the procedure do.

Eq. (7) is a vector equation: eighteen positions are 54 readings. The platform gimbal is the innermost axis. A zero of
it turns gravity about z_p, and a turn of all three input axes about z_p (beta_xz = beta_yz) is the same thing. One
direction is therefore free whatever the positions are: rank 14 of the 15 coefficients that Section 3 solves for, 17 of
the 18 that it lists (with K_nl), and 8 of the 9 that are left to the twelve positions between the faces.

At the six faces one input axis is vertical, up and down. To first order in misalignments and zeros

    (f_down - f_up)/2 = b + K_nl g^2,       (f_up - f_down)/(2 g) = 1/SF,

so the biases contain the neglected nonlinearity in full and the scale factors none of it.
"""

from __future__ import annotations

import itertools
from functools import cache
from typing import Any

import numpy as np
import sympy as sp

from derivations.verdict import AGREES, APPROXIMATION, ARCSEC, NOT_DETERMINED, WRONG, Verdict, in_unit, with_package
from derivations.wu2018 import sensor, table1
from derivations.wu2018.symbols import BETA, SOURCE, Rx, Ry, Rz

FACES = (1, 3, 5, 7, 9, 11)  # as printed
BETWEEN = (2, 4, 6, 8, 10, *range(12, 19))  # as printed
EVERY = tuple(range(1, 19))
d = sp.symbols("d_x d_y d_z", real=True)  # scale-factor errors, SF = 1 + d
FIFTEEN = (*d, *sensor.b, *BETA, *table1.ZEROS)  # coefficients
NINE, EIGHTEEN = FIFTEEN[6:], (*FIFTEEN, *sensor.K)
K_NL = 1e-5  # 10 ug/g^2, of the size of the paper's accelerometers
FIRST_ZERO = np.deg2rad(1.0)  # a gimbal zero before it is levelled


def output(row: int, nonlinear: bool = True) -> Any:
    """Return f^a / g (3,) at a position to first order in everything small, units of g; K_nl in 1/g."""
    force = -table1.gravity(*table1.resolved_angles()[row - 1])
    linear = sensor.linear_output(force).subs(dict(zip(sensor.SF, (1 + v for v in d), strict=True)))
    square = sp.Matrix([k * f**2 for k, f in zip(sensor.K, force, strict=True)]) if nonlinear else sp.zeros(3, 1)
    return linear + square


def rank(rows: tuple[int, ...], unknowns: tuple[Any, ...]) -> int:
    """Return the exact rank of the readings at some positions in some coefficients, about a perfect unit."""
    jacobian = sp.Matrix.vstack(*(output(row) for row in rows)).jacobian(unknowns)
    return int(jacobian.subs(dict.fromkeys(EIGHTEEN, 0)).rank())


def attitude(row: int) -> Any:
    """Return C_n^p (3, 3) at a position with the zeros at zero."""
    t1, t2, t3 = (k * sp.pi / 4 for k in table1.resolved_angles()[row - 1])
    return Rz(t1) * Rx(t2) * Ry(t3)


def vertical(row: int) -> tuple[int, int]:
    """Return the input axis that is vertical at a position and its direction (+1 along gravity), (-1, 0) for none."""
    along = attitude(row)[:, 2]
    hits = [(i, int(v)) for i, v in enumerate(along) if abs(v) == 1]
    return hits[0] if hits else (-1, 0)


def slanted(row: int) -> bool:
    """Return whether one input axis is along x_n or y_n and the other two are at 45 deg to the vertical."""
    C = attitude(row)
    level = [i for i in range(3) if C[i, 2] == 0]
    others = [i for i in range(3) if C[i, 2] ** 2 == sp.Rational(1, 2)]
    return len(level) == 1 and len(others) == 2 and max(abs(C[level[0], 0]), abs(C[level[0], 1])) == 1


@cache
def of_faces() -> tuple[Any, Any]:
    """Return estimates less truth of biases (3,) [g] and of 1/SF (3,), to first order, of the half sums and
    differences.
    """
    biases, scales = [], []
    for axis in range(3):
        up, down = (next(r for r in FACES if vertical(r) == (axis, sign)) for sign in (-1, 1))
        f_up, f_down = output(up)[axis], output(down)[axis]
        biases.append(sp.expand((f_up + f_down) / 2 - sensor.b[axis]))
        scales.append(sp.expand((f_up - f_down) / 2 - 1 / (1 + d[axis])))
    return sp.Matrix(biases), sp.Matrix(scales)


def first_order(expr: Any) -> Any:
    """Return the terms of first order in everything small and in K_nl."""
    e = sp.Dummy()
    return sp.expand(expr.subs({s: e * s for s in EIGHTEEN}, simultaneous=True).diff(e).subs(e, 0))


@cache
def levelled() -> list[float]:
    """Return the largest zero of inner and middle gimbal (rad) before and after each estimate and turn back.

    Readings of a perfect unit at the exact attitudes; the zeros are estimated by the first-order equations of Table 1.
    """
    exact = sp.lambdify(table1.ZEROS, [
        -(Rz(t1 + k1 * sp.pi / 4) * Rx(t2 + k2 * sp.pi / 4) * Ry(t3 + k3 * sp.pi / 4))[:, 2]
        for (k1, k2, k3) in table1.resolved_angles() for (t1, t2, t3) in (table1.ZEROS,)
    ])  # fmt: skip
    J = sp.Matrix.vstack(*(output(row, nonlinear=False) for row in EVERY)).jacobian(FIFTEEN)
    J = np.array(J.subs(dict.fromkeys(FIFTEEN, 0)).tolist(), dtype=float)
    zeros, path = np.array([0.0, FIRST_ZERO, -FIRST_ZERO]), []
    ideal = np.concatenate([np.ravel(v) for v in exact(0, 0, 0)])
    for _ in range(4):
        path.append(float(np.abs(zeros[1:]).max()))
        misfit = np.concatenate([np.ravel(v) for v in exact(*zeros)]) - ideal
        x = np.linalg.lstsq(J, misfit, rcond=1e-9)[0]  # least norm along the one free direction, which has no zeros
        zeros = zeros - np.array([0.0, *x[-2:]])  # of inner and middle gimbal
    return path  # fmt: skip


def judge_rank(item: str, printed: str, rows: tuple[int, ...], unknowns: tuple[Any, ...], why: str) -> Verdict:
    """Judge what positions determine."""
    seen, wanted = rank(rows, unknowns), len(unknowns)
    return with_package(Verdict(
        SOURCE, item, AGREES if seen == wanted else NOT_DETERMINED, printed, f"rank {seen} of {wanted}",
        "0" if seen == wanted else f"rank {seen} of {wanted}", why,
    ))  # fmt: skip


def judge_faces() -> Verdict:
    """Judge which axis is vertical at positions 1, 3, 5, 7, 9 and 11."""
    found = {vertical(row) for row in FACES}
    every = {(axis, sign) for axis in range(3) for sign in (-1, 1)}
    words = ", ".join(f"{row}: {'xyz'[vertical(row)[0]]} {'down' if vertical(row)[1] > 0 else 'up'}" for row in FACES)
    return Verdict(
        SOURCE, "Section 3, six positions", AGREES if found == every else WRONG,
        "No. 1, 3, 5, 7, 9, and 11, where each sensitive axis points upward or downward along the z_n axis in turn",
        words, "0" if found == every else f"{len(every - found)} of 6 missing", "From the angles of Table 1.",
    )  # fmt: skip


def judge_coarse() -> Verdict:
    """Judge scale factors and biases from the six faces alone, nonlinearity neglected."""
    bias, scale = (first_order(m) for m in of_faces())
    rest = bias - sp.Matrix(sensor.K)
    exact = not any(first_order(sp.expand(v)) != 0 for v in (*rest, *scale))
    size = in_unit(K_NL, "ug") if exact else "not quantified"
    return Verdict(
        SOURCE, "Section 3, coarse estimates", APPROXIMATION if exact else WRONG,
        "Scale factors and biases can be coarsely estimated by solving the equation set of the six rotation positions",
        "b_hat = b + K_nl g^2; SF_hat = SF", size,
        "Half the sum of the outputs up and down contains K_nl g^2 in full, half the difference none of it; "
        "misalignments and zeros enter by their products. The fine stage corrects it.",
        assumes=f"K_nl of {K_NL * 1e6:.0f} ug/g^2",
    )  # fmt: skip


def judge_slanted() -> Verdict:
    """Judge where the axes are at the other twelve positions."""
    other = [row for row in BETWEEN if not slanted(row)]
    return Verdict(
        SOURCE, "Section 3, 45 deg", AGREES if not other else WRONG,
        "one of the sensitive axes is parallel to the x_n axis or the y_n axis, and other two have angles of 45 deg "
        "with the vertical direction", "all twelve" if not other else f"not at {', '.join(map(str, other))}",
        "0" if not other else f"{len(other)} of 12", "From the angles of Table 1.",
    )  # fmt: skip


def judge_levelling() -> Verdict:
    """Judge whether turning inner and middle gimbal back by their estimates ends at zeros of nothing."""
    path = levelled()
    falls = all(b < 0.1 * a for a, b in itertools.pairwise(path) if a > 1e-12)
    return with_package(Verdict(
        SOURCE, "Section 3, levelling", AGREES if falls else WRONG,
        "the inner gimbal axis and the middle gimbal axis are inversely rotated, and then coarse calibration is "
        "re-executed until the re-estimated zeros are negligibly small",
        ", ".join(f"{v / ARCSEC:.2g}" for v in path[:3]) + " arcsec", "0" if falls else in_unit(path[-1], "arcsec"),
        f"Zeros of {np.rad2deg(FIRST_ZERO):.0f} deg, estimated by Table 1's first order, before and after one and two "
        "turns back: what is left is of second order, and the next turn removes it.",
    ))  # fmt: skip


def verdicts() -> tuple[Verdict, ...]:
    """Return the verdicts on Section 3."""
    free = "A platform zero and a turn of the triad about z_p (beta_xz = beta_yz) are one and the same"
    return (
        judge_rank(
            "Section 3, 18 coefficients", "totally 18 error coefficients that need to be calibrated",
            EVERY, EIGHTEEN,
            f"{free}; nothing else is free, K_nl included. One convention, such as beta_xz + beta_yz = 0, closes it.",
        ),
        judge_rank(
            "Section 3, 18 equations", "18 equations can be obtained according to Equation (7) to preliminarily "
            "estimate 15 parameters", EVERY, FIFTEEN,
            f"Eighteen vector equations, 54 readings. {free}, so 14 are determined however many positions there are.",
        ),
        judge_faces(),
        judge_coarse(),
        judge_slanted(),
        judge_rank(
            "Section 3, twelve positions", "the rest of the rotation positions are used to estimate zero-point offsets "
            "and installation error angles", BETWEEN, NINE, f"36 readings in nine angles. {free}.",
        ),
        judge_levelling(),
    )  # fmt: skip
