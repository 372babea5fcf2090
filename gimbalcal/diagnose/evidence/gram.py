r"""Gram matrices of columns, stored as one triangle, and their reduction by columns that are in the model.

.. math:: G' = G - U U^T, \qquad U = G_a L^{-T}, \qquad L L^T = G_{aa} + s^{-2} I

is what columns a of prior size s leave of G (Schur's complement). A thousand positions have 1600 columns and 24
noises, while a search needs only the few products of each cause with itself: the others are not computed. Fewer rows
than columns are kept themselves in the place of the triangle, and a product is formed when it is asked for.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gimbalcal.number import Array


def triangle_size(P: int) -> int:
    """Return the number of elements in the triangle of P columns."""
    return P * (P + 1) // 2


@dataclass(frozen=True, eq=False)
class Gram:
    """A symmetric matrix (P, P), a weighted sum of lower triangles row by row, less `taken` times its transpose."""

    triangles: tuple[Array, ...]  # (P (P + 1) / 2,) each, or more where there is room for further columns
    taken: Array  # (P, a)
    weights: Array | None = None  # (triangles,) in the sum; None where there is one triangle
    columns: Array | None = None  # (P, R) the columns of few rows R, in the place of triangles

    @classmethod
    def of(cls, G: Array, room: Array | None = None) -> Gram:
        """Return the triangle of a whole matrix (P, P), in the memory `room` if that is given."""
        empty = cls((np.empty(triangle_size(len(G))) if room is None else room,), np.zeros((0, 0)))
        return empty.grown(G)

    def grown(self, more: Array) -> Gram:
        """Return the matrix with further columns, whose products (p, P + p) with all columns are appended."""
        P, p = len(self.taken), len(more)
        self.triangles[0][triangle_size(P) : triangle_size(P + p)] = more[np.tri(p, P + p, P, dtype=bool)]
        return Gram(self.triangles, np.zeros((P + p, 0)))

    def products(self, i: Array, j: Array) -> Array:
        """Products (..., v, w) of columns i (..., v) with columns j (..., w)."""
        gram = self._whole_products(i, j)
        if not self.taken.shape[1]:
            return gram
        return np.asarray(gram - self.taken[i] @ np.swapaxes(self.taken[j], -1, -2))

    def _whole_products(self, i: Array, j: Array) -> Array:
        """The same with nothing taken."""
        if self.columns is not None:
            return np.asarray(self.columns[i] @ np.swapaxes(self.columns[j], -1, -2))
        upper, lower = np.maximum(i[..., :, None], j[..., None, :]), np.minimum(i[..., :, None], j[..., None, :])
        at = upper * (upper + 1) // 2 + lower
        if self.weights is None:
            return self.triangles[0][at]
        return np.asarray(sum(w * t[at] for w, t in zip(self.weights, self.triangles, strict=True)))

    def block(self, index: Array) -> Array:
        """Products (..., w, w) of columns (..., w) with each other."""
        return self.products(index, index)

    def with_all(self, index: Array) -> Array:
        """Products (P, w) of every column with columns (w,)."""
        return self.products(np.arange(len(self.taken)), index)

    @property
    def diagonal(self) -> Array:
        """Squares (P,) of the columns."""
        return self.block(np.arange(len(self.taken))[:, None])[:, 0, 0]

    @property
    def whole(self) -> Array:
        """All of it (P, P)."""
        return self.block(np.arange(len(self.taken)))

    def without(self, U: Array) -> Gram:
        """Less U (P, a) times its transpose."""
        return replace(self, taken=np.concatenate([self.taken, U], axis=1))
