"""Eqs. (9) to (16): what the nonlinear terms do to a navigator.

Computed quantities are C' = (1 - [phi x]) C, V' = V + dV, f' = f + df and so on. To first order

    V_dot = f^n - (2 w_ie + w_en) x V + g    gives
    dV_dot = f x phi + dV x (2 w_ie + w_en) + V x (2 dw_ie + dw_en) + df
    C_dot = C [w_ib x] - [w_in x] C          gives
    phi_dot = phi x w_in + dw_in - dw_ib^n

(gravity as computed; its error belongs to the vertical channel). Both are linear in the errors, so they hold for
errors counted as computed minus true as well as true minus computed. Eqs. (13) to (16) need the second: a navigator
that leaves K2 and K3 out computes too little by exactly those terms.
"""

from __future__ import annotations

from functools import cache
from math import pi
from typing import Any

import sympy as sp

from derivations.cross import cross
from derivations.verdict import APPROXIMATION, Case, Printed, truncate
from derivations.wang2019.symbols import K2, K3, E, L, N, omega_ie, triangle


def _vector(name: str) -> Any:
    return sp.Matrix(sp.symbols(" ".join(f"{name}_{a}" for a in "ENU"), real=True))


f, phi, V, dV, w_ie, w_en, dw_ie, dw_en, df, dw_ib = (
    _vector(n) for n in ("f", "phi", "V", "dV", "w_ie", "w_en", "dw_ie", "dw_en", "df", "dw_ib")
)
e = sp.Symbol("e")
R_M, R_N = sp.symbols("R_M R_N", positive=True)
h, dL = sp.symbols("h delta_L", real=True)
C_bn = sp.Matrix(3, 3, sp.symbols("c_:3:3", real=True))
EARTH, RADIUS, GRAVITY = 7.292115e-5, 6.371e6, 9.8
ERRORS = (*phi, *dV, *K2, *K3, dL)


def first_order(expr: Any) -> Any:
    """Return the coefficient of e."""
    return expr.applyfunc(lambda x: sp.expand(sp.diff(sp.expand(x), e).subs(e, 0)))


@cache
def velocity_error() -> Any:
    """Return dV_dot of the computed equation less the true one."""

    def acceleration(s: Any) -> Any:
        force = (sp.eye(3) - s * cross(phi)) * (f + s * df)
        turn = 2 * (w_ie + s * dw_ie) + w_en + s * dw_en
        return force - turn.cross(V + s * dV)

    return first_order(acceleration(e) - acceleration(0))


@cache
def attitude_error() -> Any:
    """Return phi_dot from C' = (1 - e [phi x]) C at an instant at which b and n coincide."""
    w_ib, w_in = sp.Matrix(sp.symbols("w_x w_y w_z", real=True)), w_ie + w_en
    C_dot = cross(w_ib) - cross(w_in)
    C_of = sp.eye(3) - e * cross(phi)
    computed = C_of * cross(w_ib + e * dw_ib) - cross(w_in + e * (dw_ie + dw_en)) * C_of
    # e-part of d/dt[(1 - e [phi x]) C] = -[phi_dot x] - [phi x] C_dot
    S = -(first_order(computed) + cross(phi) * C_dot)
    return sp.Matrix([S[2, 1], S[0, 2], S[1, 0]]).applyfunc(sp.expand)


@cache
def pole() -> Any:
    """Return the Earth's axis in east, north, up: from the position on a sphere and its derivatives."""
    longitude = sp.Symbol("lambda", real=True)
    up = sp.Matrix([sp.cos(L) * sp.cos(longitude), sp.cos(L) * sp.sin(longitude), sp.sin(L)])
    north, east = up.diff(L), up.diff(longitude) / sp.cos(L)
    return sp.Matrix([axis[2] for axis in (east, north, up)])


def earth_rate() -> Any:
    return omega_ie * pole()


def transport_rate(height: Any) -> Any:
    """Return the longitude turns n about the pole, latitude about west."""
    longitude = V[0] / ((R_N + height) * sp.cos(L))
    return longitude * pole() - V[1] / (R_M + height) * sp.Matrix([1, 0, 0])


def omitted_force() -> Any:
    """Return K2 N^2 + K3 N^3 along the axes."""
    return sp.Matrix([K2[i] * N[i] ** 2 + K3[i] * N[i] ** 3 for i in range(3)])


def omitted_rate() -> Any:
    return sp.Matrix([K2[i] * N[i] ** 2 for i in range(3)])


def at_rest(expr: Any) -> Any:
    """Return V = 0, so w_en = 0; w_ie and the errors of the two rates as functions of position and velocity errors."""
    dw = sp.diff(earth_rate(), L) * dL
    dw_transport = transport_rate(0).subs(dict(zip(V, dV, strict=True)))
    known = {**dict(zip(V, (0, 0, 0), strict=True)), **dict(zip(w_en, (0, 0, 0), strict=True)),
             **dict(zip(w_ie, earth_rate(), strict=True)), **dict(zip(dw_ie, dw, strict=True)),
             **dict(zip(dw_en, dw_transport, strict=True))}  # fmt: skip
    return expr.subs(known).applyfunc(sp.expand)


def _printed_9(force: Any) -> Any:
    return f.cross(phi) + dV.cross(2 * w_ie + w_en) + V.cross(2 * dw_ie + dw_en) + force


def _printed_10(rate: Any) -> Any:
    return phi.cross(w_ie + w_en) + dw_ie + dw_en - rate


PRINTED = {
    p.item: p
    for p in (
        Printed("Eq. (9)", "dV_dot = f x phi + dV x (2 w_ie + w_en) + V x (2 dw_ie + dw_en) + df", _printed_9(df)),
        Printed("Eq. (10)", "phi_dot = phi x (w_ie + w_en) + dw_ie + dw_en - dw_ib", _printed_10(dw_ib)),
        Printed(
            "Eq. (11)",
            "w_ie^n = [0, w_ie cos L, w_ie sin L]^T",
            sp.Matrix([0, omega_ie * sp.cos(L), omega_ie * sp.sin(L)]),
        ),
        Printed(
            "Eq. (12)",
            "w_en^n = [-V_N/R_M, V_E/R_N, V_E/R_N tan L]^T",
            sp.Matrix([-V[1] / R_M, V[0] / R_N, V[0] / R_N * sp.tan(L)]),
        ),
        Printed("Eq. (13)", "dV_dot = ... + C_b^n (K_a2 N^a(2) + K_a3 N^a(3))", _printed_9(C_bn * omitted_force())),
        Printed("Eq. (14)", "phi_dot = ... - C_b^n K_g2 N^g(2)", _printed_10(C_bn * omitted_rate())),
        Printed(
            "Eq. (15)",
            "dV_dot = f x phi + C_b^n (K_a2 N^a(2) + K_a3 N^a(3))",
            f.cross(phi) + C_bn * omitted_force(),
        ),
        Printed(
            "Eq. (16)",
            "phi_dot = phi x w_ie - C_b^n K_g2 N^g(2)",
            phi.cross(earth_rate()) - C_bn * omitted_rate(),
        ),
    )
}

NUMBERS: dict[Any, float] = {
    **dict.fromkeys((*f, *V, *w_en, *dw_ie, *dw_en), 0.0), **dict.fromkeys(w_ie, EARTH), f[2]: GRAVITY,
    **dict.fromkeys(phi, 1e-4), **dict.fromkeys(dV, 1.0), **dict.fromkeys(K2, 1e-3), **dict.fromkeys(K3, 0.0),
    **dict.fromkeys(N, 1.0), **dict.fromkeys(C_bn, 0.0), **dict.fromkeys(E, 5e-4), omega_ie: EARTH, L: pi / 6,
    R_M: RADIUS, R_N: RADIUS, dL: 1e-5, h: 100.0,
} | {C_bn[i, i]: 1.0 for i in range(3)}  # fmt: skip


def growth(hours: float) -> float:
    """Return the position error of a constant gyro error without Schuler's feedback over that with it (one axis, from
    rest).

    Without: g eps t^3 / 6. With: eps R (t - sin(w t) / w), w^2 = g / R.
    """
    from math import sin, sqrt

    t, w = 3600 * hours, sqrt(GRAVITY / RADIUS)
    return (GRAVITY * t**3 / 6) / (RADIUS * (t - sin(w * t) / w))


@cache
def cases() -> dict[str, Case]:
    """Return the derived forms of the items."""
    force = C_bn * triangle() * omitted_force()
    rate = C_bn * triangle() * omitted_rate()
    sign = (
        "Right when errors are true minus computed (the terms that the navigator leaves out enter with plus here and "
        "minus there); (9) and (10) are linear and hold for that sign too. The misalignment between the axes and the "
        "orthogonal frame is dropped, {size}."
    )
    at_rest_force = at_rest(_printed_9(force))
    at_rest_rate = at_rest(_printed_10(rate))
    return {
        "Eq. (9)": Case(
            velocity_error(),
            "First order of the velocity equation, gravity as computed; n' = (1 - [phi x]) n.",
        ),
        "Eq. (10)": Case(attitude_error(), "First order of the attitude equation with the same phi."),
        "Eq. (11)": Case(earth_rate(), "The Earth turns about the pole, which lies L above north."),
        "Eq. (12)": Case(
            truncate(transport_rate(h), (h,), 1).applyfunc(sp.simplify),
            "Right at height zero; the radii stand for R + h ({size} rad/s at 100 m and 1 m/s). The sentence below "
            "it calls "
            "both radii meridian; R_N is that of the prime vertical.",
            small=(h,),
            at={**NUMBERS, **dict.fromkeys(V, 1.0)},
        ),
        "Eq. (13)": Case(_printed_9(force), sign, small=E, at=NUMBERS),
        "Eq. (14)": Case(_printed_10(rate), sign, small=E, at=NUMBERS),
        "Eq. (15)": Case(
            at_rest_force,
            "Drops the Coriolis term of the velocity error, 2 w_ie x dV, which is second order in (errors, Earth "
            "rate): "
            "{size} m/s^2 at an error of 1 m/s.",
            small=(*ERRORS, omega_ie, *E),
            at=NUMBERS,
        ),
        "Eq. (16)": Case(
            at_rest_rate,
            "At rest V is zero but its error is not: dw_en = dV/R ({size} rad/s at 1 m/s) is larger than the term "
            "phi x w_ie that is kept, and it is what turns growth into Schuler's oscillation. Without it a constant "
            "gyroscope error carries position off {one:.1f} times too far after 1 h and {three:.0f} times after 3.2 "
            "h. It "
            "holds for some minutes. The package propagates with the feedback.",
            small=(*ERRORS, omega_ie, *E),
            at={**NUMBERS, **dict.fromkeys(K2, 1e-9)},
            facts={"one": growth(1.0), "three": growth(3.2)},
            reading=(
                "that velocity and position are still free of errors, as in the first minutes",
                lambda d: d.subs(dict.fromkeys((*dV, dL, *E), 0)),
                APPROXIMATION,
            ),
        ),
    }
