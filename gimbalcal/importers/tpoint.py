r"""TPOINT observation files of equatorial and alt-azimuth mounts.

A caption, options that begin with a colon (``:EQUAT``, ``:ALTAZ``, ``:NODA``, ...), remarks that begin with ``!``, a
line of site, date and weather, and then a line for each star, in one of two forms:

``hh mm ss.s +dd mm ss.s  hh mm ss.s +dd mm ss.s  hh mm.m``
    catalogue right ascension and declination, those that the mount reported, and local sidereal time;
``ddd.d +dd.d  ddd.d +dd.d``
    where the star was and what the mount reported in degrees: azimuth and elevation, or hour angle and declination.
    There is no clock: the order of the stars stands in for it. TPOINT's azimuth runs from south through east.

What follows on a line (a name, auxiliary readings) is passed over. A reported declination beyond 90 deg is the other
side of the pier: the same direction has angles (h + 12 h, 180 deg - declination) there. Refraction belongs to the model
(the effect `refraction`), unless it is asked for: then a catalogue place stands as high as the air of the site shows
it, by the pressure and temperature of the file (Meeus, Astronomical Algorithms, Eq. (16.4)). Format: P. T. Wallace,
TPOINT; as described by the Joint Astronomy Centre ("Pointing data format under TPOINT").

An equatorial mount is a chain of three: the declination axis, the hour-angle axis (which counts westward from the lower
meridian when turned from north, hence 180 deg), and the fixed tilt of the polar axis, latitude - 90 deg,

.. math:: C_n^p = R_y(\delta) \, R_z(h + \pi) \, R_y(L - \pi/2) .
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from math import pi
from pathlib import Path

import numpy as np

from gimbalcal.earth import normal_gravity
from gimbalcal.errors import InputError
from gimbalcal.importers.pointing_files import about_other_pole, elapsed_seconds, in_order, pointing_run, sexagesimal
from gimbalcal.importers.registry import importer, one_of
from gimbalcal.number import Array
from gimbalcal.platform import KNOWN, Axis, Platform
from gimbalcal.recording.record import Recording, Site

_NUMBER = re.compile(r"[-+]?\d+(\.\d*)?$")
_BY_STARS, _BY_ANGLES = 14, 4  # numbers of an observation: two stars and a sidereal time; two pairs of angles
_MOUNTS = ("ALTAZ", "EQUAT")
_SITE, _SEXAGESIMAL, _ANY_DAY = 6, 3, ("2000", "1", "1")  # latitude and date; latitude alone
_AUXILIARY = 3  # readings that may follow a pair of angles
_SIXTY = 60.0
_WHOLE = (0, 1, 3, 4, 6, 7, 9, 10, 12)  # hours, degrees and minutes before what they are divided into
_STAR = (24.0, _SIXTY, _SIXTY, 360.0, _SIXTY, _SIXTY)  # a declination beyond 90 deg is the other side of the pier
_MOST = {_BY_STARS: (*_STAR, *_STAR, 24.0, _SIXTY), _BY_ANGLES: (720.0, 360.0, 720.0, 360.0)}
_WEATHER = ((-100.0, 70.0), (-1.0, 1200.0), (-1000.0, 9000.0))  # degC, hPa, m; without a pressure it is zero
_AZIMUTH = {"south": 180.0, "north": 0.0}  # zero of the azimuths in a file; from south they run through east


@dataclass(frozen=True)
class _File:
    """What a file holds: its site, whether its mount is alt-azimuth, and the numbers of each star."""

    site: Site
    air: float  # refraction against that at 1010 hPa and 10 degC; 0 where the file states no pressure
    upright: bool
    rows: Array


def equatorial(latitude: float) -> Platform:
    """Return an equatorial mount at `latitude` (rad), from the tube outwards."""
    axes = (Axis("declination", "y"), Axis("hour_angle", "z", 1, pi), Axis("polar", "y", 1, latitude - pi / 2))
    return Platform("equatorial", axes)


@importer("tpoint", "azimuth", "refraction")
def import_tpoint(files: Sequence[Path], options: Mapping[str, str]) -> Recording:
    """One TPOINT file, equatorial or :ALTAZ; refraction = yes (no); azimuth = south or north for lines of angles."""
    refracted = one_of(options, "refraction", "no", {"yes": "catalogue places are raised", "no": ""})
    zero = one_of(options, "azimuth", "south", {"south": "as TPOINT counts, through east", "north": ""})
    (path,) = files
    file = _read(path)
    if refracted == "yes" and not (file.air and file.rows.shape[1] == _BY_STARS):
        raise InputError(f"{path}: refraction needs catalogue places, and a pressure in the line of the site")
    if file.rows.shape[1] == _BY_STARS:
        return _by_stars(path, file if refracted == "yes" else replace(file, air=0.0))
    run = _by_angles(path, file, zero)
    if not file.upright or "azimuth" in options:
        return run
    assumed = (
        f"{path}: azimuths are taken to run from south through east, as in TPOINT, since nothing in the file states "
        "it; where they run from north, import it by `gimbalcal import tpoint --set azimuth=north`"
    )
    return replace(run, remarks=(*run.remarks, assumed))


def _by_stars(path: Path, file: _File) -> Recording:
    """Return catalogue and reported right ascension [h] and declination [deg], and the local sidereal time."""
    words = file.rows
    stars = np.stack([_joined_sexagesimal(words[:, i : i + 3]) for i in (0, 3, 6, 9)], axis=1)
    lst = words[:, 12] + words[:, 13] / 60
    hour, declination = 15 * (lst[:, None] - stars[:, ::2]), stars[:, 1::2]  # columns: catalogue, mount
    time, remarks = elapsed_seconds(path, lst)
    if file.air:
        hour, declination = _raised_by_refraction(hour, declination, file)
    if file.upright:
        true, read = (_horizontal(hour[:, i], declination[:, i], file.site) for i in (0, 1))
        return replace(pointing_run(path, KNOWN["alt-az"], file.site, time, read, true), remarks=remarks)
    run = pointing_run(path, _mount(file.site), file.site, time, *_equatorial(hour, declination))
    return replace(run, remarks=remarks)


def _by_angles(path: Path, file: _File, zero: str) -> Recording:
    """Return where the star was and what the mount reported [deg]; the order stands in for a clock."""
    around, up = file.rows[:, 0:4:2], file.rows[:, 1:4:2]
    time, remarks = in_order(path, len(around))
    if not file.upright:
        return replace(
            pointing_run(path, _mount(file.site), file.site, time, *_equatorial(around, up)), remarks=remarks
        )
    azimuth = _AZIMUTH[zero] - around if zero == "south" else around
    true, read = ({"elevation": np.radians(up[:, i]), "azimuth": np.radians(_half_turn(azimuth[:, i]))} for i in (0, 1))
    return replace(pointing_run(path, KNOWN["alt-az"], file.site, time, read, true), remarks=remarks)


def _mount(site: Site) -> Platform:
    if site.latitude is None:
        raise ValueError("a TPOINT file has a latitude")
    return equatorial(site.latitude)


def _equatorial(hour: Array, declination: Array) -> tuple[dict[str, Array], dict[str, Array]]:
    """Return readouts and true angles [rad] of an equatorial mount; columns [deg]: star, then report."""
    read = {"declination": (declination[:, 1] + 90) % 360 - 90, "hour_angle": _half_turn(hour[:, 1])}
    true = {"declination": declination[:, 0], "hour_angle": hour[:, 0]}
    return {a: np.radians(x) for a, x in read.items()}, {a: np.radians(x) for a, x in true.items()}


def _horizontal(hour: Array, declination: Array, site: Site) -> dict[str, Array]:
    """Return elevation and azimuth from north through east [rad] of hour angle and declination [deg]."""
    azimuth, elevation = about_other_pole(np.radians(hour), np.radians(declination), site.latitude or 0.0)
    return {"elevation": elevation, "azimuth": azimuth}


def _raised_by_refraction(hour: Array, declination: Array, file: _File) -> tuple[Array, Array]:
    """Return hour angle and declination [deg] with the catalogue places (first column) raised by refraction."""
    place = _horizontal(hour[:, 0], declination[:, 0], file.site)
    E = np.degrees(place["elevation"])
    up = np.radians(E + file.air * 1.02 / 60 / np.tan(np.radians(E + 10.3 / (E + 5.11))))  # Meeus, Eq. (16.4), arcmin
    h, d = about_other_pole(place["azimuth"], up, file.site.latitude or 0.0)
    turns = np.round((hour[:, 0] - np.degrees(h)) / 360)
    return (
        np.column_stack([np.degrees(h) + 360 * turns, hour[:, 1]]),
        np.column_stack([np.degrees(d), declination[:, 1]]),
    )


def _half_turn(degrees: Array) -> Array:
    return np.asarray((degrees + 180) % 360 - 180)


def _joined_sexagesimal(words: Array) -> Array:
    """Return sexagesimal columns (n, 3) as one (n,): the sign, also of a minus zero, belongs to the whole."""
    sign = np.where(np.signbit(words[:, 0]), -1.0, 1.0)
    return np.asarray(sign * (np.abs(words) @ np.array([1, 1 / 60, 1 / 3600])))


def _read(path: Path) -> _File:
    site, air, upright, rows, end = None, 0.0, False, [], 0
    for line, text in enumerate(path.read_text(encoding="utf-8-sig", errors="replace").splitlines(), start=1):
        words = text.replace(",", " ").split()
        end = end or (line if words[:1] == ["END"] else 0)
        if end and len(_leading_numbers(words)) >= _BY_ANGLES:
            raise InputError(f"{path}, line {line}: a star stands below the END of line {end}; remove one of them")
        if text.strip().startswith(":"):
            upright = _is_upright(path, line, text) or upright
            continue
        if end or not words or text.startswith("!"):
            continue
        numbers = _leading_numbers(words)
        if site is None:
            alone = len(words) == len(numbers) == _SEXAGESIMAL and _is_latitude(numbers)  # without a date
            if len(numbers) < _SITE and not alone:  # a caption, though it may begin with a number
                continue
            site, air = _site(path, line, [*numbers, *_ANY_DAY] if alone else numbers), _refraction_of_air(numbers)
            continue
        if not numbers:
            raise InputError(
                f"{path}, line {line}: {text.strip()[:60]!r} does not begin with a number as a star does; correct it, "
                "or write ! before a remark"
            )
        rows.append(_observation(path, line, text, numbers))
    if site is None or not rows:
        raise InputError(f"{path} is not a TPOINT file: a line of latitude, date and weather and then stars are wanted")
    if len({len(row) for row in rows}) > 1:
        raise InputError(f"{path}: some stars have angles and some a catalogue place; give one kind of line")
    return _File(site, air, upright, np.array(rows))


def _is_upright(path: Path, line: int, text: str) -> bool:
    """Return whether an option says alt-azimuth. Raises InputError for one that is nearly a kind of mount."""
    option = text.strip(" :").upper()
    kind = next((word for word in _MOUNTS if option.startswith(word)), "")
    similar = get_close_matches(option[:5], _MOUNTS, 1)
    if similar and not kind:
        raise InputError(f"{path}, line {line}: {text.strip()[:60]!r} is no option of TPOINT; write :{similar[0]}")
    return kind == "ALTAZ"


def _leading_numbers(words: Sequence[str]) -> list[str]:
    """Return the words before the first that is no number: a name may follow."""
    stop = next((i for i, word in enumerate(words) if not _NUMBER.match(word)), len(words))
    return list(words[:stop])


def _observation(path: Path, line: int, text: str, numbers: Sequence[str]) -> list[float]:
    n = _BY_STARS if len(numbers) >= _BY_STARS else _BY_ANGLES
    values = [float(word) for word in numbers[:n]]
    for word, value, most in zip(numbers, values, _MOST[n], strict=False):
        if not (abs(value) <= most and (most != _SIXTY or value >= 0)):
            raise InputError(
                f"{path}, line {line}: {word[:20]} cannot be there, where {most:g} is the most; correct it"
            )
    if len(numbers) >= _BY_STARS:
        if broken := [numbers[i] for i in _WHOLE if not float(numbers[i]).is_integer()]:
            raise InputError(f"{path}, line {line}: {broken[0]} cannot stand before minutes or seconds; correct it")
        return values
    if _BY_ANGLES <= len(numbers) <= _BY_ANGLES + _AUXILIARY and "." in numbers[1]:
        return values
    rest = text.split()[len(numbers) :]
    if rest:
        raise InputError(f"{path}, line {line}: {text.strip()[:60]!r} is not a row of numbers")
    raise InputError(
        f"{path}, line {line}: an observation has {_BY_STARS} numbers, got {len(numbers)}, or {_BY_ANGLES} angles in "
        "degrees"
    )


def _refraction_of_air(numbers: Sequence[str]) -> float:
    """Return the refraction at the temperature [degC] and pressure [hPa] of the site, against 1010 hPa and 10 degC."""
    return float(numbers[7]) / 1010 * 283 / (273 + float(numbers[6])) if len(numbers) > 7 else 0.0


def _is_latitude(numbers: Sequence[str]) -> bool:
    """Return whether numbers begin with degrees, minutes and seconds of a latitude."""
    d, m, s = (float(word) for word in numbers[:3])
    return abs(d) <= 90 and d.is_integer() and 0 <= m < _SIXTY and 0 <= s < _SIXTY


def _site(path: Path, line: int, numbers: Sequence[str]) -> Site:
    """Return latitude, date, and where they were written temperature, pressure and height."""
    year, month, day = (float(word) for word in numbers[3:6])
    dated = 1800 <= year <= 2200 and 1 <= month <= 12 and 1 <= day < 32
    if not (dated and _is_latitude(numbers)) or len(numbers) >= _BY_STARS:
        raise InputError(
            f"{path}, line {line}: the first line of numbers states the site, its latitude in degrees, minutes and "
            f"seconds and then year, month and day; got {' '.join(numbers[:6])}"
        )
    air = [float(word) for word in numbers[6:9]]
    if any(not low < x < high for x, (low, high) in zip(air, _WEATHER, strict=False)):
        raise InputError(
            f"{path}, line {line}: temperature [degC], pressure [hPa] and height [m] of the site cannot be "
            f"{' '.join(numbers[6:9])}"
        )
    latitude = float(np.radians(sexagesimal(numbers[:3])))
    height = float(numbers[8]) if len(numbers) > 8 else 0.0
    return Site(latitude, height, float(normal_gravity(latitude, height)))
