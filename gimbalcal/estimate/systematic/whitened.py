r"""A recording as independent rows: innovations of a navigator whose sensors are known, and how causes move them.

The gains of a filter do not depend on the data, so its innovations answer anything that is added to force and rate by
the same recursion, and are white where the model is right:

.. math:: x_{k+1} = (1 - K_k H) (\Phi_k x_k + \Psi_k), \qquad e_k = -H (\Phi_k x_k + \Psi_k)

Least squares on them, with the constants free, is what filter and smoother do with the constants as states.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gimbalcal.effects import Effect, Parameter, Stimulus
from gimbalcal.estimate.systematic.course import KEYS
from gimbalcal.estimate.systematic.error_model import STATE, added, answering, felt
from gimbalcal.estimate.systematic.sensors import KIND, read_by, truth
from gimbalcal.estimate.systematic.settle import Settled
from gimbalcal.estimate.systematic.smoothing import VELOCITY, errors_at_start, knocked, of_rest, sigma_at_start
from gimbalcal.estimate.systematic.wander import beside, chains
from gimbalcal.forward import Rows, linearise
from gimbalcal.inference import beside_constants
from gimbalcal.kinematics import stimulus_from_truth
from gimbalcal.navigate.error_growth import NAV
from gimbalcal.number import Array
from gimbalcal.platform import BENCH

EACH = 20  # updates after a turn that stand for themselves: later ones change as slowly as the stop is long
JOINED = 10  # of the later ones in one row
COLUMNS = 48  # answers at a time


@dataclass(frozen=True, eq=False)
class Whitened:
    """n rows of three innovations [m/s], north, east, down, with sigma (n, 3), in the middle of `time` (n,).

    felt: force and rate behind the readings, a row for each group of intervals; stop (n,): ordinal, -1 while turning.
    """

    settled: Settled
    felt: Stimulus
    rows: Rows  # of both triads about the settled effects, a row for each group
    residual: Array
    sigma: Array
    time: Array
    stop: NDArray[np.int64]
    navigator: tuple[Array, Array, Array]  # Phi (K, m, m), gain (K, 3, m), one sigma (K, 3) of an innovation
    u: Array
    block: NDArray[np.int64]  # row of each update, (K,)

    @cached_property
    def _read(self) -> Array:
        """How the readings answer force and rate (g, 6, 6), about the settled effects."""
        return read_by(self.felt, self.settled.effects)

    def added_by(self, effect: Effect, wanted: Sequence[Parameter]) -> Array:
        """What an effect adds to what force and rate seem to be (g, 6, p), in SI per unit of its parameters."""
        return -np.linalg.solve(self._read, np.nan_to_num(self.rows.columns(effect, wanted)))

    def answers(self, D: Array) -> Array:
        """How the rows (n, 3, p) answer additions D (g, 6, p) to what force and rate were, per unit of each."""
        parts = [self._answers(D[..., k : k + COLUMNS]) for k in range(0, D.shape[2], COLUMNS)]
        return np.concatenate(parts, axis=2) if parts else np.zeros((*self.residual.shape, 0))

    def _answers(self, D: Array) -> Array:
        m, (Phi, gain, sigma) = self.settled, self.navigator
        Psi = answering(m.course, self.u, m.C, lambda groups: D[groups], D.shape[2])[1]
        x, out = np.zeros((Phi.shape[1], D.shape[2])), np.zeros((len(Phi), 3, D.shape[2]))
        for k in range(len(Phi)):
            x = Phi[k] @ x
            x[:NAV] += Psi[k]
            for c, i in enumerate(VELOCITY):
                if np.isfinite(sigma[k, c]):
                    y = -x[i]
                    out[k, c] = y
                    x = x + gain[k, c][:, None] * y
        return _joined(out * STATE[3], sigma * STATE[3], self.block)[0]


def whitened(m: Settled) -> Whitened:
    """The rows about the model in which the passes have settled."""
    legs = m.course
    effects = m.effects
    u = truth(legs, effects, m.u)
    expected = felt(legs, u, m.C)
    position = legs.stop[np.searchsorted(legs.first[1:], np.arange(len(u)), side="right")] + 1
    at = position[np.flatnonzero(np.diff(legs.group, prepend=-1))]
    s = stimulus_from_truth(replace(legs.groups, position=at), expected[:, :3], expected[:, 3:])
    s = s.at(time=legs.groups.time - legs.groups.time[0])
    rows = linearise(BENCH, s, effects, KIND, KEYS)
    wander = chains(legs)
    made = answering(
        legs, u, m.C, lambda groups: added(groups.stop - groups.start, len(wander)), added(0, len(wander)).shape[2]
    )
    Phi, none, Q, d = beside(made[0], made[1][:, :, :0], made[2], made[3], made[1], wander)
    x, S = errors_at_start(legs, m.start, m.C), np.diag(sigma_at_start(legs, m.start.sigma))
    R, loose = of_rest(legs, len(Phi)), knocked(Q, m.left_out)
    z = np.where((m.left_out | ~legs.believed)[:, None], np.nan, 0 * R)
    f = beside_constants.filter(Phi, none, loose, d, z, VELOCITY, R, x, np.zeros(0), S, smoothed=0)
    one = np.sqrt(f.variance)
    block = _blocks(legs.stop)
    residual, spread = _joined(f.innovation[..., None] * STATE[3], one * STATE[3], block)
    first = np.flatnonzero(np.diff(block, prepend=-1))
    time = np.add.reduceat((legs.time[1:] + legs.time[:-1]) / 2, first) / np.diff(first, append=len(block))
    return Whitened(m, s, rows, residual[..., 0], spread, time, legs.stop[first], (Phi, f.gain, one), u, block)


def _blocks(stop: NDArray[np.int64]) -> NDArray[np.int64]:
    """Row (K,) of each update: its own while turning and soon after, one of several later in a stop."""
    begins = np.diff(stop, prepend=-2) != 0
    since = np.arange(len(stop)) - np.maximum.accumulate(np.where(begins, np.arange(len(stop)), 0))
    new = begins | (stop < 0) | (since < EACH) | ((since - EACH) % JOINED == 0)
    return np.asarray(np.cumsum(new) - 1)


def _joined(e: Array, sigma: Array, block: NDArray[np.int64]) -> tuple[Array, Array]:
    """Innovations (K, 3, p) of sigma (K, 3) as rows (n, 3, p) of independent noise, and their sigma (n, 3)."""
    first = np.flatnonzero(np.diff(block, prepend=-1))
    used = np.isfinite(sigma)
    count = np.add.reduceat(used, first, axis=0)
    square = np.add.reduceat(np.where(used, sigma, 0.0) ** 2, first, axis=0) / np.maximum(count, 1)
    spread = np.sqrt(np.where(count > 0, square, float(np.nanmax(sigma)) ** 2))
    white = np.where(used[..., None], e / np.where(used, sigma, 1.0)[..., None], 0.0)
    total = np.add.reduceat(white, first, axis=0) / np.sqrt(np.maximum(count, 1))[..., None]
    return total * spread[..., None], spread
