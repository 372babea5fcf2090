"""A recording from arrays or from a data frame (pandas, polars, a dictionary), with the checks that a file passes."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from gimbalcal.errors import InputError
from gimbalcal.number import Array
from gimbalcal.platform import BENCH, Platform
from gimbalcal.quantities import QUANTITIES
from gimbalcal.recording.columns import COUNTED, ROW_STEP_S, UNITLESS, Column, columns_of
from gimbalcal.recording.dates import Dates, NoDateError
from gimbalcal.recording.document import Document
from gimbalcal.recording.header import Header, header_of
from gimbalcal.recording.reading import assemble_recording, with_dates
from gimbalcal.recording.record import Recording, Source
from gimbalcal.units import from_si

TRIADS = ("specific_force", "angular_rate", "velocity_increment", "angle_increment")
SHORT = re.compile(r"\s*(?P<quantity>\w+)\s*(?P<axis>\w+)?\s*(\[(?P<unit>[^\]]+)\])?\s*")
Entry = str | Mapping[str, Any]
Rig = Entry | Platform


def from_frame(
    frame: Any, columns: Mapping[str, Entry], *, kind: str = "multi-position", platform: Rig = "bench",
    title: str = "arrays", site: Mapping[str, tuple[float, str]] | None = None,
    noise: Mapping[str, tuple[float, str]] | None = None, instant: bool = False, average_s: float | None = None,
    called: str = "arrays", date: str = "",
) -> Recording:  # fmt: skip
    """Return a recording whose rows are those of a data frame, or of any mapping of names to columns.

    columns: for each name what it holds, ``"specific_force x [g]"``, ``"time [s]"``, ``"position"`` (without a unit:
    SI), or as a table of recording.toml, ``{"quantity": "time", "unit": "s"}``. site and noise: numbers with their
    units, ``{"latitude": (40.0, "deg")}``, ``{"accelerometer": (20.0, "ug")}``. platform: a name, axes as in a
    recording.toml, ``{"axes": [{"name": "roll", "direction": "x"}]}``, or a `Platform`. `average_s` as in `read`.
    Dates of a time column count as seconds from midnight of the first. called: how sentences name the rows. date: when
    it was recorded, ISO 8601, for a unit's history. Raises InputError with the row and the column of what is wrong.
    """
    own, platform = (platform, "bench") if isinstance(platform, Platform) else (None, platform)
    content: dict[str, Any] = {
        "format": 1, "kind": kind, "title": title, "date": date,
        "platform": {"name": platform} if isinstance(platform, str) else dict(platform),
        "site": {key: _stated_unit(key, entry) for key, entry in (site or {}).items()},
        "noise": {key: _stated_unit(key, entry) for key, entry in (noise or {}).items()},
        "columns": {name: _entry(name, entry) for name, entry in columns.items()},
        **({"samples": {"rates": "instant"}} if instant else {}),
    }  # fmt: skip
    header = header_of(content, Path(called), own)
    _refuse_missing(frame, columns)
    digest = hashlib.sha256()
    for name in columns:
        values = np.ascontiguousarray(frame[name])
        digest.update(name.encode())
        digest.update(values.tobytes() if values.dtype == object else values.view(np.uint8).data)
    return recording_of(header, frame.__getitem__, average_s=average_s, sources=(Source(called, digest.hexdigest()),))


def described_columns(frame: Any, columns: Mapping[str, Entry]) -> dict[str, Column]:
    """Return the described columns of a data frame by name, a clock not being required. Raises InputError as above."""
    _refuse_missing(frame, columns)
    content = {"columns": {name: _entry(name, entry) for name, entry in columns.items()}}
    known = columns_of(Document.of(content, Path("columns")), BENCH, clock_needed=False)
    return {c.name: c for c in known if c is not COUNTED}


def _refuse_missing(frame: Any, columns: Mapping[str, Entry]) -> None:
    missing = [name for name in columns if name not in _column_names(frame)]
    if missing:
        raise InputError(f"the frame has no column {missing[0]!r}; it has {', '.join(map(str, _column_names(frame)))}")


def from_arrays(
    time: ArrayLike, *, units: Mapping[str, str] | None = None, kind: str = "multi-position", platform: Rig = "bench",
    title: str = "arrays", site: Mapping[str, tuple[float, str]] | None = None,
    noise: Mapping[str, tuple[float, str]] | None = None, instant: bool = False, average_s: float | None = None,
    date: str = "", **quantities: Any,
) -> Recording:  # fmt: skip
    """Return a recording from arrays: time (n,) and quantities by their names in recording.toml.

    Triads (specific_force, angular_rate, ...) are (n, 3) for x, y, z; quantities of axes (gimbal_angle, covariate) are
    mappings from axis to (n,); others (temperature, position, weight) are (n,). units: by quantity, SI where absent,
    ``{"specific_force": "g", "angular_rate": "deg/s"}``. The rest is as in `from_frame`.
    """
    frame: dict[str, Any] = {"time": time}
    entries: dict[str, Entry] = {"time": _table("time", "", units)}
    for quantity, values in quantities.items():
        for axis, column in by_axis(quantity, values):
            name = f"{quantity}_{axis}".rstrip("_")
            frame[name], entries[name] = column, _table(quantity, axis, units)
    unknown = set(units or {}) - {"time", *quantities}
    if unknown:
        raise InputError(f"units names {min(unknown)!r}, and there is no such array")
    return from_frame(
        frame, entries, kind=kind, platform=platform, title=title, site=site, noise=noise, instant=instant,
        average_s=average_s, date=date,
    )  # fmt: skip


def by_axis(quantity: str, values: Any, rows: str = "n") -> Iterator[tuple[str, Any]]:
    """Yield axis and column (n,) of each channel of a quantity: a triad (n, 3), a mapping from axis, or (n,).

    Raises InputError for another shape; `rows` is n as the sentence says it.
    """
    if isinstance(values, Mapping):
        yield from values.items()
        return
    x = np.asarray(values)
    if quantity in TRIADS:
        if x.ndim != 2 or x.shape[1] != 3:
            raise InputError(f"{quantity} must be ({rows}, 3), one column for each of x, y and z, got {x.shape}")
        yield from zip("xyz", x.T, strict=True)
    elif x.ndim == 1:
        yield "", x
    else:
        raise InputError(f"{quantity} must be ({rows},), or a mapping from axis to ({rows},), got {x.shape}")


def _table(quantity: str, axis: str, units: Mapping[str, str] | None) -> dict[str, str]:
    known = QUANTITIES.get(quantity)
    unit = (units or {}).get(quantity, known.si if known else "1")
    bare = {"quantity": quantity, **({"axis": axis} if axis else {})}
    return bare if quantity in UNITLESS else {**bare, "unit": unit}


def _entry(name: str, entry: Entry) -> dict[str, Any]:
    if not isinstance(entry, str):
        return dict(entry)
    match = SHORT.fullmatch(entry)
    if not match:
        raise InputError(f"column {name!r} is {entry!r}; write quantity, axis and unit, as in 'specific_force x [g]'")
    units = {match["quantity"]: match["unit"]} if match["unit"] else None
    return _table(match["quantity"], match["axis"] or "", units)


def _stated_unit(key: str, entry: Any) -> dict[str, Any]:
    try:
        value, unit = entry
    except (TypeError, ValueError):
        raise InputError(f"{key} needs a number and its unit, as in ({entry!r}, 'deg')") from None
    return {"value": value.item() if isinstance(value, np.number) else value, "unit": unit}


def _column_names(frame: Any) -> Sequence[Any]:
    return list(frame.keys() if isinstance(frame, Mapping) else frame.columns)


def recording_of(
    header: Header,
    values: Callable[[str], Any],
    rate: float = 0.0,
    average_s: float | None = None,
    sources: tuple[Source, ...] | None = None,
) -> Recording:
    """Return the recording whose columns `values` gives by name, checked as those of a file.

    With a rate [Hz] the clock is made from the number of the row; without one rows that need no clock are counted.
    `sources`: what the columns came from, if not from the files of the header.
    """
    dates, clock = Dates(), header.column("time")
    logged = [c for c in header.columns if c is not COUNTED and not (rate and c is clock)]
    columns = {c.name: column_values(str(header.samples), c, np.asarray(values(c.name)), dates) for c in logged}
    sizes = {name: len(x) for name, x in columns.items()}
    if len(set(sizes.values())) > 1:
        listed = ", ".join(f"{name} {n}" for name, n in sizes.items())
        raise InputError(f"{header.samples}: the columns differ in length ({listed}); they must have one value per row")
    rows, remarks = next(iter(sizes.values()), 0), tuple[str, ...]()
    if clock and clock not in logged:
        if not rate:
            _refuse_samples(header, columns)
            spaced = f"its rows are taken in order, {ROW_STEP_S:g} s each, so that rates mean nothing"
            remarks = (f"{header.samples} has no clock: {spaced}",)
        columns[clock.name] = from_si(
            np.arange(float(rows)) / rate if rate else ROW_STEP_S * np.arange(float(rows)), clock.unit
        )
    recording = assemble_recording(header, [columns] if rows else [], columns.__getitem__, average_s, sources)
    return with_dates(replace(recording, remarks=(*recording.remarks, *remarks)), header, dates)


def _refuse_samples(header: Header, columns: Mapping[str, Array]) -> None:
    """Raise InputError where several rows in a row are of one position: samples have a rate, means need none."""
    position = header.column("position")
    if position is not None and np.any(np.diff(columns[position.name]) == 0):
        raise InputError(
            f"{header.samples}: no column is the time, and rows follow each other in one position; name the clock in "
            f"{header.path.name}, or give --set rate=HZ"
        )


def column_values(samples: str, column: Column, x: Array, dates: Dates) -> Array:
    """Return a column as float64, read-only as it may be the user's; dates of a clock as seconds in its unit.

    Raises InputError for what is neither, and for a clock of numbers where the header says dates.
    """
    where = f"{samples}, column {column.name}"
    if column.quantity == "time" and x.dtype.kind in "MOU" and len(x):
        import polars as pl

        try:
            return from_si(dates.seconds(pl.Series(x.astype(str))), column.unit)
        except NoDateError as problem:
            row = f"{samples}, row {problem.row + 1}, column {column.name}"
            raise InputError(f"{row}: {problem}; correct it") from None
    if column.dated and len(x):
        raise InputError(
            f"{where}: the column holds numbers, not dates of ISO 8601 as the header says; write their unit, as in "
            'unit = "s"'
        )
    try:
        values = np.asarray(x if np.isrealobj(x) else str(x.dtype), dtype=np.float64).view()
    except (TypeError, ValueError):
        raise InputError(f"{where} holds {x.dtype} where real numbers are wanted") from None
    values.flags.writeable = False
    return values
