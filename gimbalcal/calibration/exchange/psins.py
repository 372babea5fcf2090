"""The `clbt` structure of PSINS, reading to physics: f = Ka y - db - Ka2 y^2; w = Kg y - eb - gSens y_f."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from gimbalcal.calibration import Calibration
from gimbalcal.calibration.matrices import Imported, matrices, parameters_of
from gimbalcal.errors import InputError
from gimbalcal.number import Array, holds_real_numbers

HEADING = b"MATLAB 5.0 MAT-file, written by gimbalcal".ljust(116)  # SciPy's has the time: equal content, equal bytes


def content(calibration: Calibration, lost: Sequence[str]) -> bytes:
    """Return the .mat file of a calibration; `lost` is what the format cannot represent."""
    from scipy.io import savemat

    m = matrices(calibration.effects)
    Ka, Kg = np.linalg.inv(m["Ma"]), np.linalg.inv(m["Mg"])
    b, K = m["ba"], m["K"]
    zero = np.zeros((3, 1))
    # y = u + K (y - b)^2 + b solved for u is u = (1 + 2 K b) y - b - K b^2 - K y^2; Ka2 leaves K times E out
    clbt = {
        "sf": np.ones((6, 1)),
        "Kg": Kg,
        "eb": _column(Kg @ (m["bg"] - m["A"] @ Ka @ b)),
        "gSens": Kg @ m["A"] @ Ka,
        "Ka": Ka @ np.diag(1 + 2 * K * b),
        "db": _column(Ka @ (b + K * b**2)),
        "Ka2": _column(np.diag(Ka) * K),
        "rx": zero, "ry": zero, "rz": zero, "tGA": 0.0,
    }  # fmt: skip
    note = "reading to physics: f = Ka y - db - Ka2 y^2, w = Kg y_g - eb - gSens y; SI. " + " ".join(lost)
    file = io.BytesIO()
    savemat(file, {"clbt": clbt, "direction": note})  # type: ignore[arg-type]  # SciPy writes to any binary file
    return HEADING + file.getvalue()[len(HEADING) :]


def _column(v: Array) -> Array:
    return np.reshape(v, (3, 1))


def read(path: Path) -> Imported:
    """Return the value and sigma of each parameter in a .mat file."""
    from gimbalcal.importers.sandboxed_reader import matlab_variables  # with it come all readers of other rigs' files

    variables = matlab_variables(path)
    if not any(name.startswith("clbt.") for name in variables):
        raise InputError(f"{path} has no structure clbt; it has {', '.join(variables) or 'nothing'}")

    def field(name: str, default: Array) -> Array:
        value = variables.get(f"clbt.{name}", default)
        v = np.asarray(value if holds_real_numbers(value) else np.zeros(0), dtype=float)
        if v.shape != default.shape:
            raise InputError(f"{path}: clbt.{name} must have shape {default.shape}, got {v.shape}")
        if not np.isfinite(v).all():
            raise InputError(f"{path}: clbt.{name} must hold finite numbers")
        return v

    sf = field("sf", np.ones(6))
    Ka, Kg = field("Ka", np.eye(3)), field("Kg", np.eye(3))
    try:
        K = field("Ka2", np.zeros(3)) / np.diag(Ka)
        b = np.linalg.solve(Ka, field("db", np.zeros(3)))
        b = b / (1 + K * b)  # db = Ka (b + K b^2), to first order in K
        Ma = np.linalg.inv(Ka @ np.diag(1 / (1 + 2 * K * b)))
        Mg = np.linalg.inv(Kg)
        A = Mg @ field("gSens", np.zeros((3, 3))) @ Ma
        bg = Mg @ field("eb", np.zeros(3)) + A @ np.linalg.solve(Ma, b)
        m = {"Ma": Ma / sf[3:, None], "ba": b / sf[3:], "K": K * sf[3:]}
        return Imported(parameters_of({**m, "Mg": Mg / sf[:3, None], "bg": bg / sf[:3], "A": A / sf[:3, None]}))
    except np.linalg.LinAlgError:
        raise InputError(f"{path}: clbt.Ka and clbt.Kg must be matrices that have an inverse") from None
