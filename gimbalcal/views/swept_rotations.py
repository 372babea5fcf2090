r"""Rotations that gyroscopes sweep over intervals, and their answer to what effects add to the readings.

The rate is solved from the readings y of each sample k, y = h(omega), and a frame turns by

.. math:: P = \prod_k \exp(-[\omega_k \Delta t \times]), \qquad
          \delta\phi = -\sum_k P_{k+1 \dots n} \, J_l(\omega_k \Delta t) \, D_k^{-1} \, \delta y_k \, \Delta t ,

with D = dh/d(omega), as a rate that reads as it does is off by -D^-1 times what an effect adds to the reading.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from gimbalcal.effects import Effect, Stage, Stimulus
from gimbalcal.effects.effect import GYROSCOPE_STAGES
from gimbalcal.errors import InputError
from gimbalcal.forward import Rows, gyroscopes, linearise
from gimbalcal.inversion import invert_response
from gimbalcal.number import Array
from gimbalcal.platform import BENCH
from gimbalcal.recording.record import RATES
from gimbalcal.rotation import exponential, left_jacobian


@dataclass(frozen=True, eq=False)
class Sweeps:
    """Readings (m, n, 3) [rad/s] of m intervals, at steps (m, n) [s] that are 0 beyond the end, and their stimulus."""

    reading: Array
    step: Array
    stimulus: Stimulus


def swept_rotation(sweeps: Sweeps, effects: Sequence[Effect]) -> Array:
    """Return the rotation of the frame in each interval (m, 3, 3), with these effects of the gyroscopes."""
    w, _ = _corrected_rates(sweeps, effects)
    return _cumulative_rotations(w.reshape(sweeps.reading.shape) * sweeps.step[..., None])[0]


def swept_rows(sweeps: Sweeps, effects: Sequence[Effect]) -> tuple[Array, Rows]:
    """Return the rotations (m, 3, 3), and rows (m, 3) of their rotation vectors, without a residual.

    Raises InputError where different rates read the same.
    """
    m, n = sweeps.step.shape
    w, D = _corrected_rates(sweeps, effects)
    phi = w.reshape(m, n, 3) * sweeps.step[..., None]
    P, tail = _cumulative_rotations(phi)
    moved = -(tail @ left_jacobian(phi) @ np.linalg.inv(D).reshape(m, n, 3, 3)) * sweeps.step[..., None, None]
    read = linearise(BENCH, sweeps.stimulus.at(rate=w), effects, channels=RATES, stages=GYROSCOPE_STAGES)

    @cache
    def sensitivity(stage: Stage) -> Array:
        R = read.sensitivity(stage).reshape(m, n, 3, 3)
        return np.moveaxis(moved @ R, 1, 2).reshape(m, 3, 3 * n)

    return P, replace(read, residual=np.zeros((m, 3)), sensitivity=sensitivity)


def _corrected_rates(sweeps: Sweeps, effects: Sequence[Effect]) -> tuple[Array, Array]:
    """Rates (m n, 3) that read as they do, and D (m n, 3, 3)."""
    w, D, flat = invert_response(lambda rate: gyroscopes(rate, sweeps.stimulus, effects), sweeps.reading.reshape(-1, 3))
    if np.any(flat):
        raise InputError("no model of the gyroscopes turns with the unit: one of them does not follow its rate")
    return w, D


def _cumulative_rotations(phi: Array) -> tuple[Array, Array]:
    """Rotation of each interval (m, 3, 3), and that from each sample on (m, n, 3, 3), of rotation vectors (m, n, 3)."""
    C = exponential(phi)
    tail = np.empty_like(C)
    P = np.broadcast_to(np.eye(3), (len(C), 3, 3))
    for k in range(C.shape[1] - 1, -1, -1):
        tail[:, k] = P
        P = P @ C[:, k]
    return P, tail
