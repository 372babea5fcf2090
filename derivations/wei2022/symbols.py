"""The paper's symbols. Frames: n east, north, up; p of the block (b where it stands still), x along the x gyroscope."""

from __future__ import annotations

from typing import Any

import sympy as sp

SOURCE = "003"  # of errata.json

AXES = ("x", "y", "z")


def triad(name: str) -> Any:
    """Return three symbols, one for each axis."""
    return sp.symbols([f"{name}_{a}" for a in AXES], real=True)


epsilon, nabla, omega, f = (triad(n) for n in ("epsilon", "nabla", "omega", "f"))
dK_g, dK_a = triad("dK_g"), triad("dK_a")
dA_g = sp.symbols("dA_gyx dA_gzx dA_gzy", real=True)
dA_a = sp.symbols("dA_ayx dA_azx dA_axy dA_azy dA_axz dA_ayz", real=True)  # order of the states
STATES = (*epsilon, *nabla, *dK_g, *dK_a, *dA_g, *dA_a)
NAMES = (
    "eps_x", "eps_y", "eps_z", "nabla_x", "nabla_y", "nabla_z", "dK_gx", "dK_gy", "dK_gz", "dK_ax", "dK_ay", "dK_az",
    "dA_gyx", "dA_gzx", "dA_gzy", "dA_ayx", "dA_azx", "dA_axy", "dA_azy", "dA_axz", "dA_ayz",
)  # fmt: skip


def installation_g() -> Any:
    """Return (3, 3) of Eq. (5)."""
    yx, zx, zy = dA_g
    return sp.Matrix([[0, 0, 0], [yx, 0, 0], [zx, zy, 0]])


def installation_a() -> Any:
    """Return (3, 3) of Eq. (6)."""
    yx, zx, xy, zy, xz, yz = dA_a
    return sp.Matrix([[0, xy, xz], [yx, 0, yz], [zx, zy, 0]])
