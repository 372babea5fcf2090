r"""Evidence where nothing says how large the noise is: its scale and its memory from row to row are integrated over.

With y the misfit and X a candidate's columns per prior sigma, both cleared of what is already modelled (q columns) and
whitened for a first-order memory rho,

.. math:: p(y \mid X, \sigma, s) \propto \sigma^{-(N-q)} \exp(-\tfrac{1}{2\sigma^2} y^T y) \prod_j
    \left(1 + \tfrac{s^2 \lambda_j}{\sigma^2}\right)^{-1/2}
    \exp\left(\tfrac{1}{2 \sigma^4} \frac{s^2 c_j^2}{1 + s^2 \lambda_j / \sigma^2}\right)

with lambda, c the eigenvalues of X^T X and the scores X^T y along them; sums over a grid of sigma (flat in its
logarithm), of rho, and of the size s of the effect against its prior.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gimbalcal.effects.process import GaussMarkov, Process, WhiteNoise
from gimbalcal.inference.algebra import eigh, logsumexp
from gimbalcal.inference.noise import chain
from gimbalcal.number import Array

SIZES = np.array([0.1, 0.3, 1.0, 3.0, 10.0, 30.0])  # times the catalogue's prior sigma: rigs differ, physics less
SIZE_PRIOR = np.array([0.15, 0.2, 0.25, 0.2, 0.12, 0.08])
MEMORY = (0.0, 0.3, 0.6, 0.8, 0.9, 0.96)
MEMORY_PRIOR = (0.5, 0.1, 0.1, 0.1, 0.1, 0.1)
SCALES = np.geomspace(0.003, 2.0, 48)  # of the rms misfit: a cause may take away all but 1 / 300 of it
WANDERS = 1.0  # mean of ln(noise between rows / scatter of their samples) where it is more
OVERRATED = 0.3  # the same where it is less: a hand that trembles is no noise of the mean
RANK = 1e-7  # relative singular value of a modelled column below which it is one of the others again


@dataclass(frozen=True)
class Cleared:
    """Misfit y (N,) and columns X (N, P), whitened for one memory and cleared of the modelled columns."""

    y: Array
    X: Array
    dof: int
    ln_prior: float  # of the memory, with the determinants


def clear(r: Array, J: Array, X: Array, rho: float, prior: float) -> Cleared:
    """Whiten r (n, C), modelled columns J (n, C, q) and candidates X (n, C, P) for memory rho, and project J out."""
    n, C = r.shape
    noise = chain(first_order(rho), np.arange(float(n)))
    y, Z, W = (noise.whiten(a.reshape(n, C, -1)).reshape(n * C, -1) for a in (r, J, X))
    size = np.sqrt((Z**2).sum(axis=0))
    U, S, _ = np.linalg.svd(Z / np.where(size > 0, size, 1.0), full_matrices=False)
    keep = S > RANK * max(S.max(initial=0.0), 1e-300)
    Q, S = U[:, keep], S[keep]
    before = np.sqrt((W**2).sum(axis=0))
    W = W - Q @ (Q.T @ W)
    W = np.where(np.sqrt((W**2).sum(axis=0)) > 1e-4 * before, W, 0.0)
    y = (y - Q @ (Q.T @ y))[:, 0]
    ln = np.log(prior) - 0.5 * C * noise.log_determinant - float(np.log(S).sum())
    return Cleared(y, W, n * C - len(S), float(ln))


def first_order(rho: float) -> Process:
    """Unit noise of memory rho from row to row, time counted in rows."""
    return GaussMarkov(1.0, -1 / np.log(rho)) if rho > 0 else WhiteNoise(1.0)


@dataclass(frozen=True)
class Ground:
    """The hypothesis that nothing is missing: cleared arrays by memory, noise scales, ln weights (memories, scales)."""

    cleared: tuple[Cleared, ...]
    scale: Array  # (scales,) SI
    ln: Array
    gram: Array  # (memories, P, P)
    score: Array  # (memories, P)

    def best(self) -> tuple[int, float]:
        """The likeliest memory and scale."""
        k, j = np.unravel_index(int(np.argmax(self.ln)), self.ln.shape)
        return int(k), float(self.scale[j])


def ground(r: Array, J: Array, X: Array, memory: bool = True, sample: float = 0.0) -> Ground:
    r"""Prepare evidence for columns X (n, C, P) beside modelled columns J (n, C, q), misfit r (n, C).

    sample: rms of a row by the scatter of its samples, 0 where nothing tells it. The noise between rows is of that
    order, seldom less, often more, as sensors wander from rest to rest:

    .. math:: p(\ln\sigma) \propto e^{-\ln(\sigma / s) / 1} \; (\sigma > s), \quad
              e^{-\ln(s / \sigma_0) / 0.3} \; (\sigma_0 < s)

    with sigma_0 = sigma sqrt(1 - rho^2) what is new in each row: that the samples scatter stays, whatever wanders.
    """
    nodes = list(zip(MEMORY, MEMORY_PRIOR, strict=True))
    cleared = tuple(clear(r, J, X, rho, p) for rho, p in (nodes if memory else nodes[:1]))
    scale = SCALES * float(np.sqrt(np.mean(r**2)))
    ln = np.stack([c.ln_prior - c.dof * np.log(scale) - 0.5 * (c.y @ c.y) / scale**2 for c in cleared])
    if sample > 0:
        above = np.log(scale / sample)
        below = -above - 0.5 * np.log(1 - np.array([rho for rho, _ in nodes][: len(cleared)]) ** 2)[:, None]
        ln = ln - np.maximum(above, 0.0) / WANDERS - np.maximum(below, 0.0) / OVERRATED
    return Ground(
        cleared, scale, ln, np.stack([c.X.T @ c.X for c in cleared]), np.stack([c.X.T @ c.y for c in cleared])
    )  # fmt: skip


def log_evidence(g: Ground, index: Sequence[int], sizes: Array = SIZES, prior: Array = SIZE_PRIOR) -> float:
    """ln Bayes factor of the columns `index` together against nothing, all unknowns of the noise integrated over."""
    at = np.asarray(index)
    lam, V = eigh(g.gram[:, at[:, None], at])
    c2 = np.einsum("kij,ki->kj", V, g.score[:, at]) ** 2
    lam = np.maximum(lam, 0.0)
    most = np.array([c.y @ c.y for c in g.cleared])[:, None] * lam  # Cauchy and Schwarz, against rounding
    c2 = np.minimum(c2, most)
    s2 = (sizes**2)[:, None] / g.scale**2  # (sizes, scales)
    damped = 1 + s2 * lam[:, :, None, None]  # (memories, columns, sizes, scales)
    gain = (s2 / g.scale**2) * c2[:, :, None, None] / damped
    ln = 0.5 * (gain - np.log(damped)).sum(axis=1)
    return float(logsumexp(ln + np.log(prior)[:, None] + g.ln[:, None]) - logsumexp(g.ln))


def best_evidence(g: Ground, index: Sequence[int]) -> float:
    """ln Bayes factor at the size that suits best: how well the columns can fit, whatever size was expected."""
    return max(log_evidence(g, index, SIZES[i : i + 1], np.ones(1)) for i in range(len(SIZES)))


def explained(g: Ground, index: Sequence[int], memory: int | None = None) -> float:
    """Misfit y^T y that these columns can take away, at the likeliest memory or at that of ordinal `memory`."""
    k = g.best()[0] if memory is None else memory
    at = np.asarray(index)
    b = g.score[k, at]
    return float(b @ np.linalg.pinv(g.gram[k][np.ix_(at, at)], rcond=1e-10, hermitian=True) @ b)
