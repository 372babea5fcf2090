"""Kalibr-style IMU YAML, physics to reading: a_m = M a + b; w_m = M C_gyro_i w + A a + b."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from difflib import get_close_matches
from pathlib import Path

import numpy as np

from gimbalcal.calibration import Calibration
from gimbalcal.calibration.matrices import Imported, matrices, parameters_of
from gimbalcal.entries import Json
from gimbalcal.errors import InputError
from gimbalcal.number import Array

KEYS: Mapping[str, tuple[str, ...]] = {
    "accelerometers": ("M", "rx_i", "ry_i", "rz_i"),
    "gyroscopes": ("M", "A", "C_gyro_i"),
    "gimbalcal": ("accelerometer_bias", "gyroscope_bias"),
}


def content(calibration: Calibration, lost: Sequence[str]) -> bytes:
    """Return the YAML file of a calibration; `lost`, in its head, is what the format cannot represent."""
    m = matrices(calibration.effects)
    Q, R = np.linalg.qr(m["Mg"].T)  # Mg = L C_gyro_i, L lower triangular with positive diagonal
    sign = np.sign(np.diag(R))
    L, C = (R * sign[:, None]).T, (Q * sign).T
    lines = [
        "# Direction: physics to reading. a_m = M a + b; w_m = M C_gyro_i w + A a + b. SI and radians.",
        *(f"# {words}" for words in lost),
        "imu0:",
        "  model: scale-misalignment",
        "  accelerometers:",
        *_yaml_matrix("M", m["Ma"]),
        "  gyroscopes:",
        *_yaml_matrix("M", L),
        *_yaml_matrix("A", m["A"]),
        *_yaml_matrix("C_gyro_i", C),
        "  gimbalcal:   # not Kalibr's: its biases are functions of time",
        f"    accelerometer_bias: {_row(m['ba'])}",
        f"    gyroscope_bias: {_row(m['bg'])}",
    ]
    return ("\n".join(lines) + "\n").encode()


def _row(v: Array) -> str:
    return "[" + ", ".join(repr(float(x)) for x in v) + "]"


def _yaml_matrix(name: str, M: Array) -> list[str]:
    return [f"    {name}:", *(f"      - {_row(row)}" for row in M)]


def read(path: Path) -> Imported:
    """Return the value and sigma of each parameter in a YAML file; the places of the accelerometers are `rx_i`, `ry_i`,
    `rz_i`.

    Raises InputError for several units, a matrix of another size, and a key that is none of Kalibr's: the matrix that
    it means would be taken for one that is not there.
    """
    import yaml

    try:
        document = yaml.safe_load(path.read_text(encoding="utf-8-sig", errors="replace"))
    except (yaml.YAMLError, ValueError, RecursionError) as problem:  # integers of thousands of digits
        raise InputError(f"{path} is not YAML: {' '.join(str(problem).split())}") from None
    sections = document.values() if isinstance(document, dict) else ()
    units = [u for u in sections if isinstance(u, dict) and KEYS.keys() & u]
    if not any({"accelerometers", "gyroscopes"} & u.keys() for u in units):
        raise InputError(
            f"{path} has no accelerometers / M and no gyroscopes / M: not a Kalibr scale-misalignment file"
        )
    if len(units) > 1:
        raise InputError(f"{path} holds {len(units)} units; leave one of them in it")
    _refuse_unknown(path, units[0])

    def numbers(section: str, name: str, default: Array) -> Array:
        given = (units[0].get(section) or {}).get(name)
        if given is None:
            return default
        try:
            v = np.array(given, dtype=float)
        except (TypeError, ValueError, OverflowError):
            raise InputError(f"{path}: {section} / {name} must hold numbers alone") from None
        if v.size != default.size or not np.isfinite(v).all():
            size = " x ".join(map(str, default.shape))
            raise InputError(f"{path}: {section} / {name} must hold {size} numbers, got {v.size}")
        return v.reshape(default.shape)

    zero = np.zeros(3)
    return Imported(
        parameters_of(
            {
                "Ma": numbers("accelerometers", "M", np.eye(3)),
                "ba": numbers("gimbalcal", "accelerometer_bias", zero),
                "K": zero,
                "r": np.stack([numbers("accelerometers", f"r{a}_i", zero) for a in "xyz"]),
                "Mg": numbers("gyroscopes", "M", np.eye(3)) @ numbers("gyroscopes", "C_gyro_i", np.eye(3)),
                "bg": numbers("gimbalcal", "gyroscope_bias", zero),
                "A": numbers("gyroscopes", "A", np.zeros((3, 3))),
            }
        )
    )


def _refuse_unknown(path: Path, unit: Json) -> None:
    """Raise InputError for a key in the sections of numbers that Kalibr does not write, and for a section like them."""
    for name in (name for name, value in unit.items() if isinstance(value, dict) and name not in KEYS):
        similar = get_close_matches(str(name), KEYS, 1)
        if similar:
            raise InputError(f"{path} has a section {name!r} that is not known; did you mean {similar[0]}?")
    for section, known in KEYS.items():
        value = unit.get(section) or {}
        if not isinstance(value, dict):
            raise InputError(f"{path}: {section} must hold keys of its own, {', '.join(known)}")
        for name in value.keys() - set(known):
            similar = get_close_matches(str(name), known, 1, cutoff=0.3)
            hint = f"did you mean {similar[0]}?" if similar else f"it may hold {', '.join(known)}"
            raise InputError(f"{path}: {section} has a key {name!r} that is not known; {hint}")
