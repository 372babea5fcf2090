"""An attitude that was logged beside gyroscopes, at times of its own: quaternion or Euler angles, body to world."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from gimbalcal.checks.spikes import spikes
from gimbalcal.errors import InputError
from gimbalcal.number import Array
from gimbalcal.recording import Recording
from gimbalcal.rotation import frame_rotation

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

    def rate_size(self) -> tuple[Array, Array]:
        """The same times, and the size of the rate (k - 1,) [rad/s]."""
        at, w = self.rates()
        return at, np.linalg.norm(w, axis=1)

    def covers(self, begin: float, end: float) -> bool:
        """Return whether attitudes were logged from begin to end without a pause."""
        if begin < self.time[0] or end > self.time[-1]:
            return False
        a, b = np.searchsorted(self.time, [begin, end])
        return bool(np.diff(self.time[max(a - 1, 0) : b + 1]).max(initial=0.0) <= MAX_GAP_STEPS * self.step)


def reference_of(recording: Recording) -> Reference:
    """The attitude in the rows that have one, but those that leap away for a row and back.

    InputError where there is none, or quaternions are no units.
    """
    axes = QUATERNION if ("attitude", "qw") in recording.channels else EULER
    if ("attitude", axes[0]) not in recording.channels:
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
