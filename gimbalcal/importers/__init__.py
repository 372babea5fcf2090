"""Importers of other rigs' files: one small file per format, each a function under `@importer(KIND)`.

To add a format, write ``mine.py`` here with such a function, or name a module of an installed package under the entry
points `gimbalcal.importers`. The first line of its docstring says which files and options are wanted; the command line
prints it. What several formats share is in the same folder: `text_file`, `described_table`, `sandboxed_reader`.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib.metadata import entry_points
from pathlib import Path

import numpy as np

from gimbalcal.checks.column_checks import MAX_READING
from gimbalcal.errors import InputError
from gimbalcal.importers.registry import COMMON_OPTIONS, KINDS, Importer, importer
from gimbalcal.quantities import QUANTITIES
from gimbalcal.recording import Recording, dwell_means

__all__ = ["KINDS", "Importer", "import_files", "importer"]

YES, NO = ("yes", "true", "1", "on"), ("no", "false", "0", "off")

for _module in pkgutil.iter_modules(__path__):  # every file here may register a kind: a new one needs no other edit
    importlib.import_module(f"{__name__}.{_module.name}")
for _point in entry_points(group=__name__):
    _point.load()


def import_files(kind: str, files: Sequence[str | Path], options: Mapping[str, str] | None = None) -> Recording:
    """Return the recording in foreign files; `InputError` if the kind, a file or its content is not as it must be."""
    importer_of_kind = KINDS.get(kind)
    if importer_of_kind is None:
        raise InputError(f"there is no importer {kind!r}; take one of {', '.join(sorted(KINDS))}")
    paths = [Path(file) for file in files]
    for path in paths:
        if not path.is_file():
            raise InputError(f"{path} does not exist or is not a file; give the files that {kind} is to read")
    options = dict(options or {})
    average = _means_of_dwells(options.get("means", "no"))
    importer_of_kind.refuse(paths, options)
    own = {key: value for key, value in options.items() if key not in COMMON_OPTIONS}
    recording = importer_of_kind.read(paths, own)
    _refuse_beyond_measure(paths[0], recording)
    if "title" in options:
        recording = replace(recording, title=options["title"])
    if average:
        scatter = {name: recording.sigma(name) for name in ("accelerometer", "gyroscope")}
        noise = {name: sigma for name, sigma in scatter.items() if sigma is not None}
        recording = replace(dwell_means(recording), noise={**noise, **recording.noise})
    return recording


def _refuse_beyond_measure(path: Path, recording: Recording) -> None:
    """Raise InputError where a channel reaches what no sensor reads: a cell is damaged, or in another unit."""
    for (quantity, axis), x in recording.channels.items():
        most = float(np.nanmax(np.abs(x), initial=0.0))
        if most > MAX_READING.get(quantity, np.inf) and not recording.counted(quantity):
            raise InputError(
                f"{path}: the {quantity} {axis} reaches {most:.3g} {QUANTITIES[quantity].si}, more than any sensor "
                "can read; correct the cell or the unit"
            )


def _means_of_dwells(option: str) -> bool:
    if option.lower() not in (*YES, *NO):
        raise InputError(f"the option means is yes (one row for each dwell) or no, got {option!r}")
    return option.lower() in YES
