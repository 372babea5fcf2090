"""The noise of a recording: as its header states it, as processes, and else as its rows show it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from gimbalcal.earth import HOUR
from gimbalcal.effects.process import Flicker, GaussMarkov, Process, RandomWalk, SettingError, WhiteNoise
from gimbalcal.inference.noise_processes import Noise, one_sigma
from gimbalcal.inference.white_noise import white_sigma
from gimbalcal.number import Array
from gimbalcal.recording.dwell import dwells
from gimbalcal.recording.record import COLOURED, SENSORS, Key, Recording
from gimbalcal.units import to_si

TAU = HOUR
# octaves between the time constants of a flicker: its spectrum is right within 7 %, with few states
FLICKER_OCTAVES = 3.0

SETTING_SIGMA_RAD = float(to_si(1.0, "arcsec"))  # repeatability of a good gimbal, where nobody states it


def header_noise(recording: Recording) -> Mapping[str, Noise]:
    """Return processes by quantity, SI, that the header states.

    White noise of one raw sample; of gimbals that are set and left, the setting repeatability of a visit.
    """

    def process(sensor: str, sigma: float) -> Process:
        return SettingError(sigma) if sensor == "gimbal_angle" and recording.kind.gimbals_are_set else WhiteNoise(sigma)

    sigmas = {sensor: sigma for sensor, sigma in recording.noise.items() if sensor in SENSORS}
    return {SENSORS[sensor]: (process(sensor, sigma),) for sensor, sigma in sigmas.items()}


def header_coloured_noise(recording: Recording, shortest: float, longest: float) -> Mapping[str, Noise]:
    """Return processes by quantity, SI, stated in addition to white noise; flicker between two periods [s].

    A Gauss-Markov process whose time constant is not stated has `TAU`.
    """
    out: dict[str, list[Process]] = {}
    for key, size in recording.noise.items():
        if key in SENSORS or not size or key.endswith("_tau"):
            continue
        process: Process
        if key.endswith("_random_walk"):
            process = RandomWalk(size)
        elif key.endswith("_flicker"):
            process = Flicker(size, shortest, max(longest, shortest), octaves=FLICKER_OCTAVES)
        else:
            process = GaussMarkov(size, recording.noise.get(f"{key}_tau", TAU))
        out.setdefault(COLOURED[key][0], []).append(process)
    return {quantity: tuple(those) for quantity, those in out.items()}


def sample_sigma(recording: Recording, channels: Sequence[Key], value: Array) -> Array:
    """Return one sigma (C,) of one raw sample: the header's, else what neighbouring rows show; 0 without either.

    value (n, C): the rows of the channels, or what a model leaves of them; angles must not jump by a turn.
    """
    processes = header_noise(recording)
    known = [one_sigma(processes[q]) if q in processes else None for q, _ in channels]
    shown = np.zeros(len(channels))
    if None in known:
        begins, still = np.ones(len(value), dtype=bool), np.zeros(len(value), dtype=bool)
        for d in dwells(recording):
            begins[d.start + 1 : d.stop], still[d.rows] = False, True
        shown = white_sigma(value[still], begins[still], recording.weight[still])
    return np.array([shown[i] if sigma is None else sigma for i, sigma in enumerate(known)])


def resolution(x: Array) -> float:
    """Return the step of the converter behind readings (n,): the least difference, if most readings recur; else 0."""
    levels = np.unique(x)
    return float(np.diff(levels).min()) if 1 < len(levels) < len(x) / 2 else 0.0
