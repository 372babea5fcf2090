r"""Errors of the reference: the covariance that accelerometers add to gyroscopes calibrated against their gravity.

Turns start and end where the calibrated accelerometers say down is. An error of theirs, with covariance :math:`P_a`,
stands in every turn alike, so that no scatter of turns shows it; it moves the estimate x by

.. math:: \delta x = A \, \delta a, \qquad A = -(J^T J)^{-1} J^T \frac{\partial r}{\partial a},
          \qquad P_x = P_{scatter} + A P_a A^T ,

with J the derivative of the misfit r of gravity after the turns (implicit function theorem at the minimum).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gimbalcal.calibration import Calibration
from gimbalcal.effects import with_values
from gimbalcal.estimate.gyroscopes.turn_fit import TurnFit, derivative_of_turns
from gimbalcal.estimate.gyroscopes.turns import Turns, turned
from gimbalcal.number import Array
from gimbalcal.recording import Recording, dwell_means
from gimbalcal.recording.record import FORCE

STEP = 0.1  # of a sigma, over which the derivative is taken: corrections are very nearly linear


def with_reference_error(fit: TurnFit, turns: Turns, recording: Recording, accelerometers: Calibration) -> TurnFit:
    """The fit with the covariance that the accelerometers' is part of; covariances are SI."""
    if not accelerometers.parameters or not len(fit.x):
        return fit
    effects = with_values(fit.effects, fit.parameters, fit.x)
    start, end = turned(turns, effects), _moved(recording, accelerometers)  # (m, 3, 3), (p, k, 3)
    r = end[:, turns.ends] - np.einsum("mij,pmj->pmi", start, end[:, turns.ends - 1])
    J = derivative_of_turns(turns, fit)
    size = np.sqrt((J**2).sum(0))
    A = -np.linalg.lstsq(J / size, r.reshape(len(r), -1).T, rcond=None)[0] / size[:, None]
    return replace(fit, covariance=fit.covariance + A @ accelerometers.covariance @ A.T)


def _moved(recording: Recording, accelerometers: Calibration) -> Array:
    """Return the derivative (p, k, 3) of the direction of the force at each rest by the accelerometers' parameters."""
    rests, sigma = dwell_means(recording), accelerometers.sigmas
    x = accelerometers.values

    def down(values: Array) -> Array:
        made = replace(accelerometers, effects=with_values(accelerometers.effects, accelerometers.parameters, values))
        f = made.apply(rests).triad(FORCE)
        return np.asarray(f / np.linalg.norm(f, axis=1, keepdims=True))

    out = np.zeros((len(x), len(rests.time), 3))
    for i, s in enumerate(sigma):
        if s > 0:
            h = STEP * s * (np.arange(len(x)) == i)
            out[i] = (down(x + h) - down(x - h)) / (2 * STEP * s)
    return out
