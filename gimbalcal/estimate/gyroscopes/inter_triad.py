r"""The rotation between the accelerometers' frame p and the gyroscopes' frame q: Wang et al. (2019), Eq. (43).

After Zhang et al. (2010), the paper's reference [9]: turn the unit from rest to rest; the gyroscopes say by which
rotation R^q, the accelerometers where gravity was before and after, and both must be one turn of one body,

.. math:: C_p^q f_2^p = R^q \, C_p^q f_1^p .

A whole revolution brings gravity back and says nothing here.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gimbalcal.errors import InputError
from gimbalcal.inference.levenberg import minimise
from gimbalcal.number import Array, apply_matrix, arcsin, arctan2, complex_step
from gimbalcal.rotation import frame_rotation


@dataclass(frozen=True)
class InterTriad:
    """alpha, beta, gamma (3,) [rad] of Eq. (43) with their covariance [rad^2] and the rms misfit of the pairs [rad]."""

    angles: Array
    covariance: Array
    rms: float


def triad_rotation(angles: Array) -> Array:
    """C_p^q = Ry(gamma) Rx(beta) Rz(alpha) of Eq. (43) from (..., 3) [rad]."""
    a = np.asarray(angles)
    return np.asarray(frame_rotation("y", a[..., 2]) @ frame_rotation("x", a[..., 1]) @ frame_rotation("z", a[..., 0]))


def euler(C: Array) -> Array:
    """alpha, beta, gamma (3,) [rad] of a rotation matrix, the inverse of `triad_rotation` for |beta| < pi/2."""
    return np.array([arctan2(-C[1, 0], C[1, 1]), arcsin(C[1, 2]), arctan2(-C[0, 2], C[2, 2])])


def from_turns(before: Array, after: Array, turns: Array, sigma: float) -> InterTriad:
    """Estimate the rotation from unit force before and after (m, 3) in p and the turns R^q (m, 3, 3) between.

    sigma [rad]: error of one pair per component. Raises InputError where the turns do not determine the rotation.
    """

    def misfit(x: Array) -> Array:
        C = triad_rotation(x)
        return (apply_matrix(C, after) - apply_matrix(turns @ C, before)).ravel()

    # rotations of two frames against each other are no rows of the forward model: the derivative is by the angles
    found = minimise(lambda x, _: (misfit(x[0])[None], complex_step(misfit, x[0])[None]), np.zeros((1, 3)))
    J = found.jacobian[0]
    if np.linalg.svd(J, compute_uv=False)[-1] < 1e-6 * np.sqrt(len(before)):  # turns of order one give order one
        raise InputError(
            "these turns do not determine the rotation between the triads: turn about two axes that are not "
            "vertical, by angles that are not whole revolutions"
        )
    rms = float(np.sqrt(2 * found.cost[0] / J.shape[0]))
    return InterTriad(found.x[0], sigma**2 * np.linalg.inv(J.T @ J), rms)
