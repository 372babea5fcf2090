r"""Input-output law of the gyroscopes: what a rate sensor adds to the angular rate it is given.

Scale factor and misalignment have the signs of the accelerometers, exactly: true = SF x reading, with the angles of
Eq. (5) of Wu et al. (2018),

.. math:: \omega^g = SF^{-1} C_p^g \, \omega^p + \dots

The other effects are what is added to the reading. `gimbalcal.estimate.pulses.gravity_norm` states the other direction
(pulses to rate), Eq. (6) of Wang et al. (2019). Units: rad/s and m/s^2 inside.
"""

from __future__ import annotations

import numpy as np

from gimbalcal.effects import false_rate
from gimbalcal.effects.accelerometer import angles_of, misalignment_error, misalignment_matrix
from gimbalcal.effects.effect import (
    MATRIX_AXES,
    MISALIGNMENT_AXES,
    TRIAD,
    Effect,
    Role,
    Stage,
    Stimulus,
    effect,
    parameter,
)
from gimbalcal.number import Array, absolute


class GyroscopeEffect(Effect):
    """What a gyroscope adds to the rate along its axis, seen where the unit turns or is set to positions."""

    stage = Stage.GYROSCOPE
    channel = "angular_rate"
    kinds = ("rotation", "multi-position")


def rate_matrix(s: Array, beta: Array) -> Array:
    """Return M = SF^-1 C_p^g (3, 3) of a triad that reads M omega; s (3,) scale factors less one, beta (6,) angles."""
    return np.asarray((np.eye(3) + misalignment_matrix(beta)) / (1 + s)[:, None])


def of_rate_matrix(M: Array) -> tuple[Array, Array]:
    """Return scale factors less one s (3,) and misalignments beta (6,) of M (3, 3), the inverse of `rate_matrix`."""
    SF = 1 / np.diag(M)
    return SF - 1, angles_of(SF[:, None] * M)


@effect
class GyroBias(GyroscopeEffect):
    r"""A constant output at zero rate.

    .. math:: \delta\omega = \varepsilon

    Source: Wang et al. (2019), Eq. (6). Magnitude: 0.001 to 0.1 deg/h (ring laser, fibre), 10 to 1000 deg/h (MEMS).
    Seen by: a unit at rest with the Earth's rate on both sides of the axis.
    """

    id = "gyro_bias"
    says = "{who} reads {size} where nothing turns"
    sources = ("wang2019", "ieee952")
    epsilon: Array = parameter(TRIAD, unit="deg/h", sigma=1, name="gyro_bias")

    def contribution(self, s: Stimulus) -> Array:
        """Return the rate added [rad/s], (n, 3)."""
        return false_rate.constant_rate(self.epsilon, s)


@effect
class GyroBiasDrift(GyroscopeEffect):
    r"""The output at zero rate changes steadily.

    .. math:: \delta\omega = \dot\varepsilon \, t

    Source: IEEE Std 952, rate ramp. Magnitude: 0.001 deg/h/h (ring laser), 1 to 100 deg/h/h (MEMS, warming up).
    Seen by: rest in the same attitude early and late. Confounded with: gyro_g_sensitivity_rate where the attitudes
    follow the clock.
    """

    id = "gyro_bias_drift"
    says = "{who} changes its zero steadily, by {size}"
    role = Role(time_drift=True)
    sources = ("ieee952",)
    rate: Array = parameter(TRIAD, unit="deg/h/h", sigma=10, name="gyro_bias_drift")

    def contribution(self, s: Stimulus) -> Array:
        """Return the rate added [rad/s], (n, 3)."""
        return self.rate * s.time[..., None] + 0 * s.rate


@effect
class GyroScaleFactor(GyroscopeEffect):
    r"""Each gyroscope's scale factor differs from the nominal one.

    .. math:: \delta\omega_i = \frac{\omega_i}{1 + s_i} - \omega_i, \qquad s = SF - 1

    The rate is SF times the reading, as with the accelerometers: a gyroscope that reads 0.4 % too much has
    s = -4000 ppm. Source: IEEE Std 952. Magnitude: 1 to 100 ppm (optical), 1000 to 30000 ppm (MEMS). Seen by: a known
    angle about the axis.
    """

    id = "gyro_scale_factor"
    says = "{who} has a scale factor that is off by {size}"
    stage = Stage.RATE_SCALE
    linear = False
    sources = ("wang2019", "ieee952")
    s: Array = parameter(TRIAD, unit="ppm", sigma=1000, name="gyro_scale_factor")

    def contribution(self, s: Stimulus) -> Array:
        """Return the rate added [rad/s], (n, 3)."""
        return -self.s / (1 + self.s) * s.rate


@effect
class GyroMisalignment(GyroscopeEffect):
    r"""The input axes of the gyroscopes do not lie along the axes of the sensor block; each leans by two small angles.

    .. math:: C_p^g = \begin{bmatrix} 1 & \beta_{xz} & -\beta_{xy} \\ -\beta_{yz} & 1 & \beta_{yx} \\
              \beta_{zy} & -\beta_{zx} & 1 \end{bmatrix}

    and (C_p^g - I) omega is added to the rate along the input axes. beta_xz: the x input axis turned about z, as
    with the accelerometers. Source: Wu et al. (2018), Eq. (5); Wang et al. (2019), Eq. (8), there in the other
    direction. Magnitude: 1 to 100 arcsec. Seen by: rotation about another axis. The three rotations of the whole
    triad are seen only against a reference, as against the accelerometers (inter-triad misalignment, Eq. (43)).
    """

    id = "gyro_misalignment"
    says = "the input axis of {who} leans by {size}"
    stage = Stage.RATE_AXIS
    sources = ("wu2018", "wang2019")
    beta: Array = parameter(MISALIGNMENT_AXES, unit="arcsec", sigma=300, name="gyro_misalignment")

    def contribution(self, s: Stimulus) -> Array:
        """Return the rate added [rad/s], (n, 3)."""
        return misalignment_error(self.beta, s.rate)


@effect
class GyroScaleNonlinearity(GyroscopeEffect):
    r"""The output bends quadratically with the rate.

    .. math:: \delta\omega_i = K_i \omega_i^2

    Source: Wang et al. (2019), Eq. (6), K_g2, there in the other direction. Magnitude: 1 to 100 ppm per rad/s
    (optical), to 1000 (MEMS). Seen by: turning both ways about the axis; the difference of the two senses is blind
    to it. Nearly confounded with: scale-factor asymmetry when only one speed is used.
    """

    id = "gyro_scale_nonlinearity"
    says = "{who} bends with the rate, by {size}"
    sources = ("wang2019", "ieee952")
    K: Array = parameter(TRIAD, unit="ppm/(rad/s)", sigma=300, name="gyro_scale_nonlinearity")

    def contribution(self, s: Stimulus) -> Array:
        """Return the rate added [rad/s], (n, 3)."""
        return self.K * s.rate**2


@effect
class GyroScaleAsymmetry(GyroscopeEffect):
    r"""Turning one way reads more than turning the other way.

    .. math:: \delta\omega_i = A_i |\omega_i|

    Source: IEEE Std 952. Magnitude: 1 to 20 ppm (optical), 100 to 3000 ppm (MEMS). Seen by: both senses at two speeds;
    at a single speed it is the same thing as scale nonlinearity.
    """

    id = "gyro_scale_asymmetry"
    says = "{who} reads more one way round than the other, by {size}"
    sources = ("ieee952",)
    A: Array = parameter(TRIAD, unit="ppm", sigma=100, name="gyro_scale_asymmetry")

    def contribution(self, s: Stimulus) -> Array:
        """Return the rate added [rad/s], (n, 3)."""
        return self.A * absolute(s.rate)


@effect
class GyroScaleTemperature(GyroscopeEffect):
    r"""The scale factor follows the temperature.

    .. math:: \delta\omega_i = s_{T,i} \, \omega_i \, (T - T_0)

    Source: IEEE Std 952. Magnitude: 1 to 20 ppm/degC (optical), 50 to 500 ppm/degC (MEMS). Seen by: the same
    rotation at two temperatures.
    """

    id = "gyro_scale_temperature"
    says = "{who} changes its scale factor with temperature, by {size}"
    requires = ("temperature",)
    sources = ("ieee952",)
    s_T: Array = parameter(TRIAD, unit="ppm/degC", sigma=50, name="gyro_scale_temperature")

    def contribution(self, s: Stimulus) -> Array:
        """Return the rate added [rad/s], (n, 3)."""
        return self.s_T * s.rate * s.temperature_excess()[..., None]


@effect
class GyroGSensitivityRate(GyroscopeEffect):
    r"""Specific force makes the gyroscope read a rate: mass unbalance, or stress in a vibrating structure.

    .. math:: \delta\omega_i = \sum_j G_{ij} f_j

    The output of a strapdown gyroscope; on a platform that the gyroscopes hold, the same physics is a drift
    (`gyro_g_sensitivity`). Source: IEEE Std 1431. Magnitude: 0.005 to 0.05 deg/h/g (spinning wheel), 1 to 100 deg/h/g
    (MEMS). Seen by: rest in six attitudes; an axis at rest in one attitude cannot tell it from bias.
    """

    id = "gyro_g_sensitivity_rate"
    says = "{who} reads a turn where only a force acts, by {size}"
    role = Role(textbook_kinds=("multi-position",))
    sources = ("ieee1431",)
    G: Array = parameter(MATRIX_AXES, unit="deg/h/g", sigma=1, name="gyro_g_sensitivity_rate")

    def contribution(self, s: Stimulus) -> Array:
        """Return the rate added [rad/s], (n, 3)."""
        return false_rate.by_force(self.G, s)
