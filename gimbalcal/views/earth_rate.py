r"""Rates without the Earth's, of a unit whose attitude gimbals determine.

They also determine how the Earth's rate lies in the unit, up to the heading psi of the base, which the dwells tell:

.. math:: \omega_{ie}^p = \Omega \, C_b^p \, (\cos L \cos\psi, \; -\cos L \sin\psi, \; -\sin L)^T
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gimbalcal.earth import EARTH_RATE
from gimbalcal.effects import Effect
from gimbalcal.forward import gyroscopes
from gimbalcal.kinematics import stimulus_from_readings
from gimbalcal.recording import Recording, dwell_means
from gimbalcal.recording.record import FORCE, RATE


def without_earth_rate(recording: Recording, gyro: Sequence[Effect] = ()) -> Recording:
    """Return rates less what the gyroscopes, with these effects, read of the Earth's rate; counts are unchanged."""
    L = recording.site.latitude
    if L is None or recording.counted(RATE):
        return recording
    rest = dwell_means(recording)
    A = EARTH_RATE * rest.platform.attitude(rest.angles())
    u = rest.triad(FORCE) / rest.site.gravity
    level = np.concatenate([np.einsum("ij,n->nij", np.eye(3), np.ones(len(u))), np.einsum("ij,nk->nijk", np.eye(3), u)
                            .reshape(len(u), 3, 9)], axis=-1)  # fmt: skip
    columns = np.concatenate([np.cos(L) * A[..., :2], EARTH_RATE * level], axis=-1).reshape(3 * len(u), -1)
    north = np.linalg.lstsq(columns, rest.triad(RATE).ravel(), rcond=1e-9)[0][:2]
    size = float(np.hypot(*north))
    north = north / size if size > 0 else np.array([1.0, 0.0])
    earth = EARTH_RATE * recording.platform.attitude(recording.angles()) @ np.array([*(np.cos(L) * north), -np.sin(L)])
    seen = gyroscopes(earth, stimulus_from_readings(recording), gyro)
    rate = recording.triad(RATE) - seen
    channels = {**recording.channels, **{(RATE, a): rate[:, i] for i, a in enumerate("xyz")}}
    # at the equator the vertical has no part of the Earth's rate: nothing is left there to take off once more
    return replace(recording, channels=channels, site=replace(recording.site, latitude=0.0))
