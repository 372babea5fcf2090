"""How a unit turned on the way between rests: as its gimbals tell it, or its gyroscopes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gimbalcal.effects import Stimulus
from gimbalcal.effects.history import slope
from gimbalcal.forward import rate_of_chain
from gimbalcal.kinematics import ideal_force, stimulus_from_truth
from gimbalcal.number import Array
from gimbalcal.recording import Recording, dwells
from gimbalcal.recording.dwell import moves_between_dwells, rests_are_means
from gimbalcal.recording.record import FORCE, RATE
from gimbalcal.rotation import exponential, mean_rates

MIN_SLEWS = 6  # slews: their scatter tells how well a delay is known
ROWS = 6  # on the way: fewer do not tell how a slew goes
REST_SHARE = 0.5  # of the slew's rows, from the rest at each end: a delay shows there too
MAX_SMOOTHED_ROWS = 9  # rows of readouts that a parabola smooths at most, and an eighth of the slew

Slew = tuple[NDArray[np.int64], int]
"""Rows of a slew with some of the rests beside it, and the ordinal of the rest after."""


@dataclass(frozen=True, eq=False)
class SlewMotion:
    """N rows of all slews: number of the row and of its slew, turn C (N, 3, 3) from a frame at rest, rate, stimulus."""

    row: NDArray[np.int64]
    slew: NDArray[np.int64]
    C: Array
    rate: Array
    stimulus: Stimulus
    axes: Array  # (N, 3, k) of the gimbals, in the frame at rest

    @property
    def spans(self) -> list[slice]:
        """The rows of each slew."""
        edges = np.flatnonzero(np.diff(self.slew, prepend=-1, append=-1))
        return [slice(int(a), int(b)) for a, b in pairwise(edges)]


def slews(recording: Recording) -> list[Slew] | str:
    """Rows of each slew with some of the rests beside it, and the ordinal of the rest after; or why there are none."""
    visits = dwells(recording)
    if recording.position is None or not np.any(recording.position == 0):
        return "no rows between positions were logged"
    if rests_are_means(recording):
        return "the rests come as means, and a delay shows where they end"
    out = []
    for k, move in enumerate(moves_between_dwells(recording), start=1):
        a, b = visits[k - 1 : k + 1]
        n = b.start - a.stop
        if n < ROWS or move.paused:
            continue
        aside = max(2, round(REST_SHARE * n))
        first, last = max(a.start, a.stop - aside), min(b.stop, b.start + aside)
        out.append((np.arange(first, last), k))
    return out if len(out) >= MIN_SLEWS else f"fewer than {MIN_SLEWS} slews have {ROWS} rows or more"


def on_gimbals(recording: Recording, moves: Sequence[Slew]) -> SlewMotion:
    """The motion as the readouts tell it, smoothed."""
    row = np.concatenate([r for r, _ in moves])
    slew = np.concatenate([np.full(len(r), i) for i, (r, _) in enumerate(moves)])
    angle = np.concatenate([_smoothed_angles(recording.angles()[r]) for r, _ in moves])
    part = recording.select(row)
    turned = {("gimbal_angle", a): angle[:, i] for i, a in enumerate(part.platform.axis_names)}
    part = part.with_channels(turned)
    speed = slope(angle, part.time, slew)
    C = part.platform.attitude(angle)
    s = stimulus_from_truth(part, ideal_force(part, angle), np.zeros((len(row), 3))).at(visit=slew)
    axes = np.stack([rate_of_chain(part.platform, s, (), e) for e in np.eye(angle.shape[1])], axis=-1)
    rate = np.einsum("nik,nk->ni", axes, speed)
    s = s.at(rate=rate)
    return SlewMotion(row, slew, C, rate, s, np.swapaxes(C, -1, -2) @ axes)


def _smoothed_angles(angle: Array) -> Array:
    """Readouts (n, k) of one slew through parabolas: even about each row, so that nothing comes early or late."""
    from scipy.signal import savgol_filter

    size = min(MAX_SMOOTHED_ROWS, len(angle) // 8) | 1
    return angle if size < 5 else np.asarray(savgol_filter(angle, size, 2, axis=0, mode="nearest"))


def by_hand(recording: Recording, moves: Sequence[Slew]) -> SlewMotion:
    """The motion as calibrated gyroscopes tell it, less what they read at rest, from the rest before each turn."""
    visits, y, f = dwells(recording), recording.triad(RATE), recording.triad(FORCE)
    row = np.concatenate([r for r, _ in moves])
    slew = np.concatenate([np.full(len(r), i) for i, (r, _) in enumerate(moves)])
    level = np.array([y[d.rows].mean(0) for d in visits])
    rate = np.concatenate([y[r] - (level[k - 1] + level[k]) / 2 for r, k in moves])
    turned, force = [], []
    for i, (r, k) in enumerate(moves):
        phi = np.sum(mean_rates(recording.time[r], rate[slew == i]), axis=0) * np.diff(recording.time[r])[:, None]
        C = [np.eye(3)]
        for step in exponential(phi):
            C.append(step @ C[-1])
        turned.append(np.array(C))
        down = f[visits[k - 1].rows].mean(0)
        force.append(turned[-1] @ (down / np.linalg.norm(down) * recording.site.gravity))
    s = stimulus_from_truth(recording.select(row), np.concatenate(force), rate).at(visit=slew)
    return SlewMotion(row, slew, np.concatenate(turned), rate, s, np.zeros((len(row), 3, 0)))
