"""A data frame whose columns nobody described, guessed as those of a log are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from gimbalcal.errors import InputError
from gimbalcal.guess.proposal import StatedPlace, of_tables
from gimbalcal.guess.text_table import MIN_COLUMNS, Table, table_of_columns, values_of
from gimbalcal.number import Array, holds_real_numbers
from gimbalcal.recording import Recording
from gimbalcal.recording.dates import Dates
from gimbalcal.units import from_si, to_si

UNITS = {"latitude": "deg", "height": "m"}  # of a StatedPlace


def guessed_frame(frame: Any, title: str = "frame", site: Mapping[str, tuple[float, str]] | None = None) -> Recording:
    """Return the recording in a frame or a mapping of columns, with remarks on what each was taken for and why.

    site: latitude and height with their units. Raises InputError as `propose` does.
    """
    site = site or {}
    if unknown := set(site) - set(UNITS):
        raise InputError(f"site holds {min(unknown)!r}; beside guessed columns it takes latitude and height")
    place = StatedPlace(**{key: float(from_si(to_si(*stated), UNITS[key])) for key, stated in site.items()})
    proposal = of_tables({Path(title): _table(frame)}, title, 0.0, place)
    taken = tuple(f"{name} is taken for {g.in_words}, by {g.why}" for name, g in proposal.guesses.items())
    notes = tuple(f"{what}: {note}" for what, note in proposal.notes.items())
    left_out = (f"left out: {', '.join(proposal.left_out)}",) if proposal.left_out else ()
    recording = proposal.recording
    return replace(recording, remarks=(*taken, *notes, *left_out, *recording.remarks))


def _table(frame: Any) -> Table:
    """Return the columns of a frame as those of a text table; an index of dates is a clock."""
    import polars as pl

    dates = Dates()
    names = list(frame.keys() if isinstance(frame, Mapping) else frame.columns)
    columns = {str(n): np.asarray(frame[n]) for n in names}
    index = np.asarray(getattr(frame, "index", ()) if not isinstance(frame, Mapping) else ())
    if np.issubdtype(index.dtype, np.datetime64):
        columns = {"time (index)": index, **columns}

    def values(name: str, x: Array) -> tuple[Array, str]:
        if x.ndim == 1 and holds_real_numbers(x):
            return x.astype(float), "number"
        text = pl.Series(name, x.astype(str)) if x.ndim == 1 else pl.Series(name, [], dtype=pl.String)
        return values_of(name, text, ",", dates)

    table = table_of_columns((name, *values(name, x)) for name, x in columns.items())
    if len(table.columns) < MIN_COLUMNS:
        raise InputError(
            f"the frame holds {len(table.columns)} columns of numbers, and a triad and its clock take more"
        )
    return table
