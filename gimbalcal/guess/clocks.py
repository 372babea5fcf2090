"""Clocks of loggers: which column it is, where it wrapped round, and the units that it may count in.

A clock that nobody described may count seconds or ticks, begin again at midnight or where a counter is full, and stand
beside another that says when the row arrived.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from gimbalcal.errors import InputError
from gimbalcal.guess.column_names import Guess
from gimbalcal.number import Array

TICKS = "0.1 ms"  # in which some loggers count; no unit of a header
UNITS = {"s": 1.0, "ms": 1e-3, TICKS: 1e-4, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0, "d": 86400.0}  # s
NAMED = {"sample_time_fine": TICKS}  # clocks whose name tells their unit, of Xsens
WRAPS = {86400.0: "midnight", 604800.0: "the end of a week of GPS", 3600.0: "the hour", 43200.0: "noon",
         2.0**16: "2^16", 2.0**24: "2^24", 2.0**31: "2^31", 2.0**32: "2^32", 86400e3: "midnight",
         86400e6: "midnight", 604800e3: "the end of a week of GPS", 1e6: "10^6"}  # fmt: skip
RATES = (1.0, 10_000.0)  # Hz that inertial sensors are logged at
LONG = 1e3  # Hz; more nobody logs in minutes, hours or days
MOST_SENSORS = 8  # that write into one log in turn
JITTER = 0.02  # of a step: stamps that scatter by more are times of arrival where another clock beside them does not


def unit_of_time(time: Array) -> tuple[str, str]:
    """Unit of a clock (n,) by its step, and why: inertial sensors are logged at 1 Hz to 10 kHz."""
    step = float(np.median(np.diff(time))) if len(time) > 1 else 0.0
    if step <= 0:
        raise InputError("the clock stands still: say what the time is by a column that grows")
    for unit, size in UNITS.items():
        rate = 1 / (step * size)
        if unit != TICKS and RATES[0] <= rate <= (RATES[1] if size <= 1 else LONG):
            return unit, f"steps of {step:.4g}, which in {unit} are {rate:.4g} Hz"
    return "s", f"steps of {step:.4g}, at which nothing is usually logged"


def unwrapped(t: Array) -> tuple[Array, str]:
    """A clock (n,) that goes on where it began again, and at what it did; as it is where it did not.

    A step back counts as such where a whole period makes it a usual step, give or take rows that were lost.
    """
    step = np.diff(t)
    back = np.flatnonzero(step < 0)
    forward = step[step > 0]
    if not len(back) or len(back) > 0.01 * len(t) or not len(forward):
        return t, ""
    usual = float(np.median(forward))
    for period, name in WRAPS.items():
        again = step[back] + period
        if np.all((again > 0.2 * usual) & (again < 20 * usual + 1e-6 * period)):
            whole = np.array(t, dtype=float)
            whole[1:] += period * np.cumsum(step < 0)
            return whole, name
    return t, ""


def joined(columns: Mapping[str, Array]) -> tuple[str, str, Array, str] | None:
    """Whole seconds and, in the column beside, what is beyond them in ms, us or ns: both names, seconds, that unit."""
    names = list(columns)
    for first, second in pairwise(names):
        whole, rest = columns[first], columns[second]
        if len(whole) < 3 or not all(np.all(np.isfinite(x)) and np.all(x == np.round(x)) for x in (whole, rest)):
            continue
        size = next((s for s in (1e3, 1e6, 1e9) if 0 <= rest.min() and 0.5 * s < rest.max() < s), 0.0)
        if not size or not 0 < whole[-1] - whole[0] < len(whole):
            continue
        time = whole - whole[0] + rest / size
        if np.all(np.diff(time) > 0) and np.any(np.diff(rest) < 0) and jitter(time) < 1:
            return first, second, time, {1e3: "ms", 1e6: "us", 1e9: "ns"}[size]
    return None


def one_of_several(columns: Mapping[str, Array], clocks: Sequence[str]) -> tuple[dict[str, Array], str]:
    """The rows of one sensor where several write in turn and a column says which, and that in words.

    Such a column has few whole numbers, and the clock that stands still over all rows grows over those of each.
    """
    for clock in clocks:
        t = columns[clock]
        if np.all(np.diff(t) > 0):
            break
        for name, x in columns.items():
            several = np.unique(x[np.isfinite(x)])
            if name in clocks or not 1 < len(several) <= MOST_SENSORS or np.any(several != np.round(several)):
                continue
            own = [np.flatnonzero(x == one) for one in several]
            if min(map(len, own)) > 0.8 * len(t) / len(own) and all(np.all(np.diff(t[rows]) > 0) for rows in own):
                told = f"rows are of {len(own)} sensors by the column {name.strip()}, {several[0]:g} is taken"
                return {n: values[own[0]] for n, values in columns.items()}, told
    return dict(columns), ""


def jitter(t: Array) -> float:
    """How much steps scatter, half the range of the middle 80 % over the median."""
    step = np.diff(t)
    low, middle, high = np.quantile(step, (0.1, 0.5, 0.9)) if len(step) else (0.0, 1.0, 0.0)
    return float((high - low) / 2 / middle) if middle > 0 else np.inf


def best_clock(columns: Mapping[str, Array], guesses: Mapping[str, Guess]) -> str:
    """Of the columns that are taken for clocks the first that grows, or one that ticks far more evenly; else any."""
    all_of_them = [n for n, g in guesses.items() if g.quantity == "time"]
    grows = [n for n in all_of_them if np.all(np.diff(columns[n]) > 0)] or all_of_them
    named = [n for n in grows if guesses[n].why.startswith("its name")] or grows
    if not named:
        return ""
    first = jitter(columns[named[0]])
    evener = [n for n in named[1:] if jitter(columns[n]) < first / 3]
    return evener[0] if first > JITTER and evener and len(columns[evener[0]]) > 2 else named[0]


def growing(columns: Mapping[str, Array], taken: Mapping[str, Guess]) -> str:
    """A column that grows evenly and is no mere count of the rows, where no name tells a clock; or nothing."""
    for name, x in columns.items():
        if name in taken or len(x) < 3 or not np.all(np.isfinite(x)):
            continue
        step = np.diff(x)
        counted = bool(np.all(step == step[0])) and step[0] == np.round(step[0]) and x[0] in (0.0, 1.0)
        if np.all(step > 0) and jitter(x) < 0.5 and not counted:
            return name
    return ""


def in_unit(columns: Mapping[str, Array], guesses: Mapping[str, Guess], unit: str
            ) -> tuple[dict[str, Array], dict[str, Guess]]:  # fmt: skip
    """The same log with its clock counted in another unit."""
    clock = next(n for n, g in guesses.items() if g.quantity == "time")
    t = columns[clock]
    rate = 1 / (float(np.median(np.diff(t))) * UNITS[unit])
    why = f"{guesses[clock].why.partition(';')[0]}; in {unit} these rows are logged at {rate:.4g} Hz"
    scaled = t * UNITS[unit] if unit == TICKS else t
    known = "s" if unit == TICKS else unit
    return {**columns, clock: scaled}, {**guesses, clock: replace(guesses[clock], unit=known, why=why, open=False)}
