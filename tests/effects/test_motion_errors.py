"""What shows in motion alone: the numbers that the cards quote, and what two places of a sensor have in common."""

import numpy as np
import pytest

from gimbalcal.earth import EARTH_RATE
from gimbalcal.units import from_si, to_si
from tests.effects.stimulus import given, made

DEG = np.pi / 180
G = to_si(1.0, "g")
TIME = np.arange(0.0, 10.0, 0.01)


def moving(rate, force=None):
    """One dwell sampled at 100 Hz with this rate (n, 3) [rad/s] and force (n, 3) [m/s^2]."""
    n = len(TIME)
    force = np.tile([0.0, 0.0, -G], (n, 1)) if force is None else force
    return given().at(time=TIME, rate=np.broadcast_to(rate, (n, 3)), force=force, visit=np.zeros(n, dtype=int))


def ug(effect, s):
    return np.asarray(from_si(effect.contribution(s), "ug"))


def test_thirty_millimetres_at_ten_degrees_a_second_are_93_microg_towards_the_axis():
    arm = made("lever_arm", r=[0.03, 0, 0])
    felt = ug(arm, moving(np.array([0, 0, 10 * DEG])))
    np.testing.assert_allclose(felt, [[-93.2, 0, 0]] * len(TIME), atol=0.05)
    reversed_turn = ug(arm, moving(np.array([0, 0, -10 * DEG])))
    np.testing.assert_allclose(reversed_turn, felt, atol=1e-12)  # the square of the rate
    assert not ug(arm, moving(np.array([10 * DEG, 0, 0]))).any()  # about the arm itself
    np.testing.assert_allclose(ug(arm, moving(np.array([0, 0, 1 * DEG])))[:, 0], -0.932, atol=0.0005)


def test_thirty_millimetres_at_five_degrees_a_second_squared_are_267_microg_along_the_track():
    spinning_up = np.outer(TIME, [0, 0, 5 * DEG])
    felt = ug(made("lever_arm", r=[0.03, 0, 0]), moving(spinning_up))
    np.testing.assert_allclose(felt[:, 1], 267.0, atol=0.1)
    np.testing.assert_allclose(felt[:, 0], from_si(-0.03 * (5 * DEG * TIME) ** 2, "ug"), rtol=1e-12)


def test_a_lever_arm_is_the_size_effect_with_all_three_in_one_place():
    rate = np.random.default_rng(1).uniform(-1, 1, (len(TIME), 3))
    place = [0.01, -0.02, 0.03]
    together = made("accelerometer_lever_arm", r=[*place, *place, *place])
    np.testing.assert_allclose(ug(together, moving(rate)), ug(made("lever_arm", r=place), moving(rate)), rtol=1e-11)


def test_each_accelerometer_out_on_its_own_axis_feels_the_rates_about_the_other_two():
    out = made("accelerometer_lever_arm", r=(0.05 * np.eye(3)).ravel())
    rate = np.array([0.1, 0.2, 0.3])
    np.testing.assert_allclose(ug(out, moving(rate)), from_si(-0.05, "ug") * np.tile([0.13, 0.10, 0.05], (1000, 1)))


@pytest.mark.parametrize(("rate", "expected"), [(1 * DEG, 17.45), (EARTH_RATE, 0.0729)])
def test_a_millisecond_late_is_17_microg_at_a_degree_a_second(rate, expected):
    force = G * np.stack([np.sin(rate * TIME), 0 * TIME, -np.cos(rate * TIME)], axis=-1)
    late = ug(made("time_tag_latency", latency=1e-3), moving(np.zeros(3), force))
    # central differences inside, one-sided ones half a row off at both ends
    np.testing.assert_allclose(late[1:-1, 0], expected * np.cos(rate * TIME[1:-1]), rtol=1e-3)


def test_a_torquer_of_fifty_ppm_turns_the_platform_by_a_hundredth_of_a_degree_a_day_of_earth_rate():
    torqued = made("torquer_scale_factor", kappa=[0, 0, 50e-6])
    time = np.linspace(0, 86400.0, 25)
    s = given().at(time=time, rate=np.tile([EARTH_RATE, 0, EARTH_RATE], (25, 1)))
    turned = torqued.contribution(s)
    np.testing.assert_allclose(turned[-1], [0, 0, 50e-6 * 360.9856 * DEG], rtol=1e-6)  # 360.99 deg a solar day
    assert not torqued.contribution(s.at(rate=np.zeros((25, 3)))).any()  # torquing off


def test_gravity_leaks_into_a_level_unit_with_the_angle_it_has_turned():
    leak = made("gravity_leakage", kappa=1.0)
    angle = leak.contribution(moving(np.array([1e-3, 0, 0])))
    np.testing.assert_allclose(angle[:, 0], 1e-3 * TIME, atol=1e-15)
    assert not angle[:, 1:].any()
