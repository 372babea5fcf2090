r"""White noise of one sample, from what neighbouring samples do.

.. math:: \sigma^2 = \frac{1}{20} \left\langle (x_{i+3} - 3 x_{i+2} + 3 x_{i+1} - x_i)^2 \right\rangle

The third difference of a slow signal vanishes (a sidereal wave of 1 g sampled each minute leaves 1e-7 g of it), that
of white noise has variance (1 + 9 + 9 + 1) sigma^2. Differences are never taken across a gap or a change of position.
Source: von Neumann et al., Ann. Math. Statist. 12 (1941) 153, for the first difference; higher orders by the same
argument.
"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import repeat
from math import comb

import numpy as np

from gimbalcal.number import Array


def scaled_differences(
    x: Iterable[Array], begins: Array, weight: Array, order: int = 3, turn: Iterable[float] = repeat(np.inf)
) -> list[Array]:
    """Return differences (m,) of rows of channels (n,) that follow each other, scaled to the noise of one raw sample.

    begins (n,): the row does not continue the one before; weight (n,): raw samples behind each row; turn: size of a
    full turn of channels that are angles, which may jump by one, infinite of others.
    """
    m = max(len(begins) - order, 0)
    whole, variance = np.ones(m, dtype=bool), np.zeros(m)
    for j in range(order + 1):
        variance += comb(order, j) ** 2 / weight[j : j + m]
        whole &= ~begins[j : j + m] if j else True
    scale, out = np.sqrt(variance[whole]), []
    for channel, full in zip(x, turn, strict=False):  # one after the other: each stays in the cache
        d = np.diff(channel, order)[whole]
        out.append((d - full * np.round(d / full) if np.isfinite(full) else d) / scale)
    return out


def white_sigma(x: Array, begins: Array, weight: Array) -> Array:
    """Return one sigma (C,) of one raw sample of rows x (n, C); 0 where no row follows another.

    From third differences; where no position has four rows from second ones, where none has three from first ones.
    """
    for order in (3, 2, 1):
        d = np.stack(scaled_differences(x.T, begins, weight, order), axis=1)
        if len(d):
            return np.asarray(np.sqrt(np.mean(d**2, axis=0)))
    return np.zeros(x.shape[1])
