r"""What is left of the stars that is no noise: it follows an angle of the mount, or a star is far off the others.

Neighbours along an angle are alike where something follows it,

.. math:: V = \frac{\sum_i (r_{i+1} - r_i)^2}{\sum_i r_i^2}, \qquad
          z = \frac{2 - V}{\sqrt{4 / n}} \sim N(0, 1) \text{ of noise, } r \text{ in the order of the angle}

Both directions on the sky against both axes are four trials. Source: von Neumann, Annals of Mathematical Statistics 12
(1941) 367.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gimbalcal.estimate.pointing.fit import Fit
from gimbalcal.estimate.pointing.run import CHANNELS
from gimbalcal.number import Array

FOLLOWS = 1e-3  # probability, all trials paid, below which neighbours are no more alike by chance
LEAST = 1e-3  # rad; an axis that travels less stood still
FEWEST = 20  # stars in which a pattern can be told from chance
FAR = 7.0  # robust sigmas; a star further off is another star, or was not centred
MEDIAN_LENGTH = 1.1774  # of a plane vector of normal noise with sigma 1: the median of Rayleigh's distribution


@dataclass(frozen=True)
class Pattern:
    """What is left across or along that follows an axis of the mount, and the probability that noise looks so."""

    channel: str
    axis: str
    probability: float


def far_off(found: Fit, before: Sequence[int]) -> tuple[tuple[str, int, float], ...]:
    """Title of the run, number of the star from 1 and its distance [rad] of stars far off the others, worst first.

    before: how many stars of the same recording come before each run, which is one night of it.
    """
    every = [(run.title, k + n + 1, d) for run, k, left in zip(found.runs, before, found.weighted, strict=True)
             for n, d in enumerate(np.linalg.norm(left, axis=1).tolist())]  # fmt: skip
    return tuple(every[k] for k in strays(np.concatenate(found.weighted)))


def strays(left: Array) -> list[int]:
    """Ordinals of stars far off the others by what is left of them (n, 2), worst first."""
    length = np.linalg.norm(left, axis=1)
    if len(length) < FEWEST:
        return []
    far = np.flatnonzero(length > FAR * float(np.median(length)) / MEDIAN_LENGTH)
    return sorted(far.tolist(), key=lambda k: -float(length[k]))


def pattern(found: Fit, axes: Sequence[str]) -> Pattern | None:
    """The clearest pattern of what a fit leaves over the true angles of its axes; None where noise may look so."""
    from scipy.special import ndtr

    left = np.concatenate(found.weighted)
    if len(left) < FEWEST:
        return None
    trials = []
    for axis in axes:
        angle = np.concatenate([r.channels["true_angle", axis] for r in found.runs])
        if np.ptp(angle) < LEAST:
            continue
        order = np.argsort(angle, kind="stable")
        for (_, channel), r in zip(CHANNELS, left[order].T, strict=True):
            alike = 2 - (np.diff(r) ** 2).sum() / max(float((r**2).sum()), 1e-300)
            trials.append(Pattern(channel, axis, float(ndtr(-alike / np.sqrt(4 / len(r))))))
    if not trials:
        return None
    best = min(trials, key=lambda t: t.probability)
    p = min(1.0, len(trials) * best.probability)
    return Pattern(best.channel, best.axis, p) if p < FOLLOWS else None
