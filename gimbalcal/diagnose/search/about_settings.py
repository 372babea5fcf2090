r"""A platform whose angles are set loosely, linearised about the angles that each visit really had.

A setting that is off by :math:`\delta` takes half its square of the force along itself: a degree takes 150 ug, in which
a change of :math:`|f|` hides. But what it turns across the force the accelerometers show. With the calibration
constants x, Z their columns, and H what the angles of each visit do, white rows y give all of them together,

.. math:: \min |y - Z x - H \delta|^2 + |\delta|^2 / \sigma_\theta^2 ,

and the model is taken at the angles :math:`\theta + \delta`, with :math:`H \delta` back in the residuals: there the
first order is noise as before, and of the second what the uncertainty of :math:`\delta` leaves.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gimbalcal.diagnose.evidence.noise import curved
from gimbalcal.effects import Stage, values, with_values
from gimbalcal.number import Array
from gimbalcal.views.core import Fit
from gimbalcal.views.known_attitude import linearised, read_gimbals

ROUNDS = 3  # the last one about angles and constants that are known to a few arcseconds


def about_settings(o: Fit) -> Fit:
    """The rows about the angles of each visit; as they are where a setting is too small to curve anything."""
    if o.view.kind.stabilised or not read_gimbals(o.view) or not curved(o):
        return o
    visit = np.unique(o.view.stimulus.visit, return_inverse=True)[1]
    for _ in range(ROUNDS):
        x, delta, left = _told(o, visit)
        o = _at(o, x, delta[visit], left)
    return o


def _told(o: Fit, visit: Array) -> tuple[Array, Array, float]:
    """Constants (q,) in prior sigmas beside the baseline's, angles (v, k) [rad] beside the readouts of each visit.

    And what is left of the variance that settings make of the rows.
    """
    sigma, k, C, blocks = o.view.noise.setting, read_gimbals(o.view), o.residual.shape[1], len(o.view.noise.starts)
    v = int(visit.max()) + 1
    mine = visit[o.view.noise.starts][:, None] == np.arange(v)
    H = o.reduced(o.rows.sensitivity[Stage.ENCODER][:, :, k] * sigma).reshape(blocks, C, 1, len(k))
    E = (H * mine[:, None, :, None]).reshape(blocks * C, -1)
    A = np.concatenate([o.reduced(o.Z), E], axis=1)
    q = o.Z.shape[-1]
    P = np.linalg.inv(A.T @ A + np.eye(A.shape[1]))
    x = P @ (A.T @ o.reduced(o.residual[:, :, None])[:, 0])
    seen = E.T @ E  # a turn about the force is never told, and does nothing
    return x[:q], x[q:].reshape(v, -1) * sigma, float((P[q:, q:] * seen).sum() / np.trace(seen))


def _at(o: Fit, x: Array, delta: Array, left: float) -> Fit:
    """The rows at constants that x moves, readouts and delta (n, k) [rad], its first order back in what was read."""
    names, scale = o.view.stimulus.axis_names, np.array([p.sigma for p in o.parameters])
    effects = with_values(o.effects, o.parameters, values(o.effects, o.parameters) + x * scale, names)
    shift = np.zeros_like(o.view.stimulus.readout)
    shift[:, read_gimbals(o.view)] = delta
    assert o.view.displaced is not None
    there = replace(o.view.displaced(effects, shift), noise=replace(o.view.noise, setting_left=left))
    return linearised(there, effects, o.parameters)
