r"""Calibration without angles: a unit at rest in many attitudes feels always the same |f| = g.

The attitude of each rest is unknown, so its setting error is free (`setting.py` with sigma_theta = infinity) and one
scalar per rest is left, the misfit along the force,

.. math:: \rho_d = n_d \cdot (f^a_d - h(x, f^p_d)), \qquad |f^p_d| = g ,

n_d normal to what a turn of f^p can do to the outputs. No norm shows how the triad sits in its case. Convention: the
x input axis is x_p, the y input axis lies in the xy plane; then beta_yz, beta_zy and beta_zx are left (Tedaldi, Pretto
and Menegatti, ICRA 2014, Sec. III-A). Outputs in counts are first brought to m/s^2 by the ellipsoid through them, whose
centre and radii are kept as `nominal_offset` and `nominal_scale`; the coefficients are relative to these.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gimbalcal.calibration import Calibration, Residual, Stage
from gimbalcal.effects import CATALOGUE, Parameter, parameters, with_values
from gimbalcal.errors import InputError
from gimbalcal.estimate.account import joined, misfit_in_words
from gimbalcal.estimate.noise import HEADER, RESIDUAL
from gimbalcal.estimate.setting import FORCE, Fit, Noise, Problem, gauss_newton, problem
from gimbalcal.number import Array
from gimbalcal.platform import BENCH
from gimbalcal.recording import Recording, dwell_means
from gimbalcal.units import from_si, is_raw, to_si

TERMS = ("bias", "scale_factor", "misalignment")
FREE_ANGLES = ("yz", "zy", "zx")  # what the convention above leaves of the six
WIDE = 100.0  # times the prior sigma of a navigation platform: 50 mg, 5 %, 3.3 deg, as low-cost units need
NEAR = 0.2  # readings within this of g are taken to be in m/s^2 already
NORM = f"{FORCE}:norm"


@dataclass(frozen=True, eq=False)
class NormFit:
    """A fit of the norm: rests, solution with residual sigma, and what is left at each rest [m/s^2]."""

    problem: Problem
    fit: Fit
    left: Array  # (m,)
    predicted: Array  # (m,) the same for each rest when it takes no part in the fit
    condition: float  # of the Jacobian in units of g and radians

    @property
    def rms(self) -> float:
        """Root mean square of what is left [m/s^2]."""
        return float(np.sqrt(np.mean(self.left**2)))

    @property
    def leave_one_out(self) -> float:
        """Root mean square of what is left at rests that took no part [m/s^2]."""
        return float(np.sqrt(np.mean(self.predicted**2)))


def norm(recording: Recording, terms: Sequence[str] = TERMS) -> Calibration:
    """Calibrate an accelerometer triad from its rests in at least as many attitudes as there are coefficients.

    terms: effects to estimate, by id. Beyond bias, scale factor and misalignment a term is declined, and said so in
    `unobservable`, unless rests that take no part in the fit are predicted better with it. Without a stated noise the
    sigmas come from the residual. Raises InputError for unknown terms or too few attitudes.
    """
    means, nominal = nominal_units(dwell_means(recording))
    basic = [t for t in terms if t in TERMS]
    best = fit_norm(means, basic)
    declined: list[dict[str, Any]] = []
    for term in terms:
        if term in TERMS:
            continue
        tried = fit_norm(means, [*basic, term])
        if tried.leave_one_out < best.leave_one_out and tried.fit.steps:
            basic, best = [*basic, term], tried
        else:
            declined.append(_declined(term, best, tried))
    return _calibration(recording, best, nominal, declined)


def nominal_units(means: Recording) -> tuple[Recording, dict[str, Any]]:
    """The rests in m/s^2, and the nominal scale and offset that brought them there (empty if they were)."""
    y, g = means.triad(FORCE), means.site.gravity
    raw = any(is_raw(unit) for (quantity, _), unit in means.units.items() if quantity == FORCE)
    if not raw and abs(float(np.median(np.linalg.norm(y, axis=1))) / g - 1) < NEAR:
        return means, {}
    offset, radius = ellipsoid(y)
    scale = g / radius
    channels = dict(means.channels)
    for i, axis in enumerate("xyz"):
        channels[FORCE, axis] = (y[:, i] - offset[i]) * scale[i]
    unit = next((u for (quantity, _), u in means.units.items() if quantity == FORCE), "m/s^2")
    told = {"nominal_scale": scale.tolist(), "nominal_offset": offset.tolist()}
    noise = {k: v for k, v in means.noise.items() if k != "accelerometer"}  # stated in counts: not comparable
    return replace(means, channels=channels, noise=noise), {**told, "nominal_unit": unit}


def ellipsoid(y: Array) -> tuple[Array, Array]:
    """Centre and radii (3,) of the ellipsoid along the axes through y (m, 3): least squares of a y^2 + b y = 1."""
    middle, spread = y.mean(axis=0), y.std(axis=0)
    if len(y) < 6 or np.any(spread == 0):
        raise InputError(
            f"{len(y)} attitude(s) do not determine offset and scale of three axes; rest in at least six, each axis up "
            "and down once"
        )
    v = (y - middle) / spread
    solution, _, rank, _ = np.linalg.lstsq(np.column_stack([v**2, v]), np.ones(len(v)), rcond=1e-6)
    a, b = solution[:3], solution[3:]
    if rank < 6 or np.any(a <= 0):
        raise InputError(
            "the readings do not lie around an ellipsoid, so scale and offset of the raw outputs cannot be found; rest "
            "in more attitudes, each axis up and down at least once"
        )
    centre = -b / (2 * a)
    radius = np.sqrt((1 + (a * centre**2).sum()) / a)
    return middle + spread * centre, spread * radius


def wanted_terms(terms: Sequence[str]) -> tuple[Parameter, ...]:
    """Parameters of the terms, with the three misalignments that the convention leaves, on wide priors."""
    unknown = [t for t in terms if t not in CATALOGUE]
    if unknown:
        raise InputError(f"unknown term {unknown[0]!r}; write some of {', '.join(sorted(CATALOGUE))}")
    every = [q for t in terms for q in parameters(CATALOGUE[t])]
    kept = [q for q in every if q.effect != "misalignment" or q.axis in FREE_ANGLES]
    return tuple(replace(q, sigma=WIDE * q.sigma) for q in kept)


def fit_norm(means: Recording, terms: Sequence[str]) -> NormFit:
    """Fit some terms to the rests; sigma from the header, else such that chi^2 equals its degrees of freedom."""
    wanted = wanted_terms(terms)
    if len(means.time) < len(wanted):
        raise InputError(
            f"{means.title!r} has {len(means.time)} rests and {len(wanted)} coefficients are asked for; rest in at "
            "least as many attitudes, or ask for fewer --terms"
        )
    stated = means.noise.get("accelerometer")
    p = problem(replace(means, platform=BENCH), wanted)
    weight = p.weight if stated else np.ones_like(p.weight)
    force = p.force / np.linalg.norm(p.force, axis=1, keepdims=True) * means.site.gravity
    p = replace(p, weight=weight, stimulus=p.stimulus.at(force=force))
    sigma = stated or 1e-4 * means.site.gravity
    fit = gauss_newton(p, Noise(sigma, np.inf, HEADER if stated else RESIDUAL, "attitude unknown"))
    if not stated:
        fit = _rescaled(p, fit)
    return _diagnosed(p, fit)


def _rescaled(p: Problem, fit: Fit) -> Fit:
    """The same fit with the sigma that its residual shows."""
    solution, dof = fit.solution, max(fit.solution.dof, 1)
    sigma = fit.noise.accelerometer * np.sqrt(solution.chi2 / dof)
    return gauss_newton(p, replace(fit.noise, accelerometer=max(float(sigma), 1e-300)), solution.x)


def _diagnosed(p: Problem, fit: Fit) -> NormFit:
    rows = ~fit.whitened.reached  # one per rest
    J, r = fit.whitened.J[rows], fit.whitened.r[rows]
    unit = np.sqrt(p.weight) / fit.noise.accelerometer
    left = r - J @ fit.solution.x
    scale = np.array([q.sigma for q in p.parameters])
    U, S, _ = np.linalg.svd(J * scale, full_matrices=False)
    leverage = (U[:, S >= 1] ** 2).sum(axis=1)
    natural = J / unit[:, None] * natural_scale(p.parameters, p.stimulus.gravity)
    values = np.linalg.svd(natural, compute_uv=False)
    predicted = left / np.maximum(1 - leverage, 1e-12)
    return NormFit(p, fit, left / unit, predicted / unit, float(values[0] / max(values[-1], 1e-300)))


def natural_scale(wanted: Sequence[Parameter], gravity: float) -> Array:
    """Factors (p,) from derivatives by SI parameters to those by multiples of g, ratios and radians, per g of force."""
    plain = [q.unit.replace("ug", "g").replace("mg", "g").replace("ppm", "1").replace("arcsec", "rad") for q in wanted]
    return np.array([to_si(1.0, unit) for unit in plain]) / gravity


def _declined(term: str, best: NormFit, tried: NormFit) -> dict[str, Any]:
    mine = [i for i, q in enumerate(tried.problem.parameters) if q.effect == term]
    solution = tried.fit.solution
    largest = float(np.max(np.abs(solution.x[mine]) / solution.sigma[mine]))
    loo = [from_si(f.leave_one_out, "mg") for f in (best, tried)]
    return {
        "direction": {tried.problem.parameters[i].label: 1.0 for i in mine},
        "why": (
            f"{term} is declined: with it, rests that take no part in the fit are predicted to {loo[1]:.3g} mg instead "
            f"of {loo[0]:.3g} mg, the condition number goes from {best.condition:.3g} to {tried.condition:.3g}, and its "
            f"largest coefficient is {largest:.2g} sigma"
        ),
    }


def _calibration(
    recording: Recording, found: NormFit, nominal: dict[str, Any], declined: list[dict[str, Any]]
) -> Calibration:
    p, fit = found.problem, found.fit
    solution = fit.solution
    labels = tuple(q.label for q in p.parameters)
    unseen = [{"direction": u.direction, "why": u.why} for u in solution.unseen]
    rms, ahead = (from_si(v, "mg") for v in (found.rms, found.leave_one_out))
    words = f"{len(found.left)} rests: {rms:.3g} mg rms, {ahead:.3g} mg when left out, condition {found.condition:.3g}"
    outcome = [] if fit.steps else ["the fit did not converge: are the rests at rest, and around an ellipsoid?"]
    if fit.noise.accelerometer_from == HEADER:
        outcome += misfit_in_words(solution.chi2, solution.dof)
    return Calibration(
        method="multiposition",
        effects=with_values((), p.parameters, solution.x),
        parameters=p.parameters,
        covariance=solution.covariance,
        unobservable=(*unseen, *declined),
        residual=Residual(solution.chi2, solution.dof, {NORM: found.rms}),
        outcome=joined(outcome),
        provenance=_provenance(recording, found) | nominal,
        stages=(Stage("norm", labels, solution.x, solution.sigma, found.rms, words),),
    )


def _provenance(recording: Recording, found: NormFit) -> dict[str, Any]:
    p, fit = found.problem, found.fit
    return {
        "recordings": [{"path": s.path, "sha256": s.sha256} for s in recording.source],
        "noise": {
            "accelerometer_ug": from_si(fit.noise.accelerometer, "ug"),
            "accelerometer_from": fit.noise.accelerometer_from,
        },
        "rests": len(found.left),
        "rms_mg": from_si(found.rms, "mg"),
        "leave_one_out_mg": from_si(found.leave_one_out, "mg"),
        "condition": found.condition,
        "left_at_rests_mg": [
            {"position": int(q), "mg": float(v)} for q, v in zip(p.positions, from_si(found.left, "mg"), strict=True)
        ],
        "convention": "x input axis along x_p, y input axis in the xy plane of the platform frame",
        "remarks": list(recording.remarks),
    }
