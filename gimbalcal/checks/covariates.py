"""Checks of temperatures, clocks and position numbers: they enter no force, so that nothing else would notice them."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from gimbalcal.checks.check import EVERY, POSITIONS, Check, Examined
from gimbalcal.errors import number_of
from gimbalcal.number import Array
from gimbalcal.recording.dwell import Dwell, dwells
from gimbalcal.recording.record import ANGLE, COLOURED, FORCE, SENSORS
from gimbalcal.units import from_si, is_raw

TEMPERATURE = ("temperature", "")
MAX_TEMPERATURE_DEGC, MIN_TEMPERATURE_DEGC = 200.0, -100.0  # sensors of oil wells, and of no place on Earth
MAX_KELVIN = 500.0
MAX_DWELL_S, MIN_DWELL_S = 5 * 86400.0, 0.2  # of the median dwell
MIN_ROWS_OF_A_DWELL = 20  # that show how long it lasted
MAX_SHARE_MARKED, MAX_TIMES_SHOWN = 0.1, 3  # of the rows; more were on the way
MIN_MOVE, MIN_MOVES = 0.2, 4  # of the range of a channel, from one dwell to the next; and so many of them
MIN_NOISE = 1e-15  # SI; less is zero to any instrument


def noise_below_any_instrument(e: Examined) -> str:
    """Refuse a stated noise below that of any instrument."""
    r = e.recording
    for sensor, sigma in r.noise.items():
        units = () if sensor in COLOURED else [u for (q, _), u in r.units.items() if q == SENSORS[sensor]]
        if sensor not in COLOURED and 0 < sigma < MIN_NOISE and not any(map(is_raw, units)):
            return (
                f"a noise of {sigma:g} in SI units, as [noise] states for the {sensor}, is less "
                "than any instrument has; correct it, or leave it out to have it taken from the rows"
            )
    return ""


def temperature_too_high(e: Examined) -> str:
    """Refuse temperatures at which no sensor works: kelvin called degC."""
    middle, unit, number = _usual_temperature(e)
    if not middle > MAX_TEMPERATURE_DEGC:
        return ""
    kelvin = unit == "degC" and number < MAX_KELVIN
    likely = 'the numbers look like kelvin: write unit = "K"' if kelvin else "correct it"
    return (
        f"the temperature is {middle:.4g} degC in most rows, read in the unit {unit!r}, and no "
        f"sensor works there; {likely} for its column"
    )


def temperature_too_low(e: Examined) -> str:
    """Question temperatures of no place on Earth: degrees Celsius called K."""
    middle, unit, number = _usual_temperature(e)
    if not middle < MIN_TEMPERATURE_DEGC:
        return ""
    celsius = unit == "K" and number < MAX_TEMPERATURE_DEGC
    likely = "; the numbers look like degC, and then its unit is not K" if celsius else ""
    return f"the temperature is {middle:.4g} degC in most rows, read in the unit {unit!r}: is that so?{likely}"


def _usual_temperature(e: Examined) -> tuple[float, str, float]:
    """Return the median temperature [degC], its unit, and the number in this unit; NaN where none is known."""
    value = e.recording.channels.get(TEMPERATURE, np.zeros(0))
    known, unit = value[np.isfinite(value)], e.recording.units.get(TEMPERATURE, "degC")
    middle = float(np.median(known)) if len(known) else np.nan
    return middle, unit, float(from_si(middle, unit))


def dwell_times(e: Examined) -> str:
    """Question dwells of days or milliseconds: nothing at rest shows the unit of a clock."""
    each = dwells(e.recording)
    middle = float(np.median([np.ptp(e.recording.time[d.rows]) for d in each]))
    if middle > MAX_DWELL_S:
        return (
            f"each position is held for {middle / 86400:.3g} days by the clock: is that so? if the time is in ms, "
            'write unit = "ms" for its column'
        )
    if 0 < middle < MIN_DWELL_S and np.median([d.stop - d.start for d in each]) > MIN_ROWS_OF_A_DWELL:
        return (
            f"each position is held for {middle:.2g} s by the clock: is that so? if the time is in s, or in min, "
            "correct the unit of its column"
        )
    return ""


def rows_marked_as_moving(e: Examined) -> str:
    """Remark on rows marked 0, as if on the way, in a table that holds each rest in a row."""
    r = e.recording
    marked = np.flatnonzero(r.position == 0)
    means = all(d.stop - d.start == 1 for d in dwells(r))
    if not len(marked) or not means or len(marked) > MAX_SHARE_MARKED * len(r.time):
        return ""
    at = ", ".join(f"{t:.10g}" for t in r.time[marked[:MAX_TIMES_SHOWN]])
    where = at if len(marked) <= MAX_TIMES_SHOWN else f"{at} and so on"
    rows = "row is" if len(marked) == 1 else "rows are"
    return f"{len(marked)} {rows} marked 0, as on the way, where each rest is one row (at {where} s): left out"


def rows_of_the_dwell_before(e: Examined) -> str:
    """Refuse dwells whose first or last rows read what the sensors or the gimbals read in the dwell next to them.

    Dwells that follow each other without rows on the way are compared. The same number of rows at most junctions is a
    column, or the position column, that was shifted.
    """
    r, each = e.recording, dwells(e.recording)
    long = [d for d in each if d.stop - d.start >= MIN_ROWS_OF_A_DWELL]
    junctions = [(a, b) for a, b in pairwise(long) if a.stop == b.start]
    shifts: dict[int, list[str]] = {}
    for (quantity, axis), x in r.channels.items():
        if quantity in (FORCE, ANGLE) and (by := _shift_in_rows(x, junctions)):
            shifts.setdefault(by, []).append(f"{quantity} {axis}")
    if not shifts:
        return ""
    by, columns = max(shifts.items(), key=lambda item: len(item[1]))
    rows, (where, neighbour) = number_of(abs(by), "row"), ("start", "before") if by > 0 else ("end", "after")
    those = ", ".join(c.replace("_", " ") for c in columns)
    return (
        f"in {rows} at the {where} of most positions these columns read as in the position {neighbour}: {those}; shift "
        f"them, or the position numbers, by {rows}"
    )


def _shift_in_rows(x: Array, junctions: Sequence[tuple[Dwell, Dwell]]) -> int:
    """Return by how many rows a channel (n,) comes after the position numbers at most junctions where it moves."""
    levels = [(np.median(x[a.rows]), np.median(x[b.rows])) for a, b in junctions]
    least = MIN_MOVE * float(np.ptp(levels)) if levels else 0.0
    shifts = []
    for (a, b), (before, after) in zip(junctions, levels, strict=True):
        if 0 < least < abs(after - before):
            late, early = (
                np.abs(x[d.rows] - level) < abs(after - before) / 10 for d, level in ((b, before), (a, after))
            )
            shifts.append(int(np.argmin(late)) - int(np.argmin(early[::-1])))
    usual = int(np.median(shifts)) if len(shifts) >= MIN_MOVES else 0
    return usual if shifts.count(usual) > len(shifts) / 2 else 0


CHECKS = (
    Check(rows_of_the_dwell_before, POSITIONS, ("dwells",)),
    Check(noise_below_any_instrument, EVERY),
    Check(temperature_too_high, EVERY),
    Check(temperature_too_low, EVERY, question=True),
    Check(dwell_times, POSITIONS, ("dwells",), question=True),
    Check(rows_marked_as_moving, POSITIONS, ("dwells",), question=True),
)
