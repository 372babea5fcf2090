r"""Calibrations in other programs' files: Kalibr YAML, the `clbt` structure of PSINS, TPOINT models, and plain CSV.

Every format has a direction, and each file says its own:

=======  =====================  ====================================================================================
kalibr   physics to reading     a_m = M a + b; w_m = M C_gyro_i w + A a + b (linear; bias in a section of ours)
psins    reading to physics     f = Ka y - db - Ka2 y^2; w = Kg y - eb - gSens y_f
csv      physics to reading     one row per parameter, exactly as in calibration.json, without correlations
tpoint   reading to physics     a term of a mount to a line, true minus raw position, with its sigma
json     physics to reading     calibration.json itself
=======  =====================  ====================================================================================

`export` returns sentences on what the format cannot represent, so that no term is lost silently.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from gimbalcal import calibration as own
from gimbalcal.atomic import as_json, write
from gimbalcal.calibration import Calibration, Readout, Residual
from gimbalcal.calibration.content_checks import MAX_NUMBER
from gimbalcal.calibration.exchange import kalibr, parameter_table, psins, tpoint_model
from gimbalcal.calibration.matrices import LINEAR, QUADRATIC
from gimbalcal.calibration.provenance import Options, Provenance
from gimbalcal.effects import with_values
from gimbalcal.errors import InputError

FORMATS: Mapping[str, Any] = {"kalibr": kalibr, "psins": psins, "csv": parameter_table, "tpoint": tpoint_model}
FILES = {"kalibr": "imu.yaml", "psins": "clbt.mat", "csv": "calibration.csv", "tpoint": "tpoint.mod",
         "json": "calibration.json"}  # fmt: skip
DIRECTION = dict.fromkeys(FILES, "physics to readings") | dict.fromkeys(("psins", "tpoint"), "readings to physics")
ENDINGS = {".yaml": "kalibr", ".yml": "kalibr", ".mat": "psins", ".csv": "csv", ".mod": "tpoint"}


def export(calibration: Calibration, kind: str, path: Path) -> tuple[str, ...]:
    """Write a calibration as `kind`, whole or not at all; returns what the format could not hold, in sentences."""
    lost = _lost(calibration, _known(kind))
    own_format = as_json(calibration.to_dict(), indent=1).encode() if kind == "json" else None
    write(path, FORMATS[kind].content(calibration, lost) if own_format is None else own_format)
    return lost


def read_calibration(path: Path) -> Calibration:
    """Return the calibration in a file, whose ending gives its format: ours (.json) or another program's."""
    kind = ENDINGS.get(path.suffix.lower())
    return own.read(path) if kind is None else read_exchange(kind, path)


def read_exchange(kind: str, path: Path) -> Calibration:
    """Return the calibration in another program's file. Raises InputError, which names file and field."""
    if _known(kind) == "json":
        return own.read(path)
    if not path.is_file():
        raise InputError(f"{path} does not exist or is not a file")
    mount = None
    if kind == "tpoint":
        estimates, mount = tpoint_model.read(path)
        gimbals = mount.axes
    else:
        estimates, gimbals = parameter_table.read(path) if kind == "csv" else (FORMATS[kind].read(path), ())
    for p, (value, s) in estimates.items():
        if not (abs(value) < MAX_NUMBER and s < MAX_NUMBER):
            raise InputError(f"{path}: {p.label} is beyond anything that can be measured; correct it")
    wanted = tuple(estimates)
    x = np.array([v for v, _ in estimates.values()])
    sigma = np.array([s for _, s in estimates.values()])
    return Calibration(
        method=f"imported from {kind}",
        effects=with_values((), wanted, x, gimbals),
        parameters=wanted,
        covariance=np.diag(sigma**2),
        unobservable=(),
        residual=Residual(0.0, 0, {}),
        provenance=Provenance(options=Options(file=path.name, format=kind), mount=mount),
        readout=Readout(gimbals=gimbals),
    )


def _known(kind: str) -> str:
    if kind not in FILES:
        raise InputError(f"no exchange format is called {kind!r}; take one of {', '.join(FILES)}")
    return kind


def _lost(calibration: Calibration, kind: str) -> tuple[str, ...]:
    if kind == "json":
        return ()
    present = {p.effect for p, v in zip(calibration.parameters, calibration.values, strict=True) if v != 0}
    representable = {"kalibr": set(LINEAR), "psins": {*LINEAR, *QUADRATIC}}.get(kind, present)
    unnamed = tpoint_model.unnamed(calibration) if kind == "tpoint" else sorted(present - representable)
    lost = [f"{kind} has no term for {e}: it is omitted" for e in unnamed]
    if np.count_nonzero(calibration.covariance - np.diag(np.diag(calibration.covariance))):
        lost.append(f"{kind} has no place for correlations: calibration.json has them")
    if calibration.readout.counts:
        lost.append(f"{kind} has no place for the nominal scale of counts: its numbers hold after that scale")
    return tuple(lost)
