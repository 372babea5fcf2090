"""Effects that need motion: lever arms, delays between channels, torqued turns. At rest nothing is left of them."""

from __future__ import annotations

import numpy as np

from gimbalcal.effects.effect import (
    MATRIX_AXES,
    SCALAR,
    TRIAD,
    Effect,
    Role,
    Stage,
    Stimulus,
    effect,
    parameter,
)
from gimbalcal.effects.history import Dynamics, added_up, slope
from gimbalcal.number import Array


@effect
class LeverArm(Effect):
    r"""The accelerometers sit off the centre of rotation and feel centripetal and tangential force.

    .. math:: \delta f = \dot\omega \times r + \omega \times (\omega \times r)

    Source: Groves (2013), lever arms. Magnitude: r of 10 to 50 mm; 93 ug at 10 deg/s, 270 ug at 5 deg/s^2. Seen by:
    slews at two rates, with gyroscopes. Confounded with: nothing; at rest it vanishes.
    """

    id = "lever_arm"
    says = "the accelerometers sit off the centre of rotation, by {size}"
    role = Role(textbook_kinds=("rotation",))
    stage = Stage.INPUT_AXIS
    requires = ("angular_rate",)
    kinds = ("multi-position", "rotation")
    sources = ("groves2013",)
    r: Array = parameter(TRIAD, unit="mm", sigma=30, name="lever_arm")

    def contribution(self, s: Stimulus) -> Array:
        """Return the force added along the input axes [m/s^2]."""
        r = np.asarray(self.r) + 0 * s.rate
        return np.cross(s.turning_faster(), r) + np.cross(s.rate, np.cross(s.rate, r))


@effect
class AccelerometerLeverArm(Effect):
    r"""The three accelerometers are not in one point: each feels the rotation at its own place (size effect).

    .. math:: \delta a_i = [\dot\omega \times r_i + \omega \times (\omega \times r_i)]_i

    Source: Groves (2013), size effect. Magnitude: 5 to 50 mm. Seen by: fast turns about three axes. Confounded
    with: lever_arm in the part common to all three.
    """

    id = "accelerometer_lever_arm"
    says = "the accelerometers do not sit in one point: {who} is off by {size}"
    stage = Stage.INPUT_AXIS
    requires = ("angular_rate",)
    kinds = ("rotation",)
    sources = ("groves2013",)
    r: Array = parameter(MATRIX_AXES, unit="mm", sigma=30, name="accelerometer_lever_arm")

    def contribution(self, s: Stimulus) -> Array:
        """Return the force added along the input axes [m/s^2]."""
        r = np.reshape(self.r, (3, 3))
        turn, w = s.turning_faster(), s.rate
        # row i of what turns in place feel, [w' x] + w w^T - |w|^2, and the own arm of each
        (x, y, z), (p, q, o) = ([v[..., i] for i in range(3)] for v in (turn, w))
        return np.stack(
            [
                -(q * q + o * o) * r[0, 0] + (p * q - z) * r[0, 1] + (p * o + y) * r[0, 2],
                (q * p + z) * r[1, 0] - (p * p + o * o) * r[1, 1] + (q * o - x) * r[1, 2],
                (o * p - y) * r[2, 0] + (o * q + x) * r[2, 1] - (p * p + q * q) * r[2, 2],
            ],
            axis=-1,
        )


@effect
class GravityLeakage(Effect):
    r"""A unit that is taken to stay level tilts: gravity leaks into its horizontal axes.

    .. math:: \varphi = \kappa \int \omega \, dt, \qquad \delta f = -\varphi \times f

    with kappa = 1 where the gyroscopes tell the whole of the tilt. Source: Groves (2013), a level frame that is
    not. Magnitude: 0.5 to 1. Seen by: slow tilts, in the horizontal axes. Confounded with: nothing; lever_arm grows
    with the second power of the frequency.
    """

    id = "gravity_leakage"
    says = "the unit is not as level as it is taken to be: gravity leaks in, by {size}"
    role = Role(textbook_kinds=("rotation",))
    stage = Stage.PLATFORM
    requires = ("angular_rate",)
    kinds = ("rotation",)
    sources = ("groves2013",)
    kappa: float = parameter(SCALAR, unit="1", sigma=1, name="gravity_leakage")

    def dynamics(self, s: Stimulus) -> Dynamics:
        """Return the states of the tilt since the first sample."""
        return added_up(self.kappa * s.rate)


@effect
class TorquerScaleFactor(Effect):
    r"""A platform that is torqued to follow the Earth or the base turns a little more or less than commanded.

    .. math:: \varphi_i = \kappa_i \int \Omega_i \, dt

    Source: Britting (1971), torquer scale factor. Magnitude: 10 to 100 ppm. Seen by: torquing on against off.
    Confounded with: gyro_drift at one attitude, exactly.
    """

    id = "torquer_scale_factor"
    says = "the platform turns more or less than commanded, by {size}"
    stage = Stage.PLATFORM
    requires = ("angular_rate", "attitude")
    kinds = ("multi-position", "rotation")
    sources = ("britting1971",)
    kappa: Array = parameter(TRIAD, unit="ppm", sigma=50, name="torquer_scale_factor")

    def dynamics(self, s: Stimulus) -> Dynamics:
        """Return the states of the turn beyond the one commanded."""
        return added_up(self.kappa * s.rate)


@effect
class TimeTagLatency(Effect):
    r"""The accelerometers are read earlier or later than their time tag says.

    .. math:: \delta f = \delta t \, \dot f

    A positive time reads what comes later: the tag is early. Source: Groves (2013), data timing. Magnitude: 0.1 to 20
    ms; 0.07 ug per ms at Earth rate, 17 ug per ms at 1 deg/s. Seen by: slews. Confounded with:
    polar_axis_misalignment, exactly, in a static run.
    """

    id = "time_tag_latency"
    says = "the force is read later than its time tag says, by {size}"
    role = Role(textbook_kinds=("rotation",))
    stage = Stage.INPUT_AXIS
    spans_rows = True
    sources = ("groves2013",)
    latency: float = parameter(SCALAR, unit="ms", sigma=10, name="time_tag_latency")

    def contribution(self, s: Stimulus) -> Array:
        """Return the force added along the input axes [m/s^2]."""
        return self.latency * slope(s.force, s.time, s.visit)


@effect
class GyroLatency(Effect):
    r"""The gyroscopes are read earlier or later than what they are logged with.

    .. math:: \delta\omega = \delta t \, \dot\omega

    A positive time reads what comes later: a negative one is a gyroscope that lags, as behind a filter. Source: Groves
    (2013), data timing. Magnitude: 0.1 to 20 ms. Seen by: turns, against readouts or against the direction of gravity.
    Confounded with: time_tag_latency of the opposite sign, exactly, where no readouts were logged.
    """

    id = "gyro_latency"
    says = "the gyroscopes are read later than what they are logged with, by {size}"
    stage = Stage.GYROSCOPE
    channel = "angular_rate"
    requires = ("angular_rate",)
    kinds = ("rotation",)
    spans_rows = True
    sources = ("groves2013",)
    latency: float = parameter(SCALAR, unit="ms", sigma=10, name="gyro_latency")

    def contribution(self, s: Stimulus) -> Array:
        """Return the rate added [rad/s], (n, 3)."""
        return self.latency * slope(s.rate, s.time, s.visit)


@effect
class ReadoutLatency(Effect):
    r"""The gimbals are read earlier or later than the sensors they are logged with.

    .. math:: \delta\theta = \delta t \, \dot\theta

    is what the true angle has more than the readout: a positive time is a readout that lags. Source: Groves (2013),
    data timing. Magnitude: 0.1 to 100 ms; 0.36 arcsec per ms at 0.1 deg/s. Seen by: slews. Confounded with:
    time_tag_latency of the same sign, exactly, where no gyroscopes were logged.
    """

    id = "readout_latency"
    says = "the gimbal angles lag what they are logged with, by {size}"
    stage = Stage.ENCODER
    channel = "gimbal_angle"
    requires = ("attitude",)
    kinds = ("rotation",)
    spans_rows = True
    sources = ("groves2013",)
    latency: float = parameter(SCALAR, unit="ms", sigma=10, name="readout_latency")

    def contribution(self, s: Stimulus) -> Array:
        """Return the angle added [rad], (n, k)."""
        return self.latency * slope(s.angle, s.time, s.visit)
