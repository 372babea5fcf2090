r"""The rest positions and revolutions of Wang et al. (2019), Figures 2 and 3, as data.

The figures are pictures without numbers. The text says what they hold: positions with an input axis along gravity
(sensitivity to bias and every scale term, Eqs. (20)-(24)) and positions with gravity at 45 or 135 degrees between two
axes (misalignment, Eq. (25)); fifteen in all, for fifteen parameters. That is six faces and nine of the twelve edges.
Of the 220 ways to choose nine edges 92 leave the fifteen parameters undetermined; `FIFTEEN_POSITIONS`
is the choice with the smallest determinant of the covariance that treats the three axes most alike.
"""

from __future__ import annotations

import numpy as np

from gimbalcal.number import Array
from gimbalcal.schedule import FIFTEEN_POSITIONS

_H = float(np.sqrt(0.5))

# Figure 2: unit specific force in the sensor frame at each position
POSITIONS: Array = -FIFTEEN_POSITIONS.gravity_directions()

# Figure 3: axes of the nine revolutions, three along an input axis and six at 45 and 135 degrees between two;
# each is made clockwise and counter-clockwise through whole turns.
REVOLUTION_AXES: Array = np.array(
    [(1, 0, 0), (0, 1, 0), (0, 0, 1), (_H, _H, 0), (_H, -_H, 0), (_H, 0, _H), (_H, 0, -_H), (0, _H, _H), (0, _H, -_H)],
    dtype=float,
)
