r"""What the bend of the model does to constants that the turns show, where other things are hardly known.

A pass is linear. Of what it does not see (states that the turns do not show, a heading) the truth may be anywhere
within its sigma, delta, and what is seen is then off by half the second derivative. Another reference tells its size: a
pass from there comes back to the estimate, up to that,

.. math:: e(\delta) = \hat\theta(\theta + \delta) - \hat\theta(\theta)
          \approx \tfrac{1}{2} \, \nabla^2 \hat\theta \, [\delta, \delta], \qquad
          P \to P + \overline{e e^T}, \qquad \delta \sim N(0, P) .
"""

from __future__ import annotations

import numpy as np

from gimbalcal.effects import with_values
from gimbalcal.estimate.systematic.error_model import STATE, turned
from gimbalcal.estimate.systematic.seen import informed, inverse
from gimbalcal.estimate.systematic.sensors import truth
from gimbalcal.estimate.systematic.settle import Settled
from gimbalcal.estimate.systematic.smoothing import VELOCITY, for_smoother, one_pass
from gimbalcal.inference import adjoint
from gimbalcal.inference.beside_constants import Filtered
from gimbalcal.inference.information import SEEN
from gimbalcal.number import Array

DRAWS = 16  # passes: sizes of e to some 20 %


def bent(m: Settled, covariance: Array) -> Array:
    """Covariance (p, p) in SI of what second order does to the seen combinations, about where the passes settled.

    covariance (p, p) in SI of all combinations, those that are not seen with their prior.
    """
    scale, rng, last = np.array([p.sigma for p in m.wanted]), np.random.default_rng(0), m.last
    p = len(scale)
    rows = informed(m.wanted, last.factor, m.said - m.before, scale).rows[:, :p]
    _, s, Vt = np.linalg.svd(rows)
    seen = Vt[s >= SEEN].T @ Vt[s >= SEEN]
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    filtered = for_smoother(m.course, last, m.start, m.left_out)
    e = np.empty((DRAWS, p))
    for k in range(DRAWS):
        w = vectors @ (np.sqrt(np.maximum(values, 0.0)) * rng.standard_normal(p))
        other = _about(m, filtered, w, rng.standard_normal(p + 3))
        e[k] = seen @ other / scale
    return np.asarray(e.T @ e / DRAWS * np.outer(scale, scale))


def _about(m: Settled, filtered: Filtered, w: Array, noise: Array) -> Array:
    """How far (p,) [SI] a pass ends whose reference has constants that are off by w (p,) prior sigmas.

    The attitudes go with them, that at the start with a scatter of its own, from noise (p + 3,).
    """
    last, scale = m.last, np.array([p.sigma for p in m.wanted])
    Phi, Psi = last.about.Phi, last.about.Psi
    states, p = Phi.shape[1], len(w)
    own = last.filtered.factor[states:, states:]
    P, root = own @ own.T, inverse(last.factor)
    to_attitude, any_ = P[p:, :p] @ root.T @ root, own @ noise
    start = to_attitude @ (w - any_[:p]) + any_[p:]
    whole = np.asarray(np.linalg.inv(own))  # triangular, of states of order one
    after = np.concatenate([np.zeros(states), -whole.T @ (whole @ np.concatenate([w, start]))])
    C = turned(m.C, adjoint.smooth(Phi, Psi, VELOCITY, filtered, after) * STATE[:3])
    theta = m.theta + w * scale
    effects = with_values(m.base, m.wanted, theta)
    u = truth(m.course, effects, m.u)
    other = one_pass(m.course, m.wanted, effects, u, C, m.start, m.before - theta, m.left_out)
    return np.asarray(theta + other.held - m.theta)
