"""What each effect of gimbals, ground, platform drift, motion and line of sight adds, again in plain numpy.

Nothing of `gimbalcal.effects` is called: `s` is the stimulus and `p` carries the parameter values (SI) by field name.
"""

from typing import Any

import numpy as np

from gimbalcal.number import Array
from tests.effects.sensor_laws import Law, col, side, slope

DAY = 86400.0
EARTH_RATE = 7.292115e-5  # rad/s, WGS-84
UNIT = {"x": np.array([1.0, 0.0, 0.0]), "y": np.array([0.0, 1.0, 0.0]), "z": np.array([0.0, 0.0, 1.0])}


def area(x: Array, t: Array) -> Array:
    """Integral from the first row, by the trapezoid rule."""
    out = [0 * x[0]]
    for k in range(1, len(t)):
        out.append(out[-1] + (t[k] - t[k - 1]) * (x[k] + x[k - 1]) / 2)
    return np.array(out)


def wave(A: Array, B: Array, turn: Array) -> Array:
    """A sin + B cos, each (n, axes), of an angle (n,) or (n, axes), as the real part of a phasor."""
    phasor = np.exp(1j * (turn if turn.ndim == 2 else col(turn)))
    return np.asarray(np.real((np.asarray(B) - 1j * np.asarray(A)) * phasor))


def three(two: Array) -> Array:
    """Components (n, 2) with a zero third."""
    return np.column_stack([two, 0 * two[:, 0]])


def spin(w: Array, r: Array) -> Array:
    """omega x (omega x r) = omega (omega . r) - r omega^2."""
    return np.asarray(w * (w @ r)[:, None] - r * (w * w).sum(axis=1)[:, None])


def _nonorthogonality(s: Any, p: Any) -> Array:
    out = np.zeros((*s.readout.shape, 3))
    for i in range(len(s.axis_directions) - 1):
        out[:, i] = p.epsilon[i] * np.cross(UNIT[s.axis_directions[i]], UNIT[s.axis_directions[i + 1]])
    return out


def _wobble(s: Any, p: Any) -> Array:
    """A lean of the axis that turns m times while the gimbal turns once, in the plane across it."""
    out = np.zeros((*s.readout.shape, 3))
    for i, name in enumerate(s.axis_directions):
        first, second = ("xyz".index(name) + 1) % 3, ("xyz".index(name) + 2) % 3
        lean = (p.w_c[i] + 1j * p.w_s[i]) * np.exp(1j * p.m * s.angle[:, i])
        out[:, i, first], out[:, i, second] = lean.real, lean.imag
    return out


def _flexure(s: Any, p: Any) -> Array:
    """Torque about axis i of a mass on the gimbal, and of one on the gimbal inside it, turned by that one's angle."""
    out = np.zeros(s.readout.shape)
    for i, name in enumerate(s.axis_directions):
        first, second = ("xyz".index(name) + 1) % 3, ("xyz".index(name) + 2) % 3
        g = s.gravity * s.load[:, i]
        out[:, i] = p.kappa_1[i] * g[:, first] + p.kappa_2[i] * g[:, second]
        if i:
            inner, along = s.angle[:, i - 1], g[:, "xyz".index(s.axis_directions[i - 1])]
            out[:, i] += (p.kappa_3[i] * np.cos(inner) + p.kappa_4[i] * np.sin(inner)) * along
    return out


def _magnetic(s: Any, p: Any) -> Array:
    field = np.array([np.cos(p.declination), np.sin(p.declination), 0.0])
    return np.stack([p.M.reshape(3, 3) @ (C @ field) for C in s.attitude])


def _size_effect(s: Any, p: Any) -> Array:
    turn, out = slope(s.rate, s.time, s.visit), np.zeros((len(s.time), 3))
    for i, r in enumerate(p.r.reshape(3, 3)):
        out[:, i] = (np.cross(turn, r) + spin(s.rate, r))[:, i]
    return out


def _towards_down(s: Any) -> Array:
    """e_x cross down = (0, -down_z, down_y), with down against the specific force of rest."""
    down = -s.force / s.gravity
    return np.column_stack([0 * down[:, 0], -down[:, 2], down[:, 1]])


def _schuler(s: Any, p: Any) -> Array:
    return three(wave(p.A, p.B, 2 * np.pi * s.time / p.period) / col(np.exp(p.damping * s.time)))


def _day(s: Any) -> Array:
    return np.asarray(2 * np.pi * s.time / DAY)


def _squares(s: Any) -> Array:
    x, y, z = s.force.T
    return np.column_stack([y * z, z * x, x * y])


GIMBAL: dict[str, tuple[str, Law]] = {
    "gimbal_zero": ("Wu et al. (2018), section 3", lambda s, p: np.tile(p.theta_0 * (s.sense or 1), (len(s.time), 1))),
    "gimbal_zero_drift": ("Wallace, TPOINT: a zero that moves with time", lambda s, p: np.outer(s.time, p.rate)),
    "gimbal_zero_step": ("a zero that jumps", lambda s, p: np.outer(1.0 * (s.time >= p.epoch), p.J)),
    "gimbal_nonorthogonality": ("turn about the common perpendicular of two neighbours", _nonorthogonality),
    "encoder_eccentricity": ("once a turn", lambda s, p: wave(p.A, p.B, s.angle)),
    "encoder_two_cycle": ("twice a turn", lambda s, p: wave(p.A, p.B, 2 * s.angle)),
    "encoder_scale_factor": ("a readout that counts too little", lambda s, p: np.einsum("k,nk->nk", p.s, s.angle)),
    "encoder_harmonic": ("n times a turn", lambda s, p: wave(p.A, p.B, p.order * s.angle)),
    "encoder_cyclic_error": ("once a line", lambda s, p: wave(p.A, p.B, p.lines * s.angle)),
    "periodic_worm_error": (
        "Wallace, TPOINT: the period of a tooth, with harmonics",
        lambda s, p: (
            wave(p.A, p.B, p.teeth * s.angle)
            + wave(p.A_2, p.B_2, 2 * p.teeth * s.angle)
            + wave(p.A_3, p.B_3, 3 * p.teeth * s.angle)
            + wave(p.A_4, p.B_4, 4 * p.teeth * s.angle)
            + wave(p.A_5, p.B_5, 5 * p.teeth * s.angle)
        ),
    ),
    "bearing_wobble": ("a lean that turns m times", _wobble),
    "gimbal_flexure": ("torque of a mass off its axis", _flexure),
    "gimbal_friction": ("stiction; the sign passes zero over 1 mrad", lambda s, p: p.h * side(s.move_angle, 1e-3)),
    "position_blunder": ("one position only", lambda s, p: np.outer(s.position == p.position, p.delta)),
}

GROUND: dict[str, tuple[str, Law]] = {
    "base_tilt": ("Wu et al. (2018), Eq. (28)", lambda s, p: np.tile(p.kappa, (len(s.time), 1))),
    "base_tilt_drift": ("tilt rate times time", lambda s, p: three(np.outer(s.time, p.psi))),
    "base_tilt_diurnal": ("the solar day", lambda s, p: three(wave(p.A, p.B, _day(s)))),
    "plumb_line_tide": (
        "IERS Conventions (2010), chapter 7: tilt times g",
        lambda s, p: three(s.gravity * wave(p.A, p.B, 2 * np.pi * s.time / p.period)),
    ),
    "gravity_tide": (
        "IERS Conventions (2010), chapter 7: along the vertical",
        lambda s, p: wave(p.A, p.B, 2 * np.pi * s.time / p.period) * [0.0, 0.0, 1.0],
    ),
    "gravity_error": ("WGS-84", lambda s, p: np.outer(np.full(len(s.time), p.gamma * s.gravity), [0.0, 0.0, 1.0])),
    "vertical_deflection": (
        "WGS-84: g times the deflection", lambda s, p: three(np.tile(p.xi, (len(s.time), 1)) * s.gravity)
    ),
    "magnetic_field": ("IEEE Std 1293: a matrix times the horizontal field", _magnetic),
}  # fmt: skip

DRIFT: dict[str, tuple[str, Law]] = {
    "polar_axis_misalignment": ("Britting (1971)", lambda s, p: np.tile(p.phi_0, (len(s.time), 1))),
    "gyro_drift": ("Nash et al. (1971)", lambda s, p: np.outer(s.time, p.epsilon)),
    "gyro_g_sensitivity": (
        "IEEE Std 528: phi' = D f", lambda s, p: area(np.stack([p.D.reshape(3, 3) @ f for f in s.force]), s.time)
    ),
    "gyro_g2_sensitivity": ("IEEE Std 528: phi' = E f_j f_k", lambda s, p: area(p.E * _squares(s), s.time)),
    "gyro_temperature_drift": (
        "IEEE Std 952: phi' = epsilon_T (T - T_0)",
        lambda s, p: area(np.outer(s.temperature - s.reference_temperature, p.epsilon_T), s.time),
    ),
    "gyro_diurnal_drift": (
        "IEEE Std 952: phi' = A sin + B cos of the solar day, integrated from zero",
        lambda s, p: DAY / (2 * np.pi) * (np.outer(2 * np.sin(_day(s) / 2) ** 2, p.A) + np.outer(np.sin(_day(s)), p.B)),
    ),
    "case_rotation_residue": ("a line", lambda s, p: wave(p.A, p.B, 2 * np.pi * s.time / p.period)),
    "servo_limit_cycle": ("a line", lambda s, p: wave(p.A, p.B, 2 * np.pi * s.time / p.period)),
    "schuler_oscillation": ("Britting (1971): a damped line in roll and pitch", _schuler),
    "clock_rate": (
        "the Earth's turn in the time gained, about the polar axis",
        lambda s, p: np.outer(p.kappa * s.time, [0.0, 0.0, -EARTH_RATE]),
    ),
    "servo_following_error": (
        "the recorded error times its share",
        lambda s, p: np.column_stack([p.k[i] * s.covariates["servo_" + a] for i, a in enumerate("xyz")]),
    ),
}  # fmt: skip

MOTION: dict[str, tuple[str, Law]] = {
    "lever_arm": (
        "Groves (2013), lever arms", lambda s, p: np.cross(slope(s.rate, s.time, s.visit), p.r) + spin(s.rate, p.r)
    ),
    "accelerometer_lever_arm": ("Groves (2013), size effect", _size_effect),
    "gravity_leakage": ("kappa times the angle turned", lambda s, p: area(p.kappa * s.rate, s.time)),
    "torquer_scale_factor": ("Britting (1971)", lambda s, p: area(s.rate * p.kappa, s.time)),
    "time_tag_latency": ("Groves (2013), data timing", lambda s, p: p.latency * slope(s.force, s.time, s.visit)),
    "gyro_latency": ("Groves (2013), data timing", lambda s, p: p.latency * slope(s.rate, s.time, s.visit)),
    "readout_latency": ("Groves (2013), data timing", lambda s, p: p.latency * slope(s.angle, s.time, s.visit)),
}  # fmt: skip

POINTING: dict[str, tuple[str, Law]] = {
    "axis_collimation": (
        "Wallace, TPOINT: CA", lambda s, p: np.outer(np.full(len(s.time), float(p.c)), [0.0, 0.0, 1.0])
    ),
    "tube_flexure": ("Wallace, TPOINT: TF", lambda s, p: p.k * _towards_down(s)),
    "refraction": (
        "Wallace, TPOINT: TX; R cot E above a degree, the lever of `_towards_down` being cos E",
        lambda s, p: p.R * _towards_down(s) * col(1 / np.maximum(s.force[:, 0] / s.gravity, 1 / 57)),
    ),
}  # fmt: skip
MOUNT_LAWS = {**GIMBAL, **GROUND, **DRIFT, **MOTION, **POINTING}
