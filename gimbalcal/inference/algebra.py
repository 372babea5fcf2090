"""Linear algebra for several estimators."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gimbalcal.number import Array

MIN_SINGULAR_VALUE = 1e-4  # sigmas per prior sigma: a calibration direction below it changes nothing
MIN_RELATIVE_SINGULAR_VALUE = 1e-7  # of columns of unit length: one below it is a combination of the others


def eigh(G: Array) -> tuple[Array, Array]:
    """Return eigenvalues and eigenvectors of Gram matrices (..., p, p).

    Divide and conquer fails on some matrices of low rank, and does not on the same with 1e-12 added to the diagonal.
    """
    try:
        lam, V = np.linalg.eigh(G)
    except np.linalg.LinAlgError:
        size = np.trace(G, axis1=-2, axis2=-1)[..., None, None]
        lam, V = np.linalg.eigh(G + 1e-12 * size * np.eye(G.shape[-1]))
    return lam, V


def orthonormal(Z: Array, least: float = MIN_SINGULAR_VALUE) -> Array:
    """Return an orthonormal basis (R, q) of the directions in which columns Z (R, p) are longer than `least`."""
    U, S, _ = np.linalg.svd(Z, full_matrices=False)
    return np.asarray(U[:, S > least])


def unit_columns(A: Array) -> tuple[Array, Array]:
    """Return columns A (R, p) divided by their lengths, and these lengths (p,): 1 of a column of zeros, which stays."""
    size = np.linalg.norm(A, axis=0)
    size = np.where(size > 0, size, 1.0)
    return A / size, size


def orthonormal_columns(A: Array, least: float = MIN_RELATIVE_SINGULAR_VALUE) -> Array:
    """Return an orthonormal basis (R, q) of columns A (R, p), whatever their units.

    least: singular value over the largest, of columns of length one, below which a direction is rounding.
    """
    U, S, _ = np.linalg.svd(unit_columns(A)[0], full_matrices=False)
    return np.asarray(U[:, S > least * S.max(initial=1e-300)])


def nonnegative_least_squares(A: Array, y: Array) -> tuple[Array, float]:
    """Return the least squares (p,) of rows A (n, p), y (n,) without negative sizes, and the norm of the residual.

    At the solution the sizes that are not zero are the least squares of their columns alone, so that of all subsets of
    columns without a negative size the one with the least residual is right. SciPy iterates between subsets instead;
    to import it takes longer than to try all 2^p - 1 of the two or three columns that a noise has.

    Source: Lawson and Hanson, Solving Least Squares Problems (1974), chapter 23, theorem 23.4 (Kuhn-Tucker).
    """
    A, length = unit_columns(A)
    best, least = np.zeros(A.shape[1]), float(np.linalg.norm(y))
    for number in range(1, 2 ** A.shape[1]):
        chosen = [k for k in range(A.shape[1]) if number >> k & 1]
        size = np.linalg.lstsq(A[:, chosen], y, rcond=None)[0]
        left = float(np.linalg.norm(y - A[:, chosen] @ size))
        if left < least and np.all(size >= 0):
            best, least = np.zeros(A.shape[1]), left
            best[chosen] = size
    return best / length, least


def beyond(Q: Array, A: Array, least: float = 0.0) -> Array:
    """Return what orthonormal columns Q (R, q) leave of columns A (R, p), or of one (R,).

    least: share of its length that must be left of a column; one of which less is left becomes zero.
    """
    rest = A - Q @ (Q.T @ A)
    if least > 0:
        rest = np.where(np.linalg.norm(rest, axis=0) > least * np.linalg.norm(A, axis=0), rest, 0.0)
    return np.asarray(rest)


def logsumexp(x: Array, axis: int | None = None) -> Array:
    """Return ln of the sum of exp(x) along an axis, or of all; -inf where every term is."""
    top = x.max(axis=axis, keepdims=True)
    top = np.where(np.isfinite(top), top, 0.0)
    with np.errstate(divide="ignore"):
        return np.asarray(np.log(np.exp(x - top).sum(axis=axis)) + np.squeeze(top, axis=axis))


def block_diagonal(blocks: Sequence[Array]) -> Array:
    """Return a matrix (sum of r, sum of c) with blocks (r, c) along its diagonal."""
    ends = np.cumsum([b.shape for b in blocks], axis=0)
    out = np.zeros(ends[-1])
    for (i, j), b in zip(ends, blocks, strict=True):
        out[i - len(b) : i, j - b.shape[1] : j] = b
    return out
