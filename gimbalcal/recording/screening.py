r"""Is every row a number, does time go forward, is every sensor alive?

`Screen` looks at each batch as it streams by, at the cost of a few passes over data that is in the cache. What looks
suspicious there is judged at the end on the whole column:

* a frozen channel repeats one value for longer than chance allows. With noise sigma and resolution q (the smallest
  step that occurs) neighbours are equal with probability :math:`p \le \mathrm{erf}(q / 2\sqrt{2}\sigma)`, so a run of
  L in n rows is expected :math:`n p^{L-1}` times; a run is refused below 1e-6. Where sigma <= q nothing can be said:
  a quiet channel with coarse steps may well stand still.
* a clipped channel reads exactly its largest (or smallest) value far more often than any value close to it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from math import erf, log, sqrt

import numpy as np

from gimbalcal.errors import InputError, amount
from gimbalcal.number import Array
from gimbalcal.recording.columns import Column
from gimbalcal.recording.document import LARGEST
from gimbalcal.recording.header import Header
from gimbalcal.recording.holes import SPARSE, Holes
from gimbalcal.recording.record import SENSORS
from gimbalcal.recording.samples import Batch
from gimbalcal.recording.stuck import longest_run, piled_up, steps
from gimbalcal.units import celsius, from_si, is_raw, to_si

COUNTED = 1e12  # samples behind a row at most, and one over it at least: next to the others it is all, or nothing
IMPOSSIBLE = {"specific_force": 100.0, "angular_rate": 1.0}  # m/s^2, some ten g; rad/s, beyond any bias: at rest
BEYOND = {"specific_force": 1e7, "angular_rate": 1e4, "attitude_error": 1e3}  # SI; no sensor reads so much anywhere
COLDEST, HOTTEST = -273.15, 2000.0  # degC
GAP = 10.0  # times the usual step: longer ones end a run of rows
LONGEST_STEP = 86400.0  # s; no run that goes on and on pauses for longer, and others say so
STEADY = ("static-run", "rotation")  # kinds in which the time that passes between rows is part of the physics
PIECE = 10_000_000  # rows that are looked at again at a time: a longer recording is judged part by part
FEWEST = 20  # equal rows that can be called frozen or clipped at all
MOST_POSITIONS = 1_000_000
FURTHEST = 2e4 * np.pi  # rad; ten thousand turns
STRIDE = 5  # every run of FEWEST rows holds four neighbours of every fifth row
CHANCE = 1e-6
SMOOTH = 1e-7  # of the largest value: what third differences leave of a sidereal wave sampled each minute is 2e-8


class Screen:
    """Watches the rows go by and refuses the recording where they cannot be right."""

    def __init__(self, header: Header, whole: Callable[[str], Array], holes: Holes) -> None:
        self.header, self.holes = header, holes
        self.whole = lambda name: holes.whole(whole(name))  # `whole` fetches one column for a second look
        clock, position = header.column("time"), header.column("position")
        if clock is None:
            raise ValueError("a header without a time column does not pass `read_header`")
        self.clock, self.position = clock, position
        self.sensors = [c for c in header.columns if c.quantity in ("specific_force", "angular_rate")]
        self.angles = [c for c in header.columns if c.quantity == "gimbal_angle"]
        self.weights = [c for c in header.columns if c.quantity == "weight"]
        self.thermometers = [c for c in header.columns if c.quantity == "temperature" and not is_raw(c.unit)]
        if header.kind == "static-run":  # the readings of the run go on and on; at a position they may well stand still
            self.sensors += [c for c in header.columns if c.quantity == "attitude_error"]
        # gimbals that must not stand still once they have moved
        self.turning = self.angles if header.kind == "static-run" else []
        self.n = 0
        self.step = 0.0  # usual step in time
        self.last_time, self.last_position = np.nan, np.nan
        self.turns: list[int] = []  # rows where the position changes
        self.gaps: list[tuple[int, float]] = []  # inside a position
        self.peaks: dict[tuple[str, int], tuple[float, int]] = {}  # (name, sign): largest value and how often
        self.stuck: set[str] = set()
        self.repeats: Counter[str] = Counter()  # of every STRIDEth row, how many repeat the one before
        self.visits = header.kind == "multi-position" and self.position is not None  # no clock has to find them
        self.by_order = header.kind == "pointing" or bool(clock.regular) or (self.visits and clock.resolution > 0)
        self.equal = 0  # rows stamped as the one before them

    def see(self, batch: Batch) -> Array:
        """Check a batch; returns for each row whether it begins anew (after a gap or in another position)."""
        sparse = [c.name for c in self.header.columns if c.quantity in SPARSE]
        for name, every in batch.items():
            x = every[~np.isnan(every)] if name in sparse else every
            with np.errstate(over="ignore", invalid="ignore"):
                sound = np.dot(x, x) < LARGEST**2  # a NaN is not
            if not sound:
                self._finite(name, x)
        for each in self.weights:
            self._positive(each.name, batch[each.name])
        for each in self.thermometers:
            self._bearable(each, batch[each.name])
        begins = self._time(batch[self.clock.name])
        if self.position is not None:
            begins |= self._positions(batch[self.position.name])
        for each in self.sensors:
            self._sensor(each.name, batch[each.name])
        for each in self.angles:
            (self._sensor if each in self.turning else self._peak)(each.name, batch[each.name])
        self.n += len(begins)
        return begins

    def _place(self, start: int, stop: int | None = None) -> str:
        return self.holes.place(start, stop)

    def _finite(self, name: str, x: Array) -> None:
        bad = np.flatnonzero(~np.isfinite(x))
        huge = np.flatnonzero(np.abs(x) >= LARGEST)
        if not len(bad) and len(huge):
            raise InputError(
                f"{self._place(self.n + int(huge[0]))}, column {name}: {x[huge[0]]:g} is beyond anything that can be "
                "measured; correct it, or leave such rows out"
            )
        if len(bad):
            run = int(np.argmax(np.append(np.diff(bad), 2) > 1)) + 1
            more = f", nor are the {run - 1} below it" if run > 1 else ""
            where = self._place(self.n + int(bad[0]))
            raise InputError(
                f"{where}, column {name}: the value is empty or not a finite number{more}; leave such rows out"
            )

    def _positive(self, name: str, x: Array) -> None:
        none = np.flatnonzero(~((x > 1 / COUNTED) & (x < COUNTED)))
        if len(none):
            raise InputError(
                f"{self._place(self.n + int(none[0]))}, column {name}: a weight says of how many samples a row is the "
                f"mean, and is more than 0 and below {COUNTED:g}; got {x[none[0]]:g}, so leave such rows out"
            )

    def _bearable(self, each: Column, x: Array) -> None:
        degrees = celsius(x, each.unit)
        far = np.flatnonzero((degrees < COLDEST) | (degrees > HOTTEST))
        if len(far):
            raise InputError(
                f"{self._place(self.n + int(far[0]))}, column {each.name}: {x[far[0]]:g} {each.unit} is no temperature "
                "of a sensor; correct it or its unit, or leave such rows out"
            )

    def _time(self, t: Array) -> Array:
        dt = np.diff(t, prepend=self.last_time)
        seconds = to_si(1.0, self.clock.unit)
        if not self.step and len(t) > 1:
            self.step = float(np.median(dt[1:] if self.n == 0 else dt))
        long = dt * seconds > LONGEST_STEP
        wrong = np.flatnonzero((dt < 0 if self.by_order else dt <= 0) | (long & (self.header.kind in STEADY)))
        self.equal += int(np.count_nonzero(dt == 0))
        if len(wrong):
            self._refuse_time(int(wrong[0]), t, float(dt[wrong[0]]))
        self.last_time = float(t[-1]) if len(t) else self.last_time
        far = dt > GAP * self.step if self.step else np.zeros(len(t), dtype=bool)
        self.gaps += [(self.n + int(i), float(dt[i])) for i in np.flatnonzero(far)]
        begins: Array = far | np.isnan(dt)
        return begins

    def _refuse_time(self, i: int, t: Array, dt: float) -> None:
        where = f"{self._place(self.n + i)}, column {self.clock.name}"
        unit = self.clock.unit
        if dt > 0:
            raise InputError(
                f"{where}: the clock jumps forward by {dt:.6g} {unit}, more than a day; correct it, or give each "
                "part its own recording"
            )
        what = "stands still" if dt == 0 else f"jumps back by {-dt:.6g} {unit}"
        state = ", or state how coarse it is, as resolution beside its unit" if self.visits and dt == 0 else ""
        raise InputError(
            f"{where}: the clock {what} at {t[i]:.10g} {unit}; time must grow from row to row, so sort the rows and "
            f"leave out what was logged twice{state}"
        )

    def _positions(self, p: Array) -> Array:
        odd = np.flatnonzero((p != np.floor(p)) | (p < 0) | (p > MOST_POSITIONS))
        if self.position is not None and len(odd):
            raise InputError(
                f"{self._place(self.n + int(odd[0]))}, column {self.position.name}: a position is a "
                f"whole number, 1, 2, ... or 0 while moving, got {p[odd[0]]:g}"
            )
        changed: Array = np.diff(p, prepend=self.last_position) != 0
        self.turns += (np.flatnonzero(changed) + self.n).tolist()
        self.last_position = float(p[-1]) if len(p) else self.last_position
        return changed

    def _peak(self, name: str, x: Array) -> None:
        for sign in (1, -1):
            value = float(x.max() if sign > 0 else x.min())
            count = int(np.count_nonzero(x == value))
            before, seen = self.peaks.get((name, sign), (-sign * np.inf, 0))
            if value == before:
                self.peaks[name, sign] = (value, seen + count)
            elif sign * value > sign * before:
                self.peaks[name, sign] = (value, count)

    def _sensor(self, name: str, x: Array) -> None:
        self._peak(name, x)
        thin = x[::STRIDE]
        same = thin[1:] == thin[:-1]
        self.repeats[name] += int(np.count_nonzero(same))
        if bool((same[2:] & same[1:-1] & same[:-2]).any()):
            self.stuck.add(name)

    def finish(self, scatter: Mapping[str, float]) -> None:
        """The verdict on the whole; `scatter` is one sigma by column name, in the unit of the file."""
        if self.n == 0:
            what = "a line of column names" if self.header.samples.suffix == ".csv" else "columns"
            raise InputError(f"{self.header.samples} has {what} and no rows")
        self._clock_inside_dwells()
        self._angle_units()
        self._spikes()
        for each in (*self.sensors, *self.turning):
            many = self._many(min(self.n, PIECE))
            piled = [k for (name, _), (_, k) in self.peaks.items() if name == each.name and k >= many]
            if each.name in self.stuck or piled:
                sigma = self._sigma(each, scatter)
                x = self.whole(each.name)
                self._alive(each, [x[start : start + PIECE] for start in range(0, len(x), PIECE)], sigma, bool(piled))

    def _many(self, n: int) -> float:
        return max(FEWEST, 0.01 * n)

    def _sigma(self, each: Column, scatter: Mapping[str, float]) -> float:
        """What the triad scatters by, or the header's noise where that is less or nothing scatters at all."""
        sensor = next(name for name, quantity in SENSORS.items() if quantity == each.quantity)
        own = [c for c in self.sensors if c.sensor == each.sensor]
        alike = [c for c in own if c.quantity == each.quantity] or [each]  # a gimbal stands for itself
        if self.header.kind == "rotation" and all(0.5 < STRIDE * self.repeats[c.name] / self.n < 0.95 for c in alike):
            return 0.0  # a simulation without noise: what scatters is the motion
        triad = [to_si(scatter.get(c.name, 0.0), c.unit) for c in alike]
        largest = max(abs(to_si(self.peaks[c.name, k][0], c.unit)) for c in alike for k in (1, -1))
        seen = max(triad) if max(triad) > SMOOTH * largest else 0.0
        stated = self.header.noise.get(sensor, seen)
        return from_si(min(stated, seen) if seen else stated, each.unit)

    def _alive(self, each: Column, pieces: Sequence[Array], sigma: float, piled: bool) -> None:
        quantum, levels = steps(pieces)
        if sigma <= quantum or (each in self.turning and levels == 1):
            return
        first = 0
        for x in pieces if piled else ():
            self._free(each, x, first)
            first += len(x)
        start, stop, usual = longest_run(pieces)
        n = sum(map(len, pieces))
        chance = erf(quantum / (2 * sqrt(2) * sigma))
        needed = 1 + log(CHANCE / n) / log(chance) if chance else 0.0
        if stop - start >= usual * max(FEWEST, needed):
            raise InputError(
                f"{self._place(start, stop)}, column {each.name}: all {stop - start} rows read "
                f"{self.whole(each.name)[start]:.10g} {each.unit} although the noise is {sigma:.2g} {each.unit}, so "
                f"the channel is {'dead; leave its column' if stop - start == n else 'frozen; leave those rows'} out, "
                "or correct [noise]"
            )

    def _free(self, each: Column, x: Array, first: int) -> None:
        """Refuse rows of a sensor, from `first` on, that pile up at the largest or smallest value."""
        for sign, word in (1, "largest"), (-1, "smallest"):
            rows = piled_up(sign * x)
            if len(rows) >= self._many(len(x)):
                raise InputError(
                    f"{self._place(first + int(rows[0]))}, column {each.name}: {x[rows[0]]:.10g} {each.unit} "
                    f"is the {word} value of the channel and stands in {len(rows)} of its {len(x)} rows, so it is "
                    "clipped; raise the range of the sensor, or leave those rows out"
                )

    def _clock_inside_dwells(self) -> None:
        if self.header.kind != "multi-position" or self.position is None:
            return
        edges = np.array([*self.turns, self.n])
        changed = set(self.turns)
        inside = [(row, dt) for row, dt in self.gaps if row not in changed]
        steps = np.diff(self.whole(self.clock.name), prepend=np.nan) if inside else np.zeros(0)
        for row, dt in inside:
            k = int(np.searchsorted(edges, row, side="right"))
            within = steps[edges[k - 1] + 1 : edges[k]]  # a logger may be slower at rest than between
            rest = float(within.sum()) - dt
            if len(within) > 2 and dt > rest and dt > GAP * np.median(within):
                where, unit = self._place(row), self.clock.unit
                raise InputError(
                    f"{where}, column {self.clock.name}: the clock jumps forward by {dt:.6g} {unit} "
                    f"within one position, whose other rows span {rest:.6g} {unit}; correct the clock, or give the "
                    "second visit its own position number"
                )

    def remarks(self) -> tuple[str, ...]:
        """Rows of one stamp, and pauses of more than a day: parts of one recording all the same."""
        unit, column = self.clock.unit, f"column {self.clock.name}"
        alike = f"{amount(self.equal, 'row')} stamped as the one before, and taken in the order of the file"
        told = (f"{self.header.samples}, {column}: {alike}",) if self.equal else ()
        long = [(row, dt) for row, dt in self.gaps if to_si(dt, unit) > LONGEST_STEP]
        if not long:
            return told
        row, dt = max(long, key=lambda gap: gap[1])
        what = "the clock pauses" if len(long) == 1 else f"the clock pauses {len(long)} times for more than a day, here"
        days = to_si(dt, unit) / LONGEST_STEP
        return (*told, f"{self._place(row)}, {column}: {what} for {days:.3g} d; both sides are one recording")

    def _angle_units(self) -> None:
        """An angle beyond two turns in radians was most likely logged in degrees; a run may turn on and on."""
        if self.header.kind == "rotation":
            return
        for each in self.angles:
            largest = max((abs(self.peaks[each.name, sign][0]) for sign in (1, -1)), default=0.0)
            if to_si(largest, each.unit) > FURTHEST:
                raise InputError(
                    f"{self.header.samples}, column {each.name}: angles up to {largest:g} {each.unit} are no readout "
                    f"of a gimbal; correct them, or the unit in {self.header.path}"
                )
            goes_on = self.header.kind == "static-run" and each.axis == "platform"
            if not goes_on and "rad" in each.unit and to_si(largest, each.unit) > 4 * np.pi:
                raise InputError(
                    f"{self.header.samples}, column {each.name}: angles up to {largest:g} {each.unit} look like "
                    f'degrees; write unit = "deg" for it in {self.header.path}'
                )

    def _spikes(self) -> None:
        """A few rows at rest that read many g are faults of the logger; if most rows do, the unit is wrong instead."""
        for each in self.sensors:
            self._few_beyond(each, BEYOND[each.quantity], "any sensor can read", everywhere=True)
        if self.header.kind != "static-run" and (self.header.kind != "multi-position" or self.position is None):
            return  # on the move, a knock may be anything
        for each in self.sensors:
            if each.quantity in IMPOSSIBLE:
                self._few_beyond(each, IMPOSSIBLE[each.quantity], "a unit at rest can read")

    def _few_beyond(self, each: Column, most: float, what: str, everywhere: bool = False) -> None:
        """Refuse a few rows of a sensor, at rest or everywhere, that read more than `most` in SI."""
        limit = from_si(most, each.unit)
        if is_raw(each.unit) or max(abs(self.peaks[each.name, sign][0]) for sign in (1, -1)) <= limit:
            return
        x = self.whole(each.name)
        still = self.whole(self.position.name) > 0 if self.position and not everywhere else np.ones(len(x), dtype=bool)
        rows = np.flatnonzero(still & (np.abs(x) > limit))
        if 0 < len(rows) < 0.5 * len(x):
            others = f" (one of {len(rows)} such rows)" if len(rows) > 1 else ""
            raise InputError(
                f"{self._place(int(rows[0]))}, column {each.name}: {x[rows[0]]:.6g} {each.unit} is beyond anything "
                f"that {what}{others}; leave such rows out"
            )
