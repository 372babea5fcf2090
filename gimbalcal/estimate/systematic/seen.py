r"""What a pass saw of the constants, and what it did not see: that stays where it was.

A pass works with a prior so wide that it holds nothing back. Of a combination that the turns do not show it finds noise
over next to nothing, many times what a sensor has; a reference that went there would be beyond where the model is
linear, and what the turns do show would be wrong with it. So the reference goes to the estimate theta* in which such
combinations keep their prior mean, and the attitudes go with it,

.. math:: x_{k|n}(\theta^*) = x_{k|n} + P_{x \theta} P_{\theta\theta}^{-1} (\theta^* - \hat\theta) .
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gimbalcal.effects import Parameter
from gimbalcal.inference.information import Information
from gimbalcal.number import Array

WIDE = 100.0  # times the catalogue's prior: the prior holds nothing back


def informed(wanted: Sequence[Parameter], factor: Array, x: Array, scale: Sequence[float] | Array) -> Information:
    """What the data of a pass that found x (p,) [SI] say; scale (p,): the prior sigmas that the pass worked with.

    factor (p, p), lower triangular: P = S S^T holds the prior of width `WIDE`, so S^-1 has the data's singular values
    s^2 - 1 / WIDE^2.
    """
    _, s, Vt = np.linalg.svd(inverse(factor))
    s = np.sqrt(np.maximum(s**2 - WIDE**-2, 0.0))
    J = s[:, None] * Vt * (np.array([p.sigma for p in wanted]) / scale)
    return Information(tuple(wanted), np.column_stack([J, s * (Vt @ (x / scale))]), len(wanted))


def inverse(factor: Array) -> Array:
    """S^-1 of a lower triangular S (p, p)."""
    from scipy.linalg import solve_triangular

    return np.asarray(solve_triangular(factor, np.eye(len(factor)), lower=True))
