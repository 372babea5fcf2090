"""Read [site] of a recording.toml: latitude, height and gravity, and the sigmas of latitude and gravity.

Every accelerometer is scaled by gravity, so its uncertainty is one of the scale factors'. Sources: Rapp, "The
determination of geoid undulations and gravity anomalies", J. Geophys. Res. 86 (1981), for free-air anomalies of some
30 mGal rms; 0.3086 mGal come with each metre of height.
"""

from __future__ import annotations

from dataclasses import replace
from math import pi, radians, tan
from typing import Any

from gimbalcal.earth import G0, normal_gravity
from gimbalcal.errors import InputError
from gimbalcal.recording.document import Document
from gimbalcal.recording.kinds import Kind
from gimbalcal.recording.record import UNKNOWN_SITE, Site

POLE = pi / 2 * (1 + 1e-12)
ARC_MINUTE = radians(1 / 60)
RANGES = {  # SI, lowest and highest value, and what is wrong beyond
    "latitude": (-POLE, POLE, "is beyond 90 deg; give it between -90 and 90 deg, or correct its unit"),
    # from the deepest trench to the edge of space
    "height": (-12e3, 100e3, "is no place for a rig; give it above the sea, or correct its unit"),
    "gravity": (9.7, 9.9, "is not found on the Earth (9.76 to 9.84 m/s^2); correct the value or its unit"),
}
ANOMALY = 3e-4  # m/s^2, one sigma
UNKNOWN_HEIGHT = 1e-3  # m/s^2: 300 m of land
MAX_ANOMALY = 3 * ANOMALY  # a stated gravity further from normal is a rare place, or an error


def site_of(document: Document, kind: Kind) -> tuple[Site, tuple[str, ...]]:
    """Return the site of a recording of this kind, checked, and remarks on its gravity."""
    table = document.table("site")
    document.only("site", ("latitude", "height", "gravity"), table)
    quantities = {"latitude": "angle", "height": "height", "gravity": "gravity"}
    table, sigma = _stated_sigma(document, table, "gravity", "gravity", "m/s^2")
    table, latitude_sigma = _stated_sigma(document, table, "latitude", "angle", "rad")
    if latitude_sigma and not kind.stabilised:
        raise InputError(
            f"{document.where('site', 'latitude')}: a sigma of the latitude is taken into account in a static run "
            f"alone, and this is a {kind} recording; leave it out"
        )
    given = {key: document.number("site", key, entry, quantities[key]) for key, entry in table.items()}
    latitude = given.get("latitude")
    for key, (low, high, why) in RANGES.items():
        if key in given and not low <= given[key] <= high:
            written = f"{table[key]['value']} {table[key]['unit']}"
            raise InputError(f"{document.where('site', key)}: {key} {written} {why}")
    if kind.stabilised and latitude is None:
        raise InputError(
            f"{document.where('site')}: a static run needs the latitude, because the Earth turns under the "
            'platform; write latitude = { value = ..., unit = "deg" } in [site]'
        )
    stated, height = "gravity" in given, given.get("height")
    site = (
        with_gravity_stated(latitude, height, given["gravity"], sigma)
        if stated
        else with_normal_gravity(latitude, height)
    )
    site = replace(site, latitude_sigma=latitude_sigma)
    remarks = _exact_latitude(document, site) if kind.stabilised else ()
    if stated:
        return site, (*remarks, *(_odd_gravity(document, site) if kind.inertial else ()))
    columns = document.table("columns").values()
    weighed = any(isinstance(entry, dict) and entry.get("quantity") == "specific_force" for entry in columns)
    if latitude is not None or not weighed:
        return site, remarks
    off = 1e6 * site.gravity_sigma / G0
    remark = f"{document.path}: neither gravity nor latitude is given in [site]; standard gravity {G0} m/s^2 is used"
    return site, (f"{remark}, good to {off:.0f} ppm, which every scale factor takes over",)


def _stated_sigma(
    document: Document, table: dict[str, Any], name: str, quantity: str, si: str
) -> tuple[dict[str, Any], float | None]:
    """Return [site] without the sigma of one of its entries, and this sigma in SI; None where none is stated.

    Raises InputError for a sigma that is negative, or no number in a unit of the quantity.
    """
    entry = table.get(name)
    if not isinstance(entry, dict) or "sigma" not in entry:
        return table, None
    known = {**entry, "value": entry["sigma"]}
    sigma = document.number("site", name, {k: v for k, v in known.items() if k != "sigma"}, quantity)
    if sigma < 0:
        raise InputError(f"{document.where('site', name)}: the sigma of {name} is {sigma:g} {si}; give 0 or more")
    return {**table, name: {k: v for k, v in entry.items() if k != "sigma"}}, sigma


def _exact_latitude(document: Document, site: Site) -> tuple[str, ...]:
    """Return a remark where nobody states how well the latitude L of a static run is known: the rows do not show it.

    The level part of gravity in platform axes is g cos L, so that an error of L is one of the scale factors of x and y,
    tan L times as large.
    """
    if site.latitude is None or site.latitude_sigma is not None:
        return ()
    moved = f"the scale factors of x and y by {1e6 * ARC_MINUTE * abs(tan(site.latitude)):.0f} ppm"
    remark = f"{document.where('site', 'latitude')}: the latitude is taken as exact; an error of 1 arcmin moves {moved}"
    return (f"{remark}: write its sigma next to its unit, 0 where it is exact",)


def _odd_gravity(document: Document, site: Site) -> tuple[str, ...]:
    """Return a remark where the stated gravity is not that of the stated place: the scale factors follow it."""
    off = gravity_anomaly(site)
    if not off:
        return ()
    normal = site.gravity - off
    stated = f"gravity {site.gravity:.6g} m/s^2 is {1e6 * off / normal:+.0f} ppm off the {normal:.6g} m/s^2 of this"
    advice = "so is their sigma; if it was measured, write its sigma next to its unit"
    after = (
        f"latitude and height; the scale factors follow it{f', and {advice}' if site.gravity_sigma >= abs(off) else ''}"
    )
    return (f"{document.where('site', 'gravity')}: {stated} {after}",)


def with_normal_gravity(latitude: float | None, height: float | None) -> Site:
    """Return the site [rad, m] with the gravity of the ellipsoid; of an unknown latitude that of anywhere."""
    if latitude is None:
        return Site(None, height or 0.0, UNKNOWN_SITE.gravity, UNKNOWN_SITE.gravity_sigma)
    sigma = ANOMALY if height is not None else (ANOMALY**2 + UNKNOWN_HEIGHT**2) ** 0.5
    return Site(latitude, height or 0.0, float(normal_gravity(latitude, height or 0.0)), sigma)


def with_gravity_stated(latitude: float | None, height: float | None, gravity: float, sigma: float | None) -> Site:
    """Return the site with a stated gravity [m/s^2]: without a sigma exact, or uncertain by its anomaly."""
    here = Site(latitude, height or 0.0, gravity, sigma or 0.0)
    return here if sigma is not None else replace(here, gravity_sigma=abs(gravity_anomaly(here)))


def gravity_anomaly(site: Site) -> float:
    """Return the gravity of a site less that of the ellipsoid [m/s^2]; zero where the difference is usual."""
    if site.latitude is None:
        return 0.0
    off = site.gravity - float(normal_gravity(site.latitude, site.height))
    return off if abs(off) > MAX_ANOMALY else 0.0
