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

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from gimbalcal import calibration as own
from gimbalcal.atomic import as_json, write
from gimbalcal.calibration import Calibration, Readout, Residual
from gimbalcal.calibration.content_checks import MAX_NUMBER
from gimbalcal.calibration.exchange import kalibr, parameter_table, psins, tpoint_model
from gimbalcal.calibration.matrices import LINEAR, QUADRATIC, Imported
from gimbalcal.calibration.provenance import Options, Provenance
from gimbalcal.effects import with_values
from gimbalcal.errors import InputError

TO_READINGS, TO_PHYSICS = "physics to readings", "readings to physics"


class Format(NamedTuple):
    """A kind of file: its usual name, its direction, how it is written and read, and what it has no term for.

    read: of another program's file; None for calibration.json, which alone holds correlations and the readout.
    """

    file: str
    direction: str
    content: Callable[[Calibration, Sequence[str]], bytes]
    read: Callable[[Path], Imported] | None
    omitted: Callable[[Calibration], Sequence[str]] = lambda _: ()


def _terms_beyond_format(terms: Sequence[str], calibration: Calibration) -> list[str]:
    return sorted({p.effect for p, v in zip(calibration.parameters, calibration.values, strict=True) if v} - {*terms})


FORMATS: Mapping[str, Format] = {
    "kalibr": Format("imu.yaml", TO_READINGS, kalibr.content, kalibr.read, partial(_terms_beyond_format, LINEAR)),
    "psins": Format(
        "clbt.mat", TO_PHYSICS, psins.content, psins.read, partial(_terms_beyond_format, LINEAR + QUADRATIC)
    ),
    "csv": Format("calibration.csv", TO_READINGS, parameter_table.content, parameter_table.read),
    "tpoint": Format(
        "tpoint.mod", TO_PHYSICS, tpoint_model.content, tpoint_model.read, tpoint_model.parameters_without_term
    ),
    "json": Format("calibration.json", TO_READINGS, lambda c, _: as_json(c.to_dict(), indent=1).encode(), None),
}
ENDINGS = {".yaml": "kalibr", ".yml": "kalibr", ".mat": "psins", ".csv": "csv", ".mod": "tpoint"}


def export(calibration: Calibration, kind: str, path: Path) -> tuple[str, ...]:
    """Write a calibration as `kind`, whole or not at all; returns what the format could not hold, in sentences."""
    form = format_of(kind)
    lost = _lost_content(calibration, kind, form.omitted(calibration)) if form.read else ()
    write(path, form.content(calibration, lost))
    return lost


def read_calibration(path: Path) -> Calibration:
    """Return the calibration in a file, whose ending gives its format: ours (.json) or another program's."""
    return read_exchange(ENDINGS.get(path.suffix.lower(), "json"), path)


def read_exchange(kind: str, path: Path) -> Calibration:
    """Return the calibration in another program's file. Raises InputError, which names file and field."""
    read = format_of(kind).read
    if read is None:
        return own.read(path)
    if not path.is_file():
        raise InputError(f"{path} does not exist or is not a file")
    estimates, gimbals, mount = read(path)
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


def format_of(kind: str) -> Format:
    """Return the format of a name; InputError for one that is unknown."""
    if kind not in FORMATS:
        raise InputError(f"no exchange format is called {kind!r}; take one of {', '.join(FORMATS)}")
    return FORMATS[kind]


def _lost_content(calibration: Calibration, kind: str, omitted: Sequence[str]) -> tuple[str, ...]:
    lost = [f"{kind} has no term for {e}: it is omitted" for e in omitted]
    if np.count_nonzero(calibration.covariance - np.diag(np.diag(calibration.covariance))):
        lost.append(f"{kind} has no place for correlations: calibration.json has them")
    if calibration.readout.counts:
        lost.append(f"{kind} has no place for the nominal scale of counts: its numbers hold after that scale")
    return tuple(lost)
