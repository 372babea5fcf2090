"""Plain CSV, physics to reading: one row per parameter as in calibration.json, without correlations."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from gimbalcal.calibration import Calibration
from gimbalcal.calibration.calibration import gimbals_of
from gimbalcal.calibration.matrices import Imported, ParameterTable
from gimbalcal.effects import CATALOGUE, parameters
from gimbalcal.errors import InputError
from gimbalcal.units import from_si, parse, to_si

FORMAT = "# Format: 2 (both triads: true = SF x reading)"
GIMBALS = "# Gimbals, platform first: "
HEADER = ("name", "axis", "value", "sigma", "unit", "effect")


def content(calibration: Calibration, _: Sequence[str]) -> bytes:
    """Return the CSV file of a calibration."""
    file = io.StringIO()
    file.write("# Direction: physics to reading, as in calibration.json; correlations are not in this file.\n")
    file.write(f"{FORMAT}\n")
    if calibration.readout.gimbals:
        file.write(f"{GIMBALS}{', '.join(calibration.readout.gimbals)}\n")
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(HEADER)
    for p, v, s in zip(calibration.parameters, calibration.values, calibration.sigmas, strict=True):
        row = (repr(float(from_si(v, p.unit))), repr(float(from_si(s, p.unit))))
        writer.writerow((p.name, p.axis, *row, p.unit, p.effect))
    return file.getvalue().encode()


def read(path: Path) -> Imported:
    """Return the value and sigma of each parameter, and the names of the gimbals that they are counted by."""
    out: ParameterTable = {}
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except UnicodeDecodeError as problem:
        raise InputError(f"{path} is not text in UTF-8 (byte {problem.start}): save it as UTF-8") from None
    gimbal_line = next((line.removeprefix(GIMBALS) for line in lines if line.startswith(GIMBALS)), "")
    start = next((i for i, line in enumerate(lines) if not line.startswith("#")), len(lines))
    rows = csv.DictReader(lines[start:])
    try:
        columns, body = rows.fieldnames or (), list(rows)
    except csv.Error as problem:
        raise InputError(f"{path} is not CSV: {problem}; write lines of {','.join(HEADER)}") from None
    missing = [c for c in ("name", "axis", "value", "unit") if c not in columns]
    if missing:
        raise InputError(f"{path}, line {start + 1}: the column {missing[0]!r} is missing; write {','.join(HEADER)}")
    named = [(row["name"], row["axis"]) for row in body]
    gimbals = tuple(gimbal_line.split(", ")) if gimbal_line else gimbals_of(named)
    known = {(p.name, p.axis): p for cls in CATALOGUE.values() for p in parameters(cls, gimbals, constants=True)}
    for n, row in enumerate(body, start=start + 2):
        short = next((c for c in ("name", "axis", "value", "unit") if row[c] is None), "")
        if short:
            raise InputError(f"{path}, line {n}: the line ends before its {short}; write {','.join(HEADER)}")
        p = known.get((row["name"], row["axis"]))
        if p is None:
            raise InputError(f"{path}, line {n}: no parameter is called {row['name']}:{row['axis']}")
        if None in row:
            raise InputError(f"{path}, line {n}: more values than columns; write {','.join(HEADER)}")
        try:
            value, sigma = (float(to_si(float(x), row["unit"])) for x in (row["value"], row.get("sigma") or "0"))
        except ValueError as problem:
            raise InputError(f"{path}, line {n}: {problem}") from None
        if parse(row["unit"]).dimension != parse(p.unit).dimension:
            raise InputError(f"{path}, line {n}: {row['unit']!r} is no unit of {p.label}; give it in {p.unit}")
        if not (np.isfinite(value) and 0 <= sigma < np.inf):
            raise InputError(
                f"{path}, line {n}: {p.label} must be finite, with a sigma of zero or more, got "
                f"{row['value']} and {row.get('sigma')}"
            )
        if p in out:
            raise InputError(f"{path}, line {n}: {p.label} is there twice; keep one of them")
        out[p] = (value, sigma)
    return Imported(out, gimbals)
