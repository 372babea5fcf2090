"""The table in an undescribed text file: its separator, names and units, the rows of one kind, their numbers.

The rows of a table are the lines in which most cells are numbers; the separator and the number of cells are those that
most of such lines share. What stands above them names the columns wherever it has as many cells. Lines of other kinds
among the rows are skipped and counted.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gimbalcal.errors import InputError
from gimbalcal.guess import date_formats
from gimbalcal.guess.column_names import by_name, is_unit, plain_name, unit_written
from gimbalcal.guess.message_log import tables_in
from gimbalcal.importers.pointing_files import sexagesimal
from gimbalcal.importers.text_file import encoding_of, frame_of
from gimbalcal.number import Array
from gimbalcal.recording.dates import Dates, NoDateError, is_date
from gimbalcal.recording.lines import cells_of, comment_words

if TYPE_CHECKING:
    import polars as pl

HEAD_LINES, MIN_COLUMNS, MAX_NUMBER = 400, 2, 1e30  # lines that show how a log is written; of a table and its cells
MIN_SHARE = 0.4  # of the lines below the first row that are rows of the table
SEXAGESIMAL = re.compile(
    r"\s*[-+]?\d{1,3}\s*[°hd]\s*\d{1,2}([.,]\d*)?\s*['′m]\s*|"
    r"\s*[-+]?\d{1,3}\s*[:°hd ]\s*\d{1,2}\s*[:'′m ]\s*\d{1,2}([.,]\d*)?\s*[\"″s]?\s*"
)
COMMENT = re.compile(r"\s*(#|%|!|//|/(?=\W|$))")
_MARKS = (";", "\t", ",", "|", "  ", " ")  # separators; two blanks or more are one for cells that hold single ones
_HEADING = ("name", "names", "channel", "channels")  # before what the columns are called
_PLUS_MINUS = ("+-", "+/-", "±")  # before the sigma of the column to its left
_MOVING = re.compile(r"^(move|moving|slew|slewing|turn|turning|transit|none|drehen|fahrt|bewegung)$", re.IGNORECASE)
_DOUBLE = r"([\d.])[dD]([-+]\d{2,3})$"  # of Fortran
_NUMBER = re.compile(
    r"[-+]?\d{1,3}((\.\d{3})+,|(,\d{3})+\.)\d*|"
    r"[-+]?(\d+([.,]\d*)?|[.,]\d+)([eE][-+]?\d+|[dD][-+]\d{2,3})?|[-+]?(nan|inf|NaN|NA|null)"
)
_DECIMAL = re.compile(r"[-+]?\d+\.\d+")
_STATED_RATE = re.compile(
    r"\b(?:fs|f_s|sampl(?:e|ing)[ _]?(?:rate|freq\w*)|data[ _]?rate|rate|freq(?:uency)?|abtastrate)\b"
    r"\W{0,4}(\d+(?:\.\d+)?)",
    re.IGNORECASE,
)


@dataclass(frozen=True)
class TableLayout:
    """Separator, the line of the first row (from 0), the number of its cells, and the names of the columns, or none."""

    separator: str
    first: int
    width: int
    names: tuple[str, ...]


@dataclass(frozen=True)
class Table:
    """Columns of numbers by name, which of them were sexagesimal (in their first unit), and the text above them."""

    columns: dict[str, Array]
    sexagesimal: frozenset[str] = frozenset()
    above: tuple[str, ...] = ()
    others: tuple[str, ...] = field(default=())  # columns that hold no numbers
    dates: frozenset[str] = frozenset()  # columns of dates and times of day, in seconds
    day: str = ""  # from whose midnight dates are counted, ISO 8601; empty where they name none
    named: bool = True
    skipped: int = 0  # lines of other kinds among the rows

    @property
    def rate(self) -> tuple[float, str] | None:
        """Return the rate of the rows [Hz] that a line above them states, and that line."""
        stated = ((m, line) for line in self.above if (m := _STATED_RATE.search(line)))
        return next(((float(m[1]), line.strip()) for m, line in stated if float(m[1]) > 0), None)


def tables_of(path: Path, dates: Dates | None = None) -> dict[Path, Table]:
    """Return the table in a text file, see `table_of`, or those of its messages by path/word. Raises InputError."""
    messages, skipped = tables_in(path, head_of(path))
    if not messages:
        return {path: table_of(path, dates)}
    tables = {path / word: table_of(path, dates, lines) for word, lines in messages.items()}
    first, table = next(iter(tables.items()))
    return tables | {first: replace(table, skipped=table.skipped + skipped)}


def table_of_files(paths: Sequence[Path]) -> Table | None:
    """Return the table whose columns stand in a text file each, by the names of the files; None for other files."""
    if len(paths) < MIN_COLUMNS or not all(_NUMBER.fullmatch(next(iter(head_of(p)), "").strip()) for p in paths):
        return None
    columns = {}
    for path in paths:
        try:
            columns[path.stem] = np.loadtxt(path, comments=None, ndmin=1, encoding=encoding_of(path))
        except ValueError:
            return None
    rows = {len(x) for x in columns.values() if x.ndim == 1}
    return Table(columns) if len(columns) == len(paths) and len(rows) == 1 else None


def head_of(path: Path) -> list[str]:
    """Return the first lines of a text file, without zero bytes."""
    with path.open(encoding=encoding_of(path), errors="replace") as file:
        return [line.rstrip("\r\n").replace("\0", "") for line, _ in zip(file, range(HEAD_LINES), strict=False)]


def table_of(path: Path, dates: Dates | None = None, lines: Sequence[str] | None = None) -> Table:
    """Return every column of numbers of a text table, by its name; dates of ISO 8601 are seconds, counted as `dates`
    does.

    A decimal comma is understood where commas do not separate, a line of units below the names goes to the names, and
    a table without names has its columns called by number. Cells that hold no number are NaN. Raises InputError for a
    file without a table. lines: of the file, where they were made plainer.
    """
    head = head_of(path) if lines is None else list(lines[:HEAD_LINES])
    layout = _layout(head)
    if layout is None:
        like = next((line.strip()[:60] for line in head[::-1] if line.strip()), "")
        raise InputError(
            f"{path} holds no table of {MIN_COLUMNS} columns or more: its lines are like {like!r}; write numbers in "
            "columns with names above them, time acc_x acc_y acc_z, or ra_true dec_true ra_mount dec_mount LST"
        )
    frame, skipped = _rows(path, layout, head, lines)
    frame = _one_stamp(frame)
    clock = dates or Dates()
    # a column leaves the frame as it becomes numbers: of a long log there is never all of both
    table = table_of_columns((n, *values_of(n, frame.drop_in_place(n), layout.separator, clock)) for n in frame.columns)
    if len(table.columns) < MIN_COLUMNS:
        raise InputError(
            f"{path} holds {len(table.columns)} columns of numbers: no log of a unit, or in a form that is not text"
        )
    if not any(np.isfinite(x).all() for x in table.columns.values()):
        empty = ~np.any([np.isfinite(x) for x in table.columns.values()], axis=0)
        skipped += int(empty.sum())
        table = replace(table, columns={n: x[~empty] for n, x in table.columns.items()})
    above = (*head[: layout.first], *(line for line in head[layout.first :] if line.startswith("#")))
    return replace(table, above=above, day=clock.day, named=bool(layout.names), skipped=skipped)


def _rows(
    path: Path, layout: TableLayout, head: Sequence[str], lines: Sequence[str] | None
) -> tuple[pl.DataFrame, int]:
    """Return the cells of the table, as text or numbers, and how many lines of other kinds were skipped.

    Raises InputError where most of the lines are of other kinds.
    """
    mark, first = layout.separator, layout.first
    quoted = not (mark != " " and any(_seconds_marked(line, mark) for line in head[first:]))
    comments = Counter(m[1] for line in head if (m := COMMENT.match(line)))
    comment = max(comments, key=comments.__getitem__, default="#")
    try:
        if mark != "  ":
            numbers = [bool(_DECIMAL.fullmatch(cell)) for cell in _cells(head[first], mark)]
            return _with_headings(frame_of(path, mark, first, False, quoted, lines, comment, numbers), layout.names), 0
    except InputError:  # a row with more cells than the first
        pass
    every = path.read_text(encoding=encoding_of(path), errors="replace").splitlines() if lines is None else lines
    below = [line for line in every[first:] if line.strip() and not COMMENT.match(line)]
    cells = [_cells(line, mark) for line in below]
    most = max(layout.width, len(layout.names))  # a last column of remarks is often left empty
    rows = [row[: layout.width] for row in cells if layout.width <= len(row) <= most]
    if len(rows) < MIN_SHARE * len(cells):
        like = next(line for line, row in zip(below, cells, strict=True) if len(row) != layout.width)
        raise InputError(
            f"{path}: {len(rows)} of {len(cells)} lines have {layout.width} cells, and others like "
            f"{like.strip()[:60]!r} do not; put the rows of one kind into a file of their own, with names above"
        )
    clean = ["\t".join(cell.replace("\t", " ") for cell in row) for row in rows]
    return _with_headings(frame_of(path, "\t", 0, False, False, clean, ""), layout.names), len(cells) - len(rows)


def _with_headings(frame: pl.DataFrame, headings: Sequence[str]) -> pl.DataFrame:
    """Return the frame with its columns called by the headings, by number where there is none; no name stands twice."""
    names = [name or str(i) for i, name in enumerate(headings or [""] * frame.width, start=1)]
    names = [*names, *map(str, range(len(names) + 1, frame.width + 1))][: frame.width]
    twice = Counter(names)
    frame.columns = [f"{n} ({i})" if twice[n] > 1 else n for i, n in enumerate(names, start=1)]
    return frame


def table_of_columns(columns_of_text: Iterable[tuple[str, Array, str]]) -> Table:
    """Return the table of columns (n,) by name and form, see `values_of`; cells that hold hardly a number make none.

    What was stored as a "number" is a column however few there are, if any. Numbers beyond `MAX_NUMBER` are NaN.
    """
    columns: dict[str, Array] = {}
    forms: dict[str, set[str]] = {"angle": set(), "date": set()}
    others = []
    for name, numbers, form in columns_of_text:
        sound = np.abs(numbers) < MAX_NUMBER
        count = np.count_nonzero(sound)
        if count <= (0.0 if form == "number" else 0.4) * len(numbers):
            others.append(name)
            continue
        whole = numbers.dtype == float and count == len(numbers)
        columns[name] = numbers if whole else np.where(sound, numbers, np.nan)
        forms.setdefault(form, set()).add(name)
    return Table(columns, frozenset(forms["angle"]), (), tuple(others), frozenset(forms["date"]))


def _one_stamp(frame: pl.DataFrame) -> pl.DataFrame:
    """Return the frame with a day and a time of day that stand in two columns as one, by the name of the time."""
    import polars as pl

    if not frame.height:
        return frame
    first = {name: str(frame[name][0] or "").strip(" \"'") for name in frame.columns}
    day = next((n for n, cell in first.items() if date_formats.is_day(cell)), "")
    times = [n for n, cell in first.items() if date_formats.TIME.fullmatch(cell)]
    adjacent = [
        n for n in times if (day and (n, day) in pairwise(frame.columns)) or (day, n) in pairwise(frame.columns)
    ]
    time = next((n for n in times if (g := by_name(n)) and g.quantity == "time"), next(iter(adjacent), ""))
    if not day or not time:
        return frame
    days, hours = ([str(cell or "").strip(" \"'") for cell in frame[n].to_list()] for n in (day, time))
    return frame.with_columns(pl.Series(time, date_formats.in_iso(days, hours))).drop(day)


def values_of(name: str, text: object, separator: str, dates: Dates) -> tuple[Array, str]:
    """Return the numbers of a column, and whether they were a "date" or an "angle" of degrees or hours."""
    import polars as pl

    assert isinstance(text, pl.Series)
    numbers = text.cast(pl.Float64, strict=False)
    all_numbers = numbers.null_count() == text.null_count()  # as they stand: nothing else is searched cell by cell
    if not all_numbers:
        text = text.str.strip_chars().str.strip_chars("\"'").str.strip_chars()
    filled = text.drop_nulls()
    filled = filled if all_numbers else filled.filter(filled != "")
    first = str(filled[0]).strip() if len(filled) else ""
    guess = by_name(name)
    if date_formats.FRACTION_BEHIND_COLON.fullmatch(first):
        text = pl.Series(name, date_formats.with_decimal_seconds([str(cell or "") for cell in text.to_list()]))
        first = str(text[0])
    if date_formats.is_stamp(first):
        text = pl.Series(
            name, date_formats.in_iso(*date_formats.split_stamps([str(cell or "") for cell in text.to_list()]))
        )
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
    if all_numbers:
        return numbers.to_numpy(writable=True), ""
    for mark, decimal in ((".", ","), (",", ".")):  # 1.000,5 and 1,000.5
        if text.str.contains(rf"^[-+]?\d{{1,3}}(\{mark}\d{{3}})+\{decimal}\d*$").any():
            text = text.str.replace_all(mark, "", literal=True)
    plain_text = text.str.replace(",", ".", literal=True) if separator != "," else text
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
    first, *others = re.findall(r"\d+\.?\d*", cell.replace(",", "."))[:3]
    return sexagesimal([f"-{first}" if cell.lstrip().startswith("-") else first, *others])


def _layout(head: Sequence[str]) -> TableLayout | None:
    """Return how the table in the first lines of a file is written; None where they hold none."""
    best: tuple[float, int, str, int] = (0.0, 0, ",", 0)
    for mark in _MARKS:
        begins: dict[int, list[tuple[int, list[str]]]] = {}  # lines of numbers by their width
        for i, line in enumerate(head):
            row = [] if COMMENT.match(line) else _cells(line, mark)
            if len(row) >= MIN_COLUMNS and _share_of_numbers(row) > 0.5:
                begins.setdefault(len(row), []).append((i, row))
        for width, lines in begins.items():
            score = sum(_share_of_numbers(row) for _, row in lines)
            score *= 0.9 if mark == " " else 1.0  # a blank also separates what others do, and dates from times
            words = [frozenset(_wordy_cells(row)) for _, row in lines]
            usual = Counter(words).most_common(1)[0][0]  # a line of settings may hold a word and numbers, too
            first = next(i for (i, _), own in zip(lines, words, strict=True) if own <= usual)
            if mark == "  " and not _names(head[:first], mark, width, _cells(head[first], mark)):
                continue  # a blank within a cell is a separator where no names say otherwise
            best = max(best, (score, width, mark, first), key=lambda b: b[:2])
    score, width, mark, first = best
    if not score:
        return None
    rows = [row for line in head[first:] if len(row := _cells(line, mark)) == width]
    names = _names(head[:first], mark, width, rows[0])
    if not names and (number := _number_of_rows(rows)) is not None:  # which a data frame writes without a name
        others = [*rows[0][:number], *rows[0][number + 1 :]]
        names = _names(head[:first], mark, width - 1, others)
        names = (*names[:number], "", *names[number:]) if names else ()
    return TableLayout(mark, first, width, names)


def _number_of_rows(rows: Sequence[Sequence[str]]) -> int | None:
    """Return which cell, the first or the last, numbers the rows one by one; None where neither does."""
    for k in (0, len(rows[0]) - 1):
        cells = [row[k].strip(" \"'") for row in rows]
        whole = len(cells) > 2 and cells[0] in ("0", "1") and all(map(str.isdecimal, cells))
        if whole and all(int(b) == int(a) + 1 for a, b in pairwise(cells)):
            return k
    return None


def _cells(line: str, mark: str) -> list[str]:
    """Return the cells of a line, empty of one without any; a separator within quotes is none."""
    if not line.strip():
        return []
    if mark == "  ":
        return re.split(r"\s{2,}|\t\s*", line.strip())
    if mark == " ":
        return line.split()
    if line.count('"') >= 2 and not _seconds_marked(line, mark):
        return cells_of(line, mark, skipinitialspace=True)
    return line.split(mark)


def _names(above: Sequence[str], mark: str, width: int, row: Sequence[str]) -> tuple[str, ...]:
    """Return what the lines above the first row call its columns; none where no line has a word for each.

    The line with the most words that are known is taken, of equals the last. Units in a line below the names, and
    groups of columns in a line above them, belong to the names; so does what a line below holds for the first alone.
    """
    filled = 1 + max((i for i, cell in enumerate(row) if _is_numeric(cell.strip(" \"'"))), default=0)
    best: tuple[int, int, tuple[str, ...]] = (-1, -1, ())
    for i, line in enumerate(above):
        for cells in _headings(line, mark, width, filled):
            known = sum(map(_is_known_word, cells)) + width * (cells[0].lower() in _HEADING)
            if (known, i) >= best[:2] and not (best[0] >= 0 and _holds_units(cells)):
                best = known, i, cells
                break
    known, at, names = best
    if at < 0:
        return ()
    upper, lower = (_padded_cells(above[i], mark, width) if 0 <= i < len(above) else () for i in (at - 1, at + 1))
    first, *others = _cells(above[at + 1], mark) if 0 <= at + 1 < len(above) else [""]
    if not names[0] and not any(map(str.strip, others)):  # as data frames with groups of columns write their index
        names = (first.strip(), *names[1:])
    filled_names = [name for name in names if name]
    repeated = len(set(filled_names)) < 0.7 * len(filled_names)
    if repeated and upper and any(map(_holds_letters, upper)):
        groups = list(upper)
        for k in range(1, width):
            groups[k] = groups[k] or groups[k - 1]
        return tuple(f"{group} {name}".strip() for group, name in zip(groups, names, strict=True))
    if lower and not COMMENT.match(above[at + 1]) and _holds_units(lower):
        units = [cell.strip(" []()\"'") for cell in lower]
        return tuple(f"{n} [{u}]" if u not in ("", "-") else n for n, u in zip(names, units, strict=True))
    return names


def _headings(line: str, mark: str, width: int, filled: int) -> Iterator[tuple[str, ...]]:
    """Yield the ways to read a line as names of `width` columns, of which the first row has numbers up to `filled`."""
    most, comment = width + 1, COMMENT.match(line)
    text = line[comment.end() :] if comment else line
    if not comment:
        ways = [_cells(re.sub(r"(?<=[\])])(?=[A-Za-z])", mark, text), mark), _cells(text, mark)]
        if mark == " ":
            ways.append(re.sub(r"\s+([\[(])", r"\1", text.strip()).split())
    else:
        ways = [_cells(text.strip(), mark), *comment_words(line)]
    for way in ways:
        cells = [cell.strip().strip("\"'").strip() for cell in way]
        while cells and not cells[-1]:
            cells.pop()
        if comment:
            cells = [f"{cells[k - 1]} sigma" if w in _PLUS_MINUS and k else w for k, w in enumerate(cells)]
            if len(cells) > width and 2 * sum(map(_is_known_word, cells[-width:])) >= width:
                cells = cells[-width:]  # remarks may stand before the names
        elif width < len(cells) <= most + 1 and mark != " " and any(map(by_name, cells[:width])):
            cells, width = cells[:most], len(cells[:most])
        worded = sum(map(_holds_letters, cells))
        if (
            filled <= len(cells) <= width
            and worded
            and 2 * worded >= sum(map(bool, cells)) > 0
            and _share_of_numbers(cells) < 0.5
        ):
            yield tuple(cells + [""] * (width - len(cells)))


def _padded_cells(line: str, mark: str, width: int) -> tuple[str, ...]:
    """Return the cells of a line that has no more than `width`, filled up with empty ones; none for a longer line."""
    cells = [cell.strip().strip("\"'").strip() for cell in _cells(line, mark)]
    while cells and not cells[-1]:
        cells.pop()
    return tuple(cells + [""] * (width - len(cells))) if 1 < len(cells) <= width else ()


def _is_known_word(word: str) -> bool:
    """Return whether a word names a column of a log, or has a unit in brackets."""
    return by_name(word) is not None or bool(re.search(r"[\[(]", word) and unit_written(plain_name(word)))


def _wordy_cells(row: Sequence[str]) -> Iterator[int]:
    """Yield the places of the cells that hold something that is no number."""
    for i, cell in enumerate(row):
        if (text := cell.strip(" \"'")) and not _is_numeric(text):
            yield i


def _is_numeric(cell: str) -> bool:
    """Return whether a cell is a number, an angle or a date."""
    if any(form.fullmatch(cell) for form in (_NUMBER, SEXAGESIMAL, date_formats.FRACTION_BEHIND_COLON)):
        return True
    return cell[:1].isdigit() and (is_date(cell) or date_formats.is_day(cell) or date_formats.is_stamp(cell))


def _share_of_numbers(row: Sequence[str]) -> float:
    """Return which share of the cells that are filled are numbers, angles or dates; 0 where fewer than two are."""
    cells = [text for cell in row if (text := cell.strip(" \"'"))]
    known = sum(map(_is_numeric, cells))
    return known / len(cells) if known >= MIN_COLUMNS else 0.0


def _seconds_marked(line: str, mark: str) -> bool:
    """Return whether quotation marks stand for seconds of arc: behind a digit, and none before."""
    return any(re.fullmatch(r'[^"]*\d\s*"\s*', cell) for cell in line.split(mark))


def _holds_letters(cell: str) -> bool:
    return bool(re.search(r"[^\W\d_]", cell))


def _holds_units(row: Sequence[str]) -> bool:
    """Return whether a line below the names holds units: most of its cells do, or nothing."""
    below = [cell.strip(" []()\"'") for cell in row]
    known = sum(map(is_unit, below))
    return known > 0 and sum(is_unit(c) or not _holds_letters(c) for c in below) > len(below) / 2
