"""A log of an inertial unit that nobody described yet: read, its columns guessed, several logs on one clock.

What is proposed passes the checks of every recording. Where these refuse the gyroscopes in the guessed unit and take
them in another, that one is proposed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from gimbalcal.errors import InputError, amount
from gimbalcal.importers.delimited import table_of
from gimbalcal.importers.guess import (
    FORCE,
    RATE,
    Guess,
    by_name,
    by_order,
    sound_unit,
    unit_of_force,
    unit_of_rate,
    unit_of_time,
)
from gimbalcal.number import Array
from gimbalcal.recording import Recording, from_frame
from gimbalcal.recording.plausibility import refuse_implausible
from gimbalcal.units import from_si, to_si

BESIDE = ("rad/s", "deg/s", "deg/h")  # units of rate that are tried where the guessed one cannot be
FEWEST = 2  # rests that make a recording a multi-position one


@dataclass(frozen=True)
class Proposal:
    """A recording, what each of its columns is taken for (by its name in the log), and columns that are left out."""

    recording: Recording
    guesses: Mapping[str, Guess]
    left_out: tuple[str, ...]


def propose(logs: Sequence[Path], title: str = "", rate: float = 0.0) -> Proposal:
    """The recording in one log or several of one unit; rate [Hz] where a log has no clock.

    Raises InputError where no accelerometer is found, where logs do not overlap, or where nothing that is guessed makes
    a recording, with what to write into a header by hand.
    """
    tables = [_guessed(path, table_of(path), rate) for path in logs]
    columns, guesses, left = tables[0]
    for path, (other, theirs, unknown) in zip(logs[1:], tables[1:], strict=True):
        columns, guesses = _on_one_clock(path, (columns, guesses), (other, theirs))
        left += unknown
    missing = [a for a in "xyz" if not any((g.quantity, g.axis) == (FORCE, a) for g in guesses.values())]
    if missing:
        raise InputError(
            f"{logs[0]}: no column is an accelerometer along {' and '.join(missing)} by its name "
            f"({', '.join(columns)}); name the columns acc_x, acc_y, acc_z, gyro_x, ..., time, or write a "
            "header and use `gimbalcal import csv`"
        )
    title = title or logs[0].stem
    tried = [guesses, *(_in_other_unit(guesses, unit) for unit in BESIDE if _rate_is_open(guesses))]
    refused: InputError | None = None
    for g in tried:
        try:
            return Proposal(_made(columns, g, title), g, tuple(left))
        except InputError as problem:
            refused = refused or problem
    assert refused is not None
    raise refused


def _made(columns: Mapping[str, Array], guesses: Mapping[str, Guess], title: str) -> Recording:
    entries = {
        name: {"quantity": g.quantity, **({"axis": g.axis} if g.axis else {}), **({"unit": g.unit} if g.unit else {})}
        for name, g in guesses.items()
    }
    platform = "space-stable" if any(g.quantity == "gimbal_angle" for g in guesses.values()) else "bench"
    made = from_frame(columns, entries, title=title, platform=platform, called=title)
    if made.position is not None and int(made.position.max(initial=0)) < FEWEST:
        raise InputError(
            f"{title}: {amount(int(made.position.max(initial=0)), 'rest')} found, and a calibration takes six or more "
            "in different attitudes; hold the unit still for some seconds in each"
        )
    remarks = refuse_implausible(made)
    return replace(made, remarks=(*made.remarks, *remarks))


def _guessed(
    path: Path, table: Mapping[str, Array], rate: float
) -> tuple[dict[str, Array], dict[str, Guess], list[str]]:
    """Columns of a log that are known, what they are, and the names of the others."""
    columns = dict(table)
    guesses = {name: g for name in columns if (g := by_name(name)) is not None}
    if not any(g.quantity in (FORCE, RATE) for g in guesses.values()):
        guesses = by_order(columns)
    seen: set[tuple[str, str]] = set()
    for name in list(guesses):  # the first of two that say the same
        key = (guesses[name].quantity, guesses[name].axis)
        if key in seen:
            del guesses[name]
        seen.add(key)
    if ("time", "") not in seen:
        if rate <= 0:
            raise InputError(f"{path}: no column is a clock by its name ({', '.join(columns)}); give --rate HZ")
        columns = {"time": np.arange(len(next(iter(columns.values())))) / rate, **columns}
        guesses = {"time": Guess("time", "", "s", f"--rate {rate:g}"), **guesses}
    left = [name for name in columns if name not in guesses]
    return {name: columns[name] for name in guesses}, _with_units(columns, guesses), left


def _with_units(columns: Mapping[str, Array], guesses: Mapping[str, Guess]) -> dict[str, Guess]:
    """Units that no name tells, from the numbers."""
    out = dict(guesses)
    for quantity, of in ((FORCE, unit_of_force), (RATE, unit_of_rate)):
        own = [name for name, g in guesses.items() if g.quantity == quantity]
        if own and not all(sound_unit(guesses[n].unit, quantity) for n in own):
            full = np.isfinite(np.stack([columns[n] for n in own])).all(axis=0)
            unit, why = of([columns[n][full] for n in own])
            out |= {n: replace(guesses[n], unit=unit, why=f"{guesses[n].why}; {why}") for n in own}
    (clock,) = [name for name, g in guesses.items() if g.quantity == "time"]
    if not sound_unit(out[clock].unit, "time"):
        unit, why = unit_of_time(columns[clock])
        out[clock] = replace(out[clock], unit=unit, why=f"{out[clock].why}; {why}")
    return out


def _rate_is_open(guesses: Mapping[str, Guess]) -> bool:
    """Whether the unit of the gyroscopes was guessed from numbers."""
    return any(g.quantity == RATE and "up to" in g.why and g.unit != "count" for g in guesses.values())


def _in_other_unit(guesses: Mapping[str, Guess], unit: str) -> dict[str, Guess]:
    why = f"the turns between rests fit gravity in {unit}"
    return {n: replace(g, unit=unit, why=why) if g.quantity == RATE else g for n, g in guesses.items()}


Table = tuple[dict[str, Array], dict[str, Guess]]


def _on_one_clock(path: Path, first: Table, other: Table) -> Table:
    """Both logs at the first one's times, where they overlap; the other's readings lie between its own."""
    (columns, guesses), (more, theirs) = first, other
    clock, clock2 = (next(n for n, g in each.items() if g.quantity == "time") for each in (guesses, theirs))
    t = np.asarray(columns[clock])
    t2 = np.asarray(from_si(to_si(more[clock2], theirs[clock2].unit), guesses[clock].unit))
    inside = (t >= t2[0]) & (t <= t2[-1])
    if np.count_nonzero(inside) < 2:
        raise InputError(f"{path} and the first log do not overlap in time; give logs of one run, with one clock")
    known = {(g.quantity, g.axis) for g in guesses.values()}
    out, said = {n: x[inside] for n, x in columns.items()}, dict(guesses)
    for name, g in theirs.items():
        if g.quantity != "time" and (g.quantity, g.axis) not in known:
            mine = name if name not in out else f"{path.stem}_{name}"
            out[mine] = np.interp(t[inside], t2, more[name])
            said[mine] = replace(g, why=f"{g.why}; {path.name}, at the times of the first log")
    return out, said
