"""Is every row a number, does time go forward, is every sensor alive?

`Screen` looks at each batch as it streams by, at the cost of a few passes over data that is in the cache. What looks
suspicious there is judged at the end on the whole column, see `judging`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable

import numpy as np

from gimbalcal.checks.dropouts import Dropouts
from gimbalcal.errors import InputError, amount
from gimbalcal.number import Array
from gimbalcal.recording.columns import SPARSE, Column
from gimbalcal.recording.document import LARGEST
from gimbalcal.recording.header import Header
from gimbalcal.recording.samples import Batch
from gimbalcal.units import celsius, is_raw, to_si

COUNTED = 1e12  # samples behind a row at most, and one over it at least: next to the others it is all, or nothing
COLDEST, HOTTEST = -273.15, 2000.0  # degC
GAP = 10.0  # times the usual step: longer ones end a run of rows
LONGEST_STEP = 86400.0  # s; no run that goes on and on pauses for longer, and others say so
MOST_POSITIONS = 1_000_000
STRIDE = 5  # every run of FEWEST rows holds four neighbours of every fifth row


class Screen:
    """Watches the rows go by and refuses the recording where they cannot be right."""

    def __init__(self, header: Header, whole: Callable[[str], Array], dropouts: Dropouts) -> None:
        self.header, self.dropouts = header, dropouts
        self.whole = lambda name: dropouts.whole(whole(name))  # `whole` fetches one column for a second look
        clock, position = header.column("time"), header.column("position")
        if clock is None:
            raise ValueError("a header without a time column does not pass `read_header`")
        self.clock, self.position = clock, position
        self.sensors = [c for c in header.columns if c.quantity in ("specific_force", "angular_rate")]
        self.angles = [c for c in header.columns if c.quantity == "gimbal_angle"]
        self.weights = [c for c in header.columns if c.quantity == "weight"]
        self.thermometers = [c for c in header.columns if c.quantity == "temperature" and not is_raw(c.unit)]
        if header.kind.stabilised:  # the readings of the run go on and on; at a position they may well stand still
            self.sensors += [c for c in header.columns if c.quantity == "attitude_error"]
        # gimbals that must not stand still once they have moved
        self.turning = self.angles if header.kind.stabilised else []
        self.n = 0
        self.step = 0.0  # usual step in time
        self.last_time, self.last_position = np.nan, np.nan
        self.turns: list[int] = []  # rows where the position changes
        self.moves: set[int] = set()  # those of them where the unit begins to move
        self.gaps: list[tuple[int, float]] = []  # inside a position
        self.peaks: dict[tuple[str, int], tuple[float, int]] = {}  # (name, sign): largest value and how often
        self.stuck: set[str] = set()
        self.repeats: Counter[str] = Counter()  # of every STRIDEth row, how many repeat the one before
        self.visits = header.kind.in_positions and self.position is not None  # no clock has to find them
        self.by_order = header.kind.sighting or bool(clock.regular) or (self.visits and clock.resolution > 0)
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

    def place(self, start: int, stop: int | None = None) -> str:
        """Where rows `start` up to `stop` stand in the file."""
        return self.dropouts.place(start, stop)

    def _finite(self, name: str, x: Array) -> None:
        bad = np.flatnonzero(~np.isfinite(x))
        huge = np.flatnonzero(np.abs(x) >= LARGEST)
        if not len(bad) and len(huge):
            raise InputError(
                f"{self.place(self.n + int(huge[0]))}, column {name}: {x[huge[0]]:g} is beyond anything that can be "
                "measured; correct it, or leave such rows out"
            )
        if len(bad):
            run = int(np.argmax(np.append(np.diff(bad), 2) > 1)) + 1
            more = f", nor are the {run - 1} below it" if run > 1 else ""
            where = self.place(self.n + int(bad[0]))
            raise InputError(
                f"{where}, column {name}: the value is empty or not a finite number{more}; leave such rows out"
            )

    def _positive(self, name: str, x: Array) -> None:
        none = np.flatnonzero(~((x > 1 / COUNTED) & (x < COUNTED)))
        if len(none):
            raise InputError(
                f"{self.place(self.n + int(none[0]))}, column {name}: a weight says of how many samples a row is the "
                f"mean, and is more than 0 and below {COUNTED:g}; got {x[none[0]]:g}, so leave such rows out"
            )

    def _bearable(self, each: Column, x: Array) -> None:
        degrees = celsius(x, each.unit)
        far = np.flatnonzero((degrees < COLDEST) | (degrees > HOTTEST))
        if len(far):
            raise InputError(
                f"{self.place(self.n + int(far[0]))}, column {each.name}: {x[far[0]]:g} {each.unit} is no temperature "
                "of a sensor; correct it or its unit, or leave such rows out"
            )

    def _time(self, t: Array) -> Array:
        dt = np.diff(t, prepend=self.last_time)
        seconds = to_si(1.0, self.clock.unit)
        if not self.step and len(t) > 1:
            self.step = float(np.median(dt[1:] if self.n == 0 else dt))
        long = dt * seconds > LONGEST_STEP
        wrong = np.flatnonzero((dt < 0 if self.by_order else dt <= 0) | (long & self.header.kind.continuous))
        self.equal += int(np.count_nonzero(dt == 0))
        if len(wrong):
            self._refuse_time(int(wrong[0]), t, float(dt[wrong[0]]))
        self.last_time = float(t[-1]) if len(t) else self.last_time
        far = dt > GAP * self.step if self.step else np.zeros(len(t), dtype=bool)
        self.gaps += [(self.n + int(i), float(dt[i])) for i in np.flatnonzero(far)]
        begins: Array = far | np.isnan(dt)
        return begins

    def _refuse_time(self, i: int, t: Array, dt: float) -> None:
        where = f"{self.place(self.n + i)}, column {self.clock.name}"
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
                f"{self.place(self.n + int(odd[0]))}, column {self.position.name}: a position is a "
                f"whole number, 1, 2, ... or 0 while moving, got {p[odd[0]]:g}"
            )
        changed: Array = np.diff(p, prepend=self.last_position) != 0
        self.turns += (np.flatnonzero(changed) + self.n).tolist()
        self.moves |= set((np.flatnonzero(changed & (p == 0)) + self.n).tolist())
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
        return (*told, f"{self.place(row)}, {column}: {what} for {days:.3g} d; both sides are one recording")
