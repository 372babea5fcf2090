"""Made pointing runs: stars that a mount with given effects sees on target at given readouts."""

from collections.abc import Sequence

import numpy as np

from gimbalcal.effects import CATALOGUE, Effect, parameters, with_values
from gimbalcal.forward import predict, wanted_channels
from gimbalcal.importers.tpoint import equatorial
from gimbalcal.number import Array
from gimbalcal.platform import KNOWN, Platform
from gimbalcal.recording import Recording, Site
from gimbalcal.views.pointing import moved_channels, on_stars

ARCSEC = np.pi / 648000
LATITUDE = np.radians(39.0)
ALT_AZ, EQUATORIAL = KNOWN["alt-az"], equatorial(float(LATITUDE))


def effects(platform: Platform, **sizes: float) -> tuple[Effect, ...]:
    """Effects by label with "__" for the colon, in arcsec: ``base_tilt__east=20.0``."""
    known = {p.label: p for cls in CATALOGUE.values() for p in parameters(cls, platform.axis_names)}
    wanted = [known[label.replace("__", ":")] for label in sizes]
    return with_values((), wanted, ARCSEC * np.array(list(sizes.values())), platform.axis_names)


def run(platform: Platform, readout: Array, there: Sequence[Effect], noise: float = 0.0, seed: int = 1,
        **more: object) -> Recording:  # fmt: skip
    """A run at the readouts (n, k) [rad], with `noise` [arcsec] of a star in each direction in which the axes move."""
    names = platform.axis_names[: readout.shape[1]]
    time = 120.0 * np.arange(len(readout))
    read = {("gimbal_angle", a): readout[:, i] for i, a in enumerate(names)}
    true = readout.copy()
    rng = np.random.default_rng(seed)
    scatter = noise * ARCSEC * rng.standard_normal(true.shape)

    def made(true: Array) -> Recording:
        channels = read | {("true_angle", a): true[:, i] for i, a in enumerate(names)}
        return Recording("pointing", "made", platform, Site(float(LATITUDE), 0.0, 9.8), {}, time, None, channels)

    def off(true: Array) -> Array:
        r = made(true)
        seen = wanted_channels(platform, predict(platform, on_stars(r), there, "pointing"), moved_channels(r))
        return np.asarray(seen + scatter)

    for _ in range(8):  # a perfect mount would point to where this one looks
        J = np.stack([(off(true + h) - off(true - h)) / 2e-6 for h in 1e-6 * np.eye(len(names))], axis=-1)
        true = true - np.linalg.solve(J, off(true)[..., None])[..., 0]
    return Recording(**{**vars(made(true)), **more})


def sky(platform: Platform, n: int = 60, seed: int = 2) -> Array:
    """Readouts (n, 2) [rad] all over the sky; of an equatorial mount on both sides of the pier."""
    rng = np.random.default_rng(seed)
    up, around = rng.uniform(0.3, 1.3, n), rng.uniform(-3.0, 3.0, n)
    if platform is EQUATORIAL:
        up, around = rng.uniform(-0.2, 1.2, n), rng.uniform(-1.2, 1.2, n)
        other = np.arange(n) % 2 == 1
        up, around = np.where(other, np.pi - up, up), np.where(other, around + np.pi, around)
    return np.stack([up, around], axis=1)
