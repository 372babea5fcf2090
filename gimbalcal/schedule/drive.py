r"""A drive on the ellipsoid, smooth in all of its motion: legs from crossing to crossing, bends, stops and hills.

The vehicle rests at first. Each leg begins and ends at rest; its speed rises and falls, and its heading turns by a
right angle in the bend, as :math:`s(x) = x - \sin(2 \pi x) / 2 \pi`, whose first two derivatives vanish at both ends.
It goes where it points, up and down with its pitch, and the place follows from

.. math:: \dot L = \frac{v_N}{M + h}, \qquad \dot\lambda = \frac{v_E}{(N + h) \cos L}, \qquad \dot h = -v_D .
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from gimbalcal.earth import radii
from gimbalcal.number import Array
from gimbalcal.rotation import frame_rotation

if TYPE_CHECKING:
    from scipy.interpolate import CubicHermiteSpline

RAMP_S, BEND_S, BEND_START_S = 20.0, 6.0, 25.0  # s: to come to speed; of a bend, and when it begins in a leg
TURNS = np.array([1, 1, -1, 1, -1, -1, 1, -1])  # right and left, repeatedly: the track closes
PITCH_PERIOD_S = 600.0  # s, period of the pitch
GRID_STEP_S = 0.1  # s, of the grid on which the place is integrated


@dataclass(frozen=True, eq=False)
class Drive:
    """speed [m/s]; leg, rest, duration [s]; pitch [rad] of the hills; latitude [rad] and height [m] at the start."""

    speed: float
    leg: float
    pitch: float
    rest: float
    duration: float
    latitude: float
    height: float

    @property
    def corners(self) -> Array:
        """Return no times: the motion is smooth."""
        return np.zeros(0)

    def moving(self, start: Array, stop: Array) -> Array:
        """Return whether the vehicle has left its place."""
        return np.asarray((stop > self.rest) & (stop > start))

    def at(self, time: Array) -> tuple[Array, Array, Array]:
        """Return C_bn (n, 3, 3), rate against north, east, down (n, 3) [rad/s] and its slope, in vehicle axes."""
        (h, dh, ddh), (p, dp, ddp) = self._heading(time), self._pitch(time)
        C = np.swapaxes(frame_rotation("y", p) @ frame_rotation("z", h), -1, -2)
        s, c = np.sin(p), np.cos(p)
        rate = np.stack([-dh * s, dp, dh * c], axis=-1)
        return C, rate, np.stack([-ddh * s - dh * dp * c, ddp, ddh * c - dh * dp * s], axis=-1)

    def motion(self, time: Array) -> tuple[Array, Array]:
        """Return velocity (n, 3) [m/s] and its slope (n, 3) [m/s^2] in north, east, down."""
        (h, dh, _), (p, dp, _), (v, dv) = self._heading(time), self._pitch(time), self._speed(time)
        along = np.stack([np.cos(p) * np.cos(h), np.cos(p) * np.sin(h), -np.sin(p)], axis=-1)
        by_h = np.stack([-np.cos(p) * np.sin(h), np.cos(p) * np.cos(h), 0 * p], axis=-1)
        by_p = np.stack([-np.sin(p) * np.cos(h), -np.sin(p) * np.sin(h), -np.cos(p)], axis=-1)
        turning = dh[:, None] * by_h + dp[:, None] * by_p
        return v[:, None] * along, dv[:, None] * along + v[:, None] * turning

    def place(self, time: Array) -> Array:
        """Return latitude, longitude from the start [rad] and height [m], (n, 3)."""
        return np.asarray(self._course(time))

    @cached_property
    def _course(self) -> CubicHermiteSpline:
        from scipy.interpolate import CubicHermiteSpline

        t = GRID_STEP_S * np.arange(int(np.ceil(self.duration / GRID_STEP_S)) + 2)
        between = (t[1:] + t[:-1]) / 2
        v, mid = self.motion(t)[0], self.motion(between)[0]

        def integral(y: Array, m: Array) -> Array:
            return np.concatenate([[0.0], np.cumsum(GRID_STEP_S / 6 * (y[1:] + 4 * m + y[:-1]))])

        place = np.array([self.latitude, 0.0, self.height]) + np.zeros((len(t), 3))
        place[:, 2] -= integral(v[:, 2], mid[:, 2])
        for _ in range(3):  # the radii hardly depend on the latitude, which hardly moves
            slope = self._slope(place, v)
            half = self._slope((place[1:] + place[:-1]) / 2, mid)
            place[:, 0] = self.latitude + integral(slope[:, 0], half[:, 0])
            place[:, 1] = integral(slope[:, 1], half[:, 1])
        return CubicHermiteSpline(t, place, self._slope(place, v))

    @staticmethod
    def _slope(place: Array, v: Array) -> Array:
        L, _, h = place.T
        M, N = radii(L)
        return np.stack([v[:, 0] / (M + h), v[:, 1] / ((N + h) * np.cos(L)), -v[:, 2]], axis=-1)

    def _speed(self, time: Array) -> tuple[Array, Array]:
        u = np.where(time > self.rest, (time - self.rest) % self.leg, 0.0)
        up, down = _smooth_step(u / RAMP_S), _smooth_step((self.leg - u) / RAMP_S)
        return self.speed * up[0] * down[0], self.speed * (up[1] * down[0] - up[0] * down[1]) / RAMP_S

    def _heading(self, time: Array) -> tuple[Array, Array, Array]:
        since = np.maximum(time - self.rest, 0.0)
        number, u = (since // self.leg).astype(int), since % self.leg
        senses = TURNS[np.arange(number.max(initial=0) + 1) % len(TURNS)]
        before = np.concatenate([[0], np.cumsum(senses)])[number]
        share, slope, curve = _smooth_step((u - BEND_START_S) / BEND_S)
        quarter = np.pi / 2 * senses[number]
        return np.pi / 2 * before + quarter * share, quarter * slope / BEND_S, quarter * curve / BEND_S**2

    def _pitch(self, time: Array) -> tuple[Array, Array, Array]:
        w, u = 2 * np.pi / PITCH_PERIOD_S, np.maximum(time - self.rest, 0.0)
        share, slope, curve = (x / RAMP_S**i for i, x in enumerate(_smooth_step(u / RAMP_S)))  # it begins level
        s, c = self.pitch * np.sin(w * u), self.pitch * np.cos(w * u)
        return share * s, share * w * c + slope * s, (curve - share * w**2) * s + 2 * slope * w * c


def _smooth_step(x: Array) -> tuple[Array, Array, Array]:
    """Return s(x) from 0 to 1 and its first two derivatives; constant outside."""
    x = np.clip(x, 0.0, 1.0)
    a = 2 * np.pi * x
    return x - np.sin(a) / (2 * np.pi), 1 - np.cos(a), 2 * np.pi * np.sin(a)
