"""Twelve effects that nobody has asked for, of every kind: what one file has to hold, and nothing elsewhere."""

from math import pi

import numpy as np

from gimbalcal.effects.effect import (
    EVERY_KIND,
    GIMBALS,
    SCALAR,
    TRIAD,
    Effect,
    Grid,
    Stage,
    Stimulus,
    constant,
    parameter,
)
from gimbalcal.effects.effect import effect as entered
from gimbalcal.effects.history import integral, integrated, lagged_states
from gimbalcal.number import Array, cos, exp, sin

BOTH = ("rotation", "multi-position")


def enter() -> tuple[str, ...]:
    """Put all of them into the catalogue; returns their ids, to take them out again."""

    @entered
    class GyroVibration(Effect):
        r"""Vibration is rectified to a rate.

        .. math:: \delta\omega_i = V_i v^2
        """

        id = "toy_gyro_vibration"
        stage = Stage.GYROSCOPE
        channel = "angular_rate"
        kinds = BOTH
        requires = ("covariate:vibration",)
        V: Array = parameter(TRIAD, unit="deg/h/g^2", sigma=30, name="toy_vibration_rate")

        def contribution(self, s: Stimulus) -> Array:
            return self.V * np.asarray(s.covariates["vibration"])[..., None] ** 2 + 0 * s.rate

    @entered
    class GyroCubic(Effect):
        r"""The output bends with the cube of the rate.

        .. math:: \delta\omega_i = C_i \omega_i^3
        """

        id = "toy_gyro_cubic"
        stage = Stage.GYROSCOPE
        channel = "angular_rate"
        kinds = BOTH
        C: Array = parameter(TRIAD, unit="ppm/(rad/s)", sigma=100, name="toy_gyro_cubic")

        def contribution(self, s: Stimulus) -> Array:
            return self.C * s.rate**3

    @entered
    class GyroScaleFollows(Effect):
        r"""The scale factor of the gyroscopes follows any logged channel, late.

        .. math:: \delta\omega_i = k_i \omega_i c_\tau
        """

        id = "toy_gyro_follows"
        stage = Stage.GYROSCOPE
        channel = "angular_rate"
        kinds = BOTH
        requires = ("covariate",)
        k: Array = parameter(TRIAD, unit="ppm", sigma=100, name="toy_gyro_scale")
        tau: float = constant(60.0, unit="s", low=5.0, high=600.0, grid=Grid.LAG)
        covariate: str = ""

        def contribution(self, s: Stimulus) -> Array:
            x = np.asarray(s.covariates[self.covariate or next(iter(s.covariates))])
            return self.k * s.rate * exp(-1.0 / self.tau) * x[..., None]

    @entered
    class ForceVibration(Effect):
        r"""Vibration moves the scale factor of the accelerometers, late.

        .. math:: \delta a_i = k_i f_i v_\tau
        """

        id = "toy_scale_vibration"
        stage = Stage.ACCELEROMETER
        requires = ("covariate:vibration",)
        k: Array = parameter(TRIAD, unit="ppm", sigma=50, name="toy_scale_vibration")
        tau: float = constant(600.0, unit="s", low=60.0, high=3600.0, grid=Grid.LAG)

        def contribution(self, s: Stimulus) -> Array:
            followed = lagged_states(np.asarray(s.covariates["vibration"])[:, None], self.tau, np.ones(3))
            return self.k * s.force * integrated(followed, s.time)

    @entered
    class Bent(Effect):
        r"""The output saturates with its own size.

        .. math:: \delta a_i = f_i e^{-B_i f_i^2} - f_i
        """

        id = "toy_bent"
        stage = Stage.ACCELEROMETER
        linear = False
        B: Array = parameter(TRIAD, unit="1", sigma=1e-7, name="toy_bent")

        def contribution(self, s: Stimulus) -> Array:
            return s.force * exp(-self.B * s.force**2) - s.force

    @entered
    class GimbalSpring(Effect):
        r"""A cable pulls each gimbal back, from a knee on.

        .. math:: \delta\theta_i = p_i \cos(5 \theta_i + \theta_0)
        """

        id = "toy_gimbal_spring"
        stage = Stage.ENCODER
        kinds = EVERY_KIND
        channel = "gimbal_angle"
        p: Array = parameter(GIMBALS, unit="arcsec", sigma=5, name="toy_spring")
        knee: float = constant(1.0, unit="rad", low=0.1, high=3.0)

        def contribution(self, s: Stimulus) -> Array:
            return self.p * cos(5 * s.angle + self.knee)

    @entered
    class AxisPolygon(Effect):
        r"""The bearing is a polygon: its axis leans n times a turn.

        .. math:: T_i = q_i \cos n\theta_i
        """

        id = "toy_polygon"
        stage = Stage.AXIS_TILT
        kinds = EVERY_KIND
        q: Array = parameter(GIMBALS, unit="arcsec", sigma=5, name="toy_polygon")
        n: float = constant(3.0, unit="1", low=2.0, high=40.0, grid=Grid.WHOLE)

        def contribution(self, s: Stimulus) -> Array:
            lean = self.q * cos(self.n * s.angle)
            return np.stack([lean, 0 * lean, 0.5 * lean], axis=-1)

    @entered
    class BaseJump(Effect):
        r"""The base jumps once.

        .. math:: \psi = J [t \geq t_0]
        """

        id = "toy_base_jump"
        stage = Stage.BASE
        kinds = EVERY_KIND
        J: Array = parameter(("north", "east"), unit="urad", sigma=10, name="toy_jump")
        moment: float = constant(1.0, unit="s", low=0.0, high=1e7, grid=Grid.EPOCH)

        def contribution(self, s: Stimulus) -> Array:
            after = np.asarray(s.time >= self.moment, dtype=float)
            return np.stack([self.J[0] * after, self.J[1] * after, 0 * after], axis=-1)

    @entered
    class DomeSeeing(Effect):
        r"""Warm air at the slit bends the line of sight.

        .. math:: \delta = d (T - T_0) \sin h
        """

        id = "toy_dome"
        stage = Stage.LINE_OF_SIGHT
        channel = "pointing"
        kinds = ("pointing",)
        requires = ("temperature",)
        d: Array = parameter(SCALAR, unit="arcsec", sigma=5, name="toy_dome")

        def contribution(self, s: Stimulus) -> Array:
            across = self.d * s.temperature_excess() * s.force[..., 0] / s.gravity
            return np.stack([0 * across, across, 0 * across], axis=-1)

    @entered
    class PlatformHunt(Effect):
        r"""The platform hunts with a period that is nearly known.

        .. math:: \varphi_i = A_i \int \sin(2 \pi t / P) \, dt
        """

        id = "toy_hunt"
        stage = Stage.PLATFORM
        kinds = ("static-run",)
        A: Array = parameter(("equatorial_x", "equatorial_y", "polar"), unit="deg/h", sigma=0.01, name="toy_hunt")
        period: float = constant(20000.0, unit="h", low=18000.0, high=22000.0, grid=Grid.PERIOD)

        def contribution(self, s: Stimulus) -> Array:
            return self.A * integral(sin(2 * pi * s.time / self.period), s.time)[..., None]

    @entered
    class GravityFollowsPressure(Effect):
        r"""Air masses attract.

        .. math:: \delta g = a (P - \bar P)
        """

        id = "toy_air_mass"
        stage = Stage.GRAVITY
        requires = ("covariate:pressure",)
        a: Array = parameter(SCALAR, unit="uGal/hPa", sigma=0.3, name="toy_air_mass")

        def contribution(self, s: Stimulus) -> Array:
            x = np.asarray(s.covariates["pressure"])
            return np.stack([0 * x, 0 * x, self.a * (x - x.mean())], axis=-1)

    @entered
    class NavigatorCoast(Effect):
        r"""The level loop dies away.

        .. math:: \delta\phi = n e^{-\lambda t}
        """

        id = "toy_coast"
        stage = Stage.ATTITUDE
        channel = "attitude_error"
        kinds = ("static-run",)
        n: Array = parameter(("roll", "pitch"), unit="arcsec", sigma=1, name="toy_coast")
        decay: float = constant(1e-5, unit="1/h", low=0.0, high=1e-3, grid=Grid.DECAY)

        def contribution(self, s: Stimulus) -> Array:
            swing = np.asarray(self.n) * exp(-self.decay * s.time)[..., None]
            return np.concatenate([swing, 0 * swing[..., :1]], axis=-1)

    made = (GyroVibration, GyroCubic, GyroScaleFollows, ForceVibration, Bent, GimbalSpring, AxisPolygon, BaseJump,
            DomeSeeing, PlatformHunt, GravityFollowsPressure, NavigatorCoast)  # fmt: skip
    return tuple(cls.id for cls in made)
