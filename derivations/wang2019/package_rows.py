"""The rows of the package's fits, and of its simulated laboratory, against Eqs. (13) and (14), (17) to (35).

As in `package`: misfits and derivatives of what the fits minimise, item by item, at generic numbers.
"""

from __future__ import annotations

from functools import cache, partial
from math import pi
from typing import Any

import numpy as np
import sympy as sp

from derivations.comparison import checks, once
from derivations.stimulus import stimulus
from derivations.wang2019 import accelerometer, gyroscope
from derivations.wang2019.package import GENERIC, PARAMETERS, counts, numbers, vector
from derivations.wang2019.symbols import (
    BIAS,
    K1,
    K2,
    K3,
    SOURCE,
    E,
    L,
    N,
    fa,
    fp,
    g,
    omega_ie,
    polynomial,
    square,
    triangle,
)

NORM_FIT = "estimate.pulses.gravity_norm._residuals"
TURN_FIT = "estimate.pulses.whole_turns._residuals"
LABORATORY = "campaign.trials"
FREE = (*K1, *K2, *BIAS, *E)  # order of the rotation fit
ANGLE, DURATION, SIGMA, SIGMA_REST = 4 * pi, 7.0, 0.01, 0.002
ROUGH = np.array([1.2, 0.8, 1.1])  # scale factors from which the fit starts
SUMS = {"+": (np.array([0.7, -0.4, 0.6]), np.array([0.5, 0.2, 0.35])),
        "-": (np.array([-0.6, 0.5, -0.45]), np.array([0.4, 0.3, 0.2]))}  # integrals of N and N^2 each way  # fmt: skip


# --- accelerometers: the norm of the force


@once
def _norm_fit() -> tuple[float, Any]:
    """Return F of (19) with g = 1 and its 15 derivatives from the fit, whose misfit is F / (2 sigma)."""
    from gimbalcal.estimate.pulses import gravity_norm as fit

    sigma = 0.3
    r, J = fit._residuals(vector()[None], counts()[None], sigma, np.arange(15))
    return float(2 * sigma * r[0, 0]), 2 * sigma * J[0, 0]


@cache
def _derived_norm() -> float:
    return float(numbers(accelerometer.F(), GENERIC | {g: 1.0})[0, 0])


@cache
def _derived_norm_derivatives() -> Any:
    """Return (15,) derivatives of F in the order of `PARAMETERS`."""
    along = numbers(polynomial(3), GENERIC)[:, 0]
    force = numbers(triangle() * polynomial(3), GENERIC)[:, 0]
    at = {**GENERIC, **dict(zip(fa, along, strict=True)), **dict(zip(fp, force, strict=True))}
    return numbers(accelerometer.exact(*PARAMETERS), at)[:, 0]


@checks(SOURCE, "Eq. (17)", "Eq. (19)", where=NORM_FIT)
def norm_misfit() -> float:
    """The misfit of the norm."""
    return float(abs(_norm_fit()[0] - _derived_norm()))


@checks(SOURCE, "Eq. (18)", where=NORM_FIT)
def norm_cost() -> float:
    """Half the square of the misfit."""
    cost = numbers(accelerometer.cost(), GENERIC | {g: 1.0})[0, 0]
    return float(abs(_norm_fit()[0] ** 2 / 2 - cost))


def norm_derivatives(wanted: tuple[Any, ...]) -> float:
    """Return derivatives of F by some parameters."""
    wanted_at = [PARAMETERS.index(s) for s in wanted]
    return float(np.abs((_norm_fit()[1] - _derived_norm_derivatives())[wanted_at]).max())


for _item, _wanted in (("(20)", K1[:1]), ("(21)", K1[1:]), ("(22)", K2), ("(23)", K3), ("(24)", BIAS), ("(25)", E)):
    checks(SOURCE, f"Eq. {_item}", where=NORM_FIT)(partial(norm_derivatives, _wanted))


# --- gyroscopes: differences and sums of turns, and rest


@once
def _turn_fit() -> tuple[Any, Any]:
    """Return the whitened misfits (5,) and derivatives (5, 12): Eq. (30), three across the axis, Eq. (35)."""
    from gimbalcal.estimate.pulses import whole_turns as revolutions

    one, other = (np.stack(SUMS[s])[None, None] for s in "+-")
    counted = revolutions.Revolutions(one, other, counts()[None], DURATION, ANGLE, SIGMA, SIGMA_REST)
    data = revolutions._in_units_of_angle(counted, ROUGH[None], ANGLE / DURATION)
    x = np.array([GENERIC[s] for s in FREE])
    r, J = revolutions._residuals((x / _units())[None], data, counted, True)
    return r[0], J[0] / _units()


def _units() -> Any:
    """Return (12,) what one of each parameter of the fit is: scale factors over rough ones, rates over the speed."""
    speed = ANGLE / DURATION
    return np.r_[ROUGH, ROUGH**2 / speed, np.full(3, speed), np.ones(3)]


def _at_turn() -> dict[Any, float]:
    values = dict(GENERIC) | {gyroscope.angle: ANGLE, gyroscope.t: DURATION}
    by = {"+": (gyroscope.S_cw, gyroscope.S2_cw), "-": (gyroscope.S_ccw, gyroscope.S2_ccw)}
    for sense, symbols in by.items():
        for group, sums in zip(symbols, SUMS[sense], strict=True):
            values |= dict(zip(group, sums, strict=True))
    (S1, Q1), (S2, Q2) = SUMS["+"], SUMS["-"]
    return values | dict(zip((*gyroscope.S, *gyroscope.S2), (*(S1 - S2), *(Q1 - Q2)), strict=True))


@cache
def _derived_turn() -> tuple[float, dict[Any, float]]:
    """Return P, and its derivatives by the nine parameters of Eq. (30)."""
    at = _at_turn()
    along = [at[k1] * at[s] + at[k2] * at[q] for k1, k2, s, q in zip(K1, K2, gyroscope.S, gyroscope.S2, strict=True)]
    turned = numbers(triangle(), GENERIC) @ np.array(along)
    misfit = float(numbers(gyroscope.norm_of_difference(), at)[0, 0])
    at |= dict(zip(gyroscope.psi_q, turned, strict=True)) | dict(zip(gyroscope.psi_g, along, strict=True))
    nine = (*K1, *K2, *E)
    return misfit, dict(zip(nine, numbers(gyroscope.exact(*nine), at)[:, 0], strict=True))


@checks(SOURCE, "Eq. (29)", "Eq. (30)", "Eq. (31)", where=TURN_FIT)
def turn_misfit() -> float:
    """P over (2 theta)^2 from the fit, whose first misfit is P / (4 theta sigma sqrt(2))."""
    ours = _turn_fit()[0][0] * np.sqrt(2) * SIGMA / ANGLE
    return float(abs(ours - _derived_turn()[0] / (2 * ANGLE) ** 2))


def turn_derivatives(wanted: tuple[Any, ...]) -> float:
    """Return derivatives of P by some parameters, over (2 theta)^2."""
    ours = _turn_fit()[1][0, [FREE.index(s) for s in wanted]] * np.sqrt(2) * SIGMA / ANGLE
    derived = np.array([_derived_turn()[1][s] for s in wanted])
    return float(np.abs(ours - derived / (2 * ANGLE) ** 2).max())


for _item, _wanted in (("(32)", K1), ("(33)", K2), ("(34)", E), ("(30), K_g2", K2)):
    checks(SOURCE, f"Eq. {_item}", where=TURN_FIT)(partial(turn_derivatives, _wanted))


@cache
def _sum_and_difference() -> Any:
    """Return (27) + (28) and (27) - (28), sensor side, as functions of the twelve parameters at the generic turns."""
    away = dict.fromkeys((*gyroscope.W, *gyroscope.theta), sp.Integer(0))
    data = {k: v for k, v in _at_turn().items() if k not in FREE}
    one, other = (side.subs(away).subs(data) for side in gyroscope.over_a_turn())
    return sp.lambdify(FREE, [*(one + other), *(one - other)])


def _across(x: Any) -> Any:
    """Return the part of (27) + (28) across the axis of (29), over theta, at parameters (12,), complex ones too."""
    both = np.array(_sum_and_difference()(*x))
    total, axis = both[:3], both[3:]
    return (total - axis * (total @ axis) / (axis @ axis)) / ANGLE


@checks(SOURCE, "Eq. (27)", "Eq. (28)", where=TURN_FIT)
def sum_across() -> float:
    """Three rows of the sum of both senses: value and derivatives (complex steps of the derived form)."""
    r, J = _turn_fit()
    x, scale = np.array([GENERIC[s] for s in FREE]), np.sqrt(2) * SIGMA / ANGLE
    slope = np.stack([_across(x + 1e-30j * unit).imag / 1e-30 for unit in np.eye(len(x))], axis=-1)
    return float(max(np.abs(r[1:4] * scale - _across(x)).max(), np.abs(J[1:4] * scale - slope).max()))


@cache
def _derived_rest() -> tuple[float, Any]:
    """Return the squared norm less the Earth's of (35), and its derivatives (12,)."""
    from gimbalcal.earth import EARTH_RATE

    norm = square(triangle() * polynomial(2)) - gyroscope.earth_squared()
    at = GENERIC | {omega_ie: EARTH_RATE}
    return float(numbers(norm, at)[0, 0]), numbers(sp.Matrix([norm]).jacobian(FREE), at)[0]


@checks(SOURCE, "Eq. (35)", where=TURN_FIT)
def rest_row() -> float:
    """The norm of the Earth's rate at rest: value and derivatives; the fit's misfit is over 2 w sigma."""
    from gimbalcal.earth import EARTH_RATE

    r, J = (part[4] for part in _turn_fit())
    value, slope = _derived_rest()
    scale = 2 * EARTH_RATE * SIGMA_REST
    return float(max(abs(r * scale - value), np.abs(J * scale - slope).max()))


# --- pulses as the catalogue's effects


@cache
def _rate() -> Any:
    """Return Eq. (6) at the generic counts as a function of the twelve parameters."""
    return sp.lambdify(FREE, list((triangle() * polynomial(2)).subs({n: GENERIC[n] for n in N})))


def _reading(x: Any) -> Any:
    """Return (3,) what the package's gyroscopes read at the derived rate, with the effects it makes of parameters x
    (12,).
    """
    from gimbalcal.effects import with_values
    from gimbalcal.estimate.gyroscopes import revolutions
    from gimbalcal.forward import gyroscopes

    effects = with_values((), revolutions.triangular_parameters(), revolutions.as_effects(x))
    return gyroscopes(np.array([_rate()(*x)]), stimulus(np.zeros((1, 3)), (9.8, 0.6)), effects)[0]


@checks(SOURCE, "Eq. (6)", "Eq. (8)", where="estimate.gyroscopes.revolutions.as_effects")
def as_effects() -> float:
    """Linear terms: the reading is the counts. Second order: the reading does not move with K2, bias zero."""
    linear = np.array([0.0 if s in K2 else GENERIC[s] for s in FREE])
    worst = np.abs(_reading(linear) - counts()[0]).max()
    unbiased = np.array([0.0 if s in (*K2, *BIAS) else GENERIC[s] for s in FREE], dtype=complex)
    for k in K2:
        step = np.array([1e-30j if s == k else 0.0 for s in FREE])
        worst = max(worst, np.abs(_reading(unbiased + step).imag).max() / 1e-30)
    return float(worst)


# --- the simulated laboratory, without noise


class _Silent:
    """A generator that draws zeros."""

    def standard_normal(self, shape: Any) -> Any:
        return np.zeros(shape)


def _triad() -> Any:
    """Return a triad (1, 3) each of the size of Table 3, SI."""
    from gimbalcal.estimate.pulses.gravity_norm import Pulses

    x = vector(*K3)
    for i, size in enumerate((1e-8, 1e-18, 0.0, 1e-6, 1.0)):
        x[3 * i : 3 * i + 3] *= size
    return Pulses.from_vector(x[None])


@checks(SOURCE, "Eq. (26)", "Eq. (27)", "Eq. (28)", where=f"{LABORATORY}._revolution")
def simulated_turns() -> float:
    """Counts of a revolution each way: Eqs. (27), (28) with the Earth's rate up must balance, over the angle."""
    from gimbalcal.campaign import trials
    from gimbalcal.earth import EARTH_RATE

    axis, triad = np.array([2.0, -1.0, 2.0]) / 3, _triad()
    theta = 2 * pi * trials.REVOLUTIONS
    duration = theta / trials.SPEED
    at = dict(zip(PARAMETERS, triad.vector()[0], strict=True)) | {gyroscope.t: duration}
    earth = EARTH_RATE * np.sin(trials.LATITUDE) * duration * axis
    at |= dict(zip((*gyroscope.W, *gyroscope.theta), (*earth, *(theta * axis)), strict=True))
    worst = 0.0
    sides = zip(
        (1.0, -1.0),
        gyroscope.over_a_turn(),
        ((gyroscope.S_cw, gyroscope.S2_cw), (gyroscope.S_ccw, gyroscope.S2_ccw)),
        strict=True,
    )
    for sense, balance, symbols in sides:
        silent: Any = [_Silent()]
        S, Q = trials._revolution(triad, axis[None, None], sense, duration, silent)[0, 0]
        sums = dict(zip((*symbols[0], *symbols[1]), (*S, *Q), strict=True))
        worst = max(worst, float(np.abs(numbers(balance, at | sums)).max() / theta))
    return worst


@checks(SOURCE, "Eq. (11)", "Eq. (35)", where=f"{LABORATORY}._earth_at_rest")
def simulated_rest() -> float:
    """The Earth's rate at rest: its norm, and its part along the vertical, sin L."""
    from gimbalcal.campaign import trials
    from gimbalcal.earth import EARTH_RATE

    up = np.array([[2.0, -1.0, 2.0], [0.0, 0.6, -0.8]]) / np.array([[3.0], [1.0]])
    rate = trials._earth_at_rest(up[None])[0] / EARTH_RATE
    vertical = float(sp.sin(L).subs(L, trials.LATITUDE))
    return float(max(np.abs((rate**2).sum(1) - 1).max(), np.abs((rate * up).sum(1) - vertical).max()))
