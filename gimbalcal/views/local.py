r"""Parameters of groups of rows, each group with its own, eliminated: the setting errors of the gimbals at a visit.

.. math:: y_d = h(x, e_d) + n_d, \qquad e_d \sim N(0, \sigma_e^2 I), \qquad n_d \sim N(0, \sigma^2 / w_d \, I)

With G_d = dh/de_d = U diag(s) V^T the rows U^T / sqrt(sigma^2 / w_d + sigma_e^2 s^2) have unit noise, which is the
Schur complement of e_d without squaring anything. sigma_e = 0 holds them at zero; sigma_e = infinity drops the
directions that they reach.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from gimbalcal.effects import Effect
from gimbalcal.forward import Rows
from gimbalcal.number import Array, apply_matrix

if TYPE_CHECKING:
    from gimbalcal.views.core import View

MIN_SINGULAR_RATIO = 1e-9  # of dh/de, below which e does not reach a direction; rounding leaves 1e-16
START_ITERATIONS = 2  # the second leaves 10 arcsec of 6 degrees
SMALL_SETTING_RAD = 1e-3  # rad; below, the square of a setting error is less than 1 ug


@dataclass(frozen=True, eq=False)
class Local:
    """k parameters of each of m groups of rows, with one prior sigma, which may be zero or infinite.

    group (n,): ordinal of the group of each row, 0 ... m - 1; columns: rows to the derivative (n, C, k) by those of the
    row's own group; evaluate: effects and values (m, k) to the rows about both, as the rows are not linear in them;
    remaining: share of their variance that is left in rows about recovered values.
    """

    group: NDArray[np.int64]
    size: int
    sigma: float
    columns: Callable[[Rows], Array]
    evaluate: Callable[[Sequence[Effect], Array], Rows]
    remaining: float = 1.0

    @property
    def first(self) -> NDArray[np.int64]:
        """Return the first row (m,) of each group."""
        return np.flatnonzero(np.diff(self.group, prepend=-1))

    @property
    def zero_values(self) -> Array:
        """Return values (m, k) of zero."""
        return np.zeros((int(self.group[-1]) + 1, self.size))

    def by_group(self, view: View, rows: Rows, J: Array, e: Array) -> VisitRows:
        """Return rows about values e (m, k) with their derivatives J (n, C, p), by group, all channels of one sigma."""
        G, sigma = self.columns(rows), np.broadcast_to(np.asarray(view.noise.sigma), rows.residual.shape)
        return visit_rows(J, rows.residual + apply_matrix(G, e[self.group]), G, self.group, sigma[:, 0] ** -2)

    def start(self, view: View, effects: Sequence[Effect]) -> Array:
        """Return values (m, k) that effects call for, so that large ones do not throw the first step off."""
        e = self.zero_values
        for _ in range(START_ITERATIONS if self.sigma > SMALL_SETTING_RAD else 0):
            rows = self.evaluate(effects, e)
            linear = self.by_group(view, rows, np.zeros((*rows.residual.shape, 0)), e)
            e = apply_matrix(eliminate(linear, 1.0, self.sigma**2).gain, linear.r)
        return e


@dataclass(frozen=True, eq=False)
class VisitRows:
    """Rows linearised at (x, e), by visit: y - h + G e + J x = r; inside each visit the deviations from it."""

    J: Array  # (m, 3, p)
    r: Array  # (m, 3)
    G: Array  # (m, 3, k)
    weight: Array  # (m,)
    J_inside: Array  # (n, 3, p) times sqrt(weight), empty for means
    r_inside: Array  # (n, 3)


def visit_rows(J: Array, r: Array, G: Array, group: NDArray[np.int64], weight: Array) -> VisitRows:
    """Rows (n, 3) with their derivatives as weighted means of each visit, and what is left inside it."""
    if len(r) == group[-1] + 1:
        return VisitRows(J, r, G, weight, J[:0], r[:0])
    J_mean, r_mean, G_mean = (group_means(a, group, weight) for a in (J, r, G))
    root = np.sqrt(weight)
    inside = (root[:, None, None] * (J - J_mean[group]), root[:, None] * (r - r_mean[group]))
    return VisitRows(J_mean, r_mean, G_mean, np.bincount(group, weight), *inside)


def group_means(a: Array, group: NDArray[np.int64], weight: Array) -> Array:
    """Weighted means over the rows of each group: (n, ...) to (m, ...)."""
    total = np.zeros((group[-1] + 1, *a.shape[1:]))
    np.add.at(total, group, a * weight.reshape(-1, *[1] * (a.ndim - 1)))
    return np.asarray(total / np.bincount(group, weight).reshape(-1, *[1] * (a.ndim - 1)))


@dataclass(frozen=True, eq=False)
class Whitened:
    """Rows of unit noise by visit, and what turns a misfit into local parameters."""

    W: Array  # (m, 3, 3)
    J: Array  # (m, 3, p) = W J
    r: Array  # (m, 3) = W r
    reached: Array  # (m, 3) whether the local parameters reach the direction of the row
    gain: Array  # (m, k, 3): e = gain (r - J x) of the linear problem
    sigma: Array  # (m, 3) of the rows before whitening; inf where free parameters take them away
    J_inside: Array  # (n, 3, p)
    r_inside: Array  # (n, 3)

    @property
    def rows(self) -> tuple[Array, Array]:
        """Return all rows, J (q, p) and r (q,)."""
        P = self.J.shape[-1]
        return (
            np.concatenate([self.J.reshape(-1, P), self.J_inside.reshape(-1, P)]),
            np.concatenate([self.r.ravel(), self.r_inside.ravel()]),
        )

    @property
    def dependent(self) -> int:
        """Return how many rows hold nothing: dropped directions, and one deviation of each visit from its mean."""
        return int(np.isinf(self.sigma).sum()) + (self.r.size if self.r_inside.size else 0)


def eliminate(linear: VisitRows, variance: float, spread: float) -> Whitened:
    """Scale rows to unit noise with the local parameters eliminated (module docstring).

    variance: of a row of weight one; spread: of a local parameter.
    """
    U, s, Vt = np.linalg.svd(linear.G, full_matrices=True)
    k = s.shape[-1]
    s = np.where(s > MIN_SINGULAR_RATIO * max(s.max(initial=0.0), 1e-300), s, 0.0)
    white = (variance / linear.weight)[:, None]
    # 0 * inf: a direction that is not reached keeps the white noise alone
    reached_variance = np.where(s > 0, spread * np.where(s > 0, s, 1.0) ** 2, 0.0)
    total = np.concatenate([white + reached_variance, np.broadcast_to(white, (len(s), 3 - k))], axis=1)
    W = np.swapaxes(U, -1, -2) / np.sqrt(total)[..., None]
    divisor = np.where(s > 0, s, 1.0)
    share = np.where(s > 0, 1 / (divisor + white / (spread or 1e-300) / divisor), 0.0)
    reached = np.concatenate([s > 0, np.zeros((len(s), 3 - k), dtype=bool)], axis=1)
    gain = np.swapaxes(Vt[:, :k], -1, -2) @ (share[..., None] * np.swapaxes(U, -1, -2)[:, :k])
    inside = linear.J_inside / np.sqrt(variance), linear.r_inside / np.sqrt(variance)
    return Whitened(W, W @ linear.J, apply_matrix(W, linear.r), reached, gain, np.sqrt(total), *inside)
