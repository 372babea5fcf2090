"""Readings of a unit that is turned from stop to stop in its place: means of the exact rate and force.

C_b^n (t), north, east, down, follows from the turns; rate and force are what mechanics says of a unit there,
w = C_n^b w_ie + turn, f = -C_n^b g. Nothing is navigated to make them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from derivations import mechanisation as nav
from derivations.readings import TURN
from derivations.turning import rotation

LATITUDE = 0.6
STEP, STOP, TURNING = 0.1, 12.0, 8.0  # s
TURNS = (((1, 0, 0), 1.5), ((0, 1, 0), 1.6), ((0, 0, 1), -1.4), ((0, 1, 0), 1.5))
START = rotation((0.6, 0.0, 0.8), 0.9)  # C_b^n
POINTS, WEIGHTS = np.polynomial.legendre.leggauss(6)


@dataclass(frozen=True, eq=False)
class Turned:
    """n intervals that end at `time` (n,) [s]: means of force and rate (n, 6) in SI, position (n,), 0 on the way.

    attitude: C_b^n as a function of time.
    """

    time: Any
    readings: Any
    position: Any
    gravity: float

    def attitude(self, t: float) -> Any:
        """Return C_b^n (3, 3) at t."""
        return _motion(t)[0]


def _motion(t: float) -> tuple[Any, Any]:
    """Return C_b^n and the rate of the unit against n, in b: each turn comes and goes as 1 - cos."""
    C = START
    for axis, angle in TURNS:
        u = np.array(axis, float)
        since = t - STOP
        if since <= 0:
            return C, np.zeros(3)
        if since < TURNING:
            p = 2 * np.pi * since / TURNING
            return C @ rotation(u, angle * (p - np.sin(p)) / (2 * np.pi)), angle / TURNING * (1 - np.cos(p)) * u
        C, t = C @ rotation(u, angle), since - TURNING
    return C, np.zeros(3)


@cache
def turned() -> Turned:
    """Return the means over each interval, by Gauss and Legendre."""
    total = (len(TURNS) + 1) * STOP + len(TURNS) * TURNING
    n = round(total / STEP)
    end = STEP * np.arange(1, n + 1)
    earth = TURN @ nav.earth_in_n(np.float64(LATITUDE))
    g = float(nav.gravity(np.float64(LATITUDE), 0.0))
    out = np.zeros((n, 6))
    for k, t in enumerate(end - STEP / 2):
        for x, w in zip(POINTS, WEIGHTS, strict=True):
            C, turn = _motion(t + x * STEP / 2)
            out[k] += w / 2 * np.concatenate([C.T @ [0, 0, -g], C.T @ earth + turn])
    phase = (end - STEP / 2) % (STOP + TURNING)
    ordinal = ((end - STEP / 2) // (STOP + TURNING)).astype(int) + 1
    return Turned(end, out, np.where(phase < STOP, ordinal, 0), g)
