"""The noise of a simulated recording, as processes by quantity, and what its header says of it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from gimbalcal.effects.process import (
    Flicker,
    GaussMarkov,
    Process,
    RandomWalk,
    SettingError,
    WhiteNoise,
    sample,
)
from gimbalcal.inference.noise_processes import Noise, one_sigma
from gimbalcal.number import Array
from gimbalcal.recording import COLOURED, SENSORS
from gimbalcal.simulate.scenario import Scenario


def noises(scenario: Scenario) -> Mapping[str, Noise]:
    """Return the processes by quantity, SI; a header states white noise and setting.

    See `recording.noise_levels.stated`.
    """
    n, rate = scenario.noise, scenario.schedule.rate
    force = float(np.hypot(n.accelerometer, n.accelerometer_density * np.sqrt(rate)))
    spin = float(np.hypot(n.gyroscope, n.gyroscope_density * np.sqrt(rate)))
    read = WhiteNoise if scenario.recording_kind.stabilised else SettingError
    every: dict[str, list[tuple[float, Process]]] = {
        "specific_force": [
            (force, WhiteNoise(force)),
            (n.accelerometer_random_walk, RandomWalk(n.accelerometer_random_walk)),
            (n.accelerometer_flicker, Flicker(n.accelerometer_flicker)),
            (n.accelerometer_gauss_markov, GaussMarkov(n.accelerometer_gauss_markov, n.accelerometer_gauss_markov_tau)),
        ],
        "angular_rate": [
            (spin, WhiteNoise(spin)),
            (n.gyroscope_random_walk, RandomWalk(n.gyroscope_random_walk)),
            (n.gyroscope_flicker, Flicker(n.gyroscope_flicker)),
            (n.gyroscope_gauss_markov, GaussMarkov(n.gyroscope_gauss_markov, n.gyroscope_gauss_markov_tau)),
        ],
        "gimbal_angle": [(n.gimbal_angle, read(n.gimbal_angle))],
        "attitude_error": [(n.attitude, WhiteNoise(n.attitude))],
    }
    return {quantity: tuple(p for size, p in those if size > 0) for quantity, those in every.items()}


def coloured(
    noise: Noise, axis: str, time: Array, rng: np.random.Generator, states: dict[tuple[str, str], Array]
) -> Array:
    """Return the sum of a channel's noise processes (n,), SI; their last states carry over to the next block."""
    total = np.zeros(len(time))
    for process in noise:
        key = (process.id, axis)
        y, states[key] = sample(process, rng, time, state=states.get(key))
        total += y
    return total


def of_rates(noise: Noise, time: Array, rng: np.random.Generator, states: dict[tuple[str, str], Array]) -> Array:
    """Return the noise of the three gyroscopes (n, 3) [rad/s]."""
    if all(isinstance(process, WhiteNoise) for process in noise):
        return np.asarray(one_sigma(noise) * rng.standard_normal((len(time), 3)))
    return np.stack([coloured(noise, f"rate {axis}", time, rng, states) for axis in "xyz"], axis=1)


def stated(scenario: Scenario) -> dict[str, float]:
    """Return the noise that the header states: white noise of one sample and the setting repeatability."""
    every = noises(scenario)
    processes = {
        sensor: [p for p in every.get(q, ()) if isinstance(p, WhiteNoise | SettingError)]
        for sensor, q in SENSORS.items()
    }
    out = {sensor: one_sigma(noise) for sensor, noise in processes.items() if noise}
    if scenario.schedule.turns:
        out.pop("gimbal_angle", None)  # no gimbal is logged
        out |= {key: size for key in COLOURED if (size := getattr(scenario.noise, key)) and _there(scenario, key)}
    return out | ({"velocity": scenario.noise.velocity} if scenario.noise.velocity else {})


def _there(scenario: Scenario, key: str) -> bool:
    """Return whether the process of which a key of [noise] speaks is simulated: a time constant alone is none."""
    return bool(getattr(scenario.noise, key.removesuffix("_tau")))
