"""Units that only the numbers of a log determine, and the others that it may be in.

A scale of counts may be stated above the table: "LSB 16384/g", "0.061 mg per digit", "acc_1G 2048". One of
accelerometers is taken where their readings then have the length of gravity; one of gyroscopes is tried on the turns.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gimbalcal.guess import clocks
from gimbalcal.guess.column_values import MAX_GRAVITY_ERROR, costs_of_rate
from gimbalcal.guess.log import Guess, Log, filled_rows
from gimbalcal.recording.record import FORCE, RATE
from gimbalcal.units import from_si, to_si

SCALE_STATED = 3.0  # nats, by which counts are likelier whose scale the log states
MAX_COST = 15.0  # nats, beyond which a unit is not tried
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


@dataclass(frozen=True, eq=False)
class UnitCandidate:
    """A log in one choice of the units that no name states, and how unlikely that is by its numbers alone, in nats."""

    log: Log
    cost: float


def unit_candidates(log: Log, above: Sequence[str]) -> list[UnitCandidate]:
    """Return the log in every unit of clock and gyroscopes that nobody stated, the likeliest first.

    above: the lines above the tables, which may state the scale of counts.
    """
    out, rates = [], [*_rates_in_units(log)]
    for clock, t_cost in _with_clocks(log):
        for guesses, r_cost in rates:
            each, cost = clock.including(guesses), t_cost + r_cost
            scaled = in_physical_units(each, above)
            out.append(UnitCandidate(scaled, cost - (SCALE_STATED if scaled.guesses != each.guesses else 0.0)))
            out += [UnitCandidate(each, cost)] if scaled.guesses != each.guesses else []
    return sorted(out, key=lambda c: c.cost)


def _with_clocks(log: Log) -> Iterator[tuple[Log, float]]:
    """Yield the log with its clock in each unit that it may count in, and the cost of it."""
    if not log.has_open_unit("time"):
        yield log, 0.0
        return
    for unit, (cost, _) in clocks.costs_of_unit(log.columns[log.clock]).items():
        yield clocks.in_unit(log, unit), cost


def _rates_in_units(log: Log) -> Iterator[tuple[dict[str, Guess], float]]:
    """Yield the guesses of the gyroscopes in each unit that they may be in, and its cost; none where it is known."""
    if not log.has_open_unit(RATE):
        yield {}, 0.0
        return
    for unit, (cost, why) in rate_costs(log).items():
        if cost < MAX_COST:
            yield (
                {
                    n: replace(g, unit=unit, why=f"{g.why.partition(';')[0]}; {why}", open=False)
                    for n, g in log.guesses.items()
                    if g.quantity == RATE
                },
                cost,
            )


def rate_costs(log: Log) -> dict[str, tuple[float, str]]:
    """Return how unlikely each unit of the gyroscopes of a log is by their numbers, and what shows it."""
    counted = any(log.guesses[n].unit == "count" for n in log.names(FORCE))
    return costs_of_rate(filled_rows(log.values(RATE)), counted)


def stated_scales(above: Sequence[str]) -> dict[str, list[tuple[float, str]]]:
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


def in_physical_units(log: Log, above: Sequence[str]) -> Log:
    """Return the log with counts in g and deg/s where the lines above it state a scale.

    Accelerometers are scaled only where they then read gravity; counts may also be sums over a step of the clock.
    """
    for quantity, stated in stated_scales(above).items():
        unit, of_unit = ("g", "counts per g") if quantity == FORCE else ("deg/s", "counts per deg/s")
        names = [n for n in log.names(quantity) if log.guesses[n].unit == "count"]
        for size, line in stated if len(names) == 3 else ():
            scale = float(from_si(size, unit))
            step = float(np.median(np.diff(log.seconds)))
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
