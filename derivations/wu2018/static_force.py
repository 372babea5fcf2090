r"""Eqs. (18) to (27): the norm of the measured force on a platform that is stable in inertial space.

The platform's z axis points to the pole and the Earth turns by S_t under it, so n components reach the platform by

    C_n^p = Rz(-S_t) C_n^e(L),      C_n^e: north = (-sin L, 0, cos L), east = (0, 1, 0), down = (-cos L, 0, -sin L).

From here on the paper counts errors as estimate minus truth: z compares |f_hat|^2 with |f|^2, Delta f = f_hat - f.
With estimates off by sigma (scale), nabla (bias), beta (input axes) from the truth,

    f_hat^p = C_a^p(beta) (1 + sigma) (f - nabla)
    Delta f = sigma f - nabla - (C_p^a(beta) - 1) f      (first order)

and z = f . Delta f / g^2 is a Fourier polynomial in S_t of order 2, whose five coefficients are x_1 to x_5 through the
observation row H.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import sympy as sp

from derivations.verdict import Case, Printed, magnitude, same, truncate
from derivations.wu2018.frames import PRINTED as FRAMES
from derivations.wu2018.frames import platform_to_accelerometers
from derivations.wu2018.symbols import (
    BETA,
    BIAS,
    G_NORMAL,
    NUMBERS,
    RESIDUALS,
    SCALE,
    TURN,
    L,
    Rz,
    S_t,
    g,
    h,
    harmonics,
    phi,
    psi,
    q,
    theta,
)

SIGMA_NOISE = 5e-3  # m/s^2, section 6.1
sigma_x, sigma_y, sigma_z = SCALE
nabla_x, nabla_y, nabla_z = BIAS
beta_xy, beta_xz, beta_yz, beta_yx, beta_zx, beta_zy = BETA
S, C = sp.sin(L), sp.cos(L)
s, c = sp.sin(S_t), sp.cos(S_t)
f = sp.symbols("f_x f_y f_z", real=True)  # specific force over g
df = sp.symbols("Df_x Df_y Df_z", real=True)

X_1 = (sigma_x / 2 + sigma_y / 2) * C**2 - (nabla_z / g - sigma_z * S) * S
X_2 = nabla_x / g - beta_xy * S + beta_zy * S
X_3 = nabla_y / g + beta_yx * S - beta_zx * S
X_4 = sigma_x / 2 - sigma_y / 2
X_5 = (beta_yz - beta_xz) / 2
H_ROW = sp.Matrix([[1, -f[0], -f[1], f[0] ** 2 - f[1] ** 2, 2 * f[0] * f[1]]])
MATRIX_18 = sp.Matrix([[-c * S, -s, -c * C], [-s * S, c, -s * C], [C, 0, -S]])
FORCE_19 = sp.Matrix([c * C, s * C, S])
H_19 = H_ROW.subs(dict(zip(f, FORCE_19, strict=True)))  # "considering Equation (19)"

PRINTED = {
    p.item: p
    for p in (
        Printed(
            "Eq. (18)",
            "C_b^p C_n^b ~ [-cos S_t sin L, -sin S_t, -cos S_t cos L; -sin S_t sin L, cos S_t, -sin S_t cos L; "
            "cos L, 0, -sin L]",
            MATRIX_18,
        ),
        Printed(
            "Eq. (19)",
            "f_x^p/g = (f_x^P/g, f_y^P/g, f_z^P/g) = C_b^p C_n^b (0, 0, -1) = (cos S_t cos L, sin S_t cos L, sin L)",
            FORCE_19,
            garbled="the vector on the left reads f_x^p / g",
        ),
        Printed("Eq. (20)", "z = 1/2 [|f_hat^p/g|^2 - |f^p/g|^2] ~ (f^p/g)^T Delta f^p/g",
                sum(a * b for a, b in zip(f, df, strict=True))),
        Printed("Eq. (21)", "x_1 = (DSF_x/2SF_x + DSF_y/2SF_y) cos^2 L - (db~_z/g - DSF_z/SF_z sin L) sin L", X_1),
        Printed("Eq. (22)", "x_2 = db_x/g - Dbeta_xy sin L + Dbeta_zy sin L", X_2),
        Printed("Eq. (23)", "x_3 = db_y/g + Dbeta_yx sin L - Dbeta_zx sin L", X_3),
        Printed("Eq. (24)", "x_4 = DSF_x/2SF_x - DSF_y/2SF_y", X_4),
        Printed("Eq. (25)", "x_5 = (Dbeta_yz - Dbeta_xz)/2", X_5),
        Printed("Eq. (26)", "z = H x + v", (H_19 * sp.Matrix([X_1, X_2, X_3, X_4, X_5]))[0]),
        Printed("Eq. (27)", "H = [1, -f_x^p/g, -f_y^p/g, ((f_x^p)^2 - (f_y^p)^2)/g^2, 2 f_x^p f_y^p/g^2]", H_19),
    )
}  # fmt: skip


def navigation_to_platform() -> Any:
    """Return C_n^p from the geometry of the Earth."""
    north, east, down = sp.Matrix([-S, 0, C]), sp.Matrix([0, 1, 0]), sp.Matrix([-C, 0, -S])
    return Rz(-S_t) * sp.Matrix.hstack(north, east, down)


def force() -> Any:
    """Return f^p / g at rest."""
    return navigation_to_platform() * sp.Matrix([0, 0, -1])


@cache
def force_error() -> Any:
    """Return the delta f^p / g, estimate minus truth, first order in the twelve residuals."""
    B = platform_to_accelerometers() - sp.eye(3)
    corrected = (sp.eye(3) + sp.diag(*SCALE)) * (force() - sp.Matrix(BIAS) / g)
    return truncate((sp.eye(3) - B) * corrected - force(), RESIDUALS, 1)


@cache
def norm_harmonics() -> dict[str, Any]:
    """Return the Fourier coefficients of z = f . Delta f / g^2."""
    return harmonics((force().T * force_error())[0])


@cache
def states() -> tuple[Any, ...]:
    """Return x_1 to x_5: the Fourier coefficients through H = (1, -cC, -sC, C^2 cos 2S_t, C^2 sin 2S_t)."""
    return as_states(norm_harmonics())


def as_states(z: dict[str, Any]) -> tuple[Any, ...]:
    """Return the Fourier coefficients of z as x_1 to x_5."""
    raw = (z["mean"], -z["1c"] / C, -z["1s"] / C, z["2c"] / C**2, z["2s"] / C**2)
    return tuple(sp.expand(sp.simplify(v)) for v in raw)


def observation_row() -> Any:
    """Return H over the force: the row whose product with the states is z for every residual, in powers of f."""
    basis = [1, -c * C, -s * C, C**2 * sp.cos(2 * S_t), C**2 * sp.sin(2 * S_t)]
    return sp.Matrix([[sp.expand_trig(v) for v in basis]])


def second_order() -> float:
    """Return the largest deterministic part that Eq. (20) drops, residuals of Tables 2 and 3."""
    return magnitude((force_error().T * force_error())[0] / 2, NUMBERS, TURN)


def noise_mean() -> float:
    """Return the mean of |noise / g|^2 / 2 for three white components: what the noise adds to x_1."""
    return 1.5 * (SIGMA_NOISE / G_NORMAL) ** 2


def _state_case(i: int) -> Case:
    """Return x_i, with the note on what Delta means."""
    also = (X_1, X_2, X_3, X_4, X_5)
    truth_minus_estimate = {r: -r for r in RESIDUALS}
    reverses = same(states()[i].subs(truth_minus_estimate, simultaneous=True), -also[i])
    note = "every sign reverses" if reverses else "the form changes"
    return Case(
        states()[i],
        f"Right with Delta = estimate minus truth, as Delta f in (20); with the definition of (12) to (14) {note}. For "
        "the true parameters of an uncorrected sensor (estimate zero) it is minus this.",
        small=RESIDUALS,
        at=NUMBERS,
        unit="ug",
        symbols=(SCALE, BIAS),
        factors=(S, C, sp.Integer(2)),
    )


@cache
def cases() -> dict[str, Case]:
    """Return the derived forms of the items."""
    level = {psi: 0, theta: 0, phi: 0, h: L, q: 0}
    chain = (FRAMES["Eq. (4)"].formula * FRAMES["Eq. (3)"].formula).subs(level)
    closed = same(chain, navigation_to_platform())
    half_square = sum(((a + b) ** 2 - a**2) / 2 for a, b in zip(f, df, strict=True))
    sigma = SIGMA_NOISE / G_NORMAL
    return {
        "Eq. (18)": Case(
            navigation_to_platform(),
            "Exact for a level base heading north and z_p along the pole"
            + (", and equal to (4) times (3) with h = L, q = 0." if closed else "; (4) times (3) is something else."),
        ),
        "Eq. (19)": Case(force(), "Up, in platform axes."),
        "Eq. (20)": Case(
            sp.expand(half_square),
            "Half the square of Delta f is dropped: {fixed} at most with Tables 2 and 3, but noise of 5e-3 m/s^2 adds "
            "3/2 (sigma/g)^2 = {size} to the mean, hence to x_1: not zero-mean, and a third of the 1e-6 claimed.",
            small=df,
            at=dict.fromkeys(df, sigma),
            unit="ug",
            facts={"fixed": f"{second_order() * 1e6:.2g} ug"},
        ),
        **{f"Eq. ({21 + i})": _state_case(i) for i in range(5)},
        "Eq. (26)": Case(
            (force().T * force_error())[0],
            "H x with (21) to (25) is the first-order z for every S_t and all twelve residuals; but the noise v has "
            "the mean {noise} of (20), which the zero-mean assumption leaves in x_1.",
            small=RESIDUALS,
            at=NUMBERS,
            sweep=TURN,
            unit="ug",
            facts={"noise": f"{noise_mean():.1e}"},
        ),
        "Eq. (27)": Case(
            observation_row(),
            "With the force of (19): 1, -cos S_t cos L, -sin S_t cos L, cos^2 L cos 2 S_t, cos^2 L sin 2 S_t.",
            at={L: NUMBERS[L]},
            sweep=TURN,
        ),
    }
