"""Checks of each row as it is read: every value, the clock and the position numbers.

`StreamChecks` looks at each batch as it streams by, at the cost of a few passes over data that is in the cache. What is
suspicious there is checked at the end on the whole column, see `columns`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gimbalcal.checks.dropouts import Dropouts
from gimbalcal.errors import InputError, number_of
from gimbalcal.number import Array
from gimbalcal.recording.columns import SPARSE, Column
from gimbalcal.recording.document import MAX_STATED_NUMBER
from gimbalcal.recording.header import Header
from gimbalcal.recording.kinds import Kind
from gimbalcal.recording.samples import Batch
from gimbalcal.units import celsius, is_raw, to_si

MAX_SAMPLES = 1e12  # behind a row, and one over it at least: relative to the others it is all, or nothing
MIN_TEMPERATURE_DEGC, MAX_TEMPERATURE_DEGC = -273.15, 2000.0
MAX_POSITIONS = 1_000_000
GAP = 10.0  # usual steps: longer ones end a run of rows
MAX_STEP_S = 86400.0  # no run whose clock may not pause has a longer one; others say so
STRIDE = 5  # every run of 20 equal rows holds four neighbours of every fifth row


@dataclass(frozen=True)
class ValueCheck:
    """A check of every value of some columns: of which quantities, the values (n,) that it refuses, and why."""

    quantities: tuple[str, ...]
    refuses: Callable[[Array, str], NDArray[np.bool_]]
    sentence: Callable[[float, str], str]


def _not_a_temperature(x: Array, unit: str) -> NDArray[np.bool_]:
    degrees = celsius(x, unit)
    return np.asarray((degrees < MIN_TEMPERATURE_DEGC) | (degrees > MAX_TEMPERATURE_DEGC))


VALUE_CHECKS = (
    ValueCheck(
        ("weight",),
        lambda x, _: ~((x > 1 / MAX_SAMPLES) & (x < MAX_SAMPLES)),
        lambda x, _: (
            "a weight says of how many samples a row is the mean, and is more than 0 and below "
            f"{MAX_SAMPLES:g}; got {x:g}, so leave such rows out"
        ),
    ),
    ValueCheck(
        ("temperature",),
        _not_a_temperature,
        lambda x, unit: f"{x:g} {unit} is no temperature of a sensor; correct it or its unit, or leave such rows out",
    ),
    ValueCheck(
        ("position",),
        lambda x, _: (x != np.floor(x)) | (x < 0) | (x > MAX_POSITIONS),
        lambda x, _: f"a position is a whole number, 1, 2, ... or 0 while moving, got {x:g}",
    ),
)


class StreamChecks:
    """Check the rows as they go by, and remember what the checks of whole columns need."""

    label = ""  # sentences begin with the file and the line

    def __init__(self, header: Header, whole: Callable[[str], Array], dropouts: Dropouts) -> None:
        self.header, self.dropouts = header, dropouts
        self.whole = lambda name: dropouts.whole(whole(name))  # `whole` fetches one column for a second look
        clock, position = header.column("time"), header.column("position")
        if clock is None:
            raise ValueError("a header without a time column does not pass `read_header`")
        self.clock, self.position = clock, position
        self.sensors = [c for c in header.columns if c.quantity in ("specific_force", "angular_rate")]
        if header.kind.stabilised:  # these go on and on too; at a position they may well stand still
            self.sensors += [c for c in header.columns if c.quantity == "attitude_error"]
        self.angles = [c for c in header.columns if c.quantity == "gimbal_angle"]
        # gimbals that must not stand still once they have moved
        self.turning = self.angles if header.kind.stabilised else []
        physical = [c for c in header.columns if not (c.quantity == "temperature" and is_raw(c.unit))]
        self.values = [(c, check) for check in VALUE_CHECKS for c in physical if c.quantity in check.quantities]
        self.scatter: dict[str, float] = {}  # one sigma by column, once all rows went by
        self.n = 0
        self.step = 0.0  # usual step in time
        self.shortest, self.longest = np.inf, 0.0  # steps in time
        self.last_time, self.last_position = np.nan, np.nan
        self.changes: list[int] = []  # rows where the position changes
        self.departures: set[int] = set()  # those of them where the unit begins to move
        self.gaps: list[tuple[int, float]] = []  # inside a position
        self.extremes: dict[tuple[str, int], tuple[float, int]] = {}  # (name, sign): largest value and how often
        self.standing: set[str] = set()  # columns that stand still somewhere
        self.repeats: Counter[str] = Counter()  # of every STRIDEth row, how many repeat the one before
        self.numbered = header.kind.in_positions and position is not None  # no clock has to find them
        self.by_order = header.kind.sighting or bool(clock.regular) or (self.numbered and clock.resolution > 0)
        self.equal = 0  # rows stamped as the one before them

    def see(self, batch: Batch) -> Array:
        """Check a batch; return for each row whether it begins anew (after a gap or in another position)."""
        sparse = [c.name for c in self.header.columns if c.quantity in SPARSE]
        for name, every in batch.items():
            x = every[~np.isnan(every)] if name in sparse else every
            with np.errstate(over="ignore", invalid="ignore"):
                sound = np.dot(x, x) < MAX_STATED_NUMBER**2  # a NaN is not
            if not sound:
                self._check_finite(name, x)
        for c, check in (pair for pair in self.values if pair[0] is not self.position):
            self._check_values(c, check, batch[c.name])
        begins = self._clock(batch[self.clock.name])
        for c, check in (pair for pair in self.values if pair[0] is self.position):
            self._check_values(c, check, batch[c.name])
            begins |= self._positions(batch[c.name])
        for c in (*self.sensors, *self.angles):
            self._remember(c.name, batch[c.name], repeats=c not in self.angles or c in self.turning)
        self.n += len(begins)
        return begins

    @property
    def kind(self) -> Kind:
        """Return the kind of the recording that is read."""
        return self.header.kind

    def has(self, item: str) -> bool:
        """Return whether a column holds a quantity."""
        return self.header.column(item) is not None

    def largest(self, c: Column) -> float:
        """Return the largest absolute value of a column, in its unit."""
        return max(abs(self.extremes.get((c.name, sign), (0.0, 0))[0]) for sign in (1, -1))

    def place(self, start: int, stop: int | None = None) -> str:
        """Return where rows `start` up to `stop` stand in the file."""
        return self.dropouts.place(start, stop)

    def place_of(self, c: Column, start: int, stop: int | None = None) -> str:
        """Return where rows of a column stand, as a refusal begins."""
        return f"{self.place(start, stop)}, column {c.name}: "

    def _refuse(self, row: int, name: str, why: str) -> None:
        """Raise InputError for a row of the batch: every refusal of a value begins with its line and column."""
        raise InputError(f"{self.place(self.n + row)}, column {name}: {why}")

    def _check_values(self, c: Column, check: ValueCheck, x: Array) -> None:
        refused = np.flatnonzero(check.refuses(x, c.unit))
        if len(refused):
            self._refuse(int(refused[0]), c.name, check.sentence(float(x[refused[0]]), c.unit))

    def _check_finite(self, name: str, x: Array) -> None:
        bad, huge = np.flatnonzero(~np.isfinite(x)), np.flatnonzero(np.abs(x) >= MAX_STATED_NUMBER)
        if len(bad):
            run = int(np.argmax(np.append(np.diff(bad), 2) > 1)) + 1
            more = f", nor are the {run - 1} below it" if run > 1 else ""
            why = f"the value is empty or not a finite number{more}; leave such rows out"
            self._refuse(int(bad[0]), name, why)
        if len(huge):
            why = f"{x[huge[0]]:g} is beyond anything that can be measured; correct it, or leave such rows out"
            self._refuse(int(huge[0]), name, why)

    def _clock(self, t: Array) -> Array:
        """Check that time grows; return the rows (n,) after a gap."""
        dt = np.empty(len(t))
        dt[:1] = t[:1] - self.last_time
        np.subtract(t[1:], t[:-1], out=dt[1:])
        steps = dt if self.n else dt[1:]
        if not self.step and len(t) > 1:
            self.step = float(np.median(steps))
        shortest, longest = float(steps.min(initial=np.inf)), float(steps.max(initial=0.0))
        self.shortest, self.longest = min(self.shortest, shortest), max(self.longest, longest)
        self.last_time = float(t[-1]) if len(t) else self.last_time
        begins: Array = np.isnan(dt)
        si = to_si(1.0, self.clock.unit)
        # usual steps need no look at each row: twelve million rows pass here
        if shortest > 0 and longest <= GAP * self.step and longest * si <= MAX_STEP_S:
            return begins
        wrong = np.flatnonzero(
            (dt < 0 if self.by_order else dt <= 0) | (self.header.kind.continuous & (dt * si > MAX_STEP_S))
        )
        self.equal += int(np.count_nonzero(dt == 0))
        if len(wrong):
            self._refuse(int(wrong[0]), self.clock.name, self._why_not(float(t[wrong[0]]), float(dt[wrong[0]])))
        far = dt > GAP * self.step if self.step else np.zeros(len(t), dtype=bool)
        self.gaps += [(self.n + int(i), float(dt[i])) for i in np.flatnonzero(far)]
        return far | begins

    def _why_not(self, t: float, dt: float) -> str:
        unit = self.clock.unit
        if dt > 0:
            return (
                f"the clock jumps forward by {dt:.6g} {unit}, more than a day; correct it, or give each "
                "part its own recording"
            )
        what = "stands still" if dt == 0 else f"jumps back by {-dt:.6g} {unit}"
        coarse = ", or state how coarse it is, as resolution next to its unit" if self.numbered and dt == 0 else ""
        return (
            f"the clock {what} at {t:.10g} {unit}; time must grow from row to row, so sort the rows and "
            f"leave out what was logged twice{coarse}"
        )

    def _positions(self, p: Array) -> Array:
        """Remember where positions change; return these rows (n,)."""
        changed: Array = np.diff(p, prepend=self.last_position) != 0
        self.changes += (np.flatnonzero(changed) + self.n).tolist()
        self.departures |= set((np.flatnonzero(changed & (p == 0)) + self.n).tolist())
        self.last_position = float(p[-1]) if len(p) else self.last_position
        return changed

    def _remember(self, name: str, x: Array, repeats: bool) -> None:
        """Remember the extremes of a column and, where its `repeats` may be suspicious, whether it stands still."""
        for sign in (1, -1):
            value = float(x.max() if sign > 0 else x.min())
            before, counted = self.extremes.get((name, sign), (-sign * np.inf, 0))
            if sign * value >= sign * before:
                earlier = counted if value == before else 0
                self.extremes[name, sign] = (value, earlier + int(np.count_nonzero(x == value)))
        if not repeats:
            return
        thin = x[::STRIDE]
        same = thin[1:] == thin[:-1]
        self.repeats[name] += int(np.count_nonzero(same))
        if bool((same[2:] & same[1:-1] & same[:-2]).any()):
            self.standing.add(name)

    def remarks(self) -> tuple[str, ...]:
        """Return remarks on rows of one stamp, and on pauses of more than a day within one recording."""
        unit, column = self.clock.unit, f"column {self.clock.name}"
        alike = f"{number_of(self.equal, 'row')} stamped as the one before, and taken in the order of the file"
        equal = (f"{self.header.samples}, {column}: {alike}",) if self.equal else ()
        long = [(row, dt) for row, dt in self.gaps if to_si(dt, unit) > MAX_STEP_S]
        if not long:
            return equal
        row, dt = max(long, key=lambda gap: gap[1])
        what = "the clock pauses" if len(long) == 1 else f"the clock pauses {len(long)} times for more than a day, here"
        days = to_si(dt, unit) / MAX_STEP_S
        return (*equal, f"{self.place(row)}, {column}: {what} for {days:.3g} d; both sides are one recording")
