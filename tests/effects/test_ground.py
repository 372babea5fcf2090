"""Tides, deflection and gravity: how large, in which channels, and what they are confounded with."""

import numpy as np

from gimbalcal.forward import predict
from gimbalcal.platform import SPACE_STABLE, SPACE_STABLE_INERTIAL
from gimbalcal.units import from_si, to_si
from tests.effects.stimulus import made
from tests.stimuli import G, eighteen, static

ARCSEC = np.pi / 648000
M2 = 12.4206012 * 3600


def still(*effects):
    return predict(SPACE_STABLE_INERTIAL, static(48.0), effects, "static-run")


def positions(*effects):
    return predict(SPACE_STABLE, eighteen(), effects)["specific_force"]


def test_a_tide_of_110_microgal_lengthens_the_force_by_a_tenth_of_a_microg_twice_a_lunar_day():
    tide = still(made("gravity_tide", A=to_si(110.0, "uGal")))["specific_force"]
    longer = np.linalg.norm(tide, axis=1) - G
    np.testing.assert_allclose(from_si(longer.max(), "ug"), 0.112, rtol=0.01)
    np.testing.assert_allclose(longer, to_si(110.0, "uGal") * np.sin(2 * np.pi * static(48.0).time / M2), atol=1e-14)
    clean = still()["specific_force"]
    np.testing.assert_allclose(np.cross(tide, clean), 0, atol=1e-12)  # along the force, in every channel


def test_a_plumb_line_tide_turns_the_force_and_nothing_else():
    tide, clean = still(made("plumb_line_tide", B=[50e-9, 0])), still()
    turned = tide["specific_force"] - clean["specific_force"]
    np.testing.assert_allclose((turned * clean["specific_force"]).sum(axis=1), 0, atol=1e-12)
    size = np.linalg.norm(turned, axis=1)
    np.testing.assert_allclose(from_si(size[0], "ug"), 0.05, rtol=1e-3)  # 50 nrad at 9.80146 m/s^2
    assert turned[0, 2] < 0  # gravity that leans north takes from the force along the polar axis
    np.testing.assert_array_equal(tide["gimbal_angle"], clean["gimbal_angle"])  # gyroscopes hold it, not gravity


def test_a_deflection_of_ten_arcsec_is_48_microg_and_a_tilt_of_the_base():
    north, east = 10 * ARCSEC, -4 * ARCSEC
    deflected = positions(made("vertical_deflection", xi=[north, east]))
    tilted = positions(made("base_tilt", kappa=[east, -north, 0]))
    np.testing.assert_allclose(deflected, tilted, atol=2 * G * north**2)
    alone = positions(made("vertical_deflection", xi=[north, 0])) - positions()
    np.testing.assert_allclose(from_si(np.linalg.norm(alone, axis=1), "ug"), 48.48, rtol=1e-3)


def test_a_wrong_gravity_is_three_equal_scale_factors():
    wrong = positions(made("gravity_error", gamma=20e-6))
    np.testing.assert_allclose(wrong, positions(made("scale_factor", s=[1 / (1 + 20e-6) - 1] * 3)), rtol=1e-14)
    np.testing.assert_allclose(wrong, (1 + 20e-6) * positions(), rtol=1e-14)


def test_a_settling_pier_turns_the_gimbals_of_a_held_platform_and_not_its_accelerometers():
    settling, clean = still(made("base_tilt_drift", psi=[1e-6 / 3600, 0])), still()
    np.testing.assert_array_equal(settling["specific_force"], clean["specific_force"])
    tilted = still(made("base_tilt", kappa=[1e-6, 0, 0]))  # what it has come to after an hour
    np.testing.assert_array_equal(settling["gimbal_angle"][6], tilted["gimbal_angle"][6])
    assert np.abs(settling["gimbal_angle"] - clean["gimbal_angle"])[6].max() > 0.5e-6
