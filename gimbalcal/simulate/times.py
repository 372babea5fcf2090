"""When a run has its rows, and whether memory holds as many."""

from __future__ import annotations

import numpy as np

from gimbalcal.errors import InputError
from gimbalcal.number import Array
from gimbalcal.recording.memory_limit import memory_limit
from gimbalcal.schedule.trajectory import Path as Course
from gimbalcal.simulate.scenario import Scenario
from gimbalcal.simulate.timetable import Timetable

YEAR = 365.25 * 86400.0  # s
MAX_DURATION_S = 10 * YEAR
ROW_BYTES = 40  # bytes of memory that a row takes while all are counted


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


def turned_times(scenario: Scenario, path: Course) -> Array:
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
