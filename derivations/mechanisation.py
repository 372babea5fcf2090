r"""Inertial navigation in east, north, up: the equations, their first-order errors in symbols, and again in numbers.

True:      C_dot = C [w_ib x] - [w_in x] C,   V_dot = C f - (2 w_ie + w_en) x V + g,
           L_dot = V_N / (R_M + h),   lambda_dot = V_E / ((R_N + h) cos L),   h_dot = V_U.

The computer solves the same equations with what it has. Its attitude is D C with D = 1 - [phi x], so

    D_dot = D [C dw_ib x] - [w_in' x] D + D [w_in x],

and everything else is counted computed minus true. `blocks` differentiates the equations in symbols with the radii and
gravity held; `linearised` does it in numbers (complex steps) on WGS-84 with both moving, or held.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import sympy as sp

from derivations.cross import cross, cross_of_numbers
from derivations.wang2019.navigation import R_M, R_N, V, earth_rate, h, transport_rate
from derivations.wang2019.navigation import e as step
from derivations.wang2019.symbols import L

longitude = sp.Symbol("lambda", real=True)
POSITION = (L, longitude, h)
PHI = sp.symbols("phi_E phi_N phi_U", real=True)
DV = sp.symbols("dV_E dV_N dV_U", real=True)
DP = sp.symbols("dL dlambda dh", real=True)
DW = sp.symbols("dw_E dw_N dw_U", real=True)  # error of the rate C dw_ib^b
DF = sp.symbols("df_E df_N df_U", real=True)  # error of the force C df^b
DG = sp.symbols("dg_E dg_N dg_U", real=True)  # gravity as computed less true
F_N = sp.symbols("f_E f_N f_U", real=True)
ERRORS = {"phi": PHI, "V": DV, "P": DP}

A, FLATTENING, GAMMA_E, K_SOMIGLIANA, OMEGA, M_RATIO = (
    6378137.0, 1 / 298.257223563, 9.7803253359, 0.00193185265241, 7.292115e-5, 0.00344978650684
)  # WGS-84  # fmt: skip
E2 = FLATTENING * (2 - FLATTENING)


def _computed(expr: Any) -> Any:
    """Return the same quantity at the computed velocity and position."""
    moved = dict(zip((*V, *POSITION), (x + step * d for x, d in zip((*V, *POSITION), (*DV, *DP), strict=True)),
                     strict=True))  # fmt: skip
    return expr.subs(moved, simultaneous=True)


def _linear(expr: Any) -> Any:
    """Return the first order in the errors, which stand with `step`."""
    return expr.applyfunc(lambda x: sp.diff(x, step).subs(step, 0))


@cache
def attitude_rate() -> Any:
    """Return phi_dot, linear in the errors."""
    w_in = earth_rate() + transport_rate(h)
    D = sp.eye(3) - step * cross(PHI)
    D_dot = D * step * cross(DW) - cross(_computed(w_in)) * D + D * cross(w_in)
    rate = -_linear(D_dot)
    return sp.Matrix([rate[2, 1], rate[0, 2], rate[1, 0]]).applyfunc(sp.expand)


@cache
def velocity_rate() -> Any:
    """Return dV_dot, linear in the errors."""
    V_true, f = sp.Matrix(V), sp.Matrix(F_N)
    turning = 2 * earth_rate() + transport_rate(h)
    force = (sp.eye(3) - step * cross(PHI)) * f + step * sp.Matrix(DF)
    return _linear(force - _computed(turning).cross(V_true + step * sp.Matrix(DV)) + step * sp.Matrix(DG))


@cache
def position_rate() -> Any:
    """Return dP_dot, linear in the errors."""
    rate = sp.Matrix([V[1] / (R_M + h), V[0] / ((R_N + h) * sp.cos(L)), V[2]])
    return _linear(_computed(rate))


@cache
def blocks() -> dict[str, Any]:
    """Return F11 ... F33 in symbols: rows attitude, velocity, position; columns the same."""
    rates = (attitude_rate(), velocity_rate(), position_rate())
    return {f"F{i}{j}": rate.jacobian(errors).applyfunc(sp.factor_terms)
            for i, rate in enumerate(rates, start=1) for j, errors in enumerate(ERRORS.values(), start=1)}  # fmt: skip


def radii(latitude: Any) -> tuple[Any, Any]:
    """Return R_M, R_N [m]."""
    w = 1 - E2 * np.sin(latitude) ** 2
    return A * (1 - E2) / w**1.5, A / w**0.5


def gravity(latitude: Any, height: Any) -> Any:
    """Return the normal gravity [m/s^2], to second order in height."""
    s2 = np.sin(latitude) ** 2
    g = GAMMA_E * (1 + K_SOMIGLIANA * s2) / np.sqrt(1 - E2 * s2)
    return g * (1 - 2 * (1 + FLATTENING + M_RATIO - 2 * FLATTENING * s2) * height / A + 3 * height**2 / A**2)


def earth_in_n(latitude: Any) -> Any:
    """Return the rate of the Earth [rad/s] in east, north, up."""
    return OMEGA * np.array([0 * latitude, np.cos(latitude), np.sin(latitude)])


def _transport(velocity: Any, latitude: Any, height: Any, R: tuple[Any, Any]) -> Any:
    E = velocity[0] / (R[1] + height)
    return np.array([-velocity[1] / (R[0] + height), E, E * np.tan(latitude)])


def _rates(x: Any, at: Any, force: Any, held: bool) -> Any:
    """Return rates (9,) of attitude error, velocity, position in the state at + x, x (15,) with dw, df last."""
    phi, (v, p) = x[:3], np.split(at + x[3:9], 2)
    R = radii(at[3] if held else p[0])
    w_in = earth_in_n(p[0]) + _transport(v, p[0], p[2], R)
    true = earth_in_n(at[3]) + _transport(at[:3], at[3], at[5], radii(at[3]))
    D = np.eye(3) - cross_of_numbers(phi)
    D_dot = D @ cross_of_numbers(x[9:12]) - cross_of_numbers(w_in) @ D + D @ cross_of_numbers(true)
    g = gravity(at[3], at[5]) if held else gravity(p[0], p[2])
    a = D @ force + x[12:] - np.cross(w_in + earth_in_n(p[0]), v) + np.array([0 * g, 0 * g, -g])
    ground = np.array([v[1] / (R[0] + p[2]), v[0] / ((R[1] + p[2]) * np.cos(p[0])), v[2]])
    return np.concatenate([-np.array([D_dot[2, 1], D_dot[0, 2], D_dot[1, 0]]), a, ground])


def linearised(at: Any, force: Any, held: bool = True) -> Any:
    """Return (9, 15) derivatives of the rates by phi, velocity, position, C dw_ib, C df; exact to rounding.

    at (6,): velocity ENU [m/s], latitude, longitude [rad], height [m]; force (3,) in n [m/s^2]. held: radii and gravity
    as they are at the true position, the errors of both left out.
    """
    unit = 1e-30j * np.eye(15)
    return np.stack([_rates(e, np.asarray(at, float), np.asarray(force, float), held).imag / 1e-30 for e in unit], -1)


def true_rates(at: Any, C: Any, rate: Any, force: Any) -> tuple[Any, Any, Any]:
    """Return C_dot (3, 3), V_dot (3,), rates (3,) of latitude, longitude, height: the equations themselves.

    at (6,) as in `linearised`; C: C_b^n; rate, force (3,) in b.
    """
    v, p = np.asarray(at[:3], float), np.asarray(at[3:], float)
    R = radii(p[0])
    w_en = _transport(v, p[0], p[2], R)
    w_in = earth_in_n(p[0]) + w_en
    fall = np.array([0, 0, -float(gravity(p[0], p[2]))])
    C_dot = C @ cross_of_numbers(np.asarray(rate, float)) - cross_of_numbers(w_in) @ C
    V_dot = C @ force - np.cross(w_in + earth_in_n(p[0]), v) + fall
    return C_dot, V_dot, np.array([v[1] / (R[0] + p[2]), v[0] / ((R[1] + p[2]) * np.cos(p[0])), v[2]])
