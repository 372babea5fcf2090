"""Where a telescope looks: the shapes over the sky that observers know, on an alt-azimuth mount."""

from dataclasses import replace

import numpy as np

from gimbalcal.forward import predict
from gimbalcal.kinematics import DOWN
from gimbalcal.number import apply_matrix
from gimbalcal.platform import KNOWN
from tests.effects.stimulus import given, made

ARCSEC = np.pi / 648000
MOUNT = KNOWN["alt-az"]
ELEVATION = np.deg2rad([15.0, 30.0, 45.0, 60.0, 80.0])
AXES = ("elevation", "azimuth")


def sky():
    """Five stars at as many azimuths, in an hour each."""
    angles = np.stack([ELEVATION, np.linspace(-3, 2, 5)], axis=-1)
    n, load = len(angles), np.stack([apply_matrix(C, DOWN) for C in MOUNT.attitudes(angles)], axis=1)
    return replace(
        given(), time=3600.0 * np.arange(n), readout=angles, angle=angles, true_angle=angles, force=np.zeros((n, 3)),
        axis_names=AXES, sense=(), axis_directions=("y", "z"), load=load, visit=np.arange(n),
    )  # fmt: skip


def seen(*effects):
    """Where it looks less the target, across and along (n, 2) [arcsec]."""
    return predict(MOUNT, sky(), effects, "pointing")["pointing"] / ARCSEC


def test_refraction_lifts_by_r_at_45_degrees_and_by_the_cotangent_elsewhere():
    off = seen(made("refraction", AXES, R=5 * ARCSEC))
    np.testing.assert_allclose(off[:, 1], -5 / np.tan(ELEVATION), atol=2e-3)  # the true place of what is seen is lower
    np.testing.assert_allclose(off[2, 1], -5.0, atol=1e-3)
    np.testing.assert_allclose(off[:, 0], 0, atol=1e-9)


def test_a_tube_sags_with_the_cosine_of_the_elevation():
    off = seen(made("tube_flexure", AXES, k=20 * ARCSEC))
    np.testing.assert_allclose(off[:, 1], -20 * np.cos(ELEVATION), atol=2e-3)
    np.testing.assert_allclose(off[:, 0], 0, atol=1e-9)


def test_a_collimation_error_is_the_same_all_over_the_sky_and_a_zero_in_azimuth_fades_upwards():
    collimation = seen(made("axis_collimation", AXES, c=100 * ARCSEC))
    np.testing.assert_allclose(collimation[:, 0], 100.0, rtol=1e-5)
    zero = seen(made("gimbal_zero", AXES, theta_0=[0, 100 * ARCSEC]))
    np.testing.assert_allclose(zero[:, 0], 100 * np.cos(ELEVATION), atol=0.03)  # 100 arcsec squared are 0.05 arcsec


def test_a_slipping_clutch_is_a_zero_that_grows_by_the_hour():
    slipping = seen(made("gimbal_zero_drift", AXES, rate=[30 * ARCSEC / 3600, 0]))
    np.testing.assert_allclose(slipping[:, 1], 30.0 * np.arange(5), atol=1e-4)  # the elevation is more than it reads
