"""Text files of other programs as they are: encoding, separator, and whether a line of names stands above."""

from __future__ import annotations

import re
from codecs import getincrementaldecoder
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from gimbalcal.errors import InputError
from gimbalcal.recording.dates import is_date
from gimbalcal.recording.lines import EMPTY, characters_below

if TYPE_CHECKING:
    import polars as pl


def frame_of(
    path: Path,
    separator: str,
    skip: int,
    named: bool,
    quoted: bool = True,
    lines: Sequence[str] | None = None,
    comment: str = "#",
    numbers: Sequence[bool] = (),
) -> pl.DataFrame:
    """Return a table of cells, the blanks around names removed; not `quoted`: quotation marks are ordinary letters.

    lines: of the file, where they were made plainer. Cells are text but those of the columns in `numbers` that come as
    numbers at once, in half the time, if nothing else stands in any of these.
    """
    import polars as pl

    source: Path | bytes = path.absolute()  # as it stands: `~` and `*` are letters like others
    encoding = "" if lines is not None else encoding_of(path)
    if separator == " ":  # columns are often lined up by more than one blank
        lines = lines if lines is not None else path.read_text(encoding=encoding, errors="replace").splitlines()
        source, skip = "\n".join(" ".join(line.split()) for line in lines[skip:] if line.split()).encode(), 0
    elif lines is not None:
        source = "\n".join(lines).encode()
    elif encoding != "utf-8-sig":
        source = path.read_text(encoding=encoding, errors="replace").encode()
    elif comment and not characters_below(path, skip, comment[0]):
        comment = ""  # the reader would look for comments in each line, which is slow
    try:
        frame = pl.read_csv(
            source,
            separator=separator,
            skip_lines=skip,
            comment_prefix=comment or None,
            infer_schema=False,
            schema_overrides=[pl.Float64 if each else pl.String for each in numbers] if any(numbers) else None,
            has_header=named,
            glob=False,
            quote_char='"' if quoted else None,
        )
    except pl.exceptions.PolarsError as error:
        if any(numbers):
            return frame_of(path, separator, skip, named, quoted, lines, comment)
        raise InputError(
            _longer_line(path, separator, skip) or f"{path} cannot be read as a table: {str(error).splitlines()[0]}"
        ) from None
    stripped = [name.strip() for name in frame.columns]
    if len(set(stripped)) == len(stripped):
        frame.columns = stripped
    return frame


def _longer_line(path: Path, separator: str, skip: int) -> str:
    """Return a sentence on the first line with more cells than the first of the table has; empty if there is none."""
    first = 0
    with path.open(encoding=encoding_of(path), errors="replace") as file:
        for i, line in enumerate(file, start=1):
            cells = len(line.split() if separator == " " else line.split(separator))
            first = cells if i == skip + 1 else first
            if i > skip + 1 and cells > first and not line.startswith("#"):
                return (
                    f"{path}, line {i}: {line.strip()[:60]!r} has {cells} cells where the first row has {first}; rows "
                    "of several kinds are no table: put those of one kind into a file of their own, with names above"
                )
    return ""


def encoding_of(path: Path) -> str:
    """Return the encoding of a text file: UTF-8, UTF-16 where a mark says so, else that of western Windows.

    A file may be cut off inside a character: read it with `errors="replace"`.
    """
    state = path.stat()
    return _encoding_of(path, (state.st_ino, state.st_size, state.st_mtime_ns))


@lru_cache(maxsize=64)
def _encoding_of(path: Path, _state: tuple[int, int, int]) -> str:
    """Return the encoding of a file with this inode, size and time of change: it takes decoding the whole file."""
    with path.open("rb") as file:
        if file.read(2) in (b"\xff\xfe", b"\xfe\xff"):
            return "utf-16"
        for name in ("utf-8-sig", "cp1252"):
            file.seek(0)
            decoder = getincrementaldecoder(name)()
            try:
                while block := file.read(1 << 20):
                    if decoder.getstate()[0] or not block.isascii():
                        decoder.decode(block)
            except UnicodeDecodeError:
                continue
            return name
    return "latin-1"  # of which no byte is undefined


def _first_line(path: Path, skip: int) -> str:
    """Return the first line that is no comment, by which the separator is recognised, and whether names stand in it."""
    with path.open(encoding=encoding_of(path), errors="replace") as file:
        lines = (line for i, line in enumerate(file) if i >= skip and line.strip() and not line.startswith("#"))
        return next(lines, "").strip("\r\n")


def separator_of(path: Path, skip: int) -> str:
    """Return the separator that the first line shows."""
    first = _first_line(path, skip)
    shown = [mark for mark in (";", "\t", ",") if mark in first.strip()]
    return shown[0] if shown else (" " if " " in first.strip() else ",")


def holds_numbers(path: Path, skip: int, separator: str) -> bool:
    """Return whether the first line is numbers or dates, not names."""
    first = _first_line(path, skip)
    cells = first.split() if separator == " " else [cell.strip() for cell in first.split(separator)]
    number_like = re.compile(r"[-+]?(\d+([.,]\d*)?|[.,]\d+)([eE][-+]?\d+)?")
    return all(not c or c in EMPTY or number_like.fullmatch(c) or is_date(c) for c in cells)
