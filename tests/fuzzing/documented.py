"""A second fuzzer, written from README, docs and the contract of files alone; it shares no seeds with the first.

    python -m tests.fuzzing.documented --n 20000 --seed 3      many inputs
    python -m tests.fuzzing.documented --seed 3 --only 123     one of them again, with what came of it

A plant of its own (gravity through a chain of gimbals, stars on a mount) makes recordings with every documented kind of
file. Each input takes a command with documented options and one of

* a *rewriting* that changes nothing (units with their numbers, order of columns, CSV or Parquet, signs, comments): the
  parameters must be those of the recording as it was;
* a *damage* of a header, a row, a column, a result or an option: refused by one sentence without a word of Python and
  with nothing written, or answered. An answer that is green must have parameters within 5 sigma of the reference.

Wrong is also exit 3, a warning, a panic, a hang of 20 s, more than 2 GB, or NaN in a result.
"""

import argparse
import copy
import json
import os
import re
import resource
import shutil
import signal
import sys
import tempfile
import time
import tomllib
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import click
import h5py
import numpy as np
import polars as pl
import scipy.io

from gimbalcal.cli import gimbalcal
from gimbalcal.effects import CATALOGUE, loading
from tests.fuzzing.change import Rng, one_of
from tests.fuzzing.worker import _called, _judged

HANG_S, MEMORY_MB, SIGMAS = 20, 2000, 5.0
PYTHON = re.compile(
    r"\b\w*(Error|Exception|Warning)\b|NoneType|object is not|unhashable|codec can't|\bdict\b|Input should"
)
G = 9.80146
GIMBALS = ("platform", "inner", "middle")
ODD = (
    None,
    True,
    -1,
    0,
    3,
    1e300,
    2**70,
    "",
    "x",
    "é\u202e",
    "\x1b[31m",
    [],
    [1],
    ["x"],
    {},
    {"a": 1},
    "9" * 50,
    "nan",
)


def turn(axis: str, a: np.ndarray) -> np.ndarray:
    """Frame rotation about an axis (n, 3, 3)."""
    i, (c, s), one = "xyz".index(axis), (np.cos(a), np.sin(a)), np.ones_like(a)
    j, k = (i + 1) % 3, (i + 2) % 3
    R = np.zeros((len(a), 3, 3))
    R[:, i, i], R[:, j, j], R[:, k, k], R[:, j, k], R[:, k, j] = one, c, c, s, -s
    return R


# --- what a laboratory has ----------------------------------------------------------------------------------------


def rig(rng: Rng) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """A space-stable platform in 18 positions: g^p = Rz(platform) Rx(inner) Ry(middle) (0, 0, g), force = -g."""
    degrees = [
        (p, i, m) for p in (0.0, 45.0, 90.0) for i, m in ((0, 0), (90, 0), (0, 90), (180, 45), (-90, 45), (45, -90))
    ]
    angles = np.radians(np.repeat(np.array(degrees), 6, axis=0))
    C = turn("z", angles[:, 0]) @ turn("x", angles[:, 1]) @ turn("y", angles[:, 2])
    force = -C @ np.array([0.0, 0.0, G])
    read = force * (1 + np.array([2e-4, -1e-4, 3e-4])) + np.array([1e-3, -2e-3, 5e-4])
    read += 1e-4 * rng.standard_normal(read.shape)
    header = {"format": 1, "kind": "multi-position", "title": "rig", "samples": "samples.csv",
              "site": {"latitude": number(40.0, "deg"), "gravity": number(G, "m/s^2")},
              "platform": {"name": "space-stable"},
              "noise": {"accelerometer": number(1e-4, "m/s^2"), "gimbal_angle": number(1.0, "arcsec")},
              "columns": columns(time_s=("time", "", "s"), position=("position", "", ""),
                                 **{f"a{x}": ("specific_force", x, "m/s^2") for x in "xyz"},
                                 **{n: ("gimbal_angle", n, "deg") for n in GIMBALS})}  # fmt: skip
    rows = {"time_s": 10.0 * np.arange(len(read)), "position": np.repeat(np.arange(1.0, 19.0), 6)}
    rows |= {f"a{x}": read[:, i] for i, x in enumerate("xyz")}
    return header, rows | {n: np.degrees(angles[:, i]) for i, n in enumerate(GIMBALS)}


def hand(rng: Rng) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """A unit laid down in 24 attitudes; no angles."""
    down = rng.standard_normal((24, 3))
    down /= np.linalg.norm(down, axis=1)[:, None]
    force = np.repeat(-G * down, 12, axis=0) * 1.001 + 0.02 + 5e-3 * rng.standard_normal((288, 3))
    header = {"format": 1, "kind": "multi-position", "title": "hand", "samples": "samples.csv",
              "site": {"gravity": number(G, "m/s^2")}, "platform": {"name": "bench"},
              "columns": columns(time_s=("time", "", "s"), position=("position", "", ""),
                                 **{f"a{x}": ("specific_force", x, "m/s^2") for x in "xyz"})}  # fmt: skip
    rows = {"time_s": 1.0 * np.arange(288), "position": np.repeat(np.arange(1.0, 25.0), 12)}
    return header, rows | {f"a{x}": force[:, i] for i, x in enumerate("xyz")}


def stars(rng: Rng) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """An alt-azimuth mount with an encoder zero and a collimation."""
    el, az = np.degrees(rng.uniform(0.4, 1.2, 40)), np.degrees(rng.uniform(-3, 3, 40))
    noise = 0.002 * rng.standard_normal((2, 40))
    header = {"format": 1, "kind": "pointing", "title": "stars", "samples": "samples.csv",
              "site": {"latitude": number(40.0, "deg")}, "platform": {"name": "alt-az"},
              "columns": columns(time_s=("time", "", "s"),
                                 **{f"{q[0]}_{x}": (q, x, "deg") for q in ("gimbal_angle", "true_angle")
                                    for x in ("elevation", "azimuth")})}  # fmt: skip
    true = {"t_elevation": el + 0.05 + noise[0], "t_azimuth": az + 0.1 + 0.02 / np.cos(np.radians(el)) + noise[1]}
    return header, {"time_s": 60.0 * np.arange(40), "g_elevation": el, "g_azimuth": az} | true


PLANTS: dict[str, Callable[[Rng], tuple[dict[str, Any], dict[str, np.ndarray]]]] = {
    "rig": rig, "hand": hand, "stars": stars,
}  # fmt: skip


def number(value: float, unit: str) -> dict[str, Any]:
    """A number with its unit."""
    return {"value": value, "unit": unit}


def columns(**named: tuple[str, str, str]) -> dict[str, Any]:
    """[columns], of (quantity, axis, unit)."""
    return {
        name: {k: v for k, v in zip(("quantity", "axis", "unit"), each, strict=True) if v}
        for name, each in named.items()
    }


def toml(value: Any) -> str:
    """A value of TOML; JSON is one but for tables and null."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{json.dumps(k)} = {toml(v)}" for k, v in value.items()) + " }"
    if isinstance(value, list):
        return f"[{', '.join(map(toml, value))}]"
    return "nan" if value is None else json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


def save(folder: Path, header: dict[str, Any], rows: dict[str, np.ndarray]) -> None:
    """A recording folder."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "recording.toml").write_text("".join(f"{json.dumps(k)} = {toml(v)}\n" for k, v in header.items()))
    frame = pl.DataFrame({name: pl.Series(x) for name, x in rows.items()})
    if str(header["samples"]).endswith(".parquet"):
        frame.write_parquet(folder / "samples.parquet")
    else:
        frame.write_csv(folder / "samples.csv")


def laboratory(folder: Path) -> dict[str, dict[str, tuple[float, float]]]:
    """Every seed into `folder`; returns the reference parameters, value and sigma, of each recording."""
    rng, reference = np.random.default_rng(8), {}
    for name, plant in PLANTS.items():
        save(folder / name, *plant(rng))
    for name in PLANTS:
        reference[name] = run(["calibrate", name, "--json", "--out", f"{name}-calibration"], folder)[2]
        shutil.copy(folder / f"{name}-calibration" / "calibration.json", folder / f"{name}.json")
    _, rows = rig(rng)
    table = np.column_stack([rows[k] for k in ("time_s", "ax", "ay", "az")])
    (folder / "log.csv").write_text("time [s],ax [m/s^2],ay [m/s^2],az [m/s^2]\n" + lines(table, ","))
    named = {"time [s]": ("time", "", "s"), **{f"a{x} [m/s^2]": ("specific_force", x, "m/s^2") for x in "xyz"}}
    described = "".join(f"{json.dumps(n)} = {toml(v)}\n" for n, v in columns(**named).items())
    plain = 'format = 1\nkind = "multi-position"\n[platform]\nname = "bench"\n[columns]\n'
    (folder / "header.toml").write_text(plain + described)
    still = np.repeat(table[::6, 1:], 120, axis=0) + 1e-3 * rng.standard_normal((18 * 120, 3))
    (folder / "unit.log").write_text(lines(np.column_stack([still, 1e-4 * rng.standard_normal(still.shape)]), " "))
    for name, x in (("acc.txt", still), ("gyr.txt", 1e-4 * rng.standard_normal(still.shape))):
        (folder / name).write_text(lines(np.column_stack([0.01 * np.arange(len(x)), x]), " "))
    _, sky = stars(rng)
    sighted = np.column_stack([sky[k] % 360 for k in ("t_azimuth", "t_elevation", "g_azimuth", "g_elevation")])
    (folder / "stars.dat").write_text(f"stars\n:ALTAZ\n35 0 0 2024 1 1 10 900 1000\n{lines(sighted, ' ')}END\n")
    with h5py.File(folder / "rig.h5", "w") as file:
        file["time [s]"], file["a"] = table[:, 0], table[:, 1:]
    scipy.io.savemat(folder / "rig.mat", {"t": table[:, 0], "a": table[:, 1:]})
    scenario = {"format": 1, "kind": "multi-position", "seed": 3, "site": {"latitude": number(40.0, "deg")},
                "schedule": {"name": "wu2018-18", "dwell": number(10.0, "min"), "rate": number(0.01, "Hz")},
                "noise": {"accelerometer": number(10.0, "ug"), "gimbal_angle": number(1.0, "arcsec")},
                "truth": {"bias": {"x": 150.0}}}  # fmt: skip
    (folder / "scenario.toml").write_text("".join(f"{k} = {toml(v)}\n" for k, v in scenario.items()))
    holds = [{"inner": 90.0 * k, "middle": 45.0 * j} for k in range(4) for j in range(3)]
    plan = toml({"dwell": number(60.0, "s"), "holds": holds})
    (folder / "schedule.toml").write_text(f'format = 1\nplatform = {{ name = "space-stable" }}\nschedule = {plan}\n')
    return {name: {f"{p['name']}:{p['axis']}": (p["value"], p["sigma"]) for p in found["parameters"]}
            for name, found in reference.items()}  # fmt: skip


def lines(table: np.ndarray, mark: str) -> str:
    """Rows of text."""
    return "".join(mark.join(f"{x:.8g}" for x in row) + "\n" for row in table)


# --- what is done to it -------------------------------------------------------------------------------------------


def rewrite(rng: Rng, header: dict[str, Any], rows: dict[str, np.ndarray]) -> None:
    """Another way to write the same recording."""
    for _ in range(int(rng.integers(1, 4))):
        name = one_of(rng, [n for n in header["columns"] if n in rows])
        column = header["columns"][name]
        way = int(rng.integers(7))
        if way == 0 and column["quantity"] == "specific_force" and column["unit"] == "m/s^2":
            unit, size = one_of(rng, (("g", 9.80665), ("mg", 9.80665e-3), ("Gal", 1e-2)))
            for n, c in header["columns"].items():
                if c["quantity"] == "specific_force" and c["unit"] == "m/s^2":
                    rows[n], c["unit"] = rows[n] / size, unit
        elif way == 1 and column["quantity"] == "time" and column["unit"] == "s":
            unit, size = one_of(rng, (("ms", 1e-3), ("min", 60.0), ("h", 3600.0)))
            rows[name], column["unit"] = rows[name] / size, unit
        elif way == 2 and column.get("unit") == "deg":
            unit, size = one_of(rng, (("rad", np.pi / 180), ("arcmin", 60.0), ("mrad", np.pi / 0.18), ("rev", 1 / 360)))
            rows[name], column["unit"] = rows[name] * size, unit
        elif way == 3 and column["quantity"] in ("specific_force", "gimbal_angle") and "sign" not in column:
            rows[name], column["sign"] = -rows[name], -1
        elif way == 4:
            order = [str(n) for n in rng.permutation(list(rows))]
            entries = {n: rows.pop(n) for n in order}
            rows.update(entries)
        elif way == 5:
            header["samples"] = one_of(rng, ("samples.csv", "samples.parquet"))
        else:
            header["title"] = one_of(rng, ("é µ °", "a" * 300, "[x] {y} = `z`", "tab\there"))


def damage_rows(rng: Rng, header: dict[str, Any], rows: dict[str, np.ndarray]) -> None:
    """One mistake in columns or rows that the data can show."""
    force = [n for n, c in header["columns"].items() if c["quantity"] == "specific_force"]
    name, i = one_of(rng, list(rows)), int(rng.integers(len(rows["time_s"])))
    way = int(rng.integers(9))
    if way == 0:  # another unit
        other = one_of(rng, ("m/s^2", "g", "mg", "deg", "rad", "arcsec", "s", "h", "count", "ug", "V", ""))
        header["columns"][name]["unit"] = other
    elif way == 1 and force:  # a channel in another unit than its column says
        rows[one_of(rng, force)] *= one_of(rng, (1 / 9.80665, 1000 / 9.80665, 100.0))
    elif way == 2:  # a channel that stands still
        rows[name] = np.full(len(rows[name]), rows[name][i])
    elif way == 3:  # single values
        rows[name] = rows[name].copy()
        rows[name][i] = one_of(rng, (np.nan, np.inf, 1e300, -1e9, 0.0, 1e16, -rows[name][i]))
    elif way == 4:  # rows left out, doubled, or in disorder
        keep = np.arange(len(rows[name]))
        keep = one_of(rng, (np.delete(keep, i), keep[: max(i, 1)], np.insert(keep, i, i), keep[::-1]))
        for n in rows:
            rows[n] = rows[n][keep]
    elif way == 5:  # a column that is not there
        rows.pop(name)
    elif way == 6 and len(force) > 2 and "inner" in rows:  # exchanged accelerometers, against the gimbals
        rows["ax"], rows["ay"] = rows["ay"], rows["ax"]
    elif way == 7 and "inner" in rows:  # degrees that are said to be something else, a gimbal of the other sense
        rows["inner"] = rows["inner"] * one_of(rng, (-1.0, np.pi / 180, 60.0))
    else:
        header["columns"][name]["quantity"] = one_of(rng, ("time", "specific_force", "gimbal_angle", "covariate", "x"))


def damage_tree(rng: Rng, content: Any) -> None:
    """One value of nested tables and lists is of another type, gone, doubled, or new."""
    places: list[tuple[Any, Any]] = []

    def walk(node: Any) -> None:
        for key, value in node.items() if isinstance(node, dict) else enumerate(node):
            places.append((node, key))
            if isinstance(value, (dict, list)):
                walk(value)

    walk(content)
    if not places:
        return
    node, key = one_of(rng, places)
    way = int(rng.integers(6))
    if way == 0:
        del node[key]
    elif way == 1 and isinstance(node, dict):
        node[one_of(rng, ("", "x", "unit", "value", "axis", f"{key}s"))] = copy.deepcopy(one_of(rng, ODD))
    elif way == 2 and isinstance(node, list):
        node.insert(int(rng.integers(len(node) + 1)), copy.deepcopy(node[key]))
    elif way == 3 and isinstance(node[key], (int, float)) and not isinstance(node[key], bool):
        node[key] = one_of(rng, (-node[key], 0, 1e12 * node[key], node[key] * 1.5, float("nan"), 1e308))
    else:
        node[key] = copy.deepcopy(one_of(rng, ODD))


def damage_text(rng: Rng, path: Path) -> None:
    """Lines and words of a text, or bytes of another file."""
    data = path.read_bytes()
    rows = data.split(b"\n")
    i, way = int(rng.integers(len(rows))), int(rng.integers(7))
    if way == 0:
        del rows[i]
    elif way == 1:
        rows.insert(i, one_of(rng, rows))
    elif way == 2:
        rows[i] = rows[i][: int(rng.integers(len(rows[i]) + 1))] + b"\xc3"
        rows = rows[: i + 1]
    elif way == 3:
        rows[i] = re.sub(
            rb"[-+.\w]+", lambda m: one_of(rng, (b"nan", b"1e308", b"9" * 60, b"-", b"", b"x", m[0])), rows[i]
        )
    elif way == 4:
        rows[i] += one_of(rng, (b",", b" 1", b';"', b"\x00", b"\x1b[2J", "é".encode("latin-1"), b"," + b"z" * 140_000))
    elif way == 5:
        rows = [row + b"\r" for row in rows]
    else:
        cut = int(rng.integers(len(data) + 1))
        rows = (data[:cut] + bytes(rng.integers(256, size=8, dtype=np.uint8)) + data[cut + 8 :]).split(b"\n")
    path.write_bytes(b"\n".join(rows))


def _by(*commands: str) -> tuple[tuple[str, ...], ...]:
    """Commands as they are typed."""
    return tuple(tuple(command.split()) for command in commands)


READS = _by(
    "new log.csv", "new stars.dat", "new unit.log", "import csv log.csv --set header=header.toml",
    "import mikoff unit.log", "import imu-tk acc.txt gyr.txt", "import tpoint stars.dat",
    "import hdf5 rig.h5 --set header=header.toml", "import mat rig.mat --set header=header.toml",
)  # fmt: skip
TREES = _by(
    "simulate scenario.toml", "budget scenario.toml", "observe schedule.toml",
    "import csv log.csv --set header=header.toml", "apply rig --calibration rig.json",
    "apply stars --calibration stars.json", "compare rig.json rig.json", "export kalibr --calibration rig.json",
    "export csv --calibration rig.json", "export json --calibration rig.json", "export psins --calibration rig.json",
    "export tpoint --calibration stars.json",
)  # fmt: skip
COMMANDS = _by(
    "calibrate rig", "calibrate hand", "calibrate stars", "noise rig", "observe wu2018-18", "observe schedule.toml",
    "simulate scenario.toml", "new log.csv", "import tpoint stars.dat", "apply rig --calibration rig.json",
    "export csv --calibration rig.json", "catalogue", "compare rig.json hand.json", "budget scenario.toml",
    "navigate rig --calibration rig.json", "design -n 4 --step 90", "calibrate rig stars", "diagnose stars",
)  # fmt: skip
VALUES = (
    "", "-1", "0", "1", "3", "nan", "1e400", "x", "bias", "bias:x", "30", "K2", "rig", "rig.json", "..", "/dev/null",
    "é", "a,b", "tcp://127.0.0.1:1", "navigation", "consumer", "multiposition", "bias='5 ug'", "9" * 30, "\x1b[1m",
)  # fmt: skip


def input_of(rng: Rng, place: Path, quick: bool) -> tuple[str, list[str], str]:
    """Prepare one input: what it is, the arguments, and the recording whose reference its answer must meet."""
    what = one_of(rng, ("rewrite", "rows", "header", "rows", "header", "read", "tree", "tree", "options"))
    if what in ("rewrite", "rows", "header"):
        name = one_of(rng, ("rig", "hand", "stars"))
        header = tomllib.loads((place / name / "recording.toml").read_text())
        rows = {c: x.to_numpy().copy() for c, x in pl.read_csv(place / name / "samples.csv").to_dict().items()}
        {"rewrite": rewrite, "rows": damage_rows, "header": lambda r, h, _: damage_tree(r, h)}[what](rng, header, rows)
        shutil.rmtree(place / name)
        header.setdefault("samples", "samples.csv")
        save(place / name, header, rows)
        other = () if quick or what == "rewrite" or rng.random() < 0.8 else (["noise", name], ["diagnose", name])
        arguments = one_of(rng, other) if other else ["calibrate", name]
        return what, arguments, name if arguments[0] == "calibrate" and what != "header" else ""
    if what in ("read", "tree"):
        command = one_of(rng, READS if what == "read" else TREES)
        named = [word.removeprefix("header=") for word in command]
        file = one_of(rng, [word for word in named if (place / word).is_file()])
        if what == "read" or not file.endswith((".toml", ".json")):
            damage_text(rng, place / file)
        else:
            load, dump = (json.loads, json.dumps) if file.endswith(".json") else (tomllib.loads, lambda c: "".join(
                f"{json.dumps(k)} = {toml(v)}\n" for k, v in c.items()))  # fmt: skip
            content = load((place / file).read_text())
            damage_tree(rng, content)
            (place / file).write_text(dump(content))
        return what, [*command, "--out", "made"], ""
    command = list(one_of(rng, COMMANDS[:-2] if quick else COMMANDS))
    known = [p for p in gimbalcal.commands[command[0]].params if isinstance(p, click.Option) and p.name != "workers"]
    for _ in range(int(rng.integers(1, 3))):
        option = one_of(rng, known)
        command += [option.opts[0], *([] if option.is_flag else [one_of(rng, VALUES)])]
    return what, command, ""


class _HangError(BaseException):
    """An input that takes too long."""


@contextmanager
def limited(seconds: int) -> Iterator[None]:
    """Raise `_HangError` after so many seconds, and at the end again: `_called` catches whatever stops a command."""
    late = False

    def stop(*_: object) -> None:
        nonlocal late
        late = True
        raise _HangError

    before = signal.signal(signal.SIGALRM, stop)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)
    if late:
        raise _HangError


def run(arguments: list[str], place: Path) -> tuple[dict[str, Any], int, Any]:
    """Run a command in a folder: what was wrong, the exit status, and its result as JSON."""
    here, known = Path.cwd(), dict(CATALOGUE)
    os.chdir(place)
    try:
        given = {path for path in place.rglob("*") if path.is_file()}
        with limited(HANG_S):
            status, out, err = _called(arguments, place / "progress")
        found = _judged(status, out, err, place, given | {place / "progress"})
        if not found["wrong"] and status == 2 and PYTHON.search(re.sub(r"'[^']*'", "", found["last"])):
            found["wrong"] = "Python in a refusal"
        if not found["wrong"] and "\x1b" in err + out:
            found["wrong"] = "an escape sequence"
        try:
            return found, status, json.loads(out)
        except ValueError:
            return found, status, None
    except _HangError:
        return {"wrong": "hang", "last": f"no answer within {HANG_S} s", "where": ""}, 99, None
    finally:
        os.chdir(here)
        CATALOGUE.clear()
        CATALOGUE.update(known)
        loading._loaded.clear()


def silent(what: str, status: int, result: Any, reference: dict[str, tuple[float, float]]) -> str:
    """What is wrong of an answer against the reference: green, and off by more than the damage may do."""
    if what == "rewrite" and status:
        return f"a sound recording {'is refused' if status == 2 else 'does not fit'}"
    if status != 0 or not isinstance(result, dict):
        return ""
    fixed = {label for u in result["unobservable"] for label in u["direction"]}
    limit = 0.05 if what == "rewrite" else SIGMAS
    for p in result["parameters"]:
        label = f"{p['name']}:{p['axis']}"
        value, sigma = reference.get(label, (p["value"], 1.0))
        if label not in fixed and abs(p["value"] - value) > limit * np.hypot(sigma, p["sigma"]):
            return f"silent: {label} is {p['value']:.6g} +- {p['sigma']:.2g} where {value:.6g} +- {sigma:.2g} is right"
    return ""


def _forget_peak() -> None:
    """Count the largest memory of this process from here on, where the system can: it is that of one input."""
    with suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")


def fuzz(
    numbers: range | list[int],
    seed: int,
    quick: bool = False,
    seconds: float = np.inf,
    tell: Callable[[str], None] = print,
) -> tuple[Counter[str], list[Any]]:
    """Run inputs; returns how often each outcome came, and what was wrong."""
    counts: Counter[str] = Counter()
    finds: list[Any] = []
    until = time.monotonic() + seconds
    with tempfile.TemporaryDirectory(prefix="fuzz-") as name:
        base = Path(name) / "seeds"
        base.mkdir()
        reference = laboratory(base)
        for n in numbers:
            if time.monotonic() > until:
                break
            rng, place = np.random.default_rng([seed, n]), Path(name) / "w"
            shutil.copytree(base, place)
            what, arguments, of = input_of(rng, place, quick)
            arguments = [*arguments, *([] if arguments[0] == "catalogue" or "--json" in arguments else ["--json"])]
            _forget_peak()
            found, status, result = run(arguments, place)
            wrong = found["wrong"] or (silent(what, status, result, reference[of]) if of else "")
            if not wrong and resource.getrusage(resource.RUSAGE_SELF).ru_maxrss > 1024 * MEMORY_MB:
                wrong = "memory"
            counts[f"{what}: exit {status}"] += 1
            if wrong:
                finds.append({"number": n, "what": what, "arguments": arguments, "wrong": wrong, "last": found["last"],
                              "where": found["where"]})  # fmt: skip
                tell(json.dumps(finds[-1]))
            shutil.rmtree(place)
    return counts, finds


def say(line: str) -> None:
    """Print a line at once."""
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


def main() -> int:
    """Print the finds as they come and the counts; return the exit status."""
    reader = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    reader.add_argument("--n", type=int, default=1000)
    reader.add_argument("--seed", type=int, default=1)
    reader.add_argument("--only", type=int, default=None)
    reader.add_argument("--quick", action="store_true", help="without the commands that take seconds")
    reader.add_argument("--seconds", type=float, default=np.inf, help="stop after so long")
    given = reader.parse_args()
    began = time.perf_counter()
    numbers = range(given.n) if given.only is None else [given.only]
    counts, finds = fuzz(numbers, given.seed, given.quick, given.seconds, say)
    say("\n".join(f"{k:24s} {n}" for k, n in sorted(counts.items())))
    say(f"{counts.total()} inputs in {time.perf_counter() - began:.0f} s; {len(finds)} wrong")
    return int(bool(finds))


if __name__ == "__main__":
    sys.exit(main())
