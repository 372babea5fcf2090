"""Loops over samples that numba compiles; the machine code is kept beside the source, or in the user's cache."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba import njit


def compiled(loop: Callable[..., Any]) -> Callable[..., Any]:
    """A function of arrays and numbers, compiled at its first call.

    A kernel stands in one file with its helpers, because the cache does not see changes in another, and in plain
    loops, which compile in a fifth of the time that products of matrices take.
    """
    made: Callable[..., Any] = njit(cache=True)(loop)
    return made
