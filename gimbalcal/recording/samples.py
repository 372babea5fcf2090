"""The rows of a recording, streamed from CSV or Parquet in batches, and the place of a row as the user sees it."""

from __future__ import annotations

import csv
import os
import re
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gimbalcal.errors import InputError, alternatives, amount
from gimbalcal.number import Array
from gimbalcal.recording.columns import Column
from gimbalcal.recording.dates import Dates, NoDateError, is_date
from gimbalcal.recording.document import shortened
from gimbalcal.recording.room import refuse_bomb
from gimbalcal.units import from_si

if TYPE_CHECKING:
    import polars as pl

MOST_NAMES = 20  # shown of a file that has other columns than it should

Batch = Mapping[str, Array]

ROWS = 50_000
"""Rows of one batch: ten columns are 4 MB, so that a pass over them stays in the cache."""

AFTERWARDS = 0.2  # s in which threads of an engine that panicked say so, one after the other
EMPTY = ("NA", "N/A", "n/a", "null", "NULL", "None", "nan", "NaN", "NAN")
"""What programs write where they have no value."""


def batches(
    path: Path, names: Sequence[str], clock: Column | None = None, dates: Dates | None = None
) -> Iterator[Batch]:
    """The columns `names` of the samples file, as float64 arrays of some `ROWS` rows, in the order of the file.

    An empty cell is a NaN. A `clock` of dates becomes seconds, in its unit, counted by `dates`. Names that are all
    whole numbers count columns from 1 where the file has no line of names (or other names). Whatever the file cannot
    be read for is an `InputError` that names the line.
    """
    import polars as pl

    dates, rows, plain = dates or Dates(), 0, list(names)
    try:
        _check_bytes(path)
        named, lazy = has_names(path, names), _scan(path, names)
        with quiet():
            present = lazy.collect_schema()
        _check_names(path, names, present)
        dated = clock is not None and clock.name in names and _dated(path, clock, present[clock.name], named)
        plain = [name for name in names if not (dated and clock and name == clock.name)]
        _check_types(path, plain, present)
        columns = [_numbers(name, present[name], path) if name in plain else pl.col(name) for name in names]
        frames = lazy.select(columns).collect_batches(chunk_size=ROWS, maintain_order=True)
        while (frame := _next(frames, path, rows)) is not None:
            batch = _without_blank_end(frame)
            if dated and clock:
                seconds = dates.seconds(frame[clock.name][: len(batch[names[0]])])
                batch = {**batch, clock.name: from_si(seconds, clock.unit)}
            rows += frame.height
            if len(batch[names[0]]):
                yield batch
    except NoDateError as problem:
        where = place(path, rows + problem.row, named=named)
        raise InputError(f"{where}, column {clock.name if clock else ''}: {problem}; correct it") from None
    except pl.exceptions.NoDataError:
        raise InputError(f"{path} is empty; it must hold a line of column names and the rows") from None
    except (pl.exceptions.PolarsError, pl.exceptions.PanicException, OSError) as error:
        raise _explained(path, plain, error) from None


def _next(frames: Iterator[pl.DataFrame], path: Path, rows: int) -> pl.DataFrame | None:
    """The next of the frames after these rows. What the engine prints of a panic of its own goes nowhere: the user has

    a sentence. An engine that panics at a damaged page ends the rows there and raises nothing; a file of Parquet says
    how many it has.
    """
    import polars as pl

    with quiet():
        frame = next(frames, None)
        if frame is not None or path.suffix != ".parquet":
            return frame
        told = pl.scan_parquet(path.absolute(), glob=False).select(pl.len()).collect().item()
        if rows == told:
            return None
        time.sleep(AFTERWARDS)
    raise InputError(
        f"{path} says that it has {amount(told, 'row')} and {rows} can be read: it seems to be cut short or damaged; "
        "copy it again"
    )


@contextmanager
def quiet() -> Iterator[None]:
    """Nothing that compiled code writes to stderr is seen."""
    sys.stderr.flush()
    kept, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)


def column(path: Path, name: str, clock: Column | None = None) -> Array:
    """One whole column."""
    parts = [batch[name] for batch in batches(path, [name], clock if clock and name == clock.name else None)]
    at = sum(map(len, parts))
    out = np.empty(at)
    while parts:  # each is let go of once it is there: of 1e8 rows there are 0.8 GB, not twice as much
        part = parts.pop()
        out[at - len(part) : at] = part
        at -= len(part)
    return out


def has_names(path: Path, names: Sequence[str]) -> bool:
    """Whether a text file begins with a line of names: always, but where it begins with numbers and the columns are

    numbered, or named by the last comment above. A first line 0, 1, 2, ... or 1, 2, 3, ... is names, made up.
    """
    return path.suffix == ".parquet" or heading(path, names)[0]


def heading(path: Path, names: Sequence[str]) -> tuple[bool, list[str]]:
    """Whether the first line without ``#`` names the columns of a CSV, and what they are called."""
    first = [cell.strip() for cell in next((cells for _, cells in _lines(path)), [])]
    counted = [str(i) for i in range(1, len(first) + 1)]
    made_up = len(first) > 1 and first in (counted, [str(i) for i in range(len(first))])
    numbers = bool(first) and not made_up and all(_is_number(cell) or is_date(cell) for cell in first)
    if numbered(names):
        return not numbers, first if not numbers and set(names) <= set(first) else counted
    above = [] if set(names) <= set(first) else names_above(path, len(first))
    return (False, above) if names and set(names) <= set(above) else (True, first)


def names_above(path: Path, columns: int, skip: int = 0) -> list[str]:
    """The words of the last comment above the rows, if there is one for each column: many logs name them there."""
    last = ""
    with path.open(encoding="utf-8-sig", errors="replace") as file:
        for i, line in enumerate(file):
            if i >= skip and not line.startswith("#"):
                break
            last = line if i >= skip else ""
    words = [word for word in re.split(r"[\s,;]+", last.lstrip("# ").strip()) if word]
    return words if len(words) == columns else []


def numbered(names: Sequence[str]) -> bool:
    """Whether columns are called by number, counted from 1, not by name."""
    return bool(names) and all(re.fullmatch(r"[1-9]\d{0,3}", name) for name in names)


def _scan(path: Path, names: Sequence[str]) -> pl.LazyFrame:
    """The file, less the blanks around its names; columns that are called by number get their number for a name."""
    import polars as pl

    if path.suffix == ".parquet":
        lazy = pl.scan_parquet(path.absolute(), glob=False)
        with quiet():
            rows = lazy.select(pl.len()).collect().item()
        refuse_bomb(path, 8 * rows * len(names), streamed=True)
        return lazy
    if path.stat().st_size == 0:
        raise pl.exceptions.NoDataError
    # Every dtype is given: a guess from the first rows fails at the first 0.5 below a column of integers.
    head, (named, present) = (
        [cells for _, (_, cells) in zip(range(3), _lines(path), strict=False)],
        heading(path, names),
    )
    text = any(cell != cell.strip() or is_date(cell) for cells in head[named:] for cell in cells)
    there = (
        pl.scan_csv(path.absolute(), comment_prefix="#", infer_schema=False, has_header=named, glob=False)
        .collect_schema()
        .names()
    )
    if len(set(present)) < len(there) or len(present) != len(there):
        present = there
    types = {
        old: pl.Float64 if name in names and not text else pl.String for old, name in zip(there, present, strict=True)
    }
    lazy = pl.scan_csv(
        path.absolute(), comment_prefix="#", schema=types, null_values=list(EMPTY), has_header=named, glob=False
    )
    changed = {old: name for old, name in zip(there, present, strict=True) if old != name}
    return lazy.rename(changed) if changed else lazy


def _numbers(name: str, kind: pl.DataType, path: Path) -> pl.Expr:
    import polars as pl

    each = pl.col(name)
    if kind == pl.String and path.suffix != ".parquet":
        each = each.str.strip_chars()
        each = pl.when(each.is_in(["", *EMPTY])).then(None).otherwise(each)
    return each.cast(pl.Float64).alias(name)


def _dated(path: Path, clock: Column, kind: pl.DataType, named: bool) -> bool:
    """Whether the clock holds dates; `InputError` where it holds numbers and the header says dates."""
    import polars as pl

    first = ""
    if path.suffix == ".parquet" and kind == pl.String:
        head = pl.scan_parquet(path.absolute(), glob=False).select(clock.name).head(1).collect()
        first = str(head.item()) if head.height else ""
    elif path.suffix != ".parquet":
        present = heading(path, [clock.name])[1]
        at = present.index(clock.name) if clock.name in present else 0
        first = next((c[at] for i, (_, c) in enumerate(_lines(path)) if i >= named and len(c) > at), "")
    dated = kind.is_temporal() or is_date(first)
    if clock.dated and first and not dated:
        raise InputError(
            f"{place(path, 0, named=named)}, column {clock.name}: {shortened(first)!r} is not a date and time of "
            'ISO 8601, as [columns] says; correct it, or write the unit of the numbers, as in unit = "s"'
        )
    return dated


def _check_names(path: Path, names: Sequence[str], present: Mapping[str, pl.DataType]) -> None:
    missing = [name for name in names if name not in present]
    if not missing:
        return
    first = next(iter(present), "")
    other = next((mark for mark in ";\t| " if len(present) == 1 and mark in first.strip()), None)
    if other:
        raise InputError(
            f"{path}, line {_heading(path)}: separate its columns by commas, not {other!r}, and write decimal points"
        )
    if all(_is_number(name.partition("_duplicated_")[0]) for name in present):
        raise InputError(
            f"{path}, line {_heading(path)}: numbers stand where the column names belong; put them above, or call the "
            'columns by number in [columns], as in 1 = { quantity = "time", unit = "s" }'
        )
    hint = "correct the name on one side"
    if any("\ufffd" in name for name in present):
        hint = "the names are not text in UTF-8, save the file as UTF-8"
    has = [repr(shortened(name)) for name in present]
    more = f" and {len(has) - MOST_NAMES} more" if len(has) > MOST_NAMES else ""
    raise InputError(
        f"{path} has no column {alternatives([repr(name) for name in missing])}, which [columns] of recording.toml "
        f"names; it has {', '.join(has[:MOST_NAMES])}{more}; {hint}"
    )


def _check_types(path: Path, names: Sequence[str], present: Mapping[str, pl.DataType]) -> None:
    """Every column is numbers, or text that may be numbers, and has its name for itself."""
    import polars as pl

    for name in names:
        if f"{name}_duplicated_0" in present and path.suffix == ".csv":
            raise InputError(
                f"{path}, line {_heading(path)}: two columns are called {name!r}; rename the one that is not meant"
            )
        kind = present[name]
        if not (kind.is_numeric() or kind in (pl.String, pl.Null)):
            clock = "; write seconds from the start of the recording" if kind.is_temporal() else "; write numbers"
            raise InputError(f"{path}, column {name}: the column holds {kind} values, not numbers{clock}")


def _check_bytes(path: Path) -> None:
    """What a CSV file begins with is text in UTF-8, in lines."""
    if path.suffix != ".csv":
        return
    with path.open("rb") as file:
        start = file.read(4096)
    if start.startswith(b"PAR1"):
        raise InputError(f"{path} is a Parquet file; call it samples.parquet, here and in recording.toml")
    if start.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise InputError(f"{path} is text in UTF-16; save it as UTF-8")
    if b"\0" in start:
        raise InputError(f"{path} is no text file (byte {start.index(0)} is a zero); write the rows as CSV in UTF-8")
    if b"\r" in start and b"\n" not in start:
        raise InputError(f"{path} ends its lines with a bare carriage return; save it with line feeds")


def _heading(path: Path) -> int:
    """The line with the column names."""
    return next((line for line, _ in _lines(path)), 1)


def _without_blank_end(frame: pl.DataFrame) -> Batch:
    """The arrays of `frame` less blank lines at its end, which editors like to leave there."""
    n = frame.height
    while n and all(value is None for value in frame.row(n - 1)):
        n -= 1
    return {name: frame[name][:n].to_numpy() for name in frame.columns}


def _explained(path: Path, names: Sequence[str], error: BaseException) -> InputError:
    if path.suffix == ".parquet":
        reason = shortened(str(error).splitlines()[0].removeprefix("parquet: "), 150)
        text = re.search(r"conversion from `str`.* in column '(.*?)'.*?\[(\".*?\")", reason)
        if text:
            return InputError(f"{path}, column {text[1]}: {text[2]} is not a number; write the column as numbers")
        return InputError(
            f"{path} cannot be read as Parquet, it seems to be cut short or damaged ({reason}); copy it again"
        )
    reason = shortened(str(error).splitlines()[0], 150)
    return _first_bad_line(path, names) or InputError(
        f"{path} cannot be read as CSV ({reason}); write lines of numbers with commas between them"
    )


def _first_bad_line(path: Path, names: Sequence[str]) -> InputError | None:
    named, header = heading(path, names)
    for row, (line, cells) in enumerate(_lines(path)):
        odd = next((cell for cell in cells if "\ufffd" in cell), None)
        if odd is not None:
            return InputError(f"{path}, line {line}: {shortened(odd)!r} is not text in UTF-8; save the file as UTF-8")
        if named and row == 0:
            continue
        if len(cells) > len(header):
            return InputError(
                f"{path}, line {line}: {amount(len(cells), 'value')} where the first line names "
                f"{amount(len(header), 'column')}; remove what is too much, and write decimal points, not commas"
            )
        for name, cell in zip(header, cells, strict=False):
            if name in names and not _is_number(cell):
                return InputError(
                    f"{path}, line {line}, column {name}: {shortened(cell)!r} is not a number; write a number there"
                )
    return None


def _is_number(cell: str) -> bool:
    try:
        float("nan" if cell.strip() in ("", *EMPTY) else cell)
    except ValueError:
        return False
    return True


def _lines(path: Path, skip: int = 0) -> Iterator[tuple[int, list[str]]]:
    with path.open(encoding="utf-8-sig", errors="replace", newline="") as file:
        for line, text in enumerate(file, start=1):
            if line > skip and not text.startswith("#"):
                yield line, _cells(text)


def _cells(text: str) -> list[str]:
    try:
        return next(csv.reader([text]), [])
    except csv.Error:  # a line without an end, of some binary file
        return [text]


def place(path: Path, start: int, stop: int | None = None, skip: int = 0, named: bool = True) -> str:
    """Rows `start` up to `stop` (from 0) in words: the lines of a CSV, the rows of others counted from 1.

    `skip` lines stand before the line of column names, which is not there unless `named`.
    """
    word, first, last = "row", start + 1, (stop or start + 1)
    if path.suffix == ".csv":
        # the first line without '#' is the header
        word, wanted = "line", {start + named, last - 1 + named}
        found = {
            row: line for row, (line, _) in zip(range(last + 1), _lines(path, skip), strict=False) if row in wanted
        }
        first, last = found[start + named], found[last - 1 + named]
    return f"{path}, {word} {first}" if last <= first else f"{path}, {word}s {first} to {last}"
