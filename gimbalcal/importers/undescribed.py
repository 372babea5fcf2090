"""The table in a text file that nobody described: where it begins, its separator, names and units, its numbers."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from gimbalcal.errors import InputError
from gimbalcal.importers.delimited import encoding_of, frame_of, holds_numbers
from gimbalcal.importers.names import by_name, plain, unit_written
from gimbalcal.number import Array
from gimbalcal.recording.dates import Dates, NoDateError, is_date

HEAD, LEAST_COLUMNS = 200, 3  # lines that tell how a log is written, and columns of one that holds a triad
SEXAGESIMAL = re.compile(r"\s*[-+]?\d{1,3}\s*[:°hd ]\s*\d{1,2}\s*[:'′m ]\s*\d{1,2}(\.\d*)?\s*[\"″s]?\s*")


@dataclass(frozen=True)
class Table:
    """Columns of numbers by name, which of them were sexagesimal (in their first unit), and the text above them."""

    columns: dict[str, Array]
    sexagesimal: frozenset[str] = frozenset()
    above: tuple[str, ...] = ()
    others: tuple[str, ...] = field(default=())  # columns that hold no numbers


def table_of(path: Path, dates: Dates | None = None) -> Table:
    """Every column of numbers of a text table, by its name; dates of ISO 8601 are seconds, counted as `dates` does.

    Lines before the table are skipped, the separator is the one that most lines share, a decimal comma is understood
    beside semicolons and tabs, a line of units below the names goes to the names, and a table without names has its
    columns called by number. Cells that hold no number are NaN. Raises InputError for a file without a table.
    """
    with path.open(encoding=encoding_of(path)) as file:
        head = [line.rstrip("\r\n") for line, _ in zip(file, range(HEAD), strict=False)]
    skip, separator = _begins(path, head)
    named = not holds_numbers(path, skip, separator)
    frame = frame_of(path, separator, skip, named)
    if not named:
        frame.columns = _names_above(head[:skip], frame.width) or [str(i) for i in range(1, frame.width + 1)]
    elif frame.height:
        below = [str(cell or "").strip(" []()\"'") for cell in frame.row(0)]
        if sum(bool(unit_written(plain(cell))) for cell in below) > len(below) / 2:  # a line of units
            names = [f"{n} [{u}]" if u not in ("", "-") else n for n, u in zip(frame.columns, below, strict=True)]
            frame = frame[1:]
            frame.columns = names
    columns: dict[str, Array] = {}
    angles, others = set(), []
    for name in frame.columns:
        text = frame[name].str.strip_chars().str.strip_chars("\"'").str.strip_chars()
        values, sexagesimal = _values(name, text, separator, dates or Dates())
        if np.count_nonzero(np.isfinite(values)) > len(values) / 2:
            columns[name] = values
            angles |= {name} if sexagesimal else set()
        else:
            others.append(name)
    if len(columns) < LEAST_COLUMNS:
        raise InputError(
            f"{path} holds {len(columns)} columns of numbers: no log of a unit, or in a form that is not text"
        )
    above = tuple(line for line in (*head[:skip], *(line for line in head[skip:] if line.startswith("#"))))
    return Table(columns, frozenset(angles), above, tuple(others))


def _values(name: str, text: object, separator: str, dates: Dates) -> tuple[Array, bool]:
    """The numbers of a column, and whether they were written as degrees or hours, minutes and seconds."""
    import polars as pl

    assert isinstance(text, pl.Series)
    seen = text.drop_nulls()
    seen = seen.filter(seen != "")
    first = str(seen[0]) if len(seen) else ""
    guess = by_name(name)
    if is_date(first) and (
        "-" in first[1:] or (guess and guess.quantity == "time") or not SEXAGESIMAL.fullmatch(first)
    ):
        try:
            return np.asarray(dates.seconds(text)), False
        except NoDateError:
            pass
    if SEXAGESIMAL.fullmatch(first):
        return np.array([_in_first_unit(cell) for cell in text.to_list()]), True
    plain_text = text.str.replace(",", ".", literal=True) if separator in ";\t" else text
    return plain_text.cast(pl.Float64, strict=False).to_numpy().astype(float), False


def _in_first_unit(cell: str | None) -> float:
    """``"-00:30:36"`` is -0.51: the sign belongs to the whole."""
    if cell is None or not SEXAGESIMAL.fullmatch(cell):
        return np.nan
    parts = [float(part) for part in re.findall(r"\d+\.?\d*", cell)]
    return (-1.0 if cell.lstrip().startswith("-") else 1.0) * sum(x / 60**i for i, x in enumerate(parts[:3]))


def _begins(path: Path, head: Sequence[str]) -> tuple[int, str]:
    """How many lines stand before a table, and its separator."""
    best = (0, 0, 0, ",")
    for mark in (";", "\t", ",", " "):
        counts = [len(line.split()) if mark == " " else line.count(mark) + 1 for line in head if _counts(line)]
        usual = max(set(counts), key=counts.count, default=0)
        begins = next((i for i, line in enumerate(head) if _counts(line)
                       and (len(line.split()) if mark == " " else line.count(mark) + 1) == usual), 0)  # fmt: skip
        if usual >= LEAST_COLUMNS:
            best = max(best, (counts.count(usual), usual, begins, mark), key=lambda b: (b[0], b[1]))
    if not best[1]:
        raise InputError(f"{path} holds no table of {LEAST_COLUMNS} columns or more; give a text log of a unit")
    return best[2], best[3]


def _counts(line: str) -> bool:
    return bool(line.strip()) and not line.startswith("#")


def _names_above(above: Sequence[str], columns: int) -> list[str]:
    """The words of the last comment above the numbers, if there is one for each column: many logs name them there."""
    for line in reversed(above):
        if not line.startswith(("#", "%", "!", "//")):
            continue
        text = re.sub(r"\s+([\[(])", r"\1", line.lstrip("#%!/ ").strip())
        for pattern in (r"\s*[;,\t|]\s*", r"[\s,;|]+"):
            words = [word for word in re.split(pattern, text) if word]
            if len(words) == columns and len(set(words)) == columns:
                return words
    return []
