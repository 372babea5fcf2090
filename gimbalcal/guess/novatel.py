r"""Raw increments as receivers of NovAtel log them in ASCII: RAWIMU and RAWIMUS, and both extended by an X.

A line is ``%RAWIMUSA,...;week,seconds,status,Z,-Y,X,Z,-Y,X*crc``: velocity increments, then angle increments, in counts
whose size depends on the unit and is left to the calibration. Other logs may stand between. [novatel-rawimus]
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from gimbalcal.errors import InputError
from gimbalcal.guess.text_table import Table
from gimbalcal.importers.text_file import encoding_of

WEEK_S = 604800.0  # s
HEAD_LINES = 200  # lines, of which one is such a log
_LINE = re.compile(r"[#%]RAWIMUS?(X?)A,[^;]*;([^*]*)\*[0-9a-fA-F]{8}")
_NAMES = ("time [s]", *(f"{of}_{axis} [count]" for of in ("acc", "gyro") for axis in "xyz"))


def rawimu_counts(path: Path) -> Table | None:
    """Return counts of velocity and angle along x, y, z, and GPS time [s]; None for a file without such lines.

    Raises InputError for a line of the kind that is damaged, with its number; the last one may be cut short.
    """
    rows: list[list[float]] = []
    damaged = 0
    with path.open(encoding=encoding_of(path), errors="replace") as file:
        for number, line in enumerate(file, start=1):
            if not rows and number > HEAD_LINES:
                return None
            if not line.startswith(("#RAWIMU", "%RAWIMU")):
                continue
            if damaged:
                raise InputError(f"{path}, line {damaged}: this RAWIMU log is damaged; delete the line or log again")
            row = _counts(line)
            if row is None:
                damaged = number
            else:
                rows.append(row)
    if not rows:
        return None
    week, seconds, az, ay, ax, gz, gy, gx = np.array(rows).T
    columns = (WEEK_S * week + seconds, ax, -ay, az, gx, -gy, gz)
    return Table(dict(zip(_NAMES, columns, strict=True)))


def _counts(line: str) -> list[float] | None:
    """Return week, seconds and the six counts in the order of a line; None for one that is not whole."""
    match = _LINE.match(line)
    cells = match[2].split(",") if match else []
    if match is None or len(cells) != 9 + 2 * len(match[1]):
        return None
    cells = cells[2 * len(match[1]) :]
    try:
        return [float(cell) for k, cell in enumerate(cells) if k != 2]  # the status is no number
    except ValueError:
        return None
