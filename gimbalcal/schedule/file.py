"""`schedule.toml`: a schedule as a file that `design` writes, `observe` reads and a scenario can take over.

Of positions, its [platform] and [schedule] tables are those of a scenario: angles in degrees by axis, one line per
hold. With ``kind = "rotation"`` it holds the start, the rate, ramp and stop, and [[moves]], each number with its unit.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from gimbalcal.effects.effect import TRIAD
from gimbalcal.errors import InputError, list_of_alternatives, number_of, shortened_text
from gimbalcal.platform import KNOWN, Platform
from gimbalcal.recording.document import MAX_STATED_NUMBER, Document
from gimbalcal.recording.header import platform_of
from gimbalcal.recording.writing import platform_toml, toml_text
from gimbalcal.schedule.commands import DIRECTIONS, TABLE, Hold, Move, RotationSchedule, Schedule
from gimbalcal.schedule.published import ROTATIONS, SCHEDULES
from gimbalcal.units import from_si


def schedule_toml(schedule: Schedule) -> str:
    """Return the text of schedule.toml, angles to 1e-9 deg, so that reading gives them back to 2e-11 rad."""
    names = schedule.platform.axis_names
    # one duration for all holds, as a scenario has it; designs and published schedules hold no other
    seconds = schedule.holds[0].duration if schedule.holds else 0.0
    lines = [
        f"# {number_of(len(schedule.holds), 'hold')}; angles in degrees",
        "format = 1",
        f"title = {toml_text(schedule.name)}",
        "",
        *platform_toml(schedule.platform),
        "",
        "[schedule]",
        f'dwell = {{ value = {seconds!r}, unit = "s" }}',
        f'slew_rate = {{ value = {round(float(np.rad2deg(schedule.slew_rate)), 9)!r}, unit = "deg/s" }}',
    ]
    for hold in schedule.holds:
        lines += ["", "[[schedule.holds]]"]
        degrees = (round(float(np.rad2deg(a)), 9) + 0.0 for a in hold.angles)
        lines += [f"{name} = {angle!r}" for name, angle in zip(names, degrees, strict=True)]
    return "\n".join(lines) + "\n"


def read_schedule(name: str | Path) -> Schedule:
    """Return a published schedule by its name, or that of a schedule.toml. Raises InputError, naming file and line."""
    path = Path(name)
    if str(name) in SCHEDULES:
        return SCHEDULES[str(name)]
    if is_rotation(name):
        raise InputError(f"{name} is a schedule of turns, and one of positions is wanted here")
    document = _document(path)
    platform = _platform(document)
    table = document.table("schedule")
    document.only("schedule", ("dwell", "slew_rate", "holds"), table)
    holds = table.get("holds")
    if not holds:
        raise InputError(f"{document.where('schedule')}: a schedule needs [[schedule.holds]], one for each position")
    holds = document.tables("schedule.holds", holds)
    duration = _number(document, table, "dwell", "time", 600.0)
    read_holds = tuple(_hold(document, platform, i, hold, duration) for i, hold in enumerate(holds, start=1))
    rate = _number(document, table, "slew_rate", "angular_rate", float(np.deg2rad(6.0)))
    return Schedule(document.text("title", path.stem), platform, read_holds, rate)


def _document(path: Path) -> Document:
    if not path.is_file():
        known = ", ".join([*SCHEDULES, *ROTATIONS])
        raise InputError(f"{path} is no file and no published schedule; those are {known}")
    return Document(path)


def is_rotation(name: str | Path) -> bool:
    """Return whether a published name or a file is a schedule of turns and stops, not of positions."""
    if str(name) in ROTATIONS:
        return True
    if str(name) in SCHEDULES or not Path(name).is_file():
        return False
    return bool(Document(Path(name)).content.get("kind") == "rotation")


def rotation_toml(schedule: RotationSchedule) -> str:
    """Return the text of a schedule.toml of kind rotation; angles and rates are written to 1e-9 deg."""

    def number(value: float, unit: str) -> str:
        return f'{{ value = {round(float(from_si(value, unit)), 9) + 0.0!r}, unit = "{unit}" }}'

    x, y, z = schedule.start
    lines = ["format = 1", 'kind = "rotation"', f"title = {toml_text(schedule.name)}"]
    lines += [f'start = {{ x = "{x}", y = "{y}", z = "{z}" }}', f"rate = {number(schedule.rate, 'deg/s')}"]
    lines += [f"ramp = {number(schedule.ramp, 's')}", f"stop = {number(schedule.stop, 's')}"]
    lines += [f'outer = "{schedule.outer}"'] if schedule.outer else []
    lines += [f'inner = "{schedule.inner}"'] if schedule.inner != "z" else []
    for move in schedule.moves:
        lines += ["", "[[moves]]", f'axis = "{move.axis}"', f"angle = {number(move.angle, 'deg')}"]
        lines += [f"rate = {number(move.rate, 'deg/s')}"] if move.rate is not None else []
        lines += [f"stop = {number(move.stop, 's')}"] if move.stop is not None else []
    return "\n".join(lines) + "\n"


def read_rotation(name: str | Path) -> RotationSchedule:
    """Return a published schedule of turns by name, or that of a schedule.toml. Raises InputError, naming the line."""
    if str(name) in ROTATIONS:
        return ROTATIONS[str(name)]
    document = _document(Path(name))
    content = document.content
    document.only("", ("format", "kind", "title", "start", "rate", "ramp", "stop", "outer", "inner", "moves"), content)
    if content.get("kind") != "rotation":
        raise InputError(f'{name}: a schedule of turns says kind = "rotation"')
    if not content.get("moves"):
        raise InputError(f"{name}: a schedule of turns needs [[moves]], one for each turn")
    rate = _above_zero(document, "", "rate", content, "angular_rate", float(np.deg2rad(10.0)))
    entries = document.tables("moves", content["moves"])
    moves = tuple(_move(document, i, entry) for i, entry in enumerate(entries, start=1))
    inner, outer = content.get("inner", "z"), content.get("outer", "")
    if inner not in TRIAD or (outer and outer not in [*DIRECTIONS]):
        raise InputError(
            f"{document.where('', 'outer' if inner in TRIAD else 'inner')}: inner is x, y or z of the unit, and outer "
            f"one of {list_of_alternatives(list(DIRECTIONS))}"
        )
    ramp = _number(document, content, "ramp", "time", 1.0, "")
    stop = _above_zero(document, "", "stop", content, "time", 100.0)
    if ramp < 0:
        raise InputError(f"{document.where('', 'ramp')}: the ramp takes time, got {ramp:g} s; write 0 s for none")
    title = document.text("title", Path(name).stem)
    start = _start(document, content.get("start", {}))
    try:
        return RotationSchedule(title, start, moves, rate, ramp, stop, outer, inner)
    except ValueError as error:
        raise InputError(f"{document.where('', 'start')}: {error}") from None


def _start(document: Document, entry: Any) -> tuple[str, str, str]:
    where = document.where("", "start")
    if not isinstance(entry, dict) or set(entry) != set(TRIAD):
        raise InputError(f'{where}: say where the axes point, start = {{ x = "east", y = "north", z = "up" }}')
    for axis in TRIAD:
        if entry[axis] not in [*DIRECTIONS]:
            raise InputError(
                f"{where}: {axis} points to {entry[axis]!r}; write {list_of_alternatives(list(DIRECTIONS))}"
            )
    return (str(entry["x"]), str(entry["y"]), str(entry["z"]))


def _move(document: Document, number: int, entry: Any) -> Move:
    where = f"{document.where('moves')}, move {number}"
    document.only("moves", ("axis", "angle", "rate", "stop"), entry)
    if entry.get("axis") not in (*TRIAD, *TABLE):
        raise InputError(f"{where}: the axis is {list_of_alternatives([*TRIAD, *TABLE])}, got {entry.get('axis')!r}")
    if "angle" not in entry:
        raise InputError(f'{where}: write how far it turns, angle = {{ value = 90, unit = "deg" }}')
    angle = document.number("moves", "angle", entry["angle"], "angle")
    if angle == 0.0:
        raise InputError(f"{where}: a turn by nothing; leave it out, or write its angle")
    rate = _above_zero(document, "moves", "rate", entry, "angular_rate", 0.0) or None
    stop = _number(document, entry, "stop", "time", 0.0, "moves") if "stop" in entry else None
    if stop is not None and stop < 0:
        raise InputError(f"{where}: a stop takes time, got {stop:g} s")
    return Move(entry["axis"], angle, rate, stop)


def _above_zero(
    document: Document, table: str, key: str, content: dict[str, Any], quantity: str, default: float
) -> float:
    value = _number(document, content, key, quantity, default, table)
    if key in content and not value > 0:
        raise InputError(f"{document.where(table, key)}: {key} must be above zero, got {value:g} in SI")
    return value


def _platform(document: Document) -> Platform:
    if "axes" in document.table("platform"):
        return platform_of(document, stabilised=False)
    name = document.table("platform").get("name", "space-stable")
    if not isinstance(name, str) or name not in KNOWN:
        where = document.where("platform", "name")
        known = ", ".join(KNOWN)
        raise InputError(f"{where}: no platform is called {name!r}; known are {known}, or spell its axes out")
    return KNOWN[name]


def _number(
    document: Document, table: dict[str, Any], key: str, quantity: str, default: float, heading: str = "schedule"
) -> float:
    return document.number(heading, key, table[key], quantity) if key in table else default


def _hold(document: Document, platform: Platform, number: int, hold: Any, duration: float) -> Hold:
    names = platform.axis_names
    unknown = [k for k in hold if k not in names]
    if unknown:
        raise InputError(
            f"{document.where('schedule.holds')}: hold {number} turns {unknown[0]!r}, which the platform "
            f"{platform.name!r} does not have; its axes are {', '.join(names)}"
        )
    values = [hold.get(name, 0.0) for name in names]
    bad = [v for v in values if isinstance(v, bool) or not isinstance(v, int | float) or not abs(v) < MAX_STATED_NUMBER]
    if bad:
        raise InputError(
            f"{document.where('schedule.holds')}: hold {number} has the angle {shortened_text(repr(bad[0]))}; give "
            "degrees"
        )
    return Hold(tuple(float(np.deg2rad(float(v))) for v in values), duration)
