"""Calibrations of one unit over the years, drawn from their covariance."""

from datetime import UTC, datetime, timedelta

import numpy as np

from gimbalcal.calibration import Calibration, Provenance, Residual
from gimbalcal.effects import CATALOGUE, parameters, with_values
from gimbalcal.history import DatedCalibration
from gimbalcal.number import Array
from gimbalcal.recording import Source

START = datetime(2024, 3, 1, 12, tzinfo=UTC)
WANTED = tuple(p for i in ("bias", "scale_factor") for p in parameters(CATALOGUE[i]))
SIGMA = 0.01 * np.array([p.sigma for p in WANTED])
R = 0.3 + 0.7 * np.eye(len(WANTED))
LABELS = [p.label for p in WANTED]


def calibration(x: Array, k: int = 0, size: float = 1.0, recording: str = "") -> Calibration:
    """A calibration with these values (6,) in sigmas, made from a recording of its own."""
    effects = with_values((), WANTED, x * SIGMA)
    files = Source("a/recording.toml", "same"), Source("a/samples.csv", recording or f"{k:064x}")
    origin = Provenance(recordings=files, created=(START + timedelta(days=90 * k)).isoformat())
    P = size**2 * R * np.outer(SIGMA, SIGMA)
    return Calibration("three-stage", effects, WANTED, P, (), Residual(1.0, 1, {}), provenance=origin)


def history(seed: int, n: int = 7, course: Array | None = None, recording: str = "") -> list[DatedCalibration]:
    """n calibrations 90 days apart about 100 sigmas, plus `course` (n, 6) in sigmas."""
    rng = np.random.default_rng(seed)
    x = 100 + rng.standard_normal((n, len(WANTED))) @ np.linalg.cholesky(R).T + (0 if course is None else course)
    return [
        DatedCalibration(f"{k}.json", START + timedelta(days=90 * k), calibration(x[k], k, 1.0, recording))
        for k in range(n)
    ]
