"""Probabilities of sums of squares: published quantiles, and the ends of their range."""

import numpy as np
import pytest

from gimbalcal.p_value import chi_square_tail, probability


@pytest.mark.parametrize(
    ("quantile", "dof", "tail"), [(3.841459, 1, 0.05), (18.307038, 10, 0.05), (149.449253, 100, 0.001)]
)
def test_published_quantiles(quantile, dof, tail):
    """Abramowitz and Stegun (1964), Table 26.8."""
    assert probability(quantile, dof) == pytest.approx(tail, rel=1e-6)
    assert probability(quantile, dof, 1e9) == pytest.approx(tail, rel=1e-5)


def test_ends_of_the_range():
    assert chi_square_tail(np.inf, 3) == 0.0
    assert np.isnan(chi_square_tail(np.nan, 3))
    np.testing.assert_array_equal(chi_square_tail(np.zeros((2, 3)), np.array([0, 1, 2])), np.ones((2, 3)))
    assert probability(7.0, 2.0) == pytest.approx(np.exp(-3.5))
    assert probability(7.0, 0.0) == probability(7.0, 3.0, 0.0) == 1.0
