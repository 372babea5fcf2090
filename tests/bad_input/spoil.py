"""Ways to spoil a copy of a recording that ships with the project."""

import re
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import polars as pl

from gimbalcal.number import Array

FORCE = ("accel_x", "accel_y", "accel_z")
GIMBALS = ("platform", "inner", "middle")
TURN = np.pi / 180
G = 9.80665
Change = Callable[[Path], object]
"""Spoils the recording in a folder."""


def copy(source: Path, folder: Path, change: Change | None = None) -> Path:
    folder.mkdir(parents=True)
    for name in ("recording.toml", "samples.csv"):
        shutil.copy(source / name, folder / name)
    if change:
        change(folder)
    return folder


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
