"""Logs that are parts of one run: a file for each face or each turn of a unit, put one after the other."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from gimbalcal.errors import InputError
from gimbalcal.guess.column_names import Guess
from gimbalcal.guess.text_table import Table
from gimbalcal.number import Array

COUNTED = "time [s]"  # the clock of rows that are counted by a rate


def alike(guesses: Mapping[Path, Mapping[str, Guess]]) -> bool:
    """Whether logs hold the same by the same names, so that each is a part and none is another sensor."""
    held = [{name: (g.quantity, g.axis) for name, g in of.items()} for of in guesses.values()]
    return len(held) > 1 and all(each == held[0] for each in held)


def joined(logs: Mapping[Path, Table], clock: str, rate: float = 0.0) -> tuple[Table, str]:
    """Parts as one log, and in words how they follow each other; `clock` is the name of their column of time.

    Where clocks go on from part to part these stand in its order. Where each begins anew, or rows are counted by
    `rate` [Hz], parts stand in the order given, with as long a pause between two as the one before it lasted: nobody
    logged how the unit turned meanwhile, and what drifts with time is not told. Raises InputError where clocks overlap
    and none begins near zero: then these are two units at once.
    """
    many, tables = f"{len(logs)} logs of the same columns are parts of one run", dict(logs)
    if rate > 0:
        clock = COUNTED
        tables = {p: _with(t, clock, np.arange(len(next(iter(t.columns.values())))) / rate) for p, t in logs.items()}
    spans = {
        path: (float(np.nanmin(t.columns[clock])), float(np.nanmax(t.columns[clock]))) for path, t in tables.items()
    }
    order = sorted(tables, key=lambda path: spans[path])
    later = list(pairwise(order))
    if all(spans[b][0] > spans[a][1] for a, b in later):
        return _stacked([tables[path] for path in order]), f"{many}, in the order of their clock"
    for a, b in later:
        if spans[b][0] <= spans[a][1] and spans[a][0] > spans[a][1] - spans[a][0]:
            raise InputError(
                f"{a} and {b} hold the same columns at the same times, as two units do; give each its own "
                "recording, or --rate HZ where they are parts of one run whose clocks mean nothing"
            )
    end, each = 0.0, []
    for path, table in tables.items():
        first, last = spans[path]
        each.append(_with(table, clock, table.columns[clock] - first + end))
        end += 2 * (last - first)
    return _stacked(each), (
        f"{many}, in the order given; each has its own clock, so the pauses between them are made up and "
        "rates of drift mean nothing"
    )


def _with(table: Table, name: str, values: Array) -> Table:
    return replace(table, columns={name: values, **{n: x for n, x in table.columns.items() if n != name}})


def _stacked(tables: list[Table]) -> Table:
    names = list(tables[0].columns)
    return replace(tables[0], columns={n: np.concatenate([t.columns[n] for t in tables]) for n in names})
