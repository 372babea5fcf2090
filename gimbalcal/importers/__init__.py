"""Other rigs' files: one small file per rig, each a function from files and options to a `Recording`.

To add a rig, write ``mine.py`` with such a function and enter it in `KINDS`. The first line of its docstring is what
the command line prints, so it says which files and options are wanted.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType

from gimbalcal.errors import InputError
from gimbalcal.importers.delimited import import_csv
from gimbalcal.importers.hdf5 import import_hdf5
from gimbalcal.importers.imu_tk import import_imu_tk
from gimbalcal.importers.matlab import import_matlab
from gimbalcal.importers.mikoff import import_mikoff
from gimbalcal.importers.mmt import import_mmt
from gimbalcal.importers.phd2 import import_phd2
from gimbalcal.importers.tilt_table import import_tilt_table
from gimbalcal.importers.tpoint import import_tpoint
from gimbalcal.recording import Recording, dwell_means

Importer = Callable[[Sequence[Path], Mapping[str, str]], Recording]

KINDS: Mapping[str, Importer] = MappingProxyType(
    {
        "csv": import_csv,
        "hdf5": import_hdf5,
        "imu-tk": import_imu_tk,
        "mat": import_matlab,
        "mikoff": import_mikoff,
        "mmt": import_mmt,
        "phd2": import_phd2,
        "tilt-table": import_tilt_table,
        "tpoint": import_tpoint,
    }
)
"""Kinds of foreign files and the function that reads each."""

EVERYWHERE = ("title", "means")
"""Options that every kind has: another title; means = yes keeps one row per dwell."""


YES, NO = ("yes", "true", "1", "on"), ("no", "false", "0", "off")


def _asked(means: str) -> bool:
    """Whether the option means says yes."""
    if means.lower() not in (*YES, *NO):
        raise InputError(f"the option means is yes (one row for each dwell) or no, got {means!r}")
    return means.lower() in YES


def import_files(kind: str, files: Sequence[str | Path], options: Mapping[str, str] | None = None) -> Recording:
    """The recording in the foreign `files`; `InputError` if the kind, a file or its content is not as it must be."""
    if kind not in KINDS:
        raise InputError(f"there is no importer {kind!r}; take one of {', '.join(KINDS)}")
    paths = [Path(file) for file in files]
    for path in paths:
        if not path.is_file():
            raise InputError(f"{path} does not exist or is not a file; give the files that {kind} is to read")
    options = dict(options or {})
    own = {key: value for key, value in options.items() if key not in EVERYWHERE}
    average = _asked(options.get("means", "no"))
    recording = KINDS[kind](paths, own)
    if "title" in options:
        recording = replace(recording, title=options["title"])
    if average:
        seen = {name: recording.sigma(name) for name in ("accelerometer", "gyroscope")}
        noise = {name: sigma for name, sigma in seen.items() if sigma is not None}
        recording = replace(dwell_means(recording), noise={**noise, **recording.noise})
    return recording
