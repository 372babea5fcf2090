"""The package's stimulus at generic instants, for what compares its laws."""

from __future__ import annotations

from typing import Any

import numpy as np


def stimulus(force: Any, site: tuple[float, float], readout: Any = None, axis_names: tuple[str, ...] = ()) -> Any:
    """Return n instants with these forces (n, 3) [m/s^2] and readouts (n, k) [rad], nothing else happening.

    site: gravity [m/s^2] and latitude [rad]. Without readouts the axes are those of the space-stable platform, at zero.
    """
    from gimbalcal.effects import Stimulus

    n = len(force)
    zero = np.zeros((n, 3))
    if readout is None:
        readout, axis_names = np.zeros((n, 4)), ("platform", "inner", "middle", "outer")
    return Stimulus(
        time=np.arange(float(n)),
        readout=readout,
        angle=readout,
        force=force,
        gravity=site[0],
        visit=np.arange(n),
        position=np.arange(n) + 1,
        since_move=np.zeros(n),
        move_force=zero,
        move_angle=np.zeros_like(readout),
        earlier_move_force=zero,
        rate=zero,
        axis_names=axis_names,
        latitude=site[1],
    )


def attitude() -> Any:
    """Return C_b^n, a generic rotation (3, 3)."""
    q, _ = np.linalg.qr(np.array([[1.0, 0.2, -0.3], [-0.4, 1.0, 0.5], [0.3, -0.6, 1.0]]))
    return q * np.linalg.det(q)
