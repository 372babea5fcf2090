"""An inertially fixed platform that turns: how far after a day, in which channels, and what it is confounded with."""

import numpy as np

from gimbalcal.earth import EARTH_RATE
from gimbalcal.forward import predict
from gimbalcal.platform import SPACE_STABLE_INERTIAL
from gimbalcal.units import to_si
from tests.effects.stimulus import made
from tests.stimuli import LATITUDE, G, static

HOUR = 3600.0
DEG_H = to_si(1.0, "deg/h")
DEG = np.pi / 180


def outputs(*effects, step=600.0):
    return predict(SPACE_STABLE_INERTIAL, static(48.0, step), effects, "static-run")


def turned(effect, step=600.0, **changes):
    """Rotation of the platform (n, 3) [rad]."""
    return effect.contribution(static(48.0, step).at(**changes))


def test_a_slow_clock_is_a_drift_about_the_polar_axis_against_the_earth():
    clock = outputs(made("clock_rate", kappa=10e-6))
    drift = outputs(made("gyro_drift", epsilon=[0, 0, -10e-6 * EARTH_RATE]))
    clean = outputs()
    for channel in clean:
        np.testing.assert_allclose(clock[channel], drift[channel], atol=1e-14)
    # 48 h x 10 ppm = 1.73 s, in which the Earth turns by 26 arcsec: 97 ug on the equatorial axes at 40 deg
    late = np.abs(clock["specific_force"] - clean["specific_force"])[-1, :2]
    lost = 10e-6 * static().time[-1]
    np.testing.assert_allclose(np.hypot(*late), G * np.cos(LATITUDE) * EARTH_RATE * lost, rtol=1e-6)


def test_a_clock_that_runs_slow_reads_the_force_that_comes_later():
    kappa, t = 1e-3, static().time
    phase = EARTH_RATE * t * (1 + kappa) + 0.4
    later = G * np.cos(LATITUDE) * np.stack([np.cos(phase), np.sin(phase)], axis=-1)
    np.testing.assert_allclose(outputs(made("clock_rate", kappa=kappa))["specific_force"][:, :2], later, rtol=1e-12)


def test_five_degrees_for_a_day_turn_a_warm_gyroscope_by_an_eighth_of_a_degree():
    drift = made("gyro_temperature_drift", epsilon_T=[0, 0.001 * DEG_H, 0])
    angle = turned(drift, temperature=np.full(288, 25.0))
    np.testing.assert_allclose(angle[144], [0, 0.12 * DEG, 0], rtol=1e-12)  # 0.001 deg/h/degC x 5 degC x 24 h
    assert not turned(drift, temperature=np.full(288, 20.0)).any()


def test_a_daily_drift_is_back_after_a_day_and_furthest_at_noon():
    angle = turned(made("gyro_diurnal_drift", A=[0.001 * DEG_H, 0, 0], B=[0, 0.001 * DEG_H, 0]))
    np.testing.assert_allclose(angle[144], 0, atol=1e-15)
    np.testing.assert_allclose(angle[72, 0], 2 * 0.001 * DEG * 24 / (2 * np.pi), rtol=1e-12)  # 2 A / omega_d
    np.testing.assert_allclose(angle[36, 1], 0.001 * DEG * 24 / (2 * np.pi), rtol=1e-12)
    rate = np.gradient(angle[:, 0], static().time)
    np.testing.assert_allclose(rate[36], 0.001 * DEG_H, rtol=1e-3)  # at six o'clock the whole amplitude


def test_an_anisoelastic_rotor_drifts_under_two_forces_and_under_one_not():
    E = to_si(0.01, "deg/h/g^2")
    drift = made("gyro_g2_sensitivity", E=[E, 0, 0])
    one_g, s = to_si(1.0, "g"), static(48.0)
    diagonal = np.tile([0, one_g / np.sqrt(2), one_g / np.sqrt(2)], (len(s.time), 1))
    angle = drift.contribution(s.at(force=diagonal))
    np.testing.assert_allclose(angle[144], [24 * 0.005 * DEG, 0, 0], rtol=1e-12)  # half of 0.01 deg/h for a day
    for face in np.eye(3):
        assert not drift.contribution(s.at(force=np.tile(one_g * face, (len(s.time), 1)))).any()


def test_a_mass_unbalance_of_the_polar_axis_sees_the_steady_force_only():
    D = np.zeros((3, 3))
    D[0, 2] = to_si(0.02, "deg/h/g")
    angle = turned(made("gyro_g_sensitivity", D=D.ravel()))
    expected = 24 * 0.02 * DEG * np.sin(LATITUDE) * G / to_si(1.0, "g")
    np.testing.assert_allclose(angle[144], [expected, 0, 0], rtol=1e-12)


def test_case_rotation_is_a_line_of_eight_minutes_that_its_own_mean_does_not_see():
    line = made("case_rotation_residue", A=[0, 3e-6, 0])
    angle = turned(line, step=10.0)[:, 1]
    np.testing.assert_allclose(angle.reshape(-1, 48).mean(axis=1), 0, atol=1e-18)  # 48 x 10 s = 480 s
    assert abs(angle.max() - 3e-6) < 1e-9
    spectrum = np.abs(np.fft.rfft(angle))
    assert np.fft.rfftfreq(len(angle), 10.0)[spectrum.argmax()] == 1 / 480
    both = {k: v - outputs(step=10.0)[k] for k, v in outputs(line, step=10.0).items()}
    assert np.abs(both["specific_force"]).max() > 0.9 * 3e-6 * G * np.sin(LATITUDE)
    assert np.abs(both["gimbal_angle"]).max() > 0.5 * 3e-6


def test_a_limit_cycle_sampled_at_its_own_period_is_an_offset():
    cycle = made("servo_limit_cycle", A=[5e-6, 0, 0], B=[0, 2e-6, 0])
    np.testing.assert_allclose(turned(cycle, step=600.0), [[0, 2e-6, 0]] * 288, atol=1e-15)  # 60 periods of 10 s
    np.testing.assert_allclose(turned(cycle, step=2.5)[1], [5e-6, 0, 0], atol=1e-16)  # a quarter of a period later


def test_a_schuler_oscillation_swings_in_84_minutes_in_roll_and_pitch_alone():
    swing, clean = outputs(made("schuler_oscillation", A=[1e-5, 0], B=[0, 1e-5]), step=60.0), outputs(step=60.0)
    np.testing.assert_array_equal(swing["specific_force"], clean["specific_force"])
    np.testing.assert_array_equal(swing["gimbal_angle"], clean["gimbal_angle"])
    error = swing["attitude_error"] - clean["attitude_error"]
    pendulum = 2 * np.pi * np.sqrt(6.371e6 / 9.80665)  # s, as long as the Earth's radius
    t = static(48.0, 60.0).time
    # 84.4 against 84.35 minutes: 0.05 minutes in ten swings are 0.04 rad
    first = t < 10 * pendulum
    np.testing.assert_allclose(error[first, 0], 1e-5 * np.sin(2 * np.pi * t[first] / pendulum), atol=5e-7)
    np.testing.assert_allclose(error[first, 1], 1e-5 * np.cos(2 * np.pi * t[first] / pendulum), atol=5e-7)
    assert np.abs(error[:, 2]).max() < 1e-15


def test_a_damped_schuler_oscillation_falls_to_a_third_in_its_time():
    calm, lasting = (turned(made("schuler_oscillation", B=[1e-5, 0], damping=d)) for d in (1 / (10 * HOUR), 0.0))
    np.testing.assert_allclose(calm[60, 0], np.exp(-1) * lasting[60, 0], rtol=1e-12)  # 60 x 600 s = 10 h
