"""Normal gravity against published values of the WGS-84 ellipsoid."""

import numpy as np
import pytest

from gimbalcal.earth import EARTH_RATE, normal_gravity


def test_equator_and_pole_are_the_published_ones():
    # NIMA TR8350.2, Table 3.4: printed to 1e-10 m/s^2.
    assert float(normal_gravity(0.0)) == pytest.approx(9.7803253359, abs=5e-11)
    assert float(normal_gravity(np.pi / 2)) == pytest.approx(9.8321849378, abs=5e-11)


def test_somigliana_in_its_other_form():
    # Eq. (4-1) as printed, gamma_e (1 + k sin^2) / sqrt(1 - e^2 sin^2), with k and e^2 of Tables 3.3 and 3.4.
    sin2 = np.sin(np.radians(45.0)) ** 2
    published = 9.7803253359 * (1 + 0.00193185265241 * sin2) / np.sqrt(1 - 6.69437999014e-3 * sin2)
    assert float(normal_gravity(np.radians(45.0))) == pytest.approx(published, abs=1e-10)  # digits of k


def test_gravity_falls_with_height_by_the_free_air_gradient():
    # Heiskanen & Moritz (1967), Eq. (2-215): 0.3086 mGal/m near the ground at mid latitude.
    gradient = float(normal_gravity(np.radians(45.0), 100.0) - normal_gravity(np.radians(45.0), 0.0)) / 100
    assert gradient == pytest.approx(-3.086e-6, rel=5e-4)  # 4 printed digits


def test_symmetric_about_the_equator_and_broadcasts():
    latitude = np.linspace(-1.5, 1.5, 31)
    gravity = normal_gravity(latitude)
    assert gravity.shape == latitude.shape
    np.testing.assert_allclose(gravity, gravity[::-1], rtol=1e-15)


def test_earth_turns_once_in_a_sidereal_day():
    # 86164.1 s to the digits that every almanac agrees on.
    assert 2 * np.pi / EARTH_RATE == pytest.approx(86164.1, abs=0.02)
