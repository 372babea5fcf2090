r"""Consider covariance: what terms that a fit to the norm of gravity omits may have done to its estimates.

A term is declined where its coefficients do not stand clear of chance; that is no proof that they are zero. With J and
C the whitened rows of what is estimated and of what is not, r the misfit, and c normal with the usual size of such a
unit, what is known of c after the fit is

.. math:: \Lambda = C^T M C + D^{-2}, \quad M = 1 - J J^+, \qquad
          \langle c c^T \rangle = \Lambda^{-1} + \bar c \bar c^T, \quad \bar c = \Lambda^{-1} C^T M r

and the estimates, whose covariance is P, err by S c with S = P J^T C besides: their covariance grows by
S <c c^T> S^T. Source: Bierman, *Factorization Methods for Discrete Sequential Estimation* (1977), chapter 8 (consider
parameters).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gimbalcal.effects import CATALOGUE, parameters, values
from gimbalcal.estimate.fit import ViewsFit, whitened
from gimbalcal.number import Array

NOTABLE_SIGMAS = 1.0  # sigmas by which it must move an estimate to be worth a word


def covariance_of_omitted_terms(made: ViewsFit, terms: Sequence[str]) -> Array:
    """Return the increase of the covariance (p, p) of a fit by terms that are omitted from it; zero for none."""
    view, solution, n = made.views[0], made.solution, len(made.solution.parameters)
    omitted = tuple(view.grade.usual(q) for t in terms for q in parameters(CATALOGUE[t]))
    if not omitted:
        return np.zeros((n, n))
    every = (*solution.parameters, *omitted)
    both, r = whitened([view], made.effects, every, made.excesses, values(made.effects, every))
    J, C = both[:, :n], both[:, n:]
    Q = np.linalg.qr(J)[0]
    C_left, r_left = C - Q @ (Q.T @ C), r - Q @ (Q.T @ r)
    known = np.linalg.inv(C_left.T @ C_left + np.diag([1 / q.sigma**2 for q in omitted]))
    mean = known @ C_left.T @ r_left
    S = solution.covariance @ J.T @ C
    return np.asarray(S @ (known + np.outer(mean, mean)) @ S.T)


def in_words(added: Array, covariance: Array) -> str:
    """Describe the largest increase of a sigma as the end of a sentence; empty where it is small."""
    own, more = np.diag(covariance), np.diag(added)
    times = float(np.sqrt(np.max(more / own))) if len(own) else 0.0
    return (
        ""
        if times < NOTABLE_SIGMAS
        else f"; of usual size it moves an estimate by {times:.2g} of its sigma, which is wider for it"
    )
