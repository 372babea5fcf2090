r"""Eqs. (9) to (24): the 30-state filter and its measure of observability.

The scan shows no minus sign anywhere, and no fraction bar or root; plus signs and crosses are there. Two terms with
nothing between them are read as a difference, which is all they can be: vectors do not multiply. A minus in front of a
line cannot be distinguished from nothing at all.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import sympy as sp

from derivations import mechanisation as nav
from derivations.verdict import Case, Printed
from derivations.wang2019.navigation import R_M, R_N, V, earth_rate, h, transport_rate
from derivations.wang2019.symbols import L
from derivations.wei2022.symbols import STATES
from derivations.wei2022.tables import chance_of_variances

V_ = sp.Matrix(V)
phi, dV, f_n = sp.Matrix(nav.PHI), sp.Matrix(nav.DV), sp.Matrix(nav.F_N)
Phi = sp.Matrix(2, 2, sp.symbols("F_:2:2", real=True))
x, z = sp.Matrix(sp.symbols("x_1:3", real=True)), sp.Symbol("Z", real=True)
Gamma = sp.Matrix(sp.symbols("Gamma_1:3", real=True))
Q, R = sp.symbols("Q R", positive=True)
P = sp.Matrix(2, 2, sp.symbols("P_11 P_12 P_12 P_22", real=True))
H = sp.Matrix([sp.symbols("H_1:3", real=True)])
K = sp.Matrix(sp.symbols("K_1:3", real=True))
GAIN = P * H.T / ((H * P * H.T)[0] + R)  # as (20) has it
MINUS = "minus signs are lost; terms with nothing between them are read as a difference"


def _moved(rate: Any) -> Any:
    """Return the first-order change of a rate by the errors of velocity and position."""
    pairs = zip((*V, *nav.POSITION), (*nav.DV, *nav.DP), strict=True)
    return sum((rate.diff(s) * d for s, d in pairs), sp.zeros(3, 1))


def _attitude(sign: int) -> Any:
    w_ie, w_en = earth_rate(), transport_rate(h)
    return sign * (w_ie + w_en).cross(phi) + _moved(w_ie) + _moved(w_en) - sp.Matrix(nav.DW)


def _velocity() -> Any:
    w_ie, w_en = earth_rate(), transport_rate(h)
    turning = (2 * w_ie + w_en).cross(dV) + (2 * _moved(w_ie) + _moved(w_en)).cross(V_)
    return f_n.cross(phi) + sp.Matrix(nav.DF) - turning - sp.Matrix(nav.DG)


def _ground() -> Any:
    (E, N_, _), (dE, dN, dU), (dL, _, dh) = V, nav.DV, nav.DP
    sec = 1 / sp.cos(L)
    return sp.Matrix([
        dN / (R_M + h) - N_ * dh / (R_M + h) ** 2,
        sec * dE / (R_N + h) + E * sp.tan(L) * sec * dL / (R_N + h) - E * sec * dh / (R_N + h) ** 2,
        dU,
    ])  # fmt: skip


PRINTED = {
    p.item: p
    for p in (
        Printed("Eq. (9)", "phi_dot = w_in^n x phi + dw_in^n C_b^n dw_ib^b", _attitude(-1),
                garbled="minus signs are lost, here one in front of the line too", literal=_attitude(1)),
        Printed("Eq. (10)", "dv_dot = (C f) x phi + C df (2 w_ie + w_en) x dv (2 dw_ie + dw_en) x v dg", _velocity(),
                garbled=MINUS),
        Printed("Eq. (11)", "dL_dot = dv_N/(R_M+h) v_N dh/(R_M+h)^2; dlambda_dot = ...; dh_dot = dv_U", _ground(),
                garbled=MINUS),
        Printed("Eq. (12)", "X_dot = F X + G W", sp.Integer(0)),
        Printed("Eq. (13)", "X = [phi dv dL dlambda dh eps nabla dK_g dK_a dA_g (3) dA_a (6)]^T", sp.Integer(30)),
        Printed("Eq. (14)", "Z = H X + V", sp.Integer(0)),
        Printed("Eq. (15)", "Z = [dv_E dv_N dv_U dL dlambda dh]^T", sp.Integer(0)),
        Printed(
            "Eq. (16)", "H = [0_3x3 I_3x3 0_3x3 0_3x21; 0_3x3 0_3x3 I_3x3 0_3x21], 6 x 30",
            sp.Matrix.hstack(sp.zeros(6, 3), sp.eye(6), sp.zeros(6, 21)),
        ),
        Printed("Eq. (17)", "X_k = F_k/k-1 X_k-1 + Gamma_k/k-1 W_k-1, Z_k = H_k X_k + V_k", sp.Integer(0)),
        Printed("Eq. (18)", "X_k/k-1 = F_k/k-1 X_k-1", Phi * x, garbled="minus signs in indices are lost"),
        Printed("Eq. (19)", "P_k/k-1 = F P_k-1 F^T + Gamma Q Gamma^T", Phi * P * Phi.T + Gamma * Q * Gamma.T,
                garbled="minus signs in indices are lost"),
        Printed("Eq. (20)", "K_k = P_k/k-1 H^T (H P_k/k-1 H^T + R_k) 1", GAIN, garbled="the exponent -1 reads 1"),
        Printed("Eq. (21)", "X_k = X_k/k-1 + K_k (Z_k H_k X_k/k-1)", x + K * (z - (H * x)[0]), garbled=MINUS),
        Printed("Eq. (22)", "P_k = (I K_k H_k) P_k/k-1", (sp.eye(2) - GAIN * H) * P, garbled=MINUS),
        Printed("Eq. (23)", "sigma_k(j) = P_0(jj) P_k(jj)", sp.Integer(0)),
        Printed("Eq. (24)", "sigma_k(j) <= 1 unobservable, <= 2 low, <= 10 moderate, > 10 high", sp.Integer(0)),
    )
}  # fmt: skip


def _minus_g(rate: Any) -> Any:
    """Return gravity's error counted true minus computed."""
    return rate.subs(dict(zip(nav.DG, (-g for g in nav.DG), strict=True)), simultaneous=True)


@cache
def gain() -> Any:
    """Return the K that makes the trace of the covariance after the update least."""
    after = _after(K)
    slope = [sp.diff(after[0, 0] + after[1, 1], k) for k in K]
    return K.subs(sp.solve(slope, list(K), dict=True)[0])


def _after(K_: Any) -> Any:
    """Return the covariance after an update with any gain: of (1 - K H) (error before) - K (noise)."""
    remaining = sp.eye(2) - K_ * H
    return remaining * P * remaining.T + K_ * R * K_.T


def unbiased() -> Any:
    """Return a x + K z with the A that makes the error free of the true state, z = H x + noise."""
    A = sp.Matrix(2, 2, sp.symbols("A_:2:2", real=True))
    true = sp.Matrix(sp.symbols("t_1:3", real=True))
    bias = (A * true + K * (H * true)[0] - true).applyfunc(sp.expand)
    solved = sp.solve([b.coeff(s) for b in bias for s in true], list(A), dict=True)[0]
    return A.subs(solved) * x + K * z


def predicted() -> tuple[Any, Any]:
    """Return the mean and covariance of F x + Gamma w, w white with zero mean."""
    w = sp.Symbol("w", real=True)
    d = sp.Matrix(sp.symbols("d_1:3", real=True))
    state = Phi * (x + d) + Gamma * w
    mean = state.subs({w: 0, **dict.fromkeys(d, 0)})
    moments = {(0, 0): P[0, 0], (0, 1): P[0, 1], (1, 0): P[0, 1], (1, 1): P[1, 1]}
    error = (state - mean).applyfunc(sp.expand)
    by = [*d, w]

    def covariance(a: Any, b: Any) -> Any:
        return sum(a.coeff(by[i]) * b.coeff(by[j]) * (Q if i == j == 2 else moments.get((i, j), 0))
                   for i in range(3) for j in range(3))  # fmt: skip

    return mean, sp.Matrix(2, 2, lambda i, j: covariance(error[i], error[j]))


@cache
def cases() -> dict[str, Case]:
    """Return the derived forms of the items."""
    mean, covariance = predicted()
    best = gain()
    after = _after(best).applyfunc(sp.cancel)
    states = sp.Matrix([*nav.PHI, *nav.DV, *nav.DP, *STATES])
    observed = sp.Matrix([*nav.DV, *nav.DP])
    closed = sum(len(part) for part in (nav.PHI, nav.DV, nav.DP, STATES))
    return {
        "Eq. (9)": Case(
            nav.attitude_rate(),
            "With a minus in front it follows from the mechanisation; with none the Earth's rate turns the error the "
            "wrong way.",
        ),
        "Eq. (10)": Case(_minus_g(nav.velocity_rate()), "From the mechanisation; the sign of dg makes it true minus "
                         "computed."),
        "Eq. (11)": Case(nav.position_rate(), "From the mechanisation, radii held."),
        "Eq. (12)": Case(None, "The text leaves F to the reader: (9) to (11) with (7), (8)."),
        "Eq. (13)": Case(sp.Integer(closed), "Nine of navigation and the 21 of (7), (8)."),
        "Eq. (14)": Case(None, "An observation linear in the state."),
        "Eq. (15)": Case(None, "Velocity and position of a unit that stays where it is are known."),
        "Eq. (16)": Case(observed.jacobian(states), "Derivative of (15) by the states in the order of (13)."),
        "Eq. (17)": Case(None, "F now is the transition over a step."),
        "Eq. (18)": Case(mean, "White noise has no mean."),
        "Eq. (19)": Case(covariance, "Variances of the two independent parts."),
        "Eq. (20)": Case(best, "The gain that makes the trace of the covariance least."),
        "Eq. (21)": Case(unbiased(), "What is linear in prediction and datum and has no bias, whatever the gain."),
        "Eq. (22)": Case(after, "(1 - K H) P (1 - K H)^T + K R K^T with the gain of (20); with no other."),
        "Eq. (23)": Case(
            None,
            "The scan shows neither fraction bar nor root. Tables 2 and 3 decide for the root, a ratio of sigmas: were "
            "it a ratio of variances, residuals as small as Table 3's would have a probability of {chance:.0e}.",
            facts={"chance": chance_of_variances()},
            assumes="that the initial sigmas are not less than the errors that were there, the ideal values of Table 3",
        ),
        "Eq. (24)": Case(None, "Thresholds by experience."),
    }  # fmt: skip
