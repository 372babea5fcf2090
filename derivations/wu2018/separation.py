r"""Eqs. (39) to (41): from combined coefficients back to the sensor's parameters, and what cannot be had.

The static run delivers fifteen Fourier coefficients: five of the norm (through x_1 to x_5), five of pitch, five of
roll. Each second-harmonic coefficient is one difference times a known factor, so (39) and (40) are averages of three
readings of the same number. The first harmonics are what (41) inverts:

    x_2      = nabla_x/g - beta_xy S + beta_zy S          x_3      =   nabla_y/g + beta_yx S - beta_zx S
    phi_1s   = nabla_x/g - beta_xy S                      phi_1c   = -(nabla_y/g + beta_yx S)
    theta_1c = -S (nabla_x/g - beta_xy S) + beta_zy C^2   theta_1s = -S (nabla_y/g + beta_yx S) - beta_zx C^2

On the left only nabla_x/g - beta_xy S and beta_zy occur, on the right only nabla_y/g + beta_yx S and beta_zx: six
equations, rank four. The printed matrix leaves the betas out of the rows of x_2 and x_3; that alone makes it
invertible.

The reason is physical: on a cone of latitude L the force along the pole is constant, so a lean of the x axis towards
the pole reads g S beta_xy all day, like a bias. Nothing in the run turns the platform against that axis.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import sympy as sp

from derivations.verdict import ARCSEC, Case, Printed, entries, is_zero, same
from derivations.wu2018.attitude_error import DISTURBANCES, attitude_error, df, force_part
from derivations.wu2018.static_force import as_states, force, states
from derivations.wu2018.symbols import BETA, BIAS, NUMBERS, RESIDUALS, SCALE, L, Rz, S_t, g, harmonics

sigma_x, sigma_y, sigma_z = SCALE
nabla_x, nabla_y, nabla_z = BIAS
beta_xy, beta_xz, beta_yz, beta_yx, beta_zx, beta_zy = BETA
S, C = sp.sin(L), sp.cos(L)
K_NL = sp.symbols("K_x K_y K_z", real=True)  # s^2/m
x_4, x_5, phi_N2s, phi_N2c, phi_E2s, phi_E2c = sp.symbols("x_4 x_5 phi_N2s phi_N2c phi_E2s phi_E2c", real=True)
UNKNOWNS = (nabla_x, nabla_y, beta_yx, beta_zx, beta_xy, beta_zy)  # of (41); the biases over g
ROWS = ("dphi_1s", "dphi_1c", "dtheta_1c", "dtheta_1s", "x_2", "x_3")

PRINTED = {
    p.item: p
    for p in (
        Printed(
            "Eq. (39)",
            "DSF_x/2SF_x - DSF_y/2SF_y = 1/3 (x_4 - phi_N2s/cos L + phi_E2c/(cos L sin L))",
            (x_4 - phi_N2s / C + phi_E2c / (C * S)) / 3,
        ),
        Printed(
            "Eq. (40)",
            "(Dbeta_yz - Dbeta_xz)/2 = 1/3 (x_5 + phi_N2c/cos L + phi_E2s/(cos L sin L))",
            (x_5 + phi_N2c / C + phi_E2s / (C * S)) / 3,
        ),
        Printed(
            "Eq. (41)",
            "[1 0 0 0 -sin L 0; 0 -1 -sin L 0 0 0; -sin L 0 0 0 sin^2 L cos^2 L; 0 -sin L -sin^2 L -cos^2 L 0 0; "
            "1 0 0 0 0 0; 0 1 0 0 0 0] (x/g, y/g, Dbeta_yx, Dbeta_zx, Dbeta_xy, Dbeta_zy) = "
            "(dphi_1s, dphi_1c, dtheta_1s, kappa_2, kappa_3)",
            sp.Matrix(
                [
                    [1, 0, 0, 0, -S, 0],
                    [0, -1, -S, 0, 0, 0],
                    [-S, 0, 0, 0, S**2, C**2],
                    [0, -S, -(S**2), -(C**2), 0, 0],
                    [1, 0, 0, 0, 0, 0],
                    [0, 1, 0, 0, 0, 0],
                ]
            ),
            garbled="x/g and y/g stand for nabla_x/g and nabla_y/g, kappa for x, and one of the six right-hand sides, "
            "dtheta_1c by the rows, is lost",
        ),
    )
}


@cache
def coefficients() -> dict[str, Any]:
    """Return the fifteen coefficients in the twelve residuals, means without readout errors and base tilts."""
    out = {f"x_{i}": v for i, v in enumerate(states(), 1)}
    names = {"pitch": "dtheta", "roll": "dphi"}
    for channel, name in names.items():
        out |= {f"{name}_{harmonic}": v for harmonic, v in force_part()[channel].items()}
    return out


def average(difference: Any, readings: tuple[tuple[Any, Any], ...]) -> Any:
    """Return the mean of measured coefficients, each divided by its derivative with respect to the difference it
    carries.
    """
    terms = []
    for symbol, derived in readings:
        factor = sp.simplify(derived / difference)
        if factor.free_symbols - {L}:
            raise ArithmeticError(f"{derived} is no multiple of {difference}")
        terms.append(symbol / factor)
    return sp.expand(sum(terms) / len(terms))


def matrix_41() -> Any:
    """Return the six first-harmonic coefficients by the six unknowns, biases over g."""
    rows = sp.Matrix([coefficients()[name] for name in ROWS])
    matrix = rows.jacobian(UNKNOWNS)
    matrix[:, :2] = matrix[:, :2] * g
    return matrix.applyfunc(sp.simplify)


def rank_at_a_latitude(matrix: Any) -> int:
    """Return the exact rank where sin L = 3/5, cos L = 4/5; no larger anywhere if the null space is exhibited
    symbolically.
    """
    at = {S: sp.Rational(3, 5), C: sp.Rational(4, 5), g: 1}
    return int(matrix.applyfunc(lambda v: sp.expand_trig(v).subs(at)).rank())


# Directions in the twelve residuals that no coefficient of a static run sees; biases in units of g.
NULL_LEVEL: dict[str, dict[Any, Any]] = {
    "bias_x with beta_xy (nabla_x/g = S beta_xy)": {nabla_x: g * S, beta_xy: 1},
    "bias_y with beta_yx (nabla_y/g = -S beta_yx)": {nabla_y: -g * S, beta_yx: 1},
    "bias_z with scale_z (nabla_z/g = S sigma_z)": {nabla_z: g * S, sigma_z: 1},
}
NULL_TILTED: dict[str, dict[Any, Any]] = {
    "beta_xz with beta_yz (a turn about the pole)": {beta_xz: 1, beta_yz: 1},
    "scale_x, scale_y and bias_z (S : S : C^2)": {sigma_x: S, sigma_y: S, nabla_z: g * C**2},
}
MEANS = ("dtheta_mean", "dphi_mean")


def unobservable(directions: dict[str, dict[Any, Any]], names: list[str]) -> bool:
    """Return whether every direction leaves all the named coefficients unchanged, symbolically."""
    jacobian = sp.Matrix([coefficients()[n] for n in names]).jacobian(RESIDUALS)
    vectors = [sp.Matrix([d.get(r, 0) for r in RESIDUALS]) for d in directions.values()]
    return all(is_zero(v) for vector in vectors for v in entries(jacobian * vector))


@cache
def nonlinearity() -> dict[str, Any]:
    """Return what a true K_nl left uncorrected adds, f_hat = f + K f^2; the paper's system level leaves it out.

    First harmonics get part of it too (the rest is a third harmonic): to the static run K_nl looks partly like bias.
    """
    extra = sp.Matrix([k * g * v**2 for k, v in zip(K_NL, force(), strict=True)])  # over g
    in_earth = dict(zip(df, Rz(S_t) * extra, strict=True))
    tilt = attitude_error().subs(dict.fromkeys(DISTURBANCES[3:], 0)).subs(in_earth)
    out = {f"x_{i}": v for i, v in enumerate(as_states(harmonics((force().T * extra)[0])), 1)}
    for name, series in (("dphi", tilt[0]), ("dtheta", tilt[1])):
        out |= {f"{name}_{harmonic}": v for harmonic, v in harmonics(series).items()}
    return out


@cache
def ranks() -> dict[str, int]:
    """Return ranks in the twelve residuals: all 15 coefficients, without the attitude means, the norm's five alone."""
    names = list(coefficients())
    sets = {
        "all": names,
        "tilted": [n for n in names if n not in MEANS],
        "norm": names[:5],
        "attitude": names[5:],
    }
    return {
        key: rank_at_a_latitude(sp.Matrix([coefficients()[n] for n in chosen]).jacobian(RESIDUALS))
        for key, chosen in sets.items()
    }


def damage() -> tuple[float, float]:
    """Return errors that inverting the printed (41) makes on error-free coefficients of Tables 2 and 3: ug, arcsec."""
    true = sp.Matrix([r / g if r in (nabla_x, nabla_y) else r for r in UNKNOWNS]).subs(NUMBERS)
    measured = (matrix_41().subs(NUMBERS) * true).evalf()
    wrong = PRINTED["Eq. (41)"].formula.subs(NUMBERS).evalf().LUsolve(measured) - true
    bias = max(abs(float(v)) for v in wrong[:2, 0])
    angle = max(abs(float(v)) for v in wrong[2:, 0])
    return bias * 1e6, angle / ARCSEC


def _why_41(printed: Printed, _: Case) -> str:
    derived, formula = matrix_41(), printed.formula
    wrong = [name for i, name in enumerate(ROWS) if not same(formula[i, :], derived[i, :])]
    rank = rank_at_a_latitude(formula)
    bias, angle = damage()
    r, null, tilted = ranks(), "; ".join(NULL_LEVEL), "; ".join(NULL_TILTED)
    confirmed = unobservable(NULL_LEVEL, list(coefficients())) and unobservable(
        NULL_LEVEL | NULL_TILTED, [n for n in coefficients() if n not in MEANS]
    )
    rows = f"The rows of {', '.join(wrong)} are wrong: they lack the betas of (22), (23). " if wrong else ""
    return (
        f"{rows}Printed rank {rank}; derived rank {{rank}} of 6: only nabla_x/g - beta_xy sin L, "
        "nabla_y/g + beta_yx sin L, beta_zy, beta_zx are determined. Inverting the printed matrix on error-free data "
        f"of Tables 2 and 3 is wrong by {bias:.0f} ug and {angle:.0f} arcsec. All 15 coefficients have rank {r['all']} "
        f"of 12 on a level base, {r['tilted']} without the attitude means; unobservable "
        f"({'proved' if confirmed else 'NOT proved'}): {null}; and without the means also {tilted}."
    )


@cache
def cases() -> dict[str, Case]:
    """Return the derived forms of the items."""
    c = coefficients()
    noise = {"roll": f"{1 / float(C.subs(NUMBERS)):.2f}", "pitch": f"{1 / float((S * C).subs(NUMBERS)):.2f}"}
    words = (
        "Right with phi_N the roll (tilt about north) and phi_E the pitch (about east), undefined in the paper. "
        "Unbiased, but equal weights are not the best: at 40 deg roll enters times {roll}, pitch times {pitch}."
    )
    matrix = matrix_41()
    return {
        "Eq. (39)": Case(
            average((sigma_x - sigma_y) / 2, ((x_4, c["x_4"]), (phi_N2s, c["dphi_2s"]), (phi_E2c, c["dtheta_2c"]))),
            words,
            facts=noise,
            symbols=((phi_N2s, phi_N2c, phi_E2s, phi_E2c),),
            factors=(S, C),
        ),
        "Eq. (40)": Case(
            average((beta_yz - beta_xz) / 2, ((x_5, c["x_5"]), (phi_N2c, c["dphi_2c"]), (phi_E2s, c["dtheta_2s"]))),
            words,
            facts=noise,
            symbols=((phi_N2s, phi_N2c, phi_E2s, phi_E2c),),
            factors=(S, C),
        ),
        "Eq. (41)": Case(
            matrix,
            _why_41,
            at={L: NUMBERS[L]},
            rank=(rank_at_a_latitude(matrix), len(UNKNOWNS)),
            facts={"rank": rank_at_a_latitude(matrix)},
        ),
    }
