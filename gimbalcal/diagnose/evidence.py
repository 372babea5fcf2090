r"""How strongly the data speak for each cause: closed-form Gaussian evidence, calibration profiled out, noise integrated.

For one noise phi and one prior size s, with X the whitened columns from which the calibration has been projected,

.. math:: \ln BF = -\tfrac12 \ln |I + s^2 X^T X| + \tfrac12 b^T (s^{-2} I + X^T X)^{-1} b, \qquad b = X^T y ,

columns being scaled by their prior sigma. The calibration constants have a flat prior, so that BF is an e-value: under
no effect it exceeds 1 / alpha with probability at most alpha. Mixed over s, over the variants of a candidate and, with
the weight that the data give each, over the noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gimbalcal.diagnose.candidates import Candidate
from gimbalcal.diagnose.noise import Node
from gimbalcal.number import Array

SIZES = np.array([0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0])  # times the catalogue's prior sigma
SIZE_PRIOR = np.array([0.15, 0.2, 0.25, 0.18, 0.12, 0.06, 0.04])
ABSORBED = 1e-3  # a column of which less is left rests on second-order terms and on noise in its own inputs
SEEN = 1e-4  # sigmas per prior sigma: a calibration direction below it changes nothing


@dataclass(frozen=True)
class Rows:
    """Reduced rows [Z | X | y], split where the noise is white whatever the node.

    low (R', q + P + m) are the rows that a node whitens; high is the Gram matrix of the others. Z is orthonormal
    over all rows under white noise, and X and y have been cleared of it there, so that nothing cancels later.
    """

    low: Array
    high: Array
    q: int
    P: int
    Q: Array  # (R, q) orthonormal calibration columns


@dataclass(frozen=True)
class Projection:
    """One noise node with the calibration projected out: Gram matrix, scores, misfit."""

    node: Node
    G: Array  # (P, P)
    b: Array  # (P, m) one column per data vector
    misfit: Array  # (m,) y^T V^-1 y after projection
    penalty: float  # ln |V| + ln |Z^T V^-1 Z|

    def log_likelihood(self) -> Array:
        """ln p(y | phi) of no effect, up to a constant, (m,)."""
        return np.asarray(-0.5 * (self.misfit + self.penalty))


def stack(Z: Array, X: Array, y: Array, low: int) -> Rows:
    """Reduced Z (R, z), X (R, P), y (R, m) to `Rows` whose first `low` rows are coloured."""
    Q = orthonormal(Z)
    before = np.sqrt((X**2).sum(axis=0))
    X, y = X - Q @ (Q.T @ X), y - Q @ (Q.T @ y)
    X = np.where(np.sqrt((X**2).sum(axis=0)) > ABSORBED * before, X, 0.0)
    A = np.concatenate([Q, X, y], axis=1)
    tail = A[low:]
    return Rows(A[:low], tail.T @ tail, Q.shape[1], X.shape[1], Q)


def orthonormal(Z: Array) -> Array:
    """Orthonormal basis (R, q) of the calibration columns, numerically null directions left out."""
    U, S, _ = np.linalg.svd(Z, full_matrices=False)
    return np.asarray(U[:, S > SEEN])


def project(node: Node, rows: Rows) -> Projection:
    """Whiten by a node, profile the calibration out, and form the Gram matrix and scores."""
    W = node.whiten(rows.low)
    A = W.T @ W + rows.high
    q, P = rows.q, rows.P
    L = np.linalg.cholesky(A[:q, :q])
    K = np.linalg.solve(L, A[:q, q:])
    B = A[q:, q:] - K.T @ K
    logdet = 2 * float(np.log(np.diag(L)).sum())
    return Projection(node, B[:P, :P], B[:P, P:], np.diag(B)[P:].copy(), node.logdet + logdet)


def log_bayes(G: Array, b: Array) -> Array:
    """ln BF (..., sizes) for Gram matrices G (..., p, p) and scores b (..., p), one per prior size."""
    if G.shape[-1] == 1:
        lam, c = G[..., 0], b
    else:
        lam, V = np.linalg.eigh(G)
        c = np.einsum("...ij,...i->...j", V, b)
    lam = np.maximum(lam, 0.0)[..., None, :]
    s2 = (SIZES**2)[:, None]
    gain = s2 * c[..., None, :] ** 2 / (1 + s2 * lam)
    return np.asarray(0.5 * (gain - np.log1p(s2 * lam)).sum(axis=-1))


def mixed(ln: Array, prior: Array, axis: int = -1) -> Array:
    """ln of the prior-weighted mean of exp(ln) along an axis."""
    from scipy.special import logsumexp

    shape = [1] * ln.ndim
    shape[axis] = -1
    return np.asarray(logsumexp(ln + np.log(prior).reshape(shape), axis=axis))


def gather(projections: Sequence[Projection], candidates: Sequence[Candidate]) -> Array:
    """ln BF (nodes, candidates) of every single candidate at every noise, sizes and variants mixed; b (P, 1)."""
    out = np.full((len(projections), len(candidates)), -np.inf)
    by_width: dict[int, list[tuple[int, tuple[int, ...]]]] = {}
    for i, c in enumerate(candidates):
        for v in c.variants:
            by_width.setdefault(len(v.index), []).append((i, v.index))
    variants: list[list[Array]] = [[] for _ in candidates]
    G, b = np.stack([p.G for p in projections]), np.stack([p.b[:, 0] for p in projections])
    for members in by_width.values():
        index = np.array([at for _, at in members])
        parts = log_bayes(G[:, index[:, :, None], index[:, None, :]], b[:, index])
        ln = mixed(parts, SIZE_PRIOR)
        for j, (i, _) in enumerate(members):
            variants[i].append(ln[:, j])
    for i, parts_of in enumerate(variants):
        weight = np.array([v.weight for v in candidates[i].variants])
        order = np.argsort([len(v.index) for v in candidates[i].variants], kind="stable")
        out[:, i] = mixed(np.stack(parts_of, axis=-1), (weight / weight.sum())[order])
    return out


def condition(p: Projection, columns: Sequence[int], size: float) -> Projection:
    """The same projection given that these columns are in the model with prior size s."""
    a = np.asarray(columns)
    M = np.linalg.inv(p.G[np.ix_(a, a)] + np.eye(len(a)) / size**2)
    Ga, ba = p.G[:, a], p.b[a]
    return Projection(p.node, p.G - Ga @ M @ Ga.T, p.b - Ga @ (M @ ba), p.misfit - (ba * (M @ ba)).sum(axis=0),
                      p.penalty + float(np.linalg.slogdet(np.eye(len(a)) + size**2 * p.G[np.ix_(a, a)])[1]))  # fmt: skip


def best_size(G: Array, b: Array) -> float:
    """Prior size under which one candidate is likeliest."""
    return float(SIZES[int(np.argmax(log_bayes(G, b) + np.log(SIZE_PRIOR)))])
