"""MATLAB .mat files: up to v7 by scipy, v7.3 as the HDF5 that it is; a recording may be spread over several."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from gimbalcal.errors import InputError
from gimbalcal.importers.described_table import from_variables
from gimbalcal.importers.hdf5 import dataset_names, read_dataset
from gimbalcal.importers.registry import importer
from gimbalcal.importers.sandboxed_reader import matlab_variables
from gimbalcal.recording.record import Recording, Source

_HDF5 = b"\x89HDF\r\n\x1a\n"


@dataclass(frozen=True, eq=False)
class _Variables:
    """What one file holds: `find` gives the variable of a dotted name or None; `names` are those at the top."""

    path: Path
    names: tuple[str, ...]
    find: Callable[[str], Any]


@importer("mat", "header", "rate", single_file=False)
def import_matlab(files: Sequence[Path], options: Mapping[str, str]) -> Recording:
    """.mat files of one recording; header = FILE.toml, its columns named as in "imu.acc[0]" or by file; rate = Hz.

    A column is called by variable, field and index; where each channel has a file of its own, by the name of the file
    (its only variable is meant) or by file and variable, "ax.data".
    """
    variables = [_open_variables(path) for path in files]
    recording = from_variables(files[0], options, lambda name: _variable(variables, name))
    return replace(recording, source=(*recording.source, *map(Source.of, files[1:])))


def _variable(variables: Sequence[_Variables], name: str) -> tuple[Path, Any]:
    """Return the file and the variable that a column is called by: a variable first, then a file, then both."""
    matches = [(v.path, v.find(name)) for v in variables if v.find(name) is not None]
    stem, _, rest = name.partition(".")
    for v in variables:
        if not matches and v.path.stem == stem:
            inner = rest or (v.names[0] if len(v.names) == 1 else "")
            matches += [(v.path, v.find(inner))] if inner and v.find(inner) is not None else []
    if len(matches) == 1:
        return matches[0]
    if matches:
        which = " and ".join(path.name for path, _ in matches)
        better = f"{matches[0][0].stem}.{name}"
        raise InputError(f"{name} is in {which}; write the name of the file before it, as in {better}")
    has = "; ".join(f"{v.path} has {', '.join(v.names) or 'none'}" for v in variables)
    if len(variables) == 1:
        raise InputError(f"{variables[0].path} has no variable {name!r}; it has {', '.join(variables[0].names)}")
    raise InputError(f"no file has a variable {name!r}, and none that holds one variable is called so; {has}")


def _open_variables(path: Path) -> _Variables:
    with path.open("rb") as file:
        start = file.read(520)
    if _HDF5 in (start[:8], start[512:520]):  # MATLAB puts 512 bytes of its own before the signature
        return _Variables(path, dataset_names(path), lambda name: read_dataset(path, name))
    variables = matlab_variables(path)
    return _Variables(path, tuple(variables), variables.get)
