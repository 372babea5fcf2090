"""Logs that are no text: arrays in MATLAB, HDF5, NumPy, Parquet and JSON files, and records of doubles.

What a file is follows from its first bytes, not from its name. A matrix is one column for each of its components.
"""

from __future__ import annotations

import contextlib
import json
import re
import zipfile
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from gimbalcal.errors import InputError
from gimbalcal.guess.clocks import MIN_GROWING
from gimbalcal.guess.column_names import plain_name, quantity_of_log
from gimbalcal.guess.message_log import leaves_of_object, object_in
from gimbalcal.guess.text_table import MIN_COLUMNS, Table, table_of_columns, values_of
from gimbalcal.importers.hdf5 import dataset_names, read_dataset
from gimbalcal.importers.registry import DAMAGED
from gimbalcal.importers.sandboxed_reader import matlab_variables
from gimbalcal.importers.text_file import encoding_of
from gimbalcal.number import Array, holds_real_numbers
from gimbalcal.recording.dates import Dates
from gimbalcal.recording.memory_limit import refuse_packed_bomb
from gimbalcal.recording.record import FORCE
from gimbalcal.recording.samples import redirect_messages

_STAMPED = re.compile(rb"\s*\[[^\[\]{}\"\n]*\][ \t]*[^\s,\]]")  # a line of a log behind its stamp, [1530 ms] acc: 0.1
START = 4096  # bytes that show what a file is
_CONTROL = re.compile(rb"[^\t\n\f\r -~\x80-\xff]")  # bytes that no text holds
MIN_ROWS = 3
MAX_SKEW = 1e-3  # of a rotation matrix as it is written, from an orthogonal one
MAX_DOUBLE = 1e15  # in a record of doubles; beyond, the bytes are of other types
MAX_RECORD = 32  # numbers of a binary record
RATE_NAMES = frozenset(("sampling_rate", "sample_rate", "samplingrate", "fs", "freq", "frequency", "rate"))
INSTEAD = {
    b"PK\x03\x04": "a spreadsheet or an archive; save its table as CSV, or unpack it",
    b"\xd0\xcf\x11\xe0": "a spreadsheet of Excel; save its table as CSV",
    b"\x1f\x8b": "compressed by gzip; unpack it",
    b"BZh": "compressed by bzip2; unpack it",
    b"\xfd7zXZ": "compressed by xz; unpack it",
    b"%PDF": "a PDF document; give the log from which it was made",
    b"#ROSBAG": "a bag of ROS; write the topic of the unit as CSV (rostopic echo -p)",
    b"ULog": "a log of PX4; write it as CSV (ulog2csv)",
    b"\xa3\x95": "a log of ArduPilot; write it as text (mavlogdump.py --format csv)",
    b"SQLite": "a database of SQLite; write its table as CSV",
}


def arrays_tables(path: Path) -> dict[Path, Table]:
    """Return the columns of a file that is no text, or of each part of a run in it by path and name; none of a text.

    Raises InputError for one that holds no table, or in a form that only another program reads, with what to do.
    """
    with path.open("rb") as file:
        start = file.read(START)
    read = _reader(path, start)
    if read is not None:
        return {each: _table(each, variables) for each, variables in _parts(path, read(path)).items()}
    instead = next((words for magic, words in INSTEAD.items() if start.startswith(magic)), "")
    if instead:
        raise InputError(f"{path} is {instead}")
    if is_text(path):
        return {}
    if (records := _records(path)) is not None:
        return {path: frame_table(records, str(path))}
    raise InputError(
        f"{path} is a binary file of no known kind; save the log as text, one row in a line with names above"
    )


def is_text(path: Path) -> bool:
    """Return whether a file is text, of UTF-16 or of an encoding without zero bytes.

    A logger that is switched on, or loses its power, leaves runs of zero bytes; what remains has no control characters.
    """
    with path.open("rb") as file:
        start = file.read(START)
    if start.startswith((b"\xff\xfe", b"\xfe\xff")) or b"\0" not in start:
        return True
    left = start.replace(b"\0", b"")
    return b"\0\0" in start and len(left) > len(start) / 2 and not _CONTROL.search(left)


def frame_table(frame: Any, called: str = "the frame") -> Table:
    """Return the columns of a frame or a mapping as those of a text table; an index of dates is a clock."""
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

    rates = [n for n, x in columns.items() if x.ndim == 0 and plain_name(n.rpartition(".")[2]) in RATE_NAMES]
    above = tuple(f"sample rate {float(columns[n])!r}" for n in rates)
    table = table_of_columns((name, *values(name, x)) for name, x in columns.items() if x.ndim)
    if len(table.columns) < MIN_COLUMNS:
        raise InputError(f"{called} holds {len(table.columns)} columns of numbers, and a triad and its clock take more")
    named = not all(name.isdigit() for name in table.columns)
    return Table(table.columns, table.sexagesimal, above, table.others, table.dates, dates.day, named)


def _reader(path: Path, start: bytes) -> Callable[[Path], Mapping[str, Any]] | None:
    """Return the function that reads a file beginning so; None where there is none."""
    if b"\x89HDF\r\n\x1a\n" in (start[:8], start[512:520]):  # MATLAB puts 512 bytes of its own before it
        return lambda p: {name: read_dataset(p, name) for name in dataset_names(p)}
    if start.startswith(b"MATLAB 5.0 MAT-file"):
        return matlab_variables
    if start.startswith(b"\x93NUMPY") or (start.startswith(b"PK\x03\x04") and _holds_arrays(path)):
        return _numpy
    if start.startswith(b"PAR1"):
        return _parquet
    like_json = start.lstrip()[:1] in (b"{", b"[") and not _json_lines(start) and not _STAMPED.match(start)
    return _json if like_json else None


def _holds_arrays(path: Path) -> bool:
    try:
        with zipfile.ZipFile(path) as archive:
            return any(name.endswith(".npy") for name in archive.namelist())
    except DAMAGED:
        return False


def _json_lines(start: bytes) -> bool:
    """Return whether the first line is an object by itself, as in a log of one object to a line."""
    first, line_end, rest = start.strip().partition(b"\n")
    return bool(line_end and rest and object_in(first.decode(errors="replace")))


def _numpy(path: Path) -> Mapping[str, Any]:
    try:
        if zipfile.is_zipfile(path):
            refuse_packed_bomb(path)
        loaded = np.load(path)
        if isinstance(loaded, np.ndarray):
            names = loaded.dtype.names
            return {n: loaded[n] for n in names} if names else {path.stem: loaded}
        return {name: loaded[name] for name in loaded.files}
    except InputError:
        raise
    except DAMAGED:
        raise InputError(f"{path} is damaged, or holds Python objects; save its arrays again") from None


def _parquet(path: Path) -> Mapping[str, Any]:
    import polars as pl

    try:
        with redirect_messages():  # the engine prints a panic of its own to stderr
            frame = pl.read_parquet(path.absolute(), glob=False)
    except (pl.exceptions.PolarsError, pl.exceptions.PanicException, OSError) as error:
        raise InputError(f"{path} cannot be read as Parquet: {str(error).splitlines()[0]}") from None
    return {name: frame[name].to_numpy() for name in frame.columns}


def _json(path: Path) -> Mapping[str, Any]:
    """Return the columns of an object of lists, or of a list of objects, the longest that the file holds."""
    try:
        pending, best = [json.loads(path.read_text(encoding=encoding_of(path)))], dict[str, Any]()
    except (ValueError, RecursionError):
        raise InputError(f"{path} begins like JSON and is none; correct it, or save the log as CSV") from None
    size = 0
    while pending:
        each = pending.pop()
        if isinstance(each, list) and len(each) > size and all(isinstance(row, dict) for row in each):
            rows = [{n: np.nan if x is None else x for n, x in leaves_of_object(row)} for row in each]
            best, size = {n: np.array([row.get(n, np.nan) for row in rows]) for n in rows[0]}, len(each)
        elif isinstance(each, list):
            pending += [inner for inner in each if isinstance(inner, list | dict)]
        elif isinstance(each, dict):
            lists = {n: x for n, x in each.items() if isinstance(x, list) and x and not isinstance(x[0], dict)}
            longest = max(map(len, lists.values()), default=0)
            if longest > size:
                with contextlib.suppress(ValueError):
                    best, size = {n: np.array(x) for n, x in lists.items()}, longest
            pending += each.values()
    return best


def _parts(path: Path, variables: Mapping[str, Any]) -> dict[Path, Mapping[str, Any]]:
    """Return the variables of each part of a run by path and name: arrays of one triad each, and one has other rows.

    Arrays of as many rows each may be several triads at once, and all variables stay together.
    """
    tall = {name: _rows_before_components(x) for name, x in variables.items() if x is not None and np.ndim(x)}
    triads = {name: x for name, x in tall.items() if x.ndim == 2 and x.shape[1] == 3 and len(x) >= MIN_ROWS}
    quantities = {quantity_of_log(name) for name in triads}
    if len(triads) < len(tall) or len(quantities) > 1 or "" in quantities or len({*map(len, triads.values())}) < 2:
        return {path: variables}
    (quantity,) = quantities
    common = {name: x for name, x in variables.items() if name not in triads}
    return {path / name: {**common, quantity: x} for name, x in triads.items()}


def _as_quaternions(x: Array) -> Array:
    """Return rotation matrices, of which the rows of the log are the first axis or the last, as w, x, y, z; else x."""
    rows_last = x.ndim == 3 and x.shape[:2] == (3, 3) != x.shape[1:]
    C = np.moveaxis(x, 2, 0) if rows_last else x
    if C.shape[1:] != (3, 3) or not holds_real_numbers(C):
        return x
    whole = np.all(np.isfinite(C), axis=(1, 2))
    if not whole.any() or np.abs(C[whole] @ np.swapaxes(C[whole], 1, 2) - np.eye(3)).max() > MAX_SKEW:
        return x
    from scipy.spatial.transform import Rotation

    q = np.full((len(C), 4), np.nan)
    q[whole] = Rotation.from_matrix(C[whole]).as_quat(scalar_first=True)
    return q


def _rows_before_components(x: Any) -> Array:
    """Return an array with a row for each reading, of which there are more than components."""
    x = np.squeeze(np.asarray(x))
    return x.T if x.ndim == 2 and x.shape[0] < x.shape[1] else x


def _table(path: Path, variables: Mapping[str, Any]) -> Table:
    columns, others = _columns(path, variables)
    table = frame_table(columns, str(path))
    return replace(table, others=(*table.others, *others))


def _columns(path: Path, variables: Mapping[str, Any]) -> tuple[dict[str, Any], tuple[str, ...]]:
    """Return vectors and components of matrices of one length, that of most sensors and numbers, by name, and scalars.

    A component that grows before the others is their clock. Three others are x, y, z, four of them w, x, y, z; a
    matrix that alone makes the table has columns by number.
    And the names of what has rows too, but another number of them.
    """
    arrays = {name: _as_quaternions(np.squeeze(np.asarray(x))) for name, x in variables.items() if x is not None}
    tall = {name: _rows_before_components(x) for name, x in arrays.items() if x.ndim in (1, 2)}
    width, sensors = Counter[int](), Counter[int]()
    for name, x in tall.items():
        width[len(x)] += 1 if x.ndim == 1 else x.shape[1]
        sensors[len(x)] += bool(quantity_of_log(name))
    enough = [n for n in width if n >= MIN_ROWS]
    rows = max(enough, key=lambda n: (width[n] >= MIN_COLUMNS, sensors[n], n * width[n]), default=0)
    if not rows:
        listed = ", ".join(f"{name} {np.shape(x)}" for name, x in list(arrays.items())[:8]) or "nothing"
        raise InputError(f"{path} holds no array with a row for each reading; it has {listed}")
    out: dict[str, Any] = {name: x for name, x in arrays.items() if x.ndim == 0 and x.dtype.kind in "iuf"}
    kept = {name: x for name, x in tall.items() if len(x) == rows}
    for name, x in kept.items():
        if x.ndim == 2 and x.shape[1] in (2, 4, 5) and np.all(np.diff(x[:, 0]) > 0):
            out[f"{name}_time"], kept[name] = x[:, 0], np.squeeze(x[:, 1:])
    for name, x in kept.items():
        letters = {3: "xyz", 4: "wxyz"}.get(x.shape[1], "") if x.ndim == 2 else ""
        if x.ndim == 1:
            out[name] = x
        elif not letters and len(kept) == 1:
            out |= {str(i): column for i, column in enumerate(x.T, start=1)}
        else:
            hint = quantity_of_log(name)
            word = f"{name} {'acc' if hint == FORCE else 'gyro'}" if hint and len(letters) == 3 else name
            out |= {f"{word}_{letters[i] if letters else i + 1}": column for i, column in enumerate(x.T)}
    return out, tuple(f"{name} of {len(x)} rows" for name, x in tall.items() if MIN_ROWS <= len(x) != rows)


def _records(path: Path) -> dict[str, Array] | None:
    """Return the columns of a file of records of doubles, little-endian, one of which grows evenly; else None.

    A field that is never filled is left out.
    """
    size = path.stat().st_size
    values = np.fromfile(path, "<f8") if size % 8 == 0 else np.zeros(0)
    sound = np.abs(values) < MAX_DOUBLE  # neither of NaN nor of infinity
    for width in range(MIN_COLUMNS, MAX_RECORD + 1):
        if len(values) % width or len(values) < MIN_ROWS * width:
            continue
        number = np.count_nonzero(sound.reshape(-1, width), axis=0)
        rows = values.reshape(-1, width)[:, number > 0]
        if rows.shape[1] < MIN_COLUMNS or np.any(number[number > 0] < len(rows)):
            continue
        for x in rows[:100_000].T:
            step = np.diff(x)
            if np.mean(step > 0) > MIN_GROWING and np.quantile(step, 0.9) < 2 * np.median(step):
                return {str(i): column for i, column in enumerate(rows.T, start=1)}
    return None
