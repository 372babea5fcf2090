"""Scale factors follow the gravity that a calibration was made with; how far, and taken out again."""

from dataclasses import replace

import numpy as np
import pytest

from gimbalcal.calibration.gravity_uncertainty import scale_factor_direction, with_gravity, without_gravity
from gimbalcal.recording import Site
from tests.history.calibrations import LABELS, SIGMA, calibration
from tests.recording.test_dwells import recording

SCALE = [i for i, label in enumerate(LABELS) if label.startswith("scale_factor")]


def test_a_scale_factor_moves_as_a_reading_over_another_gravity():
    x = np.full(6, 0.1)
    made = calibration(x / SIGMA)
    reading, share = 1.1 * 9.8, 1e-6
    moved = (reading / (9.8 * (1 + share)) - reading / 9.8) / share
    u = scale_factor_direction(made)
    np.testing.assert_allclose(np.abs(u[SCALE]), -moved, rtol=1e-5)
    assert np.delete(u, SCALE).tolist() == [0.0, 0.0, 0.0]


def test_the_error_of_gravity_is_common_to_all_scale_factors_and_comes_out_again():
    made = calibration(np.full(6, 0.1) / SIGMA)
    there = replace(recording([1, 2]), site=Site(0.7, 0.0, 9.8, 4.9e-3))  # 500 ppm
    more = with_gravity(made, [there])
    added = more.covariance - made.covariance
    np.testing.assert_allclose(added[np.ix_(SCALE, SCALE)], (1.1 * 5e-4) ** 2, rtol=1e-9)
    assert more.provenance["options"]["gravity_sigma_ppm"] == pytest.approx(500.0)
    np.testing.assert_allclose(without_gravity(more, 5e-4), made.covariance, rtol=1e-9, atol=1e-20)
    assert without_gravity(made, 1.0) is made.covariance  # which does not hold so large an error
