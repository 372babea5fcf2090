"""Gimbals, encoders and what carries them: why a readout is not the angle of the platform."""

from __future__ import annotations

from gimbalcal.effects.effect import GIMBALS, Effect, Stage, Stimulus, effect, parameter
from gimbalcal.number import Array


@effect
class GimbalZero(Effect):
    r"""The zero of an angle sensor is off: the true angle is the readout plus this.

    .. math:: \theta = \theta_{readout} + \theta_0

    Source: Wu et al. (2018), section 3: theta_10 (platform), theta_20 (inner), theta_30 (middle). Magnitude: 1 to
    100 arcsec. Seen by: the same gimbal with gravity on two sides of it.
    """

    id = "gimbal_zero"
    stage = Stage.ENCODER
    sources = ("wu2018",)
    theta_0: Array = parameter(GIMBALS, unit="arcsec", sigma=120, name="gimbal_zero")

    def contribution(self, s: Stimulus) -> Array:
        """Angle minus readout [rad], (n, k)."""
        return self.theta_0 + 0 * s.readout


@effect
class PolarAxisMisalignment(Effect):
    r"""The inertially fixed platform starts turned against its drawing: polar axis off the pole, azimuth off.

    .. math:: f^p = R(\varphi_0) f^p_{ideal}

    Magnitude: 5 to 300 arcsec. Seen by: gimbals and force together in a static run; a turn of the encoders alone
    is a gimbal zero.
    """

    id = "polar_axis_misalignment"
    stage = Stage.PLATFORM
    kinds = ("static-run",)
    phi_0: Array = parameter(("equatorial_x", "equatorial_y", "polar"), unit="arcsec", sigma=120, name="phi_0")

    def contribution(self, s: Stimulus) -> Array:
        """Rotation in platform axes [rad], (n, 3)."""
        return self.phi_0 + 0 * s.force


@effect
class BaseTilt(Effect):
    r"""The base is not level and north: a constant rotation against the local level.

    .. math:: C_n^b = R(\kappa_N, \kappa_E, \kappa_D)

    Source: Wu et al. (2018), Eq. (28). Magnitude: 1 to 100 arcsec. Seen by: gimbals; the accelerometers of an
    inertially fixed platform are blind to it.
    """

    id = "base_tilt"
    stage = Stage.BASE
    sources = ("wu2018",)
    kappa: Array = parameter(("north", "east", "down"), unit="arcsec", sigma=120, name="base_tilt")

    def contribution(self, s: Stimulus) -> Array:
        """Rotation about north, east, down [rad], (n, 3)."""
        return self.kappa + 0 * s.force
