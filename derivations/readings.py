"""How much more the package's unit reads by each parameter of an effect, at one generic rate and force.

For what compares a paper's sensor model with the package's, first order about a perfect unit.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from derivations.comparison import once
from derivations.stimulus import stimulus

RATE, FORCE = np.array([[0.3, -0.5, 0.7]]), np.array([[3.1, -5.2, 7.3]])
SITE = (9.8, 0.6)
TURN = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])  # north, east, down to east, north, up
BETA = ("xy", "xz", "yz", "yx", "zx", "zy")  # order of the package's angles


def _readings(effect: str, field: str, value: Any) -> Any:
    from gimbalcal import forward
    from gimbalcal.effects import CATALOGUE

    s = stimulus(np.repeat(FORCE, 3, axis=0), SITE).at(rate=np.repeat(RATE, 3, axis=0))
    effects = (CATALOGUE[effect](**{field: value}),)
    read = forward.gyroscopes if CATALOGUE[effect].channel == "angular_rate" else forward.accelerometers
    return read(s.rate if read is forward.gyroscopes else s.force, s, effects)[1]


@once
def _asked() -> dict[tuple[str, str], Any]:
    """Return the kept derivatives of the package's readings, by effect and field."""
    return {}


def package_slopes(effect: str, field: str, n: int) -> Any:
    """Return (3, n) derivatives of what the package reads, complex steps about nominal."""
    kept = _asked()
    if (effect, field) not in kept:
        columns = [_readings(effect, field, 1e-30j * np.eye(n)[i]).imag / 1e-30 for i in range(n)]
        kept[effect, field] = np.stack(columns, axis=-1)
    return kept[effect, field]
