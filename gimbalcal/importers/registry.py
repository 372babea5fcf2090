"""The contract of an importer: a function from foreign files and options to a `Recording`, registered by its kind."""

from __future__ import annotations

import tokenize
import zipfile
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gimbalcal.errors import InputError
from gimbalcal.recording.record import Recording

Reader = Callable[[Sequence[Path], Mapping[str, str]], Recording]
DAMAGED = (
    OSError, EOFError, KeyError, ValueError, TypeError, OverflowError, MemoryError, RuntimeError, SyntaxError,
    zipfile.BadZipFile, zlib.error, tokenize.TokenError,
)  # fmt: skip
"""What libraries raise at a file that is cut short, damaged or of another kind."""
COMMON_OPTIONS = ("title", "means")  # that every kind has: another title; means = yes keeps one row per dwell


@dataclass(frozen=True)
class Importer:
    """One kind of foreign files: the function that reads them, its options, and whether it takes one file only."""

    kind: str
    read: Reader
    options: tuple[str, ...]
    single_file: bool

    @property
    def summary(self) -> str:
        """Return the first line of the function's docstring: which files and options are wanted."""
        return (self.read.__doc__ or "").strip().partition("\n")[0]

    def refuse(self, files: Sequence[Path], options: Mapping[str, str]) -> None:
        """Raise InputError for an option that this importer does not read, or several files where it takes one."""
        for key in options:
            if key not in (*self.options, *COMMON_OPTIONS):
                known = ", ".join([*self.options, *COMMON_OPTIONS])
                raise InputError(f"the option {key!r} is not known here; there are {known}")
        if self.single_file and len(files) != 1:
            raise InputError(f"give one file at a time, got {len(files)}")


KINDS: dict[str, Importer] = {}
"""Importers by the kind of foreign files that each reads."""


def importer(kind: str, *options: str, single_file: bool = True) -> Callable[[Reader], Reader]:
    """Register a function as the importer of a kind of files, with the options that it reads."""

    def register(read: Reader) -> Reader:
        one = Importer(kind, read, options, single_file)
        if (first := KINDS.setdefault(kind, one)) is not one:
            raise ValueError(f"two importers are called {kind!r}: {first.read.__name__} and {read.__name__}")
        return read

    return register


def number(options: Mapping[str, str], key: str, default: float) -> float:
    """Return a number among the options that is not negative."""
    try:
        value = float(options.get(key, default))
    except ValueError:
        value = np.nan
    if not (np.isfinite(value) and value >= 0):
        raise InputError(f"the option {key} must be a number of at least 0, got {options[key]!r}")
    return value


def one_of(options: Mapping[str, str], key: str, default: str, choices: Mapping[str, str]) -> str:
    """Return an option that takes one of a few words; choices say what each of them means."""
    value = options.get(key, default)
    if value not in choices:
        listed = " or ".join(f"{choice} ({meaning})" if meaning else choice for choice, meaning in choices.items())
        raise InputError(f"the option {key} must be {listed}, got {value!r}")
    return value
