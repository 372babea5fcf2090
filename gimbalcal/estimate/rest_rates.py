r"""Gyroscopes at rest: what their mean outputs say of bias and of what follows the pose.

A unit at rest in many attitudes reads its bias, plus what gravity does to it,

.. math:: y_k = \varepsilon + G f_k + \nu_k, \qquad \nu_k \sim \sigma / \sqrt{n_k} ,

with f_k the calibrated force of rest k and n_k its samples. G learned there is tested on what it has not seen: the
turns between the rests, where the gyroscopes must carry the direction of gravity from one rest to the next.
The Earth's rate (15 deg/h, of unknown direction) is part of the scatter.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gimbalcal.calibration import Calibration
from gimbalcal.correction import correct
from gimbalcal.effects import CATALOGUE, Effect, Parameter, Stimulus, parameters, with_values
from gimbalcal.estimate.poses import LINEAR, fit_turns, turns
from gimbalcal.forward import gyroscopes
from gimbalcal.kinematics import stimulus
from gimbalcal.number import STEP, Array
from gimbalcal.recording import Recording, dwell_means, dwells

RATE, FORCE = "angular_rate", "specific_force"
TERMS = ("gyro_bias", "gyro_g_sensitivity_rate")


@dataclass(frozen=True, eq=False)
class Rests:
    """Mean rates (m, 3) [rad/s] at rest with one sigma of each (m, 3), and what the unit felt there."""

    rate: Array
    sigma: Array
    stimulus: Stimulus


@dataclass(frozen=True, eq=False)
class RestFit:
    """Effects fitted to rests: values (p,) and covariance (p, p) in SI, misfit (m, 3) [rad/s], chi^2 / dof by axis."""

    effects: tuple[Effect, ...]
    parameters: tuple[Parameter, ...]
    x: Array
    covariance: Array
    misfit: Array
    chi2: Array


def rests(recording: Recording, accelerometers: Calibration, scale: float = 1.0) -> Rests:
    """The rests of a recording; `scale` is rad/s per unit of a raw output, see `poses.turns`."""
    means = dwell_means(correct(accelerometers, recording))
    rows = dwell_means(recording)
    y = recording.triad(RATE)
    inside = np.concatenate([y[d.rows] - y[d.rows].mean(0) for d in dwells(recording)])
    sigma = np.sqrt((inside**2).mean(0)) / np.sqrt(rows.weight)[:, None]
    s = stimulus(means)
    return Rests(scale * rows.triad(RATE), scale * sigma, s.at(force=means.triad(FORCE), rate=0 * s.rate))


def fit_rests(found: Rests, terms: Sequence[str] = TERMS) -> RestFit:
    """Weighted least squares of gyroscope effects, which are linear at rest."""
    wanted = tuple(p for t in terms for p in parameters(CATALOGUE[t]))
    none = np.zeros(len(wanted))
    zero = 0 * found.rate
    scale = np.array([p.sigma for p in wanted])
    probes = [with_values((), wanted, none + 1j * STEP * u) for u in np.eye(len(none))]
    J = np.stack([gyroscopes(zero, found.stimulus, e).imag / STEP for e in probes], axis=-1)
    A = (J / found.sigma[..., None]).reshape(-1, len(none)) * scale
    U, S, Vt = np.linalg.svd(A, full_matrices=False)
    x = (Vt.T @ ((U.T @ (found.rate / found.sigma).ravel()) / S)) * scale
    covariance = (Vt.T / S**2) @ Vt * np.outer(scale, scale)
    misfit = found.rate - J @ x
    used = np.array([np.any(J[:, i] != 0, axis=0).sum() for i in range(3)])
    chi2 = ((misfit / found.sigma) ** 2).sum(axis=0) / (len(misfit) - used)
    return RestFit(with_values((), wanted, x), wanted, x, covariance, misfit, chi2)


def carried(recording: Recording, accelerometers: Calibration, at_rest: Sequence[Effect] = ()) -> Array:
    """Angle (m,) [rad] by which gravity is missed after each turn, scale factors and misalignments fitted to the turns.

    `at_rest`: effects that tell the output at rest; without them it is the mean of the rests before and after.
    """
    turned, _, _ = turns(recording, accelerometers, at_rest)
    return np.asarray(np.linalg.norm(fit_turns(turned, LINEAR).misfit, axis=1))
