r"""The rotation between the accelerometers' frame p and the gyroscopes' frame q: Wang et al. (2019), Eq. (43).

After Zhang et al. (2010), the paper's reference [9]: turn the unit from rest to rest; the gyroscopes say by which
rotation R^q, the accelerometers where gravity was before and after, and both must be one turn of one body,

.. math:: C_p^q f_2^p = R^q \, C_p^q f_1^p .

A whole revolution brings gravity back and says nothing here.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gimbalcal.calibration import Calibration
from gimbalcal.effects import CATALOGUE, parameters, with_values
from gimbalcal.effects.gyroscope import of_rate_matrix, rate_matrix
from gimbalcal.errors import InputError, amount
from gimbalcal.estimate.gyroscopes.revolutions import EFFECTS
from gimbalcal.inference.algebra import block_diagonal
from gimbalcal.inference.levenberg import minimise
from gimbalcal.number import Array, apply_matrix, arcsin, arctan2, complex_step
from gimbalcal.recording import Recording, dwells
from gimbalcal.recording.dwell import moves_between_dwells
from gimbalcal.recording.record import FORCE, RATE
from gimbalcal.rotation import exponential, frame_rotation, mean_rates
from gimbalcal.units import from_si

MIN_GRAVITY_CHANGE = 0.1  # of its direction: a turn that moves it less, a whole revolution, says nothing of the triads


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
    minimum = minimise(lambda x, _: (misfit(x[0])[None], complex_step(misfit, x[0])[None]), np.zeros((1, 3)))
    J = minimum.jacobian[0]
    if np.linalg.svd(J, compute_uv=False)[-1] < 1e-6 * np.sqrt(len(before)):  # turns of order one give order one
        raise InputError(
            "these turns do not determine the rotation between the triads: turn about two axes that are not "
            "vertical, by angles that are not whole revolutions"
        )
    rms = float(np.sqrt(2 * minimum.cost[0] / J.shape[0]))
    return InterTriad(minimum.x[0], sigma**2 * np.linalg.inv(J.T @ J), rms)


def rotation_between_triads(gyroscopes: Calibration, recording: Recording, accelerometers: Calibration) -> InterTriad:
    """Estimate C_p^q from the turns between dwells that change the direction of gravity in the unit.

    The sigma follows from the residuals of the turns. Raises InputError where fewer than three turns do.
    """
    rate = gyroscopes.apply(recording).triad(RATE)
    force = accelerometers.apply(recording).triad(FORCE)
    rests = dwells(recording)
    down = np.array([force[d.rows].mean(0) for d in rests])
    down /= np.linalg.norm(down, axis=1, keepdims=True)
    between = moves_between_dwells(recording)
    changes = np.linalg.norm(np.diff(down, axis=0), axis=1) > MIN_GRAVITY_CHANGE
    used = [i for i, m in enumerate(between) if changes[i] and not m.paused]
    if len(used) < 3:
        raise InputError(
            f"gravity is moved by {amount(len(used), 'turn')}; three or more tell how the triads lie to each other"
        )
    turns = np.array([_turn(recording.time, rate, between[i].rows, rate[rests[i].rows].mean(0)) for i in used])
    fit = from_turns(down[used], down[[i + 1 for i in used]], turns, sigma=1.0)  # scaled by its residuals below
    # each turn has three residuals of rank two
    sigma = fit.rms * np.sqrt(3 * len(used) / max(2 * len(used) - 3, 1))
    return replace(fit, covariance=sigma**2 * fit.covariance)


def _turn(time: Array, rate: Array, span: slice, earth: Array) -> Array:
    """Return R^q (3, 3) of one turn relative to the Earth, whose rate (3,) [rad/s] is known before it."""
    t, C = time[span], np.eye(3)
    mean, bend, coning = mean_rates(t, rate[span])
    for dt, w in zip(np.diff(t), mean + bend + coning, strict=True):
        C = exponential((w - C @ earth) * dt) @ C
    return C


def in_accelerometer_frame(gyroscopes: Calibration, lie: InterTriad) -> Calibration:
    r"""Return the gyroscopes referred to the accelerometers' frame, with six misalignments instead of three.

    .. math:: y = M \omega^q + \dots = (M C_p^q) \, \omega^p + \dots , \quad M \text{ physics to reading}
    """
    order = [p for e in EFFECTS for p in parameters(CATALOGUE[e])]
    labels = [p.label for p in gyroscopes.parameters]
    linear = [[p.label for p in parameters(CATALOGUE[i])] for i in ("gyro_scale_factor", "gyro_misalignment")]
    n = len(labels)

    def referred(x: Array) -> Array:
        own = dict(zip(labels, x[:n], strict=True))
        s, beta = (np.array([own.get(label, 0.0) for label in of]) for of in linear)
        new = np.concatenate(of_rate_matrix(rate_matrix(s, beta) @ triad_rotation(x[n:])))
        own |= dict(zip([*linear[0], *linear[1]], new, strict=True))
        return np.array([own[p.label] for p in order])

    x = np.concatenate([gyroscopes.values, lie.angles])
    J = complex_step(referred, x)  # a change of variables from one frame to the other
    covariance = block_diagonal([gyroscopes.covariance, lie.covariance])
    angles, sigmas = (
        tuple(float(from_si(a, "arcsec")) for a in rad) for rad in (lie.angles, np.sqrt(np.diag(lie.covariance)))
    )
    origin = gyroscopes.provenance.with_options(
        frame="accelerometers", inter_triad_arcsec=angles, inter_triad_sigma_arcsec=sigmas
    )
    return replace(
        gyroscopes, effects=with_values((), order, referred(x)), parameters=tuple(order),
        covariance=J @ covariance @ J.T, unobservable=(), provenance=origin,
    )  # fmt: skip
