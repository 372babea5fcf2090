"""What the columns of one log hold: by name, by names that are alike, by order, and units by numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from dataclasses import replace
from pathlib import Path

import numpy as np

from gimbalcal.errors import InputError
from gimbalcal.guess import clocks
from gimbalcal.guess.column_names import (
    FORCE,
    RATE,
    Guess,
    body_rates,
    by_name,
    by_turn,
    counted_from_one,
    hinted,
    plain,
    unit_written,
)
from gimbalcal.guess.column_values import alike, by_order, sound_unit, unit_of_force, unit_of_rate
from gimbalcal.guess.merged_logs import one_each
from gimbalcal.guess.text_table import Table
from gimbalcal.importers.pointing import SPACED
from gimbalcal.number import Array

JOINED = "time of two columns"
EACH_A_REST = 0.05  # of the norm, from row to row: no log is so slow, but a table with a row for each position
ONE_LENGTH = 0.1  # that all but a few rests agree to in the norm of the force
MOST_RESTS = 2000  # rows of such a table


def guessed(
    path: Path, table: Table, rate: float, named: Set[str]
) -> tuple[dict[str, Array], dict[str, Guess], list[str], dict[str, str]]:
    """Columns of a log, what those are that are known, names of the others, and what was guessed of the whole."""
    columns, hint = dict(table.columns), hinted(path.stem)
    notes: dict[str, str] = {}
    if two := clocks.joined(columns):
        whole, beyond, seconds, unit = two
        columns = {JOINED: seconds, **{n: x for n, x in columns.items() if n not in two[:2]}}
    guesses = {name: g for name in columns if (g := by_name(name, hint)) is not None}
    guesses |= counted_from_one(columns)
    if two:
        why = f"its names {whole!r} and {beyond!r}, whole seconds and {unit}, counted from the first row"
        guesses = {JOINED: Guess("time", "", "s", why), **{n: g for n, g in guesses.items() if n != JOINED}}
    if not any(g.quantity == "time" for g in guesses.values()) and (clock := _of_day(columns, table)):
        guesses = {clock: Guess("time", "", "s", "its cells, which are times of day"), **guesses}
    columns, told = clocks.one_of_several(columns, [n for n, g in guesses.items() if g.quantity == "time"])
    notes |= {"sensor": told} if told else {}
    for name, g in guesses.items():
        if g.quantity == "time":
            if name in table.sexagesimal:
                columns[name] = 3600 * columns[name]
            columns[name], at = clocks.unwrapped(columns[name])
            again = f"; it begins again at {at}, and is taken to go on" if at else ""
            ticks = clocks.NAMED.get(plain(name), "")
            if ticks:
                columns[name], again = clocks.UNITS[ticks] * columns[name], f", which counts {ticks}{again}"
            stamped = bool(ticks) or name in table.dates or name in table.sexagesimal
            guesses[name] = replace(g, unit="s" if stamped else g.unit, why=g.why + again)
    if not any(g.quantity == RATE for g in guesses.values()):
        guesses |= body_rates({name: plain(name) for name in columns if name not in guesses})
    if FORCE not in named:
        unknown = {name: x for name, x in columns.items() if name not in guesses}
        guesses |= {n: g for n, g in alike(unknown).items() if g.quantity not in named}
    if not any(g.quantity in (FORCE, RATE) for g in guesses.values()) and not named & {FORCE, RATE}:
        labelled = {n: g for n, g in guesses.items() if g.quantity in ("time", "temperature")}
        rest = {name: x for name, x in columns.items() if name not in labelled}
        guesses = {**by_order(rest), **labelled} if rest else labelled
    if not any(g.quantity == "time" for g in guesses.values()) and (clock := clocks.growing(columns, guesses)):
        why = "the column that grows evenly from row to row"
        guesses = {clock: Guess("time", "", unit_written(plain(clock)), why), **guesses}
    columns, guesses = one_each(columns, guesses)
    if timing := [n for n, g in guesses.items() if g.quantity == "time"]:
        timed = np.isfinite(columns[timing[0]])
        if not timed.all():
            columns = {n: x[timed] for n, x in columns.items()}
            notes["time"] = f"{np.count_nonzero(~timed)} of {len(timed)} rows have no time and are left out"
    seen = {g.quantity for g in guesses.values()}
    force = [columns[name] for name, g in guesses.items() if g.quantity == FORCE]
    numbered = next((columns[n] for n, g in guesses.items() if g.quantity == "position"), np.zeros(2))
    distinct = len(numbered) <= MOST_RESTS and len(np.unique(numbered)) == len(numbered)
    each_a_rest = len(force) == 3 and (distinct or _jumps(force))
    if each_a_rest:  # beside samples these are what a unit makes of itself
        guesses |= {n: g for n in columns if n not in guesses and (g := by_turn(n))}
    if each_a_rest and "position" not in seen:
        columns = {"position": np.arange(1.0, len(force[0]) + 1), **columns}
        guesses = {"position": Guess("position", "", "", "the rows: the force turns from each to the next"), **guesses}
    if rate > 0:
        guesses = {name: g for name, g in guesses.items() if g.quantity != "time"}
    if rate > 0 or "time" not in seen:
        if rate <= 0 and not each_a_rest:
            raise InputError(f"{path}: no column is a clock by its name ({', '.join(columns)}); give --rate HZ")
        rows = np.arange(len(next(iter(columns.values()))))
        columns = {"time": rows / rate if rate > 0 else SPACED * rows, **columns}
        why = (
            f"--rate {rate:g}"
            if rate > 0
            else f"its rows, counted {SPACED:g} s apart since no column is a clock: rates of drift mean nothing"
        )
        guesses = {"time": Guess("time", "", "s", why), **guesses}
    if not each_a_rest:  # a standard deviation of single samples is what the rows show
        guesses = {name: g for name, g in guesses.items() if g.quantity not in ("sigma", "weight")}
    elif any(g.quantity == "sigma" for g in guesses.values()):
        counted = any(g.quantity == "weight" for g in guesses.values())
        notes["sigma"] = (
            "standard deviations are of single samples, and a mean of N is better by sqrt(N)" if counted else
            "standard deviations are taken for those of the means; of single samples, add a column with their number, "
            'quantity = "weight"'
        )  # fmt: skip
    used = (
        {*guesses, *(name for name in columns if (g := by_name(name)) and g.quantity == "sigma")}
        if each_a_rest
        else guesses
    )
    left = [name for name in (*table.columns, *table.others) if name not in used and not (two and name in two[:2])]
    return columns, _with_units(columns, guesses), left, notes


def _of_day(columns: Mapping[str, Array], table: Table) -> str:
    """A column whose cells are dates, or times of day that go on past midnight at most, whatever it is called."""
    for name, x in columns.items():
        if name in table.dates or (name in table.sexagesimal and np.all(np.diff(clocks.unwrapped(3600 * x)[0]) > 0)):
            return name
    return ""


def _jumps(force: Sequence[Array]) -> bool:
    """Whether forces (n,) along three axes turn from each row to the next, as means of positions do."""
    f = np.stack(force, axis=-1)
    f = f[np.isfinite(f).all(axis=1)]
    if not 2 < len(f) <= MOST_RESTS:
        return False
    step, norm = np.linalg.norm(np.diff(f, axis=0), axis=1), np.linalg.norm(f, axis=1)
    alike = np.quantile(np.abs(norm / np.median(norm) - 1), 0.9) < ONE_LENGTH
    return bool(alike and np.mean(step > EACH_A_REST * np.median(norm)) > 0.5)


def _with_units(columns: Mapping[str, Array], guesses: Mapping[str, Guess]) -> dict[str, Guess]:
    """Units that no name tells, from the numbers."""
    out = dict(guesses)
    for quantity, of in ((FORCE, unit_of_force), (RATE, unit_of_rate)):
        own = [name for name, g in guesses.items() if g.quantity == quantity]
        if own and not all(sound_unit(guesses[n].unit, quantity) for n in own):
            full = np.isfinite(np.stack([columns[n] for n in own])).all(axis=0)
            unit, why = of([columns[n][full] for n in own])
            told = quantity == FORCE or unit == "count"  # by gravity, or by the turns in any case
            out |= {n: replace(guesses[n], unit=unit, why=f"{guesses[n].why}; {why}", open=not told) for n in own}
    force = next((g.unit for g in out.values() if g.quantity == FORCE), "m/s^2")
    for name, g in out.items():
        if g.quantity == "sigma" and not sound_unit(g.unit, FORCE):
            out[name] = replace(g, unit=force, why=f"{g.why}; the unit is that of the forces")
    (clock,) = [name for name, g in guesses.items() if g.quantity == "time"]
    if not sound_unit(out[clock].unit, "time"):
        unit, why = clocks.unit_of_time(columns[clock])
        out[clock] = replace(out[clock], unit=unit, why=f"{out[clock].why}; {why}", open=True)
    return out
