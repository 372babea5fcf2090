"""A unit turned by hand from rest to rest, without gimbal angles: what several text formats hold."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from gimbalcal.errors import InputError, amount
from gimbalcal.number import Array
from gimbalcal.platform import BENCH
from gimbalcal.recording.detection import detect
from gimbalcal.recording.dwell import dwells
from gimbalcal.recording.kinds import MULTI_POSITION
from gimbalcal.recording.lines import EMPTY
from gimbalcal.recording.record import ANYWHERE, Key, Recording, Source
from gimbalcal.recording.scatter import pooled
from gimbalcal.units import is_raw

TRIAD = ("x", "y", "z")


def text_matrix(path: Path, columns: int) -> Array:
    """Return numbers separated by blanks or commas, `columns` to a line; a missing one is a NaN."""
    rows = []
    with path.open(encoding="utf-8", errors="replace") as file:
        for line, text in enumerate(file, start=1):
            cells = text.replace(",", " ").replace(";", " ").split()
            if not cells:
                continue
            try:
                rows.append([float("nan" if cell in EMPTY else cell) for cell in cells])
            except ValueError:
                raise InputError(f"{path}, line {line}: {text.strip()[:40]!r} is not a row of numbers") from None
            if len(cells) != columns or np.any(np.isinf(rows[-1])):
                raise InputError(f"{path}, line {line}: {columns} finite numbers are wanted, got {text.strip()[:60]!r}")
    if not rows:
        raise InputError(f"{path} is empty; it must hold rows of {columns} numbers")
    return np.array(rows)


def unit_log(
    title: str, time: Array, channels: Mapping[Key, Array], units: Mapping[Key, str], files: Sequence[Path]
) -> Recording:
    """Return a recording of a unit without a platform, its dwells detected. Channels are in SI or raw."""
    whole = np.all(np.isfinite([time, *channels.values()]), axis=0)
    left_out = np.flatnonzero(~whole)
    if not whole.any():
        raise InputError(f"{files[0]}: no row has all its values")
    time, channels = time[whole], {key: values[whole] for key, values in channels.items()}
    wrong = np.flatnonzero(np.diff(time) <= 0)
    if len(wrong):
        raise InputError(f"{files[0]}, row {wrong[0] + 2}: the clock does not go forward; sort the rows")
    force, rate = (
        {axis: values for (quantity, axis), values in channels.items() if quantity == wanted}
        for wanted in ("specific_force", "angular_rate")
    )
    raw = any(is_raw(unit) for key, unit in units.items() if key[0] == "angular_rate")
    position = detect(time, force, rate, raw)
    recording = Recording(
        kind=MULTI_POSITION,
        title=title,
        platform=BENCH,
        site=ANYWHERE,
        noise={},
        time=time,
        position=position,
        channels=channels,
        source=tuple(map(Source.of, files)),
        units=units,
        scatter=pooled(time, position, channels),
    )
    count = amount(len(dwells(recording)), "dwell")
    remarks = [f"{count} found where the sensors are quiet, numbered in order of time"]
    if len(left_out):
        rows = f"{files[0]}, row {left_out[0] + 1}: {amount(len(left_out), 'row')} of {len(whole)}"
        remarks.insert(0, f"{rows} without all values left out, this is the first")
    return replace(recording, remarks=tuple(remarks))
