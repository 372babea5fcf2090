"""Text files of the imu_tk toolkit: time and three raw outputs to a line, one file per triad.

Format: github.com/Kyle-ak/imu_tk, bin/test_data; data of Tedaldi, Pretto and Menegatti, "A robust and easy to implement
method for IMU calibration without external equipments", ICRA 2014. The files are called .mat and are text.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from gimbalcal.errors import InputError
from gimbalcal.importers.still import TRIAD, still_positions, text_matrix
from gimbalcal.importers.table import only
from gimbalcal.recording.record import Recording


def import_imu_tk(files: Sequence[Path], options: Mapping[str, str]) -> Recording:
    """Two text files, accelerometers then gyroscopes (or the first only): time [s] and x y z [count] in each line."""
    only(options, ())
    if len(files) not in (1, 2):
        raise InputError(f"imu-tk reads one or two files (accelerometers, gyroscopes), got {len(files)}")
    tables = [text_matrix(path, 4) for path in files]
    time = tables[0][:, 0]
    for path, table in zip(files[1:], tables[1:], strict=True):
        if len(table) != len(time) or not np.array_equal(table[:, 0], time):
            raise InputError(f"{path} does not have the times of {files[0]}; give two files of one session")
    quantities = ("specific_force", "angular_rate")[: len(files)]
    channels = {
        (q, axis): table[:, 1 + i] for q, table in zip(quantities, tables, strict=True) for i, axis in enumerate(TRIAD)
    }
    return still_positions(files[0].stem, time, channels, dict.fromkeys(channels, "count"), files)
