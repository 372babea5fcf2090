r"""TPOINT observation files of an equatorial mount.

Four lines of caption and options, one of site and weather, then for each star catalogue right ascension and
declination, those that the mount reported, and local sidereal time:

``hh mm ss.s +dd mm ss.s  hh mm ss.s +dd mm ss.s  hh mm.m``

A reported declination beyond 90 deg is the other side of the pier: the same direction has angles (h + 12 h, 180 deg -
declination) there. Refraction is not taken off the catalogue positions; it belongs to the model.
Format: P. T. Wallace, TPOINT; as described by the Joint Astronomy Centre ("Pointing data format under TPOINT").

The mount is a chain of three: the declination axis, the hour-angle axis (which counts westward from the lower meridian
when turned from north, hence 180 deg), and the fixed tilt of the polar axis, latitude - 90 deg,

.. math:: C_n^p = R_y(\delta) \, R_z(h + \pi) \, R_y(L - \pi/2) .
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from math import pi
from pathlib import Path

import numpy as np

from gimbalcal.earth import normal_gravity
from gimbalcal.errors import InputError
from gimbalcal.importers.pointing import elapsed, pointing_run, sexagesimal
from gimbalcal.importers.table import one_file, only
from gimbalcal.number import Array
from gimbalcal.platform import Axis, Platform
from gimbalcal.recording.record import Recording, Site

_NUMBER = re.compile(r"[-+]?\d+(\.\d+)?$")


def equatorial(latitude: float) -> Platform:
    """An equatorial mount at `latitude` (rad), from the tube outwards."""
    axes = (Axis("declination", "y"), Axis("hour_angle", "z", 1, pi), Axis("polar", "y", 1, latitude - pi / 2))
    return Platform("equatorial", axes)


def import_tpoint(files: Sequence[Path], options: Mapping[str, str]) -> Recording:
    """One TPOINT .dat file of an equatorial mount: catalogue and mount right ascension, declination; sidereal time."""
    only(options, ())
    path = one_file(files)
    site, rows = _rows(path)
    stars = np.array([[sexagesimal(row[i : i + 3]) for i in (0, 3, 6, 9)] for row in rows])
    lst = np.array([sexagesimal(row[12:14]) for row in rows])
    hour, declination = 15 * (lst[:, None] - stars[:, ::2]), stars[:, 1::2]  # deg; columns: catalogue, mount
    flipped = np.abs(declination[:, 1]) > 90
    true_hour = np.where(flipped, hour[:, 0] + 180, hour[:, 0])
    true_declination = np.where(flipped, 180 - declination[:, 0], declination[:, 0])
    readout = _radians({"declination": declination[:, 1] % 360, "hour_angle": _half_turn(hour[:, 1])})
    true = _radians({"declination": true_declination, "hour_angle": true_hour})
    if site.latitude is None:
        raise ValueError("a TPOINT file has a latitude")
    return pointing_run(path, equatorial(site.latitude), site, elapsed(path, lst), readout, true)


def _half_turn(degrees: Array) -> Array:
    return np.asarray((degrees + 180) % 360 - 180)


def _radians(angles: Mapping[str, Array]) -> dict[str, Array]:
    """Declinations run from -90 to 270 deg, so that neither side of the pier is cut."""
    limited = {axis: np.where(angle > 270, angle - 360, angle) for axis, angle in angles.items()}
    return {axis: np.radians(angle) for axis, angle in limited.items()}


def _rows(path: Path) -> tuple[Site, list[list[str]]]:
    site, rows = None, []
    for line, text in enumerate(path.read_text(encoding="utf-8", errors="replace").splitlines(), start=1):
        words = text.split()
        if not words or text.startswith(("!", ":")) or not _NUMBER.match(words[0]) or words[0] == "END":
            continue
        if not all(_NUMBER.match(word) for word in words):
            raise InputError(f"{path}, line {line}: {text.strip()[:60]!r} is not a row of numbers")
        if site is None and len(words) >= 9:
            latitude, height = np.radians(sexagesimal(words[:3])), float(words[8])
            site = Site(float(latitude), height, float(normal_gravity(latitude, height)))
        elif len(words) >= 14:
            rows.append(words)
        else:
            raise InputError(f"{path}, line {line}: an observation has 14 numbers, got {len(words)}")
    if site is None or not rows:
        raise InputError(f"{path} is not a TPOINT file: a line of latitude, date and weather and then stars are wanted")
    return site, rows
