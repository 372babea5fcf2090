"""Bearings, loads and friction of gimbals: where the platform really stands once the loop has stopped."""

from __future__ import annotations

import numpy as np

from gimbalcal.effects.effect import (
    EVERY_KIND,
    GIMBALS,
    Effect,
    Grid,
    Role,
    Stage,
    Stimulus,
    constant,
    effect,
    parameter,
)
from gimbalcal.effects.gimbal import directions
from gimbalcal.effects.history import direction
from gimbalcal.number import Array, cos, sin

MIN_TURN_RAD = 1e-3  # rad; a move below this has no sense of direction


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
        """Return the rotation between each axis and the next one out [rad], (n, k, 3)."""
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
        """Return the angle minus readout [rad], (n, k)."""
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
        """Return the angle minus readout [rad], (n, k)."""
        return self.h * direction(s.move_angle, MIN_TURN_RAD)


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
    role = Role(indivisible=True)
    delta: Array = parameter(("x", "y", "z"), unit="arcsec", sigma=30, name="blunder")
    position: float = constant(1.0, unit="1", low=1.0, high=1000.0, grid=Grid.POSITION)

    def contribution(self, s: Stimulus) -> Array:
        """Return the rotation in platform axes [rad], (n, 3)."""
        return self.delta * np.asarray(s.position == self.position, dtype=float)[..., None]
