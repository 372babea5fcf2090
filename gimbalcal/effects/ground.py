"""The ground and the Earth: a base that tilts, tides in the plumb line and in gravity, the wrong gravity value,
and the magnetic field.
"""

from __future__ import annotations

from math import pi

import numpy as np

from gimbalcal.earth import HOUR, SOLAR_RATE
from gimbalcal.effects.effect import (
    EVERY_KIND,
    MATRIX_AXES,
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
from gimbalcal.number import Array, apply_matrix, cos, sin

M2_PERIOD = 12.4206012 * HOUR  # principal lunar semidiurnal tide, IERS Conventions (2010), chapter 6
TILT = ("north", "east")


def level_vector(north: Array, east: Array, down: Array) -> Array:
    """Return components about north, east, down joined to (n, 3)."""
    return np.stack([np.asarray(north), np.asarray(east), np.asarray(down)], axis=-1)


@effect
class BaseTilt(Effect):
    r"""The base is not level and north: a constant rotation against the local level.

    .. math:: C_n^b = R(\kappa_N, \kappa_E, \kappa_D)

    Source: Wu et al. (2018), Eq. (28). Magnitude: 1 to 100 arcsec. Seen by: gimbals; the accelerometers of an
    inertially fixed platform are blind to it. Confounded with: gimbal_zero (outer).
    """

    id = "base_tilt"
    says = "the base is tilted by {size}"
    stage = Stage.BASE
    kinds = EVERY_KIND
    role = Role(textbook_kinds=("pointing",))
    gauge = ("down",)  # a turn about the vertical is no tilt: the zero of the azimuth has it
    sources = ("wu2018",)
    kappa: Array = parameter(("north", "east", "down"), unit="arcsec", sigma=120, name="base_tilt")

    def contribution(self, s: Stimulus) -> Array:
        """Return the rotation about north, east, down [rad], (n, 3)."""
        return self.kappa + 0 * s.force


@effect
class BaseTiltDrift(Effect):
    r"""The pier settles: the base tilts at a constant rate.

    .. math:: C_n^b = R(\dot\psi_N t, \dot\psi_E t, 0)

    Source: Wu et al. (2018), Eq. (28), whose tilt is constant. Magnitude: 0.1 to 5 urad/h. Seen by: accelerometers
    where encoders give the attitude; gimbals alone on an inertially fixed platform. Confounded with:
    base_tilt_diurnal within 8 h.
    """

    id = "base_tilt_drift"
    says = "the pier settles: the base tilts by {size}"
    stage = Stage.BASE
    role = Role(time_drift=True)
    kinds = EVERY_KIND
    channel = "gimbal_angle"
    sources = ("wu2018",)
    psi: Array = parameter(TILT, unit="urad/h", sigma=3, name="tilt_rate")

    def contribution(self, s: Stimulus) -> Array:
        """Return the rotation about north, east, down [rad], (n, 3)."""
        return level_vector(self.psi[0] * s.time, self.psi[1] * s.time, 0 * s.time)


@effect
class BaseTiltDiurnal(Effect):
    r"""Building and pier follow the sun: the base tilts with the solar day.

    .. math:: \psi(t) = A \sin\omega_d t + B \cos\omega_d t, \qquad \omega_d = 2\pi / 24\,\mathrm{h}

    Source: tilt of buildings by the sun, engineering experience. Magnitude: 1 to 20 urad. Seen by: gimbals at the
    sum and difference of the solar and sidereal rates. Confounded with: encoder_two_cycle in a static run;
    base_tilt_drift within 8 h.
    """

    id = "base_tilt_diurnal"
    says = "the base tilts to and fro with the day, by {size}"
    stage = Stage.BASE
    role = Role(min_duration_s=8 * HOUR)  # a shorter part of the day is base_tilt_drift
    kinds = EVERY_KIND
    channel = "gimbal_angle"
    A: Array = parameter(TILT, unit="urad", sigma=10, name="tilt_sin")
    B: Array = parameter(TILT, unit="urad", sigma=10, name="tilt_cos")

    def contribution(self, s: Stimulus) -> Array:
        """Return the rotation about north, east, down [rad], (n, 3)."""
        S, C = sin(SOLAR_RATE * s.time), cos(SOLAR_RATE * s.time)
        return level_vector(self.A[0] * S + self.B[0] * C, self.A[1] * S + self.B[1] * C, 0 * s.time)


@effect
class PlumbLineTide(Effect):
    r"""Sun and Moon turn the plumb line against the ground.

    .. math:: \delta g^n = g \, (A \sin\omega t + B \cos\omega t), \qquad \omega = 2\pi / P

    in north and east, with P the period of M2 unless stated otherwise. Source: IERS Conventions (2010), chapters 6
    and 7. Magnitude: 20 to 100 nrad. Seen by: accelerometers alone. Confounded with: platform terms, in its
    sidereal constituent K1.
    """

    id = "plumb_line_tide"
    says = "Sun and Moon turn the plumb line by {size}"
    stage = Stage.GRAVITY
    kinds = ("static-run",)
    sources = ("iers2010",)
    A: Array = parameter(TILT, unit="nrad", sigma=50, name="plumb_sin")
    B: Array = parameter(TILT, unit="nrad", sigma=50, name="plumb_cos")
    period: float = constant(M2_PERIOD, unit="h", low=11.9 * HOUR, high=26.9 * HOUR, grid=Grid.PERIOD)

    def contribution(self, s: Stimulus) -> Array:
        """Return what is added to gravity in north, east, down [m/s^2], (n, 3)."""
        S, C = sin(2 * pi / self.period * s.time), cos(2 * pi / self.period * s.time)
        north, east = (s.gravity * (self.A[i] * S + self.B[i] * C) for i in (0, 1))
        return level_vector(north, east, 0 * s.time)


@effect
class GravityTide(Effect):
    r"""Sun and Moon change the size of gravity.

    .. math:: \delta g^n = (0, 0, A \sin\omega t + B \cos\omega t), \qquad \omega = 2\pi / P

    Source: IERS Conventions (2010), chapter 7. Magnitude: 110 uGal (0.1 ug). Seen by: all channels in proportion to
    the force. Nearly confounded with: plumb_line_tide of the same period; gravity_error if constant.
    """

    id = "gravity_tide"
    says = "Sun and Moon change gravity by {size}"
    stage = Stage.GRAVITY
    kinds = ("static-run",)
    sources = ("iers2010",)
    A: float = parameter(SCALAR, unit="uGal", sigma=100, name="gravity_tide_sin")
    B: float = parameter(SCALAR, unit="uGal", sigma=100, name="gravity_tide_cos")
    period: float = constant(M2_PERIOD, unit="h", low=11.9 * HOUR, high=26.9 * HOUR, grid=Grid.PERIOD)

    def contribution(self, s: Stimulus) -> Array:
        """Return what is added to gravity in north, east, down [m/s^2], (n, 3)."""
        S, C = sin(2 * pi / self.period * s.time), cos(2 * pi / self.period * s.time)
        return level_vector(0 * s.time, 0 * s.time, self.A * S + self.B * C)


@effect
class GravityError(Effect):
    r"""The value of gravity at the site is wrong.

    .. math:: \delta g^n = (0, 0, \gamma g)

    Source: WGS-84 normal gravity against a gravimeter. Magnitude: 1 to 50 ppm. Seen by: nothing. Confounded with:
    three equal errors of scale_factor, exactly.
    """

    id = "gravity_error"
    says = "the gravity stated for the site is wrong by {size}"
    stage = Stage.GRAVITY
    sources = ("wgs84",)
    gamma: float = parameter(SCALAR, unit="ppm", sigma=20, name="gravity_error")

    def contribution(self, s: Stimulus) -> Array:
        """Return what is added to gravity in north, east, down [m/s^2], (n, 3)."""
        return level_vector(0 * s.time, 0 * s.time, self.gamma * s.gravity + 0 * s.time)


@effect
class VerticalDeflection(Effect):
    r"""The plumb line is not the normal of the ellipsoid.

    .. math:: \delta g^n = g \, (\xi_N, \xi_E, 0)

    Source: WGS-84 latitude against an astronomic one. Magnitude: 1 to 20 arcsec. Seen by: nothing alone. Confounded
    with: base_tilt with encoders; base_tilt and polar_axis_misalignment in a static run.
    """

    id = "vertical_deflection"
    says = "the plumb line leaves the ellipsoid's normal by {size}"
    stage = Stage.GRAVITY
    sources = ("wgs84",)
    xi: Array = parameter(TILT, unit="arcsec", sigma=10, name="deflection")

    def contribution(self, s: Stimulus) -> Array:
        """Return what is added to gravity in north, east, down [m/s^2], (n, 3)."""
        return level_vector(s.gravity * self.xi[0] + 0 * s.time, s.gravity * self.xi[1] + 0 * s.time, 0 * s.time)


@effect
class MagneticField(Effect):
    r"""Magnets of the torquers feel the field of the Earth: a bias that follows a second reference direction.

    .. math:: \delta a_i = \sum_j M_{ij} \, h_j, \qquad h = C_n^p (\cos D, \sin D, 0)

    with h the horizontal direction of the field, D its declination: the vertical part does what gravity does and is
    a change of scale factors and misalignments. Source: IEEE Std 1293, magnetic sensitivity. Magnitude: 1 to 20 ug
    in 50 uT. Seen by: a turn about the vertical. Nearly confounded with: cross_coupling on the 18 positions.
    """

    id = "magnetic_field"
    says = "{who} feels the Earth's magnetic field, by {size}"
    stage = Stage.ACCELEROMETER
    requires = ("attitude",)
    sources = ("ieee1293",)
    M: Array = parameter(MATRIX_AXES, unit="ug", sigma=10, name="magnetic")
    declination: float = constant(0.0, unit="deg", low=-np.pi, high=np.pi)

    def contribution(self, s: Stimulus) -> Array:
        """Return the output added [m/s^2]."""
        if s.attitude is None:
            raise ValueError("this effect needs a platform with gimbals, which say where north is")
        D = np.asarray(self.declination)
        north, east = np.asarray(s.attitude)[..., 0], np.asarray(s.attitude)[..., 1]
        return apply_matrix(np.reshape(self.M, (3, 3)), north * cos(D) + east * sin(D))
