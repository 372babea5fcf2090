r"""Gyroscopes at rest: what their mean outputs say of bias and of what follows the attitude.

A unit at rest in many attitudes reads its bias, what gravity does to it, and the Earth,

.. math:: y_k = \varepsilon + G f_k + \Omega \sin L \, f_k / g + \Omega \cos L \, n_k + \nu_k,
          \qquad \nu_k^2 \sim \sigma^2 / n_k + \sigma_w^2 ,

with f_k the calibrated force of rest k, n_k its samples and sigma_w what a wandering bias adds. The Earth's vertical
part is exactly a g-sensitivity common to all axes: it is taken off where the latitude is known, and where it is not,
G_xx = G_yy = G_zz is uncertain by it (15 deg/h/g over the square root of 3). North is not known: where turns join the
rests, what is horizontal is two unknowns beside the effects (`heading`), and scatter elsewhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gimbalcal.calibration import Calibration
from gimbalcal.earth import EARTH_RATE
from gimbalcal.effects import CATALOGUE, Effect, Parameter, Stimulus, parameters, values, with_values
from gimbalcal.estimate.extra_effects import NO_EXTENSION, Extension
from gimbalcal.estimate.fit import MAX_STEPS, TOLERANCE, excess_sigma, range_of_constants
from gimbalcal.estimate.gyroscopes.heading import horizontal_rate
from gimbalcal.estimate.gyroscopes.turns import Turns
from gimbalcal.estimate.term_selection import coefficients, needed, refusal
from gimbalcal.forward import gyroscopes
from gimbalcal.kinematics import stimulus_from_readings
from gimbalcal.number import Array, complex_step
from gimbalcal.recording import Recording, dwell_means, dwells
from gimbalcal.recording.record import FORCE, RATE

BIAS, G_SENSITIVITY = "gyro_bias", "gyro_g_sensitivity_rate"
MIN_RATE_SIGMA = 1e-9  # rad/s; below any gyroscope: where samples tell no noise, the scatter of the rests is all of it
MAX_ITERATIONS = 10  # of reweighting; each brings the excess within a few percent of the next


@dataclass(frozen=True, eq=False)
class Rests:
    """Mean rates (m, 3) [rad/s] at rest with one sigma of each (m, 3), and what the unit felt there.

    Where the unit turns steadily, at the rate of the stimulus, they are what is read beyond it. horizontal: what one
    sigma of each component of the Earth's horizontal rate makes of them (m, 3, q) [rad/s].
    """

    rate: Array
    sigma: Array
    stimulus: Stimulus
    horizontal: Array


@dataclass(frozen=True, eq=False)
class RestFit:
    """Effects fitted to rests: values (p,), covariance (p, p) in SI, misfit (m, 3) [rad/s], and what to judge it by."""

    effects: tuple[Effect, ...]
    parameters: tuple[Parameter, ...]
    x: Array
    covariance: Array
    misfit: Array
    left_out: float  # rad/s, rms misfit of a rest that took no part
    condition: float
    dof: float  # of the scatter that the sigmas are made from; inf where the samples' own noise is all there is


def rests(recording: Recording, accelerometers: Calibration, scale: float = 1.0, turns: Turns | None = None) -> Rests:
    """The rests of a recording, less the Earth's vertical rate; `scale` is rad/s per unit of a raw output.

    turns: those between them, which carry the direction of the Earth's horizontal rate.
    """
    means = dwell_means(accelerometers.apply(recording))
    rows = dwell_means(recording)
    y = recording.triad(RATE)
    root, stays = np.sqrt(recording.weight)[:, None], dwells(recording)  # rows may be means themselves
    inside = np.concatenate([(y[d.rows] - m) * root[d.rows] for d, m in zip(stays, rows.triad(RATE), strict=True)])
    sigma = np.sqrt((inside**2).mean(0)) / np.sqrt(rows.weight)[:, None]
    force, latitude = means.triad(FORCE), recording.site.latitude
    earth = 0.0 if latitude is None else EARTH_RATE * np.sin(latitude) * force / recording.site.gravity
    felt = stimulus_from_readings(means).at(force=force, rate=np.zeros_like(force))  # at rest, as the calibration tells
    down = force / np.linalg.norm(force, axis=1, keepdims=True)
    horizontal = np.zeros((len(down), 3, 0)) if turns is None else horizontal_rate(recording, turns, down)
    return Rests(scale * rows.triad(RATE) - earth, scale * sigma, felt, horizontal)


def fit_rests(
    found: Rests, terms: Sequence[str] = (BIAS, G_SENSITIVITY), extra: Extension = NO_EXTENSION,
    about: Array | None = None,
) -> RestFit:  # fmt: skip
    """Fit gyroscope effects, which are linear at rest, by weighted least squares with an excess scatter of each axis.

    about: values (p,) near which effects are linear, of a unit that turns. The Earth's horizontal rate, as far as it is
    known, is fitted beside them within what it can be.
    """
    wanted = (*(p for t in terms for p in parameters(CATALOGUE[t])), *extra.parameters)
    if extra.constants and about is None:
        return _with_constants(found, terms, extra)
    rate = found.stimulus.rate

    def read(x: Array) -> Array:
        return gyroscopes(rate, found.stimulus, with_values(extra.effects, wanted, x))

    x0 = np.zeros(len(wanted)) if about is None else about
    J = complex_step(read, x0)
    y = found.rate if about is None else found.rate - (read(x0) - rate) + J @ x0
    prior = np.array([w.sigma for w in wanted])
    p, q = len(wanted), found.horizontal.shape[-1]
    dof = len(J) - np.array([np.any(J[:, i] != 0, axis=0).sum() for i in range(3)])
    excess = np.zeros(3)
    own = np.where(found.sigma > 0, found.sigma, MIN_RATE_SIGMA)  # rows that never change, or one a rest
    for _ in range(MAX_ITERATIONS):
        sigma = np.sqrt(own**2 + excess**2)
        A = (np.concatenate([J * prior, found.horizontal], axis=-1) / sigma[..., None]).reshape(rate.size, -1)
        U, S, Vt = np.linalg.svd(np.concatenate([A, np.eye(p + q)[p:]]), full_matrices=False)
        U = U[: rate.size]  # beside the rests stands what is known of the Earth
        told = Vt.T @ ((U.T @ (y / sigma).ravel()) / S)
        x = told[:p] * prior
        misfit = y - J @ x - found.horizontal @ told[p:]
        excess = np.array([excess_sigma(misfit[:, i], own[:, i] ** 2, int(dof[i])) for i in range(3)])
    covariance = ((Vt.T / S**2) @ Vt)[:p, :p] * np.outer(prior, prior)
    A = A[:, :p]
    slack = 1 - (U**2).sum(1).reshape(misfit.shape)
    size = np.sqrt((A**2).sum(0))
    return RestFit(with_values(extra.effects, wanted, x), wanted, x, covariance, misfit,
                   float(np.sqrt(np.mean((misfit / slack) ** 2))), float(np.linalg.cond(A / size)),
                   float(dof.min()) if np.any(excess > 0) else np.inf)  # fmt: skip


def _with_constants(found: Rests, terms: Sequence[str], extra: Extension) -> RestFit:
    """The fit with nonlinear constants free, from where the sizes alone fit."""
    sizes = replace(extra, parameters=tuple(p for p in extra.parameters if p not in extra.constants))
    fit = fit_rests(found, terms, sizes)
    wanted = (*fit.parameters[: len(fit.parameters) - len(sizes.parameters)], *extra.parameters)
    bounds = range_of_constants(wanted, found.stimulus)
    x = values(fit.effects, wanted)
    for _ in range(MAX_STEPS):
        fit = fit_rests(found, terms, extra, x)
        target = np.clip(fit.x, *bounds) if bounds is not None else fit.x
        arrived = np.all(np.abs(target - x) <= TOLERANCE * np.sqrt(np.diag(fit.covariance)))
        x = target
        if arrived:
            break
    return replace(fit, effects=with_values(extra.effects, wanted, x), x=x)


def level_of(
    found: Rests, latitude: float | None, gravity: float, g_sensitivity: bool, tried: int = 0,
    extra: Extension = NO_EXTENSION,
) -> tuple[RestFit, str]:  # fmt: skip
    """Bias, and g-sensitivity if the rests support it; the second value says why not, if they do not.

    tried: coefficients that were asked for in all, those of the g-sensitivity with them (left out: these alone); extra:
    effects that are fitted in any case.
    """
    plain = fit_rests(found, (BIAS,), extra)
    if not g_sensitivity:
        return plain, ""
    data = f"{len(found.rate)} rests"
    if len(found.rate) < 6:  # four unknowns an axis, and something to test them on
        return plain, f"{G_SENSITIVITY} is left out: {data} are too few for it"
    fit = fit_rests(found, (BIAS, G_SENSITIVITY), extra)
    if latitude is None:  # the Earth's vertical rate, between -15 and 15 deg/h, is such a G
        common = np.array([float(p.effect == G_SENSITIVITY and p.axis[0] == p.axis[-1]) for p in fit.parameters])
        share = EARTH_RATE / np.sqrt(3) / gravity
        fit = RestFit(fit.effects, fit.parameters, fit.x, fit.covariance + share**2 * np.outer(common, common),
                      fit.misfit, fit.left_out, fit.condition, fit.dof)  # fmt: skip
    sigma = np.sqrt(np.diag(fit.covariance))
    clear_of = needed(tried or coefficients([G_SENSITIVITY]), fit.dof)
    why = refusal(G_SENSITIVITY, data, fit.parameters, fit.x, sigma, (plain.left_out, fit.left_out), "rad/s",
                  (plain.condition, fit.condition), clear_of)  # fmt: skip
    return (plain, why) if why else (fit, "")


def by_motion(extra: Extension, still: Rests) -> tuple[Extension, Extension]:
    """The part of extra effects that shows in what a unit at rest reads, and the part that only turning shows.

    A constant belongs to the rests where its effect has a size that shows there.
    """
    by_id = {e.id: e for e in extra.effects}

    def shows(p: Parameter) -> bool:
        (probe,) = with_values([by_id[p.effect]], (p,), np.array([p.sigma]))
        return bool(np.any(probe.contribution(still.stimulus) != 0))

    sizes = [p for p in extra.parameters if p not in extra.constants]
    at_rest = {p for p in sizes if shows(p)}
    at_rest |= {c for c in extra.constants if any(p.effect == c.effect for p in at_rest)}
    rest, moving = (tuple(p for p in extra.parameters if (p in at_rest) is still) for still in (True, False))
    return Extension(extra.effects, rest), Extension(extra.effects, moving)
