r"""Eqs. (13) to (16): the fixed-interval smoother.

Given the data through j - 1 the states at j - 1 and j are jointly Gaussian, covariance [[P, P Phi^T], [Phi P, P_j]].
The state at j - 1 less the part that follows the state at j, x_{j-1} - A x_j, is independent of x_j; later data tell
nothing of it. So

    A P_{j|j-1} = P Phi^T,    E[x_{j-1} | all] = x + A (E[x_j | all] - x_{j|j-1}),
    P_{j-1|M} = P - A P_{j|j-1} A^T + A P_{j|M} A^T.

Judged in two states with every symbol general, and again as numbers: `against_all_data` smooths three epochs in
rationals and compares with the one least-squares solution of all states and all data.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import sympy as sp

from derivations.cai2016.symbols import SOURCE
from derivations.verdict import AGREES, WRONG, Case, Printed, Verdict

x, x_j, x_M = (sp.Matrix(sp.symbols(f"{n}_1:3", real=True)) for n in ("x", "x_pred", "x_smooth"))
Phi = sp.Matrix(2, 2, sp.symbols("Phi_:2:2", real=True))
A = sp.Matrix(2, 2, sp.symbols("A_:2:2", real=True))


def _symmetric(name: str) -> Any:
    a, b, c = sp.symbols(f"{name}_11 {name}_12 {name}_22", real=True)
    return sp.Matrix([[a, b], [b, c]])


P, P_j, P_M = (_symmetric(n) for n in ("P", "P_pred", "P_smooth"))

PRINTED = {
    p.item: p
    for p in (
        Printed("Eq. (13)", "x_{j-1/M} = x_{j-1} + A_{j-1} (x_{j/M} - x_{j/j-1})", x + A * (x_M - x_j)),
        Printed("Eq. (14)", "A_{j-1} = P_{j-1} Phi^T_{j,j-1} P^-1_{j/j-1}", P * Phi.T * P_j.inv()),
        Printed("Eq. (15)", "P_{j-1/M} = P_{j-1} + A_{j-1} (P_{j/M} - P_{j/j-1}) A^T_{j-1}", P + A * (P_M - P_j) * A.T),
        Printed("Eq. (16)", "x_{M/M} = x_M", x_M),
    )
}


@cache
def gain() -> Any:
    """Return A from Cov(x_{j-1} - A x_j, x_j) = 0."""
    unknown = list(A)
    solved = sp.solve(list(P * Phi.T - A * P_j), unknown, dict=True)[0]
    return A.subs(solved)


def mean() -> Any:
    """Return the mean of the independent part, which later data leave alone, and A times that of the state at j."""
    return (x - A * x_j) + A * x_M


def covariance() -> Any:
    """Return the covariance of both parts: that of the independent one is P - A P_pred A^T, by what makes A."""
    return (P - A * P_j * A.T) + A * P_M * A.T


def _filtered(z: Any, Phi_: Any, Q: Any, R: Any, P0: Any) -> tuple[list[Any], list[Any], list[Any], list[Any]]:
    """Return Kalman filter, the first component measured at every epoch."""
    H = sp.Matrix([[1, 0]])
    means, covariances, before, P_before = [], [], [], []
    m, C = sp.zeros(2, 1), P0
    for i, value in enumerate(z):
        if i:
            m, C = Phi_ * m, Phi_ * C * Phi_.T + Q
        before.append(m)
        P_before.append(C)
        K = C * H.T * (H * C * H.T + R).inv()
        m, C = m + K * (sp.Matrix([value]) - H * m), (sp.eye(2) - K * H) * C
        means.append(m)
        covariances.append(C)
    return means, covariances, before, P_before


def against_all_data() -> Any:
    """Return the largest difference between (13) to (16) and the joint solution of three epochs; exact, so zero."""
    R_ = sp.Rational
    Phi_, Q, R = sp.Matrix([[1, R_(1, 2)], [R_(-1, 5), 1]]), sp.Matrix([[R_(1, 3), R_(1, 7)], [R_(1, 7), 1]]), R_(1, 4)
    P0, z = sp.Matrix([[2, R_(1, 2)], [R_(1, 2), 3]]), [R_(3, 10), R_(-1, 2), R_(9, 10)]
    m, C, before, P_before = _filtered(z, Phi_, Q, sp.Matrix([[R]]), P0)
    N, y = sp.zeros(6, 6), sp.zeros(6, 1)
    N[:2, :2] += P0.inv()
    for i, value in enumerate(z):
        N[2 * i, 2 * i] += 1 / R
        y[2 * i] += value / R
        if i:
            D = sp.zeros(2, 6)
            D[:, 2 * i : 2 * i + 2], D[:, 2 * i - 2 : 2 * i] = sp.eye(2), -Phi_
            N += D.T * Q.inv() * D
    joint, spread = N.inv() * y, N.inv()
    smooth, S = m[-1], C[-1]
    worst = []
    for i in (2, 1, 0):
        if i < 2:
            gain_ = C[i] * Phi_.T * P_before[i + 1].inv()
            smooth, S = m[i] + gain_ * (smooth - before[i + 1]), C[i] + gain_ * (S - P_before[i + 1]) * gain_.T
        worst += [*(smooth - joint[2 * i : 2 * i + 2, 0]), *(S - spread[2 * i : 2 * i + 2, 2 * i : 2 * i + 2])]
    return max(abs(w) for w in worst)


def gain_of_a_constant() -> Any:
    """Return the largest change of a constant's estimate from the filter's last to the smoothed ones; exact.

    A moving state and a constant that drives it, four epochs in rationals.
    """
    R_ = sp.Rational
    Phi_, Q, R = sp.Matrix([[1, R_(1, 2)], [0, 1]]), sp.Matrix([[R_(1, 3), 0], [0, 0]]), sp.Matrix([[R_(1, 4)]])
    z = [R_(3, 10), R_(-1, 2), R_(9, 10), R_(2, 5)]
    m, C, before, P_before = _filtered(z, Phi_, Q, R, sp.Matrix([[2, R_(1, 2)], [R_(1, 2), 3]]))
    smooth, S, changes = m[-1], C[-1], []
    for i in range(len(z) - 2, -1, -1):
        gain_ = C[i] * Phi_.T * P_before[i + 1].inv()
        smooth, S = m[i] + gain_ * (smooth - before[i + 1]), C[i] + gain_ * (S - P_before[i + 1]) * gain_.T
        changes += [abs(smooth[1] - m[-1][1]), abs(S[1, 1] - C[-1][1, 1])]
    return max(changes)


def judge_constants() -> Verdict:
    """Judge Section 3.2: smoothing further improves the accuracy of the calibration parameters."""
    change = gain_of_a_constant()
    return Verdict(
        SOURCE, "Section 3.2, smoothing", WRONG if change == 0 else AGREES,
        "smoothing the calibration parameters by RTS smoothing can further improve the estimation accuracy",
        "the smoothed constant is the filter's last one at every epoch", "nothing is gained" if change == 0 else "0",
        "A constant has no noise of its own, so (13) carries the filter's last estimate and (15) its covariance back "
        "unchanged; four epochs in rationals show it exactly. Attitude and velocity on the way are what gains, and a "
        "constant's estimate before the end.",
        assumes="that smoothed constants are compared with the filter's at the end",
    )  # fmt: skip


@cache
def cases() -> dict[str, Case]:
    """Return the derived forms of the items."""
    if against_all_data() != 0:
        raise ArithmeticError("the recursion and the joint solution of all data differ")
    return {
        "Eq. (13)": Case(mean(), "The part of x_(j-1) that is independent of x_j learns nothing from later data. Three "
                         "epochs in rationals give exactly the joint solution of all data."),
        "Eq. (14)": Case(gain(), "What makes x_(j-1) - A x_j independent of x_j."),
        "Eq. (15)": Case(covariance(), "The variances of both parts."),
        "Eq. (16)": Case(None, "Where the recursion starts: at the last epoch the filter has seen all data. The text "
                         "says the same of the covariance."),
    }  # fmt: skip
