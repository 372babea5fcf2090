r"""Least squares under coloured noise: white plus a first-order process, on any time grid, in O(n).

.. math:: y = A \beta + s + v, \quad v_k \sim N(0, \sigma^2 / w_k), \quad
          s_k = \varphi_k s_{k-1} + N(0, \rho \sigma^2 q_k)

with a Gauss-Markov process of correlation time tau (:math:`\varphi = e^{-\Delta t/\tau}, q = 1 - \varphi^2`, stationary
variance :math:`\rho \sigma^2`) or, at infinite tau, a random walk (:math:`\varphi = 1, q = \Delta t`, rate in variance
per second, pinned to zero one median step before the first row). The precision :math:`\Lambda` of s is tridiagonal for
any spacing of the rows, so

.. math:: V^{-1} = \tfrac{\Lambda}{\rho} \left(\tfrac{\Lambda}{\rho} + W\right)^{-1} W, \qquad
          \log|V| = \log|\tfrac{\Lambda}{\rho} + W| - \log|\tfrac{\Lambda}{\rho}| - \log|W|

cost banded Cholesky factors. The colour (rho, tau) maximises the restricted likelihood, in which beta and sigma are
profiled: harmonics and drift that the fit takes out of the noise do not make it look whiter than it is.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import inf, isinf
from typing import Literal, NamedTuple, get_args

import numpy as np

from gimbalcal.number import Array

Kind = Literal["white", "gauss-markov", "random-walk", "auto"]
HOPELESS = 6.0  # what a refinement between grid points can gain: 1.6 at most in 40 fits of white rows
NO_NOISE = 1e-300  # a misfit of rows without any noise, whose logarithm is still a number
KINDS: tuple[str, ...] = get_args(Kind)


@dataclass(frozen=True)
class Colour:
    """Noise in the unit of y: sigma of a row of unit weight, variance ratio rho of the process, tau [s]."""

    sigma: float = 1.0
    ratio: float = 0.0
    time_constant: float = inf

    @property
    def kind(self) -> str:
        """White, Gauss-Markov or random walk."""
        if self.ratio == 0:
            return "white"
        return "random-walk" if isinf(self.time_constant) else "gauss-markov"

    @property
    def process(self) -> float:
        """Stationary sigma of the Gauss-Markov process, or growth of the walk per square root of a second."""
        return float(self.sigma * np.sqrt(self.ratio))


class Fit(NamedTuple):
    """Generalised least squares for c right-hand sides."""

    beta: Array  # (q, c)
    cofactor: Array  # (q, q): covariance = sigma^2 cofactor
    misfit: Array  # (c,) r^T V^-1 r / sigma^2-scale: divide by sigma^2 for chi^2
    log_determinant: float  # log|V| + log|A^T V^-1 A| at sigma = 1


def least_squares(time: Array, A: Array, y: Array, weight: Array, colour: Colour) -> Fit:
    """Fit of A (n, q) to y (n, c) with the *shape* of the noise; its sigma scales nothing here.

    Raises numpy.linalg.LinAlgError where A does not determine beta (condition above 1e6 at unit columns: a millionth
    of what the rows say would be left).
    """
    size = np.sqrt((A**2).sum(axis=0))
    A = A / size
    B, log_V = _inverse_noise(time, np.concatenate([A, y], axis=1), weight, colour)
    q = A.shape[1]
    N = A.T @ B[:, :q]
    N = (N + N.T) / 2
    eigenvalues = np.linalg.eigvalsh(N)
    if eigenvalues[0] < 1e-12 * eigenvalues[-1]:
        raise np.linalg.LinAlgError("the columns of the design are not independent")
    cofactor = np.linalg.inv(N)
    beta = cofactor @ (A.T @ B[:, q:])
    r = y - A @ beta
    misfit = np.einsum("ij,ij->j", r, B[:, q:] - B[:, :q] @ beta)
    log_N = float(np.log(eigenvalues).sum() + 2 * np.log(size).sum())
    return Fit(beta / size[:, None], cofactor / np.outer(size, size), misfit, log_V + log_N)


def _inverse_noise(time: Array, X: Array, weight: Array, colour: Colour) -> tuple[Array, float]:
    """V^-1 X (n, c) and log|V| at sigma = 1."""
    W = weight[:, None]
    log_W = float(np.log(weight).sum())
    if colour.ratio == 0:
        return W * X, -log_W
    from scipy.linalg import cho_solve_banded, cholesky_banded

    diagonal, below, log_precision = _precision(time, colour)
    band = np.stack([diagonal + weight, np.append(below, 0.0)])
    factor = cholesky_banded(band, lower=True, check_finite=False)
    Y = cho_solve_banded((factor, True), W * X, check_finite=False)
    out = diagonal[:, None] * Y
    out[1:] += below[:, None] * Y[:-1]
    out[:-1] += below[:, None] * Y[1:]
    return out, float(2 * np.log(factor[0]).sum() - log_precision - log_W)


def _precision(time: Array, colour: Colour) -> tuple[Array, Array, float]:
    """Lambda / rho: diagonal (n,), first off-diagonal (n - 1,), log determinant."""
    step = np.diff(time)
    if isinf(colour.time_constant):
        phi, q = np.ones_like(step), step
        first = float(np.median(step))
    else:
        phi, q = np.exp(-step / colour.time_constant), -np.expm1(-2 * step / colour.time_constant)
        first = 1.0
    q, first = q * colour.ratio, first * colour.ratio
    diagonal = np.append(first, q) ** -1.0
    diagonal[:-1] += phi**2 / q
    return diagonal, -phi / q, float(-np.log(q).sum() - np.log(first))


def estimate_colour(time: Array, A: Array, y: Array, weight: Array, kind: str = "auto") -> Colour:
    """Colour of what A (n, q) leaves in y (n,), by restricted maximum likelihood; "auto" takes the kind of best BIC."""
    if kind not in KINDS:
        raise ValueError(f"`kind` must be one of {', '.join(KINDS)}, got {kind!r}")
    if kind != "auto":
        return _best(time, A, y, weight, kind)[0]
    best, least = _best(time, A, y, weight, "white")
    for k in ("gauss-markov", "random-walk"):
        found, criterion = _best(time, A, y, weight, k, least + HOPELESS)
        if criterion < least:
            best, least = found, criterion
    return best


def _best(time: Array, A: Array, y: Array, weight: Array, kind: str, bar: float = inf) -> tuple[Colour, float]:
    """Best colour of one kind and its BIC; from a grid alone where that is not below the bar."""
    columns, dof = y[:, None], len(y) - A.shape[1]

    def criterion(p: Array) -> float:
        fit = least_squares(time, A, columns, weight, _colour(p))
        return float(dof * np.log(max(fit.misfit[0] / dof, NO_NOISE)) + fit.log_determinant + len(p) * np.log(dof))

    p = np.zeros(0)
    if kind != "white":
        grid = _grid(time, kind)
        start = [criterion(g) for g in grid]
        p = grid[int(np.argmin(start))]
        if min(start) < bar:
            p = _refined(criterion, p, grid)
    colour = _colour(p)
    misfit = least_squares(time, A, columns, weight, colour).misfit[0]
    sigma = float(np.sqrt(max(misfit / dof, NO_NOISE)))
    return Colour(sigma, colour.ratio, colour.time_constant), criterion(p)


def _refined(criterion: Callable[[Array], float], start: Array, grid: Array) -> Array:
    """Minimum near a point of the grid."""
    from scipy.optimize import minimize

    result = minimize(
        criterion, start, method="Nelder-Mead", bounds=list(zip(grid.min(axis=0), grid.max(axis=0), strict=True)),
        options={"xatol": 1e-3, "fatol": 1e-4},  # a thousandth of an e-fold of rho or tau moves no sigma
    )  # fmt: skip
    return np.asarray(result.x)


def _colour(p: Array) -> Colour:
    """From logarithms: () white, (log rho) a walk, (log rho, log tau) Gauss-Markov."""
    return Colour(1.0, float(np.exp(p[0])) if p.size else 0.0, float(np.exp(p[1])) if p.size > 1 else inf)


def _grid(time: Array, kind: str) -> Array:
    """Starting points: process variance 1e-4 to 1e5 of the white one per row (or per run, for a walk), tau over all."""
    step, span = float(np.median(np.diff(time))), float(time[-1] - time[0])
    if kind == "random-walk":
        return np.log(np.geomspace(1e-4 / span, 1e5 / step, 12))[:, None]
    ratio, tau = np.log(np.geomspace(1e-4, 1e5, 7)), np.log(np.geomspace(step / 2, span, 6))
    return np.stack(np.meshgrid(ratio, tau), axis=-1).reshape(-1, 2)
