"""A text file of rows, line by line: where its rows begin, what its columns are called, and which line a row is."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Sequence
from pathlib import Path

from gimbalcal.recording.dates import is_date

COMMENT = "#"  # at the beginning of a line that is none of the table
EMPTY = ("NA", "N/A", "n/a", "null", "NULL", "None", "nan", "NaN", "NAN")
"""Cells that programs write where they have no value."""


def has_names(path: Path, names: Sequence[str]) -> bool:
    """Return whether a file begins with a line of names.

    It always does, but where it begins with numbers and the columns are numbered, or named by the last comment above.
    A first line 0, 1, 2, ... or 1, 2, 3, ... is names, made up.
    """
    return path.suffix == ".parquet" or column_heading(path, names)[0]


def column_heading(path: Path, names: Sequence[str]) -> tuple[bool, list[str]]:
    """Return whether the first line without ``#`` names the columns of a CSV, and what they are called."""
    first = [cell.strip() for cell in next((cells for _, cells in lines(path)), [])]
    counted = [str(i) for i in range(1, len(first) + 1)]
    made_up = len(first) > 1 and first in (counted, [str(i) for i in range(len(first))])
    numbers = bool(first) and not made_up and all(is_number(cell) or is_date(cell) for cell in first)
    if are_numbered(names):
        return not numbers, first if not numbers and set(names) <= set(first) else counted
    above = [] if set(names) <= set(first) else names_above(path, len(first))
    return (False, above) if names and set(names) <= set(above) else (True, first)


def names_above(path: Path, columns: int, skip: int = 0) -> list[str]:
    """Return the words of the last comment above the rows, if there is one for each column."""
    last = ""
    with path.open(encoding="utf-8-sig", errors="replace") as file:
        for i, line in enumerate(file):
            if i >= skip and not line.startswith("#"):
                break
            last = line if i >= skip else ""
    return next((words for words in comment_words(last) if len(words) == columns), [])


def comment_words(line: str) -> Iterator[list[str]]:
    """Yield the words of a comment between separators, blanks or rows of dashes; a unit belongs to its word."""
    text = re.sub(r"\s+([\[(])", r"\1", line.lstrip("#%!/ ").strip())
    for pattern in (r"\s*[;,\t|]\s*", r"[\s,;|]+", r"\s*-{2,}\s*", r"\s*-+\s*")[: 4 if "---" in text else 2]:
        yield [word for word in re.split(pattern, text) if word]


def are_numbered(names: Sequence[str]) -> bool:
    """Return whether columns are called by number, counted from 1, not by name."""
    return bool(names) and all(re.fullmatch(r"[1-9]\d{0,3}", name) for name in names)


def is_number(cell: str) -> bool:
    """Return whether a cell is a number, or says that there is none."""
    try:
        float("nan" if cell.strip() in ("", *EMPTY) else cell)
    except ValueError:
        return False
    return True


def first_line(path: Path) -> int:
    """Return the number of the line with the column names."""
    return next((line for line, _ in lines(path)), 1)


def characters_below(path: Path, line: int, characters: str) -> str:
    """Return which of some ASCII characters occur in a file below its first `line` lines.

    Searching the file for a character is much cheaper than having the reader of CSV look for comments in each line, or
    for words without a value in each cell.
    """
    present = set[str]()
    with path.open("rb") as file:
        for _ in range(line):
            file.readline()
        while block := file.read(1 << 20):
            present |= {each for each in characters if each.encode() in block}
    return "".join(present)


def lines(path: Path, skip: int = 0) -> Iterator[tuple[int, list[str]]]:
    """Yield number and cells of each line that is no comment, after the first `skip`."""
    with path.open(encoding="utf-8-sig", errors="replace", newline="") as file:
        for line, text in enumerate(file, start=1):
            if line > skip and not text.startswith("#"):
                yield line, cells_of(text)


def cells_of(line: str, mark: str = ",", skipinitialspace: bool = False) -> list[str]:
    """Return the cells of a line of CSV, or what is between its separators if a cell is too long for the reader."""
    try:
        return next(csv.reader([line], delimiter=mark, skipinitialspace=skipinitialspace), [])
    except csv.Error:
        return line.split(mark)


def rows_in_words(path: Path, start: int, stop: int | None = None, skip: int = 0, named: bool = True) -> str:
    """Return rows `start` up to `stop` (from 0) in words: the lines of a CSV, the rows of others counted from 1.

    `skip` lines stand before the line of column names, which is not there unless `named`.
    """
    word, first, last = "row", start + 1, (stop or start + 1)
    if path.suffix == ".csv":
        # the first line without '#' is the header
        word, wanted = "line", {start + named, last - 1 + named}
        line_of_row = {
            row: line for row, (line, _) in zip(range(last + 1), lines(path, skip), strict=False) if row in wanted
        }
        first, last = line_of_row[start + named], line_of_row[last - 1 + named]
    return f"{path}, {word} {first}" if last <= first else f"{path}, {word}s {first} to {last}"
