"""Nonlinearities of an accelerometer besides bias and scale factor: even, odd, kinked, cross-coupled, dead, saturated.

Forces are those along the input axes. At rest no input exceeds 1 g, and the 18 positions offer five input levels
(-1, -0.71, 0, 0.71, 1 g): several of these laws are then one and the same, as their cards say.
"""

from __future__ import annotations

import numpy as np

from gimbalcal.earth import G0
from gimbalcal.effects.accelerometer import cross_forces, nonlinearity_error
from gimbalcal.effects.effect import (
    PARTNER_AXES,
    TRIAD,
    Effect,
    Role,
    Stage,
    Stimulus,
    constant,
    effect,
    parameter,
)
from gimbalcal.number import Array, absolute, maximum, minimum, sign


@effect
class QuadraticNonlinearity(Effect):
    r"""The output bends with the square of the force: the two signs of input push the proof mass off its null alike.

    .. math:: \delta a_i = f_i \, \frac{1 - r}{1 + r}, \qquad r = \sqrt{1 - 4 K_{2,i} f_i}

    which is K_2 times the square of the output, to first order of the force. Source: IEEE Std 1293, K2; the law of
    Eq. (6) of Wu et al. (2018). Magnitude: 5 to 50 ug/g^2 (quartz flexure), 100 to 3000 (MEMS). Seen by: own axis
    at 1 g against 0.71 g; the 2nd harmonic of a sidereal turn. Confounded with: cross_coupling in a static run;
    scale_nonlinearity is the same coefficient in the 18-parameter model.
    """

    id = "quadratic_nonlinearity"
    says = "{who} bends with the square of the force, by {size}"
    stage = Stage.ACCELEROMETER
    sources = ("ieee1293", "wu2018")
    linear = False
    K2: Array = parameter(TRIAD, unit="ug/g^2", sigma=30)

    def contribution(self, s: Stimulus) -> Array:
        """Return the output added [m/s^2]."""
        return nonlinearity_error(self.K2, s.force)


@effect
class OddQuadratic(Effect):
    r"""The output bends with the square of the force, with opposite sense for the two directions.

    .. math:: \delta a_i = K_{oq,i} f_i |f_i|

    Source: IEEE Std 1293, odd quadratic coefficient. Magnitude: 1 to 20 ug/g^2 (quartz flexure). Seen by: own axis
    at 1 g against 0.71 g, odd part. Confounded with: cubic_nonlinearity at or below 1 g.
    """

    id = "odd_quadratic"
    says = "{who} bends with the square of the force, oppositely in its two directions, by {size}"
    stage = Stage.ACCELEROMETER
    sources = ("ieee1293", "ieee836")
    K_oq: Array = parameter(TRIAD, unit="ug/g^2", sigma=10)

    def contribution(self, s: Stimulus) -> Array:
        """Return the output added [m/s^2]."""
        return self.K_oq * s.force * absolute(s.force)


@effect
class CubicNonlinearity(Effect):
    r"""The restoring force stiffens or softens alike in both directions.

    .. math:: \delta a_i = K_{3,i} f_i^3

    Source: IEEE Std 1293, K3. Magnitude: 1 to 20 ug/g^3 (quartz flexure), 50 to 2000 (MEMS). Seen by: own axis at 1
    g against 0.71 g, odd part; the 3rd harmonic of a sidereal turn. Confounded with: odd_quadratic at or below 1 g.
    """

    id = "cubic_nonlinearity"
    says = "{who} bends with the cube of the force, by {size}"
    stage = Stage.ACCELEROMETER
    sources = ("ieee1293", "ieee836")
    K3: Array = parameter(TRIAD, unit="ug/g^3", sigma=10)

    def contribution(self, s: Stimulus) -> Array:
        """Return the output added [m/s^2]."""
        return self.K3 * s.force**3


@effect
class ScaleFactorAsymmetry(Effect):
    r"""The scale factor differs between positive and negative force: two torquer currents, two gains.

    .. math:: \delta a_i = S_i |f_i|

    Source: IEEE Std 1293, scale-factor asymmetry. Magnitude: 5 to 50 ppm (quartz flexure), 100 to 2000 (MEMS). Seen
    by: the positive against the negative half of the own axis. Nearly confounded with: quadratic_nonlinearity.
    """

    id = "scale_factor_asymmetry"
    says = "{who} has another scale factor for positive than for negative force, by {size}"
    stage = Stage.ACCELEROMETER
    sources = ("ieee1293", "ieee528")
    S: Array = parameter(TRIAD, unit="ppm", sigma=20, name="asymmetry")

    def contribution(self, s: Stimulus) -> Array:
        """Return the output added [m/s^2]."""
        return self.S * absolute(s.force)


@effect
class CrossCoupling(Effect):
    r"""Force across the input axis deflects the pendulum, and the own force then leans with it.

    .. math:: \delta a_i = K_{ij} f_i f_j + K_{ik} f_i f_k

    Source: IEEE Std 1293, Kip and Kio. Magnitude: 2 to 20 ug/g^2 (quartz flexure). Seen by: positions with the own
    and another axis both loaded. Confounded with: quadratic_nonlinearity and most 2nd harmonics in a static run.
    """

    id = "cross_coupling"
    says = "{who} answers to force across its axis in step with its own, by {size}"
    stage = Stage.ACCELEROMETER
    sources = ("ieee1293",)
    K_c: Array = parameter(PARTNER_AXES, unit="ug/g^2", sigma=10)

    def contribution(self, s: Stimulus) -> Array:
        """Return the output added [m/s^2]."""
        xy, xz, yx, yz, zx, zy = self.K_c
        fx, fy, fz = (s.force[..., i] for i in range(3))
        return np.stack([fx * (xy * fy + xz * fz), fy * (yx * fx + yz * fz), fz * (zx * fx + zy * fy)], axis=-1)


@effect
class CrossAxisProduct(Effect):
    r"""Forces across the input axis act on their own: through the pendulum's and the hinge's compliance.

    .. math:: \delta a_i = K_{po,i} f_j f_k + K_{pp,i} f_j^2

    with j the next axis and k the one after. Koo = 0 by convention: at 1 g the sum of all three squares is a bias.
    Source: IEEE Std 1293, Kpo, Kpp, Koo. Magnitude: 1 to 20 ug/g^2 (quartz flexure). Seen by: positions with the
    own axis at null and both others loaded. Confounded with: block_sag; nearly with cross_coupling in a static run.
    """

    id = "cross_axis_product"
    says = "{who} answers to forces across its axis, by {size}"
    stage = Stage.ACCELEROMETER
    sources = ("ieee1293",)
    K_po: Array = parameter(TRIAD, unit="ug/g^2", sigma=10)
    K_pp: Array = parameter(TRIAD, unit="ug/g^2", sigma=10, mechanism="compliance")

    def contribution(self, s: Stimulus) -> Array:
        """Return the output added [m/s^2]."""
        fj, fk = cross_forces(s.force)
        return self.K_po * fj * fk + self.K_pp * fj**2


@effect
class BlockSag(Effect):
    r"""The sensor block bends under its own weight, so the input axes lean in proportion to the load.

    .. math:: \delta a_i = c_i f_j f_k

    Source: IEEE Std 1293, mounting compliance. Magnitude: 0.5 to 5 urad/g. Seen by: positions with two axes loaded.
    Confounded with: cross_axis_product, exactly, with one orientation of each accelerometer on the block.
    """

    id = "block_sag"
    says = "the sensor block bends under its own weight, by {size}"
    stage = Stage.ACCELEROMETER
    sources = ("ieee1293",)
    c: Array = parameter(TRIAD, unit="urad/g", sigma=3, name="block_sag")

    def contribution(self, s: Stimulus) -> Array:
        """Return the output added [m/s^2]."""
        fj, fk = cross_forces(s.force)
        return self.c * fj * fk


@effect
class ReadoutCurve(Effect):
    r"""The converter behind the sensor has a curve of its own: what polynomials up to the cube do not follow.

    .. math:: \delta a_i = \sum_{n=4}^{7} c_{n,i} P_n(f_i / g_0)

    with Legendre polynomials. Source: IEEE Std 1293, readout electronics. Magnitude: 0.5 to 5 ug (24 bit), 50 to
    5000 (MEMS). Seen by: a continuous tumble. Confounded with: quadratic_nonlinearity and cubic_nonlinearity at the
    five input levels of the 18 positions, where only one even and one odd shape beyond the straight line exist.
    """

    id = "readout_curve"
    says = "{who} has a converter with a curve of its own, of {size}"
    stage = Stage.ACCELEROMETER
    role = Role(excluded="it describes a shape, not a cause")
    sources = ("ieee1293",)
    c_4: Array = parameter(TRIAD, unit="ug", sigma=3)
    c_5: Array = parameter(TRIAD, unit="ug", sigma=3)
    c_6: Array = parameter(TRIAD, unit="ug", sigma=3)
    c_7: Array = parameter(TRIAD, unit="ug", sigma=3)

    def contribution(self, s: Stimulus) -> Array:
        """Return the output added [m/s^2]."""
        x = s.force / G0
        P = [1 + 0 * x, x]
        for n in range(1, 7):
            P.append(((2 * n + 1) * x * P[n] - n * P[n - 1]) / (n + 1))  # Bonnet's recursion
        return np.asarray(self.c_4 * P[4] + self.c_5 * P[5] + self.c_6 * P[6] + self.c_7 * P[7])


@effect
class DeadZone(Effect):
    r"""Below a threshold nothing comes out; above it the threshold is missing.

    .. math:: \delta a_i = -\operatorname{sign}(f_i) \min(|f_i|, d_i)

    Source: IEEE Std 528, dead zone and threshold. Magnitude: below 1 ug (quartz flexure), to 500 ug (MEMS). Seen
    by: positions with the own axis near null against the others. Confounded with: nothing; nearly with
    accelerometer_hysteresis.
    """

    id = "dead_zone"
    says = "{who} does not answer to forces below {size}"
    stage = Stage.ACCELEROMETER
    sources = ("ieee528",)
    linear = False
    d: Array = parameter(TRIAD, unit="ug", sigma=10, name="dead_zone")

    def contribution(self, s: Stimulus) -> Array:
        """Return the output added [m/s^2]."""
        return -sign(s.force) * minimum(absolute(s.force), self.d + 0 * s.force)


@effect
class SoftSaturation(Effect):
    r"""Near full scale the output falls short, the more the further beyond a knee.

    .. math:: \delta a_i = -c_i \operatorname{sign}(f_i) \max(0, |f_i| - f_0)^2

    Source: IEEE Std 1293, input range. Magnitude: nothing on a quartz flexure at 1 g; 0.1 to 5 % near the full
    scale of a 1 to 2 g MEMS part. Seen by: own axis at 1 g. Confounded with: cubic_nonlinearity and odd_quadratic
    on the 18 positions.
    """

    id = "soft_saturation"
    says = "{who} falls short near its full scale, by {size}"
    stage = Stage.ACCELEROMETER
    sources = ("ieee1293",)
    c: Array = parameter(TRIAD, unit="mg/g^2", sigma=1, name="saturation")
    f_0: float = constant(0.85 * G0, unit="m/s^2", low=0.3 * G0, high=0.99 * G0)

    def contribution(self, s: Stimulus) -> Array:
        """Return the output added [m/s^2]."""
        beyond = maximum(absolute(s.force) - self.f_0, 0 * s.force)
        return -self.c * sign(s.force) * beyond**2
