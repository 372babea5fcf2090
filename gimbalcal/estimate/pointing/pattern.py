r"""Whether what is left of the stars follows an angle of the mount: neighbours along it are alike.

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

FOLLOWS = 1e-3  # probability, all trials paid, below which neighbours are no more alike by chance
FEWEST = 20  # stars in which a pattern can be told from chance


@dataclass(frozen=True)
class Pattern:
    """What is left across or along that follows an axis of the mount, and the probability that noise looks so."""

    channel: str
    axis: str
    probability: float


def pattern(found: Fit, axes: Sequence[str]) -> Pattern | None:
    """The clearest pattern of what a fit leaves over the true angles of its axes; None where noise may look so."""
    from scipy.stats import norm

    left = np.concatenate(found.residuals)
    if len(left) < FEWEST:
        return None
    trials = []
    for axis in axes:
        order = np.argsort(np.concatenate([r.channels["true_angle", axis] for r in found.runs]), kind="stable")
        for (_, channel), r in zip(CHANNELS, left[order].T, strict=True):
            alike = 2 - (np.diff(r) ** 2).sum() / max(float((r**2).sum()), 1e-300)
            trials.append(Pattern(channel, axis, float(norm.sf(alike / np.sqrt(4 / len(r))))))
    best = min(trials, key=lambda t: t.probability)
    p = min(1.0, len(trials) * best.probability)
    return Pattern(best.channel, best.axis, p) if p < FOLLOWS else None
