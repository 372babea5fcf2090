"""Stretches in which a rig turns a unit steadily: what gyroscopes read there beyond the rate that the angles tell."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gimbalcal.effects.history import integral
from gimbalcal.errors import InputError
from gimbalcal.number import Array
from gimbalcal.recording import Recording
from gimbalcal.recording.dwell import PAUSED, usual_step
from gimbalcal.recording.record import RATE
from gimbalcal.rotation import rotation_vector
from gimbalcal.units import from_si

BLOCK_S = 0.5  # s of a mean rate: no lag between readout and gyroscopes matters, and readouts hardly scatter
MAX_RATE_CHANGE = 0.005  # of the fastest rate, from one block to the next
MIN_RATE = np.radians(0.1)  # rad/s; a table that never turns faster stands


@dataclass(frozen=True, eq=False)
class Stretches:
    """Stretches of one recording: reading less rate (m, 3), its sigma, rate (m, 3), C_bp, and middle time (m,) [s]."""

    reading: Array
    sigma: Array
    rate: Array
    attitude: Array
    time: Array


def stretches_of(r: Recording) -> Stretches:
    """Means over blocks in which the table turns as steadily as before and after, joined where they follow.

    Raises InputError for a recording that is too short, or in which nothing turns, or never steadily.
    """
    step = usual_step(r)
    n = max(2, round(BLOCK_S / step))
    starts = np.arange(0, len(r.time) - n, n)
    if not len(starts):
        raise InputError(
            f"{r.title!r} is shorter than {BLOCK_S:g} s; turn the table at steady rates for ten seconds each"
        )
    C = r.platform.attitude(r.angles())
    y = r.triad(RATE)
    dt = np.diff(r.time)
    whole = np.array([dt[s : s + n].max() <= PAUSED * step for s in starts])
    turn = rotation_vector(C[:-1] @ np.swapaxes(C[1:], -1, -2))
    span = r.time[starts + n] - r.time[starts]
    rate = np.array([turn[s : s + n].sum(0) for s in starts]) / span[:, None]
    total = integral(y, r.time)
    mean = (total[starts + n] - total[starts]) / span[:, None]
    fastest = float(np.linalg.norm(rate[whole], axis=1).max(initial=0.0))
    if fastest < MIN_RATE:
        raise InputError(
            f"{r.title!r}: the table stands or turns by {from_si(fastest, 'deg/s'):.2g} deg/s at most; turn it at "
            "steady rates, or calibrate rests with --method multiposition"
        )
    new = np.linalg.norm(np.diff(rate, axis=0), axis=1) > MAX_RATE_CHANGE * fastest
    edge = np.concatenate([[False], new]) | np.concatenate([new, [False]]) | ~whole
    groups = np.split(np.flatnonzero(~edge), np.flatnonzero(np.diff(np.flatnonzero(~edge)) > 1) + 1)
    groups = [part for g in groups for part in _level(g, rate, MAX_RATE_CHANGE * fastest) if len(part) > 1]
    if not groups:
        raise InputError(
            f"{r.title!r}: the table never turns steadily for {4 * BLOCK_S:g} s; hold each rate for ten seconds, or "
            "use --method attitude for motion that goes on"
        )
    off = mean - rate
    inside = np.concatenate([off[g] - off[g].mean(0) for g in groups])
    white = np.sqrt((inside**2).sum(0) / max(len(inside) - len(groups), 1))
    middle = starts + n // 2
    return Stretches(
        np.array([off[g].mean(0) for g in groups]),
        np.array([white / np.sqrt(len(g)) for g in groups]),
        np.array([rate[g].mean(0) for g in groups]),
        np.array([C[starts[g[0]] : starts[g[-1]] + n].mean(0) for g in groups]),
        np.array([r.time[middle[g]].mean() for g in groups]),
    )


def _level(group: Array, rate: Array, tolerance: float) -> list[Array]:
    """Blocks that follow each other, cut where a slow change of the rate adds up to more than `tolerance`."""
    out, first = [], 0
    for k in range(1, len(group) + 1):
        if k == len(group) or np.linalg.norm(rate[group[k]] - rate[group[first]]) > 2 * tolerance:
            out.append(group[first:k])
            first = k
    return out
