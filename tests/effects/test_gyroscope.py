"""Outputs of rate sensors: what an angle that is summed from them is off by."""

import numpy as np
import pytest

from gimbalcal.units import to_si
from tests.effects.stimulus import given, made

DEG = np.pi / 180
TIME = np.arange(0.0, 3601.0)


def summed(effect, rate=None):
    """Angle (3,) [rad] that one hour of the effect's output adds up to."""
    n = len(TIME)
    rate = np.zeros((n, 3)) if rate is None else np.broadcast_to(rate, (n, 3))
    s = given().at(time=TIME, rate=rate, temperature=np.full(n, 28.0), force=np.tile([0, 0, -to_si(1.0, "g")], (n, 1)))
    return np.trapezoid(effect.contribution(s), TIME, axis=0)


def test_a_bias_that_drifts_adds_up_to_half_the_square_of_the_time():
    drifting = made("gyro_bias_drift", rate=to_si(np.array([10.0, 0, -2.0]), "deg/h/h"))
    np.testing.assert_allclose(summed(drifting), np.array([5.0, 0, -1.0]) * DEG, rtol=1e-12)  # d t^2 / 2 after an hour
    np.testing.assert_allclose(
        summed(made("gyro_bias", epsilon=to_si(np.array([10.0, 0, -2.0]), "deg/h"))), np.array([10, 0, -2]) * DEG
    )


def test_a_turn_there_and_back_leaves_the_asymmetry_and_the_bend_and_no_scale_factor():
    there = np.outer(np.sign(1800 - TIME), [0.2, 0, 0])
    turned = 0.2 * 3599  # rad, back and forth: the row in the middle stands still
    assert abs(summed(made("gyro_scale_factor", s=[1e-4, 0, 0]), there)[0]) < 1e-15
    np.testing.assert_allclose(
        summed(made("gyro_scale_asymmetry", A=[1e-4, 0, 0]), there)[0], 1e-4 * turned, rtol=1e-12
    )
    np.testing.assert_allclose(
        summed(made("gyro_scale_nonlinearity", K=[1e-4, 0, 0]), there)[0], 1e-4 * 0.2 * turned, rtol=1e-12
    )


def test_a_leaning_gyroscope_reads_the_turn_about_another_axis():
    """As Eq. (5) of Wu et al. has it: turned about z, the x input axis leans towards y; turned about y, away from z."""
    about_z, about_y = [0, 100 * DEG / 3600, 0, 0, 0, 0], [100 * DEG / 3600, 0, 0, 0, 0, 0]
    turn = 0.1 * 3600 * 100 * DEG / 3600
    for beta, rate, read in ((about_z, [0, 0.1, 0], turn), (about_y, [0, 0, 0.1], -turn)):
        found = summed(made("gyro_misalignment", beta=beta), np.array(rate))
        np.testing.assert_allclose(found, [read, 0, 0], rtol=1e-12)


def test_the_true_rate_is_the_scale_factor_times_the_reading():
    turn = np.array([0, 0, 0.1])
    too_much = made("gyro_scale_factor", s=[0, 0, -4000e-6])
    assert (turn * 3600 + summed(too_much, turn))[2] * (1 - 4000e-6) == pytest.approx(360, rel=1e-12)


def test_ten_degrees_above_the_reference_a_scale_factor_is_ten_coefficients_off():
    warm = made("gyro_scale_temperature", s_T=[0, 0, 10e-6])  # the stimulus is referred to 18 degC, and stands at 28
    np.testing.assert_allclose(summed(warm, np.array([0, 0, 0.1]))[2], 1e-4 * 360, rtol=1e-12)


def test_a_gyroscope_that_feels_the_force_drifts_with_the_sign_of_the_force():
    G = np.zeros((3, 3))
    G[0, 2] = to_si(1.0, "deg/h/g")
    np.testing.assert_allclose(summed(made("gyro_g_sensitivity_rate", G=G.ravel())), [-DEG, 0, 0], rtol=1e-12)
