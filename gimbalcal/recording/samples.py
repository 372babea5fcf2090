"""The rows of a recording, streamed from CSV or Parquet in batches, and the place of a row as the user sees it."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gimbalcal.errors import InputError, alternatives, amount
from gimbalcal.number import Array
from gimbalcal.recording.document import shortened

if TYPE_CHECKING:
    import polars as pl

MOST_NAMES = 20  # shown of a file that has other columns than it should

Batch = Mapping[str, Array]

ROWS = 50_000
"""Rows of one batch: ten columns are 4 MB, so that a pass over them stays in the cache."""


def batches(path: Path, names: Sequence[str]) -> Iterator[Batch]:
    """The columns `names` of the samples file, as float64 arrays of some `ROWS` rows, in the order of the file.

    An empty cell is a NaN. Whatever the file cannot be read for is an `InputError` that names the line.
    """
    import polars as pl

    try:
        _check_bytes(path)
        lazy = _scan(path, names)
        present = lazy.collect_schema()
        _check_names(path, names, present)
        _check_types(path, names, present)
        columns = [pl.col(name).cast(pl.Float64) for name in names]
        for frame in lazy.select(columns).collect_batches(chunk_size=ROWS, maintain_order=True):
            batch = _without_blank_end(frame)
            if len(batch[names[0]]):
                yield batch
    except pl.exceptions.NoDataError:
        raise InputError(f"{path} is empty; it must hold a line of column names and the rows") from None
    except (pl.exceptions.PolarsError, OSError) as error:
        raise _explained(path, names, error) from None


def column(path: Path, name: str) -> Array:
    """One whole column."""
    return np.concatenate([batch[name] for batch in batches(path, [name])])


def _scan(path: Path, names: Sequence[str]) -> pl.LazyFrame:
    import polars as pl

    if path.suffix == ".parquet":
        return pl.scan_parquet(path)
    if path.stat().st_size == 0:
        raise pl.exceptions.NoDataError
    # Every dtype is given: a guess from the first rows fails at the first 0.5 below a column of integers.
    present = pl.scan_csv(path, comment_prefix="#", infer_schema=False).collect_schema().names()
    types = {name: pl.Float64 if name in names else pl.String for name in present}
    return pl.scan_csv(path, comment_prefix="#", schema=types)


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
        raise InputError(f"{path}, line {_heading(path)}: numbers stand where the column names belong; put them above")
    hint = "correct the name on one side"
    if any("\ufffd" in name for name in present):
        hint = "the names are not text in UTF-8, save the file as UTF-8"
    if all(name in [there.strip() for there in present] for name in missing):
        hint = "take the blanks away around the names"
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


def _explained(path: Path, names: Sequence[str], error: Exception) -> InputError:
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
    header: list[str] = []
    for line, cells in _lines(path):
        odd = next((cell for cell in cells if "\ufffd" in cell), None)
        if odd is not None:
            return InputError(f"{path}, line {line}: {shortened(odd)!r} is not text in UTF-8; save the file as UTF-8")
        if not header:
            header = cells
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
        float(cell or "nan")
    except ValueError:
        return False
    return True


def _lines(path: Path, skip: int = 0) -> Iterator[tuple[int, list[str]]]:
    with path.open(encoding="utf-8-sig", errors="replace", newline="") as file:
        for line, text in enumerate(file, start=1):
            if line > skip and not text.startswith("#"):
                yield line, next(csv.reader([text]), [])


def place(path: Path, start: int, stop: int | None = None, skip: int = 0) -> str:
    """Rows `start` up to `stop` (from 0) in words: the lines of a CSV, the rows of others counted from 1.

    `skip` lines stand before the line of column names.
    """
    word, first, last = "row", start + 1, (stop or start + 1)
    if path.suffix == ".csv":
        word, wanted = "line", {start + 1, last}  # the first line without '#' is the header
        found = {
            row: line for row, (line, _) in zip(range(last + 1), _lines(path, skip), strict=False) if row in wanted
        }
        first, last = found[first], found[last]
    return f"{path}, {word} {first}" if last <= first else f"{path}, {word}s {first} to {last}"
