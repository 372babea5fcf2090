r"""The evidence for each cause in closed form, with the calibration profiled out and the noise integrated over.

For one noise phi and one prior size s, with X the whitened columns from which the calibration has been projected,

.. math:: \ln BF = -\tfrac12 \ln |I + s^2 X^T X| + \tfrac12 b^T (s^{-2} I + X^T X)^{-1} b, \qquad b = X^T y ,

columns being scaled by their prior sigma; `scale` has the same for a noise of any scale. The calibration constants
have a flat prior, so that BF is an e-value: under no effect it exceeds 1 / alpha with probability at most alpha.
It is averaged over s, over the variants of a candidate and, by the posterior weight of each, over the noise.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gimbalcal.diagnose.evidence.channel_scales import Place, products_of_noises, promising_nodes
from gimbalcal.diagnose.evidence.gram import Gram, triangle_size
from gimbalcal.diagnose.evidence.node import Node
from gimbalcal.diagnose.evidence.scale import STATED, Channels, Free, Stated
from gimbalcal.diagnose.library.candidates import Layout
from gimbalcal.inference.algebra import beyond, eigh, logsumexp, orthonormal
from gimbalcal.number import Array

MIN_SHARE_OF_COLUMN = 1e-3  # a column of which less is left rests on second-order terms and on noise in its own inputs
CHUNK_BYTES = 16 << 20  # of rows that are formed at a time
SPARE_COLUMNS = 200  # columns that may be put behind others later: memory that is not written takes none


@dataclass(frozen=True)
class ReducedRows:
    """Reduced rows [Z | X | y], split where the noise is white whatever the node.

    low (R', q + P + m) are the rows that a node whitens; high is the Gram matrix of the others. Z is orthonormal over
    all rows under white noise, and X and y have been made orthogonal to it there, so that no cancellation occurs later.
    """

    low: Array
    high: Array
    q: int
    P: int
    Q: Array  # (R, q) orthonormal calibration columns
    y: Array  # (R, m) data cleared of them
    scale: Stated | Free = STATED  # of white noise
    unit: float = 1.0  # of X and y, in those of reduced rows

    @property
    def few(self) -> bool:
        """Return whether the rows, all of them coloured, are fewer than the columns."""
        return len(self.low) == len(self.Q) <= self.P


@dataclass(frozen=True)
class Projection:
    """One noise node with the calibration projected out: Gram matrix, scores, misfit."""

    node: Node
    G: Gram  # of P columns
    b: Array  # (P, m) one column per data vector
    misfit: Array  # (m,) y^T V^-1 y after projection
    penalty: float  # ln |V| + ln |Z^T V^-1 Z|
    scale: Stated | Free = STATED

    def log_likelihood(self) -> Array:
        """ln p(y | phi) of no effect, up to a constant, (m,)."""
        return np.asarray(self.scale.log_likelihood(self.misfit) - 0.5 * self.penalty)

    def log_evidence(self) -> float:
        """ln of prior probability x likelihood of the noise, where nothing is missing."""
        return float(np.log(self.node.prior) + self.log_likelihood()[0])

    def explained(self, index: Sequence[int], given: Sequence[int] = ()) -> float:
        """Return the misfit that these columns of any size explain in addition to those of `given`."""
        both, own = np.array([*given, *index], dtype=int), np.array(given, dtype=int)
        return self._taken(both) - (self._taken(own) if len(own) else 0.0)

    def _taken(self, at: Array) -> float:
        b = self.b[at, 0]
        return float(b @ np.linalg.pinv(self.G.block(at), rcond=1e-10, hermitian=True) @ b)


def stacked_rows(
    Z: Array, X: Array, y: Array, low: int, scale: Stated | Free = STATED, unit: float = 1.0
) -> ReducedRows:
    """Reduced Z (R, z), X (R, P), y (R, m) to `ReducedRows` whose first `low` rows are coloured."""
    Q = orthonormal(Z)
    q, P = Q.shape[1], X.shape[1]
    y, taken, n = beyond(Q, y), Q.T @ X, q + P + y.shape[1]
    visible = (taken**2).sum(axis=0) < (1 - MIN_SHARE_OF_COLUMN**2) * np.einsum("rp,rp->p", X, X)
    coloured, high = np.empty((low, n)), np.broadcast_to(0.0, (n, n))
    step = max(1, CHUNK_BYTES // (8 * n))
    for k in range(0, len(X), step):  # a day of data has gigabytes of columns: no second copy of white rows
        part, cut = slice(k, k + step), max(low - k, 0)
        A = np.concatenate([Q[part], np.where(visible, X[part] - Q[part] @ taken, 0.0), y[part]], axis=1)
        coloured[part], white = A[:cut], A[cut:]
        if len(white):
            high = high + white.T @ white
    return ReducedRows(coloured, high, q, P, Q, y, scale, unit)


def append_columns(rows: ReducedRows, X: Array, new: Array) -> ReducedRows:
    """Return `rows` of columns X (R, P) with `new` (R, p) appended: as `stacked_rows`, but faster for a few columns."""
    q, P, low = rows.q, rows.P, len(rows.low)
    remainder = beyond(rows.Q, new, MIN_SHARE_OF_COLUMN)
    visible = rows.low[:, q : q + P].any(axis=0) | (np.diag(rows.high)[q : q + P] > 0)
    N = remainder[low:]
    QN = rows.Q[low:].T @ N
    XN = np.where(visible[:, None], X[low:].T @ N - (rows.Q.T @ X).T @ QN, 0.0)
    at, total = slice(q + P, q + P + N.shape[1]), len(rows.high) + N.shape[1]
    high = np.empty((total, total))
    old = np.r_[0 : at.start, at.stop : total]
    high[np.ix_(old, old)] = rows.high
    high[:, at] = np.concatenate([QN, XN, N.T @ N, rows.y[low:].T @ N])
    high[at] = high[:, at].T
    columns = np.concatenate([rows.low[:, : at.start], remainder[:low], rows.low[:, at.start :]], axis=1)
    return ReducedRows(columns, high, q, P + N.shape[1], rows.Q, rows.y, rows.scale, rows.unit)


def project_all(
    nodes: Sequence[Node], rows: ReducedRows, before: Sequence[Projection] = (), layout: Layout | None = None
) -> tuple[Projection, ...]:
    """Return one projection per noise, with all Gram matrices in one block of memory of some hundred MB.

    before: the projections of the rows without their last columns, which are extended in place if there is room. If
    channels may have scales of their own, a noise without stated scales has several projections: at the scales at which
    the candidates of a layout, or no cause, may be likely.
    """
    if rows.scale.channels is not None and not any(n.scales for n in nodes):
        return _of_channel_scales(nodes, rows, rows.scale.channels, layout)
    if rows.few:
        known = before or itertools.repeat(None)
        return tuple(_of_few_rows(node, rows, p) for node, p in zip(nodes, known, strict=False))
    if before and triangle_size(rows.P) <= len(before[0].G.triangles[0]):
        return tuple(_grown_projection(p, rows) for p in before)
    room = np.empty((len(nodes), triangle_size(rows.P + SPARE_COLUMNS)))
    return tuple(project(node, rows, own) for node, own in zip(nodes, room, strict=True))


def _of_channel_scales(
    nodes: Sequence[Node], rows: ReducedRows, channels: Channels, layout: Layout | None
) -> tuple[Projection, ...]:
    """Return the projections of noises at the scales of channels that hold the evidence of any promising candidate."""
    every = products_of_noises(nodes, rows.low, rows.q, rows.P, channels)
    projections: dict[Place, Projection] = {}

    def scored(wanted: Sequence[Place]) -> Array:
        for k, at in wanted:
            node, log_scales = every[k].noise(at)
            G, b, misfit, penalty = every[k].projected(log_scales)
            scale = rows.scale.with_memory(node.fresh).of_channels(node.scales)
            projections[k, at] = Projection(node, G, b, misfit, node.logdet + penalty, scale)
        new = [projections[place] for place in wanted]
        none = np.array([p.log_evidence() for p in new])[:, None]
        return none if layout is None else np.concatenate([none, gather_evidence(new, layout) + none], axis=1)

    return tuple(projections[place] for place in promising_nodes(every, scored))


def project(node: Node, rows: ReducedRows, room: Array | None = None) -> Projection:
    """Whiten by a node, profile the calibration out, and form the Gram matrix (in `room`) and scores."""
    if rows.few:
        return _of_few_rows(node, rows)
    A = node.products(rows.low)  # some MB each: in place
    A += rows.high
    q, P = rows.q, rows.P
    L = np.linalg.cholesky(A[:q, :q])
    K = np.linalg.solve(L, A[:q, q:])
    B = K.T @ K
    np.subtract(A[q:, q:], B, out=B)
    return _projection(node, rows, Gram.of(B[:P, :P], room), B[:P, P:].copy(), np.diag(B)[P:].copy(), L)


def _of_few_rows(node: Node, rows: ReducedRows, before: Projection | None = None) -> Projection:
    """The projection of few rows, whose columns are kept in the place of their products, behind those `before`."""
    q = rows.q
    old = np.zeros((0, len(rows.low))) if before is None or before.G.columns is None else before.G.columns
    W = node.whiten(np.delete(rows.low, np.s_[q : q + len(old)], axis=1))
    L = np.linalg.cholesky(W[:, :q].T @ W[:, :q])
    left = beyond(np.linalg.solve(L, W[:, :q].T).T, W[:, q:]).T
    columns, y = np.concatenate([old, left[: rows.P - len(old)]]), left[rows.P - len(old) :]
    G = Gram((), np.zeros((rows.P, 0)), columns=columns)
    return _projection(node, rows, G, columns @ y.T, (y**2).sum(axis=1), L)


def _projection(node: Node, rows: ReducedRows, G: Gram, b: Array, misfit: Array, L: Array) -> Projection:
    """The projection with these products; L (q, q): the Cholesky factor of those of the whitened calibration."""
    scale = rows.scale.with_memory(node.fresh)
    scale = scale.of_channels(node.scales) if node.scales else scale
    return Projection(node, G, b, misfit, node.logdet + 2 * float(np.log(np.diag(L)).sum()), scale)


def _grown_projection(p: Projection, rows: ReducedRows) -> Projection:
    """The projection of rows that have further columns behind those it knows."""
    q, P, known = rows.q, rows.P, len(p.b)
    these = np.r_[:q, q + known : q + P]
    A = p.node.products(rows.low, these) + rows.high[these]
    K = np.linalg.solve(np.linalg.cholesky(A[:q, :q]), A[:q, q:])
    B = A[q:, q:] - K[:, known:P].T @ K
    return replace(p, G=p.G.grown(B[:, :P]), b=np.concatenate([p.b, B[:, P:]]))


def rows_like(rows: ReducedRows, X: Array, low: int = 0) -> ReducedRows:
    """Return the same calibration and data with other columns, `low` rows or more of them coloured."""
    Q = rows.Q
    X = beyond(Q, X)
    A = np.concatenate([Q, X, rows.y], axis=1)
    low = max(low, rows.low.shape[0])
    return ReducedRows(A[:low], A[low:].T @ A[low:], rows.q, X.shape[1], Q, rows.y, rows.scale, rows.unit)


def log_bayes(p: Projection, index: Array, sizes: Array) -> Array:
    """ln BF (..., sizes) of the columns `index` (..., w) together, one per prior size."""
    gain, damping = _by_size(*_scores_along(p.G.block(index), p.b[index, 0]), sizes)
    return np.asarray(p.scale.gained(p.misfit[0], gain) - damping)


def any_size(p: Projection, index: Array) -> Array:
    """ln BF (...) of the columns `index` (..., w) together, their size mixed over its prior."""
    return logsumexp(each_size(p, index), axis=-1)


def each_size(p: Projection, index: Array) -> Array:
    """ln of prior share times BF (..., sizes) of the columns `index` (..., w) together, for each prior size."""
    return _weighed(p, *_by_size(*_scores_along(p.G.block(index), p.b[index, 0]), p.scale.sizes))


def _weighed(p: Projection, gain: Array, damping: Array) -> Array:
    return np.asarray(p.scale.gained(p.misfit[0], gain) - damping + p.scale.log_prior(p.misfit[0] - gain))


def _scores_along(G: Array, b: Array) -> tuple[Array, Array]:
    """Eigenvalues of Gram matrices (..., w, w), and scores (..., w) along their vectors."""
    if G.shape[-1] == 1:
        return np.maximum(G[..., 0], 0.0), b
    lam, V = eigh(G)
    return np.maximum(lam, 0.0), np.einsum("...ij,...i->...j", V, b)


def _by_size(lam: Array, c: Array, sizes: Array) -> tuple[Array, Array]:
    """Misfit that columns of each prior size take away, and ln |I + s^2 G| / 2, both (..., sizes)."""
    lam, c, s2 = lam[..., None, :], c[..., None, :], (sizes**2)[:, None]
    gain = (s2 * c**2 / (1 + s2 * lam)).sum(axis=-1)
    return np.asarray(gain), np.asarray(0.5 * np.log1p(s2 * lam).sum(axis=-1))


def gather_evidence(projections: Sequence[Projection], layout: Layout) -> Array:
    """ln BF (nodes, candidates) of every single candidate at every noise, sizes and variants mixed; b (P, 1)."""
    sizes = projections[0].scale.sizes
    gain, damping = np.empty((2, len(projections), len(layout.log_share), len(sizes)))
    for members, index in layout.widths:
        G, b = (np.stack(each) for each in zip(*((p.G.block(index), p.b[index, 0]) for p in projections), strict=True))
        gain[:, members], damping[:, members] = _by_size(*_scores_along(G, b), sizes)
    ln = np.stack([logsumexp(_weighed(p, gain[k], damping[k]), axis=-1) for k, p in enumerate(projections)])
    return np.asarray(np.logaddexp.reduceat(ln + layout.log_share, layout.starts, axis=1))


def by_size(p: Projection, layout: Layout) -> Array:
    """ln BF (candidates, sizes) of every single candidate at its best variant, for each of the finest sizes."""
    ln = np.empty((len(layout.log_share), len(p.scale.any_size)))
    for members, index in layout.widths:
        ln[members] = log_bayes(p, index, p.scale.any_size)
    return np.maximum.reduceat(ln, layout.starts, axis=0)


def condition_on(p: Projection, columns: Array, size: float) -> Projection:
    """Return the projection given that these columns are in the model with prior size s."""
    lam, V = eigh(p.G.block(columns))
    lam = np.maximum(lam, 0.0)  # of columns that are alike
    root = V / np.sqrt(lam + 1 / size**2)
    U, z = p.G.with_all(columns) @ root, root.T @ p.b[columns]
    penalty = float(np.log1p(size**2 * lam).sum())
    misfit = p.misfit - (z**2).sum(axis=0)
    return Projection(p.node, p.G.without(U), p.b - U @ z, misfit, p.penalty + penalty, p.scale)
