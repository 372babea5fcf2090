"""MATLAB .mat files: up to v7 by scipy, v7.3 as the HDF5 that it is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from gimbalcal.errors import InputError
from gimbalcal.importers.hdf5 import import_hdf5
from gimbalcal.importers.table import COMMON, component, header_for, one_file, only, recording_of, without_index
from gimbalcal.number import Array
from gimbalcal.recording.record import Recording

_HDF5 = b"\x89HDF\r\n\x1a\n"


def import_matlab(files: Sequence[Path], options: Mapping[str, str]) -> Recording:
    """One .mat file; header = FILE.toml, its columns named as in "imu.acc[0]" (variable, field, index); rate = Hz."""
    import scipy.io

    only(options, COMMON)
    path = one_file(files)
    with path.open("rb") as file:
        start = file.read(520)
    if _HDF5 in (start[:8], start[512:520]):  # MATLAB puts 512 bytes of its own before the signature
        return import_hdf5(files, options)
    header = header_for(path, options)
    try:
        variables: dict[str, Any] = scipy.io.loadmat(path, struct_as_record=False, squeeze_me=True)
    except (ValueError, TypeError, EOFError, OSError, NotImplementedError):
        raise InputError(
            f"{path} is not a MATLAB file, or it is cut short; text files that are only called .mat go through "
            "`gimbalcal import imu-tk` or `csv`"
        ) from None

    def fetch(name: str) -> Array:
        found: Any = variables
        for part in without_index(name).split("."):
            found = found.get(part) if isinstance(found, dict) else getattr(found, part, None)
        if found is None:
            names = ", ".join(key for key in variables if not key.startswith("__"))
            raise InputError(f"{path} has no variable {without_index(name)!r}; it has {names}")
        return component(name, np.asarray(found), path)

    return recording_of(header, options, fetch)
