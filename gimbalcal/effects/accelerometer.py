"""Input-output law of the accelerometers: the calibration coefficients of Wu et al. (2018), Eqs. (5) and (6)."""

from __future__ import annotations

import numpy as np

from gimbalcal.effects.effect import MISALIGNMENT_AXES, TRIAD, Effect, Role, Stage, Stimulus, effect, parameter
from gimbalcal.number import Array, sqrt


def misalignment_error(beta: Array, force: Array) -> Array:
    """Return (C_p^a - I) f of Wu et al. (2018), Eq. (5): beta (6,) in the order of MISALIGNMENT_AXES, force (..., 3).

    The same for the input axes of gyroscopes, with the angular rate in place of the force.
    """
    xy, xz, yz, yx, zx, zy = beta
    fx, fy, fz = (force[..., i] for i in range(3))
    out = np.empty(np.shape(force), dtype=np.result_type(beta, force))
    out[..., 0], out[..., 1], out[..., 2] = xz * fy - xy * fz, yx * fz - yz * fx, zy * fx - zx * fy
    return out


def misalignment_matrix(beta: Array) -> Array:
    """Return C_p^a - I (3, 3) of beta (6,)."""
    return misalignment_error(beta, np.eye(3)).T


def angles_of(C: Array) -> Array:
    """Return beta (6,) of C_p^a (3, 3), or of any matrix with these angles off the diagonal."""
    return np.array([-C[0, 2], C[0, 1], -C[1, 0], C[1, 2], -C[2, 1], C[2, 0]])


def nonlinearity_error(K: Array, force: Array) -> Array:
    r"""Return output w less input u of w = u + K w^2, exactly: u (1 - r) / (1 + r) with r = sqrt(1 - 4 K u).

    The implicit Eq. (6) of Wu et al. (2018) solved; K u^2 to first order (K2 of IEEE Std 1293).
    """
    r = sqrt(1 - 4 * K * force)
    return np.asarray(force * (1 - r) / (1 + r))


def cross_forces(force: Array) -> tuple[Array, Array]:
    """Return the force across each axis: along the next one and the one after it, (f_j, f_k), each (..., 3)."""
    return force[..., [1, 2, 0]], force[..., [2, 0, 1]]


@effect
class Misalignment(Effect):
    r"""The three input axes do not lie along the platform axes; each leans by two small angles.

    .. math:: C_p^a = \begin{bmatrix} 1 & \beta_{xz} & -\beta_{xy} \\ -\beta_{yz} & 1 & \beta_{yx} \\
              \beta_{zy} & -\beta_{zx} & 1 \end{bmatrix}

    Source: Wu et al. (2018), Eq. (5). Magnitude: 1 to 60 arcsec on a navigation platform. Seen by: a cross axis at
    1 g. A rotation common to all three axes about z is the same thing as the zero of the platform gimbal.
    Confounded with: gimbal_zero.
    """

    id = "misalignment"
    says = "the input axis of {who} leans by {size}"
    stage = Stage.INPUT_AXIS
    role = Role(textbook_kinds=("multi-position", "rotation"))
    gauge = ("xy", "xz", "yx")  # with the others they turn the block, which shows where its attitude is known
    sources = ("wu2018",)
    beta: Array = parameter(MISALIGNMENT_AXES, unit="arcsec", sigma=120, name="misalignment")

    def contribution(self, s: Stimulus) -> Array:
        """Return the force added along the input axes [m/s^2]: (C_p^a - I) f^p."""
        return misalignment_error(self.beta, s.force)


@effect
class ScaleFactor(Effect):
    r"""Each accelerometer's scale factor differs from the nominal one.

    .. math:: \delta f_i = \frac{f_i}{1 + s_i} - f_i, \qquad f^a = SF^{-1} C_p^a f^p, \qquad s = SF - 1

    Source: Wu et al. (2018), Eq. (6). Magnitude: 10 to 500 ppm. Seen by: own axis at +1 g against -1 g. An error of
    the gravity value is the same thing as a common change of all three. Confounded with: gravity_error.
    """

    id = "scale_factor"
    says = "{who} has a scale factor that is off by {size}"
    stage = Stage.SCALE
    sources = ("wu2018",)
    linear = False
    s: Array = parameter(TRIAD, unit="ppm", sigma=500, name="scale_factor")

    def contribution(self, s: Stimulus) -> Array:
        """Return the force added along the input axes [m/s^2]: (1 / (1 + s) - 1) f."""
        return -self.s / (1 + self.s) * s.force


@effect
class ScaleNonlinearity(Effect):
    r"""The output bends quadratically with itself (IEEE Std 1293: K2).

    .. math:: w = u + K_{nl} w^2 \;\Rightarrow\; w - u = u \, \frac{1 - r}{1 + r}, \quad r = \sqrt{1 - 4 K_{nl} u}

    with u the scaled force and w = f^a - b, the exact solution. Source: Wu et al. (2018), Eq. (6), implicit.
    Magnitude: 1 to 30 ug/g^2 (quartz flexure). Seen by: own axis at 1 g against 0.71 g. Confounded with:
    quadratic_nonlinearity, the same law under the catalogue's name.
    """

    id = "scale_nonlinearity"
    says = "{who} bends with the square of its output, by {size}"
    stage = Stage.ACCELEROMETER
    sources = ("wu2018", "ieee1293")
    linear = False
    K_nl: Array = parameter(TRIAD, unit="ug/g^2", sigma=30, name="scale_nonlinearity")

    def contribution(self, s: Stimulus) -> Array:
        """Return the output added [m/s^2]: w - u."""
        return nonlinearity_error(self.K_nl, s.force)


@effect
class Bias(Effect):
    r"""A constant output at zero force.

    .. math:: \delta a_i = b_i

    Source: Wu et al. (2018), Eq. (6), delta b. Magnitude: 10 to 500 ug. Seen by: own axis at +1 g against -1 g.
    Confounded with: the common part of K2, Kpp and Koo at 1 g.
    """

    id = "bias"
    says = "{who} reads {size} where there is no force"
    stage = Stage.ACCELEROMETER
    sources = ("wu2018",)
    b: Array = parameter(TRIAD, unit="ug", sigma=500, name="bias")

    def contribution(self, s: Stimulus) -> Array:
        """Return the output added [m/s^2]."""
        return self.b + 0 * s.force


@effect
class FrameMisalignment(Effect):
    r"""The sensor block is turned as a whole against the platform.

    .. math:: \delta f = f \times \vartheta

    Source: Wu et al. (2018), Eq. (5), the part common to all axes. Magnitude: 1 to 100 arcsec. Seen by: nothing
    that misalignment does not see. Confounded with: misalignment (its antisymmetric part), exactly; gimbal_zero
    about z.
    """

    id = "frame_misalignment"
    says = "the sensor block is turned against its platform by {size}"
    stage = Stage.INPUT_AXIS
    role = Role(excluded="misalignment contains it")
    sources = ("wu2018",)
    theta: Array = parameter(TRIAD, unit="arcsec", sigma=60, name="frame_misalignment")

    def contribution(self, s: Stimulus) -> Array:
        """Return the force added along the input axes [m/s^2]."""
        return np.cross(s.force, np.asarray(self.theta) + 0 * s.force)
