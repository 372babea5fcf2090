"""Dates and times of ISO 8601 as seconds: ``2026-11-18T05:33:10.25+01:00``, or without a zone, or a time of day."""

from __future__ import annotations

from datetime import date, datetime
from typing import TYPE_CHECKING

import numpy as np

from gimbalcal.errors import InputError
from gimbalcal.number import Array

if TYPE_CHECKING:
    import polars as pl

ISO = "ISO 8601"
"""The unit of a time column that holds dates."""

_PARTS = (
    r"^\s*(?:(?<year>\d{4})-?(?<month>\d{2})-?(?<day>\d{2})[T_ ]\s*)?(?<hour>\d{2}):?(?<minute>\d{2})"
    r"(?::?(?<second>\d{2}(?:[.,]\d+)?))?\s*(?<zone>Z|z|UTC|[+-]\d{2}(?::?\d{2})?)?\s*$"
)


def names_iso(unit: object) -> bool:
    """Return whether the text of a unit means dates: "ISO 8601", however it is spelled."""
    plain = "".join(c for c in unit.lower() if c.isalnum()) if isinstance(unit, str) else ""
    return plain in ("iso", "iso8601", "isotime", "datetime", "rfc3339")


def is_date(cell: str) -> bool:
    """Return whether a cell is a date, or a time of day, and no number.

    >>> is_date("2026-11-18 05:33:10,25"), is_date("05:33:10"), is_date("20261118_053310"), is_date("20261118")
    (True, True, True, False)
    """
    import polars as pl

    if cell.strip().replace(",", ".").replace(".", "", 1).isdecimal():
        return False  # 0533 is a number
    return bool(pl.Series([cell]).str.contains(_PARTS).item())


class Dates:
    """Turns cells into seconds since midnight of the first one's day, so that a float holds nanoseconds.

    `start` names that midnight once the first cells were seen; `zoned` says whether they name a zone.
    """

    def __init__(self) -> None:
        self.midnight: int | None = None  # days since 1970
        self.zoned: bool | None = None

    @property
    def start(self) -> str:
        """Return the day that the seconds are counted from, in words."""
        if not self.midnight:
            return "midnight"  # cells without a date
        return f"{np.datetime64(self.midnight, 'D')} 00:00{' UTC' if self.zoned else ', no zone named'}"

    @property
    def day(self) -> str:
        """Return the day of the clock's zero, ISO 8601; empty where the cells are times of an unnamed day."""
        return str(np.datetime64(self.midnight, "D")) if self.midnight else ""

    def seconds(self, cells: pl.Series) -> Array:
        """Return seconds (n,), NaN where a cell is empty. Raises NoDateError for a cell that is no date."""
        import polars as pl

        if cells.dtype.is_temporal():
            return self._of_numbers(cells)
        cells = cells.cast(pl.String) if cells.dtype == pl.Null else cells  # no cell, or none with anything in it
        groups = cells.str.extract_groups(_PARTS).struct.unnest()
        hour = groups["hour"]
        odd = (hour.is_null() & cells.is_not_null() & (cells.str.strip_chars() != "")).arg_true()
        if len(odd):
            raise NoDateError(int(odd[0]), str(cells[int(odd[0])]))
        zoned = groups["zone"].is_not_null().filter(hour.is_not_null())
        if len(zoned):
            self.zoned = bool(zoned[0]) if self.zoned is None else self.zoned
            mixed = (zoned != self.zoned).arg_true()
            if len(mixed):
                at = int(hour.is_not_null().arg_true()[int(mixed[0])])
                raise NoDateError(at, str(cells[at]), f"names {'no' if self.zoned else 'a'} zone, others do")
        day = groups["year"] + groups["month"] + groups["day"]
        date = day.str.to_date("%Y%m%d", strict=False)
        odd = (date.is_null() & day.is_not_null()).arg_true()
        if len(odd):
            raise NoDateError(int(odd[0]), str(cells[int(odd[0])]))
        days = date.cast(pl.Int32).fill_null(0).cast(pl.Float64).to_numpy()
        number = [groups[n].str.replace(",", ".").cast(pl.Float64) for n in ("hour", "minute", "second")]
        h, m, s = number[0], number[1], number[2].fill_null(0.0)
        zone = groups["zone"].str.replace(":", "")
        sign = zone.str.starts_with("-").fill_null(False).to_numpy() * -2.0 + 1.0
        east = [zone.str.slice(at, 2).cast(pl.Float64, strict=False).fill_null(0.0).to_numpy() for at in (1, 3)]
        of_day = (3600 * h + 60 * m + s).to_numpy() - sign * (3600 * east[0] + 60 * east[1])
        return self._since_midnight(days, of_day)

    def _of_numbers(self, cells: pl.Series) -> Array:
        """Return dates of Parquet, exact to a nanosecond."""
        import polars as pl

        self.zoned = getattr(cells.dtype, "time_zone", None) is not None
        tick = {"ns": 1_000_000_000, "us": 1_000_000, "ms": 1_000}[getattr(cells.dtype, "time_unit", None) or "ms"]
        whole = (cells.cast(pl.Datetime("ms")) if cells.dtype == pl.Date else cells).to_physical()
        days, rest = whole // (86400 * tick), whole % (86400 * tick)
        return self._since_midnight(days.cast(pl.Float64).to_numpy(), rest.cast(pl.Float64).to_numpy() / tick)

    def _since_midnight(self, days: Array, of_day: Array) -> Array:
        sound = np.flatnonzero(np.isfinite(days) & np.isfinite(of_day))
        if self.midnight is None and len(sound):
            self.midnight = int(days[sound[0]])
        return np.asarray((days - (self.midnight or 0)) * 86400.0 + of_day)


def recorded_on(given: object, where: str) -> str:
    """Return the date of a recording as recording.toml states it: of TOML or of ISO 8601, with a time or without.

    >>> recorded_on("2026-11-18", ""), recorded_on(datetime(2026, 11, 18, 5, 33), ""), recorded_on("", "")
    ('2026-11-18', '2026-11-18T05:33:00', '')
    """
    text = given.isoformat() if isinstance(given, date) else given
    try:
        if isinstance(text, str) and (not text or 1900 <= datetime.fromisoformat(text).year):
            return text
    except ValueError:
        pass
    raise InputError(f"{where}: date says when it was recorded, as in date = 2026-11-18, got {str(given)[:40]!r}")


class NoDateError(InputError):
    """Cell `row` of a column cannot be read as a date; whoever knows the file says where that is."""

    def __init__(self, row: int, cell: str, why: str = "is not a date and time of ISO 8601") -> None:
        super().__init__(f"{cell!r} {why}")
        self.row = row
