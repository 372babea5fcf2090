"""The published schedules, as data tables."""

from __future__ import annotations

from math import pi, sqrt

import numpy as np

from gimbalcal.number import Array
from gimbalcal.platform import KNOWN, SPACE_STABLE
from gimbalcal.schedule.schedule import Hold, Schedule

# Wu et al. (2018), Table 1: platform, inner and middle angle of positions 1 to 18 in units of pi/4
# (the printed arrows, "unchanged", resolved; derivations/ proves the gravity components from these).
EIGHTEEN_ANGLES = (
    (0, 0, 0), (0, 1, 0), (0, 2, 0), (1, 2, 0), (2, 2, 0), (2, 1, 0),
    (2, 4, 0), (2, 4, -1), (2, 4, -2), (3, 4, -2), (4, 4, -2), (4, 4, -1),
    (4, 5, 0), (3, 6, 0), (2, 7, 0), (2, 0, -1), (1, 0, -2), (0, 0, -3),
)  # fmt: skip

EIGHTEEN_POSITIONS = Schedule(
    "wu2018-18",
    SPACE_STABLE,
    tuple(Hold((p * pi / 4, i * pi / 4, m * pi / 4, 0.0)) for p, i, m in EIGHTEEN_ANGLES),
)
FACE_POSITIONS = (1, 3, 5, 7, 9, 11)  # one sensitive axis along the vertical: Wu et al. (2018) section 3

# Wang et al. (2019), Figure 2, a picture without numbers. The text says what it holds: positions with an input axis
# along gravity (bias and every scale term, Eqs. (20)-(24)) and positions with gravity at 45 or 135 degrees between two
# axes (misalignment, Eq. (25)); fifteen in all, for fifteen parameters. That is six faces and nine of the twelve edges.
# Of the 220 ways to choose nine edges 92 leave the fifteen parameters undetermined; this is the choice with the
# smallest determinant of the covariance that treats the three axes most alike. Inner and outer angle of a two-axis
# table, units of pi/4.
FIFTEEN_ANGLES = (
    (-2, 2), (2, 2), (-4, 2), (0, 2), (0, 4), (0, 0), (-3, 2), (-1, 2),
    (3, 2), (-2, 3), (2, 3), (2, 1), (-4, 3), (-4, 1), (0, 3),
)  # fmt: skip

FIFTEEN_POSITIONS = Schedule(
    "wang2019-15", KNOWN["two-axis-table"], tuple(Hold((i * pi / 4, o * pi / 4), 200.0) for i, o in FIFTEEN_ANGLES)
)

# Wang et al. (2019), Figure 3: axes (9, 3) of the revolutions, three along an input axis and six at 45 and 135 degrees
# between two; each is made clockwise and counter-clockwise through whole turns.
_H = sqrt(0.5)
REVOLUTION_AXES: Array = np.array(
    [(1, 0, 0), (0, 1, 0), (0, 0, 1), (_H, _H, 0), (_H, -_H, 0), (_H, 0, _H), (_H, 0, -_H), (0, _H, _H), (0, _H, -_H)],
    dtype=float,
)

SCHEDULES: dict[str, Schedule] = {s.name: s for s in (EIGHTEEN_POSITIONS, FIFTEEN_POSITIONS)}
