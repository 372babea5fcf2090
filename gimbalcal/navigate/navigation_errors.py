"""Errors of a navigation by channel, and their sizes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gimbalcal.earth import SOLAR_DAY
from gimbalcal.number import Array

CHANNELS = (("latitude", "arcmin"), ("longitude", "arcmin"), ("north velocity", "m/s"), ("east velocity", "m/s"),
            ("roll", "arcsec"), ("pitch", "arcsec"), ("yaw", "arcsec"))  # fmt: skip
NONE = "none"  # the label of a navigation without calibration


@dataclass(frozen=True)
class Navigated:
    """Errors of one navigation: time (n,) s, error (n, 7) in SI in the order of `CHANNELS`, position error (n,) m.

    Attitudes are nan where the true one is unknown. Bands, one sigma (n, 7) each, are what the calibration's
    covariance leaves: by linear propagation, and by navigating with drawn parameters.
    """

    label: str
    time: Array
    error: Array
    position: Array
    linear: Array | None = None
    sampled: Array | None = None
    mechanisation: str = "space-stable"

    @property
    def largest(self) -> Array:
        """Largest absolute error (7,) in SI."""
        return np.asarray(np.max(np.abs(self.error), axis=0))

    @property
    def rms(self) -> Array:
        """Root mean square error (7,) in SI."""
        return np.asarray(np.sqrt(np.mean(self.error**2, axis=0)))

    @property
    def drift_per_day(self) -> Array:
        """Slope of a straight line through each error (7,), SI per day."""
        t = (self.time - self.time.mean()) / SOLAR_DAY
        return np.asarray(t @ self.error / (t @ t))


def labels(files: Sequence[Path]) -> list[str]:
    """Return unique names of calibrations: of the file, or of the folder of a calibration.json."""
    names = [f.absolute().parent.name if f.name == "calibration.json" else f.stem for f in files]
    return names if len({*names, NONE}) == len(names) + 1 else [str(f) for f in files]
