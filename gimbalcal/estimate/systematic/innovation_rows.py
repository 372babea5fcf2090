r"""Independent rows of a recording: innovations of a navigator with calibrated sensors, and their response to causes.

The gains of a filter do not depend on the data, so its innovations respond to anything that is added to force and rate
by the same recursion, and are white where the model is right:

.. math:: x_{k+1} = (1 - K_k H) (\Phi_k x_k + \Psi_k), \qquad e_k = -H (\Phi_k x_k + \Psi_k)

Least squares on them, with the constants free, is what filter and smoother do with the constants as states.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gimbalcal.estimate.systematic.error_model import (
    KIND,
    STATE_SCALE,
    error_model,
    expected_readings,
    invert_readings,
    reading_jacobian,
    stretch_model,
)
from gimbalcal.estimate.systematic.filter_pass import (
    VELOCITY_STATES,
    filter_velocities,
    initial_errors,
    initial_sigma,
    with_velocity_jumps,
)
from gimbalcal.estimate.systematic.iterate import SystematicFit
from gimbalcal.forward import linearise
from gimbalcal.inference import adjoint
from gimbalcal.kinematics import stimulus_from_truth
from gimbalcal.navigate.error_growth import NAV
from gimbalcal.number import Array
from gimbalcal.platform import BENCH
from gimbalcal.views.navigation import InnovationRows
from gimbalcal.views.segments import CHANNELS

SINGLE_UPDATES = 20  # after a turn that make a row each; later in a stop innovations change slowly
JOINED_UPDATES = 10  # of the later ones in one row
BATCH_COLUMNS = 48  # responses computed at a time


def innovation_rows(m: SystematicFit) -> InnovationRows:
    """Return the rows about the model at which the passes ended."""
    segments, effects = m.segments, m.effects
    u = invert_readings(segments, effects, m.u)
    expected = expected_readings(segments, u, m.C)
    position = segments.stop[np.searchsorted(segments.first[1:], np.arange(len(u)), side="right")] + 1
    at = position[np.flatnonzero(np.diff(segments.group, prepend=-1))]
    s = stimulus_from_truth(replace(segments.groups, position=at), expected[:, :3], expected[:, 3:])
    s = s.at(time=segments.groups.time - segments.groups.time[0])
    rows = linearise(BENCH, s, effects, KIND, CHANNELS)
    model = error_model(segments, (), effects, u, m.C)
    x, S = initial_errors(segments, m.start, m.C), np.diag(initial_sigma(segments, m.start.sigma))
    Phi, z = model.Phi, np.zeros((len(model.Phi), 3))
    z[m.excluded | ~segments.believed] = np.nan
    model = model._replace(Psi=model.Psi[:, :, :0], root=with_velocity_jumps(model.root, m.excluded))
    f = filter_velocities(segments, model, z, x, np.zeros(0), S, smoothed=0)
    sigma, block = np.sqrt(f.variance), _block_ordinals(segments.stop)
    residual, row_sigma = _join_innovations(f.innovation[..., None] * STATE_SCALE[3], sigma * STATE_SCALE[3], block)
    first = np.flatnonzero(np.diff(block, prepend=-1))
    time = np.add.reduceat((segments.time[1:] + segments.time[:-1]) / 2, first) / np.diff(first, append=len(block))

    def part(D: Array) -> Array:
        Psi = np.zeros((*Phi.shape[:2], D.shape[2]))
        Psi[:, :NAV] = stretch_model(segments, u, m.C, lambda groups: D[groups], D.shape[2])[1]
        e, _ = adjoint.innovation_response(Phi, Psi, VELOCITY_STATES, sigma, f.gain)
        return _join_innovations(np.nan_to_num(e) * STATE_SCALE[3], sigma * STATE_SCALE[3], block)[0]

    def response(D: Array) -> Array:
        parts = [part(D[..., k : k + BATCH_COLUMNS]) for k in range(0, D.shape[2], BATCH_COLUMNS)]
        return np.concatenate(parts, axis=2) if parts else np.zeros((*row_sigma.shape, 0))

    return InnovationRows(
        s, rows, residual[..., 0], row_sigma, time, segments.stop[first], reading_jacobian(s, effects), response
    )


def _block_ordinals(stop: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the row (K,) of each update: its own while turning and soon after, shared later in a stop."""
    begins = np.diff(stop, prepend=-2) != 0
    since = np.arange(len(stop)) - np.maximum.accumulate(np.where(begins, np.arange(len(stop)), 0))
    new = begins | (stop < 0) | (since < SINGLE_UPDATES) | ((since - SINGLE_UPDATES) % JOINED_UPDATES == 0)
    return np.asarray(np.cumsum(new) - 1)


def _join_innovations(e: Array, sigma: Array, block: NDArray[np.int64]) -> tuple[Array, Array]:
    """Join innovations (K, 3, p) of sigma (K, 3) to rows (n, 3, p) of independent noise, with their sigma (n, 3)."""
    first = np.flatnonzero(np.diff(block, prepend=-1))
    used = np.isfinite(sigma)
    count = np.add.reduceat(used, first, axis=0)
    square = np.add.reduceat(np.where(used, sigma, 0.0) ** 2, first, axis=0) / np.maximum(count, 1)
    spread = np.sqrt(np.where(count > 0, square, float(np.nanmax(sigma)) ** 2))
    white = np.where(used[..., None], e / np.where(used, sigma, 1.0)[..., None], 0.0)
    total = np.add.reduceat(white, first, axis=0) / np.sqrt(np.maximum(count, 1))[..., None]
    return total * spread[..., None], spread
