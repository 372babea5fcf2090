"""Gimbals, encoders and what carries them: why a readout is not the angle of the platform."""

from __future__ import annotations

import numpy as np

from gimbalcal.effects.effect import EVERY_KIND, GIMBALS, Effect, Grid, Stage, Stimulus, constant, effect, parameter
from gimbalcal.effects.history import direction
from gimbalcal.number import Array, cos, sin

SMALLEST_TURN = 1e-3  # rad; a move below this has no sense of direction


@effect
class GimbalZero(Effect):
    r"""The zero of an angle sensor is off: the true angle is the readout plus this.

    .. math:: \delta\theta = \theta_0, \qquad \theta = \theta_{readout} + \delta\theta

    with all three counted as the platform's drawing counts them (Table 1), whichever way a recording logs its readouts:
    those of S_t and q in Eq. (4) run the other way, and there the zero adds with the other sign.

    Source: Wu et al. (2018), section 3: theta_10 (platform), theta_20 (inner), theta_30 (middle). Magnitude: 1 to
    100 arcsec. Seen by: the same gimbal with gravity on two sides of it. Confounded with: base_tilt in a static
    run.
    """

    id = "gimbal_zero"
    says = "the zero of {who} is off by {size}"
    stage = Stage.ENCODER
    kinds = EVERY_KIND
    sources = ("wu2018",)
    theta_0: Array = parameter(GIMBALS, unit="arcsec", sigma=120, name="gimbal_zero")

    def contribution(self, s: Stimulus) -> Array:
        """Angle minus readout [rad], (n, k), in the sense in which the readouts at hand are counted."""
        return np.asarray(self.theta_0) * np.array(s.sense or 1) + 0 * s.readout


def directions(s: Stimulus) -> Array:
    """Unit vectors (k, 3) of the gimbal axes, each in the frame that turns with it."""
    return np.eye(3)[["xyz".index(d) for d in s.axis_directions]].reshape(-1, 3)


@effect
class GimbalNonorthogonality(Effect):
    r"""Two neighbouring gimbal axes do not stand at right angles.

    .. math:: T_i = \epsilon_i \, a_i \times a_{i+1}, \qquad
              C_b^p = R_1(\theta_1) \, T_1 \, R_2(\theta_2) \, T_2 \, R_3(\theta_3) \cdots

    with T_i the small rotation between axis i and the next one out, about the direction across both. Source: Wu et
    al. (2018), Eq. (3), whose axes are orthogonal. Magnitude: 1 to 20 arcsec. Seen by: all tilted positions, three
    channels together. Confounded with: gimbal_zero and base_tilt for the outermost pair when the outer gimbal
    stands still.
    """

    id = "gimbal_nonorthogonality"
    says = "{who} does not stand at a right angle to its neighbour, by {size}"
    stage = Stage.AXIS_TILT
    kinds = EVERY_KIND
    usual = ("pointing",)
    sources = ("wu2018",)
    epsilon: Array = parameter(GIMBALS, unit="arcsec", sigma=10, name="nonorthogonality")

    def contribution(self, s: Stimulus) -> Array:
        """Rotation between each axis and the next one out [rad], (n, k, 3)."""
        own = directions(s)
        across = np.cross(own, np.concatenate([own[1:], own[-1:]]))  # the outermost axis has no neighbour
        return across * np.asarray(self.epsilon)[:, None] + 0 * s.readout[..., None]


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
        """Angle minus readout [rad], (n, k)."""
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
        """Angle minus readout [rad], (n, k)."""
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
    no_cause = "it says a shape, not a cause"
    A: Array = parameter(GIMBALS, unit="arcsec", sigma=1, name="harmonic_sin")
    B: Array = parameter(GIMBALS, unit="arcsec", sigma=1, name="harmonic_cos")
    order: float = constant(3.0, unit="1", low=3.0, high=24.0, grid=Grid.WHOLE)

    def contribution(self, s: Stimulus) -> Array:
        """Angle minus readout [rad], (n, k)."""
        return self.A * sin(self.order * s.angle) + self.B * cos(self.order * s.angle)


@effect
class EncoderCyclicError(Effect):
    r"""Interpolation between the lines of the circle is imperfect: an error once per line.

    .. math:: \delta\theta = A \sin N\theta + B \cos N\theta

    Source: sine and cosine channels of unequal gain and offset. Magnitude: 0.05 to 1 arcsec. Seen by: a slow sweep
    over one line. Confounded with: setting_error on positions that are far apart.
    """

    id = "encoder_cyclic_error"
    says = "the angle encoder of {who} errs by {size} within each of its lines"
    stage = Stage.ENCODER
    kinds = EVERY_KIND
    channel = "gimbal_angle"
    no_cause = "it says a shape, not a cause"
    A: Array = parameter(GIMBALS, unit="arcsec", sigma=0.5, name="cyclic_sin")
    B: Array = parameter(GIMBALS, unit="arcsec", sigma=0.5, name="cyclic_cos")
    lines: float = constant(360.0, unit="1", low=32.0, high=65536.0, grid=Grid.WHOLE)

    def contribution(self, s: Stimulus) -> Array:
        """Angle minus readout [rad], (n, k)."""
        return self.A * sin(self.lines * s.angle) + self.B * cos(self.lines * s.angle)


@effect
class PeriodicWormError(Effect):
    r"""A worm that runs out of true pushes its wheel to and fro once per turn of the worm.

    .. math:: \delta\theta = A \sin N\theta + B \cos N\theta

    with N the teeth of the wheel. Source: Wallace, TPOINT manual. Magnitude: 1 to 30 arcsec. Seen by: tracking over
    one tooth. Confounded with: encoder_cyclic_error with as many lines as teeth.
    """

    id = "periodic_worm_error"
    says = "the worm of {who} pushes it to and fro by {size}"
    stage = Stage.ENCODER
    channel = "gimbal_angle"
    kinds = ("pointing",)
    sources = ("wallace_tpoint",)
    A: Array = parameter(GIMBALS, unit="arcsec", sigma=10, name="worm_sin")
    B: Array = parameter(GIMBALS, unit="arcsec", sigma=10, name="worm_cos")
    teeth: float = constant(360.0, unit="1", low=30.0, high=2000.0, grid=Grid.WHOLE)

    def contribution(self, s: Stimulus) -> Array:
        """Angle minus readout [rad], (n, k)."""
        return self.A * sin(self.teeth * s.angle) + self.B * cos(self.teeth * s.angle)


@effect
class BearingWobble(Effect):
    r"""The axis of a bearing wobbles while it turns, m times per revolution.

    .. math:: T_i = w_{c,i} (e_{1,i} \cos m\theta_i + e_{2,i} \sin m\theta_i)
              + w_{s,i} (e_{2,i} \cos m\theta_i - e_{1,i} \sin m\theta_i)

    with e_1, e_2 across the axis. Source: bearing run-out. Magnitude: 0.2 to 5 arcsec. Seen by: three channels
    together, m of 2 and more. Confounded with: a fixed lean of the next axis for m = 1; nearly with
    encoder_two_cycle for m = 2.
    """

    id = "bearing_wobble"
    says = "the bearing of {who} wobbles by {size}"
    stage = Stage.AXIS_TILT
    kinds = EVERY_KIND
    w_c: Array = parameter(GIMBALS, unit="arcsec", sigma=2, name="wobble_cos")
    w_s: Array = parameter(GIMBALS, unit="arcsec", sigma=2, name="wobble_sin")
    m: float = constant(2.0, unit="1", low=1.0, high=12.0, grid=Grid.WHOLE)

    def contribution(self, s: Stimulus) -> Array:
        """Rotation between each axis and the next one out [rad], (n, k, 3)."""
        own = directions(s)
        e_1, e_2 = np.roll(own, 1, axis=-1), np.roll(own, 2, axis=-1)
        c, d = cos(self.m * s.angle)[..., None], sin(self.m * s.angle)[..., None]
        w_c, w_s = np.asarray(self.w_c)[:, None], np.asarray(self.w_s)[:, None]
        return np.asarray(w_c * (e_1 * c + e_2 * d) + w_s * (e_2 * c - e_1 * d))


@effect
class GimbalFlexure(Effect):
    r"""The unbalanced gimbal sags under its own weight against the stiffness of its loop.

    .. math:: \delta\theta_i = \kappa_{1,i} \, g_1^{(i)} + \kappa_{2,i} \, g_2^{(i)}
              + (\kappa_{3,i} \cos\theta_{i-1} + \kappa_{4,i} \sin\theta_{i-1}) \, g_{a(i-1)}^{(i)}

    with g_1, g_2 the components of gravity across axis i in the frame that turns with it, and g_a(i-1) the one
    along the next axis inwards: a mass that turns with gimbal i loads the first two, a mass carried by the gimbal
    inside it the last two. Source: torque of a mass off its axis. Magnitude: 0.5 to 10 arcsec/g. Seen by: positions
    whose load on that gimbal differs. Confounded with: encoder_eccentricity, exactly, where the axis is horizontal
    and carries its own load.
    """

    id = "gimbal_flexure"
    says = "{who} sags under its own weight by {size}"
    stage = Stage.ENCODER
    kinds = EVERY_KIND
    channel = "gimbal_angle"
    kappa_1: Array = parameter(GIMBALS, unit="arcsec/g", sigma=5, name="flexure_1")
    kappa_2: Array = parameter(GIMBALS, unit="arcsec/g", sigma=5, name="flexure_2")
    kappa_3: Array = parameter(GIMBALS, unit="arcsec/g", sigma=5, name="flexure_carried_cos", mechanism="carried")
    kappa_4: Array = parameter(GIMBALS, unit="arcsec/g", sigma=5, name="flexure_carried_sin", mechanism="carried")

    def contribution(self, s: Stimulus) -> Array:
        """Angle minus readout [rad], (n, k)."""
        own = directions(s)
        load = np.asarray(s.load) * s.gravity
        first = (load * np.roll(own, 1, axis=-1)).sum(axis=-1)
        second = (load * np.roll(own, 2, axis=-1)).sum(axis=-1)
        inside = np.concatenate([np.zeros((1, 3)), own[:-1]])  # the innermost gimbal carries no other
        along = (load * inside).sum(axis=-1)
        turned = np.roll(s.angle, 1, axis=-1)
        own_mass = self.kappa_1 * first + self.kappa_2 * second
        return own_mass + (self.kappa_3 * cos(turned) + self.kappa_4 * sin(turned)) * along


@effect
class GimbalFriction(Effect):
    r"""Stiction leaves each gimbal short of its readout, on the side from which it came.

    .. math:: \delta\theta_i = h_i \operatorname{sign}(\Delta\theta_i)

    with the turn at the last move of that gimbal's schedule, or of a mount from star to star: the play of its gears.
    Source: friction torque over loop stiffness. Magnitude: 0.1 to 2 arcsec; gears 1 to 30. Seen by: order of visits,
    across the force. Nearly confounded with: accelerometer_hysteresis, which acts along it.
    """

    id = "gimbal_friction"
    says = "{who} sticks and stops short of its readout by {size}"
    stage = Stage.ENCODER
    channel = "gimbal_angle"
    kinds = ("multi-position", "pointing")
    h: Array = parameter(GIMBALS, unit="arcsec", sigma=2, name="friction")

    def contribution(self, s: Stimulus) -> Array:
        """Angle minus readout [rad], (n, k)."""
        return self.h * direction(s.move_angle, SMALLEST_TURN)


@effect
class PositionBlunder(Effect):
    r"""One position was not set where the readout says, or its dwell was disturbed.

    .. math:: \varphi = \delta \, [p = p_0], \qquad f^p = R(\varphi) f^p_{ideal}

    Source: operation. Magnitude: any. Seen by: one position only, across the force. Confounded with: nothing; the
    turn about the force itself is invisible. Repeat the position.
    """

    id = "position_blunder"
    says = "one position was not set where its readout says, or was disturbed: {size}"
    stage = Stage.PLATFORM
    requires = ("position",)
    kinds = ("multi-position",)
    joint = True
    delta: Array = parameter(("x", "y", "z"), unit="arcsec", sigma=30, name="blunder")
    position: float = constant(1.0, unit="1", low=1.0, high=1000.0, grid=Grid.POSITION)

    def contribution(self, s: Stimulus) -> Array:
        """Rotation in platform axes [rad], (n, 3)."""
        return self.delta * np.asarray(s.position == self.position, dtype=float)[..., None]
