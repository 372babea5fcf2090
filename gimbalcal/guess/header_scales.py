"""What the text above a table says of how many counts a reading is: "LSB 16384/g", "0.061 mg per digit", "acc_1G 2048".

It is believed where gravity, or the turns, agree with it.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from gimbalcal.guess.column_names import FORCE, RATE, Guess
from gimbalcal.guess.column_values import NEAR
from gimbalcal.number import Array
from gimbalcal.units import from_si, to_si

_NUMBER = r"(?P<n>\d+(?:[.,]\d+)?(?:[eE][-+]?\d+)?)"
_COUNT = r"(?:lsb|counts?|cts|digits?|adu|pulses?|imp(?:ulses?|\.)?|hz)"
_UNIT = r"\(?(?P<u>[mu]?g|m/s\^?2|m/s²|[mu]?gal|m?dps|m?deg/s(?:ec)?|m?°/s|rad/s)\)?"
_PER = (  # counts in a unit, and units of a count
    (re.compile(rf"{_NUMBER}\s*{_COUNT}?(?:/s)?\s*(?:/|per)\s*{_UNIT}(?![\w/])", re.IGNORECASE), False),
    (re.compile(rf"{_NUMBER}\s*{_UNIT}\s*(?:/|per)\s*{_COUNT}", re.IGNORECASE), True),
    (re.compile(rf"acc_?(?:1g)\W+{_NUMBER}(?P<u>)", re.IGNORECASE), False),
)
_SPELT = {"dps": "deg/s", "mdps": "mdeg/s", "°/s": "deg/s", "m°/s": "mdeg/s", "deg/sec": "deg/s", "m/s2": "m/s^2",
          "m/s²": "m/s^2", "gal": "Gal", "mgal": "mGal", "": "g"}  # fmt: skip


def scales(above: Sequence[str]) -> dict[str, list[tuple[float, str]]]:
    """SI units of one count by quantity, as lines above a table say, each with its line."""
    out: dict[str, list[tuple[float, str]]] = {FORCE: [], RATE: []}
    for line in above:
        for pattern, inverse in _PER:
            for hit in pattern.finditer(line):
                unit, number = _SPELT.get(hit["u"].lower(), hit["u"].lower()), float(hit["n"].replace(",", "."))
                if number > 0:
                    size = float(to_si(1.0, unit)) * (number if inverse else 1 / number)
                    out[RATE if unit.endswith("/s") else FORCE].append((size, line.strip()))
    return out


def in_physical_units(
    columns: Mapping[str, Array], guesses: Mapping[str, Guess], above: Sequence[str], step: float
) -> tuple[dict[str, Array], dict[str, Guess]]:
    """Columns of counts in g and deg/s where the log says how much a count is; those of a gate of `step` s too.

    Accelerometers are taken so only where they then read gravity; gyroscopes are to be tried on the turns.
    """
    out, said = dict(columns), dict(guesses)
    for quantity, told in scales(above).items():
        unit, many = ("g", "counts per g") if quantity == FORCE else ("deg/s", "counts per deg/s")
        own = [n for n, g in guesses.items() if g.quantity == quantity and g.unit == "count"]
        for size, line in told if len(own) == 3 else ():
            one = float(from_si(size, unit))
            length = float(np.nanmedian(np.sqrt(sum(columns[n] ** 2 for n in own)))) * one
            fitting = [(f, w) for f, w in ((1.0, ""), (1 / step, f", added up over {step:.4g} s")) if quantity == RATE
                       or abs(length * f - 1) < NEAR]  # fmt: skip
            if not fitting:
                continue
            factor, gate = fitting[0]
            agrees = f"; at rest that is {length * factor:.4g} g" if quantity == FORCE else ""
            for n in own:
                out[n] = columns[n] * (one * factor)
                why = guesses[n].why.partition(";")[0]
                said[n] = replace(guesses[n], unit=unit, why=f"{why}; {1 / one:.6g} {many}{gate}, as the log says "
                                  f"({line!r}){agrees}")  # fmt: skip
            break
    return out, said
