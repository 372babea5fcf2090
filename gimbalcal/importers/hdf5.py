"""HDF5 files (and whatever is HDF5 inside, such as netCDF-4 and MATLAB v7.3)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gimbalcal.errors import InputError
from gimbalcal.importers.table import COMMON, component, header_for, one_file, only, recording_of, without_index
from gimbalcal.number import Array
from gimbalcal.recording.record import Recording

if TYPE_CHECKING:
    import h5py


def import_hdf5(files: Sequence[Path], options: Mapping[str, str]) -> Recording:
    """One HDF5 file; header = FILE.toml, its columns named by path and index as in "/imu/acc[0]"; rate = Hz."""
    only(options, COMMON)
    path = one_file(files)
    header = header_for(path, options)

    def fetch(name: str) -> Array:
        found = dataset(path, without_index(name))
        if found is None:
            raise InputError(f"{path} has no data set {without_index(name)!r}; it has {', '.join(dataset_names(path))}")
        return component(name, found, path)

    return recording_of(header, options, fetch)


def dataset_names(path: Path) -> tuple[str, ...]:
    """The data sets of a file by their paths inside; `InputError` where it is no HDF5."""
    import h5py

    names: list[str] = []
    with _opened(path) as file:
        file.visititems(lambda each, item: names.append(each) if isinstance(item, h5py.Dataset) else None)
    return tuple(name for name in names if not name.startswith("#"))  # MATLAB keeps its own under #refs#


def dataset(path: Path, name: str) -> Array | None:
    """One data set, its levels separated by a slash or a dot; text as text; None where there is none."""
    import h5py

    with _opened(path) as file:
        found = file.get(name.replace(".", "/").strip("/") or "/")
        if not isinstance(found, h5py.Dataset):
            return None
        value = found[()]
        return np.array([_text(v) for v in np.ravel(value)]) if found.dtype.kind in "SO" else np.asarray(value)


def _opened(path: Path) -> h5py.File:
    import h5py

    try:
        return h5py.File(path, "r")
    except OSError:
        raise InputError(f"{path} is not an HDF5 file, or it is cut short; copy it again") from None


def _text(value: object) -> str:
    return value.decode(errors="replace") if isinstance(value, bytes) else str(value)
