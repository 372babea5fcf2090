"""Explain why a file of rows cannot be read: one sentence with the line or the column, and what to write instead."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from gimbalcal.errors import InputError, list_of_alternatives, number_of, shortened_text
from gimbalcal.recording.lines import column_heading, first_line, is_number, lines

if TYPE_CHECKING:
    import polars as pl

MAX_NAMES = 20  # shown of a file that has other columns than it should


def check_bytes(path: Path) -> None:
    """Raise InputError where a CSV file does not begin with text in UTF-8, in lines."""
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


def check_names(path: Path, names: Sequence[str], present: Mapping[str, pl.DataType]) -> None:
    """Raise InputError where columns that the header names are not there."""
    missing = [name for name in names if name not in present]
    if not missing:
        return
    first = next(iter(present), "")
    other = next((mark for mark in ";\t| " if len(present) == 1 and mark in first.strip()), None)
    if other:
        raise InputError(
            f"{path}, line {first_line(path)}: separate its columns by commas, not {other!r}, and write decimal points"
        )
    if all(is_number(name.partition("_duplicated_")[0]) for name in present):
        raise InputError(
            f"{path}, line {first_line(path)}: numbers stand where the column names belong; put them above, or call "
            'the columns by number in [columns], as in 1 = { quantity = "time", unit = "s" }'
        )
    hint = "correct the name on one side"
    if any("\ufffd" in name for name in present):
        hint = "the names are not text in UTF-8, save the file as UTF-8"
    has = [repr(shortened_text(name)) for name in present]
    more = f" and {len(has) - MAX_NAMES} more" if len(has) > MAX_NAMES else ""
    raise InputError(
        f"{path} has no column {list_of_alternatives([repr(name) for name in missing])}, which [columns] of "
        f"recording.toml names; it has {', '.join(has[:MAX_NAMES])}{more}; {hint}"
    )


def check_types(path: Path, names: Sequence[str], present: Mapping[str, pl.DataType]) -> None:
    """Raise InputError where a column is neither numbers nor text that may be numbers, or shares its name."""
    import polars as pl

    for name in names:
        if f"{name}_duplicated_0" in present and path.suffix == ".csv":
            raise InputError(
                f"{path}, line {first_line(path)}: two columns are called {name!r}; rename the one that is not meant"
            )
        dtype = present[name]
        if not (dtype.is_numeric() or dtype in (pl.String, pl.Null)):
            clock = "; write seconds from the start of the recording" if dtype.is_temporal() else "; write numbers"
            raise InputError(f"{path}, column {name}: the column holds {dtype} values, not numbers{clock}")


def explanation(path: Path, names: Sequence[str], error: BaseException) -> InputError:
    """Return what an error of the engine means for the user, with the line where one can be identified."""
    if path.suffix == ".parquet":
        reason = shortened_text(str(error).splitlines()[0].removeprefix("parquet: "), 150)
        text = re.search(r"conversion from `str`.* in column '(.*?)'.*?\[(\".*?\")", reason)
        if text:
            return InputError(f"{path}, column {text[1]}: {text[2]} is not a number; write the column as numbers")
        return InputError(
            f"{path} cannot be read as Parquet, it seems to be cut short or damaged ({reason}); copy it again"
        )
    reason = shortened_text(str(error).splitlines()[0], 150)
    return _first_bad_line(path, names) or InputError(
        f"{path} cannot be read as CSV ({reason}); write lines of numbers with commas between them"
    )


def _first_bad_line(path: Path, names: Sequence[str]) -> InputError | None:
    named, header = column_heading(path, names)
    for row, (line, cells) in enumerate(lines(path)):
        odd = next((cell for cell in cells if "\ufffd" in cell), None)
        if odd is not None:
            return InputError(
                f"{path}, line {line}: {shortened_text(odd)!r} is not text in UTF-8; save the file as UTF-8"
            )
        if named and row == 0:
            continue
        if len(cells) > len(header):
            return InputError(
                f"{path}, line {line}: {number_of(len(cells), 'value')} where the first line names "
                f"{number_of(len(header), 'column')}; remove what is too much, and write decimal points, not "
                "commas"
            )
        for name, cell in zip(header, cells, strict=False):
            if name in names and not is_number(cell):
                return InputError(
                    f"{path}, line {line}, column {name}: {shortened_text(cell)!r} is not a number; write a number "
                    "there"
                )
    return None
