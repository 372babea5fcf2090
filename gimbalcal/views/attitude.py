r"""A moving gyroscope triad against a logged attitude: the rotation of each interval, swept and as the reference says.

Over an interval the gyroscopes make the rotation P, the reference from its attitude C at both ends Q; its stamps are
late by tau, and its body frame is turned to the gyroscopes' by M,

.. math:: P(\theta) = (1 - [\epsilon \times]) \, M Q(\tau) M^T , \qquad Q(\tau) = C(t_1 + \tau) \, C(t_0 + \tau)^T .

The mounting and the lag are nuisances without a prior. With R = P M Q^T M^T, and a_0 and a_1 what a small mounting mu
and lag turn the reference's attitude by at the start and the end, mu + M w dtau with w the rate of the reference,

.. math:: \delta\epsilon = \tfrac12 (\operatorname{tr} R - R) \, (P a_0 - R a_1) - \epsilon \times a_1

in axes that turn with the reference. White noise of the reference is an error that neighbouring intervals share: in
axes of its world the covariance of epsilon is the tridiagonal D of 2 and -1. White noise of the rates, and errors of
either side that change with the motion, differ from interval to interval: a random walk of the angle. Rows are whitened
by the Cholesky factor of

.. math:: V = (1 - a) \, D + 2 a \, I

with a the share of the walk. It determines the weights in the estimate of a bias: with a reference that scatters and
does not wander, the attitudes at both ends of the log decide; with a walk every interval counts equally.

The attitude is logged at times of its own, as a quaternion or Euler angles, body to world.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from gimbalcal.checks.spikes import spikes
from gimbalcal.effects import Effect
from gimbalcal.effects.baseline_effects import GYROSCOPE_BIAS, GYROSCOPE_INPUT_TERMS
from gimbalcal.effects.effect import GYROSCOPE_STAGES
from gimbalcal.errors import InputError
from gimbalcal.forward import Rows
from gimbalcal.kinematics import stimulus_from_truth
from gimbalcal.number import Array, apply_matrix
from gimbalcal.platform import BENCH
from gimbalcal.recording import Recording
from gimbalcal.recording.dwell import PAUSE_STEPS
from gimbalcal.recording.record import ANGLE, RATE, RATES
from gimbalcal.rotation import (
    cross_matrix,
    exponential,
    frame_rotation,
    left_jacobian,
    mean_rates,
    small_rotation_vector,
)
from gimbalcal.views.core import Measurement, View, nuisance, recording_fields
from gimbalcal.views.noise import NoiseModel
from gimbalcal.views.swept_rotations import Sweeps, swept_rows

if TYPE_CHECKING:
    from scipy.spatial.transform import RotationSpline

QUATERNION, EULER = ("qw", "qx", "qy", "qz"), ("roll", "pitch", "yaw")
MAX_LENGTH_ERROR = 0.1  # a quaternion's length may be off one by so much: it was rounded, not wrong
MAX_GAP_STEPS = 5.0  # usual steps: no attitude is interpolated within a longer gap
MIN_ROWS = 20


@dataclass(frozen=True)
class Reference:
    """C (k, 3, 3), components in the body of a vector in the world, at times (k,) [s]; `gone` are times left out."""

    time: Array
    C: Array
    gone: tuple[float, ...] = ()

    @property
    def step(self) -> float:
        """Usual time from one attitude to the next [s]."""
        return float(np.median(np.diff(self.time)))

    def at(self, time: Array) -> Array:
        """C (..., 3, 3) at any time inside, smooth in the rate (a spline of rotations)."""
        return np.asarray(np.swapaxes(self._spline(np.clip(time, self.time[0], self.time[-1])).as_matrix(), -1, -2))

    def turning(self, time: Array) -> Array:
        """Return the rate of the body (..., 3) [rad/s] at any time inside, in its axes: dC/dt = -[w x] C."""
        return np.asarray(self._spline(np.clip(time, self.time[0], self.time[-1]), 1))

    @cached_property
    def _spline(self) -> RotationSpline:
        from scipy.spatial.transform import Rotation, RotationSpline

        return RotationSpline(self.time, Rotation.from_matrix(np.swapaxes(self.C, -1, -2)))

    def rates(self) -> tuple[Array, Array]:
        """Times (k - 1,) half way between attitudes, and the body's rate there (k - 1, 3) [rad/s]."""
        from scipy.spatial.transform import Rotation

        turned = Rotation.from_matrix(self.C[:-1] @ np.swapaxes(self.C[1:], -1, -2)).as_rotvec()
        return (self.time[1:] + self.time[:-1]) / 2, turned / np.diff(self.time)[:, None]

    def covers(self, begin: float, end: float) -> bool:
        """Return whether attitudes were logged from begin to end without a pause."""
        if begin < self.time[0] or end > self.time[-1]:
            return False
        a, b = np.searchsorted(self.time, [begin, end])
        return bool(np.diff(self.time[max(a - 1, 0) : b + 1]).max(initial=0.0) <= MAX_GAP_STEPS * self.step)


def reference_of(recording: Recording) -> Reference:
    """Return the attitude where it was logged, or by the angles of the rig, without outliers of a single row.

    Raises InputError for a recording without one, and for quaternions that are not of unit length.
    """
    axes = QUATERNION if ("attitude", "qw") in recording.channels else EULER
    if ("attitude", axes[0]) not in recording.channels:
        if recording.platform.axes and recording.has(ANGLE):
            return _without_leaps(recording.time, np.asarray(recording.platform.attitude(recording.angles())))
        raise InputError(
            f'{recording.title!r} has no attitude; add its columns to [columns]: quantity = "attitude", axis = "qw", '
            '"qx", "qy" and "qz", or "roll", "pitch" and "yaw"'
        )
    values = np.stack([recording.channels["attitude", a] for a in axes], axis=1)
    rows = np.all(np.isfinite(values), axis=1)
    time, values = recording.time[rows], values[rows]
    if len(time) < MIN_ROWS:
        raise InputError(
            f"{recording.title!r} has an attitude in {len(time)} of its rows, at least {MIN_ROWS} are needed"
        )
    if axes is EULER:
        roll, pitch, yaw = values.T
        return _without_leaps(time, frame_rotation("x", roll) @ frame_rotation("y", pitch) @ frame_rotation("z", yaw))
    length = np.linalg.norm(values, axis=1)
    if np.any(np.abs(length - 1) > MAX_LENGTH_ERROR):
        bad = int(np.argmax(np.abs(length - 1)))
        raise InputError(
            f"{recording.title!r}, at {time[bad]:.10g} s: the quaternion has length {length[bad]:.3g}; it must be one, "
            "give qw, qx, qy and qz each their own column"
        )
    from scipy.spatial.transform import Rotation

    turned = Rotation.from_quat(values[:, [1, 2, 3, 0]])
    return _without_leaps(time, np.swapaxes(turned.as_matrix(), -1, -2))


def _without_leaps(time: Array, C: Array) -> Reference:
    """Attitudes C (k, 3, 3) but single ones that are off: matrices neither wrap nor change their sign."""
    leaps = spikes({str(i): x for i, x in enumerate(C.reshape(-1, 9).T)}, slow=True)
    off = np.any(list(leaps.values()), axis=0)
    return Reference(time[~off], C[~off], tuple(time[off].tolist()))


INTERVAL_S = 0.5  # long enough that the reference's noise is little of a turn, short enough for a wrist's motion
MAX_INTERVALS = 1200  # of a longer log they are longer
MOUNTING, LAG = "mounting", "lag"

ATTITUDE = Measurement("attitude", "arcmin")


def against_reference(
    recording: Recording, known: Reference, mounting: Array, lag: float, walk_share: float = 0.0
) -> View:
    """Return the view of the intervals of a recording; mounting M (3, 3) and lag [s] are where the nuisances are zero.

    walk_share: share of the random walk of the angle in the variance of a row, see `covariance`.
    Intervals begin and end at samples of the gyroscopes, with the reference on both ends and no pause in them.
    """
    time, y = recording.time, recording.triad(RATE)
    start, n = intervals(time, known, lag)
    spans = start[:, None] + np.arange(n + 1)
    rate = np.array([np.sum(mean_rates(time[s], y[s]), axis=0) for s in spans]).reshape(-1, 3)
    still = replace(recording.select(slice(0, 1)), platform=BENCH, position=None)
    s = stimulus_from_truth(still, np.zeros((1, 3)), np.zeros((1, 3))).held(len(rate))
    s = s.at(rate=rate, time=time[spans[:, 1:]].ravel() - time[0])
    sweeps = Sweeps(rate.reshape(-1, n, 3), np.diff(time[spans], axis=1), s)
    ends = time[spans[:, [0, -1]]]
    whiten = np.linalg.inv(np.linalg.cholesky(covariance(start, n, walk_share)))

    def about(x: Array) -> View:
        M = exponential(x[:3]) @ mounting
        C0, C1 = (known.at(ends[:, i] + lag + x[3]) for i in (0, 1))
        w0, w1 = (apply_matrix(M, known.turning(ends[:, i] + lag + x[3])) for i in (0, 1))
        J, A, to_world = left_jacobian(x[:3]), M @ (C1 @ np.swapaxes(C0, -1, -2)) @ M.T, np.swapaxes(M @ C1, -1, -2)

        def rows(effects: Sequence[Effect]) -> Rows:
            P, turned = swept_rows(sweeps, effects)
            R = P @ np.swapaxes(A, -1, -2)
            epsilon, K = small_rotation_vector(R), (np.trace(R, axis1=1, axis2=2)[:, None, None] * np.eye(3) - R) / 2
            start = np.concatenate([np.broadcast_to(J, R.shape), w0[..., None]], axis=-1)  # by mounting and lag
            end = np.concatenate([np.broadcast_to(J, R.shape), w1[..., None]], axis=-1)
            N = K @ (P @ start - R @ end) - cross_matrix(epsilon) @ end
            turned = turned.reduced(lambda X: whitened(to_world @ K @ X))
            residual = -whitened(apply_matrix(to_world, epsilon))
            return replace(turned, residual=residual, nuisance=whitened(to_world @ N))

        def whitened(X: Array) -> Array:
            return (whiten @ X.reshape(len(X), -1)).reshape(X.shape)

        return View(
            ATTITUDE, channels=RATES, **recording_fields(recording.select(spans[:, -1])), stimulus=s,
            evaluate=rows, stages=GYROSCOPE_STAGES, baseline=(*GYROSCOPE_BIAS, *GYROSCOPE_INPUT_TERMS),
            groups=np.arange(len(start)), noise=NoiseModel(), about=about,
            nuisances=(*(nuisance(MOUNTING, a, "arcmin", np.inf) for a in "xyz"), nuisance(LAG, "", "ms", np.inf)),
        )  # fmt: skip

    return about(np.zeros(4))


def intervals(time: Array, known: Reference, lag: float) -> tuple[NDArray[np.int64], int]:
    """Return the first samples (m,) of the intervals over which rates are compared with a known attitude.

    Each has n steps, the second value, without a pause of the clock, and the reference covers it at this lag [s].
    """
    dt = np.diff(time)
    step = float(np.median(dt))
    n = max(2, round(max(INTERVAL_S, 2 * known.step, (time[-1] - time[0]) / MAX_INTERVALS) / step))
    start = [
        k
        for k in range(0, len(time) - n, n)
        if dt[k : k + n].max() <= PAUSE_STEPS * step and known.covers(time[k] + lag, time[k + n] + lag)
    ]
    return np.array(start, dtype=np.int64), n


def covariance(start: NDArray[np.int64], n: int, walk_share: float = 0.0) -> Array:
    """Return the covariance (m, m) of intervals of n steps, of variance two; those that follow share an end."""
    V = 2.0 * np.eye(len(start))
    at = np.flatnonzero(start[1:] == start[:-1] + n)
    V[at, at + 1] = V[at + 1, at] = walk_share - 1.0
    return V
