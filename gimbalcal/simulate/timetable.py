"""From a schedule to a clock: when the platform stands where, truly and as commanded, and when a run has its rows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gimbalcal.earth import YEAR
from gimbalcal.errors import InputError
from gimbalcal.number import Array
from gimbalcal.platform import Platform, known_platform
from gimbalcal.recording.memory_limit import memory_limit
from gimbalcal.schedule import SCHEDULES, Hold, Schedule
from gimbalcal.schedule.trajectory import Motion
from gimbalcal.simulate.scenario import FaultsSection, Scenario, ScheduleSection

SLEW_RATE = float(np.deg2rad(6.0))  # rad/s, of a table or platform from hold to hold
MAX_DURATION_S = 10 * YEAR
ROW_BYTES = 40  # bytes of memory that a row takes while all are counted


@dataclass(frozen=True)
class Timetable:
    """Visits of a run in order: position, commanded and true gimbal angles (m, k) [rad], and times.

    `start`, `stop` (m,) [s] bound each visit. Between two of them the gimbals turn at a constant rate; with a `ramp`
    [s] their rate rises and falls as sin^2 in that time, and all is still for `settle` [s] before the next visit.
    """

    position: Array
    commanded: Array
    true: Array
    start: Array
    stop: Array
    ramp: float = 0.0
    settle: float = 0.0

    def visit(self, time: Array) -> Array:
        """Return the ordinal of the visit that began last (n,)."""
        return np.maximum(np.searchsorted(self.start, time, side="right") - 1, 0)

    def moving(self, time: Array) -> Array:
        """Return whether the platform is between two visits at each time (n,)."""
        return np.asarray(time >= self.stop[self.visit(time)])

    def angles(self, time: Array, of: Array) -> Array:
        """Return gimbal angles (n, k) [rad] on the way through `of` (m, k)."""
        if self.ramp > 0:
            here, move, share, _ = self._way(time, of)
            return np.asarray(here + move * share[:, None])
        knots = np.stack([self.start, self.stop], axis=1).ravel()
        return np.stack([np.interp(time, knots, np.repeat(column, 2)) for column in of.T], axis=-1)

    def rates(self, time: Array, of: Array) -> Array:
        """Return rates (n, k) [rad/s] at which the gimbals turn there; needs a ramp, or they jump."""
        _, move, _, speed = self._way(time, of)
        return np.asarray(move * speed[:, None])

    def _way(self, time: Array, of: Array) -> tuple[Array, Array, Array, Array]:
        """Return angles (n, k) of the last visit, the move to the next (n, k), its share done (n,) and d(share)/dt."""
        i = self.visit(time)
        j = np.minimum(i + 1, len(self.start) - 1)
        r, full = self.ramp, np.where(j > i, self.start[j] - self.settle - self.stop[i], 2 * self.ramp)
        u = np.clip(time - self.stop[i], 0.0, full)
        from_end = np.minimum(u, full - u)  # from the nearer end: both ramps are alike
        x = np.pi * np.minimum(from_end, r) / r
        turned = np.minimum(from_end, r) / 2 - r / (2 * np.pi) * np.sin(x) + np.maximum(from_end - r, 0.0)
        speed = np.where(j > i, (1 - np.cos(x)) / 2 / (full - r), 0.0)
        share = turned / (full - r)
        return of[i], of[j] - of[i], np.where(u <= full / 2, share, 1 - share) * (j > i), speed


def planned_schedule(scenario: Scenario) -> Schedule:
    """Return the schedule that the scenario names or spells out."""
    motion = scenario.schedule
    if motion.name:
        schedule = SCHEDULES[motion.name]
        if known_platform(scenario.platform.name) != schedule.platform:
            raise InputError(
                f"schedule.name: {motion.name} is for the platform {schedule.platform.name!r}, "
                f"not {scenario.platform.name!r}"
            )
        return schedule
    platform = platform_of(scenario)
    holds = tuple(_timed_hold(platform, hold, i) for i, hold in enumerate(motion.holds))
    return Schedule("scenario", platform, holds)


def platform_of(scenario: Scenario) -> Platform:
    """Return the platform that the scenario names."""
    platform = known_platform(scenario.platform.name, scenario.recording_kind.stabilised)
    if platform is None:
        raise InputError(f"platform.name: no platform is called {scenario.platform.name!r}")
    return platform


def timetable(schedule: Schedule, motion: ScheduleSection, faults: FaultsSection, ramp: float) -> Timetable:
    """Return times of all visits: dwell, turn at the finite slew rate, settle, dwell again."""
    holds = list(schedule.holds) * motion.sweeps
    commanded = np.tile(schedule.angles, (motion.sweeps, 1))
    dwell = np.array([motion.dwell or hold.duration for hold in holds])
    turn = np.abs(np.diff(commanded, axis=0)).max(axis=1, initial=0.0) / (motion.slew_rate or SLEW_RATE)
    turn = np.maximum(turn, ramp) + ramp + motion.settle  # a short turn does not come to speed
    start = np.concatenate([[0.0], np.cumsum(dwell[:-1] + turn)])
    position = np.tile(np.arange(1, len(schedule.holds) + 1), motion.sweeps)
    true = _with_faults(commanded, position, schedule.platform, faults)
    return Timetable(position, commanded, true, start, start + dwell, ramp, motion.settle)


def _timed_hold(platform: Platform, hold: dict[str, float], i: int) -> Hold:
    unknown = [axis for axis in hold if axis not in platform.axis_names]
    if unknown:
        raise InputError(
            f"schedule.holds.{i}: the platform {platform.name!r} has no axis {unknown[0]!r}; "
            f"it has {', '.join(platform.axis_names)}"
        )
    return Hold(tuple(float(np.deg2rad(hold.get(axis, 0.0))) for axis in platform.axis_names))


def _with_faults(commanded: Array, position: Array, platform: Platform, faults: FaultsSection) -> Array:
    """Return the true path of the platform: interchanged positions, then gimbals set wrong."""
    true = commanded.copy()
    for first, second in faults.interchange:
        a, b = _rows(position, first, "interchange"), _rows(position, second, "interchange")
        true[a], true[b] = commanded[b], commanded[a]
    for i, blunder in enumerate(faults.blunders):
        if blunder.gimbal not in platform.axis_names:
            raise InputError(f"faults.blunders.{i}.gimbal: the platform has no axis {blunder.gimbal!r}")
        true[_rows(position, blunder.position, f"blunders.{i}"), platform.axis_names.index(blunder.gimbal)] += (
            blunder.angle
        )
    return true


def _rows(position: Array, wanted: int, where: str) -> Array:
    rows = np.flatnonzero(position == wanted)
    if rows.size == 0:
        raise InputError(f"faults.{where}: the schedule has no position {wanted}, it has 1 to {position.max()}")
    return rows


# --- rows of a run ----------------------------------------------------------------------------------------------------


def row_times(scenario: Scenario, table: Timetable | None) -> Array:
    """Return times (n,) [s] of the rows of a schedule of positions, or of a static run."""
    motion = scenario.schedule
    _refuse_many(motion.duration if table is None else float(table.stop[-1]), motion.rate)
    if table is None:
        return np.arange(round(motion.duration * motion.rate)) / motion.rate
    time = np.arange(int(np.floor(table.stop[-1] * motion.rate + 1e-9)) + 1) / motion.rate
    time = time[time < table.stop[-1]]
    if not (motion.record_slews or scenario.turning):
        time = time[~table.moving(time)]
    dropped = np.isin(table.position[table.visit(time)], scenario.faults.drop)
    time = time[~dropped]
    if time.size == 0:
        raise InputError("schedule: no row is left; lengthen `dwell`, raise `rate` or drop fewer positions")
    return time


def turned_times(scenario: Scenario, path: Motion) -> Array:
    """Return the ends (n,) [s] of the sampling intervals of a unit that is turned along a path."""
    rate = scenario.schedule.rate
    _refuse_many(path.duration, rate)
    n = int(np.floor(path.duration * rate + 1e-9))
    if not n:
        raise InputError("schedule: no row is left; raise `rate`")
    return np.arange(1, n + 1) / rate


def _refuse_many(seconds: float, rate: float) -> None:
    """Raise InputError where a time [s] is none of a measurement, or its rows at a rate [Hz] do not go into memory."""
    if seconds > MAX_DURATION_S:
        raise InputError(f"schedule: it takes {seconds / YEAR:.4g} years; check the numbers and units of its times")
    if not seconds * rate * ROW_BYTES < memory_limit():
        raise InputError(
            f"schedule: {seconds:.4g} s at {rate:.4g} Hz are {seconds * rate:.3g} rows, more than memory holds; lower "
            "`rate` or make it shorter"
        )
