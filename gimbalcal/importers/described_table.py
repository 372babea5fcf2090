"""Recordings from general tables whose columns a header file names, as `csv`, `mat` and `hdf5` read them."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from gimbalcal.errors import InputError
from gimbalcal.importers.registry import number
from gimbalcal.number import Array
from gimbalcal.recording.frames import recording_of
from gimbalcal.recording.header import Header, foreign_header
from gimbalcal.recording.record import Recording


def header_for(path: Path, options: Mapping[str, str], skip: int = 0) -> Header:
    """Return the header file among the options, which says what the columns of `path` hold."""
    if "header" not in options:
        raise InputError(
            f"what do the columns of {path} hold? Write it down as in recording.toml, with [columns], and name that "
            "file in the option header"
        )
    header = foreign_header(Path(options["header"]), path, skip, clock_needed=False)
    ordered = header.kind.sighting or (header.kind.in_positions and header.column("position") is not None)
    if ordered or "rate" in options:
        return header  # of stars and of dwells the order may stand in for a clock
    return foreign_header(Path(options["header"]), path, skip)


def from_variables(path: Path, options: Mapping[str, str], variable: Callable[[str], tuple[Path, Any]]) -> Recording:
    """Return the recording in variables, each given by its name with the file that holds it.

    A column is a vector, or one column of a matrix by its index: ``acc[0]`` of an (n, 3) or (3, n) array ``acc``. With
    the option ``rate`` (Hz) the clock is made from the number of the row.
    """

    def column(name: str) -> Array:
        base, index = re.sub(r"\[\d+\]$", "", name), re.search(r"\[(\d+)\]$", name)
        file, value = variable(base)
        value = np.squeeze(np.asarray(value))
        if value.ndim <= 1 and not index:
            return np.atleast_1d(value)
        if value.ndim == 2 and index:
            rows = value if value.shape[0] >= value.shape[1] else value.T
            if int(index[1]) < rows.shape[1]:
                return np.asarray(rows[:, int(index[1])])
        raise InputError(
            f"{file}: {name} does not name one column of an array of shape {value.shape}; write {base}[0], "
            f"{base}[1], ... for the columns of a matrix, and no index for a vector"
        )

    return recording_of(header_for(path, options), column, number(options, "rate", 0.0))
