"""The noise of a recording: as its header states it, as processes, and else as its rows show it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from gimbalcal.earth import HOUR
from gimbalcal.effects.process import Flicker, GaussMarkov, Process, RandomWalk, SettingError, WhiteNoise
from gimbalcal.inference.noise_processes import Noise, one_sigma
from gimbalcal.inference.white_noise import scaled_differences, white_sigma
from gimbalcal.number import Array
from gimbalcal.recording.dwell import dwells
from gimbalcal.recording.record import ANGLES, COLOURED, SENSORS, Key, Recording
from gimbalcal.units import to_si

TAU = HOUR
# octaves between the time constants of a flicker: its spectrum is right within 7 %, with few states
FLICKER_OCTAVES = 3.0

BATCH_ROWS = 8192  # rows looked at in each batch: sigma to better than 1 % from the first one
SETTING_SIGMA_RAD = float(to_si(1.0, "arcsec"))  # repeatability of a good gimbal, where nobody states it


def header_noise(recording: Recording) -> Mapping[str, Noise]:
    """Return processes by quantity, SI, that the header states.

    White noise of one raw sample; of gimbals that are set and left, the setting repeatability of a visit.
    """

    def process(sensor: str, sigma: float) -> Process:
        is_set = sensor == "gimbal_angle" and not recording.kind.stabilised  # else gimbals follow the Earth
        return SettingError(sigma) if is_set else WhiteNoise(sigma)

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


class Scatter:
    """Pooled scatter of C channels over batches; turn (C,): size of a full turn of an angle, infinite of others."""

    def __init__(self, turn: Array) -> None:
        self.turn, self.squares, self.count = turn, np.zeros(len(turn)), 0

    def add(self, x: Sequence[Array], begins: Array, weight: Array, still: Array) -> None:
        """Take in channels (n,) each; `begins`: rows that do not continue the row before, `still`: those at rest."""
        if len(begins) < 4 or not len(x):
            return
        first = slice(BATCH_ROWS)
        third = scaled_differences([c[first] for c in x], begins[first] | ~still[first], weight[first], turn=self.turn)
        self.squares += [float(d @ d) for d in third]
        self.count += len(third[0])

    def sigma(self) -> list[float]:
        """Return one sigma by channel; none where no four rows followed each other."""
        return np.sqrt(self.squares / self.count).tolist() if self.count else []


def pooled_scatter(
    time: Array, position: Array | None, channels: Mapping[Key, Array], weight: Array | None = None
) -> dict[Key, float]:
    """Return the scatter of rows that are in memory, one sigma of a raw sample by channel, from the rows at rest.

    weight (n,): raw samples behind each row, one where it is left out.
    """
    n = len(time)
    weight = np.ones(n) if weight is None else weight
    p = np.ones(n) if position is None else position
    begins, still = np.diff(p, prepend=p[:1]) != 0, p > 0
    scatter = Scatter(np.array([2 * np.pi if quantity in ANGLES else np.inf for quantity, _ in channels]))
    for start in range(0, n, BATCH_ROWS):
        rows = slice(start, start + BATCH_ROWS)
        scatter.add([x[rows] for x in channels.values()], begins[rows], weight[rows], still[rows])
    return dict(zip(channels, scatter.sigma(), strict=False))
