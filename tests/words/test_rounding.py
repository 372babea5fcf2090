from math import inf, nan

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gimbalcal.words.rounding import last_place, pdg_rounded, rms, significant


@pytest.mark.parametrize(
    ("value", "sigma", "printed"),
    [
        # the three cases of the rule, as the Review of Particle Physics states them
        (0.827, 0.119, ("0.83", "0.12")),
        (0.827, 0.367, ("0.8", "0.4")),
        (0.827, 0.950, ("0.8", "1.0")),
        # the edges between them
        (1.0, 0.0354, ("1.000", "0.035")),
        (1.0, 0.0355, ("1.00", "0.04")),
        (1.0, 0.0949, ("1.00", "0.09")),
        # sigma above one, above ten, above a hundred
        (-401.67, 2.06, ("-401.7", "2.1")),
        (1234.5, 17.2, ("1234", "17")),
        (98765.0, 1234.0, ("98800", "1200")),
        (123.4, 70.0, ("120", "70")),
        # no negative zero, no power of ten
        (-0.004, 0.12, ("0.00", "0.12")),
        (1.2e-7, 3.4e-9, ("0.0000001200", "0.0000000034")),
        # what says nothing about digits
        (12.345678, 0.0, ("12.3457", "0")),
        (nan, 1.0, ("nan", "1")),
        (1.0, inf, ("1", "inf")),
    ],
)
def test_rounding_of_the_particle_data_group(value, sigma, printed):
    assert pdg_rounded(value, sigma) == printed


@given(st.floats(-1e6, 1e6), st.floats(1e-9, 1e6))
def test_rounding_moves_neither_by_more_than_half_a_last_place(value, sigma):
    rounded_value, rounded_sigma = map(float, pdg_rounded(value, sigma))
    half = 0.5 * 10.0 ** last_place(sigma) * (1 + 1e-9)  # the text read back is a double again
    assert abs(rounded_value - value) <= half + 1e-9 * abs(value)
    # 0.949995 is read as 0.950 by its three digits and so rounds up by up to a twentieth
    assert abs(rounded_sigma - sigma) <= max(half, 0.06 * sigma)


@pytest.mark.parametrize(
    ("x", "text"),
    [(0.0, "0"), (4.736, "4.74"), (280.4, "280"), (1e-7, "1.00·10⁻⁷"), (2.5e7, "2.50·10⁷"), (-0.5, "-0.500")],
)
def test_significant_digits(x, text):
    assert significant(x, 3) == text


def test_a_root_mean_square_is_told_to_three_digits():
    assert rms(np.array([3.0, 4.0])) == "3.54"
