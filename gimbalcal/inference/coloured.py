r"""Least squares under coloured noise: white plus at most one process of one state, on any time grid, in O(n).

.. math:: y = A \beta + s + v, \quad v_k \sim N(0, \sigma^2 / w_k), \quad s_k = \Phi_k s_{k-1} + N(0, Q_k)

with the Phi and Q of a Gauss-Markov process, or of a random walk that was zero one median step before the first row.
The precision :math:`\Lambda` of s is tridiagonal for any spacing of the rows (`noise_processes.chain`), so with
:math:`W = \mathrm{diag}(w) / \sigma^2`

.. math:: V^{-1} = \Lambda (\Lambda + W)^{-1} W, \qquad \log|V| = \log|\Lambda + W| - \log|\Lambda| - \log|W|

cost banded Cholesky factors. The noise maximises the restricted likelihood, in which beta and sigma are profiled:
harmonics and drift that the fit removes do not make the noise appear whiter than it is.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import inf
from typing import NamedTuple

import numpy as np

from gimbalcal.effects.process import GaussMarkov, RandomWalk, WhiteNoise
from gimbalcal.inference.noise_processes import Noise, chain
from gimbalcal.number import Array

MAX_REFINEMENT_GAIN = 6.0  # of the BIC between grid points: 1.6 at most in 40 fits of white rows
MIN_CHI2 = 1e-200  # of rows without noise, so that the logarithm is finite
ONE_PROCESS = ("white", "gauss-markov", "random-walk")
KINDS = {kind: (kind,) for kind in ONE_PROCESS} | {"auto": ONE_PROCESS}  # the kinds that are tried


class ColouredFit(NamedTuple):
    """Generalised least squares for c right-hand sides."""

    beta: Array  # (q, c)
    covariance: Array  # (q, q) of beta
    chi2: Array  # (c,) r^T V^-1 r
    log_determinant: float  # log|V| + log|A^T V^-1 A|


def least_squares(time: Array, A: Array, y: Array, weight: Array, noise: Noise) -> ColouredFit:
    """Fit A (n, q) to y (n, c) in white noise over the root of the weight (n,), and a second process if any.

    Raises numpy.linalg.LinAlgError where A does not determine beta (condition above 1e6 at unit columns: a millionth
    of what the rows say would be left).
    """
    size = np.sqrt((A**2).sum(axis=0))
    A = A / size
    B, log_V = _inverse_noise(time, np.concatenate([A, y], axis=1), weight, noise)
    q = A.shape[1]
    N = A.T @ B[:, :q]
    N = (N + N.T) / 2
    eigenvalues = np.linalg.eigvalsh(N)
    if eigenvalues[0] < 1e-12 * eigenvalues[-1]:
        raise np.linalg.LinAlgError("the columns of the design are not independent")
    covariance = np.linalg.inv(N)
    beta = covariance @ (A.T @ B[:, q:])
    r = y - A @ beta
    chi2 = np.einsum("ij,ij->j", r, B[:, q:] - B[:, :q] @ beta)
    log_N = float(np.log(eigenvalues).sum() + 2 * np.log(size).sum())
    return ColouredFit(beta / size[:, None], covariance / np.outer(size, size), chi2, log_V + log_N)


def _inverse_noise(time: Array, X: Array, weight: Array, noise: Noise) -> tuple[Array, float]:
    """Return V^-1 X (n, c) and log|V|."""
    white, *slow = noise
    weight = weight / white.initial()[0]
    W = weight[:, None]
    log_W = float(np.log(weight).sum())
    if not slow:
        return W * X, -log_W
    from scipy.linalg import cho_solve_banded, cholesky_banded

    (process,) = slow
    s = chain(process, time)
    diagonal, below = s.precision
    band = np.stack([diagonal + weight, np.append(below, 0.0)])
    factor = cholesky_banded(band, lower=True, check_finite=False)
    Y = cho_solve_banded((factor, True), W * X, check_finite=False)
    out = diagonal[:, None] * Y
    out[1:] += below[:, None] * Y[:-1]
    out[:-1] += below[:, None] * Y[1:]
    return out, float(2 * np.log(factor[0]).sum() + s.log_determinant - log_W)


def estimate_noise(time: Array, A: Array, y: Array, weight: Array, kind: str = "auto") -> Noise:
    """Return the noise of y (n,) about A (n, q), by restricted maximum likelihood; "auto": the kind of best BIC."""
    if kind not in KINDS:
        raise ValueError(f"`kind` must be one of {', '.join(KINDS)}, got {kind!r}")
    grids, (first, *others) = _starting_points(time), KINDS[kind]
    best, least = _best_noise(time, A, y, weight, grids[first], inf)
    for k in others:
        candidate, criterion = _best_noise(time, A, y, weight, grids[k], least + MAX_REFINEMENT_GAIN)
        if criterion < least:
            best, least = candidate, criterion
    return best


def _best_noise(time: Array, A: Array, y: Array, weight: Array, grid: Array, bar: float) -> tuple[Noise, float]:
    """Return the best noise of one kind and its BIC, refined from the grid of the kind where that is below the bar."""
    columns, dof = y[:, None], len(y) - A.shape[1]

    def criterion(p: Array) -> float:
        fit = least_squares(time, A, columns, weight, _noise_of_parameters(p))
        return float(dof * np.log(max(fit.chi2[0] / dof, MIN_CHI2)) + fit.log_determinant + len(p) * np.log(dof))

    start = [criterion(g) for g in grid]
    p = grid[int(np.argmin(start))]
    if p.size and min(start) < bar:
        p = _refined_minimum(criterion, p, grid)
    chi2 = least_squares(time, A, columns, weight, _noise_of_parameters(p)).chi2[0]
    return _noise_of_parameters(p, float(np.sqrt(max(chi2 / dof, MIN_CHI2)))), criterion(p)


def _refined_minimum(criterion: Callable[[Array], float], start: Array, grid: Array) -> Array:
    """Return the minimum near a point of the grid."""
    from scipy.optimize import minimize

    result = minimize(
        criterion, start, method="Nelder-Mead", bounds=list(zip(grid.min(axis=0), grid.max(axis=0), strict=True)),
        options={"xatol": 1e-3, "fatol": 1e-4},  # a thousandth of an e-fold of rho or tau moves no sigma
    )  # fmt: skip
    return np.asarray(result.x)


def _noise_of_parameters(p: Array, sigma: float = 1.0) -> Noise:
    """Return white noise for p = (); (log rho,) adds a random walk, (log rho, log tau) a Gauss-Markov process.

    rho is the variance of the process (of a walk: per second) over that of the white noise.
    """
    white = WhiteNoise(sigma)
    if not p.size:
        return (white,)
    size = float(sigma * np.sqrt(np.exp(p[0])))
    return (white, RandomWalk(size) if p.size == 1 else GaussMarkov(size, float(np.exp(p[1]))))


def _starting_points(time: Array) -> Mapping[str, Array]:
    """Return starting points by kind: ratios of process to white variance of 1e-4 to 1e5 per row or run, all tau."""
    step, span = float(np.median(np.diff(time))), float(time[-1] - time[0])
    ratio, tau = np.log(np.geomspace(1e-4, 1e5, 7)), np.log(np.geomspace(step / 2, span, 6))
    return {
        "white": np.zeros((1, 0)),
        "gauss-markov": np.stack(np.meshgrid(ratio, tau), axis=-1).reshape(-1, 2),
        "random-walk": np.log(np.geomspace(1e-4 / span, 1e5 / step, 12))[:, None],
    }
