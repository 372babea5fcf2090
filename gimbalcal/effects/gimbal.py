"""Zeros and right angles of gimbals: where the readout and the axes of a perfect platform begin to be off."""

from __future__ import annotations

import numpy as np

from gimbalcal.effects.effect import EVERY_KIND, GIMBALS, Effect, Role, Stage, Stimulus, effect, parameter
from gimbalcal.number import Array


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
        """Return the angle minus readout [rad], (n, k), in the sense in which the readouts at hand are counted."""
        return np.asarray(self.theta_0) * np.array(s.sense or 1) + 0 * s.readout


def directions(s: Stimulus) -> Array:
    """Return unit vectors (k, 3) of the gimbal axes, each in the frame that turns with it."""
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
    role = Role(textbook_kinds=("pointing",))
    sources = ("wu2018",)
    epsilon: Array = parameter(GIMBALS, unit="arcsec", sigma=10, name="nonorthogonality")

    def contribution(self, s: Stimulus) -> Array:
        """Return the rotation between each axis and the next one out [rad], (n, k, 3)."""
        own = directions(s)
        across = np.cross(own, np.concatenate([own[1:], own[-1:]]))  # the outermost axis has no neighbour
        return across * np.asarray(self.epsilon)[:, None] + 0 * s.readout[..., None]
