"""Biases that wander, as `[noise]` states them: states of the filter, so that errors are what the sigmas say."""

from dataclasses import replace

import numpy as np
import pytest

from gimbalcal.effects.process import Flicker, GaussMarkov, RandomWalk, sample
from gimbalcal.estimate.systematic.calibrate import systematic
from gimbalcal.estimate.systematic.error_model import bias_processes
from gimbalcal.estimate.systematic.state_lists import states
from gimbalcal.recording import read, write
from gimbalcal.recording.noise_levels import header_coloured_noise
from gimbalcal.simulate import simulate
from gimbalcal.views.segments import segment
from tests.estimate.systematic.table import MOVES, NOISE, turning_unit
from tests.golden import golden_text, refused

ANY = turning_unit(moves=MOVES[:2], stop=8.0, rate=10.0)
THIRTY = states("30", ANY.why_not_shown)
SCALE = np.array([p.sigma for p in THIRTY])
WALK = 2e-4  # m/s^2/sqrt(s): in a second what the accelerometers scatter by in one sample


def _drifting(process, seed):
    rng = np.random.default_rng([7, seed])
    return lambda time: np.stack([sample(process, rng, time)[0] for _ in range(3)], axis=1)


@pytest.mark.parametrize(
    ("process", "told"),
    [
        (RandomWalk(WALK), {"accelerometer_random_walk": WALK}),
        (GaussMarkov(3e-3, 30.0), {"accelerometer_gauss_markov": 3e-3, "accelerometer_gauss_markov_tau": 30.0}),
        (Flicker(3e-3, 1.0, 2000.0), {"accelerometer_flicker": 3e-3}),
    ],
)
def test_errors_are_what_the_sigmas_say_where_the_noise_is_stated(process, told):
    z, unstated = [], []
    for seed in range(2):
        truth = 0.3 * SCALE * np.random.default_rng(seed).standard_normal(len(THIRTY))
        r = turning_unit((), THIRTY, truth, stop=20.0, seed=seed, drift=_drifting(process, seed), noise=NOISE | told)
        found = systematic(r, "30")
        assert found.outcome == ""
        z.append((found.values - truth) / found.sigmas)
        if not seed:
            white = systematic(replace(r, noise=NOISE), "30")
            unstated.append((white.values - truth) / white.sigmas)
            golden_text(white.outcome)
    assert np.sqrt(np.mean(np.square(z))) == pytest.approx(1.0, abs=0.35)  # 42 numbers, correlated
    assert np.sqrt(np.mean(np.square(unstated))) > 2


def test_chains_are_those_of_the_processes():
    told = {"gyroscope_random_walk": 1e-9, "accelerometer_gauss_markov": 1e-4, "accelerometer_gauss_markov_tau": 60.0}
    made = bias_processes(segment(replace(ANY, noise=NOISE | told)))
    assert made.channel.tolist() == [0, 1, 2, 3, 4, 5]
    h = np.diff(segment(ANY).time)
    assert made.Phi[:, 0] == pytest.approx(np.exp(-h / 60.0))
    assert made.Q[:, 3] == pytest.approx(1e-18 * h)
    assert made.P_0.tolist() == [1e-8] * 3 + [0.0] * 3
    assert len(bias_processes(segment(ANY))) == 0


@pytest.mark.parametrize(("octaves", "inside", "within"), [(1.0, 16.0, 0.01), (1.0, 1.0, 0.11), (3.0, 1.0, 0.07)])
def test_a_flicker_of_few_chains_has_the_spectrum_of_many(octaves, inside, within):
    """f S(f) = B^2 / (2 pi) between the corners."""
    process = Flicker(1.0, 2.0, 4000.0, octaves)
    f = np.geomspace(inside / (2 * np.pi * 4000), 1 / (2 * np.pi * 2 * inside), 50)
    tau, variance = process.taus[:, None], process.initial()[:, None]
    S = np.sum(2 * variance * tau / (1 + (2 * np.pi * f * tau) ** 2), axis=0)  # two-sided
    assert 2 * np.pi * f * S == pytest.approx(np.ones(50), rel=within)


def test_a_simulation_states_what_it_simulates_and_a_file_keeps_it(tmp_path):
    walk = {"value": 0.02, "unit": "deg/h/sqrt(h)"}
    r, _ = simulate(
        {
            "format": 1,
            "kind": "rotation",
            "site": {"latitude": {"value": 30.0, "unit": "deg"}},
            "schedule": {"name": "jia2014-9", "dwell": {"value": 10.0, "unit": "s"}},
            "noise": {
                "gyroscope": {"value": 1.0, "unit": "deg/h"},
                "gyroscope_random_walk": walk,
                "accelerometer": {"value": 20.0, "unit": "ug"},
            },
        }
    )
    assert r.noise["gyroscope_random_walk"] == pytest.approx(np.radians(0.02) / 3600 / 60)
    assert "accelerometer_gauss_markov_tau" not in r.noise
    write(r, tmp_path / "r")
    again = read(tmp_path / "r")
    assert again.noise["gyroscope_random_walk"] == pytest.approx(r.noise["gyroscope_random_walk"])
    assert header_coloured_noise(again, 1.0, 100.0) == {
        "angular_rate": (RandomWalk(again.noise["gyroscope_random_walk"]),)
    }
    text = (tmp_path / "r" / "recording.toml").read_text()
    (tmp_path / "r" / "recording.toml").write_text(
        text.replace("rad/s/sqrt(s)", "deg/h").replace("deg/h/sqrt(h)", "deg/h")
    )
    with refused():
        read(tmp_path / "r")
