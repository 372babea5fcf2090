"""A data frame whose columns nobody described: guessed as those of a log are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from gimbalcal.errors import InputError
from gimbalcal.guess.column_names import Guess
from gimbalcal.guess.proposal import of_tables
from gimbalcal.guess.text_table import LEAST_COLUMNS, Table, gathered, values_of
from gimbalcal.number import Array
from gimbalcal.recording import Recording
from gimbalcal.recording.dates import Dates
from gimbalcal.units import from_si, to_si

STATED = {"latitude": "deg", "height": "m"}


def guessed_frame(frame: Any, title: str = "frame", site: Mapping[str, tuple[float, str]] | None = None) -> Recording:
    """The recording in a frame or a mapping of columns, with a remark on what each was taken for and why.

    site: latitude and height with their units. Raises InputError as `propose` does.
    """
    if unknown := set(site or {}) - set(STATED):
        raise InputError(f"site holds {min(unknown)!r}; beside guessed columns it takes latitude and height")
    place = {key: float(from_si(to_si(*(site or {})[key]), unit)) if key in (site or {}) else None
             for key, unit in STATED.items()}  # fmt: skip
    found = of_tables({Path(title): _table(frame)}, title, 0.0, place["latitude"], place["height"])
    took = tuple(f"{name} is taken for {held(g)}, by {g.why}" for name, g in found.guesses.items())
    told = tuple(f"{what}: {note}" for what, note in found.notes.items())
    left = (f"left out: {', '.join(found.left_out)}",) if found.left_out else ()
    made = found.recording
    return replace(made, remarks=(*took, *told, *left, *made.remarks))


def held(g: Guess) -> str:
    """What a column is taken for, in a few words."""
    return " ".join(filter(None, [g.quantity.replace("_", " "), g.axis, f"[{g.unit}]" if g.unit else ""]))


def _table(frame: Any) -> Table:
    """The columns of a frame as those of a text table; an index of dates is a clock."""
    import polars as pl

    dates = Dates()
    names = list(frame.keys() if isinstance(frame, Mapping) else frame.columns)
    given = {str(n): np.asarray(frame[n]) for n in names}
    index = np.asarray(getattr(frame, "index", ()) if not isinstance(frame, Mapping) else ())
    if index.dtype.kind == "M":
        given = {"time (index)": index, **given}

    def told(name: str, x: Array) -> tuple[Array, str]:
        if x.ndim == 1 and x.dtype.kind in "biuf":
            return x.astype(float), "number"
        text = pl.Series(name, x.astype(str)) if x.ndim == 1 else pl.Series(name, [], dtype=pl.String)
        return values_of(name, text, ",", dates)

    made = gathered((name, *told(name, x)) for name, x in given.items())
    if len(made.columns) < LEAST_COLUMNS:
        raise InputError(f"the frame holds {len(made.columns)} columns of numbers, and a triad and its clock take more")
    return made
