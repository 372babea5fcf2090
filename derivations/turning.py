"""Turns of a unit by printed words: where its axes point, in whole quarter turns, and a path in time.

An attitude is C_b^n (3, 3) in whole numbers, its columns the axes of the unit in east, north, up. A turn about an axis
that stands still in n multiplies from the left, about one of the unit from the right.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import radians
from typing import Any

import numpy as np

DIRECTIONS: dict[str, tuple[int, int, int]] = {
    "east": (1, 0, 0), "west": (-1, 0, 0), "north": (0, 1, 0), "south": (0, -1, 0),
    "upwards": (0, 0, 1), "downwards": (0, 0, -1),
}  # fmt: skip
AXES = ("x", "y", "z")


@dataclass(frozen=True)
class Turn:
    """About an axis (3,) of the unit, by degrees."""

    axis: tuple[int, int, int]
    degrees: float


def attitude(x: str, y: str, z: str) -> Any:
    """Return C_b^n from where the axes point."""
    return np.array([DIRECTIONS[d] for d in (x, y, z)]).T


def in_words(C: Any) -> tuple[str, str, str]:
    """Return where the axes point; "?" for one between the six directions."""
    x, y, z = (
        next((name for name, d in DIRECTIONS.items() if np.allclose(C[:, i], d, atol=1e-9)), "?") for i in range(3)
    )
    return x, y, z


def rotation(axis: Any, angle: float) -> Any:
    """Return the active rotation (3, 3), Rodrigues."""
    a = np.asarray(axis, float)
    K = np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


def quarter(axis: Sequence[int], degrees: float) -> Any:
    """Return the same in whole numbers for multiples of 90 deg."""
    return np.rint(rotation(axis, radians(degrees))).astype(int)


def right_handed(C: Any) -> bool:
    return bool(np.array_equal(C.T @ C, np.eye(3)) and round(float(np.linalg.det(C))) == 1)


@dataclass(frozen=True)
class Path:
    """A path at n instants in the middle of steps `dt` [s]: C_b^n (n, 3, 3), rate against n in b (n, 3) [rad/s]."""

    C: Any
    rate: Any
    dt: float

    @property
    def duration(self) -> float:
        """s."""
        return len(self.C) * self.dt


def path(start: Any, turns: Sequence[Turn], speed: float, stop: float, ramp: float = 1.0, dt: float = 0.5) -> Path:
    """Return a stop, then turn and stop in turn; trapezoids of rate; speed [deg/s], times [s], multiples of dt."""
    C, out_C, out_w = np.asarray(start, float), [], []

    def rest() -> None:
        n = round(stop / dt)
        out_C.extend([C] * n)
        out_w.extend([np.zeros(3)] * n)

    rest()
    for turn in turns:
        total = abs(turn.degrees) / speed + ramp
        n = round(total / dt)
        if abs(n * dt - total) > 1e-9:
            raise ValueError(f"a turn of {total} s is no multiple of the step {dt} s")
        middle = (np.arange(n) + 0.5) * total / n
        axis = np.sign(turn.degrees) * np.asarray(turn.axis, float)
        for t in middle:
            w, angle = _trapezoid(t, total, ramp, radians(speed))
            out_C.append(C @ rotation(axis, angle))
            out_w.append(w * axis)
        C = C @ rotation(axis, radians(abs(turn.degrees)))
        rest()
    return Path(np.array(out_C), np.array(out_w), dt)


def _trapezoid(t: float, total: float, ramp: float, top: float) -> tuple[float, float]:
    """Return the rate and angle so far."""
    if t < ramp:
        return top * t / ramp, top * t**2 / ramp / 2
    if t > total - ramp:
        remaining = total - t
        return top * remaining / ramp, top * (total - ramp) - top * remaining**2 / ramp / 2
    return top, top * (t - ramp / 2)
