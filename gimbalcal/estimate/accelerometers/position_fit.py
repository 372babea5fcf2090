r"""The fit of positions in noise that its header states, else its samples show, else the residual of the fit.

The noise of a sample shows inside the dwells. The setting repeatability of the gimbals shows only between them; where
the header does not state it, it is the value that maximises the likelihood of the residual with the calibration
parameters integrated out (REML),

.. math:: -2 \ln L = \sum \ln \sigma_i^2 + \ln |J^T W J| + \chi^2 .
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from gimbalcal.earth import G0
from gimbalcal.effects import Effect, Parameter
from gimbalcal.estimate.fit import MAX_PRIOR_SIGMAS, ViewsFit, fit
from gimbalcal.inference.information import prior
from gimbalcal.inference.noise_processes import one_sigma
from gimbalcal.number import Array
from gimbalcal.recording import Recording
from gimbalcal.recording.noise_levels import SETTING_SIGMA_RAD, header_noise, sample_sigma
from gimbalcal.recording.record import FORCE
from gimbalcal.views.core import View
from gimbalcal.views.local import VisitRows, eliminate
from gimbalcal.views.positions import Noise, by_visit, in_noise, numbers_of_visits

FIRST_SAMPLE_SIGMA = 1e-5 * G0  # m/s^2, start of the search
HEADER, SAMPLES, RESIDUAL, ATTITUDE = "header", "samples", "residual", "attitude unknown"


@dataclass(frozen=True)
class Fault:
    """Visits that do not belong where they are said to be: one mis-set, or two interchanged."""

    visits: tuple[int, ...]
    positions: tuple[int, ...]
    in_words: str


@dataclass(frozen=True, eq=False)
class Positions:
    """The fit of the force vector at visits that can be trusted, its noise, and the faults of the other visits.

    noise: of a sample and of a gimbal setting, as stated or as samples or the residual of the fit show.
    """

    fit: ViewsFit
    noise: Noise
    faults: tuple[Fault, ...] = ()

    @property
    def view(self) -> View:
        """Return the view of the positions."""
        return self.fit.views[0]

    @property
    def setting(self) -> Array:
        """Return the setting errors (m, k) [rad] of the visits."""
        return self.fit.local[0]

    @property
    def numbers(self) -> Array:
        """Return the number (m,) of the position of each visit."""
        return numbers_of_visits(self.view)

    @cached_property
    def rows(self) -> VisitRows:
        """Return the rows about the estimate, by visit; about the prior where the fit ran away and says nothing."""
        x = self.fit.x if self.fit.steps else prior(self.fit.parameters)[0]
        return by_visit(self.view, self.fit.absent, self.fit.parameters, x, self.setting)


def noise_of_positions(recording: Recording) -> Noise:
    """Noise as header and samples tell it; what neither tells is marked "residual" and a first guess."""
    stated = header_noise(recording)
    if FORCE in stated:
        force, source = one_sigma(stated[FORCE]), HEADER
    else:
        axes = [(FORCE, axis) for axis in recording.axes(FORCE)]
        force, source = recording.sigma("accelerometer") or 0.0, SAMPLES
        if not force:  # what neighbouring rows show, three axes pooled; 0 for one row a dwell
            shown = sample_sigma(replace(recording, noise={}), axes, recording.triad(FORCE))
            force = float(np.sqrt(np.mean(shown**2)))
    if "gimbal_angle" in stated:
        setting, setting_from = one_sigma(stated["gimbal_angle"]), HEADER
    else:
        setting, setting_from = SETTING_SIGMA_RAD, RESIDUAL
    return Noise(force or FIRST_SAMPLE_SIGMA, setting, source if force else RESIDUAL, setting_from)


def fit_in_noise(
    view: View, noise: Noise, wanted: Sequence[Parameter], absent: Sequence[Effect] = (), start: Array | None = None
) -> Positions:
    """Fit parameters and setting errors from `start` (p,), unless that is beyond what a unit can be."""
    mean, scale = prior(wanted)
    plausible = start is not None and np.all(np.abs(start - mean) <= MAX_PRIOR_SIGMAS * scale)
    return Positions(fit([in_noise(view, noise)], wanted, absent, start if plausible else mean), noise)


def fit_with_noise(
    view: View, noise: Noise, wanted: Sequence[Parameter], absent: Sequence[Effect] = (), start: Array | None = None
) -> Positions:
    """Fit, with what the noise does not state estimated from the residual (two rounds: the linearisation moves)."""
    p = fit_in_noise(view, noise, wanted, absent, start)
    if RESIDUAL in (noise.accelerometer_from, noise.setting_from):
        for _ in range(2):
            p = fit_in_noise(view, residual_noise(p), wanted, absent, p.fit.x)
            if not p.fit.steps:
                break
    return p


def residual_noise(p: Positions) -> Noise:
    """The noise that makes the residual of a fit most likely, over what header and samples left open."""
    from scipy.optimize import minimize

    sources = (("accelerometer", p.noise.accelerometer_from), ("setting", p.noise.setting_from))
    opened = [name for name, source in sources if source == RESIDUAL]
    start = np.log([getattr(p.noise, name) for name in opened])

    def cost(logs: Array) -> float:
        return noise_deviance(p, _with_sizes(p.noise, opened, logs))

    # two starts: the likelihood has a second, flat mode where all is put down to the other noise
    minima = [minimize(cost, start + shift, method="Nelder-Mead", options={"xatol": 1e-3}) for shift in (0.0, 4.0)]
    return _with_sizes(p.noise, opened, min(minima, key=lambda result: float(result.fun)).x)


def _with_sizes(noise: Noise, names: list[str], logs: Array) -> Noise:
    # 1e-12 to 1: an angle or a force beyond these is no noise; keeps the search inside the range of floats
    return replace(noise, **dict(zip(names, np.exp(np.clip(logs, -28, 0)).tolist(), strict=True)))


def noise_deviance(p: Positions, noise: Noise) -> float:
    """Return -2 ln of the restricted likelihood of a noise, the parameters under their prior, up to a constant."""
    w = eliminate(p.rows, (noise.accelerometer / p.noise.accelerometer) ** 2, noise.setting**2)
    mean, scale = prior(p.fit.parameters)
    J, r = w.rows
    rows = np.concatenate([J * scale, np.eye(scale.size)])
    R = np.linalg.qr(np.column_stack([rows, np.concatenate([r - J @ mean, np.zeros(scale.size)])]), mode="r")
    diagonal = np.abs(np.diag(R))
    sigma = w.sigma[np.isfinite(w.sigma)]
    inside = w.r_inside.size - (3 * len(w.r) if w.r_inside.size else 0)
    spread = np.log(sigma).sum() + inside * np.log(noise.accelerometer)
    return float(2 * spread + 2 * np.log(diagonal[:-1]).sum() + diagonal[-1] ** 2)
