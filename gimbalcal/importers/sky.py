"""Angles on the sky that are not those of a mount's axes: right ascension with sidereal time, zenith distance.

Hour angle is local sidereal time less right ascension, elevation what is left of zenith distance to a right angle.
"""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np

from gimbalcal.errors import InputError
from gimbalcal.importers.names import ANGLES, plain, unit_written
from gimbalcal.importers.undescribed import Table
from gimbalcal.number import Array
from gimbalcal.units import from_si

ASCENSION = frozenset(["ra", "ascension", "rektaszension", "rightascension", "alpha"])
DECLINATION = frozenset(["dec", "decl", "declination", "deklination", "de"])
ZENITH = frozenset(["zd", "za", "zenith", "zenit", "zenitdistanz", "zenithdistance", "zdist", "zenitwinkel"])
SIDEREAL = frozenset(["lst", "lmst", "last", "sidereal", "sternzeit"])
OFFSET = frozenset(
    ["d", "delta", "diff", "off", "offset", "offs", "err", "error", "corr", "correction", "residual", "ablage", "dev"]
)


def of_the_axes(table: Table) -> Table:
    """The table with right ascensions as hour angles and zenith distances as elevations, named after what they were.

    Raises InputError for places on the sky twice without the sidereal time that makes hour angles of them.
    """
    words = {name: set(_words(name)) for name in table.columns}
    columns: dict[str, Array] = {}
    angles = set(table.sexagesimal)
    ascensions = [n for n, w in words.items() if w & ASCENSION and not w & OFFSET]
    stars = len(ascensions) >= 2 and sum(bool(w & DECLINATION) for w in words.values()) >= 2
    clock = sidereal(table)
    if stars and not clock:
        raise InputError(
            f"right ascension and declination ({', '.join(ascensions)}) are turned by the Earth: to know where the "
            "axes of the mount stood, each row needs the local sidereal time (a column LST), or the hour angle itself"
        )
    for name, x in table.columns.items():
        if stars and name in ascensions:
            hours = sidereal_hours(table, clock) - _hours(table, name)
            columns[f"hour angle from {name} [deg]"] = 15 * (np.mod(hours + 12, 24) - 12)
        elif words[name] & ZENITH:
            unit = unit_written(plain(name))
            quarter = float(from_si(np.pi / 2, unit if unit in ANGLES else "deg"))
            columns[f"elevation from {name}"] = -x if words[name] & OFFSET else quarter - x
            angles |= {f"elevation from {name}"} if name in angles else set()
        else:
            columns[name] = x
    return replace(table, columns=columns, sexagesimal=frozenset(angles))


def sidereal(table: Table) -> str:
    """The column of local sidereal time, or nothing."""
    return next((n for n in table.columns if SIDEREAL.intersection(_words(n))), "")


def sidereal_hours(table: Table, clock: str) -> Array:
    """Local sidereal time [h] of each row."""
    x = table.columns[clock]
    return x / 3600 if clock in table.dates else _hours(table, clock)


def latitude_column(table: Table) -> tuple[str, float] | None:
    """A column that says the latitude [deg] in every row, and what it says."""
    for name, x in table.columns.items():
        if {"lat", "latitude", "breite"}.intersection(_words(name)) and np.ptp(x) < 0.1 and abs(x[0]) <= 90:
            return name, float(np.median(x))
    return None


def _hours(table: Table, name: str) -> Array:
    """Right ascension or sidereal time in hours: as sexagesimal cells have it, or numbers up to 24; else degrees."""
    x, unit = table.columns[name], unit_written(plain(name))
    hours = name in table.sexagesimal or unit == "h" or (unit not in ("deg", "rad") and float(np.nanmax(x)) <= 24)
    return np.asarray(np.degrees(x) / 15 if unit == "rad" else x if hours else x / 15)


def _words(name: str) -> list[str]:
    return plain(re.sub(r"[\[(].*", "", name)).split("_")
