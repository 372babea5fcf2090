"""How a process that makes many arrays and ends soon treats the memory that it frees."""

from __future__ import annotations

import ctypes
import gc
import os
import sys

GC_THRESHOLD = 50_000  # objects between collections, which at the default take a tenth of a short command
TRIM_THRESHOLD, MMAP_THRESHOLD = -1, -3  # options of mallopt, from malloc.h of glibc
KEPT_BYTES = 128 << 20  # of freed memory at the end of the heap
MAPPED_BYTES = 32 << 20  # of an array that has a mapping of its own, given back when it is freed; the largest allowed


def reuse_freed_memory() -> None:
    """Keep memory that arrays free for the arrays that follow, and collect garbage less often than by default.

    glibc returns freed memory to the system in small steps, and the system clears each page that it gives out again:
    a tenth of the processor time of fits whose arrays are a few megabytes. Other C libraries keep their own way. NumPy,
    which must not be imported before, asks for huge pages unless the user has said otherwise; where free memory is
    scattered, the system moves other pages to make them.
    """
    os.environ.setdefault("NUMPY_MADVISE_HUGEPAGE", "0")
    gc.set_threshold(GC_THRESHOLD)
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None) if sys.platform == "linux" else None
    if mallopt is not None:
        mallopt(TRIM_THRESHOLD, KEPT_BYTES)
        mallopt(MMAP_THRESHOLD, MAPPED_BYTES)
