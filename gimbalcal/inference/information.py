r"""Information of data about parameters in square-root form, and unobservable directions by name.

Whitened rows ``[J | r]`` of any number of stages are stacked and reduced by QR; nothing is squared, so the condition
number of the problem is not either. Parameters are scaled by their prior sigma. Then the singular values of the
triangle are signal-to-noise ratios: below one, the data have less information about a direction than the prior. Such
directions are unobservable: they are named, held at the prior mean, and given the prior's variance
(convention: the estimate has the smallest prior-scaled norm among all that fit the data equally well).
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from gimbalcal.effects import Parameter
from gimbalcal.entries import Entry
from gimbalcal.errors import InputError
from gimbalcal.number import Array
from gimbalcal.units import from_si

ABSENT_SIGNAL_TO_NOISE = 1e-3  # below, a direction has no signal but rounding of the Jacobian
MIN_SIGNAL_TO_NOISE = 1.0  # singular value of an observable direction
PRIOR_TOLERANCE = 0.01  # of the prior sigma, in value and sigma of an estimate that equals its prior
TIE_TOLERANCE = 1e-6  # relative difference of two values that count as equal: far above rounding


@dataclass(frozen=True)
class Unobservable(Entry):
    """A combination of parameters that the data do not determine: label to weight in printed units, largest 1."""

    direction: dict[str, float]
    why: str

    @classmethod
    def of(cls, wanted: Iterable[Parameter], why: str) -> Unobservable:
        """Return parameters that the data do not determine together."""
        return cls({p.label: 1.0 for p in wanted}, why)


@dataclass(frozen=True)
class Information:
    """Whitened, prior-scaled rows [J | r] (q, p + 1) about `parameters`, reduced to a triangle."""

    parameters: tuple[Parameter, ...]
    rows: Array
    count: int  # scalar observations behind the rows

    def __add__(self, other: Information) -> Information:
        """Return the sum of both, over the union of their parameters."""
        union = tuple(dict.fromkeys(self.parameters + other.parameters))
        rows = np.concatenate([_widen(part, union) for part in (self, other)])
        return Information(union, _triangle(rows), self.count + other.count)

    def at(self, values: Mapping[Parameter, float]) -> Information:
        """Return the information about the other parameters, with these at known values in SI."""
        out = [self.parameters.index(p) for p in values]
        others = [i for i in range(len(self.parameters)) if i not in out]
        mean, scale = prior([self.parameters[i] for i in out])
        known = self.rows[:, out] @ ((np.array(list(values.values())) - mean) / scale)
        rows = np.concatenate([self.rows[:, others], (self.rows[:, -1] - known)[:, None]], axis=1)
        return Information(tuple(self.parameters[i] for i in others), rows, self.count)

    def without(self, nuisance: Sequence[Parameter], flat: bool = False) -> Information:
        """Return the information about the other parameters, with the nuisance parameters eliminated.

        With their columns first, the triangle's rows below theirs do not depend on them. Their prior is added, so that
        no direction among them is free; a `flat` one is as wide as that takes.
        """
        out = [i for i, p in enumerate(self.parameters) if p in nuisance]
        others = [i for i in range(len(self.parameters)) if i not in out]
        prior = np.eye(len(out), self.rows.shape[1]) * (ABSENT_SIGNAL_TO_NOISE if flat else 1.0)
        triangle = np.asarray(np.linalg.qr(np.concatenate([prior, self.rows[:, [*out, *others, -1]]]), mode="r"))
        remaining = tuple(self.parameters[i] for i in others)
        return Information(remaining, triangle[len(out) :, len(out) :], self.count - len(out))

    def about(self, wanted: Container[Parameter]) -> Information:
        """Return the information about these parameters, whatever the others are."""
        return self.without([p for p in self.parameters if p not in wanted], flat=True)


@dataclass(frozen=True)
class Solution:
    """Least-squares estimate from information: x (p,) and covariance (p, p) in SI, what is unobservable, chi^2, dof."""

    parameters: tuple[Parameter, ...]
    x: Array
    covariance: Array
    unobservable: tuple[Unobservable, ...]
    chi2: float
    dof: int

    @property
    def sigma(self) -> Array:
        """One standard deviation (p,) in SI."""
        return np.sqrt(np.diag(self.covariance))


def information(J: Array, r: Array, parameters: Sequence[Parameter]) -> Information:
    """Return the information of a whitened Jacobian J (m, p) per SI unit and residual r (m,) about the parameters.

    r is the observation minus its prediction at zero parameters: linearise elsewhere with r = y - h(x0) + J x0.
    """
    mean, scale = prior(parameters)
    J = np.asarray(J).reshape(-1, len(parameters))
    rows = np.concatenate([J * scale, (np.ravel(r) - J @ mean)[:, None]], axis=1)
    return Information(tuple(parameters), _triangle(rows), len(rows))


def mean_information(each: Sequence[Information], weights: Array) -> Information:
    r"""Return the information whose estimate is the mean of those in several noises of these probabilities (k,).

    .. math:: \hat x = \sum_k p_k x_k, \qquad P = \sum_k p_k \left[ P_k + (x_k - \hat x)(x_k - \hat x)^T \right]

    chi^2 is the mean of theirs at that estimate. Directions of no signal but rounding are left out.
    """
    if len(each) == 1:
        return each[0]
    pooled = np.concatenate([np.sqrt(w) * info.rows[:, :-1] for w, info in zip(weights, each, strict=True)])
    _, S, Vt = np.linalg.svd(pooled, full_matrices=False)
    U = Vt[S > ABSENT_SIGNAL_TO_NOISE].T  # in which the covariances are nearly diagonal
    estimates, covariances = [], []
    for info in each:
        Q, R = np.linalg.qr(info.rows[:, :-1] @ U)
        root = np.linalg.inv(R)
        estimates.append(root @ (Q.T @ info.rows[:, -1]))
        covariances.append(root @ root.T)
    x = weights @ np.array(estimates)
    spread = np.array(estimates) - x
    P = np.einsum("k,kij->ij", weights, np.array(covariances)) + (spread.T * weights) @ spread
    chi2 = sum(
        w * ((info.rows[:, -1] - info.rows[:, :-1] @ (U @ x)) ** 2).sum() for w, info in zip(weights, each, strict=True)
    )
    scale = np.sqrt(np.diag(P))
    root = np.linalg.cholesky(np.linalg.inv(P / np.outer(scale, scale))).T / scale
    rows = np.column_stack([root @ U.T, root @ x])
    rows = np.concatenate([rows, np.append(np.zeros(pooled.shape[1]), np.sqrt(chi2))[None]])
    return Information(each[0].parameters, rows, each[0].count)


def prior(parameters: Sequence[Parameter]) -> tuple[Array, Array]:
    """Return prior mean (p,) and prior sigma (p,) of parameters, in SI."""
    return np.array([p.mean for p in parameters]), np.array([p.sigma for p in parameters])


def solve(info: Information, min_signal: float = MIN_SIGNAL_TO_NOISE) -> Solution:
    """Return estimate, covariance and unobservable directions: those below `min_signal` keep their prior."""
    p = len(info.parameters)
    mean, scale = prior(info.parameters)
    R, z = info.rows[:, :p], info.rows[:, p]
    if not np.isfinite(info.rows).all():
        raise InputError(
            "no constants of this model fit these readings, the fit runs off: check signs, axes and units in "
            "[columns], and the site"
        )
    U, S, Vt = np.linalg.svd(R, full_matrices=True)
    S = np.concatenate([S, np.zeros(p - S.size)])
    keep = min_signal <= S
    inverse = np.where(keep, 1 / np.where(keep, S, 1), 0.0)
    coefficients = (U.T @ z)[:p] if U.shape[0] >= p else np.concatenate([U.T @ z, np.zeros(p - U.shape[0])])
    x = Vt.T @ (inverse * coefficients)
    covariance = (Vt.T * np.where(keep, inverse**2, 1.0)) @ Vt
    residual = float(np.sum((z - R @ x) ** 2))
    unobservable = name_directions(Vt[~keep].T, info.parameters, R)
    P, dof = covariance * np.outer(scale, scale), info.count - int(keep.sum())
    return Solution(info.parameters, mean + x * scale, P, unobservable, residual, dof)


def chi2_about_mean(x: Array, covariance: Array) -> float:
    """Return the sum of squares of k estimates x (k, p), of covariance (k, p, p), about their weighted mean.

    Of independent estimates of the same p values it is a chi^2 of (k - 1) p degrees of freedom.
    """
    scale = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2).mean(axis=0))
    y, W = x / scale, np.linalg.inv(covariance / np.outer(scale, scale))
    off = y - np.linalg.solve(W.sum(axis=0), np.einsum("kij,kj->i", W, y))
    return float(np.einsum("ki,kij,kj->", off, W, off))


def keeps_prior(parameters: Sequence[Parameter], x: Array, sigma: Array) -> Array:
    """Return for each parameter whether its estimate (p,) and sigma (p,) in SI are those of its prior."""
    mean, scale = prior(parameters)
    return np.asarray((np.abs(sigma / scale - 1) < PRIOR_TOLERANCE) & (np.abs(x - mean) < PRIOR_TOLERANCE * scale))


def name_directions(null: Array, parameters: Sequence[Parameter], R: Array) -> tuple[Unobservable, ...]:
    """Return a sparse, readable basis of an unobservable space (p, k), with how little whitened rows R (q, p) see it.

    Both are given in prior-scaled coordinates. Gauss-Jordan elimination makes each direction contain as few parameters
    as it can. Its pivots come from the projector on the space, and ties go to the first parameter: the basis, its order
    and its signs depend neither on the vectors that span the space nor on rounding.
    """
    if not null.size:
        return ()
    scale = np.array([from_si(p.sigma, p.unit) for p in parameters], dtype=float)
    projector = null @ null.T
    pivots: list[int] = []
    for _ in range(null.shape[1]):
        j = _first_largest(np.diag(projector))
        projector = projector - np.outer(projector[:, j], projector[j]) / projector[j, j]
        pivots.append(j)
    rows = np.linalg.solve(null[pivots].T, null.T)
    # below 1 % of the largest, in prior sigmas, a parameter takes no visible part in the combination
    rows[np.abs(rows) < 0.01 * np.abs(rows).max(axis=1, keepdims=True)] = 0.0
    signals = np.linalg.norm(rows @ R.T, axis=1) / np.linalg.norm(rows, axis=1)
    return tuple(_unobservable(row * scale, signal, parameters) for row, signal in zip(rows, signals, strict=True))


def _first_largest(values: Array) -> int:
    """Return the index of the largest value, of several that differ by rounding only the first."""
    return int(np.flatnonzero(values >= (1 - TIE_TOLERANCE) * values.max())[0])


def _unobservable(row: Array, signal: float, parameters: Sequence[Parameter]) -> Unobservable:
    row = row / row[_first_largest(np.abs(row))]
    direction = {p.label: float(f"{w:.6g}") for p, w in zip(parameters, row, strict=True) if w}
    terms = " ".join(f"{w:+.3g} {label}" for label, w in direction.items())
    alone = len(direction) == 1
    if signal > ABSENT_SIGNAL_TO_NOISE:
        what = f"{next(iter(direction))} at its prior size" if alone else f"{terms} together, at their prior size,"
        why = f"{what} moves these data by {signal:.2g} of their noise: less than the prior knows"
        return Unobservable(direction, why)
    if alone:
        return Unobservable(direction, f"{next(iter(direction))} does not change any reading of these data")
    return Unobservable(direction, f"changing {terms} together leaves every reading of these data as it is")


def _triangle(rows: Array) -> Array:
    """Return R of a QR, in blocks that fit the cache: LAPACK takes fifty times as long for a tall matrix at once."""
    p = rows.shape[1]
    block = max(256, 4 * p)
    while len(rows) >= 2 * block:
        whole = len(rows) // block * block
        parts = np.asarray(np.linalg.qr(rows[:whole].reshape(-1, block, p), mode="r")).reshape(-1, p)
        rows = np.concatenate([parts, rows[whole:]])
    return np.asarray(np.linalg.qr(rows, mode="r")) if len(rows) > p else rows


def _widen(info: Information, union: tuple[Parameter, ...]) -> Array:
    out = np.zeros((len(info.rows), len(union) + 1))
    out[:, [union.index(p) for p in info.parameters]] = info.rows[:, :-1]
    out[:, -1] = info.rows[:, -1]
    return out
