"""A day at 100 Hz (8.64e6 rows of 10 columns) of a space-stable platform, or less, for measurements of reading."""

from pathlib import Path

import numpy as np

from gimbalcal.earth import EARTH_RATE
from gimbalcal.platform import SPACE_STABLE_INERTIAL
from gimbalcal.recording import Recording, Site, write


def static_run(hours: float, rate: float, rng: np.random.Generator) -> Recording:
    """A space-stable platform on a still base at 40 N, with the noise of a tactical sensor, as a logger rounds it."""
    time = np.arange(round(hours * 3600 * rate)) / rate
    latitude, phase = np.radians(40.0), EARTH_RATE * time
    force = 9.80146 * np.stack(
        [np.cos(phase) * np.cos(latitude), np.sin(phase) * np.cos(latitude), np.full_like(phase, np.sin(latitude))]
    )
    channels = {
        ("specific_force", a): np.round(f + 5e-3 * rng.standard_normal(len(time)), 6)
        for a, f in zip("xyz", force, strict=True)
    }
    angles = {"platform": phase, "middle": np.full_like(phase, latitude), "outer": np.zeros_like(phase)}
    for axis, angle in angles.items():
        channels["gimbal_angle", axis] = np.round(angle + 2.4e-6 * rng.standard_normal(len(time)), 9)
    for axis in ("roll", "pitch", "yaw"):
        channels["attitude_error", axis] = np.round(1e-5 + 2.4e-6 * rng.standard_normal(len(time)), 9)
    return Recording(
        "static-run", "24 h at 100 Hz", SPACE_STABLE_INERTIAL, Site(latitude, 0.0, 9.80146),
        {"accelerometer": 5e-3}, time, None, channels,
    )  # fmt: skip


def make(hours: float, folder: Path, samples: str) -> None:
    """Write the recording."""
    write(static_run(hours, 100.0, np.random.default_rng(1)), folder, samples=samples)
