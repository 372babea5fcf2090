"""A platform at rest in inertial space, written again without a line of the package's model: 48 h, the Earth turning.

Channels are the forces and the three gimbals that are read; axes of the platform as in plant.py.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gimbalcal.number import Array
from gimbalcal.platform import SPACE_STABLE_INERTIAL
from gimbalcal.recording import Recording, Site
from tests.diagnose.plant import ARCSEC, UG, G

LATITUDE = np.deg2rad(40.0)
EARTH = 7.292115e-5  # rad/s, WGS-84


@dataclass
class Rest:
    """What the platform goes through: time, specific force (n, 3) in g, temperature."""

    t: Array
    ideal: Array
    T: Array


Error = Callable[[Rest], Array]  # output error (n, 3) for a size of one


def rest(rng: np.random.Generator, hours: float, step: float) -> Rest:
    """The Earth's turn past the platform, and a room that is warmer by day."""
    t = np.arange(0.0, hours * 3600.0, step)
    turn = EARTH * t + rng.uniform(0, 2 * np.pi)
    up = np.stack([np.cos(turn) * np.cos(LATITUDE), np.sin(turn) * np.cos(LATITUDE), 0 * t + np.sin(LATITUDE)], axis=-1)
    T = 22 + 2.0 * np.sin(2 * np.pi * t / 86400.0 + rng.uniform(0, 2 * np.pi)) + 0.5 * rng.standard_normal(len(t))
    return Rest(t, up, T)


def record(
    rng: np.random.Generator, error: Error | None = None, size: float = 0.0, hours: float = 48.0, step: float = 600.0
) -> Recording:
    """One static run; white noise of 2 ug and 0.5 arcsec in a row."""
    r = rest(rng, hours, step)
    n = len(r.t)
    lean = np.eye(3) + rng.uniform(-40, 40, (3, 3)) * ARCSEC * (1 - np.eye(3))
    u = (r.ideal * G) @ lean.T / (1 + rng.uniform(-4e-4, 4e-4, 3))
    K, bias = rng.uniform(-1e-6, 1e-6, 3), rng.uniform(-300, 300, 3) * UG
    out = u + K * u**2 + bias + 2 * UG * rng.standard_normal((n, 3))
    out = out + (size * error(r) if error else 0.0)
    turn = np.arctan2(r.ideal[:, 1], r.ideal[:, 0])
    read = np.stack([turn, 0 * turn + LATITUDE, 0 * turn], axis=-1)
    read = read + rng.uniform(-40, 40, 3) * ARCSEC + 0.5 * ARCSEC * rng.standard_normal((n, 3))
    channels = {("specific_force", a): out[:, i] for i, a in enumerate("xyz")}
    channels |= {("gimbal_angle", a): read[:, i] for i, a in enumerate(("platform", "middle", "outer"))}
    channels |= {("temperature", ""): r.T}
    stated = {"accelerometer": 2 * UG, "gimbal_angle": 0.5 * ARCSEC}
    site = Site(LATITUDE, 0.0, G)
    return Recording("static-run", "plant at rest", SPACE_STABLE_INERTIAL, site, stated, r.t, None, channels)


def strength(seed: int, error: Error, size: float) -> float:
    """Sigmas above noise of an effect, after the calibration took what it can."""
    from gimbalcal.diagnose.evidence.projection import orthonormal
    from gimbalcal.diagnose.search.refit import fit_baseline
    from gimbalcal.views.known_attitude import view_at_known_attitude

    with_it, without = (record(np.random.default_rng(seed), error, x) for x in (size, 0.0))
    o = fit_baseline(view_at_known_attitude(without))
    d = np.stack([with_it.channels[k] - without.channels[k] for k in o.view.channels], axis=-1) / o.sigma
    y, Q = o.reduced(d[:, :, None])[:, 0], orthonormal(o.reduced(o.Z))
    return float(np.linalg.norm(y - Q @ (Q.T @ y)))
