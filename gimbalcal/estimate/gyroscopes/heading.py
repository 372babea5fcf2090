r"""The Earth's horizontal rate in a unit turned by hand: which way is north is carried through the turns.

No rest says where north is, but the gyroscopes say how the unit turned from one rest to the next, and gravity keeps the
level true. With h_k a horizontal direction in rest k, carried by P_k from the one before, and d_k along gravity,

.. math:: h_k \propto (1 - d_k d_k^T) P_k h_{k-1}, \qquad
          \omega_k^{horizontal} = \Omega \cos L \, (h_k \cos\psi + d_k \times h_k \sin\psi)

for one unknown heading psi of all rests that logged turns join. Both components are unknown beforehand, of variance
(Omega cos L)^2 / 2; where the latitude is not known, Omega^2 / 3.
"""

from __future__ import annotations

import numpy as np

from gimbalcal.earth import EARTH_RATE
from gimbalcal.effects.baseline_effects import GYROSCOPE_INPUT_TERMS
from gimbalcal.errors import InputError
from gimbalcal.estimate.gyroscopes.turn_fit import fit_turns
from gimbalcal.estimate.gyroscopes.turns import Turns, logged_turns, turned
from gimbalcal.number import Array
from gimbalcal.recording import Recording
from gimbalcal.rotation import normal_to

MAX_TURN_ERROR_RAD = 0.2  # rad by which a turn misses gravity: it was not what the gyroscopes say


def horizontal_sigma(latitude: float | None) -> float:
    """One sigma [rad/s] of each component of the Earth's horizontal rate at a latitude [rad], or anywhere (None)."""
    return EARTH_RATE * float(np.sqrt(1 / 3) if latitude is None else abs(np.cos(latitude)) / np.sqrt(2))


def horizontal_rate(recording: Recording, turns: Turns, down: Array) -> Array:
    """Return the rates of the rests by one sigma of each component of the Earth's horizontal rate, (m, 3, 2 c) [rad/s].

    For c groups of rests that turns join, down (m, 3) being the unit force in each; none where gimbals tell the
    attitude or no turn was logged: there a heading is whatever it was.
    """
    if recording.platform.axes or not logged_turns(recording):
        return np.zeros((len(down), 3, 0))
    try:
        turn = turned(turns, fit_turns(turns, GYROSCOPE_INPUT_TERMS).effects)
    except InputError:  # too few turns for a fit: as they read
        turn = turned(turns, ())
    followed = dict(zip(turns.ends.tolist(), turn, strict=True))
    columns: list[Array] = []
    heading = np.zeros(3)
    for k, d in enumerate(down):
        C = followed.get(k)
        if C is None or np.linalg.norm(C @ down[k - 1] - d) > MAX_TURN_ERROR_RAD:
            heading = normal_to(d)
            columns.append(np.zeros((len(down), 3, 2)))
        else:
            heading = C @ heading
            heading = heading - d * (d @ heading)
            heading = heading / np.linalg.norm(heading)
        columns[-1][k] = np.stack([heading, np.cross(d, heading)], axis=-1)
    sigma = horizontal_sigma(recording.site.latitude)
    alone = [x for x in columns if np.count_nonzero(np.abs(x).sum(axis=(1, 2))) > 1]
    return sigma * np.concatenate(alone, axis=-1) if alone else np.zeros((len(down), 3, 0))
