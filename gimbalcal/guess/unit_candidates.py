"""Units that only the numbers of a log determine, and the others that it may be in.

A scale of counts may be stated above the table: "LSB 16384/g", "0.061 mg per digit", "acc_1G 2048". One of
accelerometers is taken where their readings then have the length of gravity; one of gyroscopes is tried on the turns.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from gimbalcal.guess import clocks
from gimbalcal.guess.column_values import MAX_GRAVITY_ERROR
from gimbalcal.guess.log import Guess, Log
from gimbalcal.recording.record import FORCE, RATE
from gimbalcal.units import from_si, to_si

RATE_UNITS = ("rad/s", "deg/s", "deg/h")  # tried where the guessed one cannot be
MIN_RATE_HZ, MAX_RATE_HZ = 0.02, 20_000.0  # of rows, within which other units of time are tried
_NUMBER = r"(?P<n>\d+(?:[.,]\d+)?(?:[eE][-+]?\d+)?)"
_COUNT = r"(?:lsb|counts?|cts|digits?|adu|pulses?|imp(?:ulses?|\.)?|hz)"
_UNIT = r"\(?(?P<u>[mu]?g|m/s\^?2|m/s²|[mu]?gal|m?dps|m?deg/s(?:ec)?|m?°/s|rad/s)\)?"
_SCALE = (  # pattern, and whether it states units of a count, or counts in a unit
    (re.compile(rf"{_NUMBER}\s*{_COUNT}?(?:/s)?\s*(?:/|per)\s*{_UNIT}(?![\w/])", re.IGNORECASE), False),
    (re.compile(rf"{_NUMBER}\s*{_UNIT}\s*(?:/|per)\s*{_COUNT}", re.IGNORECASE), True),
    (re.compile(rf"acc_?(?:1g)\W+{_NUMBER}(?P<u>)", re.IGNORECASE), False),
)
_UNIT_OF_SPELLING = {
    "dps": "deg/s",
    "mdps": "mdeg/s",
    "°/s": "deg/s",
    "m°/s": "mdeg/s",
    "deg/sec": "deg/s",
    "m/s2": "m/s^2",
    "m/s²": "m/s^2",
    "gal": "Gal",
    "mgal": "mGal",
    "": "g",
}


def unit_candidates(log: Log, above: Sequence[str]) -> Iterator[Log]:
    """Yield the log in its likeliest units, then in other units of rate and time where nobody named them.

    above: the lines above the tables, which may state the scale of counts.
    """
    step = float(np.median(np.diff(log.columns[log.clock]))) * float(to_si(1.0, log.guesses[log.clock].unit))
    first = in_physical_units(log, above, step)
    units = [unit for unit in RATE_UNITS if first.has_open_unit(RATE)]
    yield first
    if first.guesses != log.guesses:
        yield log
    yield from (_with_rates_in(first, unit) for unit in units)
    if not log.has_open_unit("time"):
        return
    time_unit = first.guesses[first.clock].unit
    for unit, size in clocks.UNITS.items():
        rate = float(to_si(1.0, time_unit)) / (step * size)
        if unit == time_unit or not MIN_RATE_HZ <= rate <= MAX_RATE_HZ:
            continue
        other = clocks.in_unit(first, unit)
        yield other
        yield from (_with_rates_in(other, unit) for unit in units)


def rates_in(log: Log, unit: str, why: str) -> dict[str, Guess]:
    """Return the guesses of the rates with another unit."""
    return {name: replace(log.guesses[name], unit=unit, why=why, open=False) for name in log.names(RATE)}


def _with_rates_in(log: Log, unit: str) -> Log:
    return log.including(rates_in(log, unit, f"the turns between rests fit gravity in {unit}"))


def scales(above: Sequence[str]) -> dict[str, list[tuple[float, str]]]:
    """Return the SI units of one count by quantity, as lines above a table state them, each with its line."""
    out: dict[str, list[tuple[float, str]]] = {FORCE: [], RATE: []}
    for line in above:
        for pattern, of_a_count in _SCALE:
            for hit in pattern.finditer(line):
                spelling, number = hit["u"].lower(), float(hit["n"].replace(",", "."))
                unit = _UNIT_OF_SPELLING.get(spelling, spelling)
                if number > 0:
                    size = float(to_si(1.0, unit)) * (number if of_a_count else 1 / number)
                    out[RATE if unit.endswith("/s") else FORCE].append((size, line.strip()))
    return out


def in_physical_units(log: Log, above: Sequence[str], step: float) -> Log:
    """Return the log with counts in g and deg/s where the lines above it state a scale.

    Accelerometers are scaled only where they then read gravity; counts may also be sums over a step of `step` s.
    """
    for quantity, stated in scales(above).items():
        unit, of_unit = ("g", "counts per g") if quantity == FORCE else ("deg/s", "counts per deg/s")
        names = [n for n in log.names(quantity) if log.guesses[n].unit == "count"]
        for size, line in stated if len(names) == 3 else ():
            scale = float(from_si(size, unit))
            length = float(np.nanmedian(np.sqrt(sum(log.columns[n] ** 2 for n in names)))) * scale
            factors = [(1.0, ""), (1 / step, f", added up over {step:.4g} s")]
            fitting = [f for f in factors if quantity == RATE or abs(length * f[0] - 1) < MAX_GRAVITY_ERROR]
            if not fitting:
                continue
            factor, gate = fitting[0]
            agrees = f"; at rest that is {length * factor:.4g} g" if quantity == FORCE else ""
            stating = f"; {1 / scale:.6g} {of_unit}{gate}, as the log says ({line!r}){agrees}"
            log = log.including(
                {
                    n: replace(log.guesses[n], unit=unit, why=log.guesses[n].why.partition(";")[0] + stating)
                    for n in names
                },
                {n: log.columns[n] * (scale * factor) for n in names},
            )
            break
    return log
