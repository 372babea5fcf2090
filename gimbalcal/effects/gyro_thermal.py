r"""Effects of temperature on the gyroscopes of a strapdown unit: the bias follows a polynomial of it.

The coefficients are separate, one effect for each power, so that a recording says how far it supports the polynomial.
Units: rad/s and degC inside.
"""

from __future__ import annotations

from gimbalcal.effects import false_rate
from gimbalcal.effects.effect import TRIAD, Stimulus, effect, parameter
from gimbalcal.effects.gyroscope import GyroscopeEffect
from gimbalcal.number import Array


@effect
class GyroBiasTemperature(GyroscopeEffect):
    r"""The output at zero rate follows the temperature.

    .. math:: \delta\omega_i = \varepsilon_{T,i} (T - T_0)

    Source: IEEE Std 952, bias temperature sensitivity. Magnitude: 1e-4 to 1e-3 deg/h/degC (ring laser), 0.01 to 0.1
    (fibre), 1 to 100 (MEMS). Seen by: rest in one attitude while the temperature moves. Confounded with:
    gyro_bias_drift under a monotone temperature.
    """

    id = "gyro_bias_temperature"
    says = "{who} drifts with temperature, by {size}"
    requires = ("temperature",)
    sources = ("ieee952",)
    epsilon_T: Array = parameter(TRIAD, unit="deg/h/degC", sigma=1, name="gyro_epsilon_T")

    def contribution(self, s: Stimulus) -> Array:
        """Return the rate added [rad/s], (n, 3)."""
        return false_rate.by_temperature(self.epsilon_T, s)


@effect
class GyroBiasTemperatureSquared(GyroscopeEffect):
    r"""The output at zero rate bends with temperature.

    .. math:: \delta\omega_i = \varepsilon_{T2,i} (T - T_0)^2

    Source: IEEE Std 952, bias temperature sensitivity, second order. Magnitude: 0.1 to 10 deg/h/degC^2 (MEMS) over
    tens of degC. Seen by: the extremes of temperature. Confounded with: gyro_bias_temperature on a narrow range.
    """

    id = "gyro_bias_temperature_squared"
    says = "{who} drifts with the square of temperature, by {size}"
    requires = ("temperature",)
    sources = ("ieee952",)
    epsilon_T2: Array = parameter(TRIAD, unit="deg/h/degC^2", sigma=0.05, name="gyro_epsilon_T2")

    def contribution(self, s: Stimulus) -> Array:
        """Return the rate added [rad/s], (n, 3)."""
        return self.epsilon_T2 * (s.temperature_excess() ** 2)[..., None]


@effect
class GyroBiasTemperatureCubed(GyroscopeEffect):
    r"""The output at zero rate follows the cube of the temperature: compensated to second order, or never.

    .. math:: \delta\omega_i = \varepsilon_{T3,i} (T - T_0)^3

    Source: IEEE Std 952, bias temperature sensitivity, third order. Magnitude: 1e-3 to 0.1 deg/h/degC^3 (MEMS) over
    tens of degC. Seen by: a sweep of temperature far to both sides. Confounded with: gyro_bias_temperature on a
    narrow range.
    """

    id = "gyro_bias_temperature_cubed"
    says = "{who} drifts with the cube of temperature, by {size}"
    requires = ("temperature",)
    sources = ("ieee952",)
    epsilon_T3: Array = parameter(TRIAD, unit="deg/h/degC^3", sigma=0.002, name="gyro_epsilon_T3")

    def contribution(self, s: Stimulus) -> Array:
        """Return the rate added [rad/s], (n, 3)."""
        return self.epsilon_T3 * (s.temperature_excess() ** 3)[..., None]
