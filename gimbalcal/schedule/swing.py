r"""A table that swings about three axes at once, in closed form.

From where the unit stands it is turned by a heading h, a pitch p and a roll r about its own z, y and x, each
:math:`a \sin 2 \pi f t`, so that

.. math:: \omega = (\dot r - \dot h \sin p, \;\; \dot p \cos r + \dot h \cos p \sin r, \;\;
          \dot h \cos p \cos r - \dot p \sin r) .
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gimbalcal.number import Array
from gimbalcal.rotation import frame_rotation


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
