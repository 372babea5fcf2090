"""Temperature and time: biases and scale factors that follow the thermometer, lag behind it, or simply drift."""

from __future__ import annotations

from math import pi

import numpy as np

from gimbalcal.earth import G0, HOUR
from gimbalcal.effects.accelerometer import misalignment_error
from gimbalcal.effects.effect import (
    MISALIGNMENT_AXES,
    TRIAD,
    Effect,
    Grid,
    Role,
    Stage,
    Stimulus,
    constant,
    effect,
    parameter,
)
from gimbalcal.effects.history import Dynamics, lagged_states, smoothed_rate
from gimbalcal.number import Array, cos, exp


@effect
class BiasTemperature(Effect):
    r"""The bias follows the temperature.

    .. math:: \delta a_i = b_{T,i} (T - T_0)

    Source: IEEE Std 1293, temperature sensitivity of bias. Magnitude: 1 to 30 ug/degC (quartz flexure), 100 to 500
    (MEMS). Seen by: every position while the temperature moves. Confounded with: bias_drift under a monotone
    temperature; a pure 24 h cycle in a static run is absorbed.
    """

    id = "bias_temperature"
    says = "{who} drifts with temperature, by {size}"
    stage = Stage.ACCELEROMETER
    requires = ("temperature",)
    sources = ("ieee1293",)
    b_T: Array = parameter(TRIAD, unit="ug/degC", sigma=10)

    def contribution(self, s: Stimulus) -> Array:
        """Return the output added [m/s^2]."""
        return self.b_T * s.temperature_excess()[..., None]


@effect
class ScaleTemperature(Effect):
    r"""The scale factor follows the temperature: magnet and reference resistor have coefficients.

    .. math:: \delta a_i = s_{T,i} f_i (T - T_0)

    Source: IEEE Std 1293, temperature sensitivity of scale factor. Magnitude: 10 to 180 ppm/degC. Seen by: loaded
    axes while the temperature moves, with the sign of the force. Confounded with: nothing where opposite faces see
    other temperatures.
    """

    id = "scale_temperature"
    says = "{who} changes its scale factor with temperature, by {size}"
    stage = Stage.ACCELEROMETER
    requires = ("temperature",)
    sources = ("ieee1293",)
    s_T: Array = parameter(TRIAD, unit="ppm/degC", sigma=50)

    def contribution(self, s: Stimulus) -> Array:
        """Return the output added [m/s^2]."""
        return self.s_T * s.force * s.temperature_excess()[..., None]


@effect
class MisalignmentTemperature(Effect):
    r"""The input axes lean with temperature.

    .. math:: \delta f_i = (\mu_{T,ik} f_j - \mu_{T,ij} f_k) (T - T_0)

    with j the next axis and k the one after: the pattern of Eq. (5) of Wu et al. (2018). Source: IEEE Std 1293,
    input-axis misalignment. Magnitude: 0.2 to 2 urad/degC. Seen by: cross axes at 1 g while the temperature moves.
    Nearly confounded with: a thermal tilt of the gimbals.
    """

    id = "misalignment_temperature"
    says = "the input axis of {who} leans with temperature, by {size}"
    stage = Stage.INPUT_AXIS
    requires = ("temperature",)
    sources = ("ieee1293", "wu2018")
    mu_T: Array = parameter(MISALIGNMENT_AXES, unit="urad/degC", sigma=1)

    def contribution(self, s: Stimulus) -> Array:
        """Return the force added along the input axes [m/s^2]."""
        return misalignment_error(self.mu_T, s.force) * s.temperature_excess()[..., None]


@effect
class BiasTemperatureLagged(Effect):
    r"""The sensor warms later than the thermometer, so its bias follows a smoothed past of the temperature.

    .. math:: \delta a_i = b_{L,i} \int_0^\infty (T(t - u) - T_0) \frac{e^{-u / \tau}}{\tau} du

    in equilibrium before the first sample. Source: IEEE Std 1293, thermal transients. Magnitude: that of
    bias_temperature, tau 0.2 to 2 h. Seen by: what is left after bias_temperature follows dT/dt. Confounded with:
    bias_drift and warm_up under a monotone temperature.
    """

    id = "bias_temperature_lagged"
    says = "{who} follows the temperature with a delay, by {size}"
    stage = Stage.ACCELEROMETER
    requires = ("temperature",)
    sources = ("ieee1293",)
    b_L: Array = parameter(TRIAD, unit="ug/degC", sigma=10)
    tau: float = constant(0.3 * HOUR, unit="h", low=0.02 * HOUR, high=6 * HOUR, grid=Grid.LAG)

    def dynamics(self, s: Stimulus) -> Dynamics:
        """Return the temperature that the sensor has by now."""
        return lagged_states(s.temperature_excess()[:, None], self.tau, self.b_L)


@effect
class BiasTemperatureRate(Effect):
    r"""A temperature gradient across the sensor, in proportion to the rate, moves the bias.

    .. math:: \delta a_i = r_i \dot T

    with the rate smoothed over tau to both sides, because thermometers are noisy. Source: IEEE Std 1293, thermal
    transients. Magnitude: 1 to 20 ug/(degC/h). Seen by: ramps. Confounded with: bias_temperature with
    bias_temperature_lagged.
    """

    id = "bias_temperature_rate"
    says = "{who} follows the rate of the temperature, by {size}"
    stage = Stage.ACCELEROMETER
    requires = ("temperature",)
    sources = ("ieee1293",)
    r: Array = parameter(TRIAD, unit="ug/(degC/h)", sigma=10, name="bias_per_rate")
    tau: float = constant(120.0, unit="min", low=15.0, high=1800.0, grid=Grid.LAG)

    def contribution(self, s: Stimulus) -> Array:
        """Return the output added [m/s^2]."""
        return self.r * smoothed_rate(s.temperature_excess(), s.time, self.tau)[..., None]


@effect
class BiasTemperatureSquared(Effect):
    r"""The bias has a turning point in temperature.

    .. math:: \delta a_i = q_i (T - T_0)^2

    Source: IEEE Std 1293, temperature model. Magnitude: 0.05 to 0.5 ug/degC^2 (quartz flexure), 1 to 10 (MEMS).
    Seen by: the extremes of temperature. Confounded with: bias_temperature on a narrow range.
    """

    id = "bias_temperature_squared"
    says = "{who} follows the square of the temperature, by {size}"
    stage = Stage.ACCELEROMETER
    requires = ("temperature",)
    sources = ("ieee1293",)
    q: Array = parameter(TRIAD, unit="ug/degC^2", sigma=0.5, name="b_T2")

    def contribution(self, s: Stimulus) -> Array:
        """Return the output added [m/s^2]."""
        return self.q * (s.temperature_excess() ** 2)[..., None]


@effect
class WarmUp(Effect):
    r"""After power-on the bias approaches its steady value.

    .. math:: \delta a_i = w_i e^{-t / \tau}

    Source: IEEE Std 1293, turn-on transient. Magnitude: 10 to 200 ug (quartz flexure), tau 0.3 to 3 h; MEMS, minutes.
    Seen by: the first hours only. Confounded with: bias_drift in a test shorter than tau.
    """

    id = "warm_up"
    says = "{who} warms up: it settles by {size}"
    stage = Stage.ACCELEROMETER
    role = Role(time_drift=True)
    sources = ("ieee1293",)
    w: Array = parameter(TRIAD, unit="ug", sigma=50, name="warm_up")
    tau: float = constant(1.0 * HOUR, unit="h", low=0.005 * HOUR, high=12 * HOUR, grid=Grid.LAG)

    def contribution(self, s: Stimulus) -> Array:
        """Return the output added [m/s^2]."""
        return self.w * exp(-s.time / self.tau)[..., None]

    def dynamics(self, s: Stimulus) -> Dynamics:
        """Return the share of the warming that is still to come."""
        return Dynamics(np.zeros((len(s.time), 1)), np.ones(1), self.w, self.tau)


@effect
class BiasDrift(Effect):
    r"""The bias runs away at a constant rate: ageing.

    .. math:: \delta a_i = d_i t

    Source: IEEE Std 528, drift. Magnitude: 0.05 to 5 ug/h (quartz flexure), 5 to 500 (MEMS). Seen by: a return to
    the first position at the end. Confounded with: warm_up and bias_temperature under a monotone temperature.
    """

    id = "bias_drift"
    says = "{who} runs away steadily, by {size}"
    stage = Stage.ACCELEROMETER
    role = Role(time_drift=True)
    sources = ("ieee528",)
    d: Array = parameter(TRIAD, unit="ug/h", sigma=3, name="bias_drift")

    def contribution(self, s: Stimulus) -> Array:
        """Return the output added [m/s^2]."""
        return self.d * s.time[..., None]


@effect
class SlowBiasDrift(Effect):
    r"""The bias drifts to and fro over the whole recording: the bias instability of a low-cost sensor.

    .. math:: \delta a_i = w_{1,i} \cos(\pi t / T) + w_{2,i} \cos(2 \pi t / T)

    a drift and its turning within the span T: the slowest terms of any wander about its mean. Source: IEEE Std 952,
    bias instability. Magnitude: 0.5 to 5 ug (quartz flexure), 20 to 500 (MEMS). Seen by: a return to the same few
    positions throughout. Confounded with: bias_drift and warm_up in part, bias_temperature where no thermometer was
    logged.
    """

    id = "slow_bias_drift"
    says = "{who} wanders slowly over the whole recording, by {size}"
    stage = Stage.ACCELEROMETER
    role = Role(noise_realisation=True, time_drift=True, textbook_kinds=("multi-position",))
    sources = ("ieee952",)
    w_1: Array = parameter(TRIAD, unit="ug", sigma=3, name="slow_drift_1")
    w_2: Array = parameter(TRIAD, unit="ug", sigma=3, name="slow_drift_2")
    span: float = constant(3600.0, unit="s", low=60.0, high=1e6, grid=Grid.SPAN)

    def contribution(self, s: Stimulus) -> Array:
        """Return the output added [m/s^2]."""
        phase = pi * s.time[..., None] / self.span
        return self.w_1 * cos(phase) + self.w_2 * cos(2 * phase)


@effect
class BiasStep(Effect):
    r"""The bias jumps once: a particle, a glue joint, a connector.

    .. math:: \delta a_i = J_i \, [t \geq t_0]

    Source: IEEE Std 528, bias stability. Magnitude: 1 to 20 ug (quartz flexure), 20 to 1000 (MEMS). Seen by: a step
    between dwells. Confounded with: nothing where the same position stands on both sides of the step.
    """

    id = "bias_step"
    says = "{who} jumps once, by {size}"
    stage = Stage.ACCELEROMETER
    sources = ("ieee528",)
    J: Array = parameter(TRIAD, unit="ug", sigma=10, name="bias_step")
    epoch: float = constant(1.0, unit="s", low=0.0, high=100 * 24 * HOUR, grid=Grid.EPOCH)

    def contribution(self, s: Stimulus) -> Array:
        """Return the output added [m/s^2]."""
        return self.J * np.asarray(s.onwards >= self.epoch, dtype=float)[..., None]


@effect
class SelfHeating(Effect):
    r"""The torquer's power warms its own sensor: the bias follows the square of the force, late.

    .. math:: \delta a_i = H_i \int_0^\infty (f_i(t - u) / g_0)^2 \frac{e^{-u / \tau}}{\tau} du

    Source: Lawrence (1998), pendulous accelerometers. Magnitude: 1 to 10 ug (quartz flexure). Seen by: dwells short
    against tau. Confounded with: quadratic_nonlinearity when each dwell outlasts tau.
    """

    id = "self_heating"
    says = "{who} warms itself: it follows the square of its force with a delay, by {size}"
    stage = Stage.ACCELEROMETER
    spans_rows = True
    sources = ("lawrence1998",)
    H: Array = parameter(TRIAD, unit="ug", sigma=5, name="self_heating")
    tau: float = constant(0.2 * HOUR, unit="h", low=0.02 * HOUR, high=3 * HOUR, grid=Grid.LAG)

    def dynamics(self, s: Stimulus) -> Dynamics:
        """Return the temperature of each sensor, in units of what 1 g makes of it."""
        return lagged_states((s.force / G0) ** 2, self.tau, self.H)
