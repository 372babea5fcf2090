r"""All coefficients of a multi-position recording in one weighted fit of the force vector.

.. math:: \min_{x, e} \; \sum_d \frac{n_d}{\sigma_a^2} \left| f^a_d - h(x, \theta_d + e_d) \right|^2
          + \frac{1}{\sigma_\theta^2} |e_d|^2

with h the exact Eq. (6) of Wu et al. (2018) and e_d the setting error of each visit. The paper uses the vector for its
coarse stage and the norm for its fine one; this uses each where it knows most. With good angles it reaches the
Cramer-Rao bound of all that the positions show, with poor ones it passes over into the fit of the norm
(tests/benchmarks/bench_device.py).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gimbalcal.calibration import Calibration, Residual
from gimbalcal.effects import Effect, Parameter, parameters, values, with_values
from gimbalcal.errors import InputError, amount
from gimbalcal.estimate.accelerometers.account import outcome, provenance, rms, stage
from gimbalcal.estimate.accelerometers.misset import Fault, fit_without_faults
from gimbalcal.estimate.accelerometers.noise import stated_noise
from gimbalcal.estimate.accelerometers.setting import (
    Fit,
    Problem,
    baseline,
    linearise,
    problem,
    starting_values,
    whiten,
)
from gimbalcal.inference.information import Information, information
from gimbalcal.recording import Recording
from gimbalcal.units import from_si


@dataclass(frozen=True, eq=False)
class Joint:
    """A joint fit before it is put into words: the trusted visits, their fit, and the faults of the others."""

    problem: Problem
    fit: Fit
    faults: tuple[Fault, ...]
    whole: Problem


def joint(
    recording: Recording,
    start: Calibration | None = None,
    *,
    prior: Calibration | None = None,
    effects: Sequence[Effect] = (),
    averaged: bool = True,
) -> Calibration:
    """Calibrate from the vector at every dwell, with the setting error of every visit as an unknown.

    `start` is where the iteration begins and holds effects that stay as they are; it adds no information, so the
    coarse result of the same data may be given. `prior` is a calibration from *other* data and does add its own.
    `effects` joins further effects to the baseline, their parameters estimated too. `averaged=False` fits every row
    instead of dwell means, for effects that change inside a dwell.

    Positions that do not belong where the readouts say are named in `outcome` and left out of the fit. Raises
    InputError for a recording without gimbal angles or without specific force.
    """
    found = analyse(recording, start, prior, effects, averaged)
    p, fit = found.problem, found.fit
    estimate = with_values(p.effects, p.parameters, fit.solution.x, p.platform.axis_names)
    origin = provenance(recording, p, fit, found.faults)
    words = "; ".join(filter(None, [in_words(found), origin.get("lost", "")]))
    return Calibration(
        method="joint",
        effects=estimate,
        parameters=p.parameters,
        covariance=fit.solution.covariance,
        unobservable=tuple({"direction": u.direction, "why": u.why} for u in fit.solution.unseen),
        residual=Residual(fit.solution.chi2, fit.solution.dof, rms(p, fit)),
        outcome=outcome(fit, found.faults),
        provenance=origin,
        stages=(stage("joint", p, fit, words),),
    )


def analyse(
    recording: Recording,
    start: Calibration | None = None,
    prior: Calibration | None = None,
    effects: Sequence[Effect] = (),
    averaged: bool = True,
) -> Joint:
    """Fit, find positions that cannot be trusted, fit again without them."""
    if not recording.platform.axes:
        raise InputError(
            f"{recording.title!r} has no gimbal angles, so its attitude is not known; calibrate it from the norm of "
            "the force with --method multiposition"
        )
    wanted = wanted_parameters(recording, effects)
    fixed = {e.id: e for e in (*(start.effects if start else ()), *effects)}
    p = problem(recording, wanted, tuple(fixed.values()), averaged)
    first = starting_values(p, p.effects)
    rest, fit, faults = fit_without_faults(p, stated_noise(recording), first, prior_information(prior))
    return Joint(rest, fit, faults, p)


def wanted_parameters(recording: Recording, effects: Sequence[Effect] = ()) -> tuple[Parameter, ...]:
    """The 18 coefficients (17 and more on other chains) and those of further effects."""
    names = recording.platform.axis_names
    more = (q for e in effects for q in parameters(type(e), names))
    return tuple(dict.fromkeys([*baseline(recording.platform), *more]))


def information_of(recording: Recording, effects: Sequence[Effect] = ()) -> Information:
    """What a multi-position recording says, linearised at `effects` with the setting errors that go with them."""
    found = analyse(recording)
    p = found.problem
    x = starting_values(p, effects) if effects else found.fit.solution.x
    return whiten(linearise(p, x, found.fit.setting), found.fit.noise).information(p.parameters)


def prior_information(prior: Calibration | None) -> Information | None:
    """A calibration from other data as information: only the directions that those data saw."""
    if prior is None:
        return None
    scale = np.array([q.sigma for q in prior.parameters])
    variance, V = np.linalg.eigh(prior.covariance / np.outer(scale, scale))
    seen = (variance > 0) & (variance < 1 - 1e-6)  # an unseen direction carries the prior's variance, 1
    rows = (V[:, seen] / np.sqrt(variance[seen])).T / scale
    return information(rows, rows @ values(prior.effects, prior.parameters), prior.parameters)


def in_words(found: Joint) -> str:
    """What was fitted to what, and how well."""
    p, fit = found.problem, found.fit
    setting = from_si(fit.noise.setting, "arcsec")
    return (
        f"{len(p.parameters)} coefficients from the force at {p.visits} visits, with their setting errors of "
        f"{setting:.3g} arcsec (from the {fit.noise.setting_from}); "
        f"{amount(len(fit.solution.unseen), 'direction')} not seen"
    )
