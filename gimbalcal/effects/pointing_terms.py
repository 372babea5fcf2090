"""Between the innermost gimbal and the sky: why a telescope or antenna does not look where its encoders say."""

from __future__ import annotations

import numpy as np

from gimbalcal.earth import HOUR
from gimbalcal.effects.effect import (
    GIMBALS,
    SCALAR,
    Effect,
    Grid,
    Role,
    Stage,
    Stimulus,
    constant,
    effect,
    parameter,
)
from gimbalcal.number import Array, maximum

MIN_SINE_OF_ELEVATION = 1 / 57  # a degree, below which the refraction of a plane-parallel atmosphere is far too large


@effect
class AxisCollimation(Effect):
    r"""The line of sight is not square to the innermost axis (TPOINT: CA, CH; cone error).

    .. math:: \vartheta = (0, 0, c), \qquad \delta(\text{across}) = c

    Source: Wallace, TPOINT manual. Magnitude: 1 to 600 arcsec. Seen by: the two pier sides, or low against high
    elevation. Confounded with: gimbal_nonorthogonality over a narrow range of the innermost axis.
    """

    id = "axis_collimation"
    says = "the line of sight is not square to its axis, by {size}"
    role = Role(textbook_kinds=("pointing",))
    stage = Stage.LINE_OF_SIGHT
    channel = "pointing"
    kinds = ("pointing",)
    sources = ("wallace_tpoint",)
    c: Array = parameter(SCALAR, unit="arcsec", sigma=120, name="axis_collimation")

    def contribution(self, s: Stimulus) -> Array:
        """Return the rotation of the line of sight about the platform's z axis [rad], (n, 3)."""
        return np.stack([0 * s.force[..., 0], 0 * s.force[..., 0], self.c + 0 * s.force[..., 2]], axis=-1)


@effect
class TubeFlexure(Effect):
    r"""The line of sight sags with the part of gravity that acts across the tube (TPOINT: TF).

    .. math:: \vartheta = k \, x_p \times d, \qquad d = -\frac{f}{g}, \qquad
              \delta(\text{along}) = -k \, d_z = -k \cos E, \qquad \delta(\text{across}) = k \, d_y

    Source: Wallace, TPOINT manual. Magnitude: 1 to 60 arcsec. Seen by: low against high elevation. Confounded with:
    a once-per-turn encoder error of a horizontal axis.
    """

    id = "tube_flexure"
    says = "the tube sags by {size}"
    role = Role(textbook_kinds=("pointing",))
    stage = Stage.LINE_OF_SIGHT
    channel = "pointing"
    kinds = ("pointing",)
    sources = ("wallace_tpoint",)
    k: Array = parameter(SCALAR, unit="arcsec", sigma=30, name="tube_flexure")

    def contribution(self, s: Stimulus) -> Array:
        """Return the rotation of the line of sight towards down [rad], (n, 3)."""
        return self.k * _towards_down(s)


@effect
class Refraction(Effect):
    r"""Refraction left over, or flexure of like form: the sky stands higher than was computed, by cot(elevation).

    .. math:: \vartheta = \frac{R}{\max(1 / 57, \; f_x / g)} \, x_p \times d, \qquad d = -\frac{f}{g}, \qquad
              E_{seen} - E_{true} = R \cot E

    It is the refraction of a plane-parallel atmosphere, which ends a degree above the horizon: what is lower is
    refracted as there.

    Source: Wallace, TPOINT manual (TX); Explanatory Supplement (plane-parallel atmosphere, R about 60 arcsec in
    full). Magnitude: 0.5 to 10 arcsec left over. Seen by: elevations below 30 deg. Confounded with: tube_flexure at
    high elevation.
    """

    id = "refraction"
    says = "refraction is left over, or the tube sags like it: {size}"
    role = Role(textbook_kinds=("pointing",))
    stage = Stage.LINE_OF_SIGHT
    channel = "pointing"
    kinds = ("pointing",)
    sources = ("wallace_tpoint",)
    R: Array = parameter(SCALAR, unit="arcsec", sigma=10, name="refraction")

    def contribution(self, s: Stimulus) -> Array:
        """Return the rotation of the line of sight to the true place of what is seen, R cot E lower [rad], (n, 3)."""
        return _towards_down(s) * (self.R / _sine_of_elevation(s))[..., None]


@effect
class GimbalZeroDrift(Effect):
    r"""The zero of an angle sensor wanders: a slipping clutch, or a drive that runs fast.

    .. math:: \delta\theta = \dot\theta_0 t, \qquad \theta = \theta_{readout} + \delta\theta

    Source: Wallace, TPOINT manual, zero points that change during a night. Magnitude: 1 to 300 arcsec/h.
    Seen by: stars in the same part of the sky early and late. Confounded with: base_tilt_drift where only one part
    of it is seen.
    """

    id = "gimbal_zero_drift"
    says = "the zero of {who} wanders by {size}"
    stage = Stage.ENCODER
    role = Role(time_drift=True)
    channel = "pointing"
    kinds = ("pointing",)
    sources = ("wallace_tpoint",)
    rate: Array = parameter(GIMBALS, unit="arcsec/h", sigma=60, name="gimbal_zero_drift")

    def contribution(self, s: Stimulus) -> Array:
        """Return the angle minus readout [rad], (n, k)."""
        return self.rate * s.time[..., None] + 0 * s.readout


@effect
class GimbalZeroStep(Effect):
    r"""The zero of an angle sensor jumps once: a clutch slips, a tooth or a count is lost.

    .. math:: \delta\theta = J \, [t \geq t_0], \qquad \theta = \theta_{readout} + \delta\theta

    Source: Wallace, TPOINT manual, zero points that change during a night. Magnitude: 5 to 600 arcsec. Seen
    by: stars in the same part of the sky before and after. Confounded with: gimbal_zero_drift where few stars are.
    """

    id = "gimbal_zero_step"
    says = "the zero of {who} jumps once, by {size}"
    stage = Stage.ENCODER
    channel = "pointing"
    kinds = ("pointing",)
    sources = ("wallace_tpoint",)
    J: Array = parameter(GIMBALS, unit="arcsec", sigma=30, name="gimbal_zero_step")
    epoch: float = constant(1.0, unit="s", low=0.0, high=100 * 24 * HOUR, grid=Grid.EPOCH)

    def contribution(self, s: Stimulus) -> Array:
        """Return the angle minus readout [rad], (n, k)."""
        return self.J * np.asarray(s.onwards >= self.epoch, dtype=float)[..., None] + 0 * s.readout


@effect
class EncoderScaleFactor(Effect):
    r"""A readout counts too little or too much for a turn: a servo's gear, a tape or a friction wheel.

    .. math:: \delta\theta = s \, \theta

    Source: geometry: the radius of a tape encoder or friction wheel is off by s. Magnitude: 10 to 1000 ppm; a toy
    servo 1 %. Seen by: stars or positions over most of the travel of that axis. Confounded with: gimbal_zero over a
    narrow range; encoder_eccentricity over less than half a turn.
    """

    id = "encoder_scale_factor"
    says = "{who} counts too little or too much for a turn, by {size}"
    stage = Stage.ENCODER
    channel = "gimbal_angle"
    kinds = ("multi-position", "pointing")
    role = Role(max_travel_rad=np.radians(190.0))  # beyond half a turn it is a circle on its axis, which closes
    s: Array = parameter(GIMBALS, unit="ppm", sigma=100, name="encoder_scale_factor")

    def contribution(self, s: Stimulus) -> Array:
        """Return the angle minus readout [rad], (n, k)."""
        return np.asarray(self.s * s.angle)


def _towards_down(s: Stimulus) -> Array:
    """Return x_p cross down, (n, 3): this times k moves the line of sight towards down by k cos(elevation)."""
    down = -s.force / s.gravity
    return np.stack([0 * down[..., 0], -down[..., 2], down[..., 1]], axis=-1)


def _sine_of_elevation(s: Stimulus) -> Array:
    return maximum(s.force[..., 0] / s.gravity, MIN_SINE_OF_ELEVATION)
