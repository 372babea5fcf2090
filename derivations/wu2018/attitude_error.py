r"""Eqs. (28) to (38): what the navigator says about a base that stands still.

Exact definition. The navigator takes down from the measured force, north from the platform's polar axis, and the base
from the gimbal readouts:

    down = -f_hat / |f_hat|,  east = down x pole / |..|,  north = east x down,
    C_b^n = C_p^n(f_hat) C_b^p(readouts).

The attitude error is the attitude of the still, level base minus this output, as a small rotation about north, east,
down (roll, pitch, yaw when the base heads north). Everything is expanded to first order in the force error Delta f^e
(estimate minus truth, Earth-fixed axes), the readout errors delta S_t, delta h, delta q (readout minus truth), the
tilts delta kappa of the base about its own axes, and the drift Delta S_1 of the platform about x^e, the equatorial axis
in the meridian, which the paper does not define but whose coefficient identifies it.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import sympy as sp

from derivations.cross import cross
from derivations.verdict import Case, Printed
from derivations.wu2018.static_force import force, force_error
from derivations.wu2018.symbols import (
    BETA,
    BIAS,
    NUMBERS,
    RESIDUALS,
    SCALE,
    TURN,
    L,
    Ry,
    Rz,
    S_t,
    g,
    harmonics,
    psi,
)

sigma_x, sigma_y, sigma_z = SCALE
nabla_x, nabla_y, nabla_z = BIAS
beta_xy, beta_xz, beta_yz, beta_yx, beta_zx, beta_zy = BETA
S, C = sp.sin(L), sp.cos(L)
df = sp.symbols("Df^e_x Df^e_y Df^e_z", real=True)  # over g
dS_t, dh, dq = sp.symbols("dS_t dh dq", real=True)
kappa = sp.symbols("kappa_x kappa_y kappa_z", real=True)
dS_1 = sp.Symbol("DS_1", real=True)
e = sp.Symbol("e")
DISTURBANCES = (*df, dS_t, dh, dq, *kappa, dS_1)
kx, ky, kz = kappa

TILT = (dS_t * C + kx * sp.cos(psi) - ky * sp.sin(psi), -dh + kx * sp.sin(psi) + ky * sp.cos(psi))
RIGHT_28 = sp.Matrix(
    [
        df[1] - TILT[0],
        df[0] * S - df[2] * C - TILT[1],
        -dS_1 / C - df[1] * sp.tan(L) - (dq - dS_t * S + kz),
    ]
)
HALF_DIFFERENCE = sigma_x / 2 - sigma_y / 2

PRINTED = {
    p.item: p
    for p in (
        Printed(
            "Eq. (28)",
            "(dphi, dtheta, dpsi) = (Df_y^e/g, (Df_x^e sin L - Df_z^e cos L)/g, -DS_1/cos L - Df_y^e/g tan L) - "
            "(dS_t cos L + dk_x cos psi - dk_y sin psi, -dh + dk_x sin psi + dk_y cos psi, dq - dS_t sin L + dk_z)",
            RIGHT_28,
        ),
        Printed(
            "Eq. (29)",
            "mean dtheta = -(-dh + dk_x sin psi + dk_y cos psi) "
            "+ [nabla_z/g - (DSF_z/SF_z - DSF_x/2SF_x - DSF_y/2SF_y) sin L] cos L",
            -TILT[1] + (nabla_z / g - (sigma_z - sigma_x / 2 - sigma_y / 2) * S) * C,
        ),
        Printed(
            "Eq. (30)",
            "dtheta_1c = -(nabla_x/g sin L - Dbeta_xy sin^2 L - Dbeta_zy cos^2 L)",
            -(nabla_x / g * S - beta_xy * S**2 - beta_zy * C**2),
        ),
        Printed(
            "Eq. (31)",
            "dtheta_1s = -(nabla_y/g sin L + Dbeta_yx sin^2 L + Dbeta_zx cos^2 L)",
            -(nabla_y / g * S + beta_yx * S**2 + beta_zx * C**2),
        ),
        Printed("Eq. (32)", "dtheta_2c = (DSF_x/2SF_x - DSF_y/2SF_y) sin L cos L", HALF_DIFFERENCE * S * C),
        Printed("Eq. (33)", "dtheta_2s = (Dbeta_yz/2 - Dbeta_xz/2) sin L cos L", (beta_yz - beta_xz) / 2 * S * C),
        Printed(
            "Eq. (34)",
            "mean dphi = -(dS_t cos L + dk_x cos psi - dk_y sin psi) + (Dbeta_yz/2 + Dbeta_xz/2) cos L",
            -TILT[0] + (beta_yz + beta_xz) / 2 * C,
        ),
        Printed("Eq. (35)", "dphi_1s = nabla_x/g - Dbeta_xy sin L", nabla_x / g - beta_xy * S),
        Printed("Eq. (36)", "dphi_1c = -nabla_y/g - Dbeta_yx sin L", -nabla_y / g - beta_yx * S),
        Printed("Eq. (37)", "dphi_2s = -(DSF_x/2SF_x - DSF_y/2SF_y) cos L", -HALF_DIFFERENCE * C),
        Printed("Eq. (38)", "dphi_2c = (Dbeta_yz/2 - Dbeta_xz/2) cos L", (beta_yz - beta_xz) / 2 * C),
    )
}

HARMONIC_OF = {
    "Eq. (29)": ("pitch", "mean"), "Eq. (30)": ("pitch", "1c"), "Eq. (31)": ("pitch", "1s"),
    "Eq. (32)": ("pitch", "2c"), "Eq. (33)": ("pitch", "2s"), "Eq. (34)": ("roll", "mean"),
    "Eq. (35)": ("roll", "1s"), "Eq. (36)": ("roll", "1c"), "Eq. (37)": ("roll", "2s"), "Eq. (38)": ("roll", "2c"),
}  # fmt: skip


def navigation_axes(f_hat: Any) -> Any:
    """Return the north, east, down as columns, in the axes of f_hat, whose z is taken for the pole."""
    down = -f_hat / sp.sqrt((f_hat.T * f_hat)[0])
    east = down.cross(sp.Matrix([0, 0, 1]))
    east = east / sp.sqrt((east.T * east)[0])
    return sp.Matrix.hstack(east.cross(down), east, down)


def axes_to_first_order(change: Any) -> tuple[Any, Any]:
    """Return `navigation_axes` at the level site, z along the pole, and its derivative along a change of the force."""
    d = sp.symbols("d_1:4", real=True)
    axes = navigation_axes(sp.Matrix([C, 0, S]) + e * sp.Matrix(d))

    def tidy(v: Any) -> Any:
        return sp.simplify(v).subs(sp.Abs(C), C)  # the site is not at a pole

    slope = axes.diff(e).subs(e, 0).applyfunc(tidy)
    return axes.subs(e, 0).applyfunc(tidy), slope.subs(dict(zip(d, change, strict=True)))


def base_and_change() -> tuple[Any, Any]:
    """Return C_b^e times the drift that the navigator takes the base to have, all disturbances scaled by e: at 0, and
    slope.

    Earth-fixed axes, so S_t itself drops out.
    """
    drift = sp.eye(3) - e * dS_1 * cross((1, 0, 0))  # components in the drifted platform
    level = Ry(L + sp.pi / 2) * Rz(-psi)  # C_b^e of the level base: h = L, q = psi
    tilted = level * (sp.eye(3) + e * cross(kappa))
    gimbals = Rz(-e * dS_t) * Ry(e * dh + L + sp.pi / 2) * Rz(-psi - e * dq)
    factors = (drift, gimbals, level.T, tilted)  # gimbals times level.T: the readouts' errors
    at_zero = [f.subs(e, 0) for f in factors]
    slope = sp.zeros(3)
    for i, factor in enumerate(factors):
        slope += sp.prod([*at_zero[:i], factor.diff(e).subs(e, 0), *at_zero[i + 1 :]], start=sp.eye(3))
    return level, slope


@cache
def attitude_error() -> Any:
    """Return (roll, pitch, yaw) error to first order: level base minus output C_b^n, about north, east, down."""
    measured = sp.Matrix(df) - dS_1 * cross((1, 0, 0)) * sp.Matrix([C, 0, S])
    axes, turned = axes_to_first_order(measured)
    base, moved = base_and_change()
    rotation = (turned.T * base + axes.T * moved) * Rz(-psi).T
    vector = sp.Matrix([rotation[2, 1], rotation[0, 2], rotation[1, 0]])
    return (-vector).applyfunc(lambda v: sp.expand(sp.simplify(sp.expand(v))))


@cache
def force_part() -> dict[str, dict[str, Any]]:
    """Return the Fourier coefficients of roll and pitch from the twelve residuals: Delta f^e = Rz(S_t) Delta f^p in
    (28).
    """
    in_earth = Rz(S_t) * force_error()
    only_force = dict.fromkeys(DISTURBANCES[3:], 0)
    values = dict(zip(df, in_earth, strict=True))
    roll, pitch, _ = (v.subs(only_force).subs(values) for v in attitude_error())
    return {"roll": harmonics(roll), "pitch": harmonics(pitch)}


@cache
def constant_part() -> dict[str, Any]:
    """Return the roll and pitch from readout errors and base tilts: they only enter the means."""
    no_force = dict.fromkeys(df, 0)
    roll, pitch, _ = (v.subs(no_force) for v in attitude_error())
    return {"roll": roll, "pitch": pitch}


def coefficient(channel: str, harmonic: str) -> Any:
    """Return one Fourier coefficient, first order, Delta = estimate minus truth."""
    value = force_part()[channel][harmonic]
    return sp.expand(value + constant_part()[channel]) if harmonic == "mean" else value


@cache
def second_order() -> float:
    """Return the largest difference between the exact navigator and first order over a day, Tables 2 and 3 [rad]."""
    import numpy as np

    corrected = (sp.eye(3) + sp.diag(*SCALE)) * (force() - sp.Matrix(BIAS) / g)
    exact = Rz(S_t) * (sp.eye(3) + _misalignment()).inv() * corrected
    values = dict(NUMBERS)
    largest = 0.0
    for hour in TURN[::3]:
        f_hat = exact.subs({**values, **hour}).evalf()
        C_nb = np.array(navigation_axes(f_hat).T * (Ry(L + sp.pi / 2)).subs(values).evalf(), dtype=float)
        first = dict(zip(df, (Rz(S_t) * force_error()).subs({**values, **hour}).evalf(), strict=True))
        linear = attitude_error().subs(dict.fromkeys(DISTURBANCES[3:], 0)).subs(first).subs(values).evalf()
        rotation = np.array([C_nb[2, 1], C_nb[0, 2]])
        largest = max(largest, float(np.abs(-rotation - np.array(linear[:2], dtype=float)).max()))
    return largest


def _misalignment() -> Any:
    from derivations.wu2018.frames import platform_to_accelerometers

    return platform_to_accelerometers() - sp.eye(3)


def _coefficient_case(item: str) -> Case:
    channel, harmonic = HARMONIC_OF[item]
    words = (
        "First order, Delta = estimate minus truth; with Tables 2 and 3 the exact navigator differs by {second} rad."
        if harmonic != "mean"
        else "First order; readout errors and base tilts enter the means only, so a mean determines nothing unless "
        "the base is level."
    )
    return Case(
        coefficient(channel, harmonic),
        words,
        small=(*RESIDUALS, *DISTURBANCES[3:]),
        at={**NUMBERS, **dict.fromkeys(DISTURBANCES, 0.0), psi: 0.0},
        unit="arcsec",
        symbols=(SCALE, BIAS, BETA),
        factors=(S, C, sp.Integer(2)),
        facts={"second": f"{second_order():.0e}"},
    )


@cache
def cases() -> dict[str, Case]:
    """Return the derived forms of the items."""
    return {
        "Eq. (28)": Case(
            attitude_error(),
            "Level base minus navigator, Delta f = estimate minus truth, readout minus truth; Delta S_1, which the "
            "paper does not define, is the platform's drift angle about the equatorial axis in the meridian. The three "
            "are rotations about north, east, down: roll and pitch only for a base that heads north.",
            small=DISTURBANCES,
        ),
        **{item: _coefficient_case(item) for item in HARMONIC_OF},
    }
