"""Slow biases: how much is left after one time constant, a day, a turning point."""

import numpy as np

from gimbalcal.earth import G0
from gimbalcal.units import from_si, to_si
from tests.effects.stimulus import given, made

TIME = np.arange(0.0, 36000.0, 10.0)
TEN = [to_si(10.0, "ug"), 0, 0]


def output(effect, temperature=20.0, force=0.0):
    """What the x axis adds (n,) [ug]; coefficients are referred to 20 degC."""
    n = len(TIME)
    along = np.zeros((n, 3))
    along[:, 0] = force
    s = given().at(time=TIME, force=along, temperature=temperature + np.zeros(n), reference_temperature=20.0)
    return np.asarray(from_si(effect.contribution(s)[:, 0], "ug"))


def test_after_an_hour_a_third_of_the_warm_up_is_left():
    y = output(made("warm_up", w=TEN, tau=3600.0))
    np.testing.assert_allclose(y[[0, 360, 720]], [10, 10 / np.e, 10 / np.e**2], rtol=1e-12)


def test_a_bias_has_its_turning_point_at_the_reference_temperature():
    ramp = np.linspace(10.0, 30.0, len(TIME))
    y = output(made("bias_temperature_squared", q=[to_si(0.1, "ug/degC^2"), 0, 0]), ramp)
    np.testing.assert_allclose(y, y[::-1], atol=1e-12)
    np.testing.assert_allclose(y[[0, -1]], 10.0, rtol=1e-12)  # 0.1 ug/degC^2 ten degrees away


def test_on_a_ramp_the_late_bias_differs_from_the_prompt_one_by_rate_times_time_constant():
    ramp = 20 + 2.0 * TIME / 3600  # degC, two an hour
    coefficient = [to_si(5.0, "ug/degC"), 0, 0]
    late = output(made("bias_temperature_lagged", b_L=coefficient, tau=1080.0), ramp)
    prompt = output(made("bias_temperature", b_T=coefficient), ramp)
    np.testing.assert_allclose((prompt - late)[-1], 5.0 * 2.0 * 0.3, rtol=1e-10)  # 5 ug/degC x 2 degC/h x 0.3 h
    rate = output(made("bias_temperature_rate", r=[to_si(5.0, "ug/(degC/h)"), 0, 0]), ramp)
    np.testing.assert_allclose(rate, 10.0, rtol=1e-9)


def test_a_scale_that_follows_the_temperature_changes_sign_with_the_face():
    warm = made("scale_temperature", s_T=[50e-6, 0, 0])
    np.testing.assert_allclose(output(warm, 22.0, G0), 100.0, rtol=1e-12)  # 50 ppm/degC x 2 degC at 1 g
    np.testing.assert_allclose(output(warm, 22.0, -G0), -100.0, rtol=1e-12)


def test_self_heating_is_the_same_on_both_faces_and_late_after_a_turn():
    heat = made("self_heating", H=TEN, tau=720.0)
    np.testing.assert_allclose(output(heat, force=G0), output(heat, force=-G0), rtol=1e-14)
    turned = output(heat, force=np.where(TIME < 18000.0, 0.0, G0))  # from null to the face
    np.testing.assert_allclose(turned[1800 + 72], 10 * (1 - np.exp(-1)), atol=0.03)  # tau later; a ramp of one row
    np.testing.assert_allclose(turned[-1], 10.0, atol=1e-9)
