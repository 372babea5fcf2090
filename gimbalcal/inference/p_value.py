"""How likely chance alone leaves so much."""

from __future__ import annotations


def probability(chi2: float, dof: float) -> float:
    """Probability that noise alone leaves at least this chi^2; one where no degree of freedom is left.

    >>> round(probability(3.84, 1), 3), probability(10.0, 0)
    (0.05, 1.0)
    """
    from scipy.special import chdtrc

    return float(chdtrc(dof, chi2)) if dof > 0 else 1.0
