"""Limit the memory that a file takes: count its rows, and refuse a size out of proportion when it is unpacked."""

from __future__ import annotations

import os
import zipfile
from pathlib import Path

from gimbalcal.errors import InputError

MAX_MEMORY_SHARE = 0.5  # of the memory of this machine for one file
START = 1 << 20  # bytes of a text that show how long its lines are
PACKED, LARGE = 50, 500_000_000  # times its file, and bytes: readings of sensors are noise and do not pack so well


def memory_limit() -> int:
    """Return the bytes that one file may take."""
    return int(MAX_MEMORY_SHARE * os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))


def refuse_bomb(path: Path, needed: int, streamed: bool = False) -> None:
    """Raise InputError where the content of a file, `needed` bytes, is out of proportion to it or to the memory.

    What is `streamed` need not be in memory as a whole.
    """
    size = path.stat().st_size
    if (needed > memory_limit() and not streamed) or (needed > LARGE and needed > PACKED * size):
        raise InputError(
            f"{path} has {size / 1e6:.3g} MB and would take {needed / 1e9:.3g} GB when it is unpacked, which no "
            "readings of sensors do; correct it, or cut it into parts"
        )


def refuse_packed_bomb(path: Path) -> None:
    """Raise InputError where the members of a ZIP archive are out of proportion to it or to the memory.

    Raises BadZipFile for a file that is no such archive.
    """
    with zipfile.ZipFile(path) as packed:
        refuse_bomb(path, sum(each.file_size for each in packed.infolist()))


def rows_in(path: Path) -> int:
    """Return the number of rows of a samples file: of text by its size and its first lines, 0 where unreadable."""
    import polars as pl

    try:
        if path.suffix == ".parquet":
            return int(pl.scan_parquet(path.absolute(), glob=False).select(pl.len()).collect().item())
        with path.open("rb") as file:
            start = file.read(START)
        return int(path.stat().st_size / len(start) * start.count(b"\n")) if start else 0
    except (pl.exceptions.PolarsError, OSError):
        return 0  # the reader says what is wrong with it
