"""Eqs. (26) to (35): turning both ways.

With S, S2 the integrals of N and N^2 over a turn, W that of the Earth's rate in q and theta that of the turn, Eq. (6)
integrated over a turn and over its reverse gives (27) and (28), the noise aside. Bias and Earth cancel in the
difference (29) when both pass the same attitudes (whole revolutions, or the same arc back).

In Eq. (30) N^2 enters only as the difference of its integrals over the two senses: small, as `differences` shows, but
there. Their sum holds 2 w^2 / K1^2: that is where the package takes K2 from.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import sympy as sp

from derivations.cross import cross
from derivations.verdict import Case, Printed
from derivations.wang2019 import differences
from derivations.wang2019.symbols import (
    BIAS,
    K1,
    K2,
    E,
    E_yx,
    E_zx,
    E_zy,
    L,
    integral,
    norm_after_rotation,
    omega_ie,
    polynomial,
    rotation,
    square,
    triangle,
)


def _triple(name: str) -> Any:
    return sp.symbols(" ".join(f"{name}_{a}" for a in "xyz"), real=True)


S_cw, S2_cw, S_ccw, S2_ccw = (_triple(n) for n in ("S+", "S2+", "S-", "S2-"))
S, S2 = _triple("S"), _triple("S2")  # N_sum and N_sum^(2)
W, theta, w_e, w_r, w_iq = (sp.Matrix(_triple(n)) for n in ("W", "theta", "w_ie", "w_r", "w_iq"))
psi_q, psi_g = _triple("psiq"), _triple("psig")
t, angle = sp.symbols("t theta", positive=True)
UNKNOWNS = (*K1, *K2, *E)


def integrated(first: Any, second: Any) -> Any:
    """Return C (K1 S + K2 S2 + bias t)."""
    return triangle() * sp.Matrix([K1[i] * first[i] + K2[i] * second[i] + BIAS[i] * t for i in range(3)])


def turned() -> Any:
    """Return psi^q = C (K1 S + K2 S2)."""
    return triangle() * sp.Matrix([K1[i] * S[i] + K2[i] * S2[i] for i in range(3)])


def P() -> Any:
    return square(turned()) - (2 * angle) ** 2


@cache
def derivatives() -> Any:
    """Return all nine by the chain rule; each is checked against the derivative of P itself."""
    back = triangle().T * sp.Matrix(psi_q)
    by = {K1[i]: 2 * back[i] * S[i] for i in range(3)} | {K2[i]: 2 * back[i] * S2[i] for i in range(3)}
    by |= {E_yx: 2 * psi_q[1] * psi_g[0], E_zx: 2 * psi_q[2] * psi_g[0], E_zy: 2 * psi_q[2] * psi_g[1]}
    inner = [K1[i] * S[i] + K2[i] * S2[i] for i in range(3)]
    full = {**dict(zip(psi_q, turned(), strict=True)), **dict(zip(psi_g, inner, strict=True))}
    for symbol, short in by.items():
        if sp.expand(short.subs(full) - sp.diff(P(), symbol)) != 0:
            raise ArithmeticError(f"the chain rule and the derivative of P by {symbol} differ")
    return by


def exact(*wanted: Any) -> Any:
    return sp.Matrix([derivatives()[s] for s in wanted])


def printed_expansion() -> Any:
    """Return Eq. (31) as its second line prints it."""
    (Sx, Sy, Sz), (Qx, Qy, Qz) = S, S2
    x = K1[0] * Sx + K2[0] * Qx
    y = E_yx * K1[0] * Sx + K1[1] * Sy + E_yx * K2[0] * Qx + K2[1] * Qy
    z = E_zx * K1[0] * Sx + E_zy * K1[1] * Sy + K1[2] * Sz + E_zx * K2[0] * Qx + E_zy * K2[1] * Qy + K2[2] * Qz
    return x**2 + y**2 + z**2 - (2 * angle) ** 2


def _vee(skew: Any) -> Any:
    return sp.Matrix([skew[2, 1], skew[0, 2], skew[1, 0]])


def rates_of_a_product() -> Any:
    """Return w_iq^q of C_i^q = C_e^q C_i^e, from C_dot = -[w x] C of each factor: the rates, not assumed to add.

    C_i^e is taken at an instant at which i and e coincide; w_ie is given in q.
    """
    C_eq = rotation()
    rate_in_e = C_eq.T * w_e
    C_dot = -cross(w_r) * C_eq - C_eq * cross(rate_in_e)
    return _vee(-C_dot * C_eq.T).applyfunc(lambda x: sp.cancel(sp.together(x)))


def earth_over_a_turn(sense: int) -> Any:
    """Return the integral of the Earth's rate in q over a whole revolution about z, per radian turned."""
    a = sp.Symbol("a", real=True)
    c, s = sp.cos(a), sense * sp.sin(a)
    inward = sp.Matrix([[c, s, 0], [-s, c, 0], [0, 0, 1]])
    return (inward * w_e).applyfunc(lambda x: sp.integrate(x, (a, 0, 2 * sp.pi)))


@cache
def over_a_turn() -> tuple[Any, Any]:
    """Return Eq. (6) integrated over the turn and over its reverse, less what it must equal by (26)."""
    rate = triangle() * polynomial(2)
    return integral(rate, S_cw, S2_cw, t) - (W + theta), integral(rate, S_ccw, S2_ccw, t) - (W - theta)


@cache
def difference() -> Any:
    """Return (27) less (28); the Earth's two integrals are one symbol because a whole turn makes them equal."""
    if earth_over_a_turn(1) != earth_over_a_turn(-1):
        raise ArithmeticError("the Earth's rate over a turn and over its reverse differ")
    one, other = over_a_turn()
    return (one - other).applyfunc(sp.expand)


@cache
def norm_of_difference() -> Any:
    """Return P of (31): the squared norm of what (29) turns, less that of 2 theta about any axis."""
    sums = dict(zip((*S_cw, *S2_cw), (*S, *S2), strict=True)) | dict.fromkeys((*S_ccw, *S2_ccw), sp.Integer(0))
    remaining = (difference() + 2 * theta).subs(sums)
    return square(remaining) - norm_after_rotation(sp.Matrix([0, 0, 2 * angle]))


@cache
def earth_squared() -> Any:
    """Return the squared norm of the Earth's rate in any frame."""
    return sp.simplify(norm_after_rotation(omega_ie * sp.Matrix([0, sp.cos(L), sp.sin(L)])))


DIFFERENCE = {s: a - b for s, a, b in zip((*S, *S2), (*S_cw, *S2_cw), (*S_ccw, *S2_ccw), strict=True)}

PRINTED = {
    p.item: p
    for p in (
        Printed("Eq. (26)", "w_iq^q = w_ie^q + w_r^q", w_e + w_r),
        Printed("Eq. (27)",
                "C int_0^t1 (K1 N+ + K2 N(2)+ + eps + v) = int w_ie + int w_r", integrated(S_cw, S2_cw) - W - theta),
        Printed("Eq. (28)",
                "C int_0^t2 (K1 N- + K2 N(2)- + eps + v) = int w_ie - int w_r", integrated(S_ccw, S2_ccw) - W + theta),
        Printed(
            "Eq. (29)",
            "C K1 int (N+ - N-) + C K2 int (N(2)+ - N(2)-) = 2 theta",
            turned().subs(DIFFERENCE) - 2 * theta,
        ),
        Printed("Eq. (30)", "min 1/2 sum || ||C K1 N_sum + C K2 N_sum(2)||^2 - ||2 theta||^2 ||^2", P() ** 2 / 2),
        Printed("Eq. (30), K_g2", "min over K_g1, K_g2, C_g^q", sp.Integer(len(UNKNOWNS))),
        Printed("Eq. (31)", "P = (K_g1x N_sumx + ...)^2 + (...)^2 + (...)^2 - ||2 theta||^2", printed_expansion(),
                garbled="a closing bracket stands twice in the second term"),
        Printed("Eq. (32)", "dP/dK_g1i = 2 psi^q_i N_sumi", sp.Matrix([2 * psi_q[i] * S[i] for i in range(3)])),
        Printed("Eq. (33)", "dP/dK_g2i = 2 psi^q_i N_sumi(2)", sp.Matrix([2 * psi_q[i] * S2[i] for i in range(3)])),
        Printed(
            "Eq. (34)",
            "dP/dE_gyx = 2 psi^q_y psi^g_x, dP/dE_gzx = 2 psi^q_z psi^g_x, dP/dE_gzy = 2 psi^q_z psi^g_y",
            sp.Matrix([2 * psi_q[1] * psi_g[0], 2 * psi_q[2] * psi_g[0], 2 * psi_q[2] * psi_g[1]]),
        ),
        Printed(
            "Eq. (35)",
            "min over eps of 1/2 sum || ||C (K1 N_i + K2 N_i(2) + eps)||^2 - ||w_ie||^2 ||^2",
            (square(triangle() * polynomial(2)) - omega_ie**2) ** 2 / 2,
        ),
    )
}  # fmt: skip


@cache
def cases() -> dict[str, Case]:
    """Return the derived forms of the items."""
    at = {**dict.fromkeys((*psi_q, *psi_g, *S, *S2), 1.0), **dict.fromkeys(E, 5e-4)}
    dropped = (
        "First order in E: the other axes' share is dropped, {size} of the sensitivity at E = 5e-4. The package keeps "
        "it."
    )
    one, other = over_a_turn()
    rank, without = differences.ranks()
    weak, tail = differences.conditions()
    return {
        "Eq. (26)": Case(rates_of_a_product(), "The rate of a product of two turning matrices is the sum."),
        "Eq. (27)": Case(one, "The integral of (6) over the turn, the bias constant."),
        "Eq. (28)": Case(
            other,
            "The same over the turn back. The Earth's integral is that of (27) only if the same attitudes are "
            "passed: a whole "
            "revolution, or the same arc back; the paper does not say so.",
        ),
        "Eq. (29)": Case(
            difference(),
            "(27) less (28) for equal times: bias and Earth cancel, the Earth because its integral over a whole turn "
            "is the same both ways.",
        ),
        "Eq. (30)": Case(
            norm_of_difference() ** 2 / 2, "The norm of (29), which needs no direction of theta: whole turns, any axis."
        ),
        "Eq. (30), K_g2": Case(
            sp.Integer(rank),
            "The nine unknowns have rank {rank} of 9 with the Earth's rate, bias and K_g2 itself in the readings "
            "({without} without all three, where the integrals of N^2 cancel), but are ill-conditioned: at 10 deg/s "
            "sigma(K_g2) over its range of 5e-17 is {weak:.0e} times sigma(K_g1) / K_g1 in the median run, {tail:.0f} "
            "times that in one of a hundred, since the column of K_g2 passes through zero where K_g2 w^2 / K_g1^2 "
            "equals Earth less bias. The sum of the two senses holds K_g2 in full; the package uses it.",
            facts={"rank": rank, "without": without, "weak": weak, "tail": tail},
        ),
        "Eq. (31)": Case(norm_of_difference(), "The norm of (29) multiplied out."),
        "Eq. (32)": Case(exact(*K1), dropped + " The last component is exact.", small=E, at=at),
        "Eq. (33)": Case(exact(*K2), dropped + " The last component is exact.", small=E, at=at),
        "Eq. (34)": Case(exact(*E), "Exact: only row j of C_g^q holds E_jk."),
        "Eq. (35)": Case(
            (square(triangle() * polynomial(2)) - earth_squared()) ** 2 / 2,
            "At rest the only rate is the Earth's, whose norm is the same at any attitude. Headings, which Figure 2 "
            "does not "
            "show, decide how well: three that put the Earth's rate across one another are the least.",
        ),
    }  # fmt: skip
