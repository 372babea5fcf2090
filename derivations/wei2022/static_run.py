"""Section 4.1: 48 h of inertial navigation at rest with what Table 3 left over, "reduced by 3639 m".

Height is held. At 30 deg north the seven errors left obey dx/dt = F x + u with F and u constant: F from the derived
mechanisation, u = (-C dw, C df) from Eqs. (7), (8) with the residuals. How the unit stood, whether it rotated, and what
the navigator began with is not printed: here it stands still, x to the east and z up, and begins without error.
"""

from __future__ import annotations

from functools import cache
from math import radians
from typing import Any

import numpy as np

from derivations import mechanisation as nav
from derivations.verdict import ARCSEC, NOT_DETERMINED, Verdict
from derivations.wei2022.bound import columns
from derivations.wei2022.symbols import SOURCE
from derivations.wei2022.tables import GROUPS, residuals

LATITUDE, HOURS, STEP = radians(30.0), 48.0, 60.0  # of Section 4.1; s
DEG_H, UG = radians(1.0) / 3600, 9.80665e-6
KEPT = [0, 1, 2, 3, 4, 6, 7]  # without vertical velocity and height


def constants(scheme: int) -> Any:
    """Return (21,) residuals in SI, order of the states."""
    units = dict(zip(GROUPS, (DEG_H, UG, 1e-6, 1e-6, ARCSEC, ARCSEC), strict=True))
    r = np.array(residuals(scheme))
    return np.concatenate([r[part] * units[name] for name, part in GROUPS.items()])


def driven(scheme: int) -> Any:
    """Return (7,) what the residuals drive."""
    w = nav.earth_in_n(np.float64(LATITUDE))[None]
    f = np.array([[0, 0, float(nav.gravity(LATITUDE, 0.0))]])
    dw, df = np.split((columns(w, f) @ constants(scheme))[0], 2)
    return np.concatenate([-dw, df[:2], [0.0, 0.0]])


@cache
def largest(scheme: int) -> float:
    """Return the largest horizontal position error [m]."""
    f = [0, 0, float(nav.gravity(LATITUDE, 0.0))]
    F = nav.linearised([0, 0, 0, LATITUDE, 0, 0], f)[:, :9][np.ix_(KEPT, KEPT)]
    A = np.zeros((8, 8))
    A[:7, :7], A[:7, 7] = F, driven(scheme)
    step, term = np.eye(8), np.eye(8)
    for n in range(1, 12):
        term = term @ A * STEP / n
        step = step + term
    x, worst = np.array([0.0] * 7 + [1.0]), 0.0
    R_M, R_N = nav.radii(LATITUDE)
    for _ in range(int(HOURS * 3600 / STEP)):
        x = step @ x
        worst = max(worst, float(np.hypot(x[5] * R_M, x[6] * R_N * np.cos(LATITUDE))))
    return worst


def verdicts() -> tuple[Verdict, ...]:
    """Return both differences of Section 4.1."""
    eighteen, thirty = largest(0), largest(1)
    first = Verdict(
        SOURCE, "Section 4.1, 3639 m", NOT_DETERMINED, "the maximum position error was reduced by 3639 m",
        f"{eighteen:.0f} m to {thirty:.0f} m, {eighteen - thirty:.0f} m less", "not quantified",
        f"It hangs on how the unit stood or rotated and on what the navigator began with; neither is printed. Still, x "
        f"east, z up and no error to begin with, the residuals of Table 3 make {eighteen / 1000:.1f} km and "
        f"{thirty / 1000:.1f} km in 48 h: the same order.",
    )  # fmt: skip
    second = Verdict(
        SOURCE, "Section 4.1, 865 m", NOT_DETERMINED, "865 m smaller than that of the 10-position scheme", "-",
        "not quantified", "Neither the ten positions nor their residuals are printed.",
    )  # fmt: skip
    return first, second
