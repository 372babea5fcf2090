"""A plant of its own for pointing runs: two axes by rotation matrices, stars found by iteration, seeing.

No line is shared with the package but the noun `Recording` and how a platform is drawn.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from gimbalcal.number import Array
from gimbalcal.platform import KNOWN, Axis, Platform
from gimbalcal.recording import Recording, Site

ARCSEC = np.pi / 648000
LATITUDE = np.radians(33.0)
EQUATORIAL = Platform(
    "equatorial",
    (Axis("declination", "y"), Axis("hour_angle", "z", 1, np.pi), Axis("polar", "y", 1, LATITUDE - np.pi / 2)),
)
# columns: the axes of the frame in which longitude is counted westward, along north, west, up
POLE = np.array([[-np.sin(LATITUDE), 0, np.cos(LATITUDE)], [0, -1, 0], [np.cos(LATITUDE), 0, np.sin(LATITUDE)]]).T


@dataclass(frozen=True)
class Setup:
    """How a run is made."""

    equatorial: bool = False
    flips: bool = False  # whether a German mount looks across its pole east of the meridian
    stars: int = 80
    seeing: float = 1.0  # arcsec, one sigma of a coordinate at the zenith
    tails: float = 0.0
    clustered: bool = False  # one part of the sky after the other
    lowest: float = 20.0  # degrees
    tilt: float = 0.0  # arcsec of the base and of what bends, which every mount has
    sag: float = 0.0
    interval: float = 120.0


@dataclass(frozen=True, eq=False)
class Sky:
    """Where the stars are: true angles (n,) of outer and inner axis, elevation, azimuth, time, the moves between."""

    outer: Array
    inner: Array
    elevation: Array
    azimuth: Array
    t: Array
    moved: Array  # (n, 2) the last change of outer and inner
    rng: np.random.Generator


# what an effect may change: "readout" (n, 2) outer and inner [rad], "sky" (n, 2) seen across and up, "tilt" (n, 2) of
# the base about north and west, "collimation" (n,), "square" (n,)
Error = Callable[[Sky], dict[str, Array]]


def looked(s: Setup, outer: Array, inner: Array, part: dict[str, Array]) -> Array:
    """Where the mount looks, along north, west, up (n, 3), with its axes at these angles."""
    n = len(outer)
    zero = np.zeros(n)
    c, square = part.get("collimation", zero), part.get("square", zero)
    v = np.column_stack([np.cos(c), -np.sin(c), zero])
    v = Rotation.from_rotvec(np.column_stack([zero, -inner, zero])).apply(v)
    v = Rotation.from_rotvec(np.column_stack([square, zero, zero])).apply(v)
    v = Rotation.from_rotvec(np.column_stack([zero, zero, -outer])).apply(v)
    v = v @ (POLE if s.equatorial else np.eye(3)).T
    tilt = part.get("tilt", np.zeros((n, 2)))
    return np.asarray(Rotation.from_rotvec(np.column_stack([tilt, zero])).apply(v))


def sky(rng: np.random.Generator, s: Setup) -> Sky:
    """Stars all over the sky, in a random order or one part after the other."""
    n = s.stars
    elevation = np.arcsin(rng.uniform(np.sin(np.radians(s.lowest)), np.sin(np.radians(82)), n))
    azimuth = rng.uniform(-np.pi, np.pi, n)
    if s.clustered:
        order = np.lexsort((elevation, np.floor((azimuth + np.pi) / (np.pi / 4))))
        elevation, azimuth = elevation[order], azimuth[order]
    u = np.column_stack([np.cos(elevation) * np.cos(azimuth), -np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
    a = u @ POLE if s.equatorial else u
    outer, inner = np.arctan2(-a[:, 1], a[:, 0]), np.arcsin(np.clip(a[:, 2], -1, 1))
    if s.flips:
        over = outer < 0
        outer, inner = np.where(over, outer + np.pi, outer), np.where(over, np.pi - inner, inner)
    t = s.interval * (np.arange(n) + 0.3 * rng.uniform(0, 1, n))
    both = np.column_stack([outer, inner])
    return Sky(outer, inner, elevation, azimuth, t, np.diff(both, axis=0, prepend=both[:1]), rng)


def seen(s: Setup, k: Sky, parts: list[tuple[dict[str, Array], float]]) -> Array:
    """Readouts (n, 2) of outer and inner axis with every star in the middle, by Newton's rule."""
    whole: dict[str, Array] = {}
    for part, size in parts:
        for name, value in part.items():
            whole[name] = whole.get(name, 0.0) + size * value
    up = np.column_stack(
        [-np.sin(k.elevation) * np.cos(k.azimuth), np.sin(k.elevation) * np.sin(k.azimuth), np.cos(k.elevation)]
    )
    east = np.column_stack([-np.sin(k.azimuth), -np.cos(k.azimuth), 0 * k.azimuth])
    moved = whole.get("sky", np.zeros((len(k.t), 2)))
    star = (
        np.column_stack(
            [np.cos(k.elevation) * np.cos(k.azimuth), -np.cos(k.elevation) * np.sin(k.azimuth), np.sin(k.elevation)]
        )
        + moved[:, :1] * east
        + moved[:, 1:] * up
    )
    star /= np.linalg.norm(star, axis=1, keepdims=True)
    at = np.column_stack([k.outer, k.inner])
    for _ in range(6):
        off = star - looked(s, at[:, 0], at[:, 1], whole)
        D = np.stack(
            [(looked(s, *(at + d).T, whole) - looked(s, *(at - d).T, whole)) / 2e-6 for d in 1e-6 * np.eye(2)], axis=-1
        )
        at = at + np.einsum("nij,nj->ni", np.linalg.pinv(D), off)
    return at - whole.get("readout", np.zeros_like(at))


def ever(s: Setup, k: Sky, rng: np.random.Generator) -> list[tuple[dict[str, Array], float]]:
    """What every mount has: zeros, collimation, axes not square; and the tilt and sag that were asked for."""
    n = np.ones(len(k.t))
    out = [
        ({name: n}, float(size))
        for name, size in zip(("collimation", "square"), rng.uniform(-60, 60, 2) * ARCSEC, strict=True)
    ]
    out.append(({"readout": np.outer(n, rng.uniform(-0.01, 0.01, 2))}, 1.0))
    if s.tilt:
        way = rng.uniform(0, 2 * np.pi)
        out.append(({"tilt": np.outer(n, [np.cos(way), np.sin(way)])}, s.tilt * ARCSEC))
    if s.sag:
        out.append(({"sky": np.column_stack([0 * n, -np.cos(k.elevation)])}, s.sag * ARCSEC))
    return out


def noise(s: Setup, k: Sky) -> Array:
    """One sigma (n,) [rad] of each coordinate on the sky: seeing grows with the air in the way."""
    return np.asarray(s.seeing * ARCSEC * np.sin(np.maximum(k.elevation, 0.1)) ** -0.6)


def record(seed: int, s: Setup, errors: tuple[tuple[Error, float], ...] = ()) -> Recording:
    """One run."""
    rng = np.random.default_rng(seed)
    k = sky(rng, s)
    n = len(k.t)
    free = (
        rng.standard_t(s.tails, (n, 2)) * np.sqrt((s.tails - 2) / s.tails) if s.tails else rng.standard_normal((n, 2))
    )
    parts = [*ever(s, k, rng), ({"sky": noise(s, k)[:, None] * free}, 1.0)]
    read = seen(s, k, [*parts, *((error(k), size) for error, size in errors)])
    platform = EQUATORIAL if s.equatorial else KNOWN["alt-az"]
    inner, outer = platform.axis_names[:2]
    true = np.column_stack([k.outer, k.inner])
    step = 0.1 * ARCSEC
    channels = {("gimbal_angle", inner): step * np.round(read[:, 1] / step)}
    channels |= {("gimbal_angle", outer): step * np.round(read[:, 0] / step)}
    channels |= {("true_angle", inner): true[:, 1], ("true_angle", outer): true[:, 0]}
    return Recording("pointing", "mount", platform, Site(LATITUDE, 0.0, 9.8), {}, k.t, None, channels)


BASIC = ("zeros", "collimation", "square")


def strength(seed: int, s: Setup, error: Error, held: bool = True) -> float:
    """Sigmas of an effect of size one arcsecond, clear of zeros, collimation, squareness; tilt and sag if `held`."""
    rng = np.random.default_rng(seed)
    k = sky(rng, s)
    one = np.ones(len(k.t))
    terms: list[dict[str, Array]] = [{"collimation": one}, {"square": one}]
    terms += [{"readout": np.outer(one, axis)} for axis in np.eye(2)]
    if held:
        terms += [{"tilt": np.outer(one, axis)} for axis in np.eye(2)]
        terms += [{"sky": np.column_stack([0 * one, np.cos(k.elevation)])}]
    rest = seen(s, k, [])
    weight = (1 / noise(s, k))[:, None] * np.column_stack([np.cos(k.inner), one])

    def row(part: dict[str, Array]) -> Array:
        return np.asarray(((seen(s, k, [(part, ARCSEC)]) - rest) * weight).ravel())

    d, Z = row(error(k)), np.column_stack([row(t) for t in terms])
    return float(np.linalg.norm(d - Z @ np.linalg.lstsq(Z, d, rcond=1e-7)[0]))
