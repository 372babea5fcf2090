"""The paper's symbols, its Tables 2 and 3 as numbers, and the rotations everything is built from.

Frames: n north, east, down; b forward, right, down; p platform; a accelerometer axes; e Earth-fixed with z along the
pole and x in the meridian of the site. All rotations are of the frame (passive).

Wherever a difference Delta appears, the paper defines it twice: Eqs. (12)-(14) as truth minus estimate (section 4
observes |f|^2 - |f_hat|^2), Eq. (20) on as estimate minus truth (section 5 observes |f_hat|^2 - |f|^2). The symbols
below carry no sign of their own; each file says which reading it uses.
"""

from __future__ import annotations

import math
from typing import Any

import sympy as sp

from derivations.verdict import ARCSEC

SOURCE = "001"  # of errata.json

g, L, S_t = sp.symbols("g L S_t", positive=True)
h, q, psi, theta, phi = sp.symbols("h q psi theta phi", real=True)

# Delta SF_i / SF_i, nabla_i (bias, an acceleration), Delta beta_ij
SCALE = sp.symbols("sigma_x sigma_y sigma_z", real=True)
BIAS = sp.symbols("nabla_x nabla_y nabla_z", real=True)
BETA = sp.symbols("beta_xy beta_xz beta_yz beta_yx beta_zx beta_zy", real=True)
sigma_x, sigma_y, sigma_z = SCALE
nabla_x, nabla_y, nabla_z = BIAS
beta_xy, beta_xz, beta_yz, beta_yx, beta_zx, beta_zy = BETA
RESIDUALS = (*SCALE, *BIAS, *BETA)  # the twelve residual parameters of section 5

LATITUDE = math.radians(40)  # section 6.1
G_NORMAL = 9.80169  # m/s^2, WGS-84 normal gravity at 40 deg, height 0 (tests compare it with gimbalcal.earth)
TABLE_2 = {sigma_x: 1e-4, sigma_y: 2e-4, sigma_z: -1e-4, nabla_x: -1e-3, nabla_y: 5e-4, nabla_z: 1e-3}  # -, m/s^2
TABLE_3 = {
    symbol: arcseconds * ARCSEC
    for symbol, arcseconds in (
        (beta_xz, 5), (beta_yz, 10), (beta_zy, -5), (beta_xy, -10), (beta_yx, 5), (beta_zx, -5),
    )
}  # fmt: skip
NUMBERS: dict[Any, float] = {**TABLE_2, **TABLE_3, L: LATITUDE, g: G_NORMAL}
TURN = tuple({S_t: 2 * math.pi * k / 24} for k in range(24))  # one sidereal day, hour by hour


def Rx(a: Any) -> Any:
    """Return components in a frame turned by a about x."""
    return sp.Matrix([[1, 0, 0], [0, sp.cos(a), sp.sin(a)], [0, -sp.sin(a), sp.cos(a)]])


def Ry(a: Any) -> Any:
    """Return components in a frame turned by a about y."""
    return sp.Matrix([[sp.cos(a), 0, -sp.sin(a)], [0, 1, 0], [sp.sin(a), 0, sp.cos(a)]])


def Rz(a: Any) -> Any:
    """Return components in a frame turned by a about z."""
    return sp.Matrix([[sp.cos(a), sp.sin(a), 0], [-sp.sin(a), sp.cos(a), 0], [0, 0, 1]])


def harmonics(expr: Any) -> dict[str, Any]:
    """Return the Fourier coefficients over one turn of S_t: "mean", "1c", "1s", "2c", "2s".

    Exact for polynomials in cos S_t and sin S_t up to degree five: there the sum over eight angles is the integral.
    """
    angles = [k * sp.pi / 4 for k in range(8)]
    values = [sp.expand(expr.subs(S_t, a)) for a in angles]

    def projection(weight: Any) -> Any:
        return sp.simplify(sp.expand(sum(weight.subs(S_t, a) * v for a, v in zip(angles, values, strict=True)) / 4))

    return {
        "mean": projection(sp.Rational(1, 2)),
        "1c": projection(sp.cos(S_t)),
        "1s": projection(sp.sin(S_t)),
        "2c": projection(sp.cos(2 * S_t)),
        "2s": projection(sp.sin(2 * S_t)),
    }
