"""What is fuzzed: for each target the files that are spoilt, and the command that then reads them."""

import shutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from tests.fuzzing.change import BINARY, JSON, TABLE, TEXT, Rng, Spoil, one_of, spoil_columns, spoil_hdf5, spoil_mat
from tests.fuzzing.plausible import DEEP, MEANT, ROUGH, SAVED, spoil_base

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
    "design": ("--positions", "--step", "--angle-sigma", "--force-sigma", "--terms", "--separate", "--platform",
               "--criterion"),
    "noise": (),
    "budget": ("--hours", "--with", "--states", "--damping"),
    "campaign": ("--runs", "--workers", "--method", "--seed"),
    "diagnose": ("--calibration", "--baseline", "--grade", "--seed", "--unit", "--store"),
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
FOUR = ("device", "hand", "static", "stars")
CSV_HEADER = ("import", "csv", "rig.csv", "--set", "header=header.toml", "--out", "made")
CALIBRATION = ("--calibration", "calibration.json")
MONTHS = tuple(f"month{i}.json" for i in range(1, 5))
CAMPAIGN = ("camp/campaign.json", "camp/campaign.parquet")
READ_BY = (
    CSV_HEADER, ("new", "log.csv", "--out", "made"), ("observe", "schedule.toml"),
    ("import", "phd2", "guide.txt", "--set", "latitude=51", "--out", "made"),
    ("import", "tpoint", "stars.dat", "--out", "made"), ("import", "tpoint", "scope.dat", "--out", "made"),
    ("import", "mikoff", "unit.log", "--out", "made"), ("import", "mmt", "telescope.dat", "--out", "made"),
    ("simulate", "scenario.toml", "--out", "made"), ("export", "psins", *CALIBRATION, "--out", "made"),
    *(("export", "json", "--calibration", f, "--out", "made") for f in ("imu.yaml", "calibration.csv", "model.mod")),
)  # fmt: skip
SAVED_FILES = (*DEVICE, *HAND, "rig.csv", "header.toml", "log.csv", "guide.txt", "stars.dat", "scope.dat", "unit.log",
               "telescope.dat", "schedule.toml", "scenario.toml", "calibration.json", "imu.yaml", "calibration.csv",
               "model.mod")  # fmt: skip

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
                  _one("import", "mat", "rig.mat", "--set", "header=header.toml", "--out", "made"), weight=0.5),
    "npz": Target(("tilt.npz",), {"tilt.npz": BINARY}, _one("import", "tilt-table", "tilt.npz", "--out", "made")),
    "diagnose": Target(DEVICE, {DEVICE[0]: TEXT, DEVICE[1]: TABLE}, _one("diagnose", "device"), weight=0.5),
    "diagnose_hand": Target(HAND, {HAND[0]: TEXT, HAND[1]: TABLE}, _one("diagnose", "hand"), weight=0.3),
    "diagnose_static": Target(STATIC, {STATIC[1]: TABLE}, _one("diagnose", "static"), weight=0.2),
    "rough": Target(
        (*DEVICE, *HAND, *STATIC, *STARS), dict.fromkeys((DEVICE[1], HAND[1], STATIC[1], STARS[1]), ROUGH),
        _any(*(("calibrate", name) for name in (*FOUR, *FOUR)), ("noise", "static"), ("noise", "hand"))),
    "rough_turning": Target(
        (*TURNING, *STATIC, "calibration.json"), {TURNING[1]: ROUGH, STATIC[1]: ROUGH},
        _any(("calibrate", "turning"), ("calibrate", "turning", "--states", "30"), ("navigate", "static", *CALIBRATION),
             ("navigate", "turning", *CALIBRATION)), weight=0.3),
    "rough_diagnose": Target(
        (*DEVICE, *HAND, *STATIC, *STARS), dict.fromkeys((DEVICE[1], HAND[1], STATIC[1], STARS[1]), ROUGH),
        _any(*(("diagnose", name) for name in FOUR)), weight=0.7),
    "meant": Target(DEVICE, {DEVICE[0]: MEANT}, _one("calibrate", "device")),
    "meant_hand": Target(HAND, {HAND[0]: MEANT}, _one("calibrate", "hand")),
    "meant_static": Target(STATIC, {STATIC[0]: MEANT}, _one("calibrate", "static"), weight=0.5),
    "meant_turning": Target(TURNING, {TURNING[0]: MEANT}, _one("calibrate", "turning"), weight=0.2),
    "meant_stars": Target(STARS, {STARS[0]: MEANT}, _one("calibrate", "stars")),
    "meant_files": Target(
        (*DEVICE, "schedule.toml", "scenario.toml", "calibration.json", "mount.json", *STARS, "rig.csv", "header.toml"),
        dict.fromkeys(("schedule.toml", "scenario.toml", "calibration.json", "mount.json", "header.toml"), MEANT),
        _any(("observe", "schedule.toml"), ("simulate", "scenario.toml", "--out", "made"), CSV_HEADER,
             ("apply", "device", *CALIBRATION, "--out", "made"), ("export", "psins", *CALIBRATION, "--out", "made"),
             ("apply", "stars", "--calibration", "mount.json", "--out", "made"),
             ("export", "tpoint", "--calibration", "mount.json", "--out", "made")), weight=4),
    "saved": Target(
        SAVED_FILES, dict.fromkeys(SAVED_FILES, SAVED),
        _any(*READ_BY, ("calibrate", "device"), ("calibrate", "hand")), weight=4),
    "deep": Target(
        SAVED_FILES, dict.fromkeys((f for f in SAVED_FILES if not f.endswith(".csv")), DEEP),
        _any(*READ_BY, ("calibrate", "device")), weight=3),
    "store": Target(("unit.sqlite",), {"unit.sqlite": (spoil_base,)}, _one("compare", "--store", "unit.sqlite"),
                    weight=2),
    "history": Target(
        MONTHS, dict.fromkeys(MONTHS, JSON),
        _any(("compare", *MONTHS), ("compare", *MONTHS[1:], "--allow", "bias=50 ug")), weight=2),
    "mount": Target(
        (*STARS, "mount.json", "az.mod"), {"mount.json": JSON, "az.mod": TEXT},
        _any(("export", "tpoint", "--calibration", "mount.json", "--out", "made"),
             ("apply", "stars", "--calibration", "mount.json", "--out", "made"),
             ("apply", "stars", "--calibration", "az.mod", "--out", "made")), weight=3),
    "law": Target((*DEVICE, "law.py", "calibration.json"), {"law.py": TEXT},
                  _one("apply", "device", *CALIBRATION, "--effects", "law.py", "--out", "made"), weight=2),
    "campaign": Target(
        ("scenario.toml", *CAMPAIGN), {CAMPAIGN[0]: (*JSON, *JSON, *BINARY), CAMPAIGN[1]: BINARY},
        _one("campaign", "scenario.toml", "--runs", "2", "--workers", "1", "--out", "camp"), weight=0.3),
    "logs": Target(("acc.csv", "gyr.csv"), {"acc.csv": TABLE, "gyr.csv": TABLE},
                   _one("new", "acc.csv", "gyr.csv", "--out", "made"), weight=0.5),
    "parts": Target(
        ("part1.csv", "part2.csv", "part3.csv"), {"part1.csv": TABLE, "part2.csv": (*TABLE, *TEXT)},
        _one("new", "part2.csv", "part1.csv", "part3.csv", "--out", "made"), weight=0.5),
    "messages": Target(
        ("span.ASC", "flight.log", "terminal.txt"), {"span.ASC": TEXT, "flight.log": TEXT, "terminal.txt": TEXT},
        _any(*(("new", log, "--out", "made") for log in ("span.ASC", "flight.log", "terminal.txt"))), weight=1),
    "texts": Target(
        ("unit.log", "tk_acc.txt", "tk_gyr.txt", "telescope.dat"),
        {"unit.log": TEXT, "tk_acc.txt": TEXT, "tk_gyr.txt": TEXT, "telescope.dat": TEXT},
        _any(("import", "mikoff", "unit.log", "--out", "made"), ("import", "mmt", "telescope.dat", "--out", "made"),
             ("import", "imu-tk", "tk_acc.txt", "tk_gyr.txt", "--out", "made"),
             ("import", "mmt", "telescope.dat", "--out", "made")), weight=2),
    "navigate": Target((*STATIC, "calibration.json"), {STATIC[1]: TABLE, "calibration.json": JSON},
                       _one("navigate", "static", *CALIBRATION, "--samples", "3"), weight=0.3),
    "noise": Target(STATIC, {STATIC[0]: TEXT, STATIC[1]: TABLE}, _one("noise", "static"), weight=0.5),
    "budget": Target(("scenario.toml",), {"scenario.toml": (*TEXT, *MEANT)}, _one("budget", "scenario.toml"),
                     weight=0.3),
    "planning": Target(
        (*DEVICE, *STATIC, "scenario.toml", "calibration.json"), {},
        _any(("design", "-n", "3"), ("noise", "static"), ("budget", "scenario.toml"), ("observe", "wu2018-18"),
             ("campaign", "scenario.toml", "-n", "1", "--workers", "1", "--out", "made"),
             ("diagnose", "device", "--method"), ("import", "csv"), ("export",)), odd=1.0, weight=1),
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
    named = {word.removeprefix("header=") for word in arguments}
    chosen = [f for f in target.spoils if f in named or f.split("/")[0] in named] or list(target.spoils)
    for _ in range(int(rng.integers(1, 3)) if chosen else 0):
        file = one_of(rng, chosen)
        try:
            one_of(rng, target.spoils[file])(rng, place / file)
        except BaseException:  # noqa: BLE001  what is spoilt may not be read again, and an engine's panic is no Exception
            continue
    if rng.random() < target.odd:
        arguments = _odd(rng, arguments)
    return [*arguments, *([] if arguments[0] == "catalogue" else ["--json"])]


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
