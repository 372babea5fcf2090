"""Lags and integrals on irregular time agree with their closed forms."""

import numpy as np
import pytest

from gimbalcal.effects.history import (
    Dynamics,
    direction,
    integral,
    lagged_states,
    recursion,
    slope,
    smoothed_rate,
    states,
)

ONE = np.ones(3)
TIME = np.cumsum(np.random.default_rng(1).uniform(0.1, 40.0, 200))


def test_recursion_is_the_loop_it_replaces():
    rng = np.random.default_rng(2)
    a, b = rng.uniform(0, 1, 37), rng.standard_normal((37, 3))
    y, expected = np.zeros(3), []
    for k in range(37):
        y = a[k] * y + b[k]
        expected.append(y)
    np.testing.assert_allclose(recursion(a, b), expected, rtol=1e-13)


def lag(x, tau):
    return states(lagged_states(x[:, None], tau, ONE), TIME)[:, 0]


@pytest.mark.parametrize("tau", [0.5, 30.0, 1e5])
def test_the_lag_of_a_ramp_is_the_textbook_response(tau):
    t = TIME - TIME[0]
    expected = t - tau * (1 - np.exp(-t / tau))
    # rounding of differences of numbers as large as tau
    np.testing.assert_allclose(lag(t, tau), expected, atol=1e-12 * max(tau, t[-1]))


def test_the_lag_of_a_constant_is_that_constant():
    np.testing.assert_allclose(lag(np.full(200, 3.0), 20.0), 3.0, rtol=1e-13)


def test_the_smoothed_rate_of_a_ramp_is_its_slope_from_end_to_end():
    t = TIME - TIME[0]
    np.testing.assert_allclose(smoothed_rate(3.0 + 0.7 * t, TIME, 50.0), 0.7, rtol=1e-12)
    noisy = 0.7 * t + np.random.default_rng(3).standard_normal(200)
    # white noise of 1 every 20 s through 300 s: about sqrt(20 / 300) / 300 a second, four times that allowed
    np.testing.assert_allclose(smoothed_rate(noisy, TIME, 300.0)[20:-20], 0.7, atol=4 * 0.26 / 300)


def test_nothing_is_remembered_where_a_clock_begins_anew():
    t = np.linspace(0.0, 900.0, 31)
    drive = np.sin(t / 200)[:, None]
    both, again = np.concatenate([t, t]), np.concatenate([drive, 3 + drive])
    late_by = states(lagged_states(again, 300.0, np.ones(1)), both)
    np.testing.assert_allclose(late_by[31:], states(lagged_states(3 + drive, 300.0, np.ones(1)), t), atol=1e-5)
    rate = smoothed_rate(again[:, 0], both, 100.0)
    np.testing.assert_allclose(rate[31:], smoothed_rate(drive[:, 0], t, 100.0), atol=1e-4)
    np.testing.assert_allclose(rate[:31], smoothed_rate(drive[:, 0], t, 100.0), atol=1e-4)


def test_states_that_forget_nothing_add_up():
    rate = np.array([[1.0], [3.0], [3.0], [5.0]])
    time = np.array([0.0, 1.0, 3.0, 4.0])
    np.testing.assert_allclose(states(Dynamics(rate, np.array([10.0])), time)[:, 0], [10, 12, 18, 22])


def test_integral_and_slope_of_a_parabola():
    t = np.linspace(0, 10, 101)
    np.testing.assert_allclose(integral(2 * t, t), t**2, atol=1e-12)  # the trapezoid rule is exact for a line
    visit = (t > 5).astype(int)
    found = slope(t**2, t, visit)
    inside = np.r_[1:49, 53:100]  # central differences are exact for a parabola, one-sided ones are not
    np.testing.assert_allclose(found[inside], 2 * t[inside], atol=1e-12)
    assert found[50] == pytest.approx(2 * t[50], abs=0.11)  # half a step late at the end of a dwell
    jump = np.where(visit, 100.0, 0.0)
    assert not slope(jump, t, visit).any()


def test_direction_is_the_sign_of_a_move_and_zero_without_one():
    np.testing.assert_allclose(direction(np.array([-3.0, 0.0, 1e-15, 2.0]), 1e-3), [-1, 0, 0, 1], atol=1e-6)


COARSE = np.repeat([0.0, 2.0, 3.0, 7.0, 8.0], [1, 3, 2, 4, 1])  # stamps of a clock that ticks each second


@pytest.mark.parametrize("tau", [0.3, 20.0])
def test_rows_that_are_stamped_alike_are_the_limit_of_rows_that_are_not(tau):
    x, apart = np.cos(np.arange(11.0)), COARSE + 1e-7 * np.arange(11)
    alike, near = (states(lagged_states(x[:, None], tau, ONE), t)[:, 0] for t in (COARSE, apart))
    np.testing.assert_allclose(alike, near, atol=1e-5)
    np.testing.assert_allclose(smoothed_rate(x, COARSE, tau), smoothed_rate(x, apart, tau), atol=1e-5)


def test_rows_that_are_stamped_alike_have_one_slope_from_the_rows_around_them():
    still = np.zeros(11, dtype=int)
    np.testing.assert_allclose(slope(3 * COARSE, COARSE, still), 3.0, rtol=1e-14)
    assert not slope(np.arange(4.0), np.ones(4), still[:4]).any()  # one time has no slope
    split = np.repeat([0, 1], [4, 7])
    np.testing.assert_allclose(slope(3 * COARSE + 50 * split, COARSE, split), 3.0, rtol=1e-14)
