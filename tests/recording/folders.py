"""A small recording as a folder on disk, for tests that read it or spoil it."""

from pathlib import Path

import numpy as np
import pytest

from gimbalcal.errors import InputError
from gimbalcal.number import Array
from gimbalcal.recording import read

HEADER = """\
format = 1
kind = "multi-position"
title = "two positions"
samples = "samples.csv"

[site]
latitude = { value = 40.0, unit = "deg" }
gravity  = { value = 9.80146, unit = "m/s^2" }

[platform]
name = "space-stable"

[noise]
accelerometer = { value = 100.0, unit = "ug" }

[columns]
time_s   = { quantity = "time", unit = "s" }
position = { quantity = "position" }
accel_x  = { quantity = "specific_force", axis = "x", unit = "g" }
accel_y  = { quantity = "specific_force", axis = "y", unit = "g" }
accel_z  = { quantity = "specific_force", axis = "z", unit = "g" }
middle   = { quantity = "gimbal_angle", axis = "middle", unit = "deg" }
temp     = { quantity = "temperature", unit = "K" }
"""
NAMES = ["time_s", "position", "accel_x", "accel_y", "accel_z", "middle", "temp"]
DWELL = 40


def rows(seed: int = 1) -> Array:
    """Two dwells of 40 s at 1 Hz: z down, then x up; 100 ug of noise."""
    rng = np.random.default_rng(seed)
    time = np.concatenate([np.arange(DWELL), 100 + np.arange(DWELL)])
    position = np.repeat([1, 2], DWELL)
    force = np.repeat([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0]], DWELL, axis=0) + 1e-4 * rng.standard_normal((2 * DWELL, 3))
    middle = np.repeat([0.0, 90.0], DWELL)
    return np.column_stack([time, position, force.round(7), middle, np.full(2 * DWELL, 295.15)])


def text(table: Array, names: list[str] = NAMES) -> str:
    return "\n".join([",".join(names), *(",".join(repr(float(v)) for v in row) for row in table)]) + "\n"


def folder(path: Path, header: str = HEADER, samples: str | None = None) -> Path:
    """A recording folder on disk."""
    target = path / "rec"
    target.mkdir(exist_ok=True)
    (target / "recording.toml").write_text(header, encoding="utf-8")
    (target / "samples.csv").write_text(text(rows()) if samples is None else samples, encoding="utf-8")
    return target


def refusal(path: Path, header: str = HEADER, samples: str | None = None) -> str:
    """The sentence with which the recording is refused, less the path of the folder."""
    target = folder(path, header, samples)
    with pytest.raises(InputError) as caught:
        read(target)
    return str(caught.value).replace(f"{target}/", "")


def changed(row: int, column: str, value: float | str) -> str:
    """The samples with one cell changed (row from 0)."""
    lines = text(rows()).splitlines()
    cells = lines[row + 1].split(",")
    cells[NAMES.index(column)] = str(value)
    lines[row + 1] = ",".join(cells)
    return "\n".join(lines) + "\n"
