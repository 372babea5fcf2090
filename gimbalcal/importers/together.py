"""Columns of a log that say the same, and several logs of one unit on one clock."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from gimbalcal.errors import InputError
from gimbalcal.importers.clock import best_clock
from gimbalcal.importers.names import Guess
from gimbalcal.number import Array
from gimbalcal.units import from_si, to_si

Columns = tuple[dict[str, Array], dict[str, Guess]]


def one_each(columns: Mapping[str, Array], guesses: Mapping[str, Guess]) -> tuple[dict[str, Array], dict[str, Guess]]:
    """The first of columns that say the same; of clocks the best; one sigma for three."""
    out, kept = dict(columns), {}
    clock = best_clock(columns, guesses)
    sigmas = [n for n, g in guesses.items() if g.quantity == "sigma"]
    seen: set[tuple[str, str]] = set()
    for name, g in guesses.items():
        key = (g.quantity, "" if g.quantity in ("time", "sigma") else g.axis)
        if key in seen or (g.quantity == "time" and name != clock):
            continue
        seen.add(key)
        kept[name] = g
    if len(sigmas) > 1:
        del kept[next(n for n in sigmas if n in kept)]
        together = "sigma of the force"
        out[together] = np.sqrt(np.mean([columns[n] ** 2 for n in sigmas], axis=0))
        kept[together] = replace(guesses[sigmas[0]], why=f"the root of the mean square of {', '.join(sigmas)}")
    return out, kept


def on_one_clock(path: Path, first: Columns, other: Columns) -> Columns:
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
    for name in (n for n in more if n not in theirs and n not in out):  # what nobody knows yet: angles of a rig
        out[name] = np.interp(t[inside], t2, more[name])
    for name, g in theirs.items():
        if g.quantity != "time" and (g.quantity, g.axis) not in known:
            mine = name if name not in out else f"{path.stem}_{name}"
            out[mine] = np.interp(t[inside], t2, more[name])
            said[mine] = replace(g, why=f"{g.why}; {path.name}, at the times of the first log")
    return out, said
