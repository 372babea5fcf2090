"""Tails of chi^2 against those of SciPy."""

import numpy as np
import pytest
from scipy.special import chdtrc

from gimbalcal.p_value import chi_square_tail, probability


@pytest.mark.parametrize("dof", [1, 2, 3, 8, 17, 101, 1000, 5001])
def test_tails_are_those_of_scipy(dof):
    chi2 = np.concatenate([[0.0, 1e-8], dof * np.geomspace(0.01, 40, 60)])
    expected = chdtrc(dof, chi2)
    np.testing.assert_allclose(chi_square_tail(chi2, dof), expected, rtol=1e-11, atol=1e-300)
    assert probability(float(dof), dof) == pytest.approx(float(chdtrc(dof, dof)), rel=1e-11)


def test_ends_of_the_range():
    assert chi_square_tail(np.inf, 3) == chi_square_tail(np.inf, 4) == 0.0
    assert np.isnan(chi_square_tail(np.nan, 3))
    np.testing.assert_array_equal(chi_square_tail(np.zeros((2, 3)), 0), np.ones((2, 3)))
    assert probability(7.0, 2.5) == pytest.approx(float(chdtrc(2.5, 7.0)))
