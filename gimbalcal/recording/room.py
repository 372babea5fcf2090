"""How much a file may become when it is unpacked: what memory holds, and what readings of sensors can be packed to."""

from __future__ import annotations

import os
from pathlib import Path

from gimbalcal.errors import InputError

HALF = 0.5  # of the memory of this machine for one file
PACKED, LARGE = 50, 500_000_000  # times its file, and bytes: readings of sensors are noise and do not pack so well


def room() -> int:
    """Bytes that one file may take."""
    return int(HALF * os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))


def refuse_bomb(path: Path, needed: int, streamed: bool = False) -> None:
    """Raise InputError where the content of a file, `needed` bytes, is out of proportion to it or to the memory.

    What is `streamed` need not be in memory as a whole.
    """
    size = path.stat().st_size
    if (needed > room() and not streamed) or (needed > LARGE and needed > PACKED * size):
        raise InputError(
            f"{path} has {size / 1e6:.3g} MB and would take {needed / 1e9:.3g} GB when it is unpacked, which no "
            "readings of sensors do; correct it, or cut it into parts"
        )
