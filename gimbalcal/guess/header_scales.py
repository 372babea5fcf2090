"""Scales of counts stated above a table: "LSB 16384/g", "0.061 mg per digit", "acc_1G 2048".

A scale of accelerometers is taken where their readings then have the length of gravity; one of gyroscopes is tried on
the turns.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gimbalcal.guess.column_values import MAX_GRAVITY_ERROR
from gimbalcal.guess.log import FORCE, RATE, Log
from gimbalcal.units import from_si, to_si

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
