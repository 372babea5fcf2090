"""What the differences of Eq. (30) say about its nine unknowns, in numbers.

Turning at a speed w both ways with the Earth's vertical rate w_e along the axis,

    N+ = w / K1 + d,   N- = -w / K1 + d,   d = (w_e - bias) / K1 - K2 w^2 / K1^3,   N+^2 - N-^2 = 4 w d / K1

to first order. Without Earth, bias and K2 the columns of the three K2 vanish and the rank is six; with them it is nine.
The column of K2 is small and, what matters more, passes through zero within the range of the draws: sigma goes as
1 / |w_e - bias - K2 w^2 / K1^2|. An estimate with such tails has no settled RMS over 500 draws: a few make it.

The paper prints neither speed, site nor axes: 10 deg/s, 32 deg north and the nine axes of its rule (three input axes,
six between two) are ours.
"""

from __future__ import annotations

from functools import cache
from math import radians, sin
from typing import Any

import numpy as np

SPEED = radians(10.0)
EARTH = 7.292115e-5 * sin(radians(32.0))  # rad/s up
RUNS, TURNTABLES = 500, 3
_H = 0.5**0.5
AXES = np.array(
    [(1, 0, 0), (0, 1, 0), (0, 0, 1), (_H, _H, 0), (_H, -_H, 0), (_H, 0, _H), (_H, 0, -_H), (0, _H, _H), (0, _H, -_H)]
)
RANGE_K2 = radians(5e-17)  # rad/s per pulse^2, Table 3


def draws(n: int, seed: int = 0) -> tuple[Any, ...]:
    """Return K1, K2, bias, E (n, 3) each from the ranges of Table 3, rad."""
    rng = np.random.default_rng(seed)
    low = (radians(1e-7), -RANGE_K2, radians(-5e-6), -5e-4)
    high = (radians(5e-7), RANGE_K2, radians(5e-6), 5e-4)
    return tuple(rng.uniform(a, b, (n, 3)) for a, b in zip(low, high, strict=True))


def columns(K1: Any, K2: Any, bias: Any, E: Any, earth: float = EARTH) -> Any:
    """Return derivatives (n, 9 axes, 9) of P / (2 theta)^2 by ln K1, K2 over its range, and E: Eqs. (32) to (34),
    exact.
    """
    C = np.zeros((len(K1), 3, 3))
    C[:, [0, 1, 2], [0, 1, 2]] = 1
    C[:, 1, 0], C[:, 2, 0], C[:, 2, 1] = E.T
    k1, k2 = K1[:, None], K2[:, None]

    def count(sense: float) -> Any:
        rate = np.einsum("nij,kj->nki", np.linalg.inv(C), (sense * SPEED + earth) * AXES) - bias[:, None]
        return 2 * rate / (k1 + np.sqrt(k1**2 + 4 * k2 * rate))  # the root near the linear one

    one, other = count(1.0), count(-1.0)
    S, Q = one - other, one**2 - other**2
    along = k1 * S + k2 * Q
    turned = np.einsum("nij,nkj->nki", C, along)
    back = np.einsum("nkj,nji->nki", turned, C)
    leaning = np.stack(
        [turned[..., 1] * along[..., 0], turned[..., 2] * along[..., 0], turned[..., 2] * along[..., 1]], -1
    )
    return 2 * np.concatenate([back * S * k1, back * Q * RANGE_K2, leaning], axis=-1) / (2 * SPEED) ** 2


def rank(J: Any) -> int:
    """Return the rank of one run's columns, each scaled to length one where it is not zero."""
    size = np.sqrt((J**2).sum(0))
    return int(np.linalg.matrix_rank(J / np.where(size > 0, size, 1), tol=1e-9))


@cache
def ranks() -> tuple[int, int]:
    """Return the lowest rank over 200 draws with Earth and bias; rank without Earth, bias and K2."""
    K1, K2, bias, E = draws(200)
    return min(map(rank, columns(K1, K2, bias, E))), rank(columns(K1, 0 * K2, 0 * bias, E, 0.0)[0])


@cache
def conditions() -> tuple[float, float]:
    """Return the median over the draws of sigma(K2) over its range by sigma(ln K1), and the ratio of 99 % to median
    sigma(K2).
    """
    sigma = _sigmas(2000, 1)
    return float(np.median(sigma[:, 3:6] / sigma[:, :3])), float(
        np.quantile(sigma[:, 3:6], 0.99) / np.median(sigma[:, 3:6])
    )


def _sigmas(n: int, seed: int) -> Any:
    """Return one standard deviation (n, 9) of each draw for equal noise of the nine rows: the Cramer-Rao bound."""
    J = columns(*draws(n, seed))
    return np.sqrt(np.diagonal(np.linalg.inv(np.swapaxes(J, 1, 2) @ J), axis1=1, axis2=2))


@cache
def chance() -> Any:
    """Return (9,) factor by which the largest of three RMS of 500 draws exceeds the smallest, one time in twenty."""
    triples = 40
    sigma = _sigmas(triples * TURNTABLES * RUNS, 2)
    error = sigma * np.random.default_rng(3).standard_normal(sigma.shape)
    rms = np.sqrt((error.reshape(triples, TURNTABLES, RUNS, 9) ** 2).mean(2))
    return np.quantile(rms.max(1) / rms.min(1), 0.95, axis=0)
