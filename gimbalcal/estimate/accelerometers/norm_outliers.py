r"""Rests that do not belong among the others where no angle is known: a number off by one, a reading wrong, a knock.

Rests are left out, one or two of them in every possible way, and of many rests more, those that fit worst without each
other (the concentration steps of Rousseeuw and Van Driessen, 1999). An ellipsoid is laid through the others without
iteration, so that nothing is dragged by what is wrong:

.. math:: u^T Q u + q^T u = 1 + \rho, \qquad |h^{-1}(u)| = \sqrt{1 + s \rho}, \quad
          s = 1 / (1 + \tfrac14 q^T Q^{-1} q)

What it says of the norm of a rest k is held against what the others leave, s_(k), and how well they can tell it at
all, G being their normal matrix and d the row of the point of the ellipsoid in the direction of k:

.. math:: \frac{|\,|h^{-1}(u_k)| - 1\,|}{s_{(k)} \sqrt{1 + d^T G^{-1} d}} > t

(the deleted residual, studentised), t of Student's distribution, and never less than `MIN_OUTLIER_SIGMAS`.
One that is off by so much tells nothing of the sensors, and would scale every sigma. A misfit that several rests share
is missing physics, and none of them is blamed for it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from math import comb
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gimbalcal.errors import list_of_alternatives
from gimbalcal.inference.ellipsoid import MIN_POINTS, design, matrix, scale_of_deviation
from gimbalcal.number import Array
from gimbalcal.recording import Recording, dwell_means
from gimbalcal.recording.record import FORCE
from gimbalcal.units import from_si

MIN_OUTLIER_SIGMAS = 10.0  # sigmas; heavy tails reach half of it in a hundred recordings
SIGNIFICANCE = 1e-6  # probability, choices of rests paid, by which chance is not believed
MAX_OUTLIERS, MAX_SHARE = 2, 1 / 30  # or that share of many rests: of more, one could not say which are the reference
CONCENTRATIONS = 10  # steps to the rests that fit worst where these are left out, more than can be tried in every way
MAX_SUSPECTS = 40  # rests, those that fit worst with all others: where there are more, two outliers drag a fit little
MIN_SPARE_DWELLS = 4  # rests beyond the parameters: with fewer, leaving one out tests nothing
RIDGE = 0.01  # noise of 1e-3 over a prior of 0.1: what turns do not show of a unit, as six faces do not, is small
SPHERE = np.array([1.0, 1, 1, 0, 0, 0, 0, 0, 0])


@dataclass(frozen=True)
class NormOutlier:
    """A rest: its ordinal among the dwells, its position number, and how far its norm is off [m/s^2]."""

    dwell: int
    position: int
    off: float


def norm_outliers(recording: Recording) -> tuple[NormOutlier, ...]:
    """Return the dwells whose norm does not fit the others, `MAX_OUTLIERS` or `MAX_SHARE` of them at most.

    None where the others do not fit each other without them either.
    """
    every = dwell_means(recording)
    y, g, position = every.triad(FORCE), every.site.gravity, every.position
    if position is None or not np.isfinite(y).all():
        return ()
    unit = None if every.counted(FORCE) else g
    noise = (every.sigma("accelerometer") or 0.0) / np.sqrt(every.weight)
    remaining, outliers = np.arange(len(every.time)), dict[int, float]()
    most = max(MAX_OUTLIERS, int(MAX_SHARE * len(y)))
    while len(outliers) <= most:
        # Several outliers hide each other from a test of one.
        sets = (_deviating_rests(y, unit, noise, remaining, k) for k in range(1, most + 1))
        more = next(filter(None, sets), {})
        if not more:
            return tuple(NormOutlier(k, int(position[k]), g * off) for k, off in sorted(outliers.items()))
        outliers |= more
        remaining = np.setdiff1d(remaining, list(more))
    return ()


def _deviating_rests(
    y: Array, unit: float | None, noise: Array, remaining: NDArray[np.int64], several: int
) -> dict[int, float]:
    """The rests without which the others agree best, and how far they are off [g]; empty where one of them is not.

    y (m, 3), noise (m,): forces of all rests and their noise, of which 1 g is `unit`, or unknown in counts (None).
    """
    m = len(remaining)
    if m < MIN_POINTS + MIN_SPARE_DWELLS + several - 1:
        return {}
    worst = _worst(y[remaining], unit, np.zeros(0, dtype=int))
    if several <= MAX_OUTLIERS:
        choices = np.array(list(combinations(np.sort(worst[:MAX_SUSPECTS]), several)))
    else:
        for _ in range(CONCENTRATIONS):
            worst = _worst(y[remaining], unit, worst[:several])
        choices = worst[None, :several]
    through = _ellipsoids_without(y[remaining], unit, _without(m, choices))
    best = int(np.argmin(through.usual))
    if not np.isfinite(through.usual[best]):
        return {}
    gone = choices[best]
    off, tied = _against_others(through, best, gone)
    from scipy.special import stdtrit

    least = max(MIN_OUTLIER_SIGMAS, -float(stdtrit(m - several - MIN_POINTS, SIGNIFICANCE / comb(m, several))))
    noise_rms = noise[remaining[gone]] / through.size[best]
    sigmas = np.abs(off) / np.hypot(through.usual[best] * np.sqrt(1 + tied), noise_rms)
    return dict(zip(remaining[gone].tolist(), off.tolist(), strict=True)) if np.all(sigmas > least) else {}


def _worst(y: Array, unit: float | None, gone: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the rests y (m, 3), from the one that lies farthest from the ellipsoid through all but those gone."""
    return np.argsort(-np.abs(_ellipsoids_without(y, unit, _without(len(y), gone[None])).rho[0]))


def _without(m: int, choices: NDArray[np.int64]) -> Array:
    """Return which of m rests are kept (r, m) without those of each choice (r, k)."""
    kept = np.ones((len(choices), m))
    np.put_along_axis(kept, choices, 0.0, axis=1)
    return kept


class _Ellipsoids(NamedTuple):
    """Ellipsoids through r choices of m rests.

    Points u (r, m, 3), what 1 is in the unit of the readings (r,), coefficients (r, 9) with their normal matrices
    (r, 9, 9), rho (r, m) and s (r,), and what the rests that were chosen leave of the norm (r,), infinite where they
    lie on no ellipsoid.
    """

    u: Array
    size: Array
    c: Array
    normal: Array
    rho: Array
    s: Array
    usual: Array


def _ellipsoids_without(y: Array, unit: float | None, kept: Array) -> _Ellipsoids:
    """Through the rests that are kept (r, m)."""
    u, size = _unit_sphere_points(y, unit, kept)
    A = design(u)
    G = np.swapaxes(A * kept[..., None], -1, -2) @ A + RIDGE**2 * np.eye(MIN_POINTS)
    lacks = (1 - A @ SPHERE) * kept
    c = SPHERE + np.linalg.solve(G, (lacks[:, None] @ A)[:, 0, :, None])[..., 0]
    rho = (A @ c[..., None])[..., 0] - 1
    Q, q = matrix(c), c[:, 6:]
    closed = np.linalg.eigvalsh(Q)[:, 0] > RIDGE
    Q = np.where(closed[:, None, None], Q, np.eye(3))
    s = scale_of_deviation(Q, q)
    norm = np.sqrt(np.maximum(1 + s[:, None] * rho, 0.0))
    square = (kept * (norm - 1) ** 2).sum(-1) / (kept.sum(-1) - MIN_POINTS)
    return _Ellipsoids(u, size, c, G, rho, s, np.where(closed, np.sqrt(square), np.inf))


def _unit_sphere_points(y: Array, unit: float | None, kept: Array) -> tuple[Array, Array]:
    """Readings (r, m, 3) as points about the unit sphere, and what 1 is in their unit (r,).

    Counts have their middle and size from the rests that are kept (r, m).
    """
    y, r = y[None], len(kept)
    if unit is not None:
        return np.repeat(y / unit, r, axis=0), np.full(r, unit)
    there = kept[..., None] > 0
    high, low = np.where(there, y, -np.inf).max(1), np.where(there, y, np.inf).min(1)
    size = (high - low).mean(-1) / 2
    return (y - (high + low)[:, None] / 2) / size[:, None, None], size


def _against_others(through: _Ellipsoids, i: int, rests: NDArray[np.int64]) -> tuple[Array, Array]:
    """Return the relative deviation (k,) of the norm of rests from choice i, and its leverage d^T G^-1 d."""
    c = through.c[i]
    middle = -np.linalg.solve(matrix(c), c[6:]) / 2
    norm = np.sqrt(np.maximum(1 + through.s[i] * through.rho[i, rests], 0.0))
    # a wrong reading tells nothing of its own leverage: it stands where no rest is
    d = design(middle + (through.u[i, rests] - middle) / np.maximum(norm, RIDGE)[:, None])
    return norm - 1, (d * np.linalg.solve(through.normal[i], d.T).T).sum(-1)


def norm_outliers_in_words(outliers: Sequence[NormOutlier]) -> list[str]:
    """One sentence about the rests that were left out, in a list; empty where none was."""
    if not outliers:
        return []
    worst = max(outliers, key=lambda s: abs(s.off))
    which = list_of_alternatives([str(s.position) for s in outliers]).replace(" or ", " and ")
    one = len(outliers) == 1
    size = f"{abs(from_si(worst.off, 'mg')):.3g} mg"
    off = f"off what all others say by {'' if one else 'up to '}{size} of the norm"
    who = f"position {which} is" if one else f"positions {which} are"
    return [f"{who} {off}: no rest, or wrongly numbered or read; left out of the fit"]
