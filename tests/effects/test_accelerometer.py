"""What the input axes do to a force, measured on the forward model."""

import numpy as np

from gimbalcal.forward import predict
from gimbalcal.platform import SPACE_STABLE
from tests.effects.stimulus import made
from tests.stimuli import G, eighteen

TURN = 1e-6  # rad


def reading(*effects):
    return predict(SPACE_STABLE, eighteen(), effects)["specific_force"]


def test_a_turned_block_leaves_the_norm_of_the_force_alone_and_shows_a_microg_a_microradian():
    turned, clean = reading(made("frame_misalignment", theta=[TURN, -2 * TURN, 3 * TURN])), reading()
    np.testing.assert_allclose(np.linalg.norm(turned, axis=1), np.linalg.norm(clean, axis=1), rtol=1e-11)
    level = np.abs(clean @ [0, 0, 1]) > 0.99 * G  # z along the vertical: x and y see the turns about y and x
    across = np.abs((turned - clean)[level]) / G
    np.testing.assert_allclose(across, [[2 * TURN, TURN, 0]] * level.sum(), atol=1e-12)


def test_a_block_turned_about_the_platform_axis_is_a_zero_of_that_gimbal():
    turned = reading(made("frame_misalignment", theta=[0, 0, TURN]))
    zero = reading(made("gimbal_zero", theta_0=[TURN, 0, 0, 0]))
    np.testing.assert_allclose(turned, zero, atol=2 * G * TURN**2)
    assert np.abs(turned - reading()).max() > 0.9 * G * TURN


def test_a_turned_block_is_the_antisymmetric_part_of_the_misalignments():
    x, y, z = 1e-4, 2e-4, -3e-4
    beta = [y, z, z, x, x, y]  # xy, xz, yz, yx, zx, zy: the matrix of Eq. (5) is then 1 - [theta x]
    np.testing.assert_allclose(
        reading(made("frame_misalignment", theta=[x, y, z])), reading(made("misalignment", beta=beta)), rtol=1e-14
    )


def test_a_scale_factor_of_100_ppm_reads_100_ppm_less():
    np.testing.assert_allclose(reading(made("scale_factor", s=[1e-4] * 3)) * 1.0001, reading(), atol=1e-14)
