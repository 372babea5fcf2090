"""Accelerometers that remember the last moves: hysteresis, creep, and the position before the last."""

from __future__ import annotations

import numpy as np

from gimbalcal.earth import G0
from gimbalcal.effects.effect import TRIAD, Effect, Grid, Stage, Stimulus, constant, effect, parameter
from gimbalcal.effects.history import Dynamics, direction
from gimbalcal.number import Array, exp

MIN_MOVE = 1e-3 * G0  # m/s^2; a change of force below this has no sense of direction


@effect
class AccelerometerHysteresis(Effect):
    r"""The output depends on whether the force was reached from below or from above.

    .. math:: \delta a_i = h_i \operatorname{sign}(\Delta f_i)

    with the change of force at the last move. Source: IEEE Std 528, hysteresis error. Magnitude: 1 to 20 ug (quartz
    flexure), 50 to 1000 (MEMS). Seen by: order of visits, not position. Nearly confounded with: cross_coupling in
    one order; the reversed order distinguishes them.
    """

    id = "accelerometer_hysteresis"
    says = "{who} reads differently after a rise than after a fall of the force, by {size}"
    stage = Stage.ACCELEROMETER
    kinds = ("multi-position",)
    sources = ("ieee528", "ieee1293")
    h: Array = parameter(TRIAD, unit="ug", sigma=10, name="hysteresis")

    def contribution(self, s: Stimulus) -> Array:
        """Return the output added [m/s^2]."""
        return self.h * direction(s.move_force, MIN_MOVE)


@effect
class PostMoveCreep(Effect):
    r"""After a change of load the hinge relaxes: an output in proportion to the change, or to the new load, dies away.

    .. math:: \delta a_i = (c_i \Delta f_i + l_i f_i) e^{-(t - t_{move}) / \tau}

    The first term is that of a suspension loaded through the move, the second of one that was caged, or whose
    torquer was off, while it moved. Source: IEEE Std 1293, turn-on and rotation transients. Magnitude: 5 to 50 ug/g
    (quartz flexure), tau 1 to 30 min. Seen by: the first minutes of each dwell, when the dwell is not averaged.
    Confounded with: nothing while time in the dwell is kept.
    """

    id = "post_move_creep"
    says = "{who} creeps after each move, by {size}"
    stage = Stage.ACCELEROMETER
    kinds = ("multi-position",)
    sources = ("ieee1293",)
    c: Array = parameter(TRIAD, unit="ug/g", sigma=30, name="creep")
    l: Array = parameter(TRIAD, unit="ug/g", sigma=30, name="creep_of_load", mechanism="load")
    tau: float = constant(300.0, unit="min", low=20.0, high=3600.0, grid=Grid.LAG)

    def contribution(self, s: Stimulus) -> Array:
        """Return the output added [m/s^2]."""
        return (self.c * s.move_force + self.l * s.force) * exp(-s.since_move / self.tau)[..., None]

    def dynamics(self, s: Stimulus) -> Dynamics:
        """Return the share of the relaxation to come: one at every move, whatever remained of the one before."""
        load = self.c * s.move_force + self.l * s.force
        moved = np.diff(s.visit, prepend=s.visit[0]) != 0
        remaining = exp(-s.since_move / self.tau)[:, None]
        return Dynamics(np.zeros((len(s.time), 1)), remaining, load, self.tau, moved)


@effect
class TwoMoveMemory(Effect):
    r"""The output remembers the force held two positions ago (Preisach: the last extreme but one).

    .. math:: \delta a_i = m_i f_i^{(n-2)}

    Source: IEEE Std 528, hysteresis error. Magnitude: 1 to 10 ug/g (quartz flexure), 20 to 500 (MEMS). Seen by:
    order of visits two back. Confounded with: nothing; two different orders tell it from a position's own error.
    """

    id = "two_move_memory"
    says = "{who} remembers the position before the last, by {size}"
    stage = Stage.ACCELEROMETER
    kinds = ("multi-position",)
    sources = ("ieee528",)
    m: Array = parameter(TRIAD, unit="ug/g", sigma=5, name="two_move_memory")

    def contribution(self, s: Stimulus) -> Array:
        """Return the output added [m/s^2]; before the third dwell the sensor remembers the first position."""
        return self.m * (s.force - s.move_force - s.earlier_move_force)
