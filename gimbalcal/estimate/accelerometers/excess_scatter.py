"""Scatter beyond the stated noise: how far positions scatter about a model, and which larger noise would explain it."""

from __future__ import annotations

from collections.abc import Container
from dataclasses import replace

import numpy as np

from gimbalcal.calibration import Counts
from gimbalcal.estimate.accelerometers.errors_in_variables import PositionFit, Problem
from gimbalcal.estimate.accelerometers.noise import RESIDUAL, deviance, fit_with_noise
from gimbalcal.estimate.accelerometers.position_outliers import acceptable
from gimbalcal.estimate.term_selection import MAX_SCATTER_RATIO
from gimbalcal.recording import Recording, dwell_means
from gimbalcal.recording.noise_levels import resolution
from gimbalcal.recording.record import FORCE
from gimbalcal.units import from_si


def noise_of_a_mean(recording: Recording, sample: float, counts: Counts | None = None) -> float:
    """Return the noise [m/s^2] of the mean of a position from that of a sample; 0 where it is unknown.

    Where samples scatter less than a step of the converter, their mean is no better than the step.
    """
    means = dwell_means(recording)
    if not means.sigma("accelerometer"):
        return 0.0
    own = sample / float(np.sqrt(np.median(means.weight)))
    scale = counts.scale if counts else (1.0, 1.0, 1.0)
    step = max(resolution(recording.channels[FORCE, a]) * k for a, k in zip("xyz", scale, strict=True))
    return float(max(own, step / np.sqrt(12))) if sample < step else own


def scatter_in_words(stated: Container[str], excess: float, own: float) -> str:
    """A sentence where positions scatter by `excess` [m/s^2] far beyond `own`, the noise of their means.

    stated: sensors whose noise the header states.
    """
    if not own or excess <= MAX_SCATTER_RATIO * own:
        return ""
    of = "stated noise" if "accelerometer" in stated else "scatter of the samples"
    return (
        f"the positions scatter by {excess:.2g} m/s^2 about the model, {excess / own:.2g} times what the {of} explains "
        f"({own:.2g} m/s^2 for the mean of a position)"
    )


def larger_noise_in_words(p: Problem, fit: PositionFit) -> str:
    """Words "explained only if ..." for a misfit that one larger noise, at its most likely size, explains; else empty.

    The setting repeatability is tried, and outputs that wander from one visit to the next.
    """
    s = fit.solution
    if not fit.steps or acceptable(s.chi2, s.dof):
        return ""
    found = []
    opened = {
        "setting": replace(fit.noise, setting_from=RESIDUAL),
        "accelerometer": replace(fit.noise, accelerometer_from=RESIDUAL),
    }
    for name, noise in opened.items():
        stated = getattr(fit.noise, name)
        if getattr(fit.noise, f"{name}_from") == RESIDUAL or not 0 < stated < np.inf:
            continue
        free = fit_with_noise(p, noise, s.x)
        times = getattr(free.noise, name) / stated
        if free.steps and times > 1 and acceptable(free.solution.chi2, free.solution.dof):
            found.append((deviance(free.linear, free.noise, p.parameters), name, times))
    if not found:
        return ""
    _, name, times = min(found)
    if name == "setting":
        return f"explained only if the setting repeatability is {times:.2g} times the stated"
    mean = fit.noise.accelerometer / np.sqrt(float(np.median(p.weight)))
    wander = from_si(float(np.sqrt(times**2 - 1) * mean), "ug")
    return f"explained only if the outputs wander by {wander:.2g} ug from one position to the next"
