r"""Error of the observable constants by the curvature of the model, where other combinations are poorly known.

A pass is linear. The true values of unobservable combinations (states that the turns do not show, a heading) are off by
some delta, within their sigma, and the observable ones are then off by half the second derivative. A pass about such
another reference comes back to the estimate up to that error,

.. math:: e(\delta) = \hat\theta(\theta + \delta) - \hat\theta(\theta)
          \approx \tfrac{1}{2} \, \nabla^2 \hat\theta \, [\delta, \delta], \qquad
          P \to P + \overline{e e^T}, \qquad \delta \sim N(0, P) .
"""

from __future__ import annotations

import numpy as np

from gimbalcal.effects import with_values
from gimbalcal.estimate.systematic.error_model import STATE_SCALE, invert_readings, rotated
from gimbalcal.estimate.systematic.filter_pass import (
    VELOCITY_STATES,
    data_information,
    filter_and_smooth,
    inverse_factor,
    smoother_inputs,
)
from gimbalcal.estimate.systematic.iterate import SystematicFit
from gimbalcal.inference import adjoint
from gimbalcal.inference.information import MIN_SIGNAL_TO_NOISE
from gimbalcal.inference.square_root_filter import Filtered
from gimbalcal.number import Array

DRAWS = 16  # passes: sizes of e to some 20 %


def linearisation_covariance(m: SystematicFit, covariance: Array) -> Array:
    """Return the covariance (p, p) in SI of the second-order error of the observable combinations.

    covariance (p, p) in SI of all combinations, the unobservable ones with their prior.
    """
    scale, rng, last = np.array([p.sigma for p in m.wanted]), np.random.default_rng(0), m.last
    p = len(scale)
    rows = data_information(m.wanted, last.factor, m.unregularised - m.prior_mean, scale).rows[:, :p]
    _, s, Vt = np.linalg.svd(rows)
    observable = Vt[s >= MIN_SIGNAL_TO_NOISE].T @ Vt[s >= MIN_SIGNAL_TO_NOISE]
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    filtered = smoother_inputs(m.segments, last, m.start, m.excluded)
    e = np.empty((DRAWS, p))
    for k in range(DRAWS):
        w = vectors @ (np.sqrt(np.maximum(values, 0.0)) * rng.standard_normal(p))
        e[k] = observable @ _error_about(m, filtered, w, rng.standard_normal(p + 3)) / scale
    return np.asarray(e.T @ e / DRAWS * np.outer(scale, scale))


def _error_about(m: SystematicFit, filtered: Filtered, w: Array, noise: Array) -> Array:
    """Return the error (p,) [SI] of a pass about constants that are off by w (p,) prior sigmas.

    The attitudes follow the constants; the one at the start has a scatter of its own, from noise (p + 3,).
    """
    last, scale = m.last, np.array([p.sigma for p in m.wanted])
    Phi, Psi = last.model.Phi, last.model.Psi
    states, p = Phi.shape[1], len(w)
    own = last.filtered.factor[states:, states:]
    P, root = own @ own.T, inverse_factor(last.factor)
    to_attitude, draw = P[p:, :p] @ root.T @ root, own @ noise
    start = to_attitude @ (w - draw[:p]) + draw[p:]
    whole = np.asarray(np.linalg.inv(own))  # triangular, of states of order one
    after = np.concatenate([np.zeros(states), -whole.T @ (whole @ np.concatenate([w, start]))])
    C = rotated(m.C, adjoint.smooth(Phi, Psi, VELOCITY_STATES, filtered, after) * STATE_SCALE[:3])
    theta = m.theta + w * scale
    effects = with_values(m.base_effects, m.wanted, theta)
    u = invert_readings(m.segments, effects, m.u)
    other = filter_and_smooth(m.segments, m.wanted, effects, u, C, m.start, m.prior_mean - theta, m.excluded)
    return np.asarray(theta + other.regularised_step - m.theta)
