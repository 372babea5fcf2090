"""Loops over samples that numba compiles; the machine code is cached in the folder of the source or of the user."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial, update_wrapper
from typing import Any

import numpy as np


class Compiled:
    """A loop as machine code from its first call on: numba is loaded then, which takes longer than many a command."""

    def __init__(self, loop: Callable[..., Any], patience: int = 0) -> None:
        self.loop, self.patience = loop, patience
        self.machine: Callable[..., Any] | None = None
        update_wrapper(self, loop)

    def __call__(self, *given: Any) -> Any:
        if self.machine is None and self.patience and len(given[0]) <= self.patience:
            self.patience -= len(given[0])
            return self.loop(*(g.data if isinstance(g, np.ndarray) else g for g in given))  # of plain numbers
        return (self.machine or self.made())(*given)

    def made(self) -> Callable[..., Any]:
        """Return the machine code, with that of its loops in their place: numba knows its own functions alone."""
        if self.machine is None:
            from numba import njit

            self.machine = njit(cache=True)(self.loop)
            known = self.loop.__globals__
            for name in self.loop.__code__.co_names:
                if isinstance(known.get(name), Compiled):
                    known[name] = known[name].made()
        return self.machine


def compiled(loop: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function of arrays and numbers that is compiled at its first call.

    A kernel stands in one file with its helpers, because the cache does not see changes in another, and in plain
    loops, which compile in a fifth of the time that products of matrices take.
    """
    return Compiled(loop)


def interpreted_first(rows: int) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Return a loop over plain numbers that Python runs by itself for its first rows, of whatever calls.

    Rows are counted by the first argument. Where that is all there is, numba is never loaded.
    """
    return partial(Compiled, patience=rows)
