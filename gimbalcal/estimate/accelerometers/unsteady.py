"""Positions that scatter about a model more than their samples: what is ordinary, and what a model misses."""

from __future__ import annotations

import numpy as np

from gimbalcal.calibration import Counts
from gimbalcal.estimate.support import UNSTEADY
from gimbalcal.recording import Recording, dwell_means
from gimbalcal.recording.noise import resolution
from gimbalcal.recording.record import FORCE


def noise_of_a_mean(recording: Recording, sample: float, counts: Counts | None = None) -> float:
    """What the noise of a sample [m/s^2], stated or seen, makes of the mean of a position; 0 where nothing tells it.

    Where samples scatter less than a step of the converter, their mean is no better than the step.
    """
    means = dwell_means(recording)
    if not means.sigma("accelerometer"):
        return 0.0
    own = sample / float(np.sqrt(np.median(means.weight)))
    scale = counts.scale if counts else (1.0, 1.0, 1.0)
    step = max(resolution(recording.channels[FORCE, a]) * k for a, k in zip("xyz", scale, strict=True))
    return float(max(own, step / np.sqrt(12))) if sample < step else own


def scatter_in_words(recording: Recording, excess: float, own: float) -> str:
    """A sentence where positions scatter by `excess` [m/s^2] far beyond `own`, the noise of their means."""
    if not own or excess <= UNSTEADY * own:
        return ""
    of = "stated noise" if "accelerometer" in recording.noise else "scatter of the samples"
    return (
        f"the positions scatter by {excess:.2g} m/s^2 about the model, {excess / own:.2g} times what the {of} explains "
        f"({own:.2g} m/s^2 for the mean of a position)"
    )
