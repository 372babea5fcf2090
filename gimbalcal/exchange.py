r"""Calibrations in other programs' files: Kalibr-style YAML, the `clbt` structure of PSINS, and plain CSV.

Every format has a direction, and each file says its own:

=======  =====================  ====================================================================================
kalibr   physics to reading     a_m = M a + b; w_m = M C_gyro_i w + A a + b (linear; bias in a section of ours)
psins    reading to physics     f = Ka y - db - Ka2 y^2; w = Kg y - eb - gSens y_f
csv      physics to reading     one row per parameter, exactly as in calibration.json, without correlations
=======  =====================  ====================================================================================

`export` returns the sentences on what the format cannot hold; a term that is lost is never lost silently.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from gimbalcal.calibration import Calibration, Residual
from gimbalcal.effects import CATALOGUE, Effect, Parameter, parameters, with_values
from gimbalcal.errors import InputError
from gimbalcal.number import Array
from gimbalcal.units import from_si, to_si

KINDS = ("kalibr", "psins", "csv")
GIMBALS = ("platform", "inner", "middle", "outer")
LINEAR = ("bias", "scale_factor", "misalignment", "gyro_bias", "gyro_scale_factor", "gyro_misalignment",
          "gyro_g_sensitivity_rate")  # fmt: skip
QUADRATIC = ("scale_nonlinearity",)


def export(calibration: Calibration, kind: str, path: Path) -> tuple[str, ...]:
    """Write a calibration as `kind`, whole or not at all; returns what the format could not hold, in sentences."""
    if kind not in KINDS:
        raise InputError(f"no exchange format is called {kind!r}; take one of {', '.join(KINDS)}")
    lost = _lost(calibration, kind)
    content = {"kalibr": _kalibr, "psins": _psins, "csv": _csv}[kind](calibration, lost)
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.name}.part")
    try:
        temporary.write_bytes(content)
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)
    return lost


def read_exchange(kind: str, path: Path) -> Calibration:
    """The calibration in another program's file. Raises InputError, naming file and field, where it cannot be read."""
    if kind not in KINDS:
        raise InputError(f"no exchange format is called {kind!r}; take one of {', '.join(KINDS)}")
    if not path.is_file():
        raise InputError(f"{path} does not exist or is not a file")
    found = {"kalibr": _read_kalibr, "psins": _read_psins, "csv": _read_csv}[kind](path)
    wanted = tuple(found)
    x = np.array([v for v, _ in found.values()])
    sigma = np.array([s for _, s in found.values()])
    return Calibration(
        method=f"imported from {kind}",
        effects=with_values((), wanted, x, GIMBALS),
        parameters=wanted,
        covariance=np.diag(sigma**2),
        unobservable=(),
        residual=Residual(0.0, 0, {}),
        provenance={"recordings": [], "options": {"file": path.name, "format": kind}},
    )


def _lost(calibration: Calibration, kind: str) -> tuple[str, ...]:
    if kind == "csv":
        return ()
    held = LINEAR if kind == "kalibr" else (*LINEAR, *QUADRATIC)
    present = {p.effect for p, v in zip(calibration.parameters, calibration.values, strict=True) if v != 0}
    return tuple(f"{kind} has no term for {e}: it is left out" for e in sorted(present - set(held)))


def _by_effect(effects: Sequence[Effect]) -> dict[str, Array]:
    """Parameter arrays of the effects, zeros where absent."""
    by_id = {e.id: e for e in effects}
    out = {}
    for name in (*LINEAR, *QUADRATIC):
        field = parameters(CATALOGUE[name])[0].field
        size = len(parameters(CATALOGUE[name]))
        out[name] = np.asarray(getattr(by_id[name], field) if name in by_id else np.zeros(size), dtype=float)
    return out


def matrices(effects: Sequence[Effect]) -> dict[str, Array]:
    """Linear model, physics to reading: y = Ma f + ba (+ K (y - ba)^2), w_m = Mg w + A f + bg. SI."""
    v = _by_effect(effects)
    xy, xz, yz, yx, zx, zy = v["misalignment"]
    C = np.array([[1, xz, -xy], [-yz, 1, yx], [zy, -zx, 1]])  # Wu et al. (2018), Eq. (5)
    gxy, gxz, gyz, gyx, gzx, gzy = v["gyro_misalignment"]
    off = np.array([[0, gxy, gxz], [gyx, 0, gyz], [gzx, gzy, 0]])
    return {
        "Ma": C / (1 + v["scale_factor"])[:, None],
        "ba": v["bias"],
        "K": v["scale_nonlinearity"],
        "Mg": np.eye(3) + np.diag(v["gyro_scale_factor"]) + off,
        "bg": v["gyro_bias"],
        "A": v["gyro_g_sensitivity_rate"].reshape(3, 3),
    }


def _values(m: Mapping[str, Array]) -> dict[Parameter, tuple[float, float]]:
    """Parameters of the matrices, the inverse of `matrices`; sigma zero, as these formats state none."""
    Ma, Mg = m["Ma"], m["Mg"]
    s = 1 / np.diag(Ma) - 1
    C = Ma * (1 + s)[:, None]
    arrays: dict[str, ArrayLike] = {
        "scale_factor": s,
        "bias": m["ba"],
        "misalignment": [-C[0, 2], C[0, 1], -C[1, 0], C[1, 2], -C[2, 1], C[2, 0]],
        "scale_nonlinearity": m["K"],
        "gyro_scale_factor": np.diag(Mg) - 1,
        "gyro_bias": m["bg"],
        "gyro_misalignment": [Mg[0, 1], Mg[0, 2], Mg[1, 2], Mg[1, 0], Mg[2, 0], Mg[2, 1]],
        "gyro_g_sensitivity_rate": np.ravel(m["A"]),
    }
    out: dict[Parameter, tuple[float, float]] = {}
    for name, x in arrays.items():
        if np.any(np.asarray(x) != 0):
            out |= {p: (float(v), 0.0) for p, v in zip(parameters(CATALOGUE[name]), np.asarray(x), strict=True)}
    return out


# --- Kalibr ----------------------------------------------------------------------------------------------------


def _kalibr(calibration: Calibration, lost: Sequence[str]) -> bytes:
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


NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")


def _read_kalibr(path: Path) -> dict[Parameter, tuple[float, float]]:
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
    return _values(
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


# --- PSINS ----------------------------------------------------------------------------------------------------


def _psins(calibration: Calibration, lost: Sequence[str]) -> bytes:
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
    return file.getvalue()


def _column(v: Array) -> Array:
    return np.reshape(v, (3, 1))


def _read_psins(path: Path) -> dict[Parameter, tuple[float, float]]:
    from scipy.io import loadmat
    from scipy.io.matlab import MatReadError

    try:
        content = loadmat(path, struct_as_record=False, squeeze_me=True)
    except (ValueError, TypeError, EOFError, OSError, NotImplementedError, MatReadError):
        raise InputError(f"{path} is not a MATLAB file of version 5 to 7, or it is cut short") from None
    if "clbt" not in content:
        names = ", ".join(k for k in content if not k.startswith("__"))
        raise InputError(f"{path} has no structure clbt; it has {names}")
    clbt = content["clbt"]

    def field(name: str, default: Array) -> Array:
        v = np.asarray(getattr(clbt, name, default), dtype=float)
        if v.shape != default.shape:
            raise InputError(f"{path}: clbt.{name} must have shape {default.shape}, got {v.shape}")
        return v

    sf = field("sf", np.ones(6))
    Ka, Kg = field("Ka", np.eye(3)), field("Kg", np.eye(3))
    K = field("Ka2", np.zeros(3)) / np.diag(Ka)
    b = np.linalg.solve(Ka, field("db", np.zeros(3)))
    b = b / (1 + K * b)  # db = Ka (b + K b^2), to first order in K
    Ma = np.linalg.inv(Ka @ np.diag(1 / (1 + 2 * K * b)))
    Mg = np.linalg.inv(Kg)
    A = Mg @ field("gSens", np.zeros((3, 3))) @ Ma
    bg = Mg @ field("eb", np.zeros(3)) + A @ np.linalg.solve(Ma, b)
    return _values({"Ma": Ma / sf[3:, None], "ba": b / sf[3:], "K": K * sf[3:], "Mg": Mg / sf[:3, None],
                    "bg": bg / sf[:3], "A": A / sf[:3, None]})  # fmt: skip


# --- CSV ----------------------------------------------------------------------------------------------------

HEADER = ("name", "axis", "value", "sigma", "unit", "effect")


def _csv(calibration: Calibration, _: Sequence[str]) -> bytes:
    file = io.StringIO()
    file.write("# Direction: physics to reading, as in calibration.json; correlations are not in this file.\n")
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(HEADER)
    for p, v, s in zip(calibration.parameters, calibration.values, calibration.sigmas, strict=True):
        row = (repr(float(from_si(v, p.unit))), repr(float(from_si(s, p.unit))))
        writer.writerow((p.name, p.axis, *row, p.unit, p.effect))
    return file.getvalue().encode()


def _read_csv(path: Path) -> dict[Parameter, tuple[float, float]]:
    known = {(p.name, p.axis): p for cls in CATALOGUE.values() for p in parameters(cls, GIMBALS, constants=True)}
    out: dict[Parameter, tuple[float, float]] = {}
    lines = path.read_text(encoding="utf-8").splitlines()
    start = next((i for i, line in enumerate(lines) if not line.startswith("#")), len(lines))
    rows = csv.DictReader(lines[start:])
    missing = [c for c in ("name", "axis", "value", "unit") if c not in (rows.fieldnames or ())]
    if missing:
        raise InputError(f"{path}, line {start + 1}: the column {missing[0]!r} is missing; write {','.join(HEADER)}")
    for n, row in enumerate(rows, start=start + 2):
        p = known.get((row["name"], row["axis"]))
        if p is None:
            raise InputError(f"{path}, line {n}: no parameter is called {row['name']}:{row['axis']}")
        try:
            value, sigma = (float(to_si(float(x), row["unit"])) for x in (row["value"], row.get("sigma") or "0"))
        except ValueError as problem:
            raise InputError(f"{path}, line {n}: {problem}") from None
        if not (np.isfinite(value) and np.isfinite(sigma)):
            raise InputError(f"{path}, line {n}: {p.label} must be finite, got {row['value']} and {row.get('sigma')}")
        out[p] = (value, sigma)
    return out
