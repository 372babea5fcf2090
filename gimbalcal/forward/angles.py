"""Gimbal angles that realise an attitude, and the attitude that a navigator makes of its sensors."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gimbalcal.kinematics import DOWN
from gimbalcal.number import Array, apply_matrix, arcsin, arctan2, is_symbolic, sqrt
from gimbalcal.platform import Platform
from gimbalcal.rotation import frame_rotation, small_rotation_vector

# relative singular value of the gimbals' axes below which they turn about one axis less
MIN_RELATIVE_SINGULAR_VALUE = 1e-2
MAX_STEPS, MAX_STEP_RAD = 8, 1e-15  # each step squares what is left of milliradians; rad


def ideal_angles(platform: Platform, phase: Array, latitude: float) -> Array:
    """Return angles (n, k) of a perfect platform on a level base, S_t, 0, L, 0: Wu et al. (2018), Eq. (4)."""
    ideal = {"platform": phase, "middle": latitude * np.ones_like(phase)}
    return platform.angles({k: v for k, v in ideal.items() if k in platform.axis_names}, phase.shape)


def gimbal_angles(platform: Platform, C_bp: Array, ideal: Array, error: Array | float, tilts: Array | None) -> Array:
    """Return the true angles (n, k) at which the chain, axis tilts (n, k, 3) included, realises C_bp (n, 3, 3), from
    ideal ones.

    The outer gimbal follows the inner one so that the *readout* of the inner gimbal stays at zero: its true angle is
    its encoder's error (n, k). The others by Newton on the rotation vector; two steps leave 1e-16 rad
    for errors of 1e-3 rad.
    """
    free = [i for i, name in enumerate(platform.axis_names) if name != "inner"]
    inner = [i for i, name in enumerate(platform.axis_names) if name == "inner"]
    angle = ideal
    if inner and not isinstance(error, float):
        angle = angle.astype(np.result_type(angle, error))
        angle[..., inner] += error[..., inner]
    for _ in range(2):
        C, turns = _attitude_chain(platform, angle)
        C = C if tilts is None else platform.attitude(angle, tilts)
        rotation, J = small_rotation_vector(C_bp @ np.swapaxes(C, -1, -2)), turns[..., free]
        step = (
            np.linalg.solve(J, rotation[..., None])[..., 0]
            if not is_symbolic(rotation)
            else _symbolic_solve(J, rotation)
        )
        angle = angle.astype(np.result_type(angle, step))
        angle[..., free] += step
    return angle


def nearest_angles(platform: Platform, C_bp: Array, start: Array, free: Sequence[int]) -> Array:
    """Return angles (n, k) near `start` that turn the perfect chain closest to C_bp (n, 3, 3), by the free gimbals
    alone.

    The smallest changes that do it. What no free gimbal can turn, as in gimbal lock, stays.
    """
    angle = np.array(start, dtype=float)
    for _ in range(MAX_STEPS):
        C, turns = _attitude_chain(platform, angle)
        rotation = small_rotation_vector(C_bp @ np.swapaxes(C, -1, -2))
        step = apply_matrix(np.linalg.pinv(turns[..., free], rcond=MIN_RELATIVE_SINGULAR_VALUE), rotation)
        angle[..., free] += step
        if np.max(np.abs(step), initial=0.0) < MAX_STEP_RAD:
            break
    return angle


def _symbolic_solve(J: Array, b: Array) -> Array:
    import sympy

    return np.array([list(sympy.Matrix(m).LUsolve(sympy.Matrix(v))) for m, v in zip(J, b, strict=True)], dtype=object)


def _attitude_chain(platform: Platform, angle: Array) -> tuple[Array, Array]:
    """Return the attitude (n, 3, 3) of untilted axes, and the directions (n, 3, k) in platform axes of their turns."""
    C, turns = np.broadcast_to(np.eye(3), (*angle.shape[:-1], 3, 3)), []
    for i, axis in enumerate(platform.axes):
        turns.append(axis.sign * C[..., "xyz".index(axis.direction)])
        link = frame_rotation(axis.direction, axis.sign * angle[..., i] + axis.offset)
        C = C @ link if i else link
    return C, np.stack(turns, axis=-1)


def navigator_attitude_error(platform: Platform, force: Array, readout: Array) -> Array:
    r"""Return the attitude of the still, level, north-pointing base minus what the navigator makes of its sensors (n,
    3) [rad].

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
    return np.asarray(-force / sqrt((force**2).sum(axis=-1, keepdims=True)))
