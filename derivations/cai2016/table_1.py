"""Table 1: eighteen turns of a two-axis table and where the unit's axes point after each; what Section 3.4 says of it.

Outer axis: horizontal and still, a U; inner: in it, at right angles, a T. The table names neither the axis of the unit
that the inner one is nor where the outer one points. Row 1 leaves x at east, row 4 leaves z where it is: the outer axis
points east, the inner one is the unit's z. With that all other rows follow or do not; each is turned from the row above
as printed, so that a slip stays in its row.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from derivations.cai2016.symbols import SOURCE
from derivations.turning import AXES, Turn, attitude, in_words, path, quarter, right_handed
from derivations.verdict import AGREES, APPROXIMATION, WRONG, Verdict, with_package

START = ("east", "north", "upwards")
ROWS: tuple[tuple[str, int, str, str, str], ...] = (  # axis, degrees, where x, y, z point afterwards
    ("outer", 90, "east", "upwards", "south"),
    ("outer", 180, "east", "downwards", "north"),
    ("outer", 180, "east", "upwards", "south"),
    ("inner", 90, "upwards", "west", "south"),
    ("inner", 180, "downwards", "east", "south"),
    ("inner", 180, "upwards", "west", "south"),
    ("outer", 90, "south", "west", "downwards"),
    ("outer", 180, "north", "west", "upwards"),
    ("outer", 180, "south", "west", "downwards"),
    ("outer", 90, "downwards", "west", "north"),
    ("outer", 90, "north", "west", "upwards"),
    ("outer", 90, "upwards", "west", "south"),
    ("inner", 90, "west", "downwards", "south"),
    ("inner", 90, "downwards", "east", "south"),
    ("inner", 90, "east", "upwards", "south"),
    ("outer", 90, "east", "south", "downwards"),
    ("outer", 90, "east", "downwards", "north"),
    ("outer", 90, "east", "north", "upwards"),
)
OUTER_IN_N, INNER_IN_B = (1, 0, 0), (0, 0, 1)
SPEED, STOP = 5.0, 180.0  # deg/s, s


def after(C: Any, axis: str, degrees: float) -> Any:
    """Return C_b^n after a turn of the table."""
    return quarter(OUTER_IN_N, degrees) @ C if axis == "outer" else C @ quarter(INNER_IN_B, degrees)


def above(row: int) -> Any:
    """Return C_b^n before a row, as printed; row counts from 1."""
    return attitude(*START) if row == 1 else attitude(*ROWS[row - 2][2:])


def turns() -> tuple[Turn, ...]:
    """Return the eighteen turns about axes of the unit."""
    out, C = [], attitude(*START)
    for axis, degrees, *_ in ROWS:
        own = INNER_IN_B if axis == "inner" else tuple(int(c) for c in C.T @ OUTER_IN_N)
        out.append(Turn(own, degrees))  # type: ignore[arg-type]
        C = after(C, axis, degrees)
    return tuple(out)


def motion() -> Any:
    """Return the path in time: trapezoids of 5 deg/s with ramps of 1 s, which the paper does not print, and 180 s
    stops.
    """
    return path(attitude(*START), turns(), SPEED, STOP)


def item(row: int) -> str:
    """Return the name of a row in `errata.json`."""
    return f"Table 1, row {row}"


def judge_row(row: int, printed: tuple[str, int, str, str, str]) -> Verdict:
    """Judge whether the attitude follows from the row above."""
    axis, degrees, *words = printed
    derived = in_words(after(above(row), axis, degrees))
    wrong = [f"{a} {d}, not {w}" for a, d, w in zip(AXES, derived, words, strict=True) if d != w]
    follows = not wrong and right_handed(attitude(*words))
    about = "+z" if axis == "inner" else "east"
    why = f"From the row above by {degrees} deg about {about}."
    if row == len(ROWS):
        why += " The path ends where it began."
    return with_package(Verdict(
        SOURCE, item(row), AGREES if follows else WRONG, f"{axis} {degrees:+d} deg: {', '.join(words)}",
        ", ".join(derived), "0" if follows else f"{len(wrong)} of 3 axes",
        why if follows else f"{why} {'; '.join(wrong)}.",
    ))  # fmt: skip


def judge_start() -> Verdict:
    right = right_handed(attitude(*START))
    return with_package(Verdict(
        SOURCE, item(0), AGREES if right else WRONG, ", ".join(START), "right-handed", "0" if right else "left-handed",
        "A definition: nothing to derive. East, north, up is right-handed.",
    ))  # fmt: skip


def judge_duration() -> Verdict:
    """Judge one hour with 180 s at each position."""
    turning = sum(d for _, d, *_ in ROWS) / SPEED
    low, high = len(ROWS) * STOP + turning, (len(ROWS) + 1) * STOP + turning
    return Verdict(
        SOURCE, "Section 3.4, 1 h", APPROXIMATION, "5 deg/s, a pause of 180 s at each position, 1 h",
        f"{low:.0f} s, with a stop before the first turn {high:.0f} s", f"{100 * (low / 3600 - 1):.0f} to "
        f"{100 * (high / 3600 - 1):.0f} %",
        f"{turning * SPEED:.0f} deg take {turning:.0f} s, eighteen stops {len(ROWS) * STOP:.0f} s.",
    )  # fmt: skip


def judge_halves() -> tuple[Verdict, Verdict]:
    """Judge what the former and the latter nine turns are said to contain."""
    halves = [(t.axis, t.degrees) for t in turns()]
    twice = {tuple(abs(c) for c in axis) for axis, d in halves[:9] if d == 180
             and halves[:9].count((axis, d)) == 2}  # fmt: skip
    each = len(twice) == 3
    former = Verdict(
        SOURCE, "Section 3.4, former nine", AGREES if each else WRONG,
        "including twice 180 deg rotation in the single direction of each axis", f"{len(twice)} axes turned so",
        "0" if each else f"{3 - len(twice)} axes",
        "Two half turns the same way about x (rows 2, 3), z (5, 6), -y (8, 9).",
    )  # fmt: skip
    covered = {(a, d) for row in ROWS[9:] for a, d in zip(AXES, row[2:], strict=True)}
    missing = [f"{a} {d}" for a in AXES for d in ("upwards", "downwards") if (a, d) not in covered]
    missing += [f"{a} level" for a in AXES if not any((a, d) in covered for d in ("east", "west", "north", "south"))]
    latter = Verdict(
        SOURCE, "Section 3.4, latter nine", WRONG if missing else AGREES,
        "including the positions with each axis pointing to up, ground and horizon",
        ", ".join(missing) + " is missing" if missing else "every axis up, down and level", str(len(missing)),
        "Rows 10 to 18.",
    )  # fmt: skip
    return former, latter


def attitudes() -> Any:
    """Return (19, 3, 3) C_b^n at the stops, by composing the turns from the start."""
    out = [attitude(*START)]
    for axis, degrees, *_ in ROWS:
        out.append(after(out[-1], axis, degrees))
    return np.array(out)


def verdicts() -> tuple[Verdict, ...]:
    """Return the verdicts on the start, eighteen rows, and what the text says of the path."""
    rows = (judge_row(i, row) for i, row in enumerate(ROWS, start=1))
    return (judge_start(), *rows, judge_duration(), *judge_halves())
