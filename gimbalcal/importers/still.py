"""A unit turned by hand from rest to rest, without gimbal angles: what several text formats hold."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from gimbalcal.errors import InputError, amount
from gimbalcal.number import Array
from gimbalcal.platform import BENCH
from gimbalcal.recording.detection import detect
from gimbalcal.recording.dwell import dwells
from gimbalcal.recording.record import Key, Recording, Site, Source
from gimbalcal.recording.scatter import pooled

TRIAD = ("x", "y", "z")


def text_matrix(path: Path, columns: int) -> Array:
    """Numbers separated by blanks, `columns` to a line."""
    rows = []
    with path.open(encoding="utf-8", errors="replace") as file:
        for line, text in enumerate(file, start=1):
            cells = text.split()
            if not cells:
                continue
            try:
                rows.append([float(cell) for cell in cells])
            except ValueError:
                raise InputError(f"{path}, line {line}: {text.strip()[:40]!r} is not a row of numbers") from None
            if len(cells) != columns or not np.all(np.isfinite(rows[-1])):
                raise InputError(f"{path}, line {line}: {columns} finite numbers are wanted, got {text.strip()[:60]!r}")
    if not rows:
        raise InputError(f"{path} is empty; it must hold rows of {columns} numbers")
    return np.array(rows)


def still_positions(
    title: str, time: Array, channels: Mapping[Key, Array], units: Mapping[Key, str], files: Sequence[Path]
) -> Recording:
    """The multi-position recording of a unit without a platform; its dwells are detected. Channels are in SI or raw."""
    wrong = np.flatnonzero(np.diff(time) <= 0)
    if len(wrong):
        raise InputError(f"{files[0]}, row {wrong[0] + 2}: the clock does not go forward; sort the rows")
    position = detect(
        time, {axis: values for (quantity, axis), values in channels.items() if quantity == "specific_force"}
    )
    recording = Recording(
        kind="multi-position",
        title=title,
        platform=BENCH,
        site=Site(),
        noise={},
        time=time,
        position=position,
        channels=channels,
        source=tuple(Source(path.name, hashlib.sha256(path.read_bytes()).hexdigest()) for path in files),
        units=units,
        scatter=pooled(time, position, channels),
    )
    stays = amount(len(dwells(recording)), "dwell")
    found = f"{stays} found where the sensors are quiet, numbered in order of time"
    return replace(recording, remarks=(found,))
