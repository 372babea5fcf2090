"""CSV and other text tables, with a header file that says what the columns hold."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gimbalcal.errors import InputError
from gimbalcal.importers.table import COMMON, header_for, number, one_file, only, recording_of
from gimbalcal.number import Array
from gimbalcal.recording.dates import Dates, is_date
from gimbalcal.recording.record import Recording
from gimbalcal.recording.samples import EMPTY, names_above, numbered

if TYPE_CHECKING:
    import polars as pl

HEAD, LEAST_COLUMNS = 200, 3  # lines that tell how a log is written, and columns of one that holds a triad
_SEPARATORS = {"comma": ",", "semicolon": ";", "tab": "\t", "space": " "}


def import_csv(files: Sequence[Path], options: Mapping[str, str]) -> Recording:
    """One text table; header = FILE.toml with [columns], separator, skip = lines before the names, rate = Hz.

    The separator is comma, semicolon, tab or space, or the character itself, and the one that the first line shows
    where it is not given; any number of blanks is one. With semicolons a decimal comma is understood. A table without
    a line of names has its columns called by number, from 1.
    """
    only(options, (*COMMON, "separator", "skip"))
    path = one_file(files)
    skip = int(number(options, "skip", 0))
    header = header_for(path, options, skip)
    separator = _SEPARATORS.get(options.get("separator", ""), options.get("separator", "")) or _guessed(path, skip)
    if len(separator) != 1:
        raise InputError(f"the separator {separator!r} is not one character; write comma, semicolon, tab or space")
    wanted = [c.name for c in header.columns]
    named = not _holds_numbers(path, skip, separator)
    frame = _frame(path, separator, skip, named)
    if numbered(wanted) and not set(wanted) <= set(frame.columns):
        frame.columns = [str(i) for i in range(1, frame.width + 1)]
    elif not named:
        frame.columns = names_above(path, frame.width, skip) or frame.columns
        if not set(wanted) <= set(frame.columns):
            raise InputError(
                f"{path}: numbers stand where the column names belong; put them above, or call the columns by number "
                f'in {header.path.name}, as in 1 = {{ quantity = "time", unit = "s" }}'
            )
    clock = header.column("time")

    def fetch(name: str) -> Array:
        if name not in frame.columns:
            raise InputError(f"{path} has no column {name!r}; it has {', '.join(map(repr, frame.columns))}")
        text = frame[name].str.strip_chars()
        seen = text.drop_nulls()
        if clock and name == clock.name and len(seen) and is_date(seen[0]):
            return np.array(text.fill_null("").to_list())
        text = text.str.replace(",", ".", literal=True) if separator == ";" else text
        return _numbers(path, name, text, named)

    return recording_of(replace(header, named=named), options, fetch)


def table_of(path: Path) -> dict[str, Array]:
    """Every column of numbers of a text table that nobody described, by its name; dates of ISO 8601 are seconds.

    Lines before the table are skipped, the separator is the one that most lines share, and a table without names has
    its columns called by number. Cells that hold no number are NaN. Raises InputError for a file without a table.
    """
    import polars as pl

    if not path.is_file():
        raise InputError(f"{path} does not exist or is not a file; give the log of a unit")
    with path.open(encoding="utf-8-sig", errors="replace") as file:
        head = [line.rstrip("\r\n") for line, _ in zip(file, range(HEAD), strict=False)]
    skip, separator = _begins(path, head)
    named = not _holds_numbers(path, skip, separator)
    frame = _frame(path, separator, skip, named)
    if not named:
        above = names_above(path, frame.width, skip)
        frame.columns = above or [str(i) for i in range(1, frame.width + 1)]
    out = {}
    for name in frame.columns:
        text = frame[name].str.strip_chars().str.strip_chars('"')
        seen = text.drop_nulls()
        if len(seen) and is_date(seen[0]):
            out[name] = Dates().seconds(text)
            continue
        values = text.str.replace(",", ".", literal=True) if separator == ";" else text
        numbers = values.cast(pl.Float64, strict=False).to_numpy()
        if np.count_nonzero(np.isfinite(numbers)) > len(numbers) / 2:
            out[name] = numbers
    if len(out) < LEAST_COLUMNS:
        raise InputError(f"{path} holds {len(out)} columns of numbers: no log of a unit, or in a form that is not text")
    return out


def _begins(path: Path, head: Sequence[str]) -> tuple[int, str]:
    """How many lines stand before a table, and its separator."""
    best = (0, 0, 0, ",")
    for mark in (";", "\t", ",", " "):
        counts = [len(line.split()) if mark == " " else line.count(mark) + 1 for line in head if line.strip()]
        usual = max(set(counts), key=counts.count, default=0)
        begins = next((i for i, line in enumerate(head) if line.strip() and not line.startswith("#")
                       and (len(line.split()) if mark == " " else line.count(mark) + 1) == usual), 0)  # fmt: skip
        if usual >= LEAST_COLUMNS:
            best = max(best, (counts.count(usual), usual, begins, mark))
    if not best[1]:
        raise InputError(f"{path} holds no table of {LEAST_COLUMNS} columns or more; give a text log of a unit")
    return best[2], best[3]


def _frame(path: Path, separator: str, skip: int, named: bool) -> pl.DataFrame:
    """Every cell as text, the blanks around names gone."""
    import polars as pl

    source: Path | bytes = path.absolute()  # as it stands: `~` and `*` are letters like others
    if separator == " ":  # columns are often lined up by more than one blank
        lines = path.read_text(encoding="utf-8-sig", errors="replace").splitlines()[skip:]
        source, skip = "\n".join(" ".join(line.split()) for line in lines if line.split()).encode(), 0
    try:
        frame = pl.read_csv(
            source, separator=separator, skip_lines=skip, comment_prefix="#", infer_schema=False, has_header=named,
            glob=False,
        )  # fmt: skip
    except pl.exceptions.PolarsError as error:
        raise InputError(f"{path} cannot be read as a table: {str(error).splitlines()[0]}") from None
    stripped = [name.strip() for name in frame.columns]
    if len(set(stripped)) == len(stripped):
        frame.columns = stripped
    return frame


def _numbers(path: Path, name: str, text: pl.Series, named: bool) -> Array:
    import polars as pl

    empty = text.is_null() | text.is_in(["", *EMPTY])
    values = text.cast(pl.Float64, strict=False)
    bad = (values.is_null() & ~empty).arg_true()
    if len(bad):
        where = f"{path}, row {bad[0] + 1}{' below the names' if named else ''}, column {name}"
        raise InputError(f"{where}: {text[bad[0]]!r} is not a number")
    return values.set(empty, None).to_numpy()


def _first_line(path: Path, skip: int) -> str:
    with path.open(encoding="utf-8-sig", errors="replace") as file:
        lines = (line for i, line in enumerate(file) if i >= skip and line.strip() and not line.startswith("#"))
        return next(lines, "").strip("\r\n")


def _guessed(path: Path, skip: int) -> str:
    """The separator that the first line shows."""
    first = _first_line(path, skip)
    shown = [mark for mark in (";", "\t", ",") if mark in first.strip()]
    return shown[0] if shown else (" " if " " in first.strip() else ",")


def _holds_numbers(path: Path, skip: int, separator: str) -> bool:
    """Whether the first line is numbers or dates, not names."""
    first = _first_line(path, skip)
    cells = first.split() if separator == " " else [cell.strip() for cell in first.split(separator)]
    number_like = re.compile(r"[-+]?(\d+([.,]\d*)?|[.,]\d+)([eE][-+]?\d+)?")
    return all(not c or c in EMPTY or number_like.fullmatch(c) or is_date(c) for c in cells)
