"""HDF5 files (and whatever is HDF5 inside, such as netCDF-4 and MATLAB v7.3)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gimbalcal.errors import InputError
from gimbalcal.importers.described_table import from_variables
from gimbalcal.importers.registry import DAMAGED, importer
from gimbalcal.number import Array
from gimbalcal.recording.memory_limit import refuse_bomb
from gimbalcal.recording.record import Recording

if TYPE_CHECKING:
    import h5py


@importer("hdf5", "header", "rate")
def import_hdf5(files: Sequence[Path], options: Mapping[str, str]) -> Recording:
    """One HDF5 file; header = FILE.toml, its columns named by path and index as in "/imu/acc[0]"; rate = Hz."""
    (path,) = files

    def variable(name: str) -> tuple[Path, Array]:
        values = read_dataset(path, name)
        if values is None:
            raise InputError(f"{path} has no data set {name!r}; it has {', '.join(dataset_names(path))}")
        return path, values

    return from_variables(path, options, variable)


def dataset_names(path: Path) -> tuple[str, ...]:
    """Return the data sets of a file by their paths inside; `InputError` where it is no HDF5."""
    import h5py

    names: list[str] = []
    with _open_hdf5(path) as file:
        file.visititems(lambda each, item: names.append(each) if isinstance(item, h5py.Dataset) else None)
    return tuple(name for name in names if not name.startswith("#"))  # MATLAB keeps its own under #refs#


def read_dataset(path: Path, name: str) -> Array | None:
    """Return one data set, its levels separated by a slash or a dot; text as text; None where there is none.

    Raises InputError for one whose content lies in another file: what a file shows of this machine is its own.
    """
    import h5py

    with _open_hdf5(path) as file:
        place = name.replace(".", "/").strip("/") or "/"
        _refuse_external_links(path, file, place)
        item = file.get(place)
        if not isinstance(item, h5py.Dataset):
            return None
        if item.external or item.is_virtual:
            raise InputError(f"{path}: the numbers of {name!r} lie in another file; copy them into this one")
        refuse_bomb(path, item.size * max(item.dtype.itemsize, 8))
        value = item[()]
        if item.dtype.kind in "SO":
            return np.array([v.decode(errors="replace") if isinstance(v, bytes) else str(v) for v in np.ravel(value)])
        return np.asarray(value)


def _refuse_external_links(path: Path, file: h5py.File, place: str) -> None:
    """Raise InputError where a name, or any link behind it, leads into another file; nothing is followed unseen."""
    import h5py

    pending, followed = [place], set()
    while pending:
        parts = pending.pop().strip("/").split("/")
        for i in range(1, len(parts) + 1):
            level = "/".join(parts[:i])
            link = file.get(level, getlink=True) if level else None
            if isinstance(link, h5py.ExternalLink):
                raise InputError(f"{path}: {level!r} is a link to another file; copy what it means into this one")
            if isinstance(link, h5py.SoftLink) and level not in followed:
                followed.add(level)
                to = link.path if link.path.startswith("/") else "/".join([*parts[: i - 1], link.path])
                pending.append("/".join([to, *parts[i:]]))
                break


@contextmanager
def _open_hdf5(path: Path) -> Iterator[h5py.File]:
    """Open the file; whatever its content does to the library is raised as one sentence."""
    import h5py

    try:
        with h5py.File(path, "r") as file:
            yield file
    except InputError:
        raise
    except DAMAGED:
        raise InputError(f"{path} is not an HDF5 file, or it is cut short or damaged; copy it again") from None
