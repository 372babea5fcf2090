r"""Which rows of information to take: D- and A-optimal subsets of candidates, by greedy starts and exchanges.

Candidate c brings rows A_c in units of its noise and of the priors, so that information adds, F = I + sum A_c^T A_c.
D maximises log det F (the volume of what is left uncertain), A minimises tr F^{-1} (its mean square in units of the
priors), position minimises tr S F^{-1} S^T, S the answer of a navigator's position to the parameters.
A greedy start and random ones are improved by exchanging candidates until none helps (Fedorov 1972).
"""

from __future__ import annotations

import numpy as np

from gimbalcal.number import Array

CRITERIA = ("D", "A", "position")
STARTS = 10  # one greedy, the others by chance
ROUNDS = 20  # of exchanges; a handful leave nothing to exchange


def optimise(rows: Array, count: int, criterion: str, interest: Array, seed: int) -> Array:
    """Indices (count,) of the candidates (c, 3, p) that are best; interest: which parameters (p,), or S (q, p)."""
    rng = np.random.default_rng(seed)
    begin = [_greedy(rows, count, criterion, interest), *(rng.integers(0, len(rows), count) for _ in range(STARTS - 1))]
    found = [_exchange(rows, chosen, criterion, interest) for chosen in begin]
    best = max(found, key=lambda chosen: value(rows[chosen], criterion, interest))
    return np.sort(best)


def value(rows: Array, criterion: str, interest: Array) -> float:
    """The criterion (larger is better) of positions with rows (n, 3, p)."""
    F = np.eye(rows.shape[-1]) + np.einsum("cip,ciq->pq", rows, rows)
    P = _of(_of(np.linalg.inv(F), interest).T, interest)
    return float(-np.linalg.slogdet(P)[1] if criterion == "D" else -np.trace(P))


def _of(x: Array, interest: Array) -> Array:
    """Columns (..., p) of the parameters of interest, or what they are together."""
    return np.asarray(x[..., interest] if interest.dtype == bool else x @ interest.T)


def gains(rows: Array, F: Array, criterion: str, interest: Array) -> Array:
    """What adding each candidate (c, 3, p) to information F (p, p) would be worth."""
    P = np.linalg.inv(F)
    AP = rows @ P
    middle = np.linalg.inv(np.eye(rows.shape[1]) + AP @ np.swapaxes(rows, -1, -2))
    if criterion != "D":
        part = _of(AP, interest)
        return np.einsum("cip,cij,cjp->c", part, middle, part)
    full = -np.linalg.slogdet(middle)[1]
    if interest.all():
        return np.asarray(full)
    other = rows[..., ~interest]
    Pn = np.linalg.inv(F[np.ix_(~interest, ~interest)])
    return full - np.linalg.slogdet(np.eye(rows.shape[1]) + other @ Pn @ np.swapaxes(other, -1, -2))[1]


def _greedy(rows: Array, count: int, criterion: str, interest: Array) -> Array:
    F, chosen = np.eye(rows.shape[-1]), []
    for _ in range(count):
        best = int(np.argmax(gains(rows, F, criterion, interest)))
        chosen.append(best)
        F = F + rows[best].T @ rows[best]
    return np.array(chosen)


def _exchange(rows: Array, chosen: Array, criterion: str, interest: Array) -> Array:
    chosen = np.array(chosen)
    F = np.eye(rows.shape[-1]) + np.einsum("cip,ciq->pq", rows[chosen], rows[chosen])
    for _ in range(ROUNDS):
        moved = False
        for i in range(len(chosen)):
            without = F - rows[chosen[i]].T @ rows[chosen[i]]
            worth = gains(rows, without, criterion, interest)
            best = int(np.argmax(worth))
            # an exchange must pay by more than rounding, or equal positions would swap for ever
            if worth[best] > worth[chosen[i]] * (1 + 1e-9) + 1e-12:
                chosen[i], moved = best, True
                F = without + rows[best].T @ rows[best]
        if not moved:
            break
    return chosen
