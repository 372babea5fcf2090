"""Probability of a sum of squares by chance."""

from __future__ import annotations

from math import erfc, inf, lgamma

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
    if noise_dof == inf and dof == int(dof):
        return float(chi_square_tail(chi2, int(dof)))
    from scipy.special import chdtrc, fdtrc

    return float(chdtrc(dof, chi2) if noise_dof == inf else fdtrc(dof, noise_dof, chi2 / dof))


def chi_square_tail(chi2: Array | float, dof: int) -> Array:
    r"""Return the probability (...) that chi^2 of `dof` degrees of freedom is this (...) at least; 1 if there are none.

    .. math:: Q = e^{-x} \sum_j \frac{x^j}{\Gamma(j + 1)}, \qquad x = \chi^2 / 2

    over j = 0, 1, ... below dof / 2; if dof is odd, over 1/2, 3/2, ..., and erfc(sqrt x) in addition. SciPy has it for
    any number: to import that takes a tenth of a short command.

    Source: Abramowitz and Stegun (1964), Eqs. 26.4.4 and 26.4.5.
    """
    x = np.minimum(np.asarray(chi2, dtype=float) / 2, 1e300)
    j = np.arange(dof % 2 / 2, dof / 2)
    log_terms = np.multiply.outer(np.log(np.maximum(x, 1e-300)), j) - [lgamma(i + 1) for i in j.tolist()]
    total = np.exp(log_terms - x[..., None]).sum(axis=-1)
    if dof % 2:
        total = total + np.vectorize(erfc, otypes=[float])(np.sqrt(x))
    return np.asarray(np.minimum(total, 1.0)) if dof > 0 else np.ones(x.shape)


def is_explained_by_chance(chi2: float, dof: float) -> bool:
    """Return whether chance alone may leave a chi^2 as large as this."""
    return probability(chi2, dof) >= SIGNIFICANCE
