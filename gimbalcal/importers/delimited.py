"""CSV and other text tables, with a header file that says what the columns hold."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gimbalcal.errors import InputError
from gimbalcal.importers.described_table import header_for
from gimbalcal.importers.registry import importer, number
from gimbalcal.importers.text_file import frame_of, holds_numbers, separator_of
from gimbalcal.number import Array
from gimbalcal.recording.dates import is_date
from gimbalcal.recording.frames import recording_of
from gimbalcal.recording.lines import EMPTY, are_numbered, names_above
from gimbalcal.recording.record import Recording

if TYPE_CHECKING:
    import polars as pl

_SEPARATORS = {"comma": ",", "semicolon": ";", "tab": "\t", "space": " "}


@importer("csv", "header", "rate", "separator", "skip")
def import_csv(files: Sequence[Path], options: Mapping[str, str]) -> Recording:
    """One text table; header = FILE.toml with [columns], separator, skip = lines before the names, rate = Hz.

    The separator is comma, semicolon, tab or space, or the character itself, and the one that the first line shows
    where it is not given; any number of blanks is one. With semicolons a decimal comma is understood. A table without
    a line of names has its columns called by number, from 1.
    """
    (path,) = files
    skip = int(number(options, "skip", 0))
    header = header_for(path, options, skip)
    separator = _SEPARATORS.get(options.get("separator", ""), options.get("separator", "")) or separator_of(path, skip)
    if len(separator) != 1:
        raise InputError(f"the separator {separator!r} is not one character; write comma, semicolon, tab or space")
    wanted = [c.name for c in header.columns]
    named = not holds_numbers(path, skip, separator)
    frame = frame_of(path, separator, skip, named)
    if are_numbered(wanted) and not set(wanted) <= set(frame.columns):
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
        filled = text.drop_nulls()
        if clock and name == clock.name and len(filled) and is_date(filled[0]):
            return np.array(text.fill_null("").to_list())
        text = text.str.replace(",", ".", literal=True) if separator == ";" else text
        return _column_numbers(path, name, text, named)

    return recording_of(replace(header, named=named), fetch, number(options, "rate", 0.0))


def _column_numbers(path: Path, name: str, text: pl.Series, named: bool) -> Array:
    import polars as pl

    empty = text.is_null() | text.is_in(["", *EMPTY])
    values = text.cast(pl.Float64, strict=False)
    bad = (values.is_null() & ~empty).arg_true()
    if len(bad):
        where = f"{path}, row {bad[0] + 1}{' below the names' if named else ''}, column {name}"
        raise InputError(f"{where}: {text[bad[0]]!r} is not a number")
    return values.set(empty, None).to_numpy()
