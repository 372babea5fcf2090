"""Kalibr-style IMU YAML, physics to reading: a_m = M a + b; w_m = M C_gyro_i w + A a + b."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from gimbalcal.calibration import Calibration
from gimbalcal.calibration.exchange.matrices import Found, matrices, parameters_of
from gimbalcal.errors import InputError
from gimbalcal.number import Array

NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")


def content(calibration: Calibration, lost: Sequence[str]) -> bytes:
    """The YAML file of a calibration; `lost` says in its head what the format cannot hold."""
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


def read(path: Path) -> Found:
    """Value and sigma of each parameter in a YAML file."""
    sections = _numbers_by_key(path.read_text(encoding="utf-8"))

    def matrix(name: str, default: Array) -> Array:
        numbers = sections.get(name)
        if numbers is None:
            return default
        if len(numbers) != 9:
            raise InputError(f"{path}: {name.replace('.', ' / ')} must hold 3 x 3 numbers, got {len(numbers)}")
        return np.reshape(numbers, (3, 3))

    if "accelerometers.M" not in sections and "gyroscopes.M" not in sections:
        raise InputError(
            f"{path} has no accelerometers / M and no gyroscopes / M: not a Kalibr scale-misalignment file"
        )
    return parameters_of(
        {
            "Ma": matrix("accelerometers.M", np.eye(3)),
            "ba": np.array(sections.get("gimbalcal.accelerometer_bias", [0.0] * 3)),
            "K": np.zeros(3),
            "Mg": matrix("gyroscopes.M", np.eye(3)) @ matrix("gyroscopes.C_gyro_i", np.eye(3)),
            "bg": np.array(sections.get("gimbalcal.gyroscope_bias", [0.0] * 3)),
            "A": matrix("gyroscopes.A", np.zeros((3, 3))),
        }
    )


def _numbers_by_key(text: str) -> dict[str, list[float]]:
    """Numbers under "section.key" of a YAML of nested keys and number lists, in block or flow style."""
    out: dict[str, list[float]] = {}
    section = key = ""
    for raw in text.splitlines():
        line = raw.split("#")[0].rstrip()
        found = re.match(r"(\s*)([A-Za-z_][\w]*):(.*)$", line)
        if found:
            name, rest = found[2], found[3]
            if not rest.strip() and len(found[1]) <= 2:
                section, key = name, ""
                continue
            key, line = name, rest
        if key:
            out.setdefault(f"{section}.{key}", []).extend(float(x) for x in NUMBER.findall(line))
    return out
