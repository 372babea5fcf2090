r"""Other readings of three columns: which axes they may be, with which signs, and how a person says so.

A change is a signed permutation: component i of what the columns hold is `signs[i]` times column `order[i]`,

.. math:: v' = M v, \qquad M_{i, order_i} = signs_i .

Its determinant is -1 where one sign (or three), or one exchange, makes a right-handed triad left-handed.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations, product

import numpy as np

from gimbalcal.number import Array

AXES = ("x", "y", "z")
CLOSE = np.radians(15.0)  # far above gimbal zeros, misalignments and hand-set angles, far below a wrong axis
NEARLY_ALL = 0.9
EVEN = 0.5


@dataclass(frozen=True)
class AxisPermutation:
    """A signed permutation of three columns."""

    order: tuple[int, ...] = (0, 1, 2)
    signs: tuple[int, ...] = (1, 1, 1)

    @property
    def matrix(self) -> Array:
        """M (3, 3)."""
        return np.eye(3)[list(self.order)] * np.array(self.signs, dtype=float)[:, None]

    @property
    def handed(self) -> int:
        """1 where a right-handed triad stays one, -1 where it becomes left-handed."""
        return round(float(np.linalg.det(self.matrix)))

    @property
    def slips(self) -> tuple[int, int]:
        """How much has to have gone wrong for it, and how much of that is in the order."""
        moved = sum(a != b for a, b in enumerate(self.order))
        flipped = 1 if self.signs == (-1, -1, -1) else sum(s < 0 for s in self.signs)  # all three: one convention
        return moved + flipped, moved

    def inverse(self, sign: int = 1) -> AxisPermutation:
        """`sign` times M^-1."""
        back = sign * self.matrix.T
        order = tuple(int(np.argmax(np.abs(row))) for row in back)
        return AxisPermutation(order, tuple(round(float(row[i])) for i, row in zip(order, back, strict=True)))


PERMUTATIONS = tuple(
    sorted(
        (AxisPermutation(order, signs) for order in permutations(range(3)) for signs in product((1, -1), repeat=3)),
        key=lambda c: c.slips,
    )
)
"""All 48, simpler ones first; the first of them changes nothing."""


def in_words(change: AxisPermutation, sensor: str, reversed_in_words: str = "") -> str:
    """What columns of a sensor ("gyroscope") would have to be; `reversed_in_words` is what follows "wrong sign".

    >>> in_words(AxisPermutation((1, 0, 2)), "gyroscope")
    'the gyroscopes x and y are interchanged'
    >>> in_words(AxisPermutation(signs=(1, 1, -1)), "gyroscope")
    'the gyroscope z had the opposite sign'
    """
    moved = [AXES[a] for a, b in enumerate(change.order) if a != b]
    parts = []
    if len(moved) == 2:
        parts.append(f"the {sensor}s {moved[0]} and {moved[1]} are interchanged")
    elif moved:
        parts.append(f"the {sensor}s called {', '.join(AXES[b] for b in change.order)} are really x, y, z")
    if change.signs == (-1, -1, -1):
        parts.append(f"every {sensor} has the wrong sign{reversed_in_words}")
    elif -1 in change.signs:
        wrong = " and ".join(AXES[i] for i in range(3) if change.signs[i] < 0)
        parts.append(f"the {sensor}{'s' if ' ' in wrong else ''} {wrong} had the opposite sign")
    return " and ".join(parts) or "the columns are as stated"


def remedy(change: AxisPermutation, sensor: str) -> str:
    """What to write in [columns] for a change of a sensor; empty where nothing changes.

    >>> remedy(AxisPermutation((1, 0, 2), (1, -1, 1)), "gyroscope")
    'for gyroscope y write axis = "x", for gyroscope x write axis = "y", sign = -1'
    """
    wrong = [i for i in range(3) if change.order[i] != i or change.signs[i] < 0]
    out = []
    for i in wrong:
        keys = [f'axis = "{AXES[i]}"'] * (change.order[i] != i) + ["sign = -1"] * (change.signs[i] < 0)
        out.append(f"for {sensor} {AXES[change.order[i]]} write {', '.join(keys)}")
    return ", ".join(out)


def without_scale(raw: Array) -> Array | None:
    """Forces (n, 3) up to a scale from counts at rest; None unless every axis went as far both ways as the others."""
    if len(raw) < 2:
        return None
    spread = (raw.max(0) - raw.min(0)) / 2
    if spread.min() < EVEN * spread.max() or spread.max() == 0:
        return None
    return np.asarray((raw - (raw.max(0) + raw.min(0)) / 2) / spread)
