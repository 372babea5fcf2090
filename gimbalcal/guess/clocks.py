"""Clocks of loggers: which column is the time, where it starts again from zero, and the unit that it counts in.

An undescribed clock may count seconds or ticks, start again at midnight or where a counter is full, and be logged
together with another one, the time of arrival of each row.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise

import numpy as np

from gimbalcal.errors import InputError
from gimbalcal.guess.column_names import is_counter, states_other_unit
from gimbalcal.guess.log import Log
from gimbalcal.number import Array

TICKS, FILETIME = "0.1 ms", "0.1 us"  # in which some loggers count; no units of a header
UNITS = {"s": 1.0, "ms": 1e-3, TICKS: 1e-4, "us": 1e-6, FILETIME: 1e-7, "ns": 1e-9}  # s
UNITS |= {"min": 60.0, "h": 3600.0, "d": 86400.0}
UNIX_DAYS = (10957.0, 47482.0)  # of the year 2000 and of 2100, since 1970
EPOCH_DAYS = {"s": 0.0, "ms": 0.0, "us": 0.0, "ns": 0.0, FILETIME: 134774.0, "d": 719529.0}  # of 1970 by each unit
UNIT_OF_NAME = {"sample_time_fine": TICKS}  # of Xsens
WRAP_PERIODS = {
    86400.0: "midnight",
    604800.0: "the end of a week of GPS",
    3600.0: "the hour",
    43200.0: "noon",
    2.0**16: "2^16",
    2.0**24: "2^24",
    2.0**31: "2^31",
    2.0**32: "2^32",
    86400e3: "midnight",
    86400e6: "midnight",
    604800e3: "the end of a week of GPS",
    1e6: "10^6",
    1e3: "the second",  # of ms, next to a clock of whole seconds
}
MAX_WRAPS = 0.1  # of the rows
MIN_RATE_HZ, MAX_RATE_HZ, USUAL_RATE_HZ = 0.05, 10_000.0, 100.0  # that inertial sensors are logged at
COSTS = {"s": 0.0, "ms": 2.0, TICKS: 5.0, "us": 2.0, FILETIME: 9.0, "ns": 2.0, "min": 6.0, "h": 9.0, "d": 9.0}  # nats
EPOCH_GAIN = 4.0  # nats, of a unit in which the clock states a day of this century; more where no log counts in it
MAX_AGE_S = 9e10  # since the earliest epoch, the year 0, from which any clock counts
MIN_DURATION_S, SHORT_COST = 1.0, 6.0  # of a log, and nats against a unit in which it is shorter
MIN_ROWS = 3
MIN_GROWING = 0.9  # of the steps of a clock; a check names the rows at which it goes back
MAX_DISTANCE = 2.0  # of the step between stamps, of evenly spaced rows from their stamps
MAX_WAIT = 5.0  # of the step between packets, of most of them
MAX_PACKET = 50  # rows that arrive together
MAX_JITTER_OF_FEW, MANY_ROWS = 0.2, 100  # of a step, of a clock without a name in fewer rows
MAX_SENSORS = 8  # that write into one log in turn
MIN_TURNS = 5  # of all of them, that show so
SENSOR_CHANGE_RATIO = 3.0  # times the change from one turn to the next: that from sensor to sensor
MAX_JITTER = 0.02  # of a step; stamps that scatter by more are times of arrival if another clock is more regular


def costs_of_unit(time: Array) -> dict[str, tuple[float, str]]:
    r"""Return how unlikely each unit of a clock (n,) is by its step, in nats, and why.

    Inertial sensors are logged at some 100 Hz, a decade more or less, :math:`\frac{1}{2} \log_{10}^2 (f / 100)`,
    seldom in minutes or hours, and for a second at least; no clock counts from before the year 0. Raises InputError for
    a clock that stands still.
    """
    step = float(np.median(np.diff(time))) if len(time) > 1 else 0.0
    if step <= 0:
        raise InputError("the clock stands still: say what the time is by a column that grows")
    rates = {unit: 1 / (step * size) for unit, size in UNITS.items()}
    today = unit_of_epoch(time)
    return {
        unit: (
            COSTS[unit]
            + 0.5 * float(np.log10(rate / USUAL_RATE_HZ)) ** 2
            + SHORT_COST * (len(time) * step * UNITS[unit] < MIN_DURATION_S)
            - max(EPOCH_GAIN, COSTS[unit]) * (unit == today),
            f"steps of {step:.4g}, which in {unit} are {rate:.4g} Hz"
            + (", and it states a day of this century" if unit == today else ""),
        )
        for unit, rate in rates.items()
        if MIN_RATE_HZ <= rate <= MAX_RATE_HZ and float(np.max(np.abs(time))) * UNITS[unit] < MAX_AGE_S
    } or {"s": (0.0, f"steps of {step:.4g}, at which nothing is usually logged")}


def unit_of_time(time: Array) -> tuple[str, str]:
    """Return the likeliest unit of a clock (n,) by its step, and why."""
    costs = costs_of_unit(time)
    unit = min(costs, key=lambda u: costs[u][0])
    return unit, costs[unit][1]


def unit_of_epoch(time: Array) -> str:
    """Return the unit in which all stamps of a clock (n,) count from an epoch to this century; empty if none.

    The epochs are those of Unix, of Windows (0.1 us since 1601) and of MATLAB (days since the year 0).
    """
    if len(time) < MIN_ROWS or time[-1] == time[0]:
        return ""
    earliest, latest = np.min(time), np.max(time)
    for unit, epoch in EPOCH_DAYS.items():
        first, last = ((day + epoch) * UNITS["d"] / UNITS[unit] for day in UNIX_DAYS)
        if first <= earliest and latest <= last:
            return unit
    return ""


def spread_stamps(t: Array, sampled: bool = False) -> tuple[Array, str]:
    """Return a clock (n,) whose stamps stand at several rows, with these spread evenly, and a note; else as it is.

    Where most rows repeat a stamp, as those of a clock of whole seconds do, the rows are taken to be evenly spaced over
    the whole log; a packet of rows with one stamp is spread up to the next stamp. Rows of a packet may also be stamped
    one by one as they arrive: then most steps are shorter than half the mean step. Readings taken at one place after
    the other have such steps, too, and keep their times. sampled: whether the clock ticks too fast for such readings.
    """
    step = np.diff(t)
    if len(t) < MIN_ROWS or np.any(step < 0) or t[-1] == t[0]:
        return t, ""
    late = step > (t[-1] - t[0]) / len(step) / 2
    in_packets = sampled and len(t) / MAX_PACKET < np.count_nonzero(late) < len(step) / 2
    begins = late if in_packets else step > 0
    equal = int(np.count_nonzero(~begins))
    if not equal:
        return t, ""
    first = np.flatnonzero(np.concatenate([[True], begins]))
    rows, each = np.arange(len(t), dtype=float), len(t) / len(first)
    if each >= 1.5:
        slope, offset = np.polyfit(first, t[first], 1) if len(first) > 2 else (0.0, 0.0)
        even = offset + slope * rows
        off = np.quantile(np.abs(even[first] - t[first]), 0.99 if in_packets else 1.0)
        if slope > 0 and off < (MAX_WAIT if in_packets else MAX_DISTANCE) * float(np.median(np.diff(t[first]))):
            return even, f"stamps stand at {each:.3g} rows each, which are taken to be evenly spaced"
    last = t[first[-1]] + float(np.median(np.diff(t[first])))
    spread_out = np.interp(rows, [*first, len(t)], [*t[first], last])
    how = "repeat the stamp of the row before" if np.all(step[~begins] == 0) else "arrive in packets"
    return spread_out, f"{equal} rows {how} and are spread up to the next stamp"


def unwrapped_clock(t: Array) -> tuple[Array, str]:
    """Return a clock (n,) continued where it starts again, and at what it does; unchanged where it does not.

    A step back counts as a wrap where a whole period makes it a usual step, give or take rows that were lost, and where
    the clock stays within that period: stamps of packets that overlap go back, too.
    """
    step = np.diff(t)
    back = np.flatnonzero(step < 0)
    if not len(back) or len(back) > MAX_WRAPS * len(t) or not np.any(step > 0):
        return t, ""
    median = float(np.median(step[step > 0]))
    for period, name in WRAP_PERIODS.items():
        continued = step[back] + period
        usual = (continued > 0.2 * median) & (continued < 20 * median + 1e-6 * period)
        if np.ptp(t) <= period and np.all(usual):
            out = np.array(t, dtype=float)
            out[1:] += period * np.cumsum(step < 0)
            return out, name
    return t, ""


def two_column_clock(columns: Mapping[str, Array]) -> tuple[str, str, Array, str] | None:
    """Return a clock of whole seconds and a next column of ms, us or ns: both names, the seconds, that unit."""
    for first, second in pairwise(columns):
        whole, rest = columns[first], columns[second]
        if len(whole) < 3 or not all(np.all(np.isfinite(x)) and np.all(x == np.round(x)) for x in (whole, rest)):
            continue
        size = next((s for s in (1e3, 1e6, 1e9) if 0 <= rest.min() and 0.5 * s < rest.max() < s), 0.0)
        time = whole - whole[0] + rest / (size or 1.0)
        step = np.diff(time)
        if not size or np.mean(step > 0) < MIN_GROWING or not 0 < np.median(step) < 1:
            continue
        if np.any(np.diff(rest) < 0) and clock_jitter(time) < 1:
            return first, second, time, {1e3: "ms", 1e6: "us", 1e9: "ns"}[size]
    return None


def single_sensor(log: Log) -> tuple[Log, str]:
    """Return the rows of one sensor where several write in turn, by the column that numbers them, and a note.

    Their clock, if any, goes on for each of them only, or their readings are unlike from one row to the next and alike
    from one turn to the next, which packets of samples are not.
    """
    clocks = log.names("time")
    if any(np.all(np.diff(log.columns[clock]) > 0) for clock in clocks):
        return log, ""
    for name, x in log.columns.items():
        numbers = np.unique(x[np.isfinite(x)])
        if name in clocks or not 1 < len(numbers) <= MAX_SENSORS or np.any(numbers != np.round(numbers)):
            continue
        rows = [np.flatnonzero(x == number) for number in numbers]
        own_clock = any(all(np.all(np.diff(log.columns[c][r]) > 0) for r in rows) for c in clocks)
        if min(map(len, rows)) > 0.8 * len(x) / len(rows) and (own_clock or _writes_in_turn(log, name, len(numbers))):
            note = f"rows are of {len(rows)} sensors by the column {name.strip()}, {numbers[0]:g} is taken"
            return log.rows(rows[0]), note
    return log, ""


def _writes_in_turn(log: Log, number: str, sensors: int) -> bool:
    """Return whether most columns change far more from row to row than from one turn of some sensors to the next."""

    def change(x: Array, rows: int) -> float:
        return float(np.mean(np.abs(x[rows:] - x[:-rows])))

    x = log.columns[number]
    if len(x) < MIN_TURNS * sensors:
        return False
    others = [y for n, y in log.columns.items() if n != number and np.all(np.isfinite(y)) and np.any(np.diff(y) < 0)]
    unlike = [change(y, 1) > SENSOR_CHANGE_RATIO * change(y, sensors) for y in others]
    return bool(np.mean(x[sensors:] == x[:-sensors]) > 0.9) and sum(unlike) > len(others) / 2


def clock_jitter(t: Array) -> float:
    """Return the scatter of the steps of a clock: half the range of the middle 80 %, over the median."""
    step = np.diff(t)
    low, middle, high = np.quantile(step, (0.1, 0.5, 0.9)) if len(step) else (0.0, 1.0, 0.0)
    return float((high - low) / 2 / middle) if middle > 0 else np.inf


def best_clock(log: Log) -> str:
    """Return the first clock that grows, or one with far more regular steps; else any, empty if there is none."""
    clocks = log.names("time")
    growing = [n for n in clocks if np.all(np.diff(log.columns[n]) > 0)] or clocks
    named = [n for n in growing if log.guesses[n].why.startswith("its name")] or growing
    if not named:
        return ""
    first = clock_jitter(log.columns[named[0]])
    regular = [n for n in named[1:] if clock_jitter(log.columns[n]) < first / 3]
    return regular[0] if first > MAX_JITTER and regular and len(log.columns[regular[0]]) > 2 else named[0]


def regular_column(log: Log) -> str:
    """Return an unknown column that grows in regular steps, or states days, and is no count of rows; else empty."""
    for name, x in log.unknown.items():
        if len(x) < MIN_ROWS or not np.all(np.isfinite(x)) or is_counter(name) or states_other_unit(name):
            continue
        if states_days(x) or (np.all(np.diff(x) > 0) and clock_jitter(x) < 0.5 and may_be_clock(x)):
            return name
    return ""


def states_days(x: Array) -> bool:
    """Return whether a column (n,) states days of this century and goes back in few rows, which a check names."""
    return unit_of_epoch(x) != "" and bool(np.mean(np.diff(x) >= 0) > MIN_GROWING)


def may_be_clock(x: Array) -> bool:
    """Return whether a growing column (n,) that nothing calls a clock may be one.

    A column that counts the rows is no clock. Neither is a temperature or an angle by which a table of few rows is
    sorted: its steps differ.
    """
    even = clock_jitter(x) < MAX_JITTER_OF_FEW or len(x) >= MANY_ROWS or unit_of_epoch(x) != ""
    return even and not counts_rows(x)


def counts_rows(x: Array) -> bool:
    """Return whether a column (n,) is the number of each row, and does not state seconds of this century."""
    return bool(np.all(np.diff(x) == 1)) and not unit_of_epoch(x)


def in_unit(log: Log, unit: str) -> Log:
    """Return the log with its clock counted in another unit."""
    t, g = log.columns[log.clock], log.guesses[log.clock]
    rate = 1 / (float(np.median(np.diff(t))) * UNITS[unit])
    why = f"{g.why.partition(';')[0]}; in {unit} these rows are logged at {rate:.4g} Hz"
    known, scale = ("s", UNITS[unit]) if unit in (TICKS, FILETIME) else (unit, 1.0)
    guess = replace(g, unit=known, why=why, open=False)
    return log.including({log.clock: guess}, {} if scale == 1 else {log.clock: scale * t})
