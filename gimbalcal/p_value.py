"""Probability of a sum of squares by chance."""

from __future__ import annotations

from math import inf

import numpy as np

from gimbalcal.number import Array

SIGNIFICANCE = 1e-3  # probability, number of trials paid, below which chance is not believed


def probability(chi2: float, dof: float, noise_dof: float = inf) -> float:
    """Return the probability that noise alone leaves at least this chi^2; one where no degree of freedom is left.

    noise_dof: degrees of freedom of the scatter that the sigmas are scaled to; chi^2 / dof is then an F variate.

    >>> round(probability(3.84, 1), 3), probability(10.0, 0)
    (0.05, 1.0)
    """
    if dof <= 0 or noise_dof <= 0:
        return 1.0
    if noise_dof == inf:
        return float(chi_square_tail(chi2, dof))
    from scipy.special import fdtrc

    return float(fdtrc(dof, noise_dof, chi2 / dof))


def chi_square_tail(chi2: Array | float, dof: Array | float) -> Array:
    """Return the probability (...) that noise leaves at least chi2 (...); one where dof (...) is zero."""
    from scipy.special import chdtrc

    some = np.greater(dof, 0)
    return np.asarray(np.where(some, chdtrc(np.where(some, dof, 1.0), chi2), 1.0))


def is_explained_by_chance(chi2: float, dof: float) -> bool:
    """Return whether chance alone may leave a chi^2 as large as this."""
    return probability(chi2, dof) >= SIGNIFICANCE
