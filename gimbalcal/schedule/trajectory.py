r"""How a unit moves in its place, in closed form: through a rotation schedule, or swinging.

A turn of a schedule speeds up at a constant rate over the ramp r, keeps its rate w, and slows down as it sped up:

.. math:: \theta(u) = \tfrac{w}{2r} u^2 \;(u \le r), \qquad w (u - \tfrac{r}{2}), \qquad
          \theta(T - u) = \theta(T) - \theta(u), \qquad T = |\theta| / w + r .

A turn too short for its rate comes to the rate that its acceleration w / r allows. The Earth turns beneath: rates
against inertial space are :math:`\omega = a \dot\theta + C_n^b \omega_{ie}`.

A swinging table turns the unit from where it stands by a heading h, a pitch p and a roll r about its own z, y and x,
each :math:`a \sin 2 \pi f t`, so that

.. math:: \omega = (\dot r - \dot h \sin p, \;\; \dot p \cos r + \dot h \cos p \sin r, \;\;
          \dot h \cos p \cos r - \dot p \sin r) .
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from gimbalcal.number import Array
from gimbalcal.rotation import exponential, frame_rotation
from gimbalcal.schedule.commands import RotationSchedule, standing_attitude


class Motion(Protocol):
    """How a unit in its place turns: in closed form, smooth between `corners`."""

    @property
    def duration(self) -> float:
        """Return how long it takes [s]."""

    @property
    def corners(self) -> Array:
        """Return times [s] at which the angular acceleration jumps, in order."""

    def moving(self, start: Array, stop: Array) -> Array:
        """Return whether the unit turns at any time between start and stop (n,) [s]."""

    def at(self, time: Array) -> tuple[Array, Array, Array]:
        """Return C_bn (n, 3, 3), angular rate against the Earth (n, 3) [rad/s] and its slope (n, 3) [rad/s^2]."""


@dataclass(frozen=True, eq=False)
class Trajectory:
    """m turns about axes fixed in the unit: axis (m, 3), angle (m,) [rad], begin, length, ramp (m,) [s], duration [s].

    attitude (m + 1, 3, 3): C_bn at the stops, the first before any turn.
    """

    axis: Array
    angle: Array
    begin: Array
    length: Array
    ramp: Array
    attitude: Array
    duration: float

    @property
    def corners(self) -> Array:
        """Return times [s] at which the angular acceleration jumps, in order."""
        end = self.begin + self.length
        return np.unique(np.concatenate([self.begin, self.begin + self.ramp, end - self.ramp, end]))

    def moving(self, start: Array, stop: Array) -> Array:
        """Return whether the unit turns at any time between start and stop (n,) [s]."""
        i = np.searchsorted(self.begin + self.length, start, side="right")
        return np.asarray((i < len(self.begin)) & (np.append(self.begin, np.inf)[i] < stop))

    def at(self, time: Array) -> tuple[Array, Array, Array]:
        """Return C_bn (n, 3, 3), angular rate against the Earth (n, 3) [rad/s] and its slope (n, 3) [rad/s^2]."""
        if not len(self.begin):
            still = np.zeros((len(time), 3))
            return np.broadcast_to(self.attitude[0], (len(time), 3, 3)), still, still
        i = np.maximum(np.searchsorted(self.begin, time, side="right") - 1, 0)
        u = np.clip(time - self.begin[i], 0.0, self.length[i])
        r, T = self.ramp[i], self.length[i]
        peak = np.divide(self.angle[i], T - r, out=np.zeros(len(time)), where=T > r)
        from_end = np.minimum(u, T - u)
        rise = np.minimum(from_end, r)
        slope = np.divide(peak, r, out=np.zeros(len(time)), where=r > 0)
        turned = slope * rise**2 / 2 + peak * (from_end - rise)
        angle = np.where(u <= T / 2, turned, self.angle[i] - turned)
        turning = (u > 0) & (u < T)
        speed = np.where(turning, np.where(from_end < r, slope * from_end, peak), 0.0)
        speeding = np.where(turning & (from_end < r), np.where(u < T / 2, slope, -slope), 0.0)
        axis = self.axis[i]
        C = self.attitude[i] @ exponential(-angle[:, None] * axis)
        return C, speed[:, None] * axis, speeding[:, None] * axis


@dataclass(frozen=True, eq=False)
class Swing:
    """amplitude (3,) [rad] and frequency (3,) [Hz] of heading, pitch and roll about the attitude start (3, 3), C_bn."""

    amplitude: Array
    frequency: Array
    start: Array
    duration: float

    @property
    def corners(self) -> Array:
        """Return no times: the motion is smooth."""
        return np.zeros(0)

    def moving(self, start: Array, stop: Array) -> Array:
        """Return true at all times: a swing never rests."""
        return np.asarray(stop > start)

    def at(self, time: Array) -> tuple[Array, Array, Array]:
        """Return C_bn (n, 3, 3), angular rate against the Earth (n, 3) [rad/s] and its slope (n, 3) [rad/s^2]."""
        w = 2 * np.pi * self.frequency
        s, c = np.sin(np.outer(time, w)), np.cos(np.outer(time, w))
        (h, p, r), (dh, dp, dr) = (self.amplitude * s).T, (self.amplitude * w * c).T
        ddh, ddp, ddr = (-self.amplitude * w**2 * s).T
        C = self.start @ np.swapaxes(frame_rotation("x", r) @ frame_rotation("y", p) @ frame_rotation("z", h), -1, -2)
        sp, cp, sr, cr = np.sin(p), np.cos(p), np.sin(r), np.cos(r)
        rate = np.stack([dr - dh * sp, dp * cr + dh * cp * sr, dh * cp * cr - dp * sr], axis=-1)
        slope = np.stack(
            [
                ddr - ddh * sp - dh * dp * cp,
                ddp * cr - dp * dr * sr + ddh * cp * sr - dh * dp * sp * sr + dh * dr * cp * cr,
                ddh * cp * cr - dh * dp * sp * cr - dh * dr * cp * sr - ddp * sr - dp * dr * cr,
            ],
            axis=-1,
        )
        return C, rate, slope


def trajectory(schedule: RotationSchedule, tilt: Array | None = None, angle_error: Array | None = None) -> Trajectory:
    """Return the motion of a schedule; `tilt` (3,) [rad] turns it about n, `angle_error` (m,) [rad] adds to turns."""
    own = np.array([m.angle for m in schedule.moves], dtype=float)
    angle = own if angle_error is None else own + angle_error
    stops = np.array([schedule.stop, *(schedule.stop if m.stop is None else m.stop for m in schedule.moves)])
    rate = np.array([schedule.rate if m.rate is None else m.rate for m in schedule.moves])
    full = schedule.ramp * np.ones(len(own))
    short = np.abs(angle) < rate * full
    ramp = np.where(short, np.sqrt(np.abs(angle) * full / rate), full)
    length = np.where(short, 2 * ramp, np.abs(angle) / rate + full)
    begin = np.cumsum(stops[:-1] + np.concatenate([[0.0], length[:-1]])) if len(own) else np.zeros(0)
    C, axes = [standing_attitude(schedule.start)], []
    for i, turn in enumerate(angle):  # the outer axis stays put in the room, wherever the turns before have led
        axes.append(schedule.axis(i, C[-1]))
        C.append(C[-1] @ exponential(-turn * axes[-1]))
    stands = np.stack(C) if tilt is None else exponential(-tilt) @ np.stack(C)
    axis = np.array(axes).reshape(-1, 3)
    return Trajectory(axis, angle, begin, length, ramp, stands, float(stops.sum() + length.sum()))
