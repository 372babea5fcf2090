"""What is fuzzed: for each target the files that are spoilt, and the command that then reads them."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from tests.fuzzing.change import BINARY, JSON, TABLE, TEXT, Rng, Spoil, one_of, spoil_columns, spoil_hdf5, spoil_mat

ODD_ARGUMENTS = ("", "-1", "0", "nan", "inf", "1e400", "x", "9" * 30, "../..", "/dev/null", "bias", "bias:x", "bias:w",
                 "warm_up,tau=nan", "warm_up,tau=-1", "51", "tcp://nowhere", "~", "*", "a\x01b", "K3", "--help", "30",
                 "cubic_nonlinearity", "gimbal_zero:inner", "bias,bias", ",", ":", "=", "--json", "é",
                 "1,2")  # fmt: skip
OPTIONS: Mapping[str, tuple[str, ...]] = {
    "calibrate": ("--method", "--terms", "--with", "--states", "--grade", "--unit"),
    "observe": ("--angle-sigma", "--force-sigma", "--latitude", "--candidates", "--states", "--rate-noise",
                "--force-noise", "--velocity-sigma"),
    "import": ("--set", "--set"),
    "new": ("--rate", "--title"),
    "navigate": ("--damping", "--samples", "--seed"),
    "catalogue": ("--search",),
    "compare": ("--unit", "--allow"),
    "simulate": ("--seed",),
    "apply": ("--inverse",),
    "export": (),
}  # fmt: skip
METHODS = ("three-stage", "multiposition", "systematic", "attitude", "two-position")


@dataclass(frozen=True)
class Target:
    """Files or folders of the seeds that are taken, those spoilt and how, and the arguments after them."""

    takes: tuple[str, ...]
    spoils: Mapping[str, tuple[Spoil, ...]]
    command: Callable[[Rng], list[str]]
    odd: float = 0.0  # how often an argument is odd too
    weight: float = 1.0  # how often it is drawn


def _one(*arguments: str) -> Callable[[Rng], list[str]]:
    return lambda _rng: list(arguments)


def _any(*commands: tuple[str, ...]) -> Callable[[Rng], list[str]]:
    return lambda rng: list(one_of(rng, commands))


def _recording(name: str, samples: str = "samples.csv") -> tuple[str, ...]:
    return (f"{name}/recording.toml", f"{name}/{samples}")


DEVICE, PARQUET = _recording("device"), _recording("device_parquet", "samples.parquet")
STATIC, HAND, TURNING, STARS = (_recording(n) for n in ("static", "hand", "turning", "stars"))
CSV_HEADER = ("import", "csv", "rig.csv", "--set", "header=header.toml", "--out", "made")
CALIBRATION = ("--calibration", "calibration.json")

TARGETS: Mapping[str, Target] = {
    "csv": Target(DEVICE, {DEVICE[1]: TABLE}, _one("calibrate", "device"), weight=4),
    "header": Target(DEVICE, {DEVICE[0]: TEXT}, _one("calibrate", "device"), weight=4),
    "hand": Target(HAND, {HAND[0]: TEXT, HAND[1]: TABLE}, _one("calibrate", "hand"), weight=3),
    "static": Target(STATIC, {STATIC[0]: TEXT, STATIC[1]: TABLE}, _one("calibrate", "static"), weight=2),
    "parquet": Target(PARQUET, {PARQUET[1]: (*BINARY, spoil_columns)}, _one("calibrate", "device_parquet"), weight=2),
    "turning": Target(TURNING, {TURNING[0]: TEXT, TURNING[1]: TABLE}, _one("calibrate", "turning"), weight=0.7),
    "stars": Target(STARS, {STARS[0]: TEXT, STARS[1]: TABLE}, _any(("calibrate", "stars"), ("diagnose", "stars"))),
    "calibration": Target(
        (*DEVICE, "calibration.json"), {"calibration.json": JSON},
        _any(("apply", "device", *CALIBRATION, "--out", "made"), ("export", "kalibr", *CALIBRATION, "--out", "made"),
             ("compare", "calibration.json", "calibration.json"), ("export", "psins", *CALIBRATION, "--out", "made"),
             ("apply", "device", *CALIBRATION, "--inverse", "--out", "made")), weight=4),
    "exchange": Target(
        ("imu.yaml", "clbt.mat", "calibration.csv", "model.mod"),
        {"imu.yaml": TEXT, "clbt.mat": BINARY, "calibration.csv": TABLE, "model.mod": TEXT},
        _any(*(("export", "json", "--calibration", f, "--out", "made")
               for f in ("imu.yaml", "clbt.mat", "calibration.csv", "model.mod"))), weight=3),
    "schedule": Target(("schedule.toml",), {"schedule.toml": TEXT}, _one("observe", "schedule.toml"), weight=2),
    "turns": Target(("turns.toml",), {"turns.toml": TEXT}, _one("observe", "turns.toml", "--states", "30"), weight=0.2),
    "scenario": Target(("scenario.toml",), {"scenario.toml": TEXT}, _one("simulate", "scenario.toml", "--out", "made"),
                       weight=2),
    "tpoint": Target(("stars.dat", "scope.dat"), {"stars.dat": TEXT, "scope.dat": TEXT},
                     _any(("import", "tpoint", "stars.dat", "--out", "made"),
                          ("import", "tpoint", "scope.dat", "--out", "made")), weight=4),
    "phd2": Target(("guide.txt",), {"guide.txt": TEXT},
                   _one("import", "phd2", "guide.txt", "--set", "latitude=51", "--out", "made"), weight=2),
    "log": Target(("log.csv",), {"log.csv": TABLE}, _one("new", "log.csv", "--out", "made"), weight=1),
    "rig_csv": Target(("rig.csv", "header.toml"), {"rig.csv": TABLE, "header.toml": TEXT}, _one(*CSV_HEADER), weight=3),
    "hdf5": Target(("rig.h5", "header.toml"), {"rig.h5": (spoil_hdf5, spoil_hdf5, *BINARY)},
                   _one("import", "hdf5", "rig.h5", "--set", "header=header.toml", "--out", "made"), weight=3),
    "mat": Target(("rig.mat", "header.toml"), {"rig.mat": (spoil_mat, *BINARY)},
                  _one("import", "mat", "rig.mat", "--set", "header=header.toml", "--out", "made"), weight=3),
    "npz": Target(("tilt.npz",), {"tilt.npz": BINARY}, _one("import", "tilt-table", "tilt.npz", "--out", "made")),
    "diagnose": Target(DEVICE, {DEVICE[0]: TEXT, DEVICE[1]: TABLE}, _one("diagnose", "device"), weight=0.5),
    "diagnose_hand": Target(HAND, {HAND[0]: TEXT, HAND[1]: TABLE}, _one("diagnose", "hand"), weight=0.3),
    "diagnose_static": Target(STATIC, {STATIC[1]: TABLE}, _one("diagnose", "static"), weight=0.2),
    "arguments": Target(
        (*DEVICE, *STATIC, *HAND, *STARS, "calibration.json", "scenario.toml", "schedule.toml", "log.csv", "stars.dat"),
        {},
        _any(("calibrate", "device"), ("calibrate", "device", "static"), ("calibrate", "hand"), ("calibrate", "stars"),
             ("observe", "schedule.toml"), ("observe", "static-48h"), ("apply", "device", *CALIBRATION),
             ("export", "csv", *CALIBRATION), ("import", "tpoint", "stars.dat"), ("new", "log.csv"), ("catalogue",),
             ("navigate", "static", *CALIBRATION), ("compare", "calibration.json"), ("simulate", "scenario.toml")),
        odd=1.0, weight=3),
}  # fmt: skip


def prepare(name: str, seeds: Path, place: Path, rng: Rng) -> list[str]:
    """The spoilt input of one target in `place`; returns the arguments of the command."""
    target = TARGETS[name]
    for file in target.takes:
        (place / file).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(seeds / file, place / file)
    arguments = target.command(rng)
    chosen = [f for f in target.spoils if f in arguments] or list(target.spoils)
    for _ in range(int(rng.integers(1, 3)) if chosen else 0):
        file = one_of(rng, chosen)
        try:
            one_of(rng, target.spoils[file])(rng, place / file)
        except Exception:  # noqa: BLE001  what is spoilt already may not be read again by the one that spoils
            continue
    if rng.random() < target.odd:
        arguments = _odd(rng, arguments)
    return [*arguments, *([] if arguments[0] == "catalogue" else ["--json", "--quiet"])]


def _odd(rng: Rng, arguments: list[str]) -> list[str]:
    options = OPTIONS.get(arguments[0], ())
    for _ in range(int(rng.integers(1, 4))):
        way = int(rng.integers(4))
        if way < 2 and options:
            option = one_of(rng, options)
            value = one_of(rng, METHODS) if option == "--method" else one_of(rng, ODD_ARGUMENTS)
            arguments = [*arguments, option, str(value)]
        elif way == 2:
            at = int(rng.integers(1, len(arguments) + 1))
            arguments = [*arguments[:at], str(one_of(rng, ODD_ARGUMENTS)), *arguments[at:]]
        elif len(arguments) > 1:
            at = int(rng.integers(1, len(arguments)))
            arguments = [*arguments[:at], *arguments[at + 1 :]]
    return arguments
