"""Table 1: thirty turns, each printed twice: about an axis of n and about an axis of the unit.

Both columns hold if the unit's axis points where the other column says when the turn begins. The table prints no
attitude; row 1 (y is east) and row 6 (z is north, after turns about y that sum to nothing) give the one at the start,
and every other row must follow. Rows 16 to 30 are "the same as that of (1~15), and the direction is opposite".

The attitude (0, -90, -90) of Section 4.1 is read as pitch, roll, yaw, C_b^n = Rz(yaw) Rx(pitch) Ry(roll), for the x
axis of Section 2.1's b points right, y to the front, z up.
"""

from __future__ import annotations

from math import radians
from typing import Any

import numpy as np

from derivations.turning import AXES, DIRECTIONS, Turn, in_words, path, quarter, rotation
from derivations.verdict import AGREES, NOT_DETERMINED, WRONG, Verdict, with_package
from derivations.wei2022.symbols import SOURCE

ROWS: tuple[tuple[str, str, int], ...] = (  # axis of n, axis of the unit, degrees (the same in both columns)
    ("E", "y", 90), ("E", "y", 90), ("E", "y", 90), ("E", "y", -180), ("E", "y", -90), ("N", "z", 90), ("E", "x", 90),
    ("E", "x", 90), ("E", "x", 90), ("E", "x", -180), ("E", "x", -90), ("N", "z", 90), ("N", "z", 90), ("N", "z", -180),
    ("N", "z", -90),
)  # fmt: skip
N_AXES = {"E": "east", "N": "north"}
EULER = (0.0, -90.0, -90.0)  # deg, Section 4.1
SPEED, STOP = 10.0, 100.0  # deg/s, s: not printed


def start() -> Any:
    """Return C_b^n from rows 1 and 6."""
    turned = sum(d for _, axis, d in ROWS[:5] if axis == "y")
    if turned % 360:
        raise ArithmeticError("the turns about y before row 6 do not close")
    y, z = (np.array(DIRECTIONS[N_AXES[ROWS[i][0]]]) for i in (0, 5))
    return np.array([np.cross(y, z), y, z]).T


def unit_axis(name: str) -> tuple[int, int, int]:
    x, y, z = (int(a == name) for a in AXES)
    return x, y, z


def reversed_rows() -> tuple[tuple[str, str, int], ...]:
    return tuple((n, b, -d) for n, b, d in ROWS)


def turns() -> tuple[Turn, ...]:
    """Return all thirty about the unit's axes."""
    return tuple(Turn(unit_axis(b), d) for _, b, d in (*ROWS, *reversed_rows()))


def attitudes() -> Any:
    """Return (31, 3, 3) C_b^n at the stops, by the column of the unit."""
    out = [start()]
    for turn in turns():
        out.append(out[-1] @ quarter(turn.axis, turn.degrees))
    return np.array(out)


def motion() -> Any:
    """Return the path in time; rate, ramps and stops are not printed."""
    return path(start(), turns(), SPEED, STOP)


def item(row: int) -> str:
    """Return the name of a row in `errata.json`."""
    return f"Table 1, row {row}"


def judge_row(row: int, n_axis: str, b_axis: str, degrees: int) -> Verdict:
    """Judge whether the unit's axis points along the axis of n when the turn begins."""
    C = attitudes()[row - 1]
    points = in_words(C)[AXES.index(b_axis)]
    wanted = N_AXES[n_axis]
    both = points == wanted
    why = f"{b_axis} points {points} when the turn begins."
    if row in (1, 6):
        why += " Rows 1 and 6 give the start: x upwards, y east, z north."
    if not both:
        why += f" The opposite of row {row - len(ROWS)} about {b_axis} is the same as that row about {wanted}."
    if row == 2 * len(ROWS):
        why += " The path ends where it began, whichever column is reversed."
    printed = f"{n_axis} {degrees:+d} deg, {b_axis} {degrees:+d} deg"
    if row > len(ROWS):
        printed = f"as row {row - len(ROWS)}, opposite: {printed}"
    return with_package(Verdict(
        SOURCE, item(row), AGREES if both else NOT_DETERMINED, printed,
        f"{b_axis} {points}, then {', '.join(in_words(attitudes()[row]))}", "0" if both else "the sense of one turn",
        why,
    ))  # fmt: skip


def contradicted() -> list[int]:
    """Return rows of the second half in which both columns cannot be reversed."""
    C = attitudes()
    return [i for i, (n, b, _) in enumerate(reversed_rows(), start=len(ROWS) + 1)
            if in_words(C[i - 1])[AXES.index(b)] != N_AXES[n]]  # fmt: skip


def judge_second_half() -> Verdict:
    """Judge the one line that stands for fifteen rows."""
    rows = contradicted()
    other = [i + len(ROWS) for i, (a, b) in enumerate(zip(attitudes()[len(ROWS):], by_the_other_column(), strict=True))
             if not np.array_equal(a, b)]  # fmt: skip
    return Verdict(
        SOURCE, "Table 1, order 16~30", WRONG if rows else AGREES,
        "the order (16~30) is the same as that of (1~15), and the direction is opposite",
        f"not in both columns in rows {', '.join(map(str, rows))}", f"{len(rows)} of {len(ROWS)} rows" if rows else "0",
        "Row 21 turns about north the other way than row 6, so x points west where it pointed east: reversed about x a "
        "turn is not reversed about east. The unit's column is followed here and in the package; with n's the stops "
        f"after rows {', '.join(map(str, other))} are others. Both end where they began.",
    )  # fmt: skip


def by_euler(pitch: float, roll: float, yaw: float) -> Any:
    """Return C_b^n of pitch, roll, yaw in deg."""
    turned = (
        rotation(axis, radians(angle)) for axis, angle in (((0, 0, 1), yaw), ((1, 0, 0), pitch), ((0, 1, 0), roll))
    )
    z, x, y = turned
    return z @ x @ y


def judge_start() -> Verdict:
    stated = in_words(by_euler(*EULER))
    derived = in_words(start())
    same = stated == derived
    return with_package(Verdict(
        SOURCE, "Section 4.1, initial attitude", AGREES if same else WRONG, "(0, -90, -90) deg", ", ".join(derived),
        "0" if same else f"it makes {', '.join(stated)}",
        "As pitch, roll, yaw it is the attitude that Table 1's two columns need. The other scheme's (0, -180, -90), x "
        f"{', y '.join(in_words(by_euler(0.0, -180.0, -90.0))[:2])}, z downwards, cannot be checked: its turns are not "
        "printed.",
    ))  # fmt: skip


def by_the_other_column() -> Any:
    """Return (16, 3, 3) stops of rows 15 to 30 when n's column is the one that is reversed."""
    out = [attitudes()[len(ROWS)]]
    for n_axis, _, degrees in reversed_rows():
        out.append(quarter(DIRECTIONS[N_AXES[n_axis]], degrees) @ out[-1])
    return np.array(out)


def judge_times() -> Verdict:
    return Verdict(
        SOURCE, "Table 1, rate and stops", NOT_DETERMINED, "(not printed)", "-", "not quantified",
        "Neither the rate of the turns nor how long a position is held is printed, nor the noise of Section 4.1: no "
        "sigma of Tables 2 and 3 follows. The package takes 10 deg/s and 100 s.",
    )  # fmt: skip


def verdicts() -> tuple[Verdict, ...]:
    """Return the verdicts on thirty rows, the start, and what is missing."""
    rows = enumerate((*ROWS, *reversed_rows()), start=1)
    return (*(judge_row(i, *row) for i, row in rows), judge_second_half(), judge_start(), judge_times())
