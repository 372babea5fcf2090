"""A logged channel as a cause: in proportion, squared, and late."""

import numpy as np

from gimbalcal.units import from_si, to_si
from tests.effects.stimulus import given, made

TIME = np.arange(0.0, 40000.0, 10.0)
K = to_si(10.0, "ug")


def follows(effect, channel):
    """Output of x (n,) [ug] where this was logged as the only channel, counted from its mean."""
    n = len(TIME)
    s = given().at(time=TIME, covariates={"fan": channel}, force=np.zeros((n, 3)))
    return np.asarray(from_si(effect.contribution(s)[:, 0], "ug"))


def test_after_a_step_63_percent_are_there_in_one_time_constant():
    step = np.where(TIME < 10000.0, 0.0, 1.0)
    y = follows(made("bias_covariate_lagged", k=[K, 0, 0], tau=1000.0), step)
    risen = (y - y[0]) / 10.0
    np.testing.assert_allclose(risen[1100], 1 - np.exp(-1), atol=0.002)  # 1000 s after; the step is a ramp of 10 s
    np.testing.assert_allclose(risen[-1], 1.0, atol=1e-9)
    np.testing.assert_allclose(risen[:1000], 0, atol=1e-13)


def test_behind_a_ramp_it_stays_back_by_the_time_constant():
    ramp = TIME / 1000.0
    late = follows(made("bias_covariate_lagged", k=[K, 0, 0], tau=1000.0), ramp)
    prompt = follows(made("bias_covariate", k=[K, 0, 0]), ramp)
    np.testing.assert_allclose((prompt - late)[3000:], 10.0, rtol=1e-10)  # 10 ug per unit, a unit in 1000 s


def test_the_square_does_not_tell_more_from_less():
    wave = np.sin(2 * np.pi * TIME / 10000.0)
    squared = made("bias_covariate_squared", k=[K, 0, 0])
    np.testing.assert_allclose(follows(squared, wave), follows(squared, -wave), atol=1e-12)
    np.testing.assert_allclose(follows(squared, wave).mean(), 5.0, rtol=1e-9)


def test_a_channel_counts_from_its_mean_and_needs_no_zero():
    wave = np.sin(2 * np.pi * TIME / 10000.0)
    plain = made("bias_covariate", k=[K, 0, 0])
    np.testing.assert_allclose(follows(plain, wave + 1013.0), follows(plain, wave), atol=1e-11)
