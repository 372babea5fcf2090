r"""Intervals of mean readings of a rotation recording for a navigator, long where the unit does not turn.

A mean over an interval of constant rate holds the information of its samples, so that rests of days become a few
thousand intervals. A block of rows is one interval if the angle turned deviates from a constant rate by less than
:math:`\delta`,

.. math:: \max_t \left| \int_0^t \omega \, dt' - \bar\omega t \right| < \delta ,

as the coning error, half the enclosed area, is then below :math:`\delta^2`, and if the same holds for the blocks on
either side, so that the first row of a turn has its own neighbours.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gimbalcal.errors import InputError
from gimbalcal.number import Array
from gimbalcal.recording import Recording
from gimbalcal.recording.dwell import MISSED
from gimbalcal.recording.record import FORCE, RATE

MAX_UNSTEADY_ANGLE_RAD = 1e-4  # rad
MAX_INTERVAL_S = 10.0  # s, of an interval that the navigator takes in one step


@dataclass(frozen=True, eq=False)
class Intervals:
    """Mean readings: rows, with time in mid-interval; lengths dt (n,) [s]; steady: whether all rates are constant."""

    rows: Recording
    dt: Array
    steady: bool

    def filled(self) -> tuple[Array, Array]:
        """Return lengths (m,) none longer than `MAX_INTERVAL_S`, and the interval (m,) that each comes from."""
        pieces = np.maximum(np.ceil(self.dt / MAX_INTERVAL_S - 1e-9).astype(int), 1)
        return np.repeat(self.dt / pieces, pieces), np.repeat(np.arange(len(self.dt)), pieces)


def thinned(recording: Recording, block: float) -> Intervals:
    """Return means of up to `block` [s] where the rate is constant, and every row elsewhere.

    Raises InputError for a clock that pauses while the unit turns: its attitude is unknown after that.
    """
    run = _as_means(recording)
    usual = float(np.median(np.diff(run.time)))
    dt = np.diff(run.time, prepend=run.time[0] - usual)
    _refuse_lost_turns(run, dt, usual)
    several = max(1, round(block / usual))
    n = len(dt)
    first = np.arange(0, n, several)
    whole = np.diff(np.append(first, n))
    steady = _steady(run.triad(RATE), dt, first)
    alone = steady & np.append(steady[1:], True) & np.append(True, steady[:-1])
    begin = np.concatenate([np.flatnonzero(~np.repeat(alone, whole)), first[alone]])
    begin.sort()
    if len(begin) == n:
        return Intervals(replace(run, time=run.time - dt / 2, position=None), dt, bool(steady.all()))
    return _means(run, dt, begin, bool(steady.all()))


def _means(run: Recording, dt: Array, begin: Array, steady: bool) -> Intervals:
    """Return the means of the rows from each `begin` to the next, weighted with their lengths."""
    length = np.add.reduceat(dt, begin)

    def mean(x: Array) -> Array:
        return np.asarray(np.add.reduceat(x * dt, begin) / length)

    channels = {key: mean(values) for key, values in run.channels.items()}
    weight = np.add.reduceat(run.weight, begin)
    middle = mean(run.time - dt / 2)
    rows = replace(run, time=middle, channels=channels, weight=weight, position=None, other_sensors=())
    return Intervals(rows, length, steady)


def _steady(rate: Array, dt: Array, first: Array) -> Array:
    """Return whether the rate is constant in each block (k,), by the angle turned."""
    turned, time = np.cumsum(rate * dt[:, None], axis=0), np.cumsum(dt)
    before, start = turned[first] - rate[first] * dt[first, None], time[first] - dt[first]
    last = np.append(first[1:], len(dt)) - 1
    mean = (turned[last] - before) / (time[last] - start)[:, None]
    k = np.repeat(np.arange(len(first)), last - first + 1)
    off = np.abs(turned - before[k] - mean[k] * (time - start[k])[:, None]).max(axis=1)
    return np.asarray(np.maximum.reduceat(off, first) < MAX_UNSTEADY_ANGLE_RAD)


def _refuse_lost_turns(run: Recording, dt: Array, usual: float) -> None:
    for k in np.flatnonzero(dt > MISSED * usual):
        rate = run.triad(RATE)[max(k - 1, 0) : k + 1]
        if np.abs(rate[0] - rate[-1]).max() * dt[k] > np.deg2rad(1.0) or np.abs(rate).max() > np.deg2rad(0.5):
            raise InputError(
                f"{run.title!r}: the clock pauses for {dt[k]:.3g} s before row {k + 1} while the unit turns, so its "
                "attitude after that is unknown; give a recording without that pause"
            )


def _as_means(recording: Recording) -> Recording:
    """Convert instantaneous rates to means over the interval before, by linear interpolation."""
    if not recording.instant:
        return recording
    channels = {k: np.append(v[:1], (v[1:] + v[:-1]) / 2) if k[0] in (FORCE, RATE) else v
                for k, v in recording.channels.items()}  # fmt: skip
    return replace(recording, channels=channels, instant=False)
