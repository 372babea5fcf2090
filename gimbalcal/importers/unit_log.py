"""A unit turned by hand from rest to rest, without gimbal angles: what several text formats hold."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from gimbalcal.errors import InputError
from gimbalcal.number import Array
from gimbalcal.recording.frames import from_frame
from gimbalcal.recording.lines import EMPTY
from gimbalcal.recording.noise_levels import pooled_scatter
from gimbalcal.recording.record import Key, Recording, Source


def text_matrix(path: Path, columns: int) -> Array:
    """Return numbers separated by blanks or commas, `columns` to a line; a missing one is a NaN."""
    rows = []
    with path.open(encoding="utf-8-sig", errors="replace") as file:
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
    title: str,
    time: Array,
    channels: Mapping[Key, Array],
    units: Mapping[Key, str],
    files: Sequence[Path],
    kind: str = "multi-position",
) -> Recording:
    """Return a recording of a unit without a platform; time [s], channels (n,) in their units.

    Of the kind multi-position its dwells are detected.
    """
    columns = {"time": time, **{" ".join(key): values for key, values in channels.items()}}
    entries = {"time": "time [s]", **{" ".join(key): f"{' '.join(key)} [{units[key]}]" for key in channels}}
    recording = from_frame(columns, entries, kind=kind, title=title, called=str(files[0]))
    scatter = pooled_scatter(recording.time, recording.position, recording.channels)
    return replace(recording, source=tuple(map(Source.of, files)), scatter=scatter)
