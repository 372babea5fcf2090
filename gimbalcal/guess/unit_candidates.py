"""Units that only the numbers of a log determine, and the others that it may be in."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from gimbalcal.guess import clocks
from gimbalcal.guess.header_scales import in_physical_units
from gimbalcal.guess.log import RATE, Guess, Log
from gimbalcal.units import to_si

RATE_UNITS = ("rad/s", "deg/s", "deg/h")  # tried where the guessed one cannot be
MIN_RATE_HZ, MAX_RATE_HZ = 0.02, 20_000.0  # of rows, within which other units of time are tried


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
