"""A second fuzzer, written from README, docs and the contract of files alone; it shares no seeds with the first.

    python -m tests.fuzzing.documented --n 20000 --seed 3      many inputs
    python -m tests.fuzzing.documented --seed 3 --only 123     one of them again, with what came of it
    python -m tests.fuzzing.documented --n 100000 --state FILE --seconds 280     a part; again, until all are done
    python -m tests.fuzzing.documented --report FILE > docs/measured/fuzzing.txt

Each input takes a command with files of the [laboratory](laboratory.py), and one of

* a *rewriting* that changes nothing (units with their numbers, order of columns, CSV or Parquet, signs, comments, ends
  of lines, an option with its default): the numbers must be those of the input as it was;
* a *damage* of a header, a row, a column, a line, a result or an option: refused by one sentence without a word of
  Python and with nothing written, or answered. An answer that is green must have parameters within 5 sigma of the
  reference; a recording that is converted must have the rows that were not damaged, or a sentence about it.

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
import textwrap
import time
import tomllib
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import click
import numpy as np
import polars as pl

from gimbalcal.cli import gimbalcal
from gimbalcal.effects import CATALOGUE, loading
from tests.fuzzing.change import one_of
from tests.fuzzing.laboratory import LOGS, PLANTS, Header, Rng, Rows, laboratory, load, save, toml
from tests.fuzzing.worker import _called, _judged

HANG_S, STUCK_S, MEMORY_MB, SIGMAS = 20, 120, 2000, 5.0
PYTHON = re.compile(
    r"\b\w*(Error|Exception|Warning)\b|NoneType|object is not|unhashable|codec can't|\bdict\b|Input should"
)
ODD = (
    None, True, -1, 0, 3, 1e300, 2**70, "", "x", "é\u202e", "\x1b[31m", [], [1], ["x"], {}, {"a": 1}, "9" * 50, "nan",
)  # fmt: skip
UNLIMITED = 10**9


# --- what is done to it -------------------------------------------------------------------------------------------


def rewrite(rng: Rng, header: Header, rows: Rows) -> int:
    """Another way to write the same recording; returns how many rows it changes: 0."""
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
        elif (
            way == 3
            and column["quantity"] in ("specific_force", "gimbal_angle", "angular_rate")
            and "sign" not in column
        ):
            rows[name], column["sign"] = -rows[name], -1
        elif way == 4:
            order = [str(n) for n in rng.permutation(list(rows))]
            entries = {n: rows.pop(n) for n in order}
            rows.update(entries)
        elif way == 5:
            header["samples"] = one_of(rng, ("samples.csv", "samples.parquet"))
        else:
            header["title"] = one_of(rng, ("é µ °", "a" * 300, "[x] {y} = `z`", "tab\there"))
    return 0


def damage_rows(rng: Rng, header: Header, rows: Rows) -> int:
    """One mistake in columns or rows that the data can show; returns how many rows it changes."""
    force = [n for n, c in header["columns"].items() if c["quantity"] == "specific_force"]
    name = one_of(rng, list(rows))
    i = int(rng.integers(len(rows[name])))
    way = int(rng.integers(9))
    if way == 0:  # another unit
        other = one_of(rng, ("m/s^2", "g", "mg", "deg", "rad", "arcsec", "s", "h", "count", "ug", "V", ""))
        header["columns"].setdefault(name, {})["unit"] = other
    elif way == 1 and force:  # a channel in another unit than its column says
        rows[one_of(rng, force)] *= one_of(rng, (1 / 9.80665, 1000 / 9.80665, 100.0))
    elif way == 2:  # a channel that stands still
        rows[name] = np.full(len(rows[name]), rows[name][i])
    elif way == 3:  # single values
        rows[name][i] = one_of(rng, (np.nan, np.inf, 1e300, -1e9, 0.0, 1e16, -rows[name][i]))
        return 1
    elif way == 4:  # rows left out, doubled, or in disorder
        keep = np.arange(len(rows[name]))
        keep = one_of(rng, (np.delete(keep, i), keep[: max(i, 1)], np.insert(keep, i, i), keep[::-1]))
        for n in rows:
            rows[n] = rows[n][keep]
    elif way == 5:  # a column that is not there
        rows.pop(name)
    elif way == 6 and len(force) > 2 and "inner" in rows:  # exchanged accelerometers, against the gimbals
        rows[force[0]], rows[force[1]] = rows[force[1]], rows[force[0]]
    elif way == 7 and "inner" in rows:  # degrees that are said to be something else, a gimbal of the other sense
        rows["inner"] = rows["inner"] * one_of(rng, (-1.0, np.pi / 180, 60.0))
    else:
        quantity = one_of(rng, ("time", "specific_force", "gimbal_angle", "covariate", "x"))
        header["columns"].setdefault(name, {})["quantity"] = quantity
    return UNLIMITED


def damage_tree(rng: Rng, content: Any) -> str:
    """Give one value of nested tables and lists another type, remove, double or add it; returns its place."""
    places: list[tuple[Any, Any, str]] = []

    def walk(node: Any, path: str) -> None:
        for key, value in node.items() if isinstance(node, dict) else enumerate(node):
            places.append((node, key, f"{path}/{key}"))
            if isinstance(value, (dict, list)):
                walk(value, f"{path}/{key}")

    walk(content, "")
    if not places:
        return ""
    node, key, place = one_of(rng, places)
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
    return place


HEADINGS = {"stars.dat": 3, "scope.dat": 3, "guide.txt": UNLIMITED, "two_lines.txt": 2, "lines.jsonl": 0,
            "kinds.txt": 0, "terminal.txt": 0, "unit.log": 0, "acc.txt": 0, "gyr.txt": 0,
            "telescope.dat": 0}  # fmt: skip
TABLES = (".csv", ".txt", ".log", ".dat", ".jsonl")  # files in which a line is a row


def damage_text(rng: Rng, path: Path) -> tuple[int, int]:
    """Damage lines and words of a text, or bytes of another file; returns how many rows change and how many vanish."""
    data = path.read_bytes()
    rows = data.split(b"\n")
    i, way = int(rng.integers(len(rows))), int(rng.integers(7))
    changed, lost = ((0, 1), (0, 0), (1, UNLIMITED), (1, 1), (1, 1), (0, 0), (2, 2))[way]
    if way == 0:
        del rows[i]
    elif way == 1:
        rows.insert(i, one_of(rng, rows))
    elif way == 2:
        rows[i] = rows[i][: int(rng.integers(len(rows[i]) + 1))] + b"\xc3"
        rows = rows[: i + 1]
    elif way == 3:
        words = (b"nan", b"1e308", b"9" * 60, b"-", b"", b"x")
        rows[i] = re.sub(rb"[-+.\w]+", lambda m: one_of(rng, (*words, m[0])), rows[i])
    elif way == 4:
        rows[i] += one_of(rng, (b",", b" 1", b';"', b"\x00", b"\x1b[2J", "é".encode("latin-1"), b"," + b"z" * 140_000))
    elif way == 5:
        rows = [row + b"\r" for row in rows]
    else:
        cut = int(rng.integers(len(data) + 1))
        i = data[:cut].count(b"\n")
        rows = (data[:cut] + bytes(rng.integers(256, size=8, dtype=np.uint8)) + data[cut + 8 :]).split(b"\n")
    path.write_bytes(b"\n".join(rows))
    if path.suffix == ".bin" and way == 6:
        return 2, 2
    if path.suffix not in TABLES or "utf16" in path.name or i < HEADINGS.get(path.name, 1):
        return UNLIMITED, UNLIMITED
    return changed + 1, lost + 1  # an observation may be a block of lines


def rewrite_text(rng: Rng, path: Path) -> None:
    """Another way to write the same text: ends of lines, a mark of UTF-8, blank lines at the end."""
    data = path.read_bytes()
    way = int(rng.integers(3))
    path.write_bytes((data.replace(b"\n", b"\r\n"), b"\xef\xbb\xbf" + data, data + b"\n\n")[way])


# --- commands -----------------------------------------------------------------------------------------------------


def _by(text: str) -> tuple[tuple[str, ...], ...]:
    """Commands as they are typed, one in a line."""
    return tuple(tuple(line.split()) for line in text.strip().splitlines())


CHEAP = (
    *(("new", name) for name in LOGS if name != "log.mat"),
    *_by("""
new unit.log --rate 20
new part1.csv part2.csv part3.csv
new stars.dat
new scope.dat
new stars.csv
new telescope.dat
new guide.txt --latitude 51
import csv log.csv --set header=header.toml
import csv log.csv --set header=header.toml --set separator=comma
import hdf5 log.h5 --set header=h5.toml
import imu-tk acc.txt gyr.txt
import imu-tk acc.txt --set means=yes
import mikoff unit.log --set rate=20
import mmt telescope.dat
import phd2 guide.txt --set latitude=51
import tilt-table tilt.npz
import tpoint stars.dat
import tpoint stars.dat --set azimuth=north
import tpoint scope.dat
import tpoint scope.dat --set refraction=yes
apply rig --calibration rig.json
apply rig --calibration rig.json --inverse
apply rig --calibration imu.yaml
apply rig --calibration calibration.csv
apply stars --calibration stars.json
apply stars --calibration mount.mod
apply stars --calibration tpoint.mod
export kalibr --calibration rig.json
export psins --calibration rig.json
export csv --calibration rig.json
export json --calibration rig.json
export json --calibration imu.yaml
export json --calibration calibration.csv
export json --calibration mount.mod
export tpoint --calibration stars.json
compare month1.json month2.json month3.json
compare month4.json --store fleet.sqlite --unit u1
compare --store fleet.sqlite --unit u1
observe wu2018-18
observe schedule.toml
observe static-48h
simulate scenario.toml
noise static
next hand
catalogue
catalogue K3
catalogue --check law.py
design -n 4 --step 90
"""),
)  # fmt: skip
# those that estimate, and those that read MATLAB, which is done in a process of its own
FITS = _by("""
new log.mat
import mat log.mat --set header=mat.toml
apply rig --calibration clbt.mat
export json --calibration clbt.mat
calibrate rig
calibrate hand
calibrate stars
calibrate static
calibrate rig --method multiposition
calibrate rig --grade fleet:fleet.sqlite
calibrate rig --effects law.py --with side_force
calibrate hand --store fleet.sqlite --unit new
calibrate reversed --method two-position
calibrate stars --with TX --without NPAE
calibrate tx ty tz
calibrate moving
calibrate turning --states 30
""")
SLOW = _by("""
next rig
next rig static
next turning --states 30
navigate static --calibration rig.json
navigate turning --alignment 1
budget scenario.toml
campaign scenario.toml -n 2 --workers 1
observe wei2022-30 --states 30
diagnose stars
diagnose hand
diagnose rig
diagnose rig --calibration rig.json
""")
SLOWEST = _by("""
batch mounts/* --store new.sqlite --workers 1
design --kind rotation --states 30 --tries 1
demo
""")
Tiers = Sequence[tuple[Sequence[tuple[str, ...]], float]]  # commands, and how often one of them is taken
TIERS: Tiers = ((CHEAP, 0.95), (FITS, 0.045), (SLOW, 0.0045), (SLOWEST, 0.0005))
VALUES = (
    "", "-1", "0", "1", "3", "nan", "1e400", "x", "bias", "bias:x", "30", "K2", "rig", "rig.json", "..", "/dev/null",
    "é", "a,b", "tcp://127.0.0.1:1", "navigation", "consumer", "multiposition", "bias='5 ug'", "9" * 30, "\x1b[1m",
    "fleet:fleet.sqlite", "title=x", "means=yes", "rate=10", "law.py", "fleet.sqlite", "angular_rate=deg/s", "u1",
)  # fmt: skip


def options_of(command: str) -> list[click.Option]:
    """Options of a command."""
    return [p for p in gimbalcal.commands[command].params if isinstance(p, click.Option)]


def value_of(rng: Rng, option: click.Option) -> str:
    """A value for an option: one of those that it lists, at or beyond its limits, or an odd one."""
    kind = option.type
    if isinstance(kind, click.Choice) and rng.random() < 0.7:
        return str(one_of(rng, kind.choices))
    if isinstance(kind, (click.FloatRange, click.IntRange)) and rng.random() < 0.5:
        limits = [x for x in (kind.min, kind.max) if x is not None]
        return str(one_of(rng, (*limits, *(2 * x - 1 for x in limits), *(x + 1 for x in limits), 7)))
    return str(one_of(rng, VALUES))


def defaults_of(command: str) -> list[list[str]]:
    """Options of a command with their defaults, as they would be typed."""
    numbers = [
        o for o in options_of(command) if isinstance(o.default, (int, float, str)) and not o.is_flag and o.default != ""
    ]
    return [[o.opts[0], str(o.default)] for o in numbers] + [["--quiet"]] * (command != "catalogue")


@dataclass
class Input:
    """One input: what is done, the arguments, and how many rows of what is converted may change and vanish."""

    what: str
    command: tuple[str, ...]
    arguments: list[str]
    changed: int = 0
    lost: int = 0
    place: str = ""  # in a tree


def copy_named(base: Path, command: tuple[str, ...], place: Path) -> list[str]:
    """Copy what a command names; returns the names."""
    named = [part for word in command for part in (word.rpartition("=")[2].rpartition(":")[2].partition("/")[0],)]
    named = [word for word in dict.fromkeys(named) if (base / word).exists()]
    place.mkdir(exist_ok=True)
    for name in named:
        if (base / name).is_dir():
            shutil.copytree(base / name, place / name)
        else:
            shutil.copy(base / name, place / name)
    return named


def input_of(rng: Rng, place: Path, base: Path, recordings: dict[str, tuple[Header, Rows]], tiers: Tiers) -> Input:
    """Prepare one input in a folder."""
    share = np.cumsum([w for _, w in tiers])
    command = one_of(rng, tiers[int(np.searchsorted(share, rng.random() * share[-1]))][0])
    named = copy_named(base, command, place)
    whole = [n for n in named if n in recordings]
    trees = [n for n in named if n.endswith((".toml", "json"))]
    texts = [n for n in named if (place / n).is_file() and n not in trees]
    logs = command[0] in ("new", "import")
    ways = ["options"] * 4 + ["defaults"] + (["rewrite"] + ["rows"] * 6 + ["header"] * 6) * bool(whole)
    what = one_of(rng, ways + ["tree"] * 8 * bool(trees) + ["text"] * 8 * bool(texts) + ["rewrite text"] * logs)
    found = Input(what, command, [*command, *([] if command[0] == "catalogue" else ["--out", "made"])])
    if what in ("rewrite", "rows", "header"):
        name = one_of(rng, whole)
        header, rows = copy.deepcopy(recordings[name])
        if what == "header":
            found.place = damage_tree(rng, header)
            found.changed = UNLIMITED
        else:
            found.changed = {"rewrite": rewrite, "rows": damage_rows}[what](rng, header, rows)
        found.lost = found.changed
        shutil.rmtree(place / name)
        header.setdefault("samples", "samples.csv")
        save(place / name, header, rows)
    elif what == "tree":
        path = place / one_of(rng, trees)
        text = path.read_text()
        found.changed = found.lost = UNLIMITED
        content = json.loads(text) if path.suffix == ".json" else tomllib.loads(text)
        found.place = damage_tree(rng, content)
        tables = (f"{json.dumps(k)} = {toml(v)}\n" for k, v in content.items()) if isinstance(content, dict) else ()
        path.write_text(json.dumps(content) if path.suffix == ".json" else "".join(tables))
    elif what == "text":
        found.place = one_of(rng, texts)
        found.changed, found.lost = damage_text(rng, place / found.place)
        if not logs:  # what is damaged is a calibration
            found.changed = found.lost = UNLIMITED
    elif what == "rewrite text":
        plain = [n for n in texts if n.endswith(TABLES) and "utf16" not in n]
        if plain:
            rewrite_text(rng, place / one_of(rng, plain))
    elif what == "defaults":
        given = [o for o in defaults_of(command[0]) if o[0] not in command]
        found.arguments += one_of(rng, given) if given else []
    else:
        found.changed = found.lost = UNLIMITED
        known = [o for o in options_of(command[0]) if o.name != "workers" or command in SLOWEST]
        for _ in range(int(rng.integers(1, 3))):
            option = one_of(rng, known)
            found.arguments += [option.opts[0], *([] if option.is_flag else [value_of(rng, option)])]
    if command[0] != "catalogue":
        found.arguments.append("--json")
    return found


# --- what comes of it ---------------------------------------------------------------------------------------------


class _HangError(BaseException):
    """An input that takes too long."""


@contextmanager
def limited() -> Iterator[None]:
    """Raise `_HangError` after so much processor time or waiting, and at the end again: `_called` catches all."""
    late = False

    def stop(*_: object) -> None:
        nonlocal late
        late = True
        raise _HangError

    before = [(s, signal.signal(s, stop)) for s in (signal.SIGPROF, signal.SIGALRM)]
    signal.setitimer(signal.ITIMER_PROF, HANG_S)
    signal.alarm(STUCK_S)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.alarm(0)
        for s, action in before:
            signal.signal(s, action)
    if late:
        raise _HangError


@dataclass
class Outcome:
    """What came of a command: its judgement, the numbers of its result, the recording and the sentences it wrote."""

    status: int
    found: dict[str, Any]
    result: Any = None
    table: Rows = field(default_factory=dict)
    sentences: frozenset[str] = frozenset()


def run(arguments: list[str], place: Path) -> Outcome:
    """Run a command in a folder."""
    here, known = Path.cwd(), dict(CATALOGUE)
    os.chdir(place)
    try:
        given = {path for path in place.rglob("*") if path.is_file()}
        with limited():
            status, out, err = _called(arguments, place / "progress")
        found = _judged(status, out, err, place, given | {place / "progress"})
        of_python = "law.py" in arguments
        if (
            not found["wrong"]
            and not of_python
            and status == 2
            and PYTHON.search(re.sub(r"'[^']*'", "", found["last"]))
        ):
            found["wrong"] = "Python in a refusal"
        if not found["wrong"] and "\x1b" in err + out:
            found["wrong"] = "an escape sequence"
        outcome = Outcome(status, found)
        with suppress(ValueError):
            outcome.result = json.loads(out)
        if status in (0, 1) and (place / "made" / "recording.toml").is_file():
            outcome.table = load(place / "made")
        said = [*err.splitlines(), *(x for x in _leaves(outcome.result).values() if isinstance(x, str))]
        outcome.sentences = frozenset(re.sub(r"[-+\d.]+", "#", line).strip() for line in said)
    except _HangError:  # what tells how much of it is done does not hang
        wrong = "" if (place / "progress").is_file() else "hang"
        return Outcome(99, {"wrong": wrong, "last": f"no answer within {HANG_S} s", "where": ""})
    else:
        return outcome
    finally:
        os.chdir(here)
        CATALOGUE.clear()
        CATALOGUE.update(known)
        loading._loaded.clear()


def _leaves(content: Any, path: str = "") -> dict[str, Any]:
    if not isinstance(content, (dict, list)):
        return {path: content}
    found = {}
    for key, value in content.items() if isinstance(content, dict) else enumerate(content):
        found |= _leaves(value, f"{path}/{key}")
    return found


VOLATILE = re.compile(r"created|seconds|path|folder|sha256|version|/file|elapsed|title|recording", re.IGNORECASE)


def different_numbers(result: Any, reference: Any) -> str:
    """The first number of a result that is not that of the reference."""
    a, b = _leaves(result), _leaves(reference)
    for place in [*b, *(p for p in a if p not in b)]:
        x, y = a.get(place), b.get(place)
        if not isinstance(x, (int, float)) | isinstance(y, (int, float)) or VOLATILE.search(place) or x == y:
            continue
        # sums over arrays are rounded by where these lie in memory
        if None in (x, y) or not np.isclose(float(x), float(y), rtol=1e-6, atol=0.0):
            return f"{place} is {x} where {y} is right"
    return ""


def off(result: Any, reference: Any, limit: float) -> str:
    """The first parameter of a calibration that is off the reference by more than so many sigmas."""
    if not (isinstance(result, dict) and isinstance(reference, dict) and "unobservable" in result):
        return ""
    right = {f"{p['name']}:{p['axis']}": p for p in reference["parameters"]}
    fixed = {label for r in (result, reference) for u in r["unobservable"] for label in u["direction"]}
    for p in result["parameters"]:
        label = f"{p['name']}:{p['axis']}"
        q = right.get(label, p | {"sigma": 1.0})
        if (
            label not in fixed
            and "value" in p
            and "value" in q
            and abs(p["value"] - q["value"]) > limit * np.hypot(q["sigma"], p["sigma"])
        ):
            return (f"{label} is {p['value']:.6g} +- {p['sigma']:.2g} where {q['value']:.6g} +- {q['sigma']:.2g} "
                    f"is right")  # fmt: skip
    return ""


def different_rows(table: Rows, reference: Rows) -> tuple[int, int]:
    """How many rows of a recording are in no row of the reference, and the reverse; the clock and dwells aside."""
    names = [n for n in reference if n.partition(":")[0] not in ("time", "position")]
    if set(names) - set(table):
        return UNLIMITED - 1, UNLIMITED - 1
    scale = [1e-7 * max(float(np.nanmax(np.abs(reference[n]))), 1e-300) for n in names]
    with np.errstate(invalid="ignore"):
        a, b = (Counter(zip(*(np.round(t[n] / s).tolist() for n, s in zip(names, scale, strict=True)), strict=True))
                for t in (table, reference))  # fmt: skip
    return (a - b).total(), (b - a).total()


def clock_off(table: Rows, reference: Rows) -> bool:
    """Return whether the clock of the same rows runs differently."""
    t, u = table.get("time:", np.zeros(1)), reference.get("time:", np.zeros(1))
    return len(t) == len(u) > 1 and bool(np.max(np.abs(t - t[0] - (u - u[0]))) > 1e-6 * max(np.ptp(u), 1.0))


def silent(given: Input, got: Outcome, reference: Outcome, counts: Counter[str]) -> str:
    """What is wrong of an answer beside the reference: green or without a sentence, off by more than the damage."""
    same = given.what in ("rewrite", "rewrite text", "defaults")
    if same and got.status != reference.status:
        return f"{given.what}: exit {got.status} where {reference.status} is right"
    if got.status not in (0, 1) or "--help" in given.arguments:
        return ""
    if given.what == "defaults" and (where := different_numbers(got.result, reference.result)):
        return f"a default that is stated: {where}"
    if given.what != "options" and got.status == 0 and isinstance(got.result, dict) and "unobservable" in got.result:
        counts["compared: parameters"] += 1
        if where := off(got.result, reference.result, 0.05 if same else SIGMAS):
            return f"silent: {where}"
    if not reference.table or given.what == "options":
        return ""
    model = re.match(r"/(parameters|model|readout|covariance|provenance)", given.place)
    unread = given.what == "tree" and given.arguments[0] == "apply" and given.place and not model
    allowed = (0, 0) if unread else (given.changed, given.lost)
    if min(allowed) >= UNLIMITED:
        return ""
    counts["compared: recordings"] += 1
    changed, lost = different_rows(got.table, reference.table)
    if got.sentences <= reference.sentences and (changed > allowed[0] or lost > allowed[1]):
        return f"silent: {changed} rows of the recording are new and {lost} have gone where {allowed} were damaged"
    if changed == lost == 0 and got.sentences <= reference.sentences and clock_off(got.table, reference.table):
        return "silent: the clock runs differently"
    return ""


def calibrated(place: Path, got: Outcome) -> Outcome:
    """The calibration of the recording that a command made; nothing where that takes seconds, or there is none."""
    if not got.table or any(name.startswith("angular_rate") for name in got.table):
        return Outcome(2, {})
    return run(["calibrate", "made", "--json", "--out", "of-made"], place)


def _forget_peak() -> None:
    """Count the largest memory of this process from here on, where the system can: it is that of one input."""
    with suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")


class Fuzzer:
    """The laboratory, the outcome of every sound command, and the counts."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.base = folder, folder / "seeds"
        self.base.mkdir()
        laboratory(self.base, self._seed)
        rows = {name: load_rows(self.base / name) for name in PLANTS}
        self.recordings = rows
        self.references: dict[tuple[str, ...], tuple[Outcome, Outcome]] = {}
        self.counts: Counter[str] = Counter()

    def _seed(self, arguments: Any) -> None:
        assert run([*arguments, "--json"], self.base).status == 0, arguments

    def reference(self, command: tuple[str, ...]) -> tuple[Outcome, Outcome]:
        """What comes of a command without damage, and of the calibration of a recording that it makes."""
        if command not in self.references:
            place = self.folder / "sound"
            copy_named(self.base, command, place)
            extra = [] if command[0] == "catalogue" else ["--out", "made", "--json"]
            got = run([*command, *extra], place)
            converted = command[0] in ("new", "import")
            self.references[command] = got, calibrated(place, got) if converted else Outcome(2, {})
            shutil.rmtree(place)
        return self.references[command]

    def one(self, seed: int, n: int, tiers: Tiers = TIERS) -> dict[str, Any] | None:
        """Run one input; returns what was wrong, or nothing."""
        rng, place = np.random.default_rng([seed, n]), self.folder / "w"
        try:
            given = input_of(rng, place, self.base, self.recordings, tiers)
            reference, reference_fit = self.reference(given.command)
            _forget_peak()
            began = time.monotonic()
            got = run(given.arguments, place)
            if time.monotonic() - began > HANG_S:
                self.counts["slow: " + " ".join(given.arguments)] += 1
            wrong = got.found["wrong"] or silent(given, got, reference, self.counts)
            if not wrong and resource.getrusage(resource.RUSAGE_SELF).ru_maxrss > 1024 * MEMORY_MB:
                wrong = "memory"
            damaged = given.what in ("text", "tree") and got.status == 0 and reference_fit.status == 0
            if not wrong and damaged and got.sentences <= reference.sentences and rng.random() < 0.3:
                fit = calibrated(place, got)
                self.counts["compared: calibrations of what was converted"] += 1
                if fit.status == 0 and fit.sentences <= reference_fit.sentences:
                    where = off(fit.result, reference_fit.result, SIGMAS)
                    wrong = fit.found["wrong"] or (where and f"silent: {where}")
        finally:
            shutil.rmtree(place, ignore_errors=True)
        command = " ".join(given.command[: 2 if given.command[0] in ("import", "export") else 1])
        self.counts[f"what: {given.what}: exit {got.status}"] += 1
        self.counts[f"command: {command}"] += 1
        for word in given.arguments:
            if word.startswith("--"):
                self.counts[f"option: {given.command[0]} {word}"] += 1
        if not wrong:
            return None
        return {"seed": seed, "number": n, "what": given.what, "place": given.place, "arguments": given.arguments,
                "wrong": wrong, "last": got.found["last"], "where": got.found["where"]}  # fmt: skip


def load_rows(folder: Path) -> tuple[Header, Rows]:
    """Header and columns of a recording, as they stand in its files."""
    header = tomllib.loads((folder / "recording.toml").read_text())
    frame = pl.read_csv(folder / "samples.csv")
    return header, {c: x.cast(pl.Float64).to_numpy().copy() for c, x in frame.to_dict().items()}


@contextmanager
def fuzzer() -> Iterator[Fuzzer]:
    """A fuzzer in a folder that goes with it; in memory, where the system can."""
    memory = Path("/dev/shm")
    with tempfile.TemporaryDirectory(prefix="fuzz-", dir=memory if memory.is_dir() else None) as name:
        kept, tempfile.tempdir = tempfile.tempdir, name
        try:
            yield Fuzzer(Path(name))
        finally:
            tempfile.tempdir = kept


def fuzz(numbers: range, seed: int, tiers: Tiers = TIERS) -> tuple[Counter[str], list[dict[str, Any]]]:
    """Run inputs; returns how often each outcome came, and what was wrong."""
    with fuzzer() as runs:
        finds = [find for n in numbers if (find := runs.one(seed, n, tiers)) is not None]
        return runs.counts, finds


def say(line: str) -> None:
    """Print a line at once."""
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


def report(states: Sequence[dict[str, Any]]) -> None:
    """Print what was wrong in runs, then the counts of outcomes by what was done, comparisons, commands and options."""
    counts = Counter[str]()
    for state in states:
        counts += Counter(state["counts"])
        say(f"{state['next']} inputs, seed {state['seed']}: {len(state['finds'])} wrong when they were run")
        for find in state["finds"]:
            typed = json.dumps(" ".join(find["arguments"]))[1:-1]
            each = (textwrap.shorten(words, 100, placeholder=" ...") for words in (find["wrong"], typed))
            say(f"    {find['number']}: {'; '.join(each)}")
        if "again" in state:
            say(f"    run again at the end: {state['again']} of them wrong")
    say("")
    for kind in ("what", "compared", "command", "slow"):
        for key, n in sorted(counts.items()):
            if key.startswith(f"{kind}: "):
                say(f"{key.removeprefix('what: '):60s} {n}")
    used = {key.removeprefix("option: ") for key in counts if key.startswith("option: ")}
    every = {f"{name} {o.opts[0]}" for name in gimbalcal.commands for o in options_of(name)}
    every = {word for word in every if word.partition(" ")[2].startswith("--")}
    say(f"options: {len(used & every)} of {len(every)}; not used: {', '.join(sorted(every - used)) or 'none'}")


def main() -> int:
    """Print the finds as they come and the counts; return the exit status."""
    reader = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    reader.add_argument("--n", type=int, default=1000)
    reader.add_argument("--seed", type=int, default=1)
    reader.add_argument("--only", type=int, default=None)
    reader.add_argument("--seconds", type=float, default=np.inf, help="stop after so long")
    reader.add_argument("--state", type=Path, default=None, help="file in which a run is continued")
    reader.add_argument("--again", action="store_true", help="run what was wrong again")
    reader.add_argument("--report", type=Path, nargs="+", help="print the counts of runs by their files")
    given = reader.parse_args()
    state: dict[str, Any] = {"seed": given.seed, "next": 0, "counts": {}, "finds": []}
    if given.state is not None and given.state.is_file():
        state = json.loads(given.state.read_text())
    if given.report:
        report([json.loads(path.read_text()) for path in given.report])
        return 0
    until, wrong = time.monotonic() + given.seconds, 0
    with fuzzer() as runs:
        if given.again or given.only is not None:
            seeds = [(f["seed"], f["number"]) for f in state["finds"]] if given.again else [(given.seed, given.only)]
            for seed, n in seeds:
                find = runs.one(seed, n)
                wrong += find is not None
                say(json.dumps(find))
            state["again"] = wrong
        else:
            while state["next"] < given.n and time.monotonic() < until:
                find = runs.one(state["seed"], state["next"])
                state["next"] += 1
                if find is not None:
                    state["finds"].append(find)
                    say(json.dumps(find))
            state["counts"] = dict(Counter(state["counts"]) + runs.counts)
            wrong = len(state["finds"])
            report([state])
    if given.state is not None:
        given.state.write_text(json.dumps(state))
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
