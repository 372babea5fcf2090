"""Encoders of gimbals and the worms that drive them: errors that come back with the angle."""

from __future__ import annotations

import numpy as np

from gimbalcal.effects.effect import (
    EVERY_KIND,
    GIMBALS,
    Effect,
    Grid,
    Role,
    Stage,
    Stimulus,
    constant,
    effect,
    parameter,
)
from gimbalcal.number import Array, cos, sin


@effect
class EncoderEccentricity(Effect):
    r"""The circle of an angle encoder is centred off its axis: an error once per revolution.

    .. math:: \delta\theta = A \sin\theta + B \cos\theta

    Source: geometry: offset over radius, 1 um on 50 mm is 4.1 arcsec. Magnitude: 1 to 40 arcsec. Seen by: a pattern
    in the gimbal angle, three channels together. Confounded with: gimbal_flexure on a horizontal axis; absorbed in
    a static run on gimbals that stand still.
    """

    id = "encoder_eccentricity"
    says = "the angle encoder of {who} sits off its centre: it errs by {size} once a turn"
    stage = Stage.ENCODER
    kinds = EVERY_KIND
    channel = "gimbal_angle"
    A: Array = parameter(GIMBALS, unit="arcsec", sigma=10, name="eccentricity_sin")
    B: Array = parameter(GIMBALS, unit="arcsec", sigma=10, name="eccentricity_cos")

    def contribution(self, s: Stimulus) -> Array:
        """Return the angle minus readout [rad], (n, k)."""
        return self.A * sin(s.angle) + self.B * cos(s.angle)


@effect
class EncoderTwoCycle(Effect):
    r"""An elliptic circle or bearing: an error twice per revolution.

    .. math:: \delta\theta = A \sin 2\theta + B \cos 2\theta

    Source: geometry of a read head on an ellipse. Magnitude: 0.3 to 5 arcsec. Seen by: a pattern in twice the
    gimbal angle. Confounded with: base_tilt_diurnal in a static run shorter than weeks.
    """

    id = "encoder_two_cycle"
    says = "the angle encoder of {who} errs by {size} twice a turn"
    stage = Stage.ENCODER
    kinds = EVERY_KIND
    channel = "gimbal_angle"
    A: Array = parameter(GIMBALS, unit="arcsec", sigma=3, name="two_cycle_sin")
    B: Array = parameter(GIMBALS, unit="arcsec", sigma=3, name="two_cycle_cos")

    def contribution(self, s: Stimulus) -> Array:
        """Return the angle minus readout [rad], (n, k)."""
        return self.A * sin(2 * s.angle) + self.B * cos(2 * s.angle)


@effect
class EncoderHarmonic(Effect):
    r"""A clamped or warped circle: an error n times per revolution, n of 3 and more.

    .. math:: \delta\theta = A \sin n\theta + B \cos n\theta

    Source: geometry of a circle held at n points. Magnitude: 0.1 to 2 arcsec. Seen by: as many angles as 2 n + 1.
    Confounded with: higher and lower n, which alias on a schedule of 45 degree steps.
    """

    id = "encoder_harmonic"
    says = "the angle encoder of {who} errs by {size}, several times a turn"
    stage = Stage.ENCODER
    kinds = EVERY_KIND
    channel = "gimbal_angle"
    role = Role(excluded="it describes a shape, not a cause")
    A: Array = parameter(GIMBALS, unit="arcsec", sigma=1, name="harmonic_sin")
    B: Array = parameter(GIMBALS, unit="arcsec", sigma=1, name="harmonic_cos")
    order: float = constant(3.0, unit="1", low=3.0, high=24.0, grid=Grid.WHOLE)

    def contribution(self, s: Stimulus) -> Array:
        """Return the angle minus readout [rad], (n, k)."""
        return self.A * sin(self.order * s.angle) + self.B * cos(self.order * s.angle)


@effect
class EncoderCyclicError(Effect):
    r"""Interpolation between the lines of the circle is imperfect: an error once per line.

    .. math:: \delta\theta = A \sin N\theta + B \cos N\theta

    Source: sine and cosine channels of unequal gain and offset. Magnitude: 0.05 to 1 arcsec. Seen by: a slow sweep
    over one line. Confounded with: setting_error on widely spaced positions.
    """

    id = "encoder_cyclic_error"
    says = "the angle encoder of {who} errs by {size} within each of its lines"
    stage = Stage.ENCODER
    kinds = EVERY_KIND
    channel = "gimbal_angle"
    role = Role(excluded="it describes a shape, not a cause")
    A: Array = parameter(GIMBALS, unit="arcsec", sigma=0.5, name="cyclic_sin")
    B: Array = parameter(GIMBALS, unit="arcsec", sigma=0.5, name="cyclic_cos")
    lines: float = constant(360.0, unit="1", low=32.0, high=65536.0, grid=Grid.WHOLE)

    def contribution(self, s: Stimulus) -> Array:
        """Return the angle minus readout [rad], (n, k)."""
        return self.A * sin(self.lines * s.angle) + self.B * cos(self.lines * s.angle)


@effect
class PeriodicWormError(Effect):
    r"""A worm that runs out of true pushes its wheel to and fro, in the same way in each turn of the worm.

    .. math:: \delta\theta = A \sin N\theta + B \cos N\theta + A_2 \sin 2N\theta + B_2 \cos 2N\theta
              + A_3 \sin 3N\theta + B_3 \cos 3N\theta + A_4 \sin 4N\theta + B_4 \cos 4N\theta
              + A_5 \sin 5N\theta + B_5 \cos 5N\theta

    with N the teeth of the wheel: the error has the period of a tooth and need not be a sinusoid, as the flanks of the
    worm and the gears that drive it add harmonics. Source: Wallace, TPOINT manual. Magnitude: 1 to 30 arcsec. Seen by:
    tracking over one tooth. Confounded with: encoder_cyclic_error with as many lines as teeth.
    """

    id = "periodic_worm_error"
    says = "the worm of {who} pushes it to and fro by {size}"
    stage = Stage.ENCODER
    channel = "gimbal_angle"
    kinds = ("pointing",)
    sources = ("wallace_tpoint",)
    A: Array = parameter(GIMBALS, unit="arcsec", sigma=10, name="worm_sin")
    B: Array = parameter(GIMBALS, unit="arcsec", sigma=10, name="worm_cos")
    A_2: Array = parameter(GIMBALS, unit="arcsec", sigma=5, name="worm_2_sin", order=2)
    B_2: Array = parameter(GIMBALS, unit="arcsec", sigma=5, name="worm_2_cos", order=2)
    A_3: Array = parameter(GIMBALS, unit="arcsec", sigma=3, name="worm_3_sin", order=3)
    B_3: Array = parameter(GIMBALS, unit="arcsec", sigma=3, name="worm_3_cos", order=3)
    A_4: Array = parameter(GIMBALS, unit="arcsec", sigma=2, name="worm_4_sin", order=4)
    B_4: Array = parameter(GIMBALS, unit="arcsec", sigma=2, name="worm_4_cos", order=4)
    A_5: Array = parameter(GIMBALS, unit="arcsec", sigma=2, name="worm_5_sin", order=5)
    B_5: Array = parameter(GIMBALS, unit="arcsec", sigma=2, name="worm_5_cos", order=5)
    teeth: float = constant(360.0, unit="1", low=30.0, high=2000.0, grid=Grid.WHOLE)

    def contribution(self, s: Stimulus) -> Array:
        """Return the angle minus readout [rad], (n, k)."""
        each = (self.A, self.B), (self.A_2, self.B_2), (self.A_3, self.B_3), (self.A_4, self.B_4), (self.A_5, self.B_5)
        phase = self.teeth * s.angle
        return np.asarray(sum(a * sin(k * phase) + b * cos(k * phase) for k, (a, b) in enumerate(each, 1)))
