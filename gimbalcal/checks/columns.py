r"""What looked suspicious while the rows went by, judged on the whole column.

* a frozen channel repeats one value for longer than chance allows. With noise sigma and resolution q (the smallest
  step that occurs) neighbours are equal with probability :math:`p \le \mathrm{erf}(q / 2\sqrt{2}\sigma)`, so a run of
  L in n rows is expected :math:`n p^{L-1}` times; a run is refused below 1e-6. Where sigma <= q nothing can be said:
  a quiet channel with coarse steps may well stand still.
* a clipped channel reads exactly its largest (or smallest) value far more often than any value close to it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import erf, log, sqrt

import numpy as np

from gimbalcal.checks.frozen_channels import longest_run, piled_up, steps
from gimbalcal.checks.stream import GAP, STRIDE, Screen
from gimbalcal.errors import InputError
from gimbalcal.number import Array
from gimbalcal.recording.columns import Column
from gimbalcal.recording.record import SENSORS
from gimbalcal.units import from_si, is_raw, to_si

IMPOSSIBLE = {"specific_force": 100.0, "angular_rate": 1.0}  # m/s^2, some ten g; rad/s, beyond any bias: at rest
BEYOND = {"specific_force": 1e7, "angular_rate": 1e4, "attitude_error": 1e3}  # SI; no sensor reads so much anywhere
PIECE = 10_000_000  # rows that are looked at again at a time: a longer recording is judged part by part
FEWEST = 20  # equal rows that can be called frozen or clipped at all
FURTHEST = 2e4 * np.pi  # rad; ten thousand turns
CHANCE = 1e-6
SMOOTH = 1e-7  # of the largest value: what third differences leave of a sidereal wave sampled each minute is 2e-8


def judge(s: Screen, scatter: Mapping[str, float]) -> None:
    """The verdict on the whole; `scatter` is one sigma by column name, in the unit of the file."""
    if s.n == 0:
        what = "a line of column names" if s.header.samples.suffix == ".csv" else "columns"
        raise InputError(f"{s.header.samples} has {what} and no rows")
    _clock_inside_dwells(s)
    _angle_units(s)
    _spikes(s)
    for each in (*s.sensors, *s.turning):
        many = _many(min(s.n, PIECE))
        piled = [k for (name, _), (_, k) in s.peaks.items() if name == each.name and k >= many]
        if each.name in s.stuck or piled:
            sigma = _sigma(s, each, scatter)
            x = s.whole(each.name)
            _alive(s, each, [x[start : start + PIECE] for start in range(0, len(x), PIECE)], sigma, bool(piled))


def _many(n: int) -> float:
    return max(FEWEST, 0.01 * n)


def _sigma(s: Screen, each: Column, scatter: Mapping[str, float]) -> float:
    """What the triad scatters by, or the header's noise where that is less or nothing scatters at all."""
    sensor = next(name for name, quantity in SENSORS.items() if quantity == each.quantity)
    own = [c for c in s.sensors if c.sensor == each.sensor]
    alike = [c for c in own if c.quantity == each.quantity] or [each]  # a gimbal stands for itself
    if s.header.kind.rotating and all(0.5 < STRIDE * s.repeats[c.name] / s.n < 0.95 for c in alike):
        return 0.0  # a simulation without noise: what scatters is the motion
    triad = [to_si(scatter.get(c.name, 0.0), c.unit) for c in alike]
    largest = max(abs(to_si(s.peaks[c.name, k][0], c.unit)) for c in alike for k in (1, -1))
    seen = max(triad) if max(triad) > SMOOTH * largest else 0.0
    stated = s.header.noise.get(sensor, seen)
    return from_si(min(stated, seen) if seen else stated, each.unit)


def _alive(s: Screen, each: Column, pieces: Sequence[Array], sigma: float, piled: bool) -> None:
    quantum, levels = steps(pieces)
    if sigma <= quantum or (each in s.turning and levels == 1):
        return
    first = 0
    for x in pieces if piled else ():
        _free(s, each, x, first)
        first += len(x)
    start, stop, usual = longest_run(pieces)
    n = sum(map(len, pieces))
    chance = erf(quantum / (2 * sqrt(2) * sigma))
    needed = 1 + log(CHANCE / n) / log(chance) if chance else 0.0
    if stop - start >= usual * max(FEWEST, needed):
        raise InputError(
            f"{s.place(start, stop)}, column {each.name}: all {stop - start} rows read "
            f"{s.whole(each.name)[start]:.10g} {each.unit} although the noise is {sigma:.2g} {each.unit}, so "
            f"the channel is {'dead; leave its column' if stop - start == n else 'frozen; leave those rows'} out, "
            "or correct [noise]"
        )


def _free(s: Screen, each: Column, x: Array, first: int) -> None:
    """Refuse rows of a sensor, from `first` on, that pile up at the largest or smallest value."""
    for sign, word in (1, "largest"), (-1, "smallest"):
        rows = piled_up(sign * x)
        if len(rows) >= _many(len(x)):
            raise InputError(
                f"{s.place(first + int(rows[0]))}, column {each.name}: {x[rows[0]]:.10g} {each.unit} "
                f"is the {word} value of the channel and stands in {len(rows)} of its {len(x)} rows, so it is "
                "clipped; raise the range of the sensor, or leave those rows out"
            )


def _clock_inside_dwells(s: Screen) -> None:
    if not s.header.kind.in_positions or s.position is None:
        return
    edges = np.array([*s.turns, s.n])
    changed = set(s.turns)
    inside = [(row, dt) for row, dt in s.gaps if row not in changed]
    step = np.diff(s.whole(s.clock.name), prepend=np.nan) if inside else np.zeros(0)
    for row, dt in inside:
        k = int(np.searchsorted(edges, row, side="right"))
        if edges[k - 1] in s.moves:  # on the way to the next position a logger may pause as long as it likes
            continue
        within = step[edges[k - 1] + 1 : edges[k]]  # a logger may be slower at rest than between
        rest = float(within.sum()) - dt
        if len(within) > 2 and dt > rest and dt > GAP * np.median(within):
            where, unit = s.place(row), s.clock.unit
            raise InputError(
                f"{where}, column {s.clock.name}: the clock jumps forward by {dt:.6g} {unit} "
                f"within one position, whose other rows span {rest:.6g} {unit}; correct the clock, or give the "
                "second visit its own position number"
            )


def _angle_units(s: Screen) -> None:
    """An angle beyond two turns in radians was most likely logged in degrees; a run may turn on and on."""
    if s.header.kind.rotating:
        return
    for each in s.angles:
        largest = max((abs(s.peaks[each.name, sign][0]) for sign in (1, -1)), default=0.0)
        if to_si(largest, each.unit) > FURTHEST:
            raise InputError(
                f"{s.header.samples}, column {each.name}: angles up to {largest:g} {each.unit} are no readout "
                f"of a gimbal; correct them, or the unit in {s.header.path}"
            )
        goes_on = s.header.kind.stabilised and each.axis == "platform"
        if not goes_on and "rad" in each.unit and to_si(largest, each.unit) > 4 * np.pi:
            raise InputError(
                f"{s.header.samples}, column {each.name}: angles up to {largest:g} {each.unit} look like "
                f'degrees; write unit = "deg" for it in {s.header.path}'
            )


def _spikes(s: Screen) -> None:
    """A few rows at rest that read many g are faults of the logger; if most rows do, the unit is wrong instead."""
    for each in s.sensors:
        _few_beyond(s, each, BEYOND[each.quantity], "any sensor can read", everywhere=True)
    if not s.header.kind.stabilised and (not s.header.kind.in_positions or s.position is None):
        return  # on the move, a knock may be anything
    for each in s.sensors:
        if each.quantity in IMPOSSIBLE:
            _few_beyond(s, each, IMPOSSIBLE[each.quantity], "a unit at rest can read")


def _few_beyond(s: Screen, each: Column, most: float, what: str, everywhere: bool = False) -> None:
    """Refuse a few rows of a sensor, at rest or everywhere, that read more than `most` in SI."""
    limit = from_si(most, each.unit)
    if is_raw(each.unit) or max(abs(s.peaks[each.name, sign][0]) for sign in (1, -1)) <= limit:
        return
    x = s.whole(each.name)
    still = s.whole(s.position.name) > 0 if s.position and not everywhere else np.ones(len(x), dtype=bool)
    rows = np.flatnonzero(still & (np.abs(x) > limit))
    if 0 < len(rows) < 0.5 * len(x):
        others = f" (one of {len(rows)} such rows)" if len(rows) > 1 else ""
        raise InputError(
            f"{s.place(int(rows[0]))}, column {each.name}: {x[rows[0]]:.6g} {each.unit} is beyond anything "
            f"that {what}{others}; leave such rows out"
        )
