"""`schedule.toml`: a schedule as a file that `design` writes, `observe` reads and a scenario can take over.

Its [platform] and [schedule] tables are those of a scenario: angles in degrees by axis, one line per hold.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from gimbalcal.errors import InputError, amount
from gimbalcal.platform import KNOWN, Platform
from gimbalcal.recording.document import Document
from gimbalcal.schedule import SCHEDULES, Hold, Schedule


def schedule_toml(schedule: Schedule) -> str:
    """The text of schedule.toml. Angles are written to 1e-9 degrees, so that reading gives them back to 2e-11 rad."""
    names = schedule.platform.axis_names
    # one duration for all holds, as a scenario has it; designs and published schedules hold no other
    seconds = schedule.holds[0].duration if schedule.holds else 0.0
    lines = [
        f"# {amount(len(schedule.holds), 'hold')}; angles in degrees",
        "format = 1",
        f'title = "{schedule.name}"',
        "",
        "[platform]",
        f'name = "{schedule.platform.name}"',
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
    """A published schedule by its name, or the one in a schedule.toml. Raises InputError, naming file and line."""
    path = Path(name)
    if str(name) in SCHEDULES:
        return SCHEDULES[str(name)]
    if not path.is_file():
        raise InputError(f"{name} is no file and no published schedule; those are {', '.join(SCHEDULES)}")
    document = Document(path)
    platform = _platform(document)
    table = document.table("schedule")
    document.only("schedule", ("dwell", "slew_rate", "holds"), table)
    holds = table.get("holds")
    if not isinstance(holds, list) or not holds:
        raise InputError(f"{document.where('schedule')}: a schedule needs [[schedule.holds]], one for each position")
    duration = _number(document, table, "dwell", "time", 600.0)
    made = tuple(_hold(document, platform, i, hold, duration) for i, hold in enumerate(holds, start=1))
    rate = _number(document, table, "slew_rate", "angular_rate", float(np.deg2rad(6.0)))
    return Schedule(str(document.content.get("title", path.stem)), platform, made, rate)


def _platform(document: Document) -> Platform:
    name = document.table("platform").get("name", "space-stable")
    if name not in KNOWN:
        where = document.where("platform", "name")
        raise InputError(f"{where}: no platform is called {name!r}; known are {', '.join(KNOWN)}")
    return KNOWN[name]


def _number(document: Document, table: dict[str, Any], key: str, quantity: str, default: float) -> float:
    return document.number("schedule", key, table[key], quantity) if key in table else default


def _hold(document: Document, platform: Platform, number: int, hold: Any, duration: float) -> Hold:
    names = platform.axis_names
    unknown = [k for k in hold if k not in names]
    if unknown:
        raise InputError(
            f"{document.where('schedule.holds')}: hold {number} turns {unknown[0]!r}, which the platform "
            f"{platform.name!r} does not have; its axes are {', '.join(names)}"
        )
    values = [hold.get(name, 0.0) for name in names]
    bad = [v for v in values if isinstance(v, bool) or not isinstance(v, int | float) or not np.isfinite(v)]
    if bad:
        raise InputError(f"{document.where('schedule.holds')}: hold {number} has the angle {bad[0]!r}; give degrees")
    return Hold(tuple(float(np.deg2rad(v)) for v in values), duration)
