r"""Table 1: gravity in platform axes at the eighteen positions, and the gimbal angles that lead there.

Gravity is (0, 0, g) on the level base. Seen from the platform through middle (about y), inner (about x) and platform
gimbal (about z),

    g^p = Rz(theta_1) Rx(theta_2) Ry(theta_3) (0, 0, g),      theta_i = k_i pi/4 + theta_i0,

to first order in the zeros theta_i0, which is the order in which the table states its small entries. Entries near
+-g/sqrt(2) are printed without their first-order terms: they are approximations, and the size says of what.

The angles are judged by the printed gravity of their row: an angle agrees if it is a multiple of pi/4 that reproduces
every sound entry of the row, the other two angles as printed.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from functools import cache
from typing import Any

import sympy as sp

from derivations.verdict import AGREES, APPROXIMATION, ARCSEC, NOT_DETERMINED, Case, Printed, judge, order
from derivations.wu2018.symbols import Rx, Ry, Rz, g

ZEROS = sp.symbols("theta_10 theta_20 theta_30", real=True)
t1, t2, t3 = ZEROS
r = sp.sqrt(2) / 2
ZERO_SIZE = 10 * ARCSEC  # what a size is quoted for: zeros as large as the angles of Table 3

SIGNS = tuple(dict(zip(ZEROS, signs, strict=True)) for signs in itertools.product((ZERO_SIZE, -ZERO_SIZE), repeat=3))

# theta_1, theta_2, theta_3 in units of pi/4 as printed, arrows ("remains unchanged") kept as None
ANGLES: tuple[tuple[int | None, int | None, int | None], ...] = (
    (0, 0, 0), (None, 1, None), (None, 2, None), (1, None, None), (2, None, None), (None, 1, None),
    (None, 4, None), (None, None, -1), (None, None, -2), (3, None, None), (4, None, None), (None, None, -1),
    (None, 5, 0), (3, 6, None), (2, 7, None), (None, 0, -1), (1, None, -2), (0, None, -3),
)  # fmt: skip

# g_x, g_y, g_z of each row: the reading, in units of g
GRAVITY = (
    (-t3, t2, 1),
    (r * t1 - t3, r, r),
    (t1 - t3, 1, -t2),
    (r, r, -t2),
    (1, t3 - t1, -t2),
    (r, t3 - r * t1, r),
    (-t2, t3, -1),
    (-r * (t1 + t2), -r, -r),
    (-t1, -1, -t3),
    (-r, -r, -t3),
    (-1, t1, -t3),
    (-r, r * (t1 + t2), -r),
    (r * t1 + t3, r, -r),
    (-r, r, r * t2),
    (-r, r * (t3 + t2), r),
    (r * (-t1 + t2), -r, r),
    (r, -r, t3),
    (r, -r * (t1 + t2), -r),
)

# the same cells as the scan shows them, r2 for sqrt(2)
SCAN = (
    ("-g theta_30", "g theta_20", "8"),
    ("(r2/2 theta_10 - theta_30) g", "r2/2 g", "g/r2"),
    ("g (theta_10 - theta_30)", "8", "-g theta_20"),
    ("r2/2 g", "g/r2 g", "-g theta_20"),
    ("(empty)", "g (theta_30 - theta_10)", "-g theta_20"),
    ("g/r2 g", "(theta_30 - r2/2 theta_10) g", "r2/2 g"),
    ("-g theta_20", "g theta_30^2", "-g"),
    ("-r2/2 g (theta_10 + theta_20)", "-r2/2 g", "-r2/2 g"),
    ("-g theta_10", "-g", "-g theta_30 (barred)"),
    ("-r2/2 g", "-r2/2 g", "-g theta_30"),
    ("-g (underlined)", "8010", "-g theta_30"),
    ("-r2/2 g", "r2/2 g (theta_10 + theta_20)", "-r2/2 g"),
    ("(r2/2 theta_10 + theta_30) g", "r2/2 g", "-r2/2 g"),
    ("-r2/2 g", "r2/2 g r2/2 g", "r2/2 g theta_20"),
    ("-r2/2 g", "r2/2 g (theta_30 + theta_20)", "(r2/2 g theta_20)/(r2/2 g)"),
    ("r2/2 g (-theta_10 + theta_20)", "-r2/2 g", "r2/2 g"),
    ("r2/2 g", "-r2/2 g", "g theta_30"),
    ("r2/2 g", "-r2/2 g (theta_10 + theta_20)", "-r2/2 g"),
)
GARBLED = {
    (1, "z"): "8 for g",
    (3, "y"): "8 for g",
    (4, "y"): "the g of row 3 or 5 runs into it; half of sqrt(2) is legible",
    (5, "x"): "the cell is empty and its g stands in the cell of row 6",
    (6, "x"): "the g of row 5 runs into it",
    (7, "y"): "the scan shows theta_30 squared, and may have made an exponent of a speck",
    (9, "z"): "a bar over theta",
    (11, "x"): "an underline",
    (11, "y"): "8010 for g theta_10",
    (14, "y"): "the cells of rows 13 and 14 run together",
    (15, "z"): "the cell of row 14 stands over it as a fraction",
}
LITERAL = {(7, "y"): t3**2}  # where the scan is a formula too, in units of g
COMPONENTS = ("x", "y", "z")


def resolved_angles() -> tuple[tuple[int, int, int], ...]:
    """Return the printed angles with every arrow replaced by the row above."""
    rows: list[tuple[int, int, int]] = []
    for row in ANGLES:
        above = rows[-1] if rows else (0, 0, 0)
        a, b, c = (x if x is not None else y for x, y in zip(row, above, strict=True))
        rows.append((a, b, c))
    return tuple(rows)


@cache
def _turn(axis: int, k: int, derivative: int) -> Any:
    """Return a gimbal's rotation at k pi/4, or its derivative by the angle there."""
    angle = sp.Symbol("angle")
    matrix = (Rz, Rx, Ry)[axis](angle)
    return (matrix.diff(angle) if derivative else matrix).subs(angle, k * sp.pi / 4)


@cache
def gravity(k1: int, k2: int, k3: int) -> Any:
    """Return g^p / g at three multiples of pi/4, to first order in the zeros."""

    def chain(*derivatives: int) -> Any:
        a, b, c = (_turn(i, k, n) for i, (k, n) in enumerate(zip((k1, k2, k3), derivatives, strict=True)))
        return a * b * c * sp.Matrix([0, 0, 1])

    return chain(0, 0, 0) + t1 * chain(1, 0, 0) + t2 * chain(0, 1, 0) + t3 * chain(0, 0, 1)


def angle_item(row: int, axis: int) -> str:
    return f"Table 1, row {row}, theta_{axis + 1}"


def gravity_item(row: int, component: str) -> str:
    return f"Table 1, row {row}, g_{component}"


def _printed_gravity() -> dict[str, Printed]:
    out = {}
    for row, (reading, cells) in enumerate(zip(GRAVITY, SCAN, strict=True), 1):
        for component, value, scan in zip(COMPONENTS, reading, cells, strict=True):
            item = gravity_item(row, component)
            cell = (row, component)
            literal = g * LITERAL[cell] if cell in LITERAL else None
            out[item] = Printed(item, scan, g * sp.sympify(value), GARBLED.get(cell, ""), literal=literal)
    return out


def _printed_angles() -> dict[str, Printed]:
    out = {}
    for row, (raw, angles) in enumerate(zip(ANGLES, resolved_angles(), strict=True), 1):
        for i, (cell, k) in enumerate(zip(raw, angles, strict=True)):
            item = angle_item(row, i)
            angle = ZEROS[i] + k * sp.pi / 4
            scan = f"(arrow: unchanged) {angle}" if cell is None else str(angle)
            out[item] = Printed(item, scan, angle)
    return out


PRINTED = {**_printed_gravity(), **_printed_angles()}


def _gravity_case(row: int, component: str) -> Case:
    derived = g * gravity(*resolved_angles()[row - 1])[COMPONENTS.index(component)]
    return Case(
        derived,
        _explain,
        small=ZEROS,
        at={g: 1.0, **dict.fromkeys(ZEROS, ZERO_SIZE)},
        sweep=SIGNS,
        unit="ug",
        symbols=(ZEROS,),
        factors=(sp.sqrt(2), sp.sqrt(2) / 2, sp.Integer(2)),
    )


def _explain(printed: Printed, case: Case) -> str:
    verdict, slip = judge(printed, case)
    if verdict == AGREES:
        return "First order in the gimbal zeros."
    if verdict == NOT_DETERMINED:
        return (
            "To first order in the gimbal zeros, in which the table is stated, it is right without; size up to {size}."
        )
    if verdict == APPROXIMATION:
        lost = sp.sstr(sp.expand(case.derived - printed.formula))
        return f"Leaves out {lost}: up to {{size}} for zeros of 10 arcsec."
    cause = f"One slip: {slip}" if slip else "No single slip explains it"
    return (
        f"{cause}; the row's own angles give {sp.sstr(case.derived)}. The difference is up to {{size}} for zeros of "
        "10 arcsec, and a coarse stage built on it puts that into its gimbal zeros."
    )


def sound_components(row: int, printed: Mapping[str, Printed]) -> dict[str, Any]:
    """Return the printed gravity of a row where it is consistent with the row's angles."""
    out = {}
    for component in COMPONENTS:
        p = printed.get(gravity_item(row, component), PRINTED[gravity_item(row, component)])
        if judge(p, _gravity_case(row, component))[0] in (AGREES, APPROXIMATION):
            out[component] = p.formula
    return out


def consistent_angles(row: int, axis: int, printed: Mapping[str, Printed]) -> list[int]:
    """Return multiples of pi/4 for one angle that reproduce every sound entry of the row, the other angles as
    printed.
    """
    angles, sound = list(resolved_angles()[row - 1]), sound_components(row, printed)
    fits = []
    for k in range(8):
        angles[axis] = k
        vector = gravity(*angles)
        differences = [(g * vector[COMPONENTS.index(c)] - value, value) for c, value in sound.items()]
        if all(order(d, ZEROS) > order(value, ZEROS) for d, value in differences):
            fits.append(k)
    return fits


def _angle_case(row: int, axis: int) -> Case:
    """Return the angle that the printed gravity of the row demands."""
    fits = consistent_angles(row, axis, PRINTED)
    printed = resolved_angles()[row - 1][axis]
    k = printed if printed % 8 in fits else (fits[0] if fits else printed + 4)
    count_in_words = "The only multiple" if len(fits) == 1 else f"One of {len(fits)} multiples"
    return Case(
        ZEROS[axis] + k * sp.pi / 4,
        f"{count_in_words} of pi/4 that reproduces the row's sound gravity entries.",
        at={},
    )


@cache
def cases() -> dict[str, Case]:
    """Return the derived forms of the items."""
    out = {}
    for row in range(1, 19):
        for component in COMPONENTS:
            out[gravity_item(row, component)] = _gravity_case(row, component)
        for axis in range(3):
            out[angle_item(row, axis)] = _angle_case(row, axis)
    return out
