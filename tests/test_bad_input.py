"""What a hostile or unlucky user hands to the command line: each fault is one sentence, status 2, nothing written.

Every case is a copy of a recording that ships with the project, with one thing wrong. The sentence says what, where
(file, line or row, column) and what to do instead. The second half are inputs that look odd and are not wrong.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from datetime import datetime, timedelta, timezone
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from gimbalcal.effects import values
from gimbalcal.methods import calibrate
from gimbalcal.number import Array
from gimbalcal.pipeline import load
from gimbalcal.recording import Recording, dwells, read, write

DATA = Path(__file__).resolve().parent.parent / "data"
DEVICE, STATIC = DATA / "space_stable_18", DATA / "space_stable_static"
FORCE = ("accel_x", "accel_y", "accel_z")
Change = Callable[[Path], object]
"""Spoils the recording in a folder."""
Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def run(command: Callable[..., int], capsys: pytest.CaptureFixture[str]) -> Run:
    """The command line in this process: status, stdout and stderr."""

    def go(*arguments: object) -> tuple[int, str, str]:
        status = command(*arguments)
        shown = capsys.readouterr()
        return status, shown.out, shown.err

    return go


def copy(source: Path, folder: Path, change: Change | None = None) -> Path:
    folder.mkdir(parents=True)
    for name in ("recording.toml", "samples.csv"):
        shutil.copy(source / name, folder / name)
    if change:
        change(folder)
    return folder


# --- ways to spoil ----------------------------------------------------------------------------------------------------


def header(old: str, new: str) -> Change:
    """The first match of a regular expression in recording.toml, replaced as it stands."""

    def change(folder: Path) -> None:
        path = folder / "recording.toml"
        text = path.read_text(encoding="utf-8")
        assert re.search(old, text), old
        path.write_text(re.sub(old, lambda _: new, text, count=1), encoding="utf-8")

    return change


def table(folder: Path) -> tuple[list[str], Array]:
    lines = (folder / "samples.csv").read_text().splitlines()
    return lines[0].split(","), np.array([[float(v) for v in line.split(",")] for line in lines[1:]])


def put(folder: Path, names: list[str], rows: Array, form: Callable[[float], str] = repr) -> None:
    text = "\n".join([",".join(names), *(",".join(form(float(v)) for v in row) for row in rows)])
    (folder / "samples.csv").write_text(text + "\n")


def rows(edit: Callable[[Array, dict[str, int]], Array | None]) -> Change:
    """The numbers edited in place, or replaced by what `edit` returns; columns by name."""

    def change(folder: Path) -> None:
        names, held = table(folder)
        made = edit(held, {name: i for i, name in enumerate(names)})
        put(folder, names, held if made is None else made)

    return change


def lines(edit: Callable[[list[str]], list[str]]) -> Change:
    def change(folder: Path) -> None:
        path = folder / "samples.csv"
        path.write_text("\n".join(edit(path.read_text().splitlines())) + "\n", encoding="utf-8")

    return change


def cell(line: int, name: str, text: str) -> Change:
    def edit(held: list[str]) -> list[str]:
        cells = held[line - 1].split(",")
        cells[held[0].split(",").index(name)] = text
        return [*held[: line - 1], ",".join(cells), *held[line:]]

    return lines(edit)


def both(*changes: Change) -> Change:
    return lambda folder: [change(folder) for change in changes]


def column(name: str, change: Callable[[Array], object], start: int = 0, stop: int | None = None) -> Change:
    """Some rows of a column put through `change`."""

    def edit(held: Array, at: dict[str, int]) -> None:
        held[start:stop, at[name]] = change(held[start:stop, at[name]])

    return rows(edit)


def times(factor: float, *names: str) -> Change:
    return both(*(column(name, lambda v: v * factor) for name in names))


def swapped(a: str, b: str) -> Change:
    def edit(held: Array, at: dict[str, int]) -> None:
        held[:, [at[a], at[b]]] = held[:, [at[b], at[a]]]

    return rows(edit)


def without(*names: str) -> Change:
    """A column that neither the header nor the samples have."""

    def cut(held: list[str]) -> list[str]:
        kept = [i for i, name in enumerate(held[0].split(",")) if name not in names]
        return [",".join(line.split(",")[i] for i in kept) for line in held]

    return both(lines(cut), *(header(rf"(?m)^{name} = .*\n", "") for name in names))


def unit(axis: str, old: str, new: str) -> Change:
    return header(rf'axis = "{axis}", unit = "{re.escape(old)}"', f'axis = "{axis}"{new}')


def called(unit_: str, old: str, *axes: str) -> Change:
    return both(*(unit(axis, old, f', unit = "{unit_}"') for axis in axes))


def parquet(edit: Callable[[pl.DataFrame], pl.DataFrame] = lambda frame: frame) -> Change:
    def change(folder: Path) -> None:
        edit(pl.read_csv(folder / "samples.csv")).write_parquet(folder / "samples.parquet")
        (folder / "samples.csv").unlink()
        header("samples.csv", "samples.parquet")(folder)

    return change


def data(edit: Callable[[bytes], bytes], name: str = "samples.csv") -> Change:
    return lambda folder: (folder / name).write_bytes(edit((folder / name).read_bytes()))


def linked(to: str) -> Change:
    """The samples moved out of the folder, and a link in their place."""

    def change(folder: Path) -> None:
        (folder / "samples.csv").rename(folder.parent / "elsewhere.csv")
        (folder / "samples.csv").symlink_to(to)

    return change


def folder_for_samples(folder: Path) -> None:
    (folder / "samples.csv").unlink()
    (folder / "samples.csv").mkdir()


def held(*positions: int) -> Change:
    return rows(lambda table, at: table[np.isin(table[:, at["position"]], positions)])


def lost(*positions: int) -> Change:
    return held(*(p for p in range(1, 19) if p not in positions))


def interchanged(a: int, b: int) -> Change:
    """The forces of two positions under each other's name and angles."""

    def edit(held: Array, at: dict[str, int]) -> None:
        here, there = (np.flatnonzero(held[:, at["position"]] == p) for p in (a, b))
        order = np.arange(len(held))
        order[here], order[there] = there, here
        force = [at[name] for name in FORCE]
        held[:, force] = held[order][:, force]

    return rows(edit)


def mis_set(position: int, gimbal: str, degrees: float) -> Change:
    def edit(held: Array, at: dict[str, int]) -> None:
        held[held[:, at["position"]] == position, at[gimbal]] += degrees

    return rows(edit)


def clip(name: str, low: float, high: float) -> Change:
    return column(name, lambda v: np.clip(v, low, high))


# --- refused: the rows ------------------------------------------------------------------------------------------------

GIMBALS = ("platform", "inner", "middle")
RUN_GIMBALS = ("platform", "middle", "outer")
ATTITUDE = ("roll", "pitch", "yaw")
TURN = np.pi / 180
G = 9.80665

ROWS: dict[str, tuple[Path, Change, str]] = {
    **{
        f"{source.name}: {a} and {b} swapped": (
            source,
            swapped(f"accel_{a}", f"accel_{b}"),
            rf"rec/recording.toml: only \d+ of \d+ .* and (18|576) if the accelerometers {a} and {b} are interchanged",
        )
        for source in (DEVICE, STATIC)
        for a, b in ("xy", "xz", "yz")
    },
    **{
        f"{source.name}: reads +g": (source, times(-1, *FORCE), r"every accelerometer has the wrong sign \(f = a - g")
        for source in (DEVICE, STATIC)
    },
    "one sign": (DEVICE, times(-1, "accel_y"),
        "18 if the accelerometer y had the opposite sign; as stated they make a left-handed triad; correct"),
    "gimbals swapped": (DEVICE, swapped("inner", "middle"),
        "18 if the inner and middle angles are interchanged"),
    "radians called degrees": (DEVICE, times(TURN, *GIMBALS),
        'angles look like radians; write unit = "rad" for'),
    "radians called degrees, run": (STATIC, times(TURN, *RUN_GIMBALS),
        "turns by 0.2625. deg/h where the Earth turns by"),
    "one gimbal in radians": (DEVICE, times(TURN, "inner"),
        "18 if the inner angle is in radians; correct"),
    "one gimbal in radians, run": (STATIC, times(TURN, "middle"),
        "576 if the middle angle is in radians; correct"),
    "degrees called radians": (DEVICE, called("rad", "deg", *GIMBALS),
        'rec/samples.csv, column platform: angles up to 180 rad look like degrees; write unit = "deg"'),
    "degrees called radians, run": (STATIC, called("rad", "deg", *RUN_GIMBALS),
        "column middle: angles up to 39.* like deg"),
    "platform in degrees called radians": (STATIC, called("rad", "deg", "platform"),
        "turns by 861.* deg/h where the"),
    "attitude in arcsec called degrees": (STATIC, called("deg", "arcsec", *ATTITUDE),
        "the attitude error in roll reaches 120 deg, read in the unit 'deg'; correct the unit"),
    "g called m/s^2": (DEVICE, times(1 / G, *FORCE),
        r'is 0.999\d m/s\^2 .* look like g: write unit = "g" of its col'),
    "g called m/s^2, run": (STATIC, times(1 / G, *FORCE),
        'the numbers look like g: write unit = "g" of its columns'),
    "m/s^2 called g": (DEVICE, called("g", "m/s^2", *"xyz"),
        r'numbers look like m/s\^2: write unit = "m/s\^2" of its'),
    "one axis in g": (DEVICE, times(1 / G, "accel_x"),
        r"the accelerometer x alone reads 0.102 times .* not 'm/s\^2'"),
    "one axis in g, run": (STATIC, times(1 / G, "accel_z"),
        "the accelerometer z alone reads 0.102 times what the"),
    **{
        f"{source.name}: {name} is dead": (
            source,
            column(name, lambda _: 1.25),
            rf"rec/samples.csv, lines 2 to \d+, column {name}: all (1080|576) rows read 1.25 .*; leave",
        )
        for source, name in (
            (DEVICE, "accel_x"),
            (DEVICE, "accel_z"),
            (STATIC, "accel_y"),
            (STATIC, "roll"),
            (STATIC, "yaw"),
        )
    },
    "a gimbal is dead": (DEVICE, column("inner", lambda _: 0.25),
        r"\(the readout of inner never moves\); check the platform"),
    "the platform gimbal is dead": (STATIC, column("platform", lambda _: 9.0),
        "platform gimbal turns by 0 deg/h where"),
    "dead in one position": (DEVICE, column("accel_x", lambda _: 1.25, 120, 180),
        "lines 122 to 181, column accel_x: all 60"),
    "dead from the middle on": (STATIC, column("accel_x", lambda _: 1.25, 300),
        "lines 302 to 577, column accel_x: all 276"),
    "a readout stops": (STATIC, column("middle", lambda _: 39.989, 300),
        "line 302, column middle: 39.989 deg .* 276 of its"),
    "clipped": (DEVICE, clip("accel_z", -9.0, 9.0),
        r"column accel_z: -?9 m/s\^2 is the (larg|small)est value .*clipped; rai"),
    "clipped a little": (DEVICE, clip("accel_z", -9.7985, 99),
        r"column accel_z: -9.7985 m/s\^2 is the smallest value of t"),
    "clipped, run": (STATIC, clip("accel_x", -6.0, 6.0),
        r"column accel_x: 6 m/s\^2 is the largest value of the channel and"),
    "nothing but NaN": (DEVICE, column("accel_x", lambda _: np.nan),
        "column accel_x: no row has a value; leave the column out of"),
    "mostly NaN": (STATIC, column("middle", lambda _: np.nan, 10, 500),
        "column middle: 490 of 576 rows have no value, .* bring them to common rows"),
    "empty time": (DEVICE, cell(50, "time_s", ""),
        "line 50, column time_s: the value is empty or not a finite number; leave"),
    "empty position": (DEVICE, cell(50, "position", ""),
        "line 50, column position: the value is empty or not a finite"),
    "infinite": (DEVICE, cell(77, "accel_z", "inf"),
        "line 77, column accel_z: the value is empty or not a finite number"),
    "far too large": (DEVICE, cell(77, "accel_z", "1e300"),
        r"line 77, column accel_z: 1e\+300 is beyond anything that can"),
    "spike": (DEVICE, cell(77, "accel_z", "5000"),
        r"line 77, column accel_z: 5000 m/s\^2 is beyond anything that a unit at"),
    "a million turns": (DEVICE, column("inner", lambda _: 1e12, 0, 60),
        r"column inner: angles up to 1e\+12 deg are no readou"),
    "text in a cell": (DEVICE, cell(77, "accel_z", "off"),
        "line 77, column accel_z: 'off' is not a number; write a number"),
    "text in a cell, run": (STATIC, cell(77, "yaw", "OVL"),
        "line 77, column yaw: 'OVL' is not a number; write a number th"),
    "a date for a time": (DEVICE, cell(3, "time_s", "2026-11-21T12:00:00"),
        "line 3, column time_s: '2026-.*' is not a num"),
    "position 1.5": (DEVICE, cell(9, "position", "1.5"),
        "line 9, column position: a position is a whole number, 1, 2, ... o"),
    "position -1": (DEVICE, cell(9, "position", "-1"),
        "line 9, column position: a position is a whole number, .* got -1"),
    "position 1e30": (DEVICE, cell(9, "position", "1e30"),
        r"line 9, column position: a position is .* got 1e\+30"),
    "clock back": (DEVICE, column("time_s", lambda t: t - 3000, 500),
        "line 502, column time_s: the clock jumps back by 2990"),
    "clock back, run": (STATIC, column("time_s", lambda t: t - 3000, 300),
        "line 302, column time_s: the clock jumps back by"),
    "clock stands": (DEVICE, column("time_s", lambda t: t - 10, 77, 78),
        "line 79, column time_s: the clock stands still at 7"),
    "rows doubled": (DEVICE, lines(lambda v: [*v[:20], v[19], *v[20:]]),
        "line 21, column time_s: the clock stands still at"),
    "clock ahead by days, run": (STATIC, column("time_s", lambda t: t + 259200, 300),
        "line 302, .* s, more than a day; corr"),
    "clock ahead, run": (STATIC, column("time_s", lambda t: t + 600, 300),
        "between 89700 s and 90600 s the clock goes on by"),
    "clock ahead in a dwell": (DEVICE, column("time_s", lambda t: t + 5000, 30),
        "line 32, .* forward by 5010 s within one"),
    "time in minutes": (STATIC, times(1 / 60, "time_s"),
        "turns by 902.* deg/h where the Earth turns by 15.041 deg/h; correct"),
    "time in hours": (STATIC, times(1 / 3600, "time_s"),
        "the static run lasts .* s, in which the Earth hardly turns; record"),
    "one row": (DEVICE, lines(lambda v: v[:2]),
        r"holds 1 position \(1\), from which .* cannot be told; hold 6 or more"),
    "one row, run": (STATIC, lines(lambda v: v[:2]),
        "the static run lasts 0 s, in which the Earth hardly turns; record h"),
    "one hour, run": (STATIC, lines(lambda v: v[:14]),
        "the run covers 15.0 deg of the Earth's turn, too little to tell"),
    "two positions": (DEVICE, held(1, 5),
        r"holds 2 positions \(1, 5\), from which the errors of three acceleromet"),
    "never at rest": (DEVICE, column("position", lambda _: 0),
        "has no dwell: every row has position 0, or nothing in it is"),
    "always position 1": (DEVICE, column("position", lambda _: 1),
        "within position 1, from 0 to 11070 s, the force moves by"),
}  # fmt: skip

# --- refused: the files -----------------------------------------------------------------------------------------------

FILES: dict[str, tuple[Path, Change, str]] = {
    "empty file": (DEVICE, data(lambda _: b""),
        "rec/samples.csv is empty; it must hold a line of column names and the rows"),
    "comments only": (DEVICE, data(lambda _: b"# a\n# b\n"),
        "rec/samples.csv is empty; it must hold a line of column"),
    "names only": (DEVICE, lines(lambda v: v[:1]),
        "rec/samples.csv has a line of column names and no rows"),
    "names only, run": (STATIC, lines(lambda v: v[:1]),
        "rec/samples.csv has a line of column names and no rows"),
    "no names": (DEVICE, lines(lambda v: v[1:]),
        "samples.csv, line 1: numbers stand where the column names belong; put th"),
    "a name twice": (DEVICE, lines(lambda v: [v[0] + ",accel_x", *(w + ",0" for w in v[1:])]),
        "two columns are called 'acc"),
    "a row too long": (DEVICE, lines(lambda v: [*v[:40], v[40] + ",7", *v[41:]]),
        "line 41: 10 values where the first line n"),
    "a row of units": (DEVICE, lines(lambda v: [v[0], "s,,m/s^2", *v[1:]]),
        "line 2, column time_s: 's' is not a number; w"),
    "semicolons": (DEVICE, data(lambda b: b.replace(b",", b";")),
        "line 1: separate its columns by commas, not ';', and wri"),
    "decimal commas": (DEVICE, data(lambda b: b.replace(b",", b";").replace(b".", b",")),
        "by commas, not ';', and write de"),
    "tabs": (DEVICE, data(lambda b: b.replace(b",", b"\t")),
        r"line 1: separate its columns by commas, not '\\t', and write"),
    "carriage returns": (DEVICE, data(lambda b: b.replace(b"\n", b"\r")),
        "its lines with a bare carriage return; save it"),
    "UTF-16": (DEVICE, data(lambda b: b.decode().encode("utf-16")),
        "rec/samples.csv is text in UTF-16; save it as UTF-8"),
    "Latin-1": (DEVICE, data(lambda b: b.replace(b",22.", b",22\xb0", 1)),
        "line 2: '22.* is not text in UTF-8; save the fi"),
    "zeros": (DEVICE, data(lambda b: b"\0" * len(b)),
        "is no text file .byte 0 is a zero.; write the rows as CSV in UTF-8"),
    "Parquet cut short": (DEVICE, both(parquet(), data(lambda b: b[:-9], "samples.parquet")),
        "cut short or damaged .* copy"),
    "Parquet, nothing left": (DEVICE, both(parquet(), data(lambda b: b"", "samples.parquet")),
        "cut short or damaged .* co"),
    "Parquet of text": (DEVICE, parquet(lambda f: f.with_columns(accel_x=pl.lit("abc"))),
        "column accel_x: .abc. is not a nu"),
    "Parquet without rows": (DEVICE, parquet(lambda f: f.head(0)),
        "rec/samples.parquet has columns and no rows"),
    "Parquet called CSV": (DEVICE, data(lambda _: b"PAR1\x15\x00"),
        "samples.csv is a Parquet file; call it samples.parquet"),
    "above the folder": (DEVICE, header("samples.csv", "../samples.csv"),
        "line 4: samples = '../samples.csv' leaves the fol"),
    "absolute": (DEVICE, header("samples.csv", "/etc/hosts.csv"),
        "line 4: samples = '/etc/hosts.csv' leaves the folder of"),
    "a link out": (DEVICE, linked("../elsewhere.csv"),
        "line 4: samples = 'samples.csv' leaves the folder of the recording;"),
    "a link to itself": (DEVICE, linked("samples.csv"),
        "line 4: samples = 'samples.csv' is no name of a file here; put"),
    "a link to nothing": (DEVICE, linked("nothing.csv"),
        "line 4: the samples file rec/samples.csv does not exist; put it"),
    "Windows path": (DEVICE, header('"samples.csv"', r"'C:\data\samples.csv'"),
        r"line 4: samples = 'C:.*' is no name of a f"),
    "Windows path in quotes": (DEVICE, header("samples.csv", r"C:\data\samples.csv"),
        "line 4, column 16: Unescaped .* corr"),
    "NUL in a name": (DEVICE, header("samples.csv", r"a\u0000.csv"),
        "line 4: samples = .* is no name of a file here; put th"),
    "an endless name": (DEVICE, header("samples.csv", "a" * 5000 + ".csv"),
        r"line 4: samples = 'a{29}\.\.\.a+.csv' is no na"),
    "a folder for samples": (DEVICE, folder_for_samples,
        "line 4: samples = 'samples.csv' is a folder; write the name of the"),
    "no recording.toml": (DEVICE, lambda f: (f / "recording.toml").unlink(),
        "rec has no recording.toml: a recording is a fo"),
    "empty recording.toml": (DEVICE, data(lambda _: b"", "recording.toml"),
        "rec/recording.toml: format must be 1, got None"),
    "recording.toml in Latin-1": (DEVICE, data(lambda b: b.replace(b"Space", b"Sp\xe4ce"), "recording.toml"),
        "is not UTF-8"),
    "unknown kind": (DEVICE, header("multi-position", "static"),
        "line 2: kind must be one of multi-position, static-run, r"),
    "a rotation": (DEVICE, header("multi-position", "rotation"),
        "is a rotation recording; the three stages take a multi-pos"),
    "latitude 95": (STATIC, header("value = 40.0", "value = 95.0"),
        "line 7: latitude 95"),
    "no latitude": (STATIC, header(r"latitude = .*\n", ""),
        "line 6: a static run needs the latitude, because the Earth turns"),
    "southern latitude": (STATIC, header("value = 40.0", "value = -40.0"),
        r"lies at 40 deg to .* says -40 deg; correct the l"),
    "latitude in radians": (STATIC, header("value = 40.0", "value = 0.698"),
        "says 0.698 deg; correct the latitude, its sign o"),
    "endless latitude": (DEVICE, header("value = 40.0", "value = " + "9" * 400),
        r"recording.toml: site.latitude.value is a whole number of more than 64 bits, which TOML does not have"),
    "negative gravity": (DEVICE, header("value = 9.8", "value = -9.8"),
        r"line 9: gravity -9.80\d* m/s\^2 is not found on the"),
    "gravity 98": (DEVICE, header("value = 9.8015", "value = 98.015"),
        r"line 9: gravity 98.01\d* m/s\^2 is not found on the"),
    "in orbit": (DEVICE, header("value = 60.0", "value = 4e5"),
        "line 8: height 400000.0 m is no place for a rig; give it"),
    "no noise at all": (DEVICE, header(r"value = 9.80664\d*e-05", "value = 1e-30"),
        "a noise of 1e-30 .* less than any instr"),
    "unknown unit": (DEVICE, unit("x", "m/s^2", ', unit = "m/s2"'),
        r"line 21, column 'accel_x': the unit 'm/s2' is not know"),
    "no unit": (DEVICE, unit("x", "m/s^2", ""),
        "line 21: column 'accel_x' has no unit; write, for example, unit ="),
    "unit of something else": (DEVICE, unit("inner", "deg", ', unit = "g"'),
        "line 25, column 'inner': 'g' is not a unit of"),
    "no accel_y": (DEVICE, without("accel_y"),
        r"has no specific_force along y: add the column to \[columns\] of its rec"),
    "no accel_y in the file": (DEVICE, lines(lambda v: [v[0].replace("accel_y", "a_y"), *v[1:]]),
        "has no column 'accel_y', w"),
    "no angles": (DEVICE, without(*GIMBALS),
        "has no gimbal_angle column, .* with --method multiposition"),
    "no inner angle": (DEVICE, without("inner"),
        "the inner angle is in no column and taken as zero"),
    "no time": (DEVICE, without("time_s"),
        r"line 18: no column is the time; write time_s = \{ quantity = .time., unit"),
    "no columns": (DEVICE, header(r"(?s)\[columns\].*", ""),
        "rec/recording.toml: no column is the time; write time_s ="),
}  # fmt: skip


@pytest.mark.parametrize("fault", [*ROWS, *FILES])
def test_a_fault_is_one_sentence_and_nothing_is_written(run: Run, tmp_path: Path, fault: str) -> None:
    source, change, sentence = (ROWS | FILES)[fault]
    folder = copy(source, tmp_path / "rec", change)
    before = sorted(tmp_path.rglob("*"))
    status, out, err = run("calibrate", folder, "--out", tmp_path / "out", "--quiet", "--json")
    err = err.replace(f"{tmp_path}/", "")
    assert status == 2, err
    assert re.search(sentence, err), err
    assert err.startswith("gimbalcal: ")
    assert err.endswith("\n")
    assert err.count("\n") == 1
    assert len(err) < 700  # a screen, not a dump of the file
    assert out == ""
    assert sorted(tmp_path.rglob("*")) == before


# --- refused: the command line ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["calibrate"], "Missing argument 'RECORDINGS...'; see `gimbalcal calibrate --help`"),
        (["frobnicate"], "No such command 'frobnicate'; see `gimbalcal --help`"),
        (["calibrate", DEVICE, "--method", "magic"], "'magic' is not one of 'three-stage', "),
        (["calibrate", DEVICE, "--frobnicate"], "No such option"),
        (["design", "-n", "0"], "0 is not in the range x>=1; see `gimbalcal design --help`"),
        (["campaign", "wu2018-18", "-n", "-3"], "-3 is not in the range 1<=x<=10000000"),
        (["simulate", "demo", "--seed", "-1"], "-1 is not in the range x>=0"),
        (["calibrate", DEVICE, "--terms", "nonsense"], "--terms nonsense goes with --method multiposition"),
        (
            ["calibrate", DEVICE, "--method", "multiposition", "--terms", "nonsense"],
            "--terms names 'nonsense', which is not",
        ),
        (["calibrate", STATIC, "--method", "multiposition"], "holds 1 rest position for 9 parameters ("),
        (["calibrate", DATA / "README.md"], "README.md is not a folder: a recording is a folder with a recording.toml"),
        (
            ["calibrate", DEVICE / "samples.csv"],
            "samples.csv is not a folder: a recording is a folder with a recording.tom",
        ),
        (
            ["calibrate", DATA],
            "data has no recording.toml: a recording is a folder with a recording.toml that says what",
        ),
        (["calibrate", DEVICE, DEVICE], "are both multi-position recordings; give one of each kind"),
        (["diagnose", DATA / "README.md"], "README.md is not a folder: a recording is a folder with a recording.toml"),
        (
            ["diagnose", DEVICE, "--calibration", "nowhere.json"],
            "there is no nowhere.json; give a calibration.json that",
        ),
        (["diagnose", DEVICE, "--calibration", DATA / "README.md"], "README.md is not a calibration.json written by"),
        (["diagnose", DEVICE, "--baseline", "nonsense"], "the baseline names 'nonsense', which is no effect"),
        (["diagnose", DEVICE, "--seed", "one"], "'one' is not a valid integer"),
    ],
)
def test_a_slip_on_the_command_line(run: Run, tmp_path: Path, arguments: list[object], sentence: str) -> None:
    extra = [] if arguments in (["calibrate"], ["frobnicate"]) else ["--out", tmp_path / "out", "--quiet"]
    status, out, err = run(*arguments, *extra)
    assert status == 2
    assert sentence in err
    assert err.startswith("gimbalcal: ")
    assert (err.count("\n"), out) == (1, "")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("below", ["", "below", "far/below"])
def test_results_do_not_go_into_a_file(run: Run, tmp_path: Path, below: str) -> None:
    (tmp_path / "file").write_text("mine")
    status, _, err = run("calibrate", DEVICE, "--out", tmp_path / "file" / below)
    assert status == 2
    why = f"cannot be a folder, because {tmp_path / 'file'} is a file; give another name"
    assert err == f"gimbalcal: --out {tmp_path / 'file' / below} {why}\n"
    assert (tmp_path / "file").read_text() == "mine"


def test_results_do_not_go_where_nobody_may_write(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "access", lambda *_: False)  # root, who runs tests in containers, may write anywhere
    status, _, err = run("calibrate", DEVICE, "--out", tmp_path / "out")
    assert (status, err.count("\n")) == (2, 1)
    assert f"{tmp_path} does not permit it; give another folder" in err


def test_a_disk_that_fails_is_a_sentence(run: Run, tmp_path: Path) -> None:
    (tmp_path / "out" / "calibration.json").mkdir(parents=True)
    status, _, err = run("calibrate", DEVICE, "--out", tmp_path / "out", "--overwrite", "--quiet")
    assert status == 2
    assert "calibration.json" in err
    assert "cannot be read or written" in err
    assert err.count("\n") == 1
    assert [p.name for p in (tmp_path / "out").iterdir()] == ["calibration.json"]  # no temporary file either


def test_an_earlier_result_outlives_a_failed_run(run: Run, tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.mkdir()
    (out / "calibration.json").write_text("earlier")
    folder = copy(DEVICE, tmp_path / "rec", cell(500, "accel_z", "off"))
    assert run("calibrate", folder, "--out", out)[0] == 2
    assert [(p.name, p.read_text()) for p in out.iterdir()] == [("calibration.json", "earlier")]


def test_ctrl_c_in_the_middle_leaves_nothing(tmp_path: Path) -> None:
    """A real process, a real signal, sent once the first stage has been announced."""
    program = [sys.executable, "-m", "gimbalcal", "calibrate", str(DEVICE), str(STATIC), "--out", str(tmp_path / "out")]
    with subprocess.Popen(program, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        said: list[str] = []
        while "stage 1" not in "".join(said):
            said.append(process.stderr.readline())
            assert said[-1], "".join(said)
        time.sleep(0.05)
        process.send_signal(signal.SIGINT)
        rest = process.stderr.read()
        # struck while a module is being made, the interpreter ends itself by the signal; a shell calls both 130
        assert process.wait(timeout=30) in (130, -signal.SIGINT)
    assert rest.splitlines()[-1] == "gimbalcal: interrupted; nothing half-written is left behind"
    assert "Traceback" not in rest
    assert not list(tmp_path.iterdir())


# --- odd, and not wrong -----------------------------------------------------------------------------------------------


def backwards(held: Array, at: dict[str, int]) -> Array:
    """The positions visited from 18 down to 1."""
    parts, begin = [], 0.0
    for position in range(18, 0, -1):
        part = held[held[:, at["position"]] == position]
        part[:, at["time_s"]] += begin - part[0, at["time_s"]]
        begin = part[-1, at["time_s"]] + 40.0
        parts.append(part)
    return np.concatenate(parts)


def again(held: Array, at: dict[str, int]) -> Array:
    """Position 4 once more at the end."""
    part = held[held[:, at["position"]] == 4]
    part[:, at["time_s"]] += held[-1, at["time_s"]] + 60.0 - part[0, at["time_s"]]
    return np.concatenate([held, part])


def with_moves(held: Array, at: dict[str, int]) -> Array:
    """Three hundred rows of motion, position 0, between the dwells, logged faster than at rest."""
    rng = np.random.default_rng(1)
    parts = []
    for position in range(1, 19):
        parts.append(held[held[:, at["position"]] == position])
        after = held[held[:, at["position"]] == position + 1]
        if len(after):
            moving = np.linspace(parts[-1][-1], after[0], 302)[1:-1]
            moving[:, at["position"]] = 0
            moving[:, [at[name] for name in FORCE]] += 0.5 * rng.standard_normal((300, 3))
            parts.append(moving)
    return np.concatenate(parts)


def as_text(form: Callable[[float], str]) -> Change:
    return lambda folder: put(folder, *table(folder), form)


def whole(value: float) -> str:
    return str(int(value)) if value == int(value) else repr(value)


def integers(frame: pl.DataFrame) -> pl.DataFrame:
    """Column types as a logger has them."""
    angles = [pl.col(name).round().cast(pl.Int32) for name in GIMBALS]
    return frame.with_columns(pl.col("position").cast(pl.UInt8), pl.col("time_s").cast(pl.Int64), *angles)


def dated(text: list[str]) -> list[str]:
    """The clock as a logger in another zone writes it, whole seconds without a fraction."""
    at = text[0].split(",").index("time_s")
    zero = datetime(2026, 11, 18, 23, 59, 50, tzinfo=timezone(timedelta(hours=-9.5)))
    cells = [line.split(",") for line in text[1:]]
    for row in cells:
        row[at] = (zero + timedelta(seconds=float(row[at]))).isoformat()
    return [text[0], *(",".join(row) for row in cells)]


def by_number(folder: Path) -> None:
    """`recording.toml` calls the columns by number."""
    names = (DEVICE / "samples.csv").read_text().partition("\n")[0].split(",")
    for i, name in enumerate(names, start=1):
        header(rf"(?m)^{name}\s*=", f"{i} =")(folder)


def windows(folder: Path) -> None:
    for name in ("recording.toml", "samples.csv"):
        data(lambda b: b"\xef\xbb\xbf" + b.replace(b"\n", b"\r\n"), name)(folder)


SAME: dict[str, Change] = {
    "byte order mark and CRLF": windows,
    "integers where they are whole": as_text(whole),
    "scientific notation": as_text(lambda value: f"{value:.16E}"),
    "quoted numbers": lines(lambda v: [v[0], *(",".join(f'"{c}"' for c in line.split(",")) for line in v[1:])]),
    "an unknown column of text": lines(lambda v: [v[0] + ",remark", *(line + ",all is well" for line in v[1:])]),
    "blank lines at the end": lines(lambda v: [*v, "", ""]),
    "a clock from 1970 on": column("time_s", lambda t: t + 1.7e9),
    "a clock before zero": column("time_s", lambda t: t - 1e6),
    "moves between the dwells": rows(with_moves),
    "positions backwards": rows(backwards),
    "blanks around names and numbers": lines(lambda v: [w.replace(",", " , ") for w in v]),
    "a row without a value": lines(lambda v: [*v[:40], ",".join([*v[40].split(",")[:3], ""]), *v[40:]]),
    "dates for a clock": lines(dated),
    "a line of numbers for the names": both(data(lambda b: b.partition(b"\n")[2]), by_number),
    "a pause of three days": column("time_s", lambda t: t + 259200, 540),
    "Parquet of dates": parquet(lambda f: f.with_columns(time_s=pl.from_epoch(pl.col("time_s").cast(pl.Int64)))),
    "Parquet": parquet(),
    "Parquet of integers": parquet(integers),
    "no temperature": without("temperature"),
    "no latitude": header(r"latitude = .*\n", ""),
    "angles in radians": both(times(TURN, *GIMBALS), called("rad", "deg", *GIMBALS)),
    "force in g": both(times(1 / G, *FORCE), called("g", "m/s^2", *"xyz")),
}


@pytest.fixture(scope="module")
def reference() -> dict[tuple[str, str], dict[str, Any]]:
    """The parameters of the untouched recording."""
    return by_label(calibrate([DEVICE])[0].to_dict())


def by_label(content: dict[str, Any]) -> dict[tuple[str, str], dict[str, Any]]:
    return {(p["name"], p["axis"]): p for p in content["parameters"]}


@pytest.mark.parametrize("oddity", SAME)
def test_what_looks_odd_changes_nothing(
    run: Run, tmp_path: Path, reference: dict[tuple[str, str], dict[str, Any]], oddity: str
) -> None:
    status, out, err = run("calibrate", copy(DEVICE, tmp_path / "rec", SAME[oddity]), "--quiet", "--json")
    assert (status, err) == (0, ""), err
    made = by_label(json.loads(out))
    assert made.keys() == reference.keys()
    for label, parameter in reference.items():
        # rounding only: 1e-9 m/s^2 of 1e-4 m/s^2 noise; integers and sums over other blocks keep far within
        assert made[label]["value"] == pytest.approx(parameter["value"], abs=1e-4 * parameter["sigma"]), label
        assert made[label]["sigma"] == pytest.approx(parameter["sigma"], rel=1e-4), label


@pytest.mark.parametrize(
    ("change", "seen", "lost"),
    [
        (lost(4), 17, "position 4 of schedule wu2018-18 missing: sigma grows most for bias:x by 1.1"),
        (lost(4, 10, 15), 17, "positions 4, 10, 15 of schedule wu2018-18 missing: sigma grows most for scale_factor:x"),
        (lost(1, 2), 17, "positions 1, 2 of schedule wu2018-18 missing: sigma grows most for scale_factor:z by 1.6"),
        (rows(again), 17, ""),
        (held(1, 2, 3, 4, 5, 6), 15, "2 further directions not seen at all"),
    ],
)
def test_what_positions_are_left_still_calibrates(
    run: Run, tmp_path: Path, reference: dict[tuple[str, str], dict[str, Any]], change: Change, seen: int, lost: str
) -> None:
    status, out, _ = run("calibrate", copy(DEVICE, tmp_path / "rec", change), "--quiet", "--json")
    content = json.loads(out)
    assert (status, content["outcome"]) == (0, "")
    assert lost in content["provenance"].get("lost", "")
    assert bool(lost) == ("lost" in content["provenance"])
    made = by_label(content)
    assert len(made) - len(content["unobservable"]) == seen
    for label, parameter in reference.items():
        # the same noise less some rows: five sigma of the poorer result is generous for the correlated difference
        sigma = max(made[label]["sigma"], parameter["sigma"])
        assert abs(made[label]["value"] - parameter["value"]) < 5 * sigma, label


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (interchanged(4, 10), "Positions 4 and 10 are interchanged"),
        (mis_set(7, "inner", 3 / 60), "Position 7 is mis-set: its force is 18"),
        (mis_set(7, "inner", 2.0), "Position 7 is mis-set: its force is 2 deg off"),
        (mis_set(12, "middle", -2.0), "Position 12 is mis-set: its force is 2 deg off"),
    ],
)
def test_a_wrong_position_is_named_and_left_out(
    run: Run, tmp_path: Path, reference: dict[tuple[str, str], dict[str, Any]], change: Change, words: str
) -> None:
    status, out, err = run("calibrate", copy(DEVICE, tmp_path / "rec", change), "--quiet", "--json")
    content = json.loads(out)
    assert (status, err) == (1, "")
    assert content["outcome"].startswith(words)
    assert "left out of the fit" in content["outcome"]
    made = by_label(content)
    for label, parameter in reference.items():
        # nothing of the fault has leaked in: 2 deg are 7200 sigma of a setting
        sigma = max(made[label]["sigma"], parameter["sigma"])
        assert abs(made[label]["value"] - parameter["value"]) < 5 * sigma, label


def test_an_odd_gravity_is_remarked(run: Run, tmp_path: Path) -> None:
    folder = copy(DEVICE, tmp_path / "rec", header("value = 9.8015", "value = 9.7515"))
    status, out, _ = run("calibrate", folder, "--quiet", "--json")
    assert status == 0
    content = json.loads(out)
    (remark,) = content["provenance"]["remarks"]
    assert "line 9: gravity 9.75151 m/s^2 is -5101 ppm off the 9.80" in remark
    sigmas = [p["sigma"] for p in content["parameters"] if p["name"] == "scale_factor"]
    assert min(sigmas) == pytest.approx(5101, rel=1e-3)  # nobody says that it was measured


# --- symmetries -------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def device() -> Recording:
    return load([DEVICE])[0]


def calibrated(recording: Recording, folder: Path) -> tuple[Array, Array]:
    """Values and sigmas, in SI, by way of the disk."""
    made = calibrate([write(recording, folder)])[0]
    return values(made.effects, made.parameters), np.sqrt(np.diag(made.covariance))


SLOW = settings(max_examples=5, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


@SLOW
@given(seed=st.integers(0, 2**32 - 1))
def test_the_order_of_rows_in_a_dwell_does_not_matter(tmp_path: Path, device: Recording, seed: int) -> None:
    rng = np.random.default_rng(seed)
    order = np.concatenate([d.start + rng.permutation(d.stop - d.start) for d in dwells(device)])
    mixed = replace(device, channels={key: v[order] for key, v in device.channels.items()})
    (x, sigma), (y, _) = (calibrated(r, tmp_path / n) for r, n in ((device, "ordered"), (mixed, "mixed")))
    # sums of 60 rows in another order: 1e-15 of 9.8 m/s^2, and the noise, stated, is 1e-4 m/s^2
    np.testing.assert_allclose(y, x, rtol=0, atol=1e-6 * sigma.min())


@SLOW
@given(shift=st.integers(-(10**9), 10**9))
def test_the_origin_of_time_does_not_matter(tmp_path: Path, device: Recording, shift: int) -> None:
    later = replace(device, time=device.time + shift)
    (x, sigma), (y, _) = (calibrated(r, tmp_path / n) for r, n in ((device, "now"), (later, "then")))
    np.testing.assert_array_less(np.abs(y - x), 1e-9 * sigma)


@SLOW
@given(samples=st.sampled_from(["samples.csv", "samples.parquet"]), seed=st.integers(0, 2**32 - 1))
def test_written_and_read_again_is_the_same(tmp_path: Path, device: Recording, samples: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    some = device.select(
        np.sort(rng.choice(len(device.time), 600, replace=False))
    )  # fewer may leave a gap that is refused
    back = read(write(some, tmp_path / f"{seed}", samples))
    assert (back.kind, back.title, back.platform) == (some.kind, some.title, some.platform)
    np.testing.assert_array_equal(back.time, some.time)
    np.testing.assert_array_equal(back.position, some.position)
    assert back.channels.keys() == some.channels.keys()
    for key, held_values in some.channels.items():
        np.testing.assert_allclose(back.channels[key], held_values, rtol=4e-16, atol=0)  # deg and back: two roundings
