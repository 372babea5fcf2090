"""Pointing runs of the 6.5 m MMT, an alt-azimuth telescope: github.com/MMTObservatory/pytelpoint, `read_raw_datfile`.

Each star is a block of lines; RAA is the raw encoder reading, TAA the true direction, altitude then azimuth in degrees.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from gimbalcal.errors import InputError
from gimbalcal.importers.pointing_files import elapsed_seconds, pointing_run, sexagesimal
from gimbalcal.importers.registry import importer
from gimbalcal.platform import KNOWN
from gimbalcal.recording.record import Recording, Site

LATITUDE = np.radians(31 + 41 / 60 + 19.6 / 3600)  # pytelpoint, constants.py
HEIGHT = 2600.0  # m, ibid.
FEWEST, MOST = {"RAA": 2, "TAA": 2, "LST": 1}, {"RAA": 720.0, "TAA": 720.0, "LST": 24.0}  # numbers; deg and h
AXES = ("elevation", "azimuth")


@importer("mmt")
def import_mmt(files: Sequence[Path], _options: Mapping[str, str]) -> Recording:
    """One .dat file of the MMT: blocks of CAT, RAA (raw), TAA (true altitude, azimuth [deg]) and LST lines."""
    (path,) = files
    numbers_of: dict[str, list[list[float]]] = {"RAA": [], "TAA": [], "LST": []}
    for line, text in enumerate(path.read_text(encoding="utf-8-sig", errors="replace").splitlines(), start=1):
        name, colon, rest = text.partition(":")
        if not colon or name not in numbers_of:
            continue
        try:
            numbers = [sexagesimal(rest.split(":"))] if name == "LST" else [float(word) for word in rest.split()]
        except ValueError:
            raise InputError(f"{path}, line {line}: {text.strip()[:60]!r} does not hold numbers") from None
        if len(numbers) < FEWEST[name] or not all(abs(x) <= MOST[name] for x in numbers[:2]):
            wanted = "hours, minutes and seconds" if name == "LST" else "an altitude and an azimuth in degrees"
            raise InputError(f"{path}, line {line}: {text.strip()[:60]!r} does not hold {wanted}")
        numbers_of[name].append(numbers[: FEWEST[name]])
    counts = {name: len(rows) for name, rows in numbers_of.items()}
    if len(set(counts.values())) != 1 or not counts["RAA"]:
        listed = ", ".join(f"{n} {name}" for name, n in counts.items())
        raise InputError(f"{path} is not an MMT pointing run: each star needs RAA, TAA and LST, there are {listed}")
    raw, true = (np.radians(np.array(numbers_of[name])[:, :2]) for name in ("RAA", "TAA"))
    time, remarks = elapsed_seconds(path, np.array(numbers_of["LST"])[:, 0])
    readout = {axis: raw[:, i] for i, axis in enumerate(AXES)}
    where = Site(float(LATITUDE), HEIGHT)
    run = pointing_run(path, KNOWN["alt-az"], where, time, readout, {axis: true[:, i] for i, axis in enumerate(AXES)})
    return replace(run, remarks=remarks)
