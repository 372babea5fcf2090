"""The Earth: its rotation and its normal gravity.

Source: NIMA TR8350.2, *Department of Defense World Geodetic System 1984*, 3rd ed., amendment 1 (2000), Tables
3.1 to 3.4 for the constants, Eqs. (4-1) and (4-3) for gravity on and above the ellipsoid.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

EARTH_RATE = 7.292115e-5
"""Rotation of the Earth relative to inertial space, rad/s (WGS-84, Table 3.1): the sidereal rate."""

G0 = 9.80665
"""Standard gravity, m/s^2, exact (3rd CGPM, 1901); what "1 g" means in a unit."""

HOUR = 3600.0  # s
NAUTICAL_MILE = 1852.0  # m
SOLAR_DAY = 24 * HOUR  # s, mean
YEAR = 365.25 * SOLAR_DAY  # s, Julian
SOLAR_RATE = 2 * np.pi / SOLAR_DAY  # rad/s

SEMI_MAJOR_AXIS = 6378137.0  # m, Table 3.1
FLATTENING = 1 / 298.257223563  # Table 3.1
E2 = FLATTENING * (2 - FLATTENING)  # first eccentricity squared
GRAVITY_EQUATOR = 9.7803253359  # m/s^2, Table 3.4
GRAVITY_POLE = 9.8321849378  # m/s^2, Table 3.4
GRAVITY_RATIO = 0.00344978650684  # m = omega^2 a^2 b / GM, Table 3.4


def radii(latitude: float | NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    r"""Return radii of curvature of the ellipsoid [m] at geodetic `latitude` (rad): M along the meridian, N across it.

    .. math:: M = \frac{a (1 - e^2)}{(1 - e^2 \sin^2 L)^{3/2}}, \qquad N = \frac{a}{\sqrt{1 - e^2 \sin^2 L}}
    """
    w = 1 - E2 * np.sin(latitude) ** 2
    return SEMI_MAJOR_AXIS * (1 - E2) / w**1.5, SEMI_MAJOR_AXIS / np.sqrt(w)


def rate_at(latitude: float | NDArray[np.float64]) -> NDArray[np.float64]:
    r"""Return the rotation of the Earth (..., 3) [rad/s] in north, east, down at geodetic `latitude` (rad).

    .. math:: \omega_{ie} = \Omega \, (\cos L, \; 0, \; -\sin L)
    """
    c, s = np.cos(latitude), np.sin(latitude)
    return EARTH_RATE * np.stack([c, np.zeros_like(c), -s], axis=-1)


def normal_gravity(
    latitude: float | NDArray[np.float64], height: float | NDArray[np.float64] = 0.0
) -> NDArray[np.float64]:
    r"""Return the gravity of the WGS-84 ellipsoid at geodetic `latitude` (rad) and `height` (m) above it, in m/s^2.

    .. math::
        \gamma &= \frac{a \gamma_e \cos^2 L + b \gamma_p \sin^2 L}{\sqrt{a^2 \cos^2 L + b^2 \sin^2 L}} \\
        \gamma_h &= \gamma \left[1 - \frac{2}{a}(1 + f + m - 2 f \sin^2 L) h + \frac{3}{a^2} h^2\right]

    The first is exact (Somigliana; Eq. (4-1)), the second (Eq. (4-3)) a series in h/a. Gravity at a real site
    differs by up to some 1e-3 m/s^2: give the measured value in the recording where it is known.

    >>> round(float(normal_gravity(0.0)), 10), round(float(normal_gravity(np.pi / 2)), 10)
    (9.7803253359, 9.8321849378)
    """
    a, b = SEMI_MAJOR_AXIS, SEMI_MAJOR_AXIS * (1 - FLATTENING)
    sin2 = np.sin(latitude) ** 2
    cos2 = 1 - sin2
    ground = (a * GRAVITY_EQUATOR * cos2 + b * GRAVITY_POLE * sin2) / np.sqrt(a**2 * cos2 + b**2 * sin2)
    slope = 1 + FLATTENING + GRAVITY_RATIO - 2 * FLATTENING * sin2
    above = 1 - 2 / a * slope * height + 3 / a**2 * height**2
    return np.asarray(ground * above, dtype=np.float64)
