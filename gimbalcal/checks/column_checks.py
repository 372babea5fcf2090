r"""Checks of whole columns, where something was suspicious while their rows went by.

* a frozen channel repeats one value for longer than chance allows. With noise sigma and resolution q (the smallest
  step that occurs) neighbours are equal with probability :math:`p \le \mathrm{erf}(q / 2\sqrt{2}\sigma)`, so a run of
  L in n rows is expected :math:`n p^{L-1}` times; a run is refused below 1e-6. Where sigma <= q nothing can be said:
  a quiet channel with coarse steps may well stand still. That holds for the sigma of the rows of the run, as the other
  sensors of the triad show it: elsewhere the unit may move.
* a channel with a dead band reads zero in such a run, and in many more rows than it reads any of the next values.
* a clipped channel reads exactly its largest (or smallest) value far more often than any value close to it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from math import erf, log, sqrt

import numpy as np

from gimbalcal.checks.check import EVERY, POSITIONS, SIGHTINGS, STATIC, Check
from gimbalcal.checks.stream_checks import GAP, STRIDE, StreamChecks
from gimbalcal.number import Array
from gimbalcal.recording.columns import Column
from gimbalcal.recording.record import SENSOR_OF
from gimbalcal.units import from_si, is_raw, to_si

# SI; no sensor reads so much anywhere; and at rest, some ten g and beyond any bias
MAX_READING = {"specific_force": 1e7, "angular_rate": 1e4, "attitude_error": 1e3}
MAX_READING_AT_REST = {"specific_force": 100.0, "angular_rate": 1.0}
PIECE = 10_000_000  # rows that are looked at again at a time: a longer recording is checked part by part
MAX_STRETCHES = 30  # that a sentence lists
CALM_STEPS = 2.0  # scatter of the other sensors of a triad, below which a channel with such steps may stand still
MIN_ROWS = 20  # equal rows that can be called frozen or clipped at all
NEAR_ROWS = 500  # on either side of such a run, that show how long runs of the channel usually are
MIN_SHARE_CLIPPED = 0.01  # of the rows
MIN_AT_END = 5  # rows of a turn, of which no other value near the end has two
CLIPPED_RATIO = 5  # times as many rows as at any of the next values
NEXT_VALUES = 5
MAX_ANGLE_RAD = 2e4 * np.pi  # ten thousand turns
MAX_ANGLE_IN_RADIANS = 4 * np.pi
MIN_PROBABILITY = 1e-6
SMOOTH_RATIO = 1e-7  # of the largest value: what third differences leave of a sidereal wave sampled each minute is 2e-8
DISTINCT_SHARE = 0.9  # share of rows that hardly repeat a value


def no_rows(s: StreamChecks) -> str:
    """Refuse a file without rows."""
    if s.n:
        return ""
    what = "a line of column names" if s.header.samples.suffix == ".csv" else "columns"
    return f"{s.header.samples} has {what} and no rows"


def clock_within_dwells(s: StreamChecks) -> str:
    """Refuse a clock that jumps forward within one position."""
    changes = set(s.changes)
    inside = [(row, dt) for row, dt in s.gaps if row not in changes]
    step = np.diff(s.whole(s.clock.name), prepend=np.nan) if inside else np.zeros(0)
    edges = np.array([*s.changes, s.n])
    for row, dt in inside:
        k = int(np.searchsorted(edges, row, side="right"))
        if edges[k - 1] in s.departures:  # on the way to the next position a logger may pause as long as it likes
            continue
        within = step[edges[k - 1] + 1 : edges[k]]  # a logger may be slower at rest than between
        others = float(within.sum()) - dt
        if len(within) > 2 and dt > others and dt > GAP * np.median(within):
            unit = s.clock.unit
            return s.place_of(s.clock, row) + (
                f"the clock jumps forward by {dt:.6g} {unit} within one position, whose other rows span "
                f"{others:.6g} {unit}; correct the clock, or give the second visit its own position number"
            )
    return ""


def angles_in_degrees(s: StreamChecks) -> str:
    """Refuse angles beyond two turns in radians, most likely logged in degrees; a run may turn on and on."""
    for c in s.angles:
        largest = s.largest(c)
        what = f"{s.header.samples}, column {c.name}: angles up to {largest:g} {c.unit}"
        if to_si(largest, c.unit) > MAX_ANGLE_RAD:
            return f"{what} are no readout of a gimbal; correct them, or the unit in {s.header.path}"
        goes_on = s.kind.stabilised and c.axis == "platform"
        if not goes_on and "rad" in c.unit and to_si(largest, c.unit) > MAX_ANGLE_IN_RADIANS:
            return f'{what} look like degrees; write unit = "deg" for it in {s.header.path}'
    return ""


def beyond_any_sensor(s: StreamChecks) -> str:
    """Refuse a few rows that read more than any sensor can."""
    return _refuse_beyond(s, MAX_READING, "any sensor can read")


def beyond_rest(s: StreamChecks) -> str:
    """Refuse a few rows that read more than a unit at rest can; on the move, a knock may be anything."""
    return _refuse_beyond(s, MAX_READING_AT_REST, "a unit at rest can read", s.position)


def _refuse_beyond(s: StreamChecks, limits: Mapping[str, float], what: str, position: Column | None = None) -> str:
    """Refuse a few rows beyond a limit in SI (at rest, by a position column, if given); of most, the unit is wrong."""
    for c in (c for c in s.sensors if c.quantity in limits and not is_raw(c.unit)):
        limit = from_si(limits[c.quantity], c.unit)
        if s.largest(c) <= limit:
            continue
        x = s.whole(c.name)
        beyond = np.abs(x) > limit
        if position:
            beyond &= _are_few_of_their_rest(s.whole(position.name), beyond)
        rows = np.flatnonzero(beyond)
        if 0 < len(rows) < 0.5 * len(x):
            others = f" (one of {len(rows)} such rows)" if len(rows) > 1 else ""
            why = f"{x[rows[0]]:.6g} {c.unit} is beyond anything that {what}{others}; leave such rows out"
            return s.place_of(c, int(rows[0])) + why
    return ""


def _are_few_of_their_rest(position: Array, beyond: Array) -> Array:
    """Return which rows (n,) belong to a rest of which at most half are beyond a limit.

    Where more are, the unit turned steadily on a table and did not rest.
    """
    number = np.where(position > 0, position, 0).astype(int)
    rows, many = np.bincount(number), np.bincount(number, weights=beyond)
    turning = (rows >= MIN_ROWS) & (many > 0.5 * rows)
    return (number > 0) & ~turning[number]


def frozen_or_clipped(s: StreamChecks) -> str:
    """Refuse a channel that repeats one value, or its largest, more often than chance allows."""
    for c in (*s.sensors, *s.turning):
        many = _is_many(min(s.n, PIECE))
        clipped = any(count >= many for (name, _), (_, count) in s.extremes.items() if name == c.name)
        if c.name not in s.standing and not clipped:
            continue
        x = s.whole(c.name)
        pieces = [x[start : start + PIECE] for start in range(0, len(x), PIECE)]
        if sentence := _not_alive(s, c, pieces, _noise_of_triad(s, c), clipped):
            return sentence
    return ""


def _is_many(n: int) -> float:
    return max(MIN_ROWS, MIN_SHARE_CLIPPED * n)


def _noise_of_triad(s: StreamChecks, c: Column) -> float:
    """Return the scatter of the triad, or the header's noise where that is less or nothing scatters at all."""
    own = [other for other in s.sensors if other.sensor == c.sensor]
    triad = [other for other in own if other.quantity == c.quantity] or [c]  # a gimbal stands for itself
    if s.kind.rotating and all(0.5 < STRIDE * s.repeats[t.name] / s.n < 0.95 for t in triad):
        return 0.0  # a simulation without noise: what scatters is the motion
    sigma = max(to_si(s.scatter.get(t.name, 0.0), t.unit) for t in triad)
    shown = sigma if sigma > SMOOTH_RATIO * max(to_si(s.largest(t), t.unit) for t in triad) else 0.0
    stated = s.header.noise.get(SENSOR_OF[c.quantity], shown)
    return from_si(min(stated, shown) if shown else stated, c.unit)


def _not_alive(s: StreamChecks, c: Column, pieces: Sequence[Array], sigma: float, clipped: bool) -> str:
    quantum, levels = resolution(pieces)
    if sigma <= quantum or (c in s.turning and levels == 1):
        return ""
    first = 0
    for x in pieces if clipped else ():
        if sentence := _refuse_clipped(s, c, x, first):
            return sentence
        first += len(x)
    start, stop, usual = longest_run(pieces)
    n = sum(map(len, pieces))
    probability = erf(quantum / (2 * sqrt(2) * sigma))
    needed = 1 + log(MIN_PROBABILITY / n) / log(probability) if probability else 0.0
    least = usual * max(MIN_ROWS, needed)
    if stop - start < least:
        return ""
    x = s.whole(c.name)
    runs = [
        run
        for run in runs_of(pieces, least)
        if run[1] - run[0] >= max(MIN_ROWS, needed) * _usual_length(x, *run, least)
        and not _is_calm(s, c, *run, quantum)
    ]
    if not runs:
        return ""
    start, stop = max(runs, key=lambda run: run[1] - run[0])
    value = f"{x[start]:.10g} {c.unit}"
    why = f"all {stop - start} rows read {value} although the noise is {sigma:.2g} {c.unit}, so the channel is "
    if zeros := _within_dead_band(x, start, stop, quantum):
        cure = "log what the sensor reads, or leave its column out"
        return f"{s.place_of(c, start, stop)}{why}set to zero about it, by a dead band, in {zeros} rows; {cure}"
    triad = [o for o in s.sensors if (o.sensor, o.quantity) == (c.sensor, c.quantity)]
    largest = max((to_si(s.largest(o), o.unit) for o in triad), default=np.inf)
    stuck = (
        "at the end of its range; raise that, or leave" if abs(to_si(x[start], c.unit)) >= largest else "frozen; leave"
    )
    cure = "dead; leave its column" if stop - start == n else f"{stuck} those rows"
    others = [s.place(*run).rpartition(", ")[2] for run in runs if run != (start, stop)]
    more = [*others[:MAX_STRETCHES], *([f"{len(others) - MAX_STRETCHES} more"] if len(others) > MAX_STRETCHES else [])]
    also = f", and {', '.join(more)} likewise" if others else ""
    return f"{s.place_of(c, start, stop)}{why}{cure} out{also}, or correct [noise]"


def _usual_length(x: Array, start: int, stop: int, least: float) -> float:
    """Return the mean length of the runs of one value about a run of a channel (n,), those of `least` left out.

    Readings behind a filter change slowly at rest, and hardly two in a row are alike where the unit moves.
    """
    neighbours = [x[max(0, start - NEAR_ROWS) : start], x[stop : stop + NEAR_ROWS]]
    lengths = np.concatenate(
        [np.diff(np.flatnonzero(np.diff(part, prepend=np.nan, append=np.nan))) for part in neighbours]
    )
    usual = lengths[lengths < least]
    return float(usual.mean()) if len(usual) else 1.0


def _within_dead_band(x: Array, start: int, stop: int, quantum: float) -> int:
    """Return how many rows of a channel (n,) are zero, if the run of one value is and many others are; else 0."""
    zeros = int(np.count_nonzero(x == 0))
    next_values = np.count_nonzero(np.abs(x) < (NEXT_VALUES + 0.5) * quantum) - zeros
    others = zeros - (stop - start)
    return zeros if x[start] == 0 and others > max(MIN_ROWS, CLIPPED_RATIO * next_values / (2 * NEXT_VALUES)) else 0


def _is_calm(s: StreamChecks, c: Column, start: int, stop: int, quantum: float) -> bool:
    """Return whether other channels vary in rows of one value, those of its triad by no more than `CALM_STEPS` steps.

    The unit is at rest there, and what scatters elsewhere is its motion: a channel with coarse steps stands still.
    """
    triad = [o for o in s.sensors if (o.sensor, o.quantity) == (c.sensor, c.quantity) and o.name != c.name]
    others = [to_si(s.whole(o.name)[start:stop], o.unit) for o in triad]
    varying = any(np.ptp(s.whole(o.name)[start:stop]) > 0 for o in s.sensors if o.name != c.name)
    return varying and bool(others) and all(float(np.std(x)) <= CALM_STEPS * to_si(quantum, c.unit) for x in others)


def _refuse_clipped(s: StreamChecks, c: Column, x: Array, first: int) -> str:
    """Refuse rows (n,) of a sensor, from `first` on, of which many read the largest or smallest value."""
    for sign, word in (1, "largest"), (-1, "smallest"):
        rows = at_maximum(sign * x)
        if len(rows) >= _is_many(len(x)):
            return s.place_of(c, first + int(rows[0])) + (
                f"{x[rows[0]]:.10g} {c.unit} is the {word} value of the channel and stands in {len(rows)} of its "
                f"{len(x)} rows, so it is clipped; raise the range of the sensor, or leave those rows out"
            )
    return ""


CHECKS = (
    Check(no_rows, EVERY),
    Check(clock_within_dwells, POSITIONS, ("position",)),
    Check(angles_in_degrees, (*POSITIONS, *STATIC, *SIGHTINGS)),
    Check(beyond_any_sensor, EVERY),
    Check(beyond_rest, STATIC),
    Check(beyond_rest, POSITIONS, ("position",)),
    Check(frozen_or_clipped, EVERY),
)


# --- values of a column -----------------------------------------------------------------------------------------------


def resolution(pieces: Sequence[Array]) -> tuple[float, int]:
    """Return the smallest step between readings that come in pieces, and the number of different ones.

    The step is zero where hardly two readings are alike, and so is the number where that shows in one piece.
    """
    levels: Array = np.zeros(0)
    counts: Array = np.zeros(0)
    changes = 0
    for x in pieces:
        own, often = np.unique(x, return_counts=True)
        changes += int(np.count_nonzero(np.diff(x)))
        if len(own) > len(x) / 2 and _all_distinct(own, often):
            return 0.0, 0  # all of 1e8 need not be compared
        levels, at = np.unique(np.concatenate([levels, own]), return_inverse=True)
        counts = np.bincount(at, weights=np.concatenate([counts, often.astype(float)])).astype(float)
    returns = len(levels) == 2 and changes > 2  # to both of two readings, which are neighbours on a coarse scale
    if len(levels) < 2 or (_all_distinct(levels, counts) and not returns):
        return 0.0, len(levels)
    return float(np.diff(levels).min()), len(levels)


def _all_distinct(levels: Array, counts: Array) -> bool:
    """Return whether no two readings are alike, but for those that are frozen, or at one of two stops."""
    others = float(counts.sum() - np.sort(counts)[-2:].sum())
    return len(levels) - 2 >= DISTINCT_SHARE * others


def at_maximum(y: Array) -> Array:
    """Return the rows where `y` equals its maximum, if they are many times as many as at any of the next values."""
    top = y.max()
    rows = np.flatnonzero(y == top)
    others_below = y[y < top]
    for _ in range(NEXT_VALUES):
        if not len(others_below):
            break
        next_value = others_below.max()
        if CLIPPED_RATIO * np.count_nonzero(others_below == next_value) >= len(rows):
            return rows[:0]
        others_below = others_below[others_below < next_value]
    return rows if len(others_below) else rows[:0]


def at_end_of_range(channels: Sequence[Array]) -> Array:
    """Return in which rows (n,) any sensor of some (n,) reads an end of its range, where several rows stand."""
    both = [(sign, x, end) for x in channels for sign, end in ((1, x.max()), (-1, x.min()))]
    several = [(sign, x, end) for sign, x, end in both if np.count_nonzero(x == end) >= MIN_AT_END]
    ends = [sign * end for sign, x, end in several if len(at_maximum(sign * x)) >= MIN_AT_END]
    return np.any([np.isin(x, [*ends, *np.negative(ends)]) if ends else np.zeros(len(x), bool) for x in channels], 0)


def runs_of(pieces: Sequence[Array], least: float) -> list[tuple[int, int]]:
    """Return first row and end of every run of at least `least` equal values, in pieces that follow each other."""
    each = ((b, np.flatnonzero(np.diff(b) >= least)) for b in _bounds_of_runs(pieces))
    return [(int(b[k]), int(b[k + 1])) for b, long in each for k in long]


def longest_run(pieces: Sequence[Array]) -> tuple[int, int, float]:
    """Return first row and end of the longest run of equal values, and the mean length of the other runs.

    The values come in pieces that follow each other.
    """
    first, stop, runs, n = 0, 0, 0, 0
    for b in _bounds_of_runs(pieces):
        lengths, n = np.diff(b), int(b[-1])
        runs += len(lengths)
        k = int(np.argmax(lengths)) if len(lengths) else 0
        if len(lengths) and lengths[k] > stop - first:
            first, stop = int(b[k]), int(b[k + 1])
    others = (n - (stop - first)) / (runs - 1) if runs > 1 else 1.0
    return first, stop, float(others)


def _bounds_of_runs(pieces: Sequence[Array]) -> Iterator[Array]:
    """Yield the first rows of runs of equal values: of those that end in a piece and of the next; last, of the last.

    A run may go on from one piece to the next.
    """
    begun, n, last = 0, 0, np.nan
    for x in pieces:
        starts = np.flatnonzero(np.concatenate([[bool(n) and x[0] != last], x[1:] != x[:-1]])) + n
        yield np.concatenate([[begun], starts]).astype(np.int64)
        begun, n, last = int(starts[-1]) if len(starts) else begun, n + len(x), x[-1]
    yield np.array([begun, n])
