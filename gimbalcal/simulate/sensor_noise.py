"""The noise of a simulated recording, as processes by quantity, and what its header says of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

import numpy as np

from gimbalcal.effects.process import Flicker, GaussMarkov, Process, RandomWalk, SettingError, WhiteNoise, sample
from gimbalcal.inference.noise_processes import Noise, one_sigma
from gimbalcal.number import Array
from gimbalcal.recording import COLOURED, SENSORS
from gimbalcal.simulate.scenario import Scenario


def noise_processes(scenario: Scenario) -> Mapping[str, Noise]:
    """Return the processes by quantity, SI; a header states white noise and setting.

    See `recording.noise_levels.header_noise`.
    """
    n, rate = scenario.noise, scenario.schedule.rate
    angle_noise = WhiteNoise if scenario.recording_kind.stabilised else SettingError
    every: dict[str, list[tuple[float, Callable[[float], Process]]]] = {
        "gimbal_angle": [(n.gimbal_angle, angle_noise)],
        "attitude_error": [(n.attitude, WhiteNoise)],
    }
    for sensor in ("accelerometer", "gyroscope"):
        size = partial(getattr, n)
        tau = size(f"{sensor}_gauss_markov_tau")
        every[SENSORS[sensor]] = [
            (float(np.hypot(size(sensor), size(f"{sensor}_density") * np.sqrt(rate))), WhiteNoise),
            (size(f"{sensor}_random_walk"), RandomWalk),
            (size(f"{sensor}_flicker"), Flicker),
            (size(f"{sensor}_gauss_markov"), partial(GaussMarkov, tau=tau)),
        ]
    return {quantity: tuple(process(size) for size, process in those if size > 0) for quantity, those in every.items()}


def coloured_noise(
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
    return np.stack([coloured_noise(noise, f"rate {axis}", time, rng, states) for axis in "xyz"], axis=1)


def stated_noise(scenario: Scenario) -> dict[str, float]:
    """Return the noise that the header states: white noise of one sample and the setting repeatability."""
    every, n = noise_processes(scenario), scenario.noise
    processes = {
        sensor: [p for p in every.get(q, ()) if isinstance(p, WhiteNoise | SettingError)]
        for sensor, q in SENSORS.items()
    }
    out = {sensor: one_sigma(noise) for sensor, noise in processes.items() if noise}
    if scenario.schedule.turns:
        out.pop("gimbal_angle", None)  # no gimbal is logged; a time constant alone is no process
        out |= {key: size for key in COLOURED if (size := getattr(n, key)) and getattr(n, key.removesuffix("_tau"))}
    return out | ({"velocity": n.velocity} if n.velocity else {})
