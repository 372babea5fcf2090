"""Single terms of the static run, each against a number made another way."""

import dataclasses

import numpy as np
import pytest

from gimbalcal.effects import with_values
from gimbalcal.estimate.accelerometers.position_fit import HEADER, SAMPLES
from gimbalcal.estimate.static_run.combined_coefficients import NAMES, coefficient_matrix
from gimbalcal.estimate.static_run.force_filter import observation_matrix, projection
from gimbalcal.estimate.static_run.system import calibrate_static_run, noise_from, static_parameters, static_readings
from gimbalcal.forward import accelerometers
from gimbalcal.kinematics import with_phase_of_force
from gimbalcal.views.known_attitude import readings
from tests.estimate.static_runs import NOISE, TABLE_2_3, run
from tests.stimuli import LATITUDE, G
from tests.stimuli import static as held


def test_the_columns_of_equation_27_are_what_errors_of_the_sensors_do_to_the_norm():
    s, rng = held(24.0), np.random.default_rng(1)
    wanted = [
        p for p in static_parameters(static_readings(run())) if p.effect in ("scale_factor", "bias", "misalignment")
    ]
    x = np.array([1e-3 * p.sigma for p in wanted]) * rng.standard_normal(len(wanted))
    departure = accelerometers(s.force, s, with_values((), wanted, x)) - s.force
    combined = coefficient_matrix(LATITUDE, G, wanted)[[NAMES.index(f"x{i}") for i in range(1, 6)]] @ x
    found = observation_matrix(s.force / G) @ combined
    # products of two errors: 1e-6
    np.testing.assert_allclose(found, projection(departure, s.force / G, G), atol=1e-5 * np.abs(found).max())


def test_without_a_platform_readout_the_force_tells_the_phase():
    recording = run(TABLE_2_3)
    phase = with_phase_of_force(recording).channels["gimbal_angle", "platform"]
    read = recording.channels["gimbal_angle", "platform"]
    # biases of 1e-3 m/s^2 against 7.5 m/s^2 in the equatorial plane, and 10 arcsec
    np.testing.assert_allclose(np.angle(np.exp(1j * (phase - read))), 0, atol=3e-4)


def test_the_stage_says_by_how_many_sigmas_the_two_roads_differ():
    words = calibrate_static_run(static_readings(run(TABLE_2_3, np.random.default_rng(6)))).stages[0].in_words
    worst = float(words.split("more than ")[1].split(" of its sigma")[0])
    assert 0.2 < worst < 5  # the largest of fifteen differences of about a sigma or less


def test_direction_and_phase_are_those_of_an_ideal_platform():
    ready = readings(run())
    np.testing.assert_allclose(np.linalg.norm(ready.direction, axis=1), 1, rtol=1e-12)
    np.testing.assert_allclose(ready.direction[:, 2], np.sin(LATITUDE), rtol=1e-12)
    np.testing.assert_allclose(np.tan(ready.phase), ready.direction[:, 1] / ready.direction[:, 0], rtol=1e-9)


def test_means_over_many_samples_are_as_quiet_as_their_root_says():
    recording = run(TABLE_2_3, np.random.default_rng(3), step=300.0)
    few = dataclasses.replace(recording, weight=np.full(len(recording.time), 100.0))
    np.testing.assert_allclose(static_readings(few).sigma[0, 0], NOISE["accelerometer"] / 10, rtol=1e-12)
    silent = dataclasses.replace(few, noise={})
    # rows that scatter by sigma are means of 100 samples of ten sigma
    np.testing.assert_allclose(static_readings(silent).sigma[0, 0], NOISE["accelerometer"], rtol=0.15)  # 576 rows: 5 %


def test_one_silent_channel_is_enough_to_say_that_samples_told_the_noise():
    recording = run(TABLE_2_3, np.random.default_rng(4))
    assert noise_from(static_readings(recording)) == HEADER
    partly = {k: v for k, v in NOISE.items() if k != "attitude"}
    assert noise_from(static_readings(dataclasses.replace(recording, noise=partly))) == SAMPLES


def test_the_residual_of_a_run_is_its_noise_channel_by_channel():
    recording = run(TABLE_2_3, np.random.default_rng(5))
    found = calibrate_static_run(static_readings(recording))
    for axis in "xyz":
        # 288 rows: 4 % a sigma
        assert found.residual.rms[f"specific_force:{axis}"] == pytest.approx(NOISE["accelerometer"], rel=0.2)
    assert found.residual.rms["attitude_error:roll"] == pytest.approx(NOISE["attitude"], rel=0.2)
    assert found.stages[0].rms == pytest.approx(NOISE["accelerometer"], rel=0.15)
    left = static_readings(recording).residual(found.effects)
    assert found.residual.rms["specific_force:x"] == pytest.approx(np.sqrt(np.mean(left[:, 0] ** 2)), rel=1e-12)
