r"""Rotations of frames: about an axis, by small angles, by a vector, and by samples of a rate.

All are passive, as everywhere in the package: a matrix gives the components of a fixed vector in the turned frame. A
frame turned by the rotation vector :math:`\varphi` has

.. math:: C = \exp(-[\varphi \times]) = 1 - \frac{\sin\varphi}{\varphi} [\varphi \times]
          + \frac{1 - \cos\varphi}{\varphi^2} [\varphi \times]^2 .
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from gimbalcal.number import Array, cos, sin


def frame_rotation(direction: str, angle: ArrayLike) -> Array:
    r"""Return the direction cosine matrix of a frame turned by `angle` about one of its axes (passive rotation).

    .. math:: R_x(a) = \begin{bmatrix} 1&0&0\\ 0&\cos a&\sin a\\ 0&-\sin a&\cos a \end{bmatrix}

    and cyclic. Parameters: direction "x", "y" or "z"; angle (...) [rad]. Returns (..., 3, 3).
    """
    angle = np.asarray(angle)
    i = "xyz".index(direction)
    j, k = (i + 1) % 3, (i + 2) % 3
    out = np.zeros((*angle.shape, 3, 3), dtype=np.result_type(angle.dtype, float))
    c, s = cos(angle), sin(angle)
    out[..., i, i] = 1
    out[..., j, j] = c
    out[..., k, k] = c
    out[..., j, k] = s
    out[..., k, j] = -s
    return out


def within_half_turn(angle: Array) -> Array:
    """Return angles (...) [rad] less whole turns, from -pi to pi."""
    return np.asarray((angle + np.pi) % (2 * np.pi) - np.pi)


def tilt_rotation(tilt: ArrayLike) -> Array:
    r"""Return the frame rotation by three small angles about x, then y, then z: ``Rz Ry Rx``; (..., 3) [rad] to (...,
    3, 3).

    Multiplied out, as it stands in every link of every chain:

    .. math:: \begin{bmatrix} c_z c_y & c_z s_y s_x + s_z c_x & s_z s_x - c_z s_y c_x \\
              -s_z c_y & c_z c_x - s_z s_y s_x & s_z s_y c_x + c_z s_x \\ s_y & -c_y s_x & c_y c_x \end{bmatrix}
    """
    tilt = np.asarray(tilt)
    (cx, cy, cz), (sx, sy, sz) = ([x[..., i] for i in range(3)] for x in (cos(tilt), sin(tilt)))
    rows = (
        (cz * cy, cz * sy * sx + sz * cx, sz * sx - cz * sy * cx),
        (-sz * cy, cz * cx - sz * sy * sx, sz * sy * cx + cz * sx),
        (sy, -cy * sx, cy * cx),
    )
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def small_rotation_vector(C: Array) -> Array:
    """Return the first-order rotation vector (..., 3) [rad] of a frame rotation near identity: C = 1 - [v x]."""
    pairs = ((1, 2), (2, 0), (0, 1))
    return np.stack([(C[..., i, j] - C[..., j, i]) / 2 for i, j in pairs], axis=-1)


def cross_matrix(v: Array) -> Array:
    """Return the matrix [v x] (..., 3, 3) that multiplies w to v x w, from v (..., 3)."""
    x, y, z = (v[..., i] for i in range(3))
    o = np.zeros_like(x)
    return np.stack([np.stack(r, -1) for r in ((o, -z, y), (z, o, -x), (-y, x, o))], axis=-2)


def exponential(phi: Array) -> Array:
    """Return exp(-[phi x]) (..., 3, 3): frame rotations by phi (..., 3) [rad]. At -phi it turns vectors by phi."""
    a2 = (phi**2).sum(-1)[..., None, None]
    a = np.sqrt(a2)
    small = a2 < 1e-12  # beyond, series and closed form agree to rounding
    safe = np.where(small, 1.0, a)
    X = cross_matrix(phi)
    s = np.where(small, 1 - a2 / 6, np.sin(safe) / safe)
    c = np.where(small, 0.5 - a2 / 24, (1 - np.cos(safe)) / safe**2)
    return np.asarray(np.eye(3) - s * X + c * (X @ X))


def rotation_vector(R: Array) -> Array:
    """Return phi (..., 3) [rad] of exp([phi x]) (..., 3, 3), which turns vectors by phi, less than half a turn."""
    v = np.stack([R[..., 2, 1] - R[..., 1, 2], R[..., 0, 2] - R[..., 2, 0], R[..., 1, 0] - R[..., 0, 1]], -1) / 2
    sine = np.linalg.norm(v, axis=-1, keepdims=True)
    angle = np.arctan2(sine, (np.trace(R, axis1=-2, axis2=-1)[..., None] - 1) / 2)
    return np.asarray(np.where(sine > 1e-9, v * angle / np.where(sine > 1e-9, sine, 1.0), v))


def left_jacobian(phi: Array) -> Array:
    """Return the derivative of the rotation vector at the end by phi (..., 3, 3): left Jacobian of SO(3) at -phi."""
    a2 = (phi**2).sum(-1)[..., None, None]
    a = np.sqrt(a2)
    small = a2 < 1e-8  # (1 - cos a)/a^2 loses 1e-8 here, the series 1e-9
    safe = np.where(small, 1.0, a)
    X = cross_matrix(phi)
    c = np.where(small, 0.5 - a2 / 24, (1 - np.cos(safe)) / safe**2)
    d = np.where(small, 1 / 6 - a2 / 120, (safe - np.sin(safe)) / safe**3)
    return np.asarray(np.eye(3) - c * X + d * (X @ X))


def mean_rates(time: Array, rate: Array) -> tuple[Array, Array, Array]:
    r"""Return rates whose sum, times the step, is the rotation vector from sample to sample of a rate (n, 3) [rad/s].

    .. math:: \frac{\varphi}{\Delta t} = \frac{a + b}{2} + \frac{\Delta t}{12} (\dot a - \dot b)
              + \frac{\Delta t}{12} \, a \times b ,

    right to the fifth order in the step for a rate that is a cubic between samples a and b with the slopes of `time`
    (n,) [s]. Returns the three terms, (n - 1, 3) each: the first two are linear in the rate, the third (coning) square.
    """
    dt = np.diff(time)[:, None]
    slope = np.gradient(rate, time, axis=0)
    bend = (slope[:-1] - slope[1:]) * dt / 12
    return (rate[1:] + rate[:-1]) / 2, bend, np.cross(rate[:-1], rate[1:]) * dt / 12


def composed_rotation(C: Array) -> Array:
    """Return the rotation (m, 3, 3) of n steps C (m, n, 3, 3), each from the frame in which the one before ended."""
    while (n := C.shape[1]) > 1:  # in pairs: later ones stand on the left
        C = np.concatenate([C[:, 1::2] @ C[:, : n - n % 2 : 2], C[:, n - n % 2 :]], axis=1)
    return np.asarray(C[:, 0])


def rotation_between(a: Array, b: Array, handed: int = 1) -> Array:
    """Return R (3, 3) for which R a is nearest to b, vectors (n, 3), by least squares; handed -1: a mirrored rotation.

    Source: G. Wahba, SIAM Review 7 (1965) 409, solved by the singular value decomposition.
    """
    U, _, Vt = np.linalg.svd(b.T @ a)
    return np.asarray(U @ np.diag([1.0, 1.0, handed * np.sign(np.linalg.det(U @ Vt))]) @ Vt)


def normal_to(u: Array) -> Array:
    """Return a unit vector across each of u (..., 3)."""
    least = np.eye(3)[np.argmin(np.abs(u), axis=-1)]
    v = np.cross(u, least)
    return np.asarray(v / np.linalg.norm(v, axis=-1, keepdims=True))
