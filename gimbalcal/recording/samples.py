"""The rows of a recording, streamed from CSV or Parquet in batches."""

from __future__ import annotations

import os
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from itertools import chain, pairwise
from pathlib import Path
from typing import IO, TYPE_CHECKING

import numpy as np

from gimbalcal.checks.unreadable import check_bytes, check_names, check_types, explanation
from gimbalcal.errors import InputError, number_of, shortened_text
from gimbalcal.number import Array
from gimbalcal.recording.columns import Column
from gimbalcal.recording.dates import Dates, NoDateError, is_date
from gimbalcal.recording.lines import (
    COMMENT,
    EMPTY,
    characters_below,
    column_heading,
    first_line,
    has_names,
    lines,
    rows_in_words,
)
from gimbalcal.recording.memory_limit import refuse_bomb
from gimbalcal.units import from_si

if TYPE_CHECKING:
    import polars as pl

Batch = Mapping[str, Array]

ROWS = 50_000
"""Rows of one batch: ten columns are 4 MB, so that a pass over them stays in the cache."""

SILENCE = 1.0  # s without a message after which the threads of an engine that panicked have all reported it


def batches(
    path: Path, names: Sequence[str], clock: Column | None = None, dates: Dates | None = None, end: bool = False
) -> Iterator[Batch]:
    """Yield the columns `names` of the samples file, as float64 arrays of some `ROWS` rows, in the order of the file.

    An empty cell is a NaN; blank rows at the end of the file are left out unless its `end` is asked for. A `clock` of
    dates becomes seconds, in its unit, counted by `dates`. Names that are all
    whole numbers count columns from 1 where the file has no line of names (or other names). Whatever the file cannot
    be read for is an `InputError` that names the line.
    """
    import polars as pl

    dates, rows, plain = dates or Dates(), 0, list(names)
    try:
        check_bytes(path)
        named, lazy = has_names(path, names), _scan(path, names)
        with redirect_messages():
            present = lazy.collect_schema()
        check_names(path, names, present)
        dated = clock is not None and clock.name in names and _holds_dates(path, clock, present[clock.name], named)
        plain = [name for name in names if not (dated and clock and name == clock.name)]
        check_types(path, plain, present)
        columns = [_numbers(name, present[name], path) if name in plain else pl.col(name) for name in names]
        for frame, following in pairwise(chain(_frames(lazy.select(columns), path), [None])):
            if frame is None:
                break
            batch = _arrays(frame, end or not _is_blank(following))
            if dated and clock:
                seconds = dates.seconds(frame[clock.name][: len(batch[names[0]])])
                batch = {**batch, clock.name: from_si(seconds, clock.unit)}
            rows += frame.height
            if len(batch[names[0]]):
                yield batch
    except NoDateError as problem:
        where = rows_in_words(path, rows + problem.row, named=named)
        raise InputError(f"{where}, column {clock.name if clock else ''}: {problem}; correct it") from None
    except pl.exceptions.NoDataError:
        raise InputError(f"{path} is empty; it must hold a line of column names and the rows") from None
    except (pl.exceptions.PolarsError, pl.exceptions.PanicException, OSError) as error:
        raise explanation(path, plain, error) from None


def _frames(lazy: pl.LazyFrame, path: Path) -> Iterator[pl.DataFrame]:
    """Yield frames of some `ROWS` rows of a file.

    What the engine prints of a panic of its own goes nowhere: the user has a sentence. An engine that panics at a
    damaged page ends the rows there and raises nothing; a file of Parquet says how many it has.
    """
    import polars as pl

    rows, frames = 0, lazy.collect_batches(chunk_size=ROWS, maintain_order=True)
    with tempfile.TemporaryFile() as messages:
        while True:
            with redirect_messages(messages):
                if (frame := next(frames, None)) is None:
                    break
            rows += frame.height
            yield frame
        if path.suffix != ".parquet":
            return
        with redirect_messages(messages):
            stated = pl.scan_parquet(path.absolute(), glob=False).select(pl.len()).collect().item()
            size = -1
            while rows != stated and size != (size := os.fstat(messages.fileno()).st_size):
                time.sleep(SILENCE)  # one thread reports after the other
    if rows != stated:
        raise InputError(
            f"{path} says that it has {number_of(stated, 'row')} and {rows} can be read: it seems to be cut "
            "short or damaged; copy it again"
        )


@contextmanager
def redirect_messages(messages: IO[bytes] | None = None) -> Iterator[None]:
    """Redirect what compiled code writes to stderr to a file of messages, an unnamed one where none is given."""
    sys.stderr.flush()
    kept = os.dup(2)
    with nullcontext(messages) if messages else tempfile.TemporaryFile() as file:
        try:
            os.dup2(file.fileno(), 2)
            yield
        finally:
            os.dup2(kept, 2)
            os.close(kept)


def column(path: Path, name: str, clock: Column | None = None) -> Array:
    """Return one whole column, with blank lines at its end: other columns may have values there."""
    dated = clock if clock and name == clock.name else None
    parts = [batch[name] for batch in batches(path, [name], dated, end=True)]
    at = sum(map(len, parts))
    out = np.empty(at)
    while parts:  # each is let go of once it is there: of 1e8 rows there are 0.8 GB, not twice as much
        part = parts.pop()
        out[at - len(part) : at] = part
        at -= len(part)
    return out


def _scan(path: Path, names: Sequence[str]) -> pl.LazyFrame:
    """Return the file, less the blanks around its names; columns called by number are named by it."""
    import polars as pl

    if path.suffix == ".parquet":
        lazy = pl.scan_parquet(path.absolute(), glob=False)
        with redirect_messages():
            rows = lazy.select(pl.len()).collect().item()
        refuse_bomb(path, 8 * rows * len(names), streamed=True)
        return lazy
    if path.stat().st_size == 0:
        raise pl.exceptions.NoDataError
    # Every dtype is given: a guess from the first rows fails at the first 0.5 below a column of integers.
    head = [cells for _, (_, cells) in zip(range(3), lines(path), strict=False)]
    named, present = column_heading(path, names)
    text = any(cell != cell.strip() or is_date(cell) for cells in head[named:] for cell in cells)
    there = (
        pl.scan_csv(path.absolute(), comment_prefix=COMMENT, infer_schema=False, has_header=named, glob=False)
        .collect_schema()
        .names()
    )
    if len(set(present)) < len(there) or len(present) != len(there):
        present = there
    types = {
        old: pl.Float64 if name in names and not text else pl.String for old, name in zip(there, present, strict=True)
    }
    # the reader looks for comments and for words without a value only where the file can hold any: both are slow
    above = first_line(path) - 1
    marks = characters_below(path, above + named, COMMENT + "".join({word[0] for word in EMPTY}))
    lazy = pl.scan_csv(
        path.absolute(), comment_prefix=COMMENT if above or COMMENT in marks else None, schema=types,
        null_values=list(EMPTY) if marks.strip(COMMENT) else None, has_header=named, glob=False,
    )  # fmt: skip
    changed = {old: name for old, name in zip(there, present, strict=True) if old != name}
    return lazy.rename(changed) if changed else lazy


def _numbers(name: str, dtype: pl.DataType, path: Path) -> pl.Expr:
    import polars as pl

    each = pl.col(name)
    if dtype == pl.String and path.suffix != ".parquet":
        each = each.str.strip_chars()
        each = pl.when(each.is_in(["", *EMPTY])).then(None).otherwise(each)
    return each.cast(pl.Float64).alias(name)


def _holds_dates(path: Path, clock: Column, dtype: pl.DataType, named: bool) -> bool:
    """Return whether the clock holds dates; `InputError` where it holds numbers and the header says dates."""
    import polars as pl

    first = ""
    if path.suffix == ".parquet" and dtype == pl.String:
        head = pl.scan_parquet(path.absolute(), glob=False).select(clock.name).head(1).collect()
        first = str(head.item()) if head.height else ""
    elif path.suffix != ".parquet":
        present = column_heading(path, [clock.name])[1]
        at = present.index(clock.name) if clock.name in present else 0
        first = next((c[at] for i, (_, c) in enumerate(lines(path)) if i >= named and len(c) > at), "")
    dated = dtype.is_temporal() or is_date(first)
    if clock.dated and first and not dated:
        raise InputError(
            f"{rows_in_words(path, 0, named=named)}, column {clock.name}: {shortened_text(first)!r} is not a date and "
            "time of "
            'ISO 8601, as [columns] says; correct it, or write the unit of the numbers, as in unit = "s"'
        )
    return dated


def _is_blank(frame: pl.DataFrame | None) -> bool:
    """Return whether nothing is in a frame, or none follows."""
    return frame is None or all(frame[name].null_count() == frame.height for name in frame.columns)


def _arrays(frame: pl.DataFrame, whole: bool) -> Batch:
    """Return the arrays of `frame`, all or less blank lines at its end, which editors like to leave there."""
    n = frame.height
    while not whole and n and all(value is None for value in frame.row(n - 1)):
        n -= 1
    return {each.name: each.to_numpy() for each in frame.head(n)}
