"""The table in a text file that nobody described: where it begins, its separator, names and units, its numbers."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gimbalcal.errors import InputError
from gimbalcal.guess import date_formats
from gimbalcal.guess.column_names import by_name, plain, unit_written
from gimbalcal.guess.message_log import tables_in
from gimbalcal.importers.delimited import encoding_of, frame_of
from gimbalcal.number import Array
from gimbalcal.recording.dates import Dates, NoDateError, is_date
from gimbalcal.recording.lines import comment_words

if TYPE_CHECKING:
    import polars as pl

HEAD_LINES, MIN_COLUMNS = 200, 3  # lines that show how a log is written, and columns of one that holds a triad
SEXAGESIMAL = re.compile(
    r"\s*[-+]?\d{1,3}\s*[°hd]\s*\d{1,2}([.,]\d*)?\s*['′m]\s*|"
    r"\s*[-+]?\d{1,3}\s*[:°hd ]\s*\d{1,2}\s*[:'′m ]\s*\d{1,2}([.,]\d*)?\s*[\"″s]?\s*"
)


_BESIDE = ("+-", "+/-", "±")  # what the column before is known to
_MOVING = re.compile(r"^(move|moving|slew|slewing|turn|turning|transit|none|drehen|fahrt|bewegung)$", re.IGNORECASE)
_DOUBLE = r"([\d.])[dD]([-+]\d{2,3})$"  # of Fortran
_NUMBER = re.compile(
    r"[-+]?\d{1,3}((\.\d{3})+,|(,\d{3})+\.)\d*|"
    r"[-+]?(\d+([.,]\d*)?|[.,]\d+)([eE][-+]?\d+|[dD][-+]\d{2,3})?|[-+]?(nan|inf|NaN|NA|null)"
)


@dataclass(frozen=True)
class TableLayout:
    """Lines before a table (its line of names belongs to it), its separator, and whether it has names."""

    skip: int
    separator: str
    named: bool


@dataclass(frozen=True)
class Table:
    """Columns of numbers by name, which of them were sexagesimal (in their first unit), and the text above them."""

    columns: dict[str, Array]
    sexagesimal: frozenset[str] = frozenset()
    above: tuple[str, ...] = ()
    others: tuple[str, ...] = field(default=())  # columns that hold no numbers
    dates: frozenset[str] = frozenset()  # columns of dates and times of day, in seconds
    day: str = ""  # from whose midnight dates are counted, ISO 8601; empty where they name none


def tables_of(path: Path, dates: Dates | None = None) -> dict[Path, Table]:
    """Return the table in a text file, see `table_of`, or those of its messages by path/word. Raises InputError."""
    with path.open(encoding=encoding_of(path)) as file:
        head = [line.rstrip("\r\n") for line, _ in zip(file, range(HEAD_LINES), strict=False)]
    messages = tables_in(path, head)
    if not messages:
        return {path: table_of(path, dates)}
    return {path / word: table_of(path, dates, lines) for word, lines in messages.items()}


def table_of(path: Path, dates: Dates | None = None, lines: Sequence[str] | None = None) -> Table:
    """Return every column of numbers of a text table, by its name; dates of ISO 8601 are seconds, counted as `dates`
    does.

    Lines before the table are skipped, the separator is the one that most lines share, a decimal comma is understood
    beside semicolons and tabs, a line of units below the names goes to the names, and a table without names has its
    columns called by number. Cells that hold no number are NaN. Raises InputError for a file without a table.
    lines: of the file, where they were made plainer.
    """
    if lines is None:
        with path.open(encoding=encoding_of(path)) as file:
            head = [line.rstrip("\r\n") for line, _ in zip(file, range(HEAD_LINES), strict=False)]
    else:
        head = list(lines[:HEAD_LINES])
    layout = _layout(head)
    if layout is None:
        like = next((line.strip()[:60] for line in head[::-1] if line.strip()), "")
        raise InputError(
            f"{path} holds no table of {MIN_COLUMNS} columns or more: its lines are like {like!r}; write numbers in "
            "columns with names above them, time acc_x acc_y acc_z, or ra_true dec_true ra_mount dec_mount LST"
        )
    skip, separator, named = layout.skip, layout.separator, layout.named
    marked = separator != " " and any(_seconds_marked(line, separator) for line in head[skip:])
    frame = frame_of(path, separator, skip, named, quoted=not marked, lines=lines)
    if not named:
        frame.columns = _names_above(head[:skip], frame.width) or [str(i) for i in range(1, frame.width + 1)]
    elif frame.height:
        below = [str(cell or "") for cell in frame.row(0)]
        if not _holds_numbers(below) and _holds_units(below):
            units = [cell.strip(" []()\"'") for cell in below]
            names = [f"{n} [{u}]" if u not in ("", "-") else n for n, u in zip(frame.columns, units, strict=True)]
            frame = frame[1:]
            frame.columns = names
    frame = _one_stamp(frame)
    clock = dates or Dates()
    texts = ((n, frame[n].str.strip_chars().str.strip_chars("\"'").str.strip_chars()) for n in frame.columns)
    table = table_of_columns((name, *values_of(name, text, separator, clock)) for name, text in texts)
    if len(table.columns) < MIN_COLUMNS:
        raise InputError(
            f"{path} holds {len(table.columns)} columns of numbers: no log of a unit, or in a form that is not text"
        )
    above = (*head[:skip], *(line for line in head[skip:] if line.startswith("#")))
    return replace(table, above=above, day=clock.day)


def table_of_columns(columns_of_text: Iterable[tuple[str, Array, str]]) -> Table:
    """Return the table of columns (n,) by name and form, see `values_of`; cells that hold hardly a number make none.

    What was stored as a "number" is a column however few there are.
    """
    columns: dict[str, Array] = {}
    forms: dict[str, set[str]] = {"angle": set(), "date": set()}
    others = []
    for name, values, form in columns_of_text:
        if form != "number" and np.count_nonzero(np.isfinite(values)) <= len(values) / 2:
            others.append(name)
            continue
        columns[name] = values
        forms.setdefault(form, set()).add(name)
    return Table(columns, frozenset(forms["angle"]), (), tuple(others), frozenset(forms["date"]))


def _one_stamp(frame: pl.DataFrame) -> pl.DataFrame:
    """Return the frame with a day and a time of day that stand in two columns as one, by the name of the time."""
    import polars as pl

    if not frame.height:
        return frame
    first = {name: str(frame[name][0] or "").strip(" \"'") for name in frame.columns}
    day = next((n for n, cell in first.items() if date_formats.is_day(cell)), "")
    time = next(
        (
            n
            for n, cell in first.items()
            if date_formats.TIME.fullmatch(cell) and (g := by_name(n)) and g.quantity == "time"
        ),
        "",
    )
    if not day or not time:
        return frame
    days, times = ([str(cell or "").strip(" \"'") for cell in frame[n].to_list()] for n in (day, time))
    return frame.with_columns(pl.Series(time, date_formats.in_iso(days, times))).drop(day)


def values_of(name: str, text: object, separator: str, dates: Dates) -> tuple[Array, str]:
    """Return the numbers of a column, and whether they were a "date" or an "angle" of degrees or hours."""
    import polars as pl

    assert isinstance(text, pl.Series)
    filled = text.drop_nulls()
    filled = filled.filter(filled != "")
    first = str(filled[0]) if len(filled) else ""
    guess = by_name(name)
    if date_formats.is_stamp(first):
        text = pl.Series(name, date_formats.in_iso(*date_formats.split([str(cell or "") for cell in text.to_list()])))
        first = str(text[0])
    if is_date(first) and (
        "-" in first[1:] or (guess and guess.quantity == "time") or not SEXAGESIMAL.fullmatch(first)
    ):
        try:
            return np.asarray(dates.seconds(text)), "date"
        except NoDateError:
            pass
    if SEXAGESIMAL.fullmatch(first):
        return np.array([_in_first_unit(cell) for cell in text.to_list()]), "angle"
    if guess and guess.quantity == "position" and not _NUMBER.fullmatch(first):
        return _labels([str(cell or "") for cell in text.to_list()]), ""
    for mark, decimal in ((".", ","), (",", ".")):  # 1.000,5 and 1,000.5
        if text.str.contains(rf"^[-+]?\d{{1,3}}(\{mark}\d{{3}})+\{decimal}\d*$").any():
            text = text.str.replace_all(mark, "", literal=True)
    plain_text = text.str.replace(",", ".", literal=True) if separator in ";\t" else text
    plain_text = plain_text.str.replace(_DOUBLE, "${1}e${2}") if re.search(_DOUBLE, first) else plain_text
    return plain_text.cast(pl.Float64, strict=False).to_numpy().astype(float), ""


def _labels(cells: Sequence[str]) -> Array:
    """Return positions that are called "P01", "A", "face up": numbered as they come; 0 where a row has no such word."""
    numbers: dict[str, int] = {}

    def number(cell: str) -> float:
        labelled = re.search(r"\w", cell) and not _MOVING.search(cell)
        return float(numbers.setdefault(cell, len(numbers) + 1)) if labelled else 0.0

    return np.array([number(cell) for cell in cells])


def _in_first_unit(cell: str | None) -> float:
    """Return a sexagesimal cell in its first unit: ``"-00:30:36"`` is -0.51, the sign belongs to the whole."""
    if cell is None or not SEXAGESIMAL.fullmatch(cell):
        return np.nan
    parts = [float(part) for part in re.findall(r"\d+\.?\d*", cell.replace(",", "."))]
    return (-1.0 if cell.lstrip().startswith("-") else 1.0) * sum(x / 60**i for i, x in enumerate(parts[:3]))


def _layout(head: Sequence[str]) -> TableLayout | None:
    """Return where the table in the first lines of a file begins, and its separator.

    Most lines of one width in which most cells are numbers are the table; its names stand in the line above, or above a
    line of units. What stands higher, cells of a form included, is no part of it.
    """
    best: tuple[int, int, int, str] = (0, 0, 0, ",")
    cells = {mark: [_cells(line, mark) for line in head] for mark in (";", "\t", ",", " ")}
    for mark, rows in cells.items():
        begins: dict[int, list[int]] = {}  # lines of numbers by their width
        for i, row in enumerate(rows):
            if len(row) >= MIN_COLUMNS and _holds_numbers(row):
                begins.setdefault(len(row), []).append(i)
        for width, lines in begins.items():
            if mark != " " or 0.9 * len(lines) > best[0]:  # a blank also separates what tabs do
                best = max(best, (len(lines), width, lines[0], mark), key=lambda b: (b[0], b[3] != " ", b[1]))
    length, width, first, mark = best
    if not length:
        return None
    above = [(i, row) for i, row in enumerate(cells[mark][:first]) if row]
    if not above or head[above[-1][0]].startswith(("#", "!", "//")):
        return TableLayout(first, mark, False)
    names, row = above[-1]
    remarked = len(row) > width and mark != " " and any(map(by_name, row[:width]))  # a last column is often left empty
    if len(row) != width and not remarked:
        return TableLayout(first, mark, False)
    if len(above) > 1 and len(above[-2][1]) == width and _holds_units(row) and any(map(_holds_letters, above[-2][1])):
        names, row = above[-2]
    return TableLayout(names, mark, True) if any(map(_holds_letters, row)) else TableLayout(first, mark, False)


def _cells(line: str, mark: str) -> list[str]:
    """Return the cells of a line, empty of a comment or a line without any; a separator within quotes is none."""
    if not line.strip() or line.startswith("#"):
        return []
    if mark == " ":
        return line.split()
    if line.count('"') >= 2 and not _seconds_marked(line, mark):
        return next(csv.reader([line], delimiter=mark, skipinitialspace=True))
    return line.split(mark)


def _seconds_marked(line: str, mark: str) -> bool:
    """Return whether quotation marks stand for seconds of arc: behind a digit, and none before."""
    return any(re.fullmatch(r'[^"]*\d\s*"\s*', cell) for cell in line.split(mark))


def _holds_numbers(row: Sequence[str]) -> bool:
    """Return whether more than half of the cells that are filled are numbers, angles or dates, and two or more are."""
    filled = [text for cell in row if (text := cell.strip(" \"'"))]
    known = sum(bool(_NUMBER.fullmatch(text) or SEXAGESIMAL.fullmatch(text) or is_date(text)) for text in filled)
    return known >= MIN_COLUMNS - 1 and 2 * known > len(filled)


def _holds_letters(cell: str) -> bool:
    return bool(re.search(r"[^\W\d_]", cell))


def _holds_units(row: Sequence[str]) -> bool:
    """Return whether a line below the names holds units: most of its cells do, or nothing."""
    below = [cell.strip(" []()\"'") for cell in row]
    known = sum(bool(unit_written(plain(cell))) for cell in below)
    return known > 0 and sum(bool(unit_written(plain(c))) or not _holds_letters(c) for c in below) > len(below) / 2


def _names_above(above: Sequence[str], columns: int) -> list[str]:
    """Return the words of the comment above the numbers that names most of them, many logs have one; the last of
    equals.

    Words before the names ("22 GHz pointing, source AZ(deg) ...") do not count where the others are known.
    """
    best: tuple[int, list[str]] = (-1, [])
    for line in above:
        if not line.startswith(("#", "%", "!", "//")):
            continue
        for words in comment_words(line):
            tail = [f"{words[k - 1]} sigma" if w in _BESIDE and k else w for k, w in enumerate(words)][-columns:]
            if len(tail) < columns or len(set(tail)) < columns:
                continue
            known = sum(
                bool(by_name(word)) or bool(re.search(r"[\[(]", word) and unit_written(plain(word))) for word in tail
            )
            if (len(words) == columns or 2 * known >= columns) and known >= best[0]:
                best = known, tail
                break
    return best[1]
