"""The platform itself turns: gyroscope drifts and loop residues of an inertially fixed platform.

The drifts are integrals of the laws in `false_rate`, which say why the platform's coefficients have the other sign.
"""

from __future__ import annotations

from math import pi

import numpy as np

from gimbalcal.earth import EARTH_RATE, HOUR, SOLAR_RATE
from gimbalcal.effects import false_rate
from gimbalcal.effects.effect import (
    MATRIX_AXES,
    PLATFORM_AXES,
    SCALAR,
    Effect,
    Grid,
    Stage,
    Stimulus,
    constant,
    effect,
    parameter,
)
from gimbalcal.effects.history import Dynamics, added_up
from gimbalcal.number import Array, cos, exp, sin

SCHULER_PERIOD = 84.4 * 60  # 2 pi sqrt(R / g)


class PlatformTurn(Effect):
    """A turn of an inertially fixed platform against its drawing, seen in a static run."""

    stage = Stage.PLATFORM
    kinds = ("static-run",)


@effect
class PolarAxisMisalignment(PlatformTurn):
    r"""The inertially fixed platform starts turned against its drawing: polar axis off the pole, azimuth off.

    .. math:: \varphi = \varphi_0, \qquad f^p = R(\varphi) f^p_{ideal}

    counted from S_t, whose constant is what the platform gimbal reads on average: a turn about the pole that the zero
    of this gimbal and the tilt of the base make is in phi_0:polar of an estimate. Source: Britting (1971), initial
    alignment of a space-stabilised platform. Magnitude: 5 to 300 arcsec. Seen by: gimbals and force together in a
    static run; a turn of the encoders alone is a gimbal zero. Confounded with: nothing there; in a multi-position
    recording it is invisible.
    """

    id = "polar_axis_misalignment"
    says = "the platform starts turned against its drawing by {size}"
    sources = ("britting1971",)
    phi_0: Array = parameter(PLATFORM_AXES, unit="arcsec", sigma=120, name="phi_0")

    def contribution(self, s: Stimulus) -> Array:
        """Return the rotation in platform axes [rad], (n, 3)."""
        return self.phi_0 + 0 * s.force


@effect
class GyroDrift(PlatformTurn):
    r"""The gyroscopes drift at a constant rate and take the platform along.

    .. math:: \varphi = \epsilon t

    constant in platform axes, which stand still in inertial space. Source: Nash et al. (1971); Britting (1971).
    Magnitude: 0.001 to 0.01 deg/h. Seen by: accelerometers and gimbals together. Confounded with: clock_rate for
    the polar axis.
    """

    id = "gyro_drift"
    says = "the platform's gyroscopes drift by {size}"
    sources = ("nash1971", "britting1971")
    epsilon: Array = parameter(PLATFORM_AXES, unit="deg/h", sigma=0.005, name="gyro_drift")

    def contribution(self, s: Stimulus) -> Array:
        """Return the rotation in platform axes [rad], (n, 3)."""
        return false_rate.constant_rate(self.epsilon, s) * s.time[..., None]

    def dynamics(self, s: Stimulus) -> Dynamics:
        """Return the states of the turn since the first sample."""
        return added_up(false_rate.constant_rate(self.epsilon, s))


@effect
class GyroGSensitivity(PlatformTurn):
    r"""The rotor's mass is off its centre: specific force makes it drift.

    .. math:: \varphi = D \int f \, dt

    Source: IEEE Std 528, acceleration-sensitive drift rate. Magnitude: 0.005 to 0.05 deg/h/g. Seen by: six
    attitudes of the platform. Confounded with: cross_coupling and a solar-day drift at one attitude.
    """

    id = "gyro_g_sensitivity"
    says = "the platform's gyroscopes drift with the force on them, by {size}"
    sources = ("ieee528", "lawrence1998")
    D: Array = parameter(MATRIX_AXES, unit="deg/h/g", sigma=0.02, name="g_sensitivity")

    def dynamics(self, s: Stimulus) -> Dynamics:
        """Return the states of the turn since the first sample."""
        return added_up(false_rate.by_force(self.D, s))


@effect
class GyroG2Sensitivity(PlatformTurn):
    r"""The rotor's suspension yields unequally along two axes: the product of two forces makes it drift.

    .. math:: \varphi_i = E_i \int f_j f_k \, dt

    Source: IEEE Std 528, acceleration-squared-sensitive drift rate. Magnitude: 0.002 to 0.02 deg/h/g^2. Seen by:
    twice the sidereal rate in the drift. Confounded with: gyro_g_sensitivity at one attitude.
    """

    id = "gyro_g2_sensitivity"
    says = "the platform's gyroscopes drift with the product of two forces, by {size}"
    sources = ("ieee528", "lawrence1998")
    E: Array = parameter(PLATFORM_AXES, unit="deg/h/g^2", sigma=0.01, name="g2_sensitivity")

    def dynamics(self, s: Stimulus) -> Dynamics:
        """Return the states of the turn since the first sample."""
        return added_up(false_rate.by_force_products(self.E, s))


@effect
class GyroTemperatureDrift(PlatformTurn):
    r"""The drift rate follows the temperature.

    .. math:: \varphi = \epsilon_T \int (T - T_0) \, dt

    Source: IEEE Std 952, environmentally sensitive drift. Magnitude: 1e-4 to 1e-3 deg/h/degC. Seen by:
    accelerometers and gimbals together while the temperature moves. Confounded with: gyro_drift at a constant
    temperature.
    """

    id = "gyro_temperature_drift"
    says = "the platform's gyroscopes drift with temperature, by {size}"
    requires = ("temperature",)
    sources = ("ieee952",)
    epsilon_T: Array = parameter(PLATFORM_AXES, unit="deg/h/degC", sigma=0.001, name="thermal_drift")

    def dynamics(self, s: Stimulus) -> Dynamics:
        """Return the states of the turn since the first sample."""
        return added_up(false_rate.by_temperature(self.epsilon_T, s))


@effect
class GyroDiurnalDrift(PlatformTurn):
    r"""The drift rate follows the solar day.

    .. math:: \varphi = \int (A \sin\omega_d t + B \cos\omega_d t) \, dt
              = \frac{1}{\omega_d} (A (1 - \cos\omega_d t) + B \sin\omega_d t)

    Source: IEEE Std 952, environmentally sensitive drift. Magnitude: 1e-4 to 1e-3 deg/h. Seen by: accelerometers
    and gimbals together. Confounded with: gyro_g_sensitivity and cross_coupling in runs shorter than weeks.
    """

    id = "gyro_diurnal_drift"
    says = "the platform's gyroscopes drift to and fro with the day, by {size}"
    sources = ("ieee952",)
    A: Array = parameter(PLATFORM_AXES, unit="deg/h", sigma=0.001, name="diurnal_drift_sin")
    B: Array = parameter(PLATFORM_AXES, unit="deg/h", sigma=0.001, name="diurnal_drift_cos")

    def contribution(self, s: Stimulus) -> Array:
        """Return the rotation in platform axes [rad], (n, 3)."""
        phase = (SOLAR_RATE * s.time)[..., None]  # integrated in closed form: exact for any sampling interval
        return (self.A * (1 - cos(phase)) + self.B * sin(phase)) / SOLAR_RATE

    def dynamics(self, s: Stimulus) -> Dynamics:
        """Return the states of the turn since the first sample."""
        return added_up(false_rate.by_solar_day(self.A, self.B, s))


@effect
class CaseRotationResidue(PlatformTurn):
    r"""Gyroscope cases are turned to average their drifts out; what is left turns the platform at that period.

    .. math:: \varphi = A \sin(2\pi t / P) + B \cos(2\pi t / P)

    Source: Britting (1971), case rotation of free-rotor gyroscopes. Magnitude: 0.5 to 10 urad, period 8 min. Seen
    by: a sharp line in all channels if samples are closer than half the period. Confounded with: nothing.
    """

    id = "case_rotation_residue"
    says = "the platform turns to and fro with the rotation of the gyroscopes' cases, by {size}"
    sources = ("britting1971",)
    A: Array = parameter(PLATFORM_AXES, unit="urad", sigma=3, name="case_rotation_sin")
    B: Array = parameter(PLATFORM_AXES, unit="urad", sigma=3, name="case_rotation_cos")
    period: float = constant(480.0, unit="min", low=240.0, high=960.0, grid=Grid.PERIOD)

    def contribution(self, s: Stimulus) -> Array:
        """Return the rotation in platform axes [rad], (n, 3)."""
        return _harmonic(self.A, self.B, s.time, self.period)


@effect
class ServoLimitCycle(PlatformTurn):
    r"""Friction and gain of the platform loop sustain an oscillation.

    .. math:: \varphi = A \sin(2\pi t / P) + B \cos(2\pi t / P)

    Source: Lawrence (1998), platform servo loops. Magnitude: 0.5 to 20 urad. Seen by: raw samples; block averages
    alias it. Confounded with: case_rotation_residue where the rate of samples aliases one into the other.
    """

    id = "servo_limit_cycle"
    says = "the platform's servo loop oscillates, by {size}"
    sources = ("lawrence1998",)
    A: Array = parameter(PLATFORM_AXES, unit="urad", sigma=5, name="limit_cycle_sin")
    B: Array = parameter(PLATFORM_AXES, unit="urad", sigma=5, name="limit_cycle_cos")
    period: float = constant(10.0, unit="s", low=0.02, high=120.0, grid=Grid.PERIOD)

    def contribution(self, s: Stimulus) -> Array:
        """Return the rotation in platform axes [rad], (n, 3)."""
        return _harmonic(self.A, self.B, s.time, self.period)


@effect
class SchulerOscillation(Effect):
    r"""The navigator's level loop swings with the period of a pendulum as long as the Earth's radius.

    .. math:: \delta\phi = (A \sin(2\pi t / P) + B \cos(2\pi t / P)) \, e^{-\lambda t}, \qquad P = 2\pi\sqrt{R / g}

    with lambda zero where nothing damps it.

    Source: Britting (1971), Schuler tuning. Magnitude: 0.5 to 20 arcsec. Seen by: roll and pitch, nothing else.
    Confounded with: nothing.
    """

    id = "schuler_oscillation"
    says = "the navigator swings with Schuler's period, by {size}"
    stage = Stage.ATTITUDE
    channel = "attitude_error"
    kinds = ("static-run",)
    sources = ("britting1971", "wu2018")
    A: Array = parameter(("roll", "pitch"), unit="arcsec", sigma=1, name="schuler_sin")
    B: Array = parameter(("roll", "pitch"), unit="arcsec", sigma=1, name="schuler_cos")
    period: float = constant(SCHULER_PERIOD, unit="min", low=80 * 60.0, high=89 * 60.0, grid=Grid.PERIOD)
    damping: float = constant(0.0, unit="1/h", low=0.0, high=1 / HOUR, grid=Grid.DECAY)

    def contribution(self, s: Stimulus) -> Array:
        """Return the roll, pitch, yaw [rad], (n, 3)."""
        swing = _harmonic(self.A, self.B, s.time, self.period) * exp(-self.damping * s.time)[..., None]
        return np.concatenate([swing, 0 * swing[..., :1]], axis=-1)


@effect
class ClockRate(PlatformTurn):
    r"""The clock of the recording runs slow against the Earth's turn, or fast.

    .. math:: \varphi = (0, 0, -\omega_{ie} \kappa t), \qquad \delta f = \kappa t \, \dot f

    What it calls t is t (1 + kappa): a positive kappa is a slow clock. Source: Groves (2013), data timing. Magnitude:
    0.01 to 50 ppm. Seen by: a growing phase of the sidereal line. Confounded with: gyro_drift about the polar axis,
    exactly, as far as the accelerometers are asked.
    """

    id = "clock_rate"
    says = "the clock of the recording runs wrong by {size}"
    sources = ("groves2013",)
    kappa: float = parameter(SCALAR, unit="ppm", sigma=10, name="clock_rate")

    def contribution(self, s: Stimulus) -> Array:
        """Return the rotation in platform axes [rad], (n, 3): the Earth's turn in the time the clock has lost."""
        turn = EARTH_RATE * self.kappa * s.time
        return np.stack([0 * turn, 0 * turn, -turn], axis=-1)


def _harmonic(A: Array, B: Array, time: Array, period: float) -> Array:
    phase = (2 * pi / period * time)[..., None]
    return np.asarray(A * sin(phase) + B * cos(phase))
