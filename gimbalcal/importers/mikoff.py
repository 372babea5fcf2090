"""Logs of github.com/mikoff/imu-calib: six columns, m/s^2 and rad/s, 100 lines a second, no clock."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from gimbalcal.effects.effect import TRIAD
from gimbalcal.importers.registry import importer, number
from gimbalcal.importers.unit_log import text_matrix, unit_log
from gimbalcal.recording.record import Recording


@importer("mikoff", "rate")
def import_mikoff(files: Sequence[Path], options: Mapping[str, str]) -> Recording:
    """One text file: ax ay az [m/s^2] gx gy gz [rad/s] in each line; rate = lines a second (100)."""
    (path,) = files
    table = text_matrix(path, 6)
    keys = [(q, axis) for q in ("specific_force", "angular_rate") for axis in TRIAD]
    units = {key: "m/s^2" if key[0] == "specific_force" else "rad/s" for key in keys}
    time = np.arange(len(table)) / number(options, "rate", 100.0)
    return unit_log(path.stem, time, {key: table[:, i] for i, key in enumerate(keys)}, units, files)
