"""What each effect of the sensors adds, written again in plain numpy from its source, one channel at a time.

Nothing of `gimbalcal.effects` is called: `s` is the stimulus and `p` carries the parameter values (SI) by field name.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from gimbalcal.number import Array

Law = Callable[[Any, Any], Array]
G0 = 9.80665  # m/s^2, standard gravity (SI)
NEXT, AFTER = [1, 2, 0], [2, 0, 1]  # the axis j after i, and k after j, cyclic


def col(x: Array) -> Array:
    """A series (n,) as a column (n, 1)."""
    return np.asarray(x)[:, None]


def lag(x: Array, t: Array, tau: float) -> Array:
    """y of tau y' = x - y, y = x at first, x straight between samples: there y = x - m tau + C exp(-t / tau)."""
    y = [x[0]]
    for k in range(1, len(t)):
        h = t[k] - t[k - 1]
        m = (x[k] - x[k - 1]) / h
        y.append(x[k] - m * tau + (y[-1] - x[k - 1] + m * tau) * np.exp(-h / tau))
    return np.array(y)


def behind(x: Array, t: Array, tau: float) -> Array:
    """x - y of `lag`: d' = m - d / tau."""
    d = [0.0]
    for k in range(1, len(t)):
        h = abs(t[k] - t[k - 1])
        d.append(d[-1] * np.exp(-h / tau) - (x[k] - x[k - 1]) / h * tau * np.expm1(-h / tau))
    return np.array(d)


def two_sided_rate(x: Array, t: Array, tau: float) -> Array:
    """Lead less lag of x over lead less lag of the clock."""
    ahead = -behind(x[::-1], t[::-1], tau)[::-1]
    clock_ahead = -behind(t[::-1], t[::-1], tau)[::-1]
    return np.asarray((ahead + behind(x, t, tau)) / (clock_ahead + behind(t, t, tau)))


def slope(x: Array, t: Array, visit: Array) -> Array:
    """Difference quotient over the neighbours in the same dwell; zero where there is none."""
    out = np.zeros_like(x)
    for i in range(len(t)):
        near = [k for k in (i - 1, i, i + 1) if 0 <= k < len(t) and visit[k] == visit[i]]
        if len(near) > 1:
            out[i] = (x[near[-1]] - x[near[0]]) / (t[near[-1]] - t[near[0]])
    return out


def legendre(n: int, x: Array) -> Array:
    return np.asarray(np.polynomial.legendre.Legendre.basis(n)(x))


def side(move: Array, width: float) -> Array:
    """Sign of a move, smooth over moves as small as `width`."""
    return np.asarray(np.sin(np.arctan(move / width)))


def implicit(K: Array, u: Array) -> Array:
    """w - u = K w^2 by repeated insertion, which gains three digits a round where K u is 1e-3."""
    w = u
    for _ in range(9):
        w = u + K * w**2
    return np.asarray(K * w**2)


def leaned(f: Array, beta: Array) -> Array:
    """(C_p^a - 1) f with the matrix as it is printed: beta in the order xy, xz, yz, yx, zx, zy."""
    xy, xz, yz, yx, zx, zy = beta
    return np.asarray(f @ np.array([[0, xz, -xy], [-yz, 0, yx], [zy, -zx, 0]]).T)


def across(f: Array) -> tuple[Array, Array]:
    return f[:, NEXT], f[:, AFTER]


def _cross_coupling(s: Any, p: Any) -> Array:
    xy, xz, yx, yz, zx, zy = p.K_c
    x, y, z = s.force.T
    return np.column_stack([xy * x * y + xz * x * z, yx * y * x + yz * y * z, zx * z * x + zy * z * y])


def _products(s: Any, p: Any) -> Array:
    x, y, z = s.force.T
    po = p.K_po * np.column_stack([y * z, z * x, x * y])
    return np.asarray(po + p.K_pp * np.column_stack([y * y, z * z, x * x]))


def _readout_curve(s: Any, p: Any) -> Array:
    coefficients = {4: p.c_4, 5: p.c_5, 6: p.c_6, 7: p.c_7}
    return np.asarray(sum(c * legendre(n, s.force / G0) for n, c in coefficients.items()))


def _warmth(s: Any) -> Array:
    return col(s.temperature - s.reference_temperature)


def _logged(s: Any, p: Any) -> Array:
    c = s.covariates[p.covariate]
    return np.asarray(c - sum(c) / len(c))


def _self_heating(s: Any, p: Any) -> Array:
    return np.column_stack([p.H[i] * lag((s.force[:, i] / G0) ** 2, s.time, p.tau) for i in range(3)])


def _gyro_misalignment(s: Any, p: Any) -> Array:
    xy, xz, yz, yx, zx, zy = p.beta
    return np.asarray(s.rate @ np.array([[0, xz, -xy], [-yz, 0, yx], [zy, -zx, 0]]).T)


ACCELEROMETER: dict[str, tuple[str, Law]] = {
    "bias": ("Wu et al. (2018), Eq. (6)", lambda s, p: np.tile(p.b, (len(s.time), 1))),
    "scale_factor": ("Wu et al. (2018), Eq. (6)", lambda s, p: s.force / (1 + p.s) - s.force),
    "scale_nonlinearity": ("Wu et al. (2018), Eq. (6), implicit", lambda s, p: implicit(p.K_nl, s.force)),
    "misalignment": ("Wu et al. (2018), Eq. (5)", lambda s, p: leaned(s.force, p.beta)),
    "frame_misalignment": (
        "Wu et al. (2018), Eq. (5), the common part: C = 1 - [theta x]",
        lambda s, p: leaned(s.force, p.theta[[1, 2, 2, 0, 0, 1]]),
    ),
    "quadratic_nonlinearity": ("IEEE Std 1293, K2; Wu et al. (2018), Eq. (6)", lambda s, p: implicit(p.K2, s.force)),
    "odd_quadratic": (
        "IEEE Std 1293, odd quadratic: K f^2 for f > 0 and -K f^2 for f < 0",
        lambda s, p: np.where(s.force > 0, p.K_oq * s.force**2, -p.K_oq * s.force**2),
    ),
    "cubic_nonlinearity": ("IEEE Std 1293, K3 f^3", lambda s, p: p.K3 * s.force * s.force * s.force),
    "scale_factor_asymmetry": (
        "IEEE Std 1293: S f for f > 0 and -S f for f < 0", lambda s, p: p.S * np.where(s.force > 0, s.force, -s.force)
    ),
    "cross_coupling": ("IEEE Std 1293, Kip f_i f_p + Kio f_i f_o", _cross_coupling),
    "cross_axis_product": ("IEEE Std 1293, Kpo f_p f_o + Kpp f_p^2", _products),
    "block_sag": (
        "mounting compliance: the axis leans by c f_j and sees f_k",
        lambda s, p: p.c * across(s.force)[0] * across(s.force)[1],
    ),
    "readout_curve": ("Legendre polynomials of degree 4 to 7", _readout_curve),
    "dead_zone": (
        "IEEE Std 528, dead zone: no output within d, the rest d short",
        lambda s, p: -np.clip(s.force, -p.d, p.d),
    ),
    "soft_saturation": (
        "a parabola beyond the knee",
        lambda s, p: np.where(
            np.abs(s.force) > p.f_0, -p.c * np.sign(s.force) * (np.abs(s.force) - p.f_0) ** 2, 0 * s.force
        ),
    ),
    "accelerometer_hysteresis": (
        "IEEE Std 528, hysteresis; the sign passes zero over 1 mg", lambda s, p: p.h * side(s.move_force, 1e-3 * G0)
    ),
    "post_move_creep": (
        "relaxation with one time constant of the change and of the load",
        lambda s, p: p.c * s.move_force * col(np.exp(-s.since_move / p.tau))
        + p.l * s.force * col(np.exp(-s.since_move / p.tau)),
    ),
    "two_move_memory": (
        "force two dwells ago: now less the last move less the one before",
        lambda s, p: p.m * (s.force - (s.move_force + s.earlier_move_force)),
    ),
}  # fmt: skip

SLOW: dict[str, tuple[str, Law]] = {
    "bias_temperature": ("IEEE Std 1293: b_T (T - T_0)", lambda s, p: p.b_T * _warmth(s)),
    "scale_temperature": ("IEEE Std 1293: s_T f (T - T_0)", lambda s, p: s.force * p.s_T * _warmth(s)),
    "misalignment_temperature": (
        "Wu et al. (2018), Eq. (5), times T - T_0", lambda s, p: leaned(s.force, p.mu_T) * _warmth(s)
    ),
    "bias_temperature_lagged": (
        "tau y' = T - T_0 - y",
        lambda s, p: p.b_L * col(lag(s.temperature - s.reference_temperature, s.time, p.tau)),
    ),
    "bias_temperature_rate": ("r dT/dt", lambda s, p: p.r * col(two_sided_rate(s.temperature, s.time, p.tau))),
    "bias_temperature_squared": ("IEEE Std 1293: q (T - T_0)^2", lambda s, p: p.q * _warmth(s) ** 2),
    "warm_up": ("w / e after tau", lambda s, p: p.w / col(np.exp(s.time / p.tau))),
    "bias_drift": ("IEEE Std 528: d t", lambda s, p: np.outer(s.time, p.d)),
    "slow_bias_drift": (
        "half a turn and a whole turn of a cosine over the span",
        lambda s, p: np.outer(np.cos(np.pi * s.time / p.span), p.w_1)
        + np.outer(np.cos(2 * np.pi * s.time / p.span), p.w_2),
    ),
    "bias_step": ("Heaviside's step", lambda s, p: np.outer(np.heaviside(s.time - p.epoch, 1.0), p.J)),
    "self_heating": ("Lawrence (1998): torquer power, late", _self_heating),
    "bias_covariate": ("regression", lambda s, p: np.outer(_logged(s, p), p.k)),
    "bias_covariate_lagged": ("tau y' = c - y", lambda s, p: np.outer(lag(_logged(s, p), s.time, p.tau), p.k)),
    "bias_covariate_squared": ("regression", lambda s, p: np.outer(_logged(s, p) ** 2, p.k)),
    "supply_voltage": (
        "IEEE Std 1293: k dV + kappa f dV",
        lambda s, p: np.outer(_logged(s, p), p.k) + col(_logged(s, p)) * s.force * p.kappa,
    ),
    "pressure": ("IEEE Std 1293: k dP", lambda s, p: np.outer(_logged(s, p), p.k)),
    "vibration_rectification": (
        "IEEE Std 1293: K_vr times the mean square", lambda s, p: np.outer(s.covariates["vibration"] ** 2, p.K_vr)
    ),
}  # fmt: skip

GYROSCOPE: dict[str, tuple[str, Law]] = {
    "gyro_bias": ("Wang et al. (2019), Eq. (6)", lambda s, p: np.tile(p.epsilon, (len(s.time), 1))),
    "gyro_bias_drift": ("IEEE Std 952, rate ramp", lambda s, p: np.outer(s.time, p.rate)),
    "gyro_bias_temperature": ("IEEE Std 952: e_T (T - T_0)", lambda s, p: np.outer(_warmth(s).ravel(), p.epsilon_T)),
    "gyro_bias_temperature_squared": (
        "IEEE Std 952: e_T2 (T - T_0)^2",
        lambda s, p: np.outer(_warmth(s).ravel() ** 2, p.epsilon_T2),
    ),
    "gyro_bias_temperature_cubed": (
        "IEEE Std 952: e_T3 (T - T_0)^3",
        lambda s, p: np.outer(_warmth(s).ravel() ** 3, p.epsilon_T3),
    ),
    "gyro_scale_factor": ("IEEE Std 952, true = SF x reading", lambda s, p: s.rate @ np.diag(1 / (1 + p.s)) - s.rate),
    "gyro_misalignment": ("Wu et al. (2018), Eq. (5)", _gyro_misalignment),
    "gyro_scale_nonlinearity": ("Wang et al. (2019), Eq. (6), K_g2", lambda s, p: p.K * s.rate * s.rate),
    "gyro_scale_asymmetry": (
        "IEEE Std 952: A omega one way, -A omega the other",
        lambda s, p: p.A * np.where(s.rate > 0, s.rate, -s.rate),
    ),
    "gyro_scale_temperature": ("IEEE Std 952: s_T omega (T - T_0)", lambda s, p: s.rate * p.s_T * _warmth(s)),
    "gyro_g_sensitivity_rate": ("IEEE Std 1431: G f", lambda s, p: s.force @ p.G.reshape(3, 3).T),
}
SENSOR_LAWS = {**ACCELEROMETER, **SLOW, **GYROSCOPE}
