"""The sigma of gravity: of the ellipsoid, as stated, and where the stated value is anomalous."""

import numpy as np
import pytest

from gimbalcal.earth import normal_gravity
from gimbalcal.recording.site import ANOMALY, UNKNOWN_HEIGHT, gravity_anomaly, with_gravity_stated, with_normal_gravity

L = np.deg2rad(48.0)
HERE = float(normal_gravity(L, 500.0))


def test_the_gravity_of_the_ellipsoid_is_good_to_anomalies_and_to_the_height():
    known = with_normal_gravity(L, 500.0)
    assert (known.gravity, known.gravity_sigma) == (HERE, 3e-4)  # 30 mGal
    unknown = with_normal_gravity(L, None)
    assert unknown.gravity_sigma == pytest.approx(np.hypot(ANOMALY, UNKNOWN_HEIGHT))
    assert unknown.gravity - HERE == pytest.approx(500 * 3.086e-6, rel=0.01)  # 0.3086 mGal each metre
    assert with_normal_gravity(None, None).gravity_sigma > 10 * unknown.gravity_sigma


def test_a_stated_gravity_is_exact_unless_it_is_anomalous_or_its_sigma_is_stated():
    usual, strange = HERE + 2 * ANOMALY, HERE - 4e-3
    assert with_gravity_stated(L, 500.0, usual, None).gravity_sigma == 0.0
    assert with_gravity_stated(L, 500.0, strange, None).gravity_sigma == pytest.approx(4e-3)
    assert with_gravity_stated(L, 500.0, strange, 1e-6).gravity_sigma == 1e-6
    assert with_gravity_stated(None, None, strange, None).gravity_sigma == 0.0
    assert gravity_anomaly(with_gravity_stated(L, 500.0, strange, 0.0)) == pytest.approx(-4e-3)
    assert gravity_anomaly(with_gravity_stated(L, 500.0, usual, 0.0)) == 0.0
