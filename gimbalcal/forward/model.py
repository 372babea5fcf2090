"""What the channels of a platform with these effects read: encoder-referenced, inertially fixed, pointing."""

from __future__ import annotations

from collections.abc import Container, Sequence

import numpy as np

from gimbalcal.earth import EARTH_RATE
from gimbalcal.effects import Effect, Stage, Stimulus
from gimbalcal.errors import InputError
from gimbalcal.forward.angles import gimbal_angles, ideal_angles, navigator_attitude_error
from gimbalcal.kinematics import DOWN, navigation_to_platform, required_latitude
from gimbalcal.number import STEP, Array, apply_matrix, arctan2, cos, sin
from gimbalcal.platform import Platform
from gimbalcal.rotation import tilt_rotation

SENSED_QUANTITIES = ("specific_force", "angular_rate")  # by sensors in one block
SENSOR_CHAINS = {
    "specific_force": ("force", (Stage.INPUT_AXIS, Stage.SCALE, Stage.ACCELEROMETER)),
    "angular_rate": ("rate", (Stage.RATE_AXIS, Stage.RATE_SCALE, Stage.GYROSCOPE)),
}  # what sensors feel, and the stages that add to it in this order until it is read


def predict(
    platform: Platform, s: Stimulus, effects: Sequence[Effect], kind: str = "multi-position"
) -> dict[str, Array]:
    """Return the channel outputs of a platform with these effects.

    Returns "specific_force" (n, 3) [m/s^2] and "angular_rate" (n, 3) [rad/s], of gyroscopes in the same block that
    turn at the stimulus' rate and feel the true force; for a static run, whose gyroscopes hold the platform, instead
    "gimbal_angle" (n, k) [rad] and "attitude_error" (n, 3) [rad]; for a pointing recording "pointing" (n, 2) [rad],
    seen direction minus target across the innermost axis' plane and along it. Float, complex or symbolic, as the
    parameters are.
    """
    other = OTHER_KINDS.get(kind)
    return other(platform, s, effects) if other else sensors(block_force(platform, s, effects), s, effects)


def sensors(
    force: Array, s: Stimulus, effects: Sequence[Effect], quantities: Container[str] = SENSED_QUANTITIES
) -> dict[str, Array]:
    """Return the outputs of accelerometers and gyroscopes in a block that feels the specific force f^p (n, 3)."""
    out = {}
    if "specific_force" in quantities:
        out["specific_force"] = accelerometers(force, s, effects)
    if "angular_rate" in quantities:
        out["angular_rate"] = gyroscopes(s.rate, s.at(force=force), effects)
    return out


def _total_addition(effects: Sequence[Effect], stage: Stage, s: Stimulus) -> Array | float:
    """Return the sum of what all effects add at one stage (0.0 where none does)."""
    return sum((e.contribution(s) for e in effects if e.stage is stage), start=0.0)


def _stage_rotation(effects: Sequence[Effect], stage: Stage, s: Stimulus) -> Array:
    tilt = _total_addition(effects, stage, s)
    return np.eye(3) if isinstance(tilt, float) else tilt_rotation(tilt)


def block_force(platform: Platform, s: Stimulus, effects: Sequence[Effect]) -> Array:
    """Return f^p (n, 3) where the encoders say where the platform points; without gimbals the stimulus says it."""
    if not platform.axes:
        tilt = _total_addition(effects, Stage.PLATFORM, s)
        return s.force if isinstance(tilt, float) else apply_matrix(tilt_rotation(tilt), s.force)
    rotation = _stage_rotation(effects, Stage.PLATFORM, s)
    C_np, s = _mount(platform, s, effects)
    gravity = s.gravity * DOWN + _total_addition(effects, Stage.GRAVITY, s)
    return -apply_matrix(rotation @ C_np, np.broadcast_to(gravity, s.force.shape))


def _mount(platform: Platform, s: Stimulus, effects: Sequence[Effect]) -> tuple[Array, Stimulus]:
    """Return C_np of a mount whose readouts say where it points, and the stimulus with its true angles."""
    angle = s.readout + _total_addition(effects, Stage.ENCODER, s)
    s = s.at(angle=angle)
    tilts = _total_addition(effects, Stage.AXIS_TILT, s)
    C_bp = platform.attitude(angle, None if isinstance(tilts, float) else tilts)
    return C_bp @ _stage_rotation(effects, Stage.BASE, s), s


def attitude(platform: Platform, s: Stimulus, effects: Sequence[Effect]) -> Array:
    """Return C_np (n, 3, 3) of a platform whose readouts say where it points, as these effects make it stand."""
    return np.asarray(_stage_rotation(effects, Stage.PLATFORM, s) @ _mount(platform, s, effects)[0])


def _line_of_sight(platform: Platform, s: Stimulus, effects: Sequence[Effect]) -> dict[str, Array]:
    """Return the observed direction minus target (n, 2) [rad], across and along, in the axes of a perfect mount."""
    aimed = on_target(platform, s).aimed
    C_np, s = _mount(platform, s, effects)
    s = s.at(force=-s.gravity * C_np[..., 2])
    along = _stage_rotation(effects, Stage.LINE_OF_SIGHT, s)[..., :1, :]
    return {"pointing": ((along @ C_np) @ aimed)[..., 0, :]}


def on_target(platform: Platform, s: Stimulus) -> Stimulus:
    """Return the stimulus with the line of sight of a perfect mount on its target, computed once for many effects.

    Raises InputError where nothing says where the target was.
    """
    if s.aimed is not None:
        return s
    if s.true_angle is None:
        raise InputError("a pointing recording needs `true_angle` columns: where the target really was")
    C = platform.attitude(s.true_angle)
    return s.at(aimed=np.stack([C[..., 1, :], -C[..., 2, :]], axis=-1))


def accelerometers(force: Array, s: Stimulus, effects: Sequence[Effect]) -> Array:
    """Return the accelerometer outputs (n, 3) [m/s^2] for the specific force f^p (n, 3): Wu et al. (2018), Eq. (6)."""
    return reading_after_stages(*SENSOR_CHAINS["specific_force"], s.at(force=force), effects)


def angular_rate(platform: Platform, s: Stimulus, effects: Sequence[Effect], readout_rate: Array) -> Array:
    r"""Return angular rate (n, 3) [rad/s] of the sensor block against the inertial frame, in its axes.

    .. math:: \omega = -\mathrm{vee}(\dot C_n^p {C_n^p}^T) + C_n^p \, \omega_{ie}^n

    exact for the chain as it is built; `readout_rate` (n, k) [rad/s] says how the readouts change.
    """
    C_np = _mount(platform, s, effects)[0]
    earth = EARTH_RATE * np.array([cos(required_latitude(s.latitude)), 0.0, -sin(required_latitude(s.latitude))])
    own = rate_of_chain(platform, s, effects, readout_rate)
    return apply_matrix(_stage_rotation(effects, Stage.PLATFORM, s), own + apply_matrix(C_np, earth + 0 * own))


def rate_of_chain(platform: Platform, s: Stimulus, effects: Sequence[Effect], readout_rate: Array) -> Array:
    """Return the part of `angular_rate` by which the gimbals turn the sensor block against the base, (n, 3) [rad/s]."""
    C_np = _mount(platform, s, effects)[0]
    moved = _mount(platform, s.at(readout=s.readout + 1j * STEP * readout_rate), effects)[0]
    W = (moved.imag / STEP) @ np.swapaxes(C_np, -1, -2)
    return -np.stack([W[..., 2, 1], W[..., 0, 2], W[..., 1, 0]], axis=-1)


def gyroscopes(rate: Array, s: Stimulus, effects: Sequence[Effect]) -> Array:
    """Return the gyroscope outputs (n, 3) [rad/s] for the angular rate (n, 3) of the sensor block."""
    return reading_after_stages(*SENSOR_CHAINS["angular_rate"], s.at(rate=rate), effects)


def reading_after_stages(felt: str, stages: Sequence[Stage], s: Stimulus, effects: Sequence[Effect]) -> Array:
    """Return what is left (n, 3) of the "force" or "rate" felt in `s` after each of the stages has added to it."""
    value = getattr(s, felt)
    for stage in stages:
        value = value + _total_addition(effects, stage, s)
        s = s.at(**{felt: value})
    return np.asarray(value)


def _inertially_fixed(platform: Platform, s: Stimulus, effects: Sequence[Effect]) -> dict[str, Array]:
    """Return outputs of a platform that gyroscopes hold while a still base turns with the Earth."""
    L = required_latitude(s.latitude)
    unit = s.force / s.gravity
    phase = arctan2(unit[..., 1], unit[..., 0])
    drift = _stage_rotation(effects, Stage.PLATFORM, s)
    C_np = drift @ navigation_to_platform(phase, L)
    gravity = s.gravity * DOWN + _total_addition(effects, Stage.GRAVITY, s)
    force = accelerometers(-apply_matrix(C_np, np.broadcast_to(gravity, s.force.shape)), s, effects)
    C_nb = _stage_rotation(effects, Stage.BASE, s)
    s = s.at(angle=ideal_angles(platform, phase, L))
    tilts, off = _total_addition(effects, Stage.AXIS_TILT, s), _total_addition(effects, Stage.ENCODER, s)
    tilted = None if isinstance(tilts, float) else tilts
    angle = gimbal_angles(platform, C_np @ np.swapaxes(C_nb, -1, -2), s.angle, off, tilted)
    s = s.at(angle=angle)
    readout = angle - _total_addition(effects, Stage.ENCODER, s)
    attitude = navigator_attitude_error(platform, force, readout) + _total_addition(effects, Stage.ATTITUDE, s)
    return {"specific_force": force, "gimbal_angle": readout, "attitude_error": attitude}


OTHER_KINDS = {"static-run": _inertially_fixed, "pointing": _line_of_sight}
"""What is predicted of kinds of recording whose sensor block is not held where encoders say."""
