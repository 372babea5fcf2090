r"""Turns between rests as gyroscopes measured them, against what gravity's direction, or the gimbals, did.

Rates M w for rates w, M a signed permutation times a ratio of units, turn the unit from rest 1 to rest 2 by

.. math:: f_2 / |f_2| = C(M w) \, f_1 / |f_1|, \qquad C(M w) = M \, C(\det(M) \, w) \, M^T ,

so that all permutations follow from two integrations.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gimbalcal.checks.column_checks import at_end_of_range
from gimbalcal.checks.input_errors import MAX_DEVIATION_RAD, MIN_AGREEMENT, PERMUTATIONS, Correction
from gimbalcal.effects.effect import TRIAD
from gimbalcal.number import Array
from gimbalcal.recording.dwell import dwell_levels, dwells, moves_between_dwells
from gimbalcal.recording.record import ANGLE, FORCE, RATE, Recording
from gimbalcal.rotation import composed_rotation, cross_matrix, exponential

MIN_MOTION_RAD = 0.5  # a turn that moves the reference less deviates by less than `MAX_DEVIATION_RAD` under any sign
MIN_TURNS, MAX_TURNS = 3, 40  # those that move the reference most: enough to distinguish 48 permutations
MATRICES = np.array([p.matrix for p in PERMUTATIONS])
LEFT_HANDED = np.array([int(p.handed < 0) for p in PERMUTATIONS])
MAX_STEPS = 4000  # of a turn; longer ones are averaged
MIN_SPREAD = 0.5  # of the widest axis: counts of a triad that went as far both ways along every axis


@dataclass(frozen=True, eq=False)
class MeasuredTurns:
    """Turns between rests: readings less their level at rest, steps and start, and the reference before and after.

    The reference is a direction (3,) or, from gimbals, an attitude (3, 3) whose columns turn alike.
    """

    reading: list[Array]  # (n, 3) of each turn, SI or counts
    step: list[Array]  # (n,) s
    start: Array  # (m,) s
    before: Array  # (m, 3, k)
    after: Array  # (m, 3, k)

    @property
    def reference(self) -> str:
        """Name of the reference."""
        return "gravity" if self.before.shape[-1] == 1 else "the gimbals"

    @cached_property
    def _of_factor(self) -> dict[float, Array]:
        return {}

    @cached_property
    def _of_permutations(self) -> dict[float, Array]:
        return {}

    @cached_property
    def vectors(self) -> Array:
        """Rotation vectors (m, n, 3) [reading times s] of the steps of each checked turn, zeros behind shorter ones."""
        out = np.zeros((len(self.reading), max(map(len, self.step)), 3))
        for row, w, dt in zip(out, self.reading, self.step, strict=True):
            row[: len(dt)] = w * dt[:, None]
        return out

    def deviation(self, C: Array) -> Array:
        """Return the angle (..., m) [rad] by which turns C (..., m, 3, 3) miss the reference."""
        off = np.linalg.norm(C @ self.before - self.after, axis=(-2, -1)) / np.sqrt(self.before.shape[-1])
        return np.asarray(2 * np.arcsin(np.minimum(off / 2, 1.0)))

    def agreeing(self, correction: Correction) -> int:
        """Return the number of turns that end where the reference does, by corrected rates."""
        return int(np.count_nonzero(self.agrees(correction)))

    def agrees(self, correction: Correction) -> NDArray[np.bool_]:
        """Return which turns (m,) end where the reference does, by corrected rates."""
        return np.asarray(self.deviation(self.turned(correction)) < MAX_DEVIATION_RAD)

    def agreeing_permuted(self, factor: float) -> Array:
        """Return the number of turns (48,) that end where the reference does, by rates times a factor, permuted."""
        if factor not in self._of_permutations:
            P, C = MATRICES[:, None], np.array([self._of(factor), self._of(-factor)])[LEFT_HANDED]
            self._of_permutations[factor] = turns_that_agree(self, P @ C @ P.swapaxes(-1, -2))
        return self._of_permutations[factor]

    def agreeing_by_factor(self, factors: Array) -> Array:
        """Return the number of turns (k,) that end where the reference does, with all rates times each of `factors`."""
        return np.array([int(turns_that_agree(self, self._of(factor))) for factor in factors.tolist()])

    def fitting_factor(self, factors: Array) -> tuple[float, int] | None:
        """Return the least of some factors (k,) of all rates at which nearly all turns end where the reference does.

        Neighbouring factors that do are one, and larger ones go round once more. And how many turns do; None for none.
        """
        agreeing = self.agreeing_by_factor(factors)
        fits = np.flatnonzero(agreeing >= MIN_AGREEMENT * len(self.reading))
        if not len(fits):
            return None
        fits = fits[: 1 + int(np.argmax(np.append(np.diff(fits) > 1, True)))]
        return float(np.exp(np.log(factors[fits]).mean())), int(max(agreeing[fits]))

    def turned(self, correction: Correction) -> Array:
        """Return C (m, 3, 3) of every turn by corrected rates."""
        M = correction.clock * (correction.matrices[RATE][1] if RATE in correction.matrices else np.eye(3))
        sizes = np.abs(M).max(axis=1)
        if np.ptp(sizes) > 0:  # some axes in another unit: M is diagonal
            return composed_rotation(exponential(np.diag(M) * self.vectors))
        P = M / sizes[0]
        return np.asarray(P @ self._of(float(sizes[0] * np.round(np.linalg.det(P)))) @ P.T)

    def _of(self, factor: float) -> Array:
        """Return C (m, 3, 3) of every turn for readings times `factor`: their axes are the same."""
        if factor not in self._of_factor:
            angle, X, XX = self._about_axes
            turned = factor * angle
            self._of_factor[factor] = composed_rotation(np.eye(3) - np.sin(turned) * X + (1 - np.cos(turned)) * XX)
        return self._of_factor[factor]

    @cached_property
    def _about_axes(self) -> tuple[Array, Array, Array]:
        """Return angles (m, n, 1, 1) of the steps, and cross matrices (m, n, 3, 3) of their axes, and their squares."""
        angle = np.linalg.norm(self.vectors, axis=-1)
        X = cross_matrix(self.vectors / np.where(angle > 0, angle, 1.0)[..., None])
        return angle[..., None, None], X, X @ X


def turns_of(recording: Recording) -> MeasuredTurns | None:
    """Return the turns that move the reference most, gravity's direction or else the gimbals.

    None for too few of them, or without gyroscopes along all axes.
    """
    if set(recording.axes(RATE)) != set(TRIAD):
        return None
    visits = dwells(recording)
    clipped = at_end_of_range([recording.channels[RATE, axis] for axis in TRIAD])
    logged = [
        k
        for k, m in enumerate(moves_between_dwells(recording))
        if m.rows.stop - m.rows.start > 2 and not m.paused and not clipped[m.rows].any()
    ]
    for reference in (down_at_rests, _attitude):
        at_rest = reference(recording)
        if at_rest is None:
            continue
        moved = np.linalg.norm(at_rest[1:] - at_rest[:-1], axis=(1, 2))
        order = sorted((k for k in logged if moved[k] > MIN_MOTION_RAD), key=lambda k: -moved[k])[:MAX_TURNS]
        if len(order) < MIN_TURNS:
            continue
        level = dwell_levels(recording, RATE)
        spans = [slice(visits[k].stop - 1, visits[k + 1].start + 1) for k in order]
        averaged = [
            _mean_rates(recording.time[s], recording.triad(RATE, rows=s) - (level[k] + level[k + 1]) / 2)
            for k, s in zip(order, spans, strict=True)
        ]
        after = [k + 1 for k in order]
        start = recording.time[[s.start for s in spans]]
        return MeasuredTurns([r for r, _ in averaged], [t for _, t in averaged], start, at_rest[order], at_rest[after])
    return None


def down_at_rests(recording: Recording) -> Array | None:
    """Return the direction of the force at each rest (m, 3, 1); counts are centred, where every axis went both ways."""
    if set(recording.axes(FORCE)) != set(TRIAD):
        return None
    f = dwell_levels(recording, FORCE)
    if recording.counted(FORCE):
        half = (f.max(0) - f.min(0)) / 2 if len(f) > 1 else np.zeros(3)
        if half.max() == 0 or half.min() < MIN_SPREAD * half.max():
            return None
        f = (f - (f.max(0) + f.min(0)) / 2) / half
    length = np.linalg.norm(f, axis=1, keepdims=True)
    return None if not len(f) or np.any(length == 0) else (f / length)[..., None]


def _attitude(recording: Recording) -> Array | None:
    """Return C_bp (m, 3, 3) at each rest by the gimbals."""
    if not recording.platform.axes or not recording.has(ANGLE):
        return None
    angles = recording.angles()
    return np.asarray(recording.platform.attitude(angles[[d.start for d in dwells(recording)]]))


def _mean_rates(time: Array, y: Array) -> tuple[Array, Array]:
    """Return mean rate (n, 3) and step (n,) from row to row, or over several rows of a very long turn."""
    dt, mean = np.diff(time), (y[1:] + y[:-1]) / 2
    size = -(-len(dt) // MAX_STEPS)
    if size > 1:
        starts = np.arange(0, len(dt), size)
        total = np.add.reduceat(dt, starts)
        mean, dt = np.add.reduceat(mean * dt[:, None], starts) / total[:, None], total
    return mean, dt


def turns_that_agree(turns: MeasuredTurns, C: Array) -> Array:
    """Return the number (...) of turns C (..., m, 3, 3) that end where the reference does."""
    return np.count_nonzero(turns.deviation(C) < MAX_DEVIATION_RAD, axis=-1)
