"""Any other logged channel as a cause: straight, late or squared; and the named ones of the catalogue.

A covariate effect holds the name of its channel; the empty name means the only one that was recorded. Parameters are
per unit of the covariate as it was logged.
"""

from __future__ import annotations

import numpy as np

from gimbalcal.earth import HOUR
from gimbalcal.effects.effect import TRIAD, Effect, Grid, Role, Stage, Stimulus, constant, effect, parameter
from gimbalcal.effects.history import Dynamics, lagged_states
from gimbalcal.number import Array


def channel(s: Stimulus, name: str) -> Array:
    """Return the covariate (n,) less its mean. Raises ValueError where it is absent or the empty name is ambiguous."""
    names = list(s.covariates)
    if (name and name not in names) or (not name and len(names) != 1):
        raise ValueError(f"this effect needs the covariate {name!r} and the recording has {names}")
    x = np.asarray(s.covariates[name or names[0]])
    return np.asarray(x - x.mean())


@effect
class BiasCovariate(Effect):
    r"""The bias follows a logged channel.

    .. math:: \delta a_i = k_i (c - \bar c)

    Source: regression on what was logged. Magnitude: any. Seen by: every position while the channel moves.
    Confounded with: bias_temperature and bias_drift if the channel follows them.
    """

    id = "bias_covariate"
    says = "{who} follows a logged channel, by {size}"
    stage = Stage.ACCELEROMETER
    role = Role(generic=True)
    requires = ("covariate",)
    k: Array = parameter(TRIAD, unit="ug", sigma=10, name="bias_per_covariate")
    covariate: str = ""

    def contribution(self, s: Stimulus) -> Array:
        """Return the output added [m/s^2]."""
        return self.k * channel(s, self.covariate)[..., None]


@effect
class BiasCovariateLagged(Effect):
    r"""The bias follows a logged channel late.

    .. math:: \delta a_i = k_i \int_0^\infty (c(t - u) - \bar c) \frac{e^{-u / \tau}}{\tau} du

    Source: regression on what was logged. Magnitude: any. Seen by: what is left after bias_covariate follows its
    rate. Confounded with: bias_drift under a monotone channel.
    """

    id = "bias_covariate_lagged"
    says = "{who} follows a logged channel with a delay, by {size}"
    stage = Stage.ACCELEROMETER
    requires = ("covariate",)
    k: Array = parameter(TRIAD, unit="ug", sigma=10, name="bias_per_lagged_covariate")
    tau: float = constant(0.3 * HOUR, unit="h", low=0.02 * HOUR, high=6 * HOUR, grid=Grid.LAG)
    covariate: str = ""

    def dynamics(self, s: Stimulus) -> Dynamics:
        """Return the channel as the sensor has followed it by now."""
        return lagged_states(channel(s, self.covariate)[:, None], self.tau, self.k)


@effect
class BiasCovariateSquared(Effect):
    r"""The bias follows the square of a logged channel.

    .. math:: \delta a_i = k_i (c - \bar c)^2

    Source: regression on what was logged. Magnitude: any. Seen by: the extremes of the channel. Confounded with:
    bias_covariate on one side of the mean.
    """

    id = "bias_covariate_squared"
    says = "{who} follows the square of a logged channel, by {size}"
    stage = Stage.ACCELEROMETER
    requires = ("covariate",)
    k: Array = parameter(TRIAD, unit="ug", sigma=10, name="bias_per_squared_covariate")
    covariate: str = ""

    def contribution(self, s: Stimulus) -> Array:
        """Return the output added [m/s^2]."""
        return self.k * (channel(s, self.covariate) ** 2)[..., None]


@effect
class SupplyVoltage(Effect):
    r"""The reference voltage of the torquer moves bias and scale factor.

    .. math:: \delta a_i = (k_i + \kappa_i f_i) \Delta V

    Source: IEEE Std 1293, supply sensitivity. Magnitude: 1 to 10 ppm/V (quartz flexure), 100 to 2000 (MEMS). Seen
    by: a covariate named supply_voltage [V]. Confounded with: bias_temperature if the supply follows the
    temperature.
    """

    id = "supply_voltage"
    says = "{who} follows the supply voltage, by {size}"
    stage = Stage.ACCELEROMETER
    requires = ("covariate:supply_voltage",)
    sources = ("ieee1293",)
    k: Array = parameter(TRIAD, unit="ug/V", sigma=10, name="bias_per_volt")
    kappa: Array = parameter(TRIAD, unit="ppm/V", sigma=10, name="scale_per_volt")
    covariate: str = "supply_voltage"

    def contribution(self, s: Stimulus) -> Array:
        """Return the output added [m/s^2]."""
        return (self.k + self.kappa * s.force) * channel(s, self.covariate)[..., None]


@effect
class Pressure(Effect):
    r"""Air pressure squeezes the case or damps the proof mass.

    .. math:: \delta a_i = k_i \Delta P

    Source: IEEE Std 1293, pressure sensitivity. Magnitude: 0.01 to 0.1 ug/hPa. Seen by: a covariate named pressure
    [Pa]. Confounded with: bias_drift on the time scale of the weather.
    """

    id = "pressure"
    says = "{who} follows the air pressure, by {size}"
    stage = Stage.ACCELEROMETER
    requires = ("covariate:pressure",)
    sources = ("ieee1293",)
    k: Array = parameter(TRIAD, unit="ug/hPa", sigma=0.05, name="bias_per_pressure")
    covariate: str = "pressure"

    def contribution(self, s: Stimulus) -> Array:
        """Return the output added [m/s^2]."""
        return self.k * channel(s, self.covariate)[..., None]


@effect
class VibrationRectification(Effect):
    r"""A curved or clipped response turns vibration into a bias.

    .. math:: \delta a_i = K_{vr,i} \, a_{rms}^2

    Source: IEEE Std 1293, vibration rectification error. Magnitude: 20 to 60 ug/g^2 (quartz flexure), 100 to 5000
    (MEMS). Seen by: a covariate named vibration [m/s^2], the rms of the raw samples. Confounded with: a bias of
    each position if the motors' load depends on attitude.
    """

    id = "vibration_rectification"
    says = "{who} makes a constant reading of vibration, by {size}"
    stage = Stage.ACCELEROMETER
    requires = ("covariate:vibration",)
    sources = ("ieee1293",)
    K_vr: Array = parameter(TRIAD, unit="ug/g^2", sigma=40)
    covariate: str = "vibration"

    def contribution(self, s: Stimulus) -> Array:
        """Return the output added [m/s^2]."""
        return self.K_vr * np.asarray(s.covariates[self.covariate])[..., None] ** 2


@effect
class ServoFollowingError(Effect):
    r"""The loops leave a recorded error, and it may not have been taken into account (coefficient 1) or twice (-1).

    .. math:: \varphi_i = k_i e_i(t)

    Source: Lawrence (1998), platform servo loops. Magnitude: the coefficient is 0 or 1. Seen by: covariates named
    servo_x, servo_y, servo_z [rad]. Confounded with: nothing where the record moves; its constant part is a
    misalignment.
    """

    id = "servo_following_error"
    says = "errors that the servo loops recorded are taken into account wrongly, by {size} of their size"
    stage = Stage.PLATFORM
    requires = ("covariate:servo_x", "covariate:servo_y", "covariate:servo_z")
    sources = ("lawrence1998",)
    k: Array = parameter(TRIAD, unit="1", sigma=1, name="servo_share")

    def contribution(self, s: Stimulus) -> Array:
        """Return the rotation in platform axes [rad], (n, 3)."""
        e = np.stack([np.asarray(s.covariates[f"servo_{axis}"]) for axis in TRIAD], axis=-1)
        return self.k * e
