"""Inertial navigation at rest in full, nothing linearised: what a constant sensor error makes of a position.

The equations whose first order (9), (10) are, on a sphere with the height held:

    C_dot = C [w_ib x] - [w_in x] C,    V_dot = C f - (2 w_ie + w_en) x V,
    L_dot = V_N / R,    lambda_dot = V_E / (R cos L)

by Runge and Kutta's fourth order. The unit lies with its axes east, north, up and reads the Earth's rate and one g, and
the error. The sites of the experiments are not printed: 32 deg north is ours.
"""

from __future__ import annotations

from functools import cache
from math import cos, hypot, radians, sin, tan
from typing import Any

import numpy as np

from derivations.cross import cross_of_numbers
from derivations.wang2019.navigation import EARTH, GRAVITY, RADIUS

LATITUDE = radians(32.0)
STEP = 40.0  # s; half of it changes a position by 3e-5 of itself


def _earth(L: float) -> Any:
    return EARTH * np.array([0.0, cos(L), sin(L)])


def _rates(x: Any, rate: Any, force: Any) -> Any:
    """Return the rates of attitude (9 elements), velocity east and north, latitude and longitude."""
    C, (E, N), L = x[:9].reshape(3, 3), x[9:11], x[11]
    w_en = np.array([-N, E, E * tan(L)]) / RADIUS
    w_ie = _earth(L)
    V_dot = C @ force - np.cross(2 * w_ie + w_en, [E, N, 0.0])
    C_dot = C @ cross_of_numbers(rate) - cross_of_numbers(w_ie + w_en) @ C
    return np.concatenate([C_dot.ravel(), V_dot[:2], [N / RADIUS, E / RADIUS / cos(L)]])


@cache
def largest(gyroscope: tuple[float, float, float], accelerometer: tuple[float, float, float], hours: float) -> float:
    """Return the largest horizontal position error [m] of constant errors [rad/s], [m/s^2]."""
    rate, force = _earth(LATITUDE) + gyroscope, np.array([0, 0, GRAVITY]) + accelerometer
    x = np.concatenate([np.eye(3).ravel(), [0.0, 0.0, LATITUDE, 0.0]])
    worst = 0.0
    for _ in range(round(hours * 3600 / STEP)):
        k1 = _rates(x, rate, force)
        k2 = _rates(x + STEP / 2 * k1, rate, force)
        k3 = _rates(x + STEP / 2 * k2, rate, force)
        x = x + STEP / 6 * (k1 + 2 * k2 + 2 * k3 + _rates(x + STEP * k3, rate, force))
        worst = max(worst, RADIUS * hypot(x[11] - LATITUDE, x[12] * cos(LATITUDE)))
    return worst
