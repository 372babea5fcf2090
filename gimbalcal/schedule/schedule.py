"""Commands to the platform: an ordered list of holds.

A schedule has no clock and no state; the simulator gives it both.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gimbalcal.number import Array, apply_matrix
from gimbalcal.platform import Platform


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
