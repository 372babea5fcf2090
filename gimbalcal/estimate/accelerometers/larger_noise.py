"""Which larger noise would explain what a fit leaves: gimbals that repeat worse than stated, outputs that wander."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gimbalcal.estimate.accelerometers.misset import acceptable
from gimbalcal.estimate.accelerometers.noise import RESIDUAL, deviance, fit_with_noise
from gimbalcal.estimate.accelerometers.setting import PositionFit, Problem
from gimbalcal.units import from_si


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
