"""The gravity of a site and its sigma: as stated, by the ellipsoid, or unknown.

Every accelerometer is scaled by it, so its uncertainty is one of the scale factors'. Sources: Rapp, "The determination
of geoid undulations and gravity anomalies", J. Geophys. Res. 86 (1981), for free-air anomalies of some 30 mGal rms;
0.3086 mGal come with each metre of height.
"""

from __future__ import annotations

from dataclasses import replace

from gimbalcal.earth import normal_gravity
from gimbalcal.recording.record import ANYWHERE, Site

ANOMALY = 3e-4  # m/s^2, one sigma
UNKNOWN_HEIGHT = 1e-3  # m/s^2: 300 m of land
ODD = 3 * ANOMALY  # a stated gravity further from normal is a rare place, or a slip


def not_stated(latitude: float | None, height: float | None) -> Site:
    """The site [rad, m] with the gravity of the ellipsoid; of nowhere in particular that of anywhere."""
    if latitude is None:
        return Site(None, height or 0.0, ANYWHERE.gravity, ANYWHERE.gravity_sigma)
    sigma = ANOMALY if height is not None else (ANOMALY**2 + UNKNOWN_HEIGHT**2) ** 0.5
    return Site(latitude, height or 0.0, float(normal_gravity(latitude, height or 0.0)), sigma)


def stated(latitude: float | None, height: float | None, gravity: float, sigma: float | None) -> Site:
    """The site with a gravity [m/s^2] that was stated: exact where nobody says its sigma, or as far as it is odd."""
    here = Site(latitude, height or 0.0, gravity, sigma or 0.0)
    return here if sigma is not None else replace(here, gravity_sigma=abs(odd(here)))


def odd(site: Site) -> float:
    """Return the gravity of a site less that of the ellipsoid [m/s^2]; zero where the difference is usual."""
    if site.latitude is None:
        return 0.0
    off = site.gravity - float(normal_gravity(site.latitude, site.height))
    return off if abs(off) > ODD else 0.0
