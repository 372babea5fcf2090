"""Recordings from general tables whose columns a header file names, as `csv`, `mat` and `hdf5` read them."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from gimbalcal.errors import InputError
from gimbalcal.importers.pointing import ROW_STEP_S
from gimbalcal.importers.registry import number
from gimbalcal.number import Array
from gimbalcal.recording.columns import COUNTED, Column
from gimbalcal.recording.dates import Dates, NoDateError
from gimbalcal.recording.header import Header, foreign_header
from gimbalcal.recording.reading import assemble, dated
from gimbalcal.recording.record import Recording
from gimbalcal.units import from_si


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
        return header  # of stars and of rests the order may stand in for a clock
    return foreign_header(Path(options["header"]), path, skip)


def recording_of(header: Header, options: Mapping[str, str], fetch: Callable[[str], Array]) -> Recording:
    """Return the recording whose columns `fetch` gives by name.

    With the option ``rate`` (Hz) the time column is made from the number of the row, for files without a clock.
    """
    clock = header.column("time")
    names = [c.name for c in header.columns if c is not COUNTED]
    rate = number(options, "rate", 0.0)
    dates = Dates()
    columns = {}
    for name in names:
        if not clock or name != clock.name:
            columns[name] = _numbers(header, name, fetch(name))
        elif not rate:
            columns[name] = _clock(header, clock, fetch(name), dates)
    sizes = {name: len(values) for name, values in columns.items()}
    if len(set(sizes.values())) > 1:
        listed = ", ".join(f"{name} {n}" for name, n in sizes.items())
        raise InputError(f"{header.samples}: the columns differ in length ({listed}); they must have one value per row")
    remarks: tuple[str, ...] = ()
    if clock and (rate or clock is COUNTED):
        rows = np.arange(float(next(iter(sizes.values()), 0)))
        columns[clock.name] = from_si(rows / rate if rate else ROW_STEP_S * rows, clock.unit)
        if not rate:
            _refuse_samples(header, columns)
            spaced = f"its rows are {ROW_STEP_S:g} s apart in order, so that rates mean nothing"
            remarks = (f"{header.samples} has no clock: {spaced}",)
    recording = assemble(header, [columns] if columns and len(columns[names[0]]) else [], lambda name: columns[name])
    return dated(replace(recording, remarks=(*recording.remarks, *remarks)), header, dates)


def _refuse_samples(header: Header, columns: Mapping[str, Array]) -> None:
    """Raise InputError where several rows in a row are of one position: samples have a rate, means need none."""
    position = header.column("position")
    if position is not None and np.any(np.diff(columns[position.name]) == 0):
        raise InputError(
            f"{header.samples}: no column is the time, and rows follow each other in one position; name the clock in "
            f"{header.path.name}, or give --set rate=HZ"
        )


def _clock(header: Header, clock: Column, values: Array, dates: Dates) -> Array:
    """Return the time column in its unit: numbers, or text that is dates of ISO 8601."""
    if np.issubdtype(values.dtype, np.number):
        if clock.dated:
            raise InputError(
                f"{header.samples}, column {clock.name}: the column holds numbers, not dates of ISO 8601 as the header "
                'says; write their unit, as in unit = "s"'
            )
        return _numbers(header, clock.name, values)
    import polars as pl

    try:
        return from_si(dates.seconds(pl.Series([str(v) for v in values])), clock.unit)
    except NoDateError as problem:
        row = f"{header.samples}, row {problem.row + 1}, column {clock.name}"
        raise InputError(f"{row}: {problem}; correct it") from None


def _numbers(header: Header, name: str, values: Array) -> Array:
    if np.iscomplexobj(values) or not np.issubdtype(values.dtype, np.number):
        raise InputError(f"{header.samples}: {name} holds {values.dtype} where real numbers are wanted")
    return np.ascontiguousarray(values, dtype=np.float64)


def component(name: str, value: Array, path: Path) -> Array:
    """Return ``acc[0]`` of an (n, 3) or (3, n) array `value` called ``acc``; a vector needs no index."""
    index = re.search(r"\[(\d+)\]$", name)
    value = np.squeeze(np.asarray(value))
    if value.ndim <= 1 and not index:
        return np.atleast_1d(value)
    if value.ndim == 2 and index:
        rows = value if value.shape[0] >= value.shape[1] else value.T
        if int(index[1]) < rows.shape[1]:
            return np.asarray(rows[:, int(index[1])])
    raise InputError(
        f"{path}: {name} does not name one column of an array of shape {value.shape}; write {without_index(name)}[0], "
        f"{without_index(name)}[1], ... for the columns of a matrix, and no index for a vector"
    )


def without_index(name: str) -> str:
    """Return `name` without its index."""
    return re.sub(r"\[\d+\]$", "", name)
