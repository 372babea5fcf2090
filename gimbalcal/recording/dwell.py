"""The dwells of a recording: stretches of rows in one position, in order of visits."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gimbalcal.effects.effect import TRIAD
from gimbalcal.errors import InputError
from gimbalcal.number import Array
from gimbalcal.recording.record import ANGLE, ANGLES, FORCE, Recording

MEANS = 1.5  # times the samples of a row on the way: a row of a rest is a longer mean
PAUSE_STEPS = 10.0  # usual steps: nobody knows how a unit turned while the clock paused for longer
SAME_ATTITUDE = np.cos(np.radians(5.0))  # dwells that are closer than this are one attitude
UP_AND_DOWN = 6  # attitudes, each of three axes up and down
MIN_SHARE_OF_OFFSET, MIN_SHARE_OF_TURN = 0.03, 0.6  # of counts, which gravity is; of the widest axis' range
MISSED_ROW_STEPS = 1.5  # times the usual step: a row is missing, and rows on both sides have no common middle


@dataclass(frozen=True)
class Dwell:
    """Rows `start` up to `stop` were logged in `position`."""

    position: int
    start: int
    stop: int

    @property
    def rows(self) -> slice:
        """Return the rows, to index an array with."""
        return slice(self.start, self.stop)


def dwells(recording: Recording) -> tuple[Dwell, ...]:
    """Return the visits of `recording` in order of time; a position may be visited more than once, 0 is no visit.

    A recording without positions (a static run) is one visit of position 1.
    """
    n = len(recording.time)
    if recording.position is None or n == 0:
        return (Dwell(1, 0, n),) if n else ()
    p = recording.position
    edges = np.concatenate([[0], np.flatnonzero(p[1:] != p[:-1]) + 1, [n]])
    return tuple(Dwell(int(p[start]), int(start), int(stop)) for start, stop in pairwise(edges) if p[start] > 0)


def visited_positions(recording: Recording) -> int:
    """Return how many positions were visited; none where the recording has no positions."""
    return 0 if recording.position is None else len({d.position for d in dwells(recording)})


def attitudes(y: Array) -> int:
    """Return the number of different attitudes among dwells that read y (m, 3) in any unit."""
    kept = np.zeros((0, 3))
    for u in y / np.linalg.norm(y, axis=1, keepdims=True):
        if not np.any(kept @ u > SAME_ATTITUDE):
            kept = np.vstack([kept, u])
    return len(kept)


def in_several_attitudes(recording: Recording, fewest: int = 2) -> bool:
    """Return whether accelerometers rest at different angles of a platform, or in so many attitudes by the force.

    `UP_AND_DOWN` attitudes are the fewest that determine bias and scale factor of three accelerometers.
    """
    if not recording.has(FORCE) or visited_positions(recording) < 2:
        return False
    if recording.has(ANGLE) or len(recording.axes(FORCE)) < 3:
        return True
    y = dwell_means(recording).triad(FORCE)
    if recording.counted(FORCE):  # from an offset, where they point all ways about another middle than zero
        low, high = y.min(axis=0), y.max(axis=0)
        turned = MIN_SHARE_OF_TURN * np.max(high - low) < np.min(high - low)
        if turned and np.mean(high - low) / 2 > MIN_SHARE_OF_OFFSET * np.linalg.norm(high + low) / 2:
            y = y - (low + high) / 2
    return attitudes(y) >= fewest


@dataclass(frozen=True)
class MoveRows:
    """Rows from the last of a dwell to the first of the next; `paused`: nobody knows how the unit turned meanwhile."""

    rows: slice
    paused: bool


def moves_between_dwells(recording: Recording) -> tuple[MoveRows, ...]:
    """Return the move from each dwell to the next; the clock pauses in one where it takes `PAUSE_STEPS` usual steps."""
    spans = [slice(a.stop - 1, b.start + 1) for a, b in pairwise(dwells(recording))]
    longest = PAUSE_STEPS * usual_step(recording) if spans else 0.0
    return tuple(MoveRows(s, bool(np.any(np.diff(recording.time[s]) > longest))) for s in spans)


def rests_are_means(recording: Recording) -> bool:
    """Return whether rows of rests are means and those on the way between them are not."""
    p, weight = recording.position, recording.weight
    if p is None or np.all(p > 0) or not np.any(p > 0) or weight.max() <= MEANS * weight.min():
        return False
    return bool(np.median(weight[p > 0]) > MEANS * np.median(weight[p == 0]))


def whole_means(recording: Recording) -> Recording:
    """Return the rows of rests that stand for as many samples as most of their rest do: these all weigh alike."""
    kept = np.zeros(len(recording.time), dtype=bool)
    for d in dwells(recording):
        weight = recording.weight[d.rows]
        kept[d.rows] = weight > weight.max() / 2
    return recording.select(kept)


def usual_step(recording: Recording) -> float:
    """Return the usual time from row to row [s]: on the way, where the rows of rests are means."""
    p = recording.position
    several = p is not None and np.count_nonzero(p == 0) > 1
    way = p == 0 if p is not None and several and rests_are_means(recording) else slice(None)
    return float(np.median(np.diff(recording.time[way]), overwrite_input=True))


def dwell_means(recording: Recording) -> Recording:
    """One row per dwell: means over its rows, weighted by `weight`, which adds up.

    Angles are averaged as angles (359 and 1 deg give 360). The scatter of the rows stays with the result. Do not
    average where something decays within a dwell: the time inside it is lost.
    """
    visits = dwells(recording)
    if not visits:
        raise InputError(
            f"the recording {recording.title!r} has no dwell: every row has position 0, or nothing in it is at rest"
        )
    return _means(recording, visits, np.array([d.position for d in visits], dtype=np.int64))


def dwell_levels(recording: Recording, quantity: str) -> Array:
    """Return the mean (m, 3) of the rows of each dwell, all alike, of a triad."""
    channels = [recording.channels[quantity, axis] for axis in TRIAD]
    return np.array([[x[d.rows].mean() for x in channels] for d in dwells(recording)]).reshape(-1, 3)


def block_means(recording: Recording, rows: int) -> Recording:
    """One row per `rows` consecutive rows of a recording without positions, averaged as `dwell_means` does.

    No block reaches across a gap: one that a gap cuts has fewer rows.
    """
    n, dt = len(recording.time), np.diff(recording.time)
    gaps = (np.flatnonzero(dt > MISSED_ROW_STEPS * np.median(dt)) + 1).tolist() if n > 1 else []
    return stretch_means(recording, [at for start, stop in pairwise([0, *gaps, n]) for at in range(start, stop, rows)])


def stretch_means(recording: Recording, starts: Sequence[int]) -> Recording:
    """One row per stretch of a recording without positions, from each start to the next, averaged as `dwell_means`."""
    return _means(recording, [Dwell(1, start, stop) for start, stop in pairwise([*starts, len(recording.time)])], None)


def without_dwells(recording: Recording, ordinals: Collection[int]) -> Recording:
    """Return the recording without some dwells, whose rows are on the way if such rows were logged, and gone if not."""
    if recording.position is None or not ordinals:
        return recording
    out = np.zeros(len(recording.time), dtype=bool)
    for d in (d for k, d in enumerate(dwells(recording)) if k in ordinals):
        out[d.rows] = True
    on_the_way = np.any(recording.position == 0)
    return replace(recording, position=np.where(out, 0, recording.position)) if on_the_way else recording.select(~out)


def in_blocks(recording: Recording, count: int) -> Recording:
    """Return the recording with its dwells cut into about `count` dwells of as many rows each, numbered in order."""
    visits = dwells(recording)
    rows = max(1, sum(d.stop - d.start for d in visits) // count)
    position = np.zeros(len(recording.time), dtype=np.int64)
    number = 0
    for d in visits:
        for part in np.array_split(np.arange(d.start, d.stop), max(1, (d.stop - d.start) // rows)):
            number += 1
            position[part] = number
    return replace(recording, position=position)


def _means(recording: Recording, stretches: Sequence[Dwell], position: NDArray[np.int64] | None) -> Recording:
    def mean(values: Array, angle: bool = False) -> Array:
        return np.array([_weighted_mean(values[d.rows], recording.weight[d.rows], angle) for d in stretches])

    lasts = np.array([_duration(recording, d) for d in stretches])
    return replace(
        recording,
        time=mean(recording.time),
        position=position,
        channels={key: mean(values, key[0] in ANGLES) for key, values in recording.channels.items()},
        weight=np.array([recording.weight[d.rows].sum() for d in stretches]),
        begin=float(recording.time[0]) if recording.begin is None else recording.begin,
        duration=lasts if lasts.any() else None,
        other_sensors=tuple(_means(other, stretches, position) for other in recording.other_sensors),
    )


def _duration(recording: Recording, d: Dwell) -> float:
    """Return the time [s] of which the mean of a stretch of rows is one: from its first row to its last."""
    own = 0 * recording.time if recording.duration is None else recording.duration
    first, last = d.start, d.stop - 1
    return float(recording.time[last] - recording.time[first] + (own[first] + own[last]) / 2)


def _weighted_mean(values: Array, weight: Array, angle: bool) -> float:
    first = float(values[0])
    off = values - first
    if angle:
        off = off - 2 * np.pi * np.round(off / (2 * np.pi))
    return first + float((off * weight).sum() / weight.sum())
