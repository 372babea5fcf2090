"""Faults of the rows."""

from pathlib import Path

import numpy as np

from tests.bad_input.spoil import (
    FORCE,
    GIMBALS,
    TURN,
    Change,
    G,
    called,
    cell,
    clip,
    column,
    held,
    lines,
    swapped,
    times,
)
from tests.paths import DEVICE, STATIC

RUN_GIMBALS = ("platform", "middle", "outer")
ATTITUDE = ("roll", "pitch", "yaw")

ROWS: dict[str, tuple[Path, Change]] = {
    **{
        f"{source.name}: {a} and {b} swapped": (source, swapped(f"accel_{a}", f"accel_{b}"))
        for source in (DEVICE, STATIC)
        for a, b in ("xy", "xz", "yz")
    },
    **{f"{source.name}: reads +g": (source, times(-1, *FORCE)) for source in (DEVICE, STATIC)},
    "one sign": (DEVICE, times(-1, "accel_y")),
    "gimbals swapped": (DEVICE, swapped("inner", "middle")),
    "radians called degrees": (DEVICE, times(TURN, *GIMBALS)),
    "radians called degrees, run": (STATIC, times(TURN, *RUN_GIMBALS)),
    "one gimbal in radians": (DEVICE, times(TURN, "inner")),
    "one gimbal in radians, run": (STATIC, times(TURN, "middle")),
    "degrees called radians": (DEVICE, called("rad", "deg", *GIMBALS)),
    "degrees called radians, run": (STATIC, called("rad", "deg", *RUN_GIMBALS)),
    "platform in degrees called radians": (STATIC, called("rad", "deg", "platform")),
    "attitude in arcsec called degrees": (STATIC, called("deg", "arcsec", *ATTITUDE)),
    "g called m/s^2": (DEVICE, times(1 / G, *FORCE)),
    "g called m/s^2, run": (STATIC, times(1 / G, *FORCE)),
    "m/s^2 called g": (DEVICE, called("g", "m/s^2", *"xyz")),
    "one axis in g": (DEVICE, times(1 / G, "accel_x")),
    "one axis in g, run": (STATIC, times(1 / G, "accel_z")),
    **{
        f"{source.name}: {name} is dead": (source, column(name, lambda _: 1.25))
        for source, names in ((DEVICE, ("accel_x", "accel_z")), (STATIC, ("accel_y", "roll", "yaw")))
        for name in names
    },
    "a gimbal is dead": (DEVICE, column("inner", lambda _: 0.25)),
    "the platform gimbal is dead": (STATIC, column("platform", lambda _: 9.0)),
    "dead in one position": (DEVICE, column("accel_x", lambda _: 1.25, 120, 180)),
    "dead from the middle on": (STATIC, column("accel_x", lambda _: 1.25, 300)),
    "a readout stops": (STATIC, column("middle", lambda _: 39.989, 300)),
    "clipped": (DEVICE, clip("accel_z", -9.0, 9.0)),
    "clipped a little": (DEVICE, clip("accel_z", -9.7985, 99)),
    "clipped, run": (STATIC, clip("accel_x", -6.0, 6.0)),
    "nothing but NaN": (DEVICE, column("accel_x", lambda _: np.nan)),
    "mostly NaN": (STATIC, column("middle", lambda _: np.nan, 10, 500)),
    "empty time": (DEVICE, cell(50, "time_s", "")),
    "empty position": (DEVICE, cell(50, "position", "")),
    "infinite": (DEVICE, cell(77, "accel_z", "inf")),
    "far too large": (DEVICE, cell(77, "accel_z", "1e300")),
    "spike": (DEVICE, cell(77, "accel_z", "5000")),
    "a million turns": (DEVICE, column("inner", lambda _: 1e12, 0, 60)),
    "text in a cell": (DEVICE, cell(77, "accel_z", "off")),
    "text in a cell, run": (STATIC, cell(77, "yaw", "OVL")),
    "a date for a time": (DEVICE, cell(3, "time_s", "2026-11-21T12:00:00")),
    "position 1.5": (DEVICE, cell(9, "position", "1.5")),
    "position -1": (DEVICE, cell(9, "position", "-1")),
    "position 1e30": (DEVICE, cell(9, "position", "1e30")),
    "clock back": (DEVICE, column("time_s", lambda t: t - 3000, 500)),
    "clock back, run": (STATIC, column("time_s", lambda t: t - 3000, 300)),
    "clock stands": (DEVICE, column("time_s", lambda t: t - 10, 77, 78)),
    "rows doubled": (DEVICE, lines(lambda v: [*v[:20], v[19], *v[20:]])),
    "clock ahead by days, run": (STATIC, column("time_s", lambda t: t + 259200, 300)),
    "clock ahead, run": (STATIC, column("time_s", lambda t: t + 600, 300)),
    "clock ahead in a dwell": (DEVICE, column("time_s", lambda t: t + 5000, 30)),
    "time in minutes": (STATIC, times(1 / 60, "time_s")),
    "time in hours": (STATIC, times(1 / 3600, "time_s")),
    "one row": (DEVICE, lines(lambda v: v[:2])),
    "one row, run": (STATIC, lines(lambda v: v[:2])),
    "one hour, run": (STATIC, lines(lambda v: v[:14])),
    "two positions": (DEVICE, held(1, 5)),
    "never at rest": (DEVICE, column("position", lambda _: 0)),
    "always position 1": (DEVICE, column("position", lambda _: 1)),
}
