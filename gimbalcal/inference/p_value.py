"""Probability of a sum of squares by chance."""

from __future__ import annotations

from math import inf

SIGNIFICANCE = 1e-3  # probability, number of trials paid, below which chance is not believed


def probability(chi2: float, dof: float, noise_dof: float = inf) -> float:
    """Return the probability that noise alone leaves at least this chi^2; one where no degree of freedom is left.

    noise_dof: degrees of freedom of the scatter that the sigmas are scaled to; chi^2 / dof is then an F variate.

    >>> round(probability(3.84, 1), 3), probability(10.0, 0)
    (0.05, 1.0)
    """
    from scipy.special import chdtrc, fdtrc

    if dof <= 0 or noise_dof <= 0:
        return 1.0
    return float(chdtrc(dof, chi2) if noise_dof == inf else fdtrc(dof, noise_dof, chi2 / dof))


def is_explained_by_chance(chi2: float, dof: float) -> bool:
    """Return whether chance alone may leave a chi^2 as large as this."""
    return probability(chi2, dof) >= SIGNIFICANCE
