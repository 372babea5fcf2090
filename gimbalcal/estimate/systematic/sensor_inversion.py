r"""Invert the sensor model: force and rate behind the readings, and their sensitivity to each parameter.

With y = h(u, theta) the readings of force and rate u (both triads in one vector),

.. math:: u = h^{-1}(y, \theta), \qquad D = \frac{\partial u}{\partial \theta}
          = -\left(\frac{\partial h}{\partial u}\right)^{-1} \frac{\partial h}{\partial \theta}

so that the coupling of any effect into the filter is its own contribution, and a state is added by its name alone.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gimbalcal.effects import CATALOGUE, Effect, Parameter
from gimbalcal.effects.effect import Stimulus
from gimbalcal.forward import linearise, picked, predict
from gimbalcal.kinematics import stimulus_from_truth
from gimbalcal.number import Array, complex_step
from gimbalcal.platform import BENCH
from gimbalcal.recording import Recording
from gimbalcal.views.segments import CHANNELS, Segments

MAX_ITERATIONS, CONVERGED_RESIDUAL = 40, 1e-14  # each multiplies the residual by the sensors' errors, 5 % at most
DIVERGENCE_RATIO = 10.0  # to the smallest residual
KIND = "rotation"


def invert_readings(segments: Segments, effects: Sequence[Effect], start: Array | None = None) -> Array:
    """Return force and rate (n, 6) behind the mean readings, by iteration from `start` (default: the readings).

    Where the iteration diverges (a latency of more than a step), the nearest iterate is returned.
    """
    y = segments.readings
    u = y if start is None else start
    s = stimulus_from_truth(segments.rows, u[:, :3], u[:, 3:])
    size = np.abs(y).max(axis=0)
    nearest, best = np.inf, u
    for _ in range(MAX_ITERATIONS):
        step = _read(s, effects, u)
        np.subtract(y, step, out=step)
        residual = float((np.abs(step).max(axis=0) / np.where(size > 0, size, 1.0)).max())
        if not residual < DIVERGENCE_RATIO * nearest:
            return best
        nearest, best = min((nearest, best), (residual, u), key=lambda each: each[0])
        u = u + step
        if residual <= CONVERGED_RESIDUAL:
            break
    return u


def sensitivity(
    recording: Recording, effects: Sequence[Effect], wanted: Sequence[Parameter], u: Array, rows: slice
) -> Array:
    """Return D (m, 6, p) of some rows of a recording of means, about the effects and the motion u (g, 6)."""
    few = slice(max(rows.start - 1, 0), rows.stop + 1)  # slopes look at the neighbours
    s = stimulus_from_truth(recording.select(few), u[few, :3], u[few, 3:])
    s = s.at(time=recording.time[few] - recording.time[0], rate_slope=s.turning_faster())
    stages = dict.fromkeys(CATALOGUE[p.effect].stage for p in wanted)
    J = linearise(BENCH, s, effects, KIND, CHANNELS, stages=stages).jacobian(wanted)
    if any(np.any(np.asarray(v) != 0) for e in effects for v in vars(e).values()):
        J = np.linalg.solve(complex_step(lambda x: _read(s, effects, x), u[few]), J)
    return -J[rows.start - few.start : rows.stop - few.start]


def reading_jacobian(s: Stimulus, effects: Sequence[Effect]) -> Array:
    """Return the derivative (n, 6, 6) of the readings by force and rate, for a stimulus."""
    return complex_step(lambda x: _read(s, effects, x), np.concatenate([s.force, s.rate], axis=1))


def _read(s: Stimulus, effects: Sequence[Effect], u: Array) -> Array:
    # all six readings by force and rate, where latencies and lever arms couple rows and triads: no stage of `Rows`
    s = s.at(force=u[:, :3], rate=u[:, 3:])
    return picked(BENCH, predict(BENCH, s, effects, KIND), CHANNELS)
