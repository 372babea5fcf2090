r"""The one forward model: gimbal angles, time and environment in, sensor readings out.

This is the only place where the stages of `effects` meet. Kinds of recording differ in what holds still:

* *encoder-referenced* (multi-position, rotation): the readouts say where the platform points,

  .. math:: f^p = -C_b^p(\theta) \, C_n^b \, g^n, \qquad \theta = \text{readout} + \delta\theta ;

* *inertially fixed* (static run): the gyroscopes hold the platform, the Earth turns under it, and the gimbal angles
  are a result,

  .. math:: f^p / g = R(\varphi) (\cos S_t \cos L, \; \sin S_t \cos L, \; \sin L), \qquad
            C_b^p(\theta) = R(\varphi) \, C_n^p(S_t, L) \, {C_n^b}^T .

* *pointing*: a telescope or antenna is told a direction; what a pointing model leaves is the direction seen across
  and along the innermost gimbal,

  .. math:: v = {C_n^b}^T {C_b^p(\theta)}^T R(\text{line of sight})^T \, x_p ,

  against the target, in the axes in which a perfect mount would see it.

Every derivative is a complex step through the same code.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from gimbalcal.earth import EARTH_RATE
from gimbalcal.effects import Effect, Parameter, Stage, Stimulus, values, with_values
from gimbalcal.errors import InputError
from gimbalcal.kinematics import DOWN, navigation_to_platform, required_latitude
from gimbalcal.number import STEP, Array, apply_matrix, arcsin, arctan2, cos, is_symbolic, sin, tilt_rotation
from gimbalcal.platform import Platform


def predict(
    platform: Platform, s: Stimulus, effects: Sequence[Effect], kind: str = "multi-position"
) -> dict[str, Array]:
    """Channel outputs of a platform with these effects.

    Returns "specific_force" (n, 3) [m/s^2] and, for a static run, "gimbal_angle" (n, k) [rad] and "attitude_error"
    (n, 3) [rad]; for a pointing recording "pointing" (n, 2) [rad], seen direction minus target across the innermost
    axis' plane and along it. Float, complex or symbolic, as the parameters are.
    """
    if kind == "static-run":
        return _inertially_fixed(platform, s, effects)
    if kind == "pointing":
        return {"pointing": _pointing(platform, s, effects)}
    return {"specific_force": accelerometers(_encoder_referenced(platform, s, effects), s, effects)}


def _total(effects: Sequence[Effect], stage: Stage, s: Stimulus) -> Array | float:
    """Sum of what all effects add at one stage (0.0 where none does)."""
    return sum((e.contribution(s) for e in effects if e.stage is stage), start=0.0)


def _rotation(effects: Sequence[Effect], stage: Stage, s: Stimulus) -> Array:
    tilt = _total(effects, stage, s)
    return np.eye(3) if isinstance(tilt, float) else tilt_rotation(tilt)


def _encoder_referenced(platform: Platform, s: Stimulus, effects: Sequence[Effect]) -> Array:
    """f^p (n, 3) where the encoders say where the platform points; without gimbals the stimulus says it."""
    rotation = _rotation(effects, Stage.PLATFORM, s)
    if not platform.axes:
        return apply_matrix(rotation, s.force)
    C_np, s = _mount(platform, s, effects)
    gravity = s.gravity * DOWN + _total(effects, Stage.GRAVITY, s)
    return -apply_matrix(rotation @ C_np, np.broadcast_to(gravity, s.force.shape))


def _mount(platform: Platform, s: Stimulus, effects: Sequence[Effect]) -> tuple[Array, Stimulus]:
    """C_np of a mount whose readouts say where it points, and the stimulus with its true angles."""
    angle = s.readout + _total(effects, Stage.ENCODER, s)
    s = s.at(angle=angle)
    tilts = _total(effects, Stage.AXIS_TILT, s)
    C_bp = platform.attitude(angle, None if isinstance(tilts, float) else tilts)
    return C_bp @ _rotation(effects, Stage.BASE, s), s


def _pointing(platform: Platform, s: Stimulus, effects: Sequence[Effect]) -> Array:
    """Seen direction minus target (n, 2) [rad], across and along the innermost axis, as a perfect mount sees them."""
    true_angle = s.true_angle
    if true_angle is None:
        raise InputError("a pointing recording needs `true_angle` columns: where the target really was")
    C_np, s = _mount(platform, s, effects)
    s = s.at(force=-s.gravity * C_np[..., 2])
    sight = np.swapaxes(_rotation(effects, Stage.LINE_OF_SIGHT, s) @ C_np, -1, -2)[..., 0]
    seen = apply_matrix(platform.attitude(true_angle), sight)
    return np.stack([seen[..., 1], -seen[..., 2]], axis=-1)


def accelerometers(force: Array, s: Stimulus, effects: Sequence[Effect]) -> Array:
    """Accelerometer outputs (n, 3) [m/s^2] for the specific force f^p (n, 3): Wu et al. (2018), Eq. (6)."""
    s = s.at(force=force)
    s = s.at(force=s.force + _total(effects, Stage.INPUT_AXIS, s))
    s = s.at(force=s.force + _total(effects, Stage.SCALE, s))
    return np.asarray(s.force + _total(effects, Stage.ACCELEROMETER, s))


def turning(platform: Platform, s: Stimulus, effects: Sequence[Effect], readout_rate: Array) -> Array:
    r"""Angular rate (n, 3) [rad/s] of the sensor block against the inertial frame, in its axes.

    .. math:: \omega = -\mathrm{vee}(\dot C_n^p {C_n^p}^T) + C_n^p \, \omega_{ie}^n

    exact for the chain as it is built; `readout_rate` (n, k) [rad/s] says how the readouts change.
    """
    C_np = _mount(platform, s, effects)[0]
    moved = _mount(platform, s.at(readout=s.readout + 1j * STEP * readout_rate), effects)[0]
    W = (moved.imag / STEP) @ np.swapaxes(C_np, -1, -2)
    earth = EARTH_RATE * np.array([cos(required_latitude(s.latitude)), 0.0, -sin(required_latitude(s.latitude))])
    own = -np.stack([W[..., 2, 1], W[..., 0, 2], W[..., 1, 0]], axis=-1)
    return apply_matrix(_rotation(effects, Stage.PLATFORM, s), own + apply_matrix(C_np, earth + 0 * own))


def gyroscopes(rate: Array, s: Stimulus, effects: Sequence[Effect]) -> Array:
    """Gyroscope outputs (n, 3) [rad/s] for the angular rate (n, 3) of the sensor block."""
    return np.asarray(rate + _total(effects, Stage.GYROSCOPE, s.at(rate=rate)))


def _inertially_fixed(platform: Platform, s: Stimulus, effects: Sequence[Effect]) -> dict[str, Array]:
    """Outputs of a platform that gyroscopes hold while a still base turns with the Earth."""
    L = required_latitude(s.latitude)
    unit = s.force / s.gravity
    phase = arctan2(unit[..., 1], unit[..., 0])
    drift = _rotation(effects, Stage.PLATFORM, s)
    C_np = drift @ navigation_to_platform(phase, L)
    gravity = s.gravity * DOWN + _total(effects, Stage.GRAVITY, s)
    force = accelerometers(-apply_matrix(C_np, np.broadcast_to(gravity, s.force.shape)), s, effects)
    C_nb = _rotation(effects, Stage.BASE, s)
    s = s.at(angle=_ideal_angles(platform, phase, L))
    angle = _gimbal_angles(platform, C_np @ np.swapaxes(C_nb, -1, -2), s, effects)
    s = s.at(angle=angle)
    readout = angle - _total(effects, Stage.ENCODER, s)
    attitude = navigator_attitude_error(platform, force, readout) + _total(effects, Stage.ATTITUDE, s)
    return {"specific_force": force, "gimbal_angle": readout, "attitude_error": attitude}


def _ideal_angles(platform: Platform, phase: Array, latitude: float) -> Array:
    """Angles (n, k) of a perfect platform on a level base: S_t, 0, L, 0."""
    ideal = {"platform": phase, "middle": latitude * np.ones_like(phase)}
    return platform.angles({k: v for k, v in ideal.items() if k in platform.axis_names}, phase.shape)


def _gimbal_angles(platform: Platform, C_bp: Array, s: Stimulus, effects: Sequence[Effect]) -> Array:
    """True angles (n, k) at which the chain, axis tilts included, realises C_bp; s.angle holds the ideal ones.

    The outer gimbal follows the inner one so that the *readout* of the inner gimbal stays at zero: its true angle is
    its encoder's error. The others by Newton on the rotation vector; two steps leave 1e-16 rad for errors of 1e-3 rad.
    """
    free = [i for i, name in enumerate(platform.axis_names) if name != "inner"]
    held = [i for i, name in enumerate(platform.axis_names) if name == "inner"]
    error = _total(effects, Stage.ENCODER, s)
    total = _total(effects, Stage.AXIS_TILT, s)
    tilts = None if isinstance(total, float) else total
    angle = s.angle
    if held and not isinstance(error, float):
        angle = angle.astype(np.result_type(angle, error))
        angle[..., held] += error[..., held]
    for _ in range(2):
        C = platform.attitude(angle, tilts)
        left = _rotation_vector(C_bp @ np.swapaxes(C, -1, -2))
        J = np.stack([_axis_in_platform(platform, angle, i) for i in free], axis=-1)
        step = np.linalg.solve(J, left[..., None])[..., 0] if not is_symbolic(left) else _symbolic_solve(J, left)
        angle = angle.astype(np.result_type(angle, step))
        angle[..., free] += step
    return angle


def _symbolic_solve(J: Array, b: Array) -> Array:
    import sympy

    return np.array([list(sympy.Matrix(m).LUsolve(sympy.Matrix(v))) for m, v in zip(J, b, strict=True)], dtype=object)


def _rotation_vector(C: Array) -> Array:
    """First-order rotation vector of a frame rotation near identity: C = 1 - [v x] (..., 3)."""
    pairs = ((1, 2), (2, 0), (0, 1))
    return np.stack([(C[..., i, j] - C[..., j, i]) / 2 for i, j in pairs], axis=-1)


def _axis_in_platform(platform: Platform, angle: Array, i: int) -> Array:
    """Direction (n, 3) in platform axes about which readout i turns the platform."""
    inner = Platform(platform.name, platform.axes[:i]).attitude(angle[..., :i])
    axis = platform.axes[i]
    unit = np.zeros(3)
    unit["xyz".index(axis.direction)] = axis.sign
    return apply_matrix(inner, np.broadcast_to(unit, (*angle.shape[:-1], 3)))


def navigator_attitude_error(platform: Platform, force: Array, readout: Array) -> Array:
    r"""Attitude of the still, level, north-pointing base minus what the navigator makes of its sensors (n, 3) [rad].

    The navigator takes down from the measured force, north from the platform's polar axis z_p, and the base from the
    gimbal readouts: C_n^b = C_p^b(readout) C_n^p(f, z_p). Roll, pitch, yaw with the sign of Wu et al. (2018), Eq. (28).
    """
    down = -force / np.sqrt((force**2).sum(axis=-1, keepdims=True)) if not is_symbolic(force) else _unit_down(force)
    pole = np.broadcast_to(DOWN, down.shape)
    east = np.cross(down, pole)
    length = (east**2).sum(axis=-1, keepdims=True)
    east = east / (np.sqrt(length) if not is_symbolic(length) else length ** (1 / 2))
    C_np = np.stack([np.cross(east, down), east, down], axis=-1)
    C_nb = np.swapaxes(platform.attitude(readout), -1, -2) @ C_np
    # C_nb of Eq. (3): first row holds yaw and pitch, third column pitch and roll.
    roll = arctan2(C_nb[..., 1, 2], C_nb[..., 2, 2])
    pitch = -arcsin(C_nb[..., 0, 2])
    yaw = arctan2(C_nb[..., 0, 1], C_nb[..., 0, 0])
    return -np.stack([roll, pitch, yaw], axis=-1)


def _unit_down(force: Array) -> Array:
    from gimbalcal.number import sqrt

    return np.asarray(-force / sqrt((force**2).sum(axis=-1, keepdims=True)))


def jacobian(
    platform: Platform,
    s: Stimulus,
    effects: Sequence[Effect],
    wanted: Sequence[Parameter],
    kind: str = "multi-position",
) -> dict[str, Array]:
    """Derivatives of `predict` by the wanted parameters, exact by complex step: channel to (n, c, p), SI."""
    x0 = values(effects, wanted)

    def outputs(x: Array) -> dict[str, Array]:
        return predict(platform, s, with_values(effects, wanted, x, s.axis_names), kind)

    return complex_step(outputs, x0)


def complex_step(function: Callable[[Array], dict[str, Array]], x0: Array) -> dict[str, Array]:
    """Jacobian of a dict of arrays by the complex step: x (p,) to channel (..., p)."""
    columns = [function(x0 + 1j * STEP * unit) for unit in np.eye(x0.size)]
    return {k: np.stack([c[k].imag / STEP for c in columns], axis=-1) for k in columns[0]}
