"""Dates as people and spreadsheets write them, as ISO 8601: 14.06.2026 8:05, 6/14/2026 8:05 PM, or two columns."""

from __future__ import annotations

import re
from collections.abc import Sequence

DAY = re.compile(r"\s*(\d{1,4})\s*([./-])\s*(\d{1,2})\s*\2\s*(\d{1,4})\.?\s*")
_AFTER = re.compile(r"^([^\s,]+),\s*")  # a comma behind the day
_NAMED = re.compile(r"\s*(\d{1,4})[-. ]+([A-Za-zäé]{3,9})\.?[-., ]+(\d{1,4})(?=[ T,]|$)")
_NAMES_OF_MONTHS = (
    "jan,feb fév,mar mär mrz,apr avr,may mai,jun,jul,aug,sep,oct okt,nov,dec dez déc"  # English, German, French
)
_MONTHS = {name: number for number, names in enumerate(_NAMES_OF_MONTHS.split(","), start=1) for name in names.split()}
FRACTION_BEHIND_COLON = re.compile(r"(\d{1,2}:\d{2}:\d{2}):(\d{1,6})")
TIME = re.compile(r"\s*(\d{1,2}):(\d{2})(?::(\d{2}(?:[.,]\d+)?))?\s*([AaPp])?\.?(?:[Mm]\.?)?\s*(Z|UTC)?\s*")


def _in_numbers(cell: str) -> str:
    """Return a day whose month has a name, 11-Mar-2026, as 11-03-2026; other cells as they are."""
    match = _NAMED.match(cell)
    month = _MONTHS.get(match[2].lower()[:3]) if match else None
    return f"{match[1]}-{month:02d}-{match[3]}{cell[match.end() :]}" if match and month else cell


def is_day(cell: str) -> bool:
    """Return whether a cell names a day, and no time.

    >>> is_day("14.06.2026"), is_day("2026-06-14"), is_day("3.14")
    (True, True, False)
    """
    match = DAY.fullmatch(_in_numbers(cell))
    return match is not None and max(len(match[1]), len(match[4])) == 4


def is_stamp(cell: str) -> bool:
    """Return whether a cell names a day and a time in a form other than ISO 8601.

    >>> is_stamp("6/14/2026 8:05:10 PM"), is_stamp("14-Jun-2026 08:05:10"), is_stamp("2026-06-14 08:05:10")
    (True, True, False)
    """
    day, _, time = _AFTER.sub(r"\1 ", _in_numbers(cell.strip())).partition(" ")
    return is_day(day) and TIME.fullmatch(time) is not None and re.match(r"\d{4}-\d\d-\d\d ", cell.strip()) is None


def in_iso(days: Sequence[str], times: Sequence[str]) -> list[str]:
    """Return days and times of rows as ISO 8601; what is neither is empty.

    A number beyond 12 shows which of two is the day; else it follows from dots (the day first) and
    slashes (the month first).
    """
    matches = [DAY.fullmatch(_in_numbers(day)) for day in days]
    slashed = any(f and f[2] == "/" for f in matches)
    first_beyond = any(f and len(f[4]) == 4 and int(f[1]) > 12 for f in matches)
    month_first = slashed and not first_beyond
    return [_one(f, TIME.fullmatch(time), month_first) for f, time in zip(matches, times, strict=True)]


def with_decimal_seconds(cells: Sequence[str]) -> list[str]:
    """Return times of day whose fraction of a second stands behind a third colon with a decimal point there.

    All fractions count in the unit of the longest: tenths where all have one digit, ms where some have three.

    >>> with_decimal_seconds(["14:45:28:8", "14:45:28:120"])
    ['14:45:28.008', '14:45:28.120']
    """
    matches = [FRACTION_BEHIND_COLON.fullmatch(cell) for cell in cells]
    digits = max((len(m[2]) for m in matches if m), default=0)
    return [f"{m[1]}.{m[2].zfill(digits)}" if m else "" for m in matches]


def split_stamps(cells: Sequence[str]) -> tuple[list[str], list[str]]:
    """Return days and times of stamps."""
    both = [_AFTER.sub(r"\1 ", _in_numbers(cell.strip())).partition(" ") for cell in cells]
    return [day for day, _, _ in both], [time for _, _, time in both]


def _one(day: re.Match[str] | None, time: re.Match[str] | None, month_first: bool) -> str:
    if day is None or time is None:
        return ""
    a, b, c = day[1], day[3], day[4]
    year, month, date = (a, b, c) if len(a) == 4 else (c, a, b) if month_first else (c, b, a)
    hour = int(time[1])
    if time[4]:
        hour = hour % 12 + (12 if time[4].lower() == "p" else 0)
    return f"{int(year):04d}-{int(month):02d}-{int(date):02d}T{hour:02d}:{time[2]}:{time[3] or '00'}"
