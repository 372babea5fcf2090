"""Units that only the numbers of a log told, and the others that it may be in."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from gimbalcal.guess import clocks
from gimbalcal.guess.column_names import RATE, Guess
from gimbalcal.guess.header_scales import in_physical_units
from gimbalcal.guess.merged_logs import Columns
from gimbalcal.number import Array
from gimbalcal.units import to_si

BESIDE = ("rad/s", "deg/s", "deg/h")  # units of rate that are tried where the guessed one cannot be
SLOWEST, FASTEST = 0.02, 20_000.0  # Hz; clocks in other units are tried within


def in_likely_units(
    columns: Mapping[str, Array], guesses: Mapping[str, Guess], above: Sequence[str]
) -> Iterator[Columns]:
    """The log as it most likely is, and then in other units of rate and time where nobody named them."""
    clock = next(n for n, g in guesses.items() if g.quantity == "time")
    step = float(np.median(np.diff(columns[clock]))) * float(to_si(1.0, guesses[clock].unit))
    first = in_physical_units(columns, guesses, above, step)
    units = [unit for unit in BESIDE if is_open(first[1], RATE)]
    yield first
    if first[1] != dict(guesses):
        yield dict(columns), dict(guesses)
    yield from ((first[0], _in_other_unit(first[1], unit)) for unit in units)
    if not is_open(guesses, "time"):
        return
    for unit, size in clocks.UNITS.items():
        rate = float(to_si(1.0, guesses[clock].unit)) / (step * size)
        if unit == guesses[clock].unit or not SLOWEST <= rate <= FASTEST:
            continue
        other = clocks.in_unit(first[0], first[1], unit)
        yield other
        yield from ((other[0], _in_other_unit(other[1], u)) for u in units)


def is_open(guesses: Mapping[str, Guess], quantity: str) -> bool:
    """Whether the unit of a quantity was guessed from its numbers, and may be another."""
    return any(g.quantity == quantity and g.open for g in guesses.values())


def _in_other_unit(guesses: Mapping[str, Guess], unit: str) -> dict[str, Guess]:
    why = f"the turns between rests fit gravity in {unit}"
    return {n: replace(g, unit=unit, why=why, open=False) if g.quantity == RATE else g for n, g in guesses.items()}
