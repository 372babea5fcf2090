r"""Information of one pass about the constants; combinations that the turns do not observe keep their prior mean.

A pass works with a prior so wide that it has no influence. An unobservable combination then comes out as noise over
next to nothing, many times the size of any sensor error; a reference that went there would leave the range in which the
model is linear, and spoil what is observable too. So the reference goes to the estimate theta* in which such
combinations keep their prior mean, and the attitudes follow,

.. math:: x_{k|n}(\theta^*) = x_{k|n} + P_{x \theta} P_{\theta\theta}^{-1} (\theta^* - \hat\theta) .
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gimbalcal.effects import Parameter
from gimbalcal.inference.information import Information
from gimbalcal.number import Array

WIDE_PRIOR_SIGMAS = 100.0  # times the catalogue's prior, which then has no influence


def data_information(
    wanted: Sequence[Parameter], factor: Array, x: Array, scale: Sequence[float] | Array
) -> Information:
    """Return the information of the data alone, from a pass that estimated x (p,) [SI] with prior sigmas scale (p,).

    factor (p, p), lower triangular: P = S S^T includes the prior of width w = `WIDE_PRIOR_SIGMAS`, so the singular
    values s of S^-1 become sqrt(s^2 - 1 / w^2).
    """
    _, s, Vt = np.linalg.svd(inverse_factor(factor))
    s = np.sqrt(np.maximum(s**2 - WIDE_PRIOR_SIGMAS**-2, 0.0))
    J = s[:, None] * Vt * (np.array([p.sigma for p in wanted]) / scale)
    return Information(tuple(wanted), np.column_stack([J, s * (Vt @ (x / scale))]), len(wanted))


def inverse_factor(factor: Array) -> Array:
    """Return S^-1 of a lower triangular S (p, p)."""
    from scipy.linalg import solve_triangular

    return np.asarray(solve_triangular(factor, np.eye(len(factor)), lower=True))
