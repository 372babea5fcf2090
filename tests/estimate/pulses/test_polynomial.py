"""Pulses to physics and back."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gimbalcal.campaign.trials import accelerometer_truth, generators
from gimbalcal.earth import G0
from gimbalcal.estimate.pulses.gravity_norm import Pulses, unit_lower_triangular


@settings(deadline=None)
@given(st.integers(0, 10**6))
def test_counts_and_physical_are_inverse(seed):
    triad = accelerometer_truth(generators(seed, range(2)))
    force = np.random.default_rng(seed).uniform(-2, 2, (2, 7, 3)) * G0
    # Newton stops at 1e-15 of the count; the third-order terms amplify that by less than ten
    np.testing.assert_allclose(triad.physical(triad.counts(force)), force, rtol=0, atol=1e-13 * G0)


def test_misalignment_is_unit_lower_triangular():
    assert unit_lower_triangular(np.array([1.0, 2.0, 3.0])).tolist() == [[1, 0, 0], [1, 1, 0], [2, 3, 1]]


def test_a_polynomial_that_folds_is_refused():
    one = np.ones(3)
    with pytest.raises(ValueError, match="folds inside the measured range"):
        Pulses(one, -one, 0 * one, 0 * one, 0 * one).counts(np.array([[2.0, 2.0, 2.0]]))
