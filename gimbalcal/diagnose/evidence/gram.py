r"""Products of columns with each other, half of which are stored, and what columns in the model take of them.

.. math:: G' = G - U U^T, \qquad U = G_a L^{-T}, \qquad L L^T = G_{aa} + s^{-2} I

is what columns a of prior size s leave of G (Schur's complement). Of a thousand positions there are 1600 columns and 24
noises, while a search asks for the few products of each cause with itself: the others are never formed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gimbalcal.number import Array


def size(P: int) -> int:
    """Numbers in the triangle of P columns."""
    return P * (P + 1) // 2


@dataclass(frozen=True, eq=False)
class Gram:
    """A symmetric matrix (P, P): the lower triangle row by row, less `taken` times its transpose."""

    triangle: Array  # (P (P + 1) / 2,)
    taken: Array  # (P, a)

    @classmethod
    def of(cls, G: Array, room: Array | None = None) -> Gram:
        """That of a whole matrix (P, P), its triangle in `room` if that is given."""
        triangle = np.empty(size(len(G))) if room is None else room
        for i, row in enumerate(G):
            triangle[size(i) : size(i + 1)] = row[: i + 1]
        return cls(triangle, np.zeros((len(G), 0)))

    def at(self, i: Array, j: Array) -> Array:
        """Products (...) of columns i (...) with columns j (...)."""
        upper = np.maximum(i, j)
        return self.less(self.triangle[upper * (upper + 1) // 2 + np.minimum(i, j)], i, j)

    def less(self, products: Array, i: Array, j: Array) -> Array:
        """Products (...) as the triangle has them, less what is taken."""
        if not self.taken.shape[1]:
            return products
        return np.asarray(products - (self.taken[i] * self.taken[j]).sum(axis=-1))

    def block(self, index: Array) -> Array:
        """Products (..., w, w) of columns (..., w) with each other."""
        return self.at(index[..., :, None], index[..., None, :])

    def beside(self, index: Array) -> Array:
        """Products (P, w) of every column with columns (w,)."""
        return self.at(np.arange(len(self.taken))[:, None], index[None, :])

    @property
    def diagonal(self) -> Array:
        """Squares (P,) of the columns."""
        every = np.arange(len(self.taken))
        return self.at(every, every)

    @property
    def whole(self) -> Array:
        """All of it (P, P)."""
        return self.block(np.arange(len(self.taken)))

    def without(self, U: Array) -> Gram:
        """Less U (P, a) times its transpose."""
        return Gram(self.triangle, np.concatenate([self.taken, U], axis=1))
