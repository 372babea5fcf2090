"""The paper's symbols, and the sensor model they stand in, built from the definition of its frame.

Frames: n east, north, up; m of the block, x along the x gyroscope, y turned by gamma_yz from the y gyroscope in the
plane of both, z by gamma_zx, gamma_zy from the z gyroscope; g, a input axes. A measured vector has a tilde in print and
`_t` here.
"""

from __future__ import annotations

from typing import Any

import sympy as sp

SOURCE = "002"  # of errata.json

AXES = ("x", "y", "z")


def triad(name: str, **assumptions: Any) -> Any:
    """Return three symbols, one for each axis."""
    return sp.symbols([f"{name}{a}" for a in AXES], **{"real": True, **assumptions})


K_g, N_g, b_g, v_g, omega = (triad(n) for n in ("K_g", "N_g", "b_g", "v_g", "omega_"))
K_a, N_a, b_a, v_a, f, f_t, omega_t = (triad(n) for n in ("K_a", "N_a", "b_a", "v_a", "f_", "ft_", "omegat_"))
G_matrix = sp.Matrix(3, 3, sp.symbols([f"G_{i}{j}" for i in AXES for j in AXES], real=True))
K_a2 = triad("K_a2")
K_cross = sp.symbols("K_axy K_axz K_ayx K_ayz K_azx K_azy", real=True)
r = triad("r_")
GAMMA = sp.symbols("gamma_yz gamma_zx gamma_zy", real=True)
ALPHA = sp.symbols("alpha_xz alpha_xy alpha_yz alpha_yx alpha_zy alpha_zx", real=True)


def about(axis: int, angle: Any) -> Any:
    """Return a vector turned about an axis by an angle, right-handed."""
    c, s = sp.cos(angle), sp.sin(angle)
    j, k = (axis + 1) % 3, (axis + 2) % 3
    out = sp.eye(3)
    out[j, j], out[j, k], out[k, j], out[k, k] = c, -s, s, c
    return out


def gyro_axes() -> Any:
    """Return C_m^g: the input axes in m as rows. An axis of m is its input axis turned by the angle, so back by minus
    it.
    """
    yz, zx, zy = GAMMA
    x, y, z = (sp.eye(3)[:, i] for i in range(3))
    return sp.Matrix.hstack(x, about(2, -yz) * y, about(0, -zx) * about(1, -zy) * z).T


def accelerometer_axes() -> Any:
    """Return C_m^a, two angles each."""
    xz, xy, yz, yx, zy, zx = ALPHA
    pairs = (((2, xz), (1, xy)), ((2, yz), (0, yx)), ((1, zy), (0, zx)))
    columns = [about(i, -a) * about(j, -b) * sp.eye(3)[:, n] for n, ((i, a), (j, b)) in enumerate(pairs)]
    return sp.Matrix.hstack(*columns).T


def T_g() -> Any:
    """Return T_g as (3) prints it."""
    yz, zx, zy = GAMMA
    return sp.Matrix([[1, 0, 0], [-yz, 1, 0], [zy, -zx, 1]])


def T_a() -> Any:
    """Return T_a as (6) prints it."""
    xz, xy, yz, yx, zy, zx = ALPHA
    return sp.Matrix([[1, xz, -xy], [-yz, 1, yx], [zy, -zx, 1]])


def crossed(force: Any) -> Any:
    """Return (3, 6) what multiplies K_axy ... K_azy: each accelerometer has the products of its own force with the
    others.
    """
    x, y, z = force
    return sp.Matrix([[x * y, x * z, 0, 0, 0, 0], [0, 0, x * y, y * z, 0, 0], [0, 0, 0, 0, x * z, y * z]])


def squared(force: Any) -> Any:
    return sp.diag(*(c**2 for c in force))


def centripetal(rate: Any, arm: Any) -> Any:
    """Return w x (w x r)."""
    w = sp.Matrix(rate)
    return w.cross(w.cross(sp.Matrix(arm)))


def size_effect(rate: Any) -> Any:
    """Return (3, 3) by which r_x, r_y, r_z enter the readings: each accelerometer on its own axis, in steady
    rotation.
    """
    columns = []
    for i in range(3):
        on_axis = centripetal(rate, sp.eye(3)[:, i])
        columns.append(sp.Matrix([on_axis[j] if j == i else 0 for j in range(3)]))
    return sp.Matrix.hstack(*columns).applyfunc(sp.expand)
