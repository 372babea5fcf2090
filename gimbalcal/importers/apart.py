"""Files whose reader could crash, read in a process of its own."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from gimbalcal.errors import InputError
from gimbalcal.number import Array
from gimbalcal.recording.room import room


def matlab_variables(path: Path) -> dict[str, Array]:
    """Variables of a MATLAB file up to v7 by name, fields of structures by dotted name. Raises InputError."""
    program = Path(__file__).with_name("matlab_reader.py")
    with tempfile.TemporaryDirectory(prefix="gimbalcal-") as folder:
        into = Path(folder) / "variables.npz"
        command = [sys.executable, "-P", str(program), str(path.absolute()), str(into), str(room())]
        ended = subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=False)  # noqa: S603
        if ended.returncode or not into.is_file():
            raise InputError(
                f"{path} is not a MATLAB file of version 5 to 7, or it is cut short or damaged; save it again (text "
                "files that are only called .mat go through `gimbalcal import imu-tk` or `csv`)"
            )
        with np.load(into) as found:
            return {name: np.asarray(found[name]) for name in found.files}
