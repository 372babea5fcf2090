r"""Commands to a platform as data: holds at gimbal angles in order, or the turns and stops of a unit.

A schedule has no clock and no state; the simulator gives it both. A move of a `RotationSchedule` turns the unit about
one of its own axes (x, y, z), or about an axis of the table that carries it: `outer` stays put in the room, `inner`
turns with the unit. Both stay put in the unit and in the room during the move, so attitudes follow in closed form,

.. math:: C_b^n \leftarrow C_b^n R(a, \theta) \quad (\text{inner, x, y, z}), \qquad
          C_b^n \leftarrow R(u, \theta) C_b^n \quad (\text{outer}),

with R the rotation of vectors by theta about a unit vector, right-handed.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from gimbalcal.effects.effect import TRIAD
from gimbalcal.errors import list_of_alternatives
from gimbalcal.number import Array, apply_matrix
from gimbalcal.platform import Platform
from gimbalcal.rotation import exponential

DIRECTIONS: Mapping[str, tuple[float, float, float]] = {  # in north, east, down
    "north": (1.0, 0.0, 0.0),
    "south": (-1.0, 0.0, 0.0),
    "east": (0.0, 1.0, 0.0),
    "west": (0.0, -1.0, 0.0),
    "up": (0.0, 0.0, -1.0),
    "down": (0.0, 0.0, 1.0),
}
TABLE = ("outer", "inner")


@dataclass(frozen=True)
class Hold:
    """Stay at gimbal angles `angles` [rad], in the platform's axis order, for `duration` [s]."""

    angles: tuple[float, ...]
    duration: float = 600.0  # s; Wu et al. (2018) section 4 holds 10 min (20 s for the coarse stage)


@dataclass(frozen=True)
class Schedule:
    """Ordered holds on one platform; slews between them run at `slew_rate` [rad/s]."""

    name: str
    platform: Platform
    holds: tuple[Hold, ...]
    slew_rate: float = np.deg2rad(6.0)

    @property
    def angles(self) -> Array:
        """Return gimbal angles (m, k) [rad] of the holds."""
        return np.array([hold.angles for hold in self.holds], dtype=float).reshape(len(self.holds), -1)

    def gravity_directions(self) -> Array:
        """Return unit gravity in platform axes (m, 3) at each hold, on a level base: C_bp (0, 0, 1)."""
        return apply_matrix(self.platform.attitude(self.angles), np.array([0.0, 0.0, 1.0]))


@dataclass(frozen=True)
class Move:
    """A turn by `angle` [rad] about `axis`; `rate` [rad/s] and the `stop` [s] after it where they are its own.

    along: where the source prints that the axis points, if it does.
    """

    axis: str
    angle: float
    rate: float | None = None
    stop: float | None = None
    along: str = ""


@dataclass(frozen=True)
class RotationSchedule:
    """Moves of a unit that starts with its x, y and z axes along `start`, each followed by a stop, one before them all.

    rate [rad/s]; ramp [s] in which a turn comes to it, at constant acceleration, and to rest again; stop [s].
    outer: where the table's outer axis points (the direction of x at the start where it is empty); inner: the axis of
    the unit that the inner axis is along. stated: the attitude that the source prints after each move, if it does.
    """

    name: str
    start: tuple[str, str, str]
    moves: tuple[Move, ...]
    rate: float = np.deg2rad(10.0)
    ramp: float = 1.0
    stop: float = 100.0
    outer: str = ""
    inner: str = "z"
    stated: tuple[tuple[str, str, str], ...] = ()
    source: str = ""

    def __post_init__(self) -> None:
        unknown = next((d for d in self.start if d not in DIRECTIONS), "")
        if unknown:
            raise ValueError(f"{unknown!r} is no direction; write {list_of_alternatives(list(DIRECTIONS))}")
        C = standing_attitude(self.start)
        if not np.allclose(C @ C.T, np.eye(3)) or np.linalg.det(C) < 0:
            x, y, z = self.start
            raise ValueError(
                f"x {x}, y {y}, z {z} is no attitude of a unit: the axes of a right-handed triad are at right angles, "
                "and z is where x turns to y; correct start"
            )

    def axis(self, i: int, C_bn: Array) -> Array:
        """Return the axis (3,) of move i in the unit, which stands as C_bn (3, 3) turns its components into n."""
        name = self.moves[i].axis
        if name == "outer":
            return np.asarray(C_bn.T @ np.array(DIRECTIONS[self.outer or self.start[0]]))
        return np.eye(3)[TRIAD.index(self.inner if name == "inner" else name)]

    def attitudes(self) -> Array:
        """Return C_bn (m + 1, 3, 3) at each stop: columns are x, y and z of the unit in north, east, down."""
        out = [standing_attitude(self.start)]
        for i, move in enumerate(self.moves):
            out.append(out[-1] @ exponential(-move.angle * self.axis(i, out[-1])))
        return np.stack(out)


def standing_attitude(start: tuple[str, str, str]) -> Array:
    """Return C_bn (3, 3) of a unit whose x, y and z axes point in three of `DIRECTIONS`."""
    return np.array([DIRECTIONS[d] for d in start]).T


def direction(v: Array) -> str:
    """Return which of `DIRECTIONS` a vector (3,) points along; empty where it is along none."""
    return next((name for name, d in DIRECTIONS.items() if np.allclose(v, d, atol=1e-9)), "")


def contradictions(schedule: RotationSchedule) -> tuple[str, ...]:
    """Return the differences between what the source prints and what the moves do, one sentence for each row."""
    out, C = [], schedule.attitudes()
    for i, move in enumerate(schedule.moves):
        there = direction(C[i] @ schedule.axis(i, C[i]))
        if move.along and there != move.along:
            out.append(f"row {i + 1}: {move.axis} points {there or 'between'} by the rows above, printed {move.along}")
    for i, printed in enumerate(schedule.stated, start=1):
        attitude = tuple(direction(column) for column in C[i].T)
        if attitude != printed:
            out.append(f"row {i}: the move leads to {', '.join(attitude)}, printed {', '.join(printed)}")
    return tuple(out)
