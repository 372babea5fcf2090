"""HDF5 files (and whatever is HDF5 inside, such as netCDF-4 and MATLAB v7.3)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from gimbalcal.errors import InputError
from gimbalcal.importers.table import COMMON, component, header_for, one_file, only, recording_of, without_index
from gimbalcal.number import Array
from gimbalcal.recording.record import Recording


def import_hdf5(files: Sequence[Path], options: Mapping[str, str]) -> Recording:
    """One HDF5 file; header = FILE.toml, its columns named by path and index as in "/imu/acc[0]"; rate = Hz."""
    import h5py

    only(options, COMMON)
    path = one_file(files)
    header = header_for(path, options)
    try:
        file = h5py.File(path, "r")
    except OSError:
        raise InputError(f"{path} is not an HDF5 file, or it is cut short; copy it again") from None
    with file:

        def fetch(name: str) -> Array:
            found = file.get(without_index(name).replace(".", "/"))
            if not isinstance(found, h5py.Dataset):
                names: list[str] = []
                file.visititems(lambda each, item: names.append(each) if isinstance(item, h5py.Dataset) else None)
                raise InputError(f"{path} has no data set {without_index(name)!r}; it has {', '.join(names)}")
            return component(name, np.asarray(found[()]), path)

        return recording_of(header, options, fetch)
