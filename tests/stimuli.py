"""Stimuli made by hand for tests that need no recording."""

import numpy as np

from gimbalcal.earth import EARTH_RATE
from gimbalcal.effects import Stimulus
from gimbalcal.platform import SPACE_STABLE
from gimbalcal.schedule import EIGHTEEN_POSITIONS

G = 9.80146  # m/s^2
LATITUDE = np.deg2rad(40.0)


def remembering(fresh: np.ndarray, memory: float) -> np.ndarray:
    """Rows (n,) of unit variance that remember the row before, made of independent ones."""
    out = np.array(fresh)
    for k in range(1, len(out)):
        out[k] = memory * out[k - 1] + np.sqrt(1 - memory**2) * fresh[k]
    return out


def _still(n: int, readout: np.ndarray, force: np.ndarray, time: np.ndarray, **more: object) -> Stimulus:
    return Stimulus(
        time=time,
        readout=readout,
        angle=readout,
        force=force,
        gravity=G,
        visit=np.arange(n),
        position=np.arange(1, n + 1),
        since_move=np.zeros(n),
        move_force=np.diff(force, axis=0, prepend=force[:1]),
        move_angle=np.diff(readout, axis=0, prepend=readout[:1]),
        earlier_move_force=np.zeros((n, 3)),
        rate=np.zeros((n, 3)),
        axis_names=SPACE_STABLE.axis_names,
        **more,  # type: ignore[arg-type]
    )


def eighteen() -> Stimulus:
    """One row per position of the 18-position schedule, ten minutes apart."""
    force = -G * EIGHTEEN_POSITIONS.gravity_directions()
    return _still(18, EIGHTEEN_POSITIONS.angles, force, 600.0 * np.arange(18), temperature=20 + np.sin(np.arange(18.0)))


def static(hours: float = 48.0, step: float = 600.0) -> Stimulus:
    """An inertially fixed platform at 40 deg N."""
    time = np.arange(0.0, hours * 3600, step)
    phase = EARTH_RATE * time + 0.4
    unit = np.stack(
        [np.cos(phase) * np.cos(LATITUDE), np.sin(phase) * np.cos(LATITUDE), np.full_like(phase, np.sin(LATITUDE))], -1
    )
    readout = np.stack([phase, 0 * phase, 0 * phase + LATITUDE, 0 * phase], -1)
    return _still(len(time), readout, G * unit, time, latitude=LATITUDE)
