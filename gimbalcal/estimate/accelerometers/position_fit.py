r"""The fit of positions in noise that its header states, else its samples show, else the residual of the fit.

The noise of a sample shows inside the dwells. The setting repeatability of the gimbals shows only between them; where
the header does not state it, it is the value that maximises the likelihood of the residual with the calibration
parameters integrated out (REML),

.. math:: -2 \ln L = \sum \ln \sigma_i^2 + \ln |J^T W J| + \chi^2 .
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gimbalcal.earth import G0
from gimbalcal.effects import Parameter
from gimbalcal.estimate.fit import MAX_PRIOR_SIGMAS, fit
from gimbalcal.inference.information import Solution, prior
from gimbalcal.inference.noise_processes import one_sigma
from gimbalcal.number import Array
from gimbalcal.recording import Recording
from gimbalcal.recording.noise_levels import header_noise, sample_sigma
from gimbalcal.recording.record import FORCE
from gimbalcal.views.local import VisitRows
from gimbalcal.views.positions import Noise, Problem, by_visit, view_of_positions, whiten

FIRST_SETTING_RAD = np.deg2rad(1 / 3600)  # rad, start of the search: what a good gimbal repeats to
FIRST_SAMPLE_SIGMA = 1e-5 * G0  # m/s^2, start of the search
HEADER, SAMPLES, RESIDUAL, ATTITUDE = "header", "samples", "residual", "attitude unknown"


@dataclass(frozen=True, eq=False)
class PositionFit:
    """A converged fit: its solution, the setting errors (m, k) [rad] and the last linearisation."""

    solution: Solution
    setting: Array
    linear: VisitRows
    noise: Noise
    steps: int  # 0 where it did not converge


def noise_of_positions(recording: Recording) -> Noise:
    """Noise as header and samples tell it; what neither tells is marked "residual" and a first guess."""
    stated = header_noise(recording)
    if FORCE in stated:
        force, source = one_sigma(stated[FORCE]), HEADER
    else:
        force, source = recording.sigma("accelerometer") or inside_dwells(recording), SAMPLES
    if not recording.platform.axes:
        setting, setting_from = np.inf, ATTITUDE
    elif "gimbal_angle" in stated:
        setting, setting_from = one_sigma(stated["gimbal_angle"]), HEADER
    else:
        setting, setting_from = FIRST_SETTING_RAD, RESIDUAL
    return Noise(force or FIRST_SAMPLE_SIGMA, setting, source if force else RESIDUAL, setting_from)


def inside_dwells(recording: Recording) -> float:
    """One sigma of a raw sample from what neighbouring rows show, three axes pooled; 0 for one row a dwell."""
    axes = [(FORCE, axis) for axis in recording.axes(FORCE)]
    shown = sample_sigma(replace(recording, noise={}), axes, recording.triad(FORCE))
    return float(np.sqrt(np.mean(shown**2)))


def gauss_newton(p: Problem, noise: Noise, start: Array | None = None) -> PositionFit:
    """Fit parameters and setting errors; `steps` is 0 where the fit runs away."""
    mean, scale = prior(p.parameters)
    plausible = start is not None and np.all(np.abs(start - mean) <= MAX_PRIOR_SIGMAS * scale)
    fitted = fit([view_of_positions(p, noise)], p.parameters, p.effects, start if plausible else mean)
    linear = by_visit(p, fitted.x if fitted.steps else mean, fitted.local[0])  # where it ran away nothing can be read
    return PositionFit(fitted.solution, fitted.local[0], linear, noise, fitted.steps)


def fit_with_noise(p: Problem, noise: Noise, start: Array | None = None) -> PositionFit:
    """Fit, with what the noise does not state estimated from the residual (two rounds: the linearisation moves)."""
    fit = gauss_newton(p, noise, start)
    if RESIDUAL in (noise.accelerometer_from, noise.setting_from):
        for _ in range(2):
            fit = gauss_newton(p, residual_noise(p, fit), fit.solution.x)
            if not fit.steps:
                break
    return fit


def residual_noise(p: Problem, fit: PositionFit) -> Noise:
    """The noise that makes the residual of a fit most likely, over what header and samples left open."""
    from scipy.optimize import minimize

    opened = [
        name
        for name, source in (("accelerometer", fit.noise.accelerometer_from), ("setting", fit.noise.setting_from))
        if source == RESIDUAL
    ]
    start = np.log([getattr(fit.noise, name) for name in opened])

    def cost(logs: Array) -> float:
        return deviance(fit.linear, _with(fit.noise, opened, logs), p.parameters)

    # two starts: the likelihood has a second, flat mode where all is put down to the other noise
    minima = [minimize(cost, start + shift, method="Nelder-Mead", options={"xatol": 1e-3}) for shift in (0.0, 4.0)]
    return _with(fit.noise, opened, min(minima, key=lambda result: float(result.fun)).x)


def _with(noise: Noise, names: list[str], logs: Array) -> Noise:
    # 1e-12 to 1: an angle or a force beyond these is no noise; keeps the search inside the range of floats
    return replace(noise, **dict(zip(names, np.exp(np.clip(logs, -28, 0)).tolist(), strict=True)))


def deviance(linear: VisitRows, noise: Noise, parameters: Sequence[Parameter]) -> float:
    """Return -2 ln of the restricted likelihood with the parameters under their prior, up to a constant."""
    w = whiten(linear, noise)
    mean, scale = prior(parameters)
    J = np.concatenate([w.J.reshape(-1, scale.size), w.J_inside.reshape(-1, scale.size)])
    r = np.concatenate([np.concatenate([w.r.ravel(), w.r_inside.ravel()]) - J @ mean, np.zeros(scale.size)])
    rows = J * scale
    R = np.linalg.qr(np.column_stack([np.concatenate([rows, np.eye(scale.size)]), r]), mode="r")
    diagonal = np.abs(np.diag(R))
    sigma = w.sigma[np.isfinite(w.sigma)]
    inside = w.r_inside.size - (3 * len(w.r) if w.r_inside.size else 0)
    spread = np.log(sigma).sum() + inside * np.log(noise.accelerometer)
    return float(2 * spread + 2 * np.log(diagonal[:-1]).sum() + diagonal[-1] ** 2)
