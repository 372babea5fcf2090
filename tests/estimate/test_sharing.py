"""Agreement of recordings: the rise of chi^2 is that of the differences, along what several of them determine."""

import numpy as np
import pytest

from gimbalcal.effects import CATALOGUE, parameters
from gimbalcal.estimate.fit import excess_sigma
from gimbalcal.estimate.sharing import Comparison, agreement_test, disagreeing_recordings, largest_difference
from gimbalcal.inference.information import information, solve

X, Y, _ = parameters(CATALOGUE["bias"])


def told(value, sigma, n=1):
    """Information of n equal rows about one bias."""
    return information(np.full((n, 1), 1 / sigma), np.full(n, value / sigma), (X,))


def test_the_rise_is_the_square_of_the_difference_over_its_sigma():
    one, other = told(3e-4, 1e-4), told(1e-4, 2e-4)
    found = agreement_test(solve(one + other), [solve(one), solve(other)])
    assert found.combinations == 1
    assert found.rise == pytest.approx((2e-4) ** 2 / (1e-8 + 4e-8), rel=1e-9)
    assert found.p_value == pytest.approx(0.3711, abs=1e-3)  # chi^2 of 0.8 on 1


def test_an_estimated_noise_makes_a_difference_more_likely():
    one, other = told(1e-3, 1e-4), told(0.0, 1e-4)
    alone = [solve(one), solve(other)]
    known, estimated, larger = (
        agreement_test(solve(one + other), alone, variance, dof).p_value
        for variance, dof in ((1.0, np.inf), (1.0, 4), (9.0, 4))
    )
    assert known < estimated < larger


def test_what_only_one_recording_determines_is_not_compared():
    both = information(np.eye(2) / 1e-4, np.array([3.0, 40.0]), (X, Y))
    found = agreement_test(solve(told(3e-4, 1e-4) + both), [solve(told(3e-4, 1e-4)), solve(both)])
    assert found.combinations == 1
    assert found.p_value == pytest.approx(1.0)


def test_of_two_recordings_one_is_as_far_off_as_the_other():
    off = [Comparison(title, 2, 1e-6, "most in bias:x") for title in "ab"]
    assert disagreeing_recordings(off) == [0]
    three = [Comparison(title, 3, p) for title, p in (("a", 0.5), ("b", 1e-6), ("c", 0.5))]
    assert disagreeing_recordings(three) == [1]
    assert Comparison("d", 3, obstacle="too few rests").agrees
    assert largest_difference((X, Y), np.array([1e-4, 1e-2]), np.array([1e-5, 1.0])).startswith("most in bias:x")


def test_the_excess_explains_what_the_known_noise_does_not():
    r, own = np.array([3.0, -4.0, 5.0, 1.0]), np.full(4, 2.0)
    excess = excess_sigma(r, own, 3)
    assert (r**2 / (own + excess**2)).sum() == pytest.approx(3.0)
    assert excess_sigma(r, np.zeros(4), 3) == pytest.approx(np.sqrt(51 / 3))
    assert excess_sigma(r, np.full(4, 100.0), 3) == 0.0
