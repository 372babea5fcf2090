"""Angles on the sky that are not those of a mount's axes: right ascension with sidereal time, zenith distance.

Hour angle is local sidereal time less right ascension, elevation what is left of zenith distance to a right angle.
Where no column is the sidereal time it follows from UTC and the longitude, counted eastward.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from datetime import date
from pathlib import Path

import numpy as np

from gimbalcal.errors import InputError
from gimbalcal.guess.column_names import ANGLES, plain_name, unit_written
from gimbalcal.guess.text_table import Table
from gimbalcal.importers.pointing_files import about_other_pole
from gimbalcal.number import Array
from gimbalcal.recording.record import Recording
from gimbalcal.units import from_si

ASCENSION = frozenset(["ra", "ascension", "rektaszension", "rightascension", "alpha"])
DECLINATION = frozenset(["dec", "decl", "declination", "deklination", "de"])
ZENITH = frozenset(["zd", "za", "zenith", "zenit", "zenitdistanz", "zenithdistance", "zdist", "zenitwinkel"])
SIDEREAL = frozenset(["lst", "lmst", "last", "sidereal", "sternzeit"])
KEYWORDS = {
    "OBJCTRA": "ra mount",
    "OBJCTDEC": "dec mount [deg]",
    "CRVAL1": "ra solved [deg]",
    "CRVAL2": "dec solved [deg]",
    "SITELAT": "latitude",
    "SITELONG": "longitude",
}
MIN_ELEVATION_RAD = np.radians(-2.0)  # that a telescope is pointed to
_ANGLE = r"\d{1,3}(?:\.\d+|[\s:°d]+\d{1,2}[\s:'′m]+\d{1,2}(?:\.\d*)?[\"″s]?)?"
OFFSET = frozenset(
    ["d", "delta", "diff", "off", "offset", "offs", "err", "error", "corr", "correction", "residual", "ablage", "dev"]
)


def axis_angles(table: Table, longitude: float | None) -> tuple[Table, dict[str, str]]:
    """Return the table with right ascensions as hour angles and zenith distances as elevations, by their old names.

    longitude: of the place, deg east, where no column or remark states it. Returns what was assumed, too. Raises
    InputError for places on the sky twice without a sidereal time, or UTC and a longitude, that makes hour angles of
    them.
    """
    table = _with_fits_keywords(table)
    words = {name: set(_words(name)) for name in table.columns}
    columns: dict[str, Array] = {}
    angles = set(table.sexagesimal)
    ascensions = [n for n, w in words.items() if w & ASCENSION and not w & OFFSET]
    stars = len(ascensions) >= 2 and sum(bool(w & DECLINATION) for w in words.values()) >= 2
    clock, notes = sidereal(table), dict[str, str]()
    hours = sidereal_hours(table, clock) if clock else np.zeros(0)
    if stars:
        notes["equinox"] = f"{' and '.join(ascensions)} are taken for places of one equinox"
    if stars and not clock:
        hours, notes["sidereal"] = _sidereal_of_utc(table, ascensions, longitude)
    for name, x in table.columns.items():
        if stars and name in ascensions:
            columns[f"hour angle from {name} [deg]"] = 15 * (np.mod(hours - _hours(table, name) + 12, 24) - 12)
        elif words[name] & ZENITH:
            unit = unit_written(plain_name(name))
            quarter = float(from_si(np.pi / 2, unit if unit in ANGLES else "deg"))
            columns[f"elevation from {name}"] = -x if words[name] & OFFSET else quarter - x
            angles |= {f"elevation from {name}"} if name in angles else set()
        else:
            columns[name] = x
    return replace(table, columns=columns, sexagesimal=frozenset(angles)), notes


def refuse_single_places(path: Path, table: Table) -> None:
    """Raise InputError where a table holds one column of right ascensions and one of declinations."""
    words = {name: set(_words(name)) - OFFSET for name in table.columns}
    own = [[n for n, w in words.items() if w & coordinate] for coordinate in (ASCENSION, DECLINATION)]
    if all(len(each) == 1 for each in own):
        raise InputError(
            f"{path}: right ascension and declination are in one column each ({own[0][0].strip()}, "
            f"{own[1][0].strip()}); a pointing run needs the place of the star and the place that the mount gives: add "
            "the other as ra_true, dec_true or ra_mount, dec_mount"
        )


def _with_fits_keywords(table: Table) -> Table:
    """Return the table with the keywords of FITS files in words: place of the mount, and of the solved plate."""
    spelt = {n: f"{n} {KEYWORDS[n.strip().upper()]}" for n in table.columns if n.strip().upper() in KEYWORDS}
    return replace(
        table,
        columns={spelt.get(n, n): x for n, x in table.columns.items()},
        sexagesimal=frozenset(spelt.get(n, n) for n in table.sexagesimal),
    )


def _sidereal_of_utc(table: Table, ascensions: list[str], longitude: float | None) -> tuple[Array, str]:
    """Return the local sidereal time [h] by a column of UTC and the longitude, and by which."""
    stated = (longitude, "--longitude") if longitude is not None else next(_longitudes(table), None)
    universal = next(_days(table), None)
    if stated is None or universal is None:
        missing = "a longitude (--longitude DEG, east is positive)" if universal else "a date and time, or a JD,"
        raise InputError(
            f"right ascension and declination ({', '.join(ascensions)}) are turned by the Earth: to know where the "
            "axes of the mount stood, each row needs the local sidereal time (a column LST), the hour angle itself, or "
            f"UTC and the longitude; here {missing} is missing"
        )
    (east, where), (days, clock) = stated, universal
    centuries = days / 36525
    degrees = 280.46061837 + 360.98564736629 * days + 0.000387933 * centuries**2 - centuries**3 / 38_710_000
    why = f"from {clock}, taken for UTC, and the longitude {east:.6g} deg, counted eastward, as {where} says"
    return np.mod(degrees + east, 360) / 15, why  # Meeus, Astronomical Algorithms, Eq. (12.4)


def _days(table: Table) -> Iterator[tuple[Array, str]]:
    """Yield days (n,) since 2000-01-01 12:00 UTC of columns with the date, and their names."""
    for name, x in table.columns.items():
        if name in table.dates and table.day:
            yield (date.fromisoformat(table.day) - date(2000, 1, 1)).days - 0.5 + x / 86400, name
        elif {"jd", "mjd", "julian"}.intersection(_words(name)) and 2_400_000 < np.nanmedian(x) < 2_500_000:
            yield x - 2_451_545.0, name
        elif {"mjd"}.intersection(_words(name)) and 30_000 < np.nanmedian(x) < 90_000:
            yield x - 51_544.5, name


def _longitudes(table: Table) -> Iterator[tuple[float, str]]:
    """Yield the longitude [deg], eastward, that a column states in every row, or a remark."""
    for name, x in table.columns.items():
        if {"lon", "long", "longitude", "laenge"}.intersection(_words(name)) and np.ptp(x) < 0.1:
            yield float(np.median(x)), name
    for line in table.above:
        if angle := angle_stated(line, "lon(?:g(?:itude)?)?", "E", "W"):
            yield angle, repr(line.strip())


def angle_stated(line: str, word: str, plus: str, minus: str) -> float | None:
    """Return an angle [deg] after a word in a remark, decimal or sexagesimal, with the letter of its sense after it.

    >>> angle_stated("lat -33 30 00, lon 70:44:12 W", "lat", "N", "S"), angle_stated("lon=16.5 W", "lon", "E", "W")
    (-33.5, -16.5)
    """
    letter = rf"\W*(?:deg\w*)?\W*((?-i:{plus}|{minus})\b)?"
    match = re.search(rf"\b{word}\b\W*?([-+]?)({_ANGLE}){letter}", line, re.IGNORECASE)
    if not match:
        return None
    size = sum(float(part) / 60**k for k, part in enumerate(re.findall(r"\d+\.?\d*", match[2])))
    negative = (match[1] == "-") != ((match[3] or plus) == minus)
    return -size if negative else size


def refuse_below_horizon(path: Path, run: Recording, why: str) -> None:
    """Raise InputError where a sidereal time that was worked out puts stars below the horizon."""
    latitude = run.site.latitude or 0.0
    h, d = (run.channels["true_angle", axis] for axis in ("hour_angle", "declination"))
    up = about_other_pole(h, d, latitude)[1]
    if (below := int(np.count_nonzero(up < MIN_ELEVATION_RAD))) > 0:
        raise InputError(
            f"{path}: {below} of {len(up)} stars would stand below the horizon with the sidereal time {why}; are the "
            "times UTC, and is the longitude counted eastward (west is negative)? Say it with --longitude DEG, or add "
            "a column LST"
        )


def sidereal(table: Table) -> str:
    """Return the column of local sidereal time, or nothing."""
    return next((n for n in table.columns if SIDEREAL.intersection(_words(n))), "")


def sidereal_hours(table: Table, clock: str) -> Array:
    """Return the local sidereal time [h] of each row."""
    x = table.columns[clock]
    return x / 3600 if clock in table.dates else _hours(table, clock)


def latitude_column(table: Table) -> tuple[str, float] | None:
    """Return a column that states the latitude [deg] in every row, and its value."""
    for name, x in table.columns.items():
        if {"lat", "latitude", "breite"}.intersection(_words(name)) and np.ptp(x) < 0.1 and abs(x[0]) <= 90:
            return name, float(np.median(x))
    return None


def _hours(table: Table, name: str) -> Array:
    """Return right ascension or sidereal time in hours, of sexagesimal cells or numbers up to 24; else of degrees."""
    x, unit = table.columns[name], unit_written(plain_name(name))
    hours = name in table.sexagesimal or unit == "h" or (unit not in ("deg", "rad") and float(np.nanmax(x)) <= 24)
    return np.asarray(np.degrees(x) / 15 if unit == "rad" else x if hours else x / 15)


def _words(name: str) -> list[str]:
    return plain_name(re.sub(r"[\[(].*", "", name)).split("_")
