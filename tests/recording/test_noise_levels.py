"""The noise of a recording: what the header says as processes, and one answer to how large a sample's noise is."""

from dataclasses import replace

import numpy as np
import pytest

from gimbalcal.effects.process import Flicker, GaussMarkov, RandomWalk, SettingError, WhiteNoise
from gimbalcal.inference.white_noise import scaled_differences, white_sigma
from gimbalcal.recording.noise_levels import header_coloured_noise, header_noise, sample_sigma
from gimbalcal.simulate import simulate
from gimbalcal.simulate.scenario import load
from gimbalcal.simulate.simulation import noise_processes
from tests.diagnose.plant import ARCSEC, UG, record

AXES = [("specific_force", a) for a in "xyz"]


def test_a_header_is_processes_by_quantity():
    told = header_noise(record(np.random.default_rng(1)))
    assert told == {"specific_force": (WhiteNoise(20 * UG),), "gimbal_angle": (SettingError(ARCSEC),)}


def test_the_header_of_a_simulation_states_the_processes_that_made_it():
    for name in ("wu2018-static", "wu2018-18"):
        scenario = load(name)
        recording, _ = simulate(scenario)
        made = noise_processes(scenario)
        for quantity, (process,) in header_noise(recording).items():
            assert process in made[quantity]
            assert not isinstance(process, RandomWalk | GaussMarkov)


def test_coloured_noise_has_the_times_that_are_stated_and_an_hour_where_none_is():
    told = {"accelerometer": 1e-4, "gyroscope_gauss_markov": 2e-7, "gyroscope_gauss_markov_tau": 600.0,
            "accelerometer_gauss_markov": 3e-5, "gyroscope_random_walk": 4e-9, "gyroscope_flicker": 5e-8}  # fmt: skip
    made = header_coloured_noise(replace(record(np.random.default_rng(1)), noise=told), 10.0, 1e4)
    assert made["specific_force"] == (GaussMarkov(3e-5, 3600.0),)
    assert made["angular_rate"] == (GaussMarkov(2e-7, 600.0), RandomWalk(4e-9), Flicker(5e-8, 10.0, 1e4, octaves=3.0))


def test_the_header_comes_before_the_rows_and_the_rows_before_nothing():
    recording = record(np.random.default_rng(2), white=30.0)
    force = recording.triad("specific_force")
    np.testing.assert_array_equal(sample_sigma(recording, AXES, force), 30 * UG)
    silent = replace(recording, noise={})
    # 18 x 117 third differences, correlated: 3 sigma of 2.6 %
    np.testing.assert_allclose(sample_sigma(silent, AXES, force), 30 * UG, rtol=0.08)
    one_each = silent.select(np.arange(0, len(recording.time), 120))
    np.testing.assert_array_equal(sample_sigma(one_each, AXES, force[::120]), 0.0)


@pytest.mark.parametrize("rows", [2, 3, 4, 50])
def test_short_stretches_take_lower_differences_and_weights_count(rows):
    rng, n = np.random.default_rng(3), 6000 // rows * rows
    weight = rng.uniform(1, 9, n)
    x = rng.standard_normal((n, 1)) / np.sqrt(weight)[:, None]
    begins = np.arange(n) % rows == 0
    x += 100 * np.cumsum(begins)[:, None]  # every stretch has a level of its own
    assert white_sigma(x, begins, weight)[0] == pytest.approx(1.0, abs=0.08)


def test_differences_are_those_of_the_module_and_take_out_whole_turns():
    x = np.random.default_rng(4).standard_normal((50, 2))
    none, one = np.zeros(50, dtype=bool), np.ones(50)
    by_hand = (x[3:] - 3 * x[2:-1] + 3 * x[1:-2] - x[:-3]) / np.sqrt(20)
    np.testing.assert_allclose(scaled_differences(x.T, none, one), by_hand.T, atol=1e-14)
    turned = x * 0.01 + 2 * np.pi * (np.arange(50) > 20)[:, None]
    np.testing.assert_allclose(
        scaled_differences(turned.T, none, one, turn=2 * [2 * np.pi]), 0.01 * by_hand.T, atol=1e-13
    )
