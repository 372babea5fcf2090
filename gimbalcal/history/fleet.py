r"""Distribution of each parameter over the units of a fleet, and the calibration of a unit with it as prior.

Units i = 1 ... n have estimates x_i with sigma_i, and their true values are normal with mean mu and spread tau,

.. math:: x_i \sim N(\mu, \tau^2 + \sigma_i^2) .

Given tau, mu is the mean with weights :math:`1 / (\tau^2 + \sigma_i^2)` and variance :math:`V_\mu`; tau itself has

.. math:: p(\tau | x) \propto V_\mu^{1/2} \prod_i (\tau^2 + \sigma_i^2)^{-1/2}
          e^{-(x_i - \hat \mu)^2 / 2 (\tau^2 + \sigma_i^2)}

by a uniform prior, and is integrated over on a grid: what a further unit will have is so uncertain as few units leave
it, and a spread that the sigmas hide is not taken for zero. A unit is outside where the distribution of all others has
so small a tail that chance explains it once in a hundred fleets. Parameters are independent of each other here.

The prior of a unit is that distribution (empirical Bayes). With S_d the information of its data, which determine
nothing along their null directions, and F that of the fleet,

.. math:: P = (S_d + F + N)^{-1}, \qquad x = P (S_d \hat x + F \mu) ,

where N is the prior of the grade along null directions, for parameters that the fleet does not determine. The error of
gravity is common to all units of a site, and no number of them makes it smaller: it is removed before and added after.
Source: Gelman et al., *Bayesian Data Analysis* (2013), section 5.4.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import sqrt
from pathlib import Path

import numpy as np

from gimbalcal.calibration import Calibration, Readout
from gimbalcal.calibration.common_readout import common_readout, in_readout, is_in_counts
from gimbalcal.calibration.gravity_uncertainty import scale_factor_direction, without_gravity
from gimbalcal.calibration.provenance import AssumedGrade
from gimbalcal.effects import Parameter, with_values
from gimbalcal.errors import InputError, number_of
from gimbalcal.history.unit_store import DatedCalibration, calibrations_by_unit
from gimbalcal.number import Array
from gimbalcal.p_value import probability
from gimbalcal.recording import Recording
from gimbalcal.words.history_sentences import unusual_unit_in_words
from gimbalcal.words.naming import unobservable_leading

UnitEstimate = tuple[str, float, float, float]  # of one parameter: unit, time [s since 1970], value and sigma [SI]
FLEET = "fleet"  # name of the grade in the provenance, and the prefix of --grade fleet:FILE
MIN_UNITS = 5  # below, the spread has no finite expectation
SIGNIFICANCE = 0.01  # false-alarm probability over all parameters and units of a fleet
MAX_OUTSIDE = 0.25  # share of the units; where more are outside they are no exceptions, and all are taken
GRID = np.concatenate([[0.0], np.geomspace(1e-3, 1e2, 240)])  # of tau, in standard deviations of the estimates
FLAT_SIZE = 1e3  # prior sigmas of a parameter that the fleet does not determine
OBSERVABLE = 1 - 1e-6  # of the prior variance, above which a direction keeps its prior


@dataclass(frozen=True, eq=False)
class Distribution:
    """One parameter over n units: estimates (n,) and sigmas (n,) [SI], and which are inside; see the module.

    mean and sigma [SI] are those of a further unit, `spread` that of the units (tau), all expectations over tau;
    p_value (n,): two-sided, of each unit in the distribution of the others.
    """

    parameter: Parameter
    units: tuple[str, ...]
    time: Array  # (n,) s since 1970 at which they were recorded, nan where that is not stated
    value: Array
    own_sigma: Array
    inside: Array
    p_value: Array
    mean: float
    mean_sigma: float
    spread: float
    sigma: float

    @cached_property
    def trend(self) -> tuple[float, float]:
        """Slope over the date of the units inside [SI/s], with one sigma; nan where dates do not differ."""
        known = self.inside & np.isfinite(self.time)
        if not known.any() or not np.ptp(self.time[known]) > 0:
            return np.nan, np.nan
        w = 1 / (self.own_sigma[known] ** 2 + self.spread**2)
        t, x = self.time[known] - np.average(self.time[known], weights=w), self.value[known]
        information = float((w * t**2).sum())
        return float((w * t * x).sum() / information), 1 / sqrt(information)


@dataclass(frozen=True, eq=False)
class Fleet:
    """Distributions by label of a parameter; source: the file, in words; units: how many there are in all.

    readout: the nominal scale and offset that the parameters are errors of, where the units output counts; hashes:
    SHA-256 of the samples of each unit.
    """

    distributions: Mapping[str, Distribution]
    source: str
    units: int
    readout: Readout = field(default_factory=Readout)
    hashes: Mapping[str, frozenset[str]] = field(default_factory=dict)

    @cached_property
    def identity(self) -> str:
        """Return the SHA-256 of all that a calibration takes from it."""
        rows = [(label, d.units, d.value.tolist(), d.own_sigma.tolist()) for label, d in self.distributions.items()]
        samples = [(unit, sorted(hashes)) for unit, hashes in self.hashes.items()]
        return hashlib.sha256(json.dumps([rows, self.readout.to_dict(), samples]).encode()).hexdigest()

    def without(self, recordings: Sequence[Recording]) -> Fleet:
        """Return the fleet without the units that were calibrated from any of these recordings."""
        own = {f.sha256 for r in recordings for f in r.source}
        hashes = {unit: of_unit for unit, of_unit in self.hashes.items() if not of_unit & own}
        if len(hashes) == len(self.hashes):
            return self
        rows = {
            d.parameter: [row for row in zip(d.units, d.time, d.value, d.own_sigma, strict=True) if row[0] in hashes]
            for d in self.distributions.values()
        }
        return replace(self, distributions=_distributions(rows), units=len(hashes), hashes=hashes)


def fleet_of_store(path: Path) -> Fleet:
    """Return the fleet of a store: the last calibration of each unit. Raises InputError for too few units.

    Calibrations that took their prior from a fleet are omitted: they are not independent of it.
    """
    by_unit = calibrations_by_unit(path, lambda c: not rests_on_fleet(c))
    known = fleet({unit: dated[-1] for unit, dated in by_unit.items() if dated}, str(path))
    if not known.distributions:
        raise InputError(
            f"{path} holds calibrations of {number_of(known.units, 'unit')}, and a fleet takes {MIN_UNITS} or "
            "more with a parameter that their data determine; calibrate more units with --store, or name a --grade"
        )
    return known


def grade_and_fleet(grade: str | Fleet) -> tuple[str, Fleet | None]:
    """Return the name of a grade, empty for that of the noise, and the fleet of "fleet:FILE" or one that is given."""
    if isinstance(grade, Fleet):
        return "", grade
    if grade.startswith(f"{FLEET}:"):
        return "", fleet_of_store(Path(grade.removeprefix(f"{FLEET}:")))
    return grade, None


def rests_on_fleet(c: Calibration) -> bool:
    """Return whether a calibration took its prior from a fleet."""
    grade = c.provenance.options.grade
    return grade is not None and grade.name == FLEET


def fleet(by_unit: Mapping[str, DatedCalibration], source: str = "") -> Fleet:
    """Return the distribution of every parameter that the data of `MIN_UNITS` units or more determine.

    Units that output counts are brought to their median nominal scale and offset. Where some output counts and others
    SI, the parameters of that output are taken from the kind that is more frequent.
    """
    readout = common_readout([d.calibration for d in by_unit.values()])
    rows: dict[str, list[UnitEstimate]] = {}
    named: dict[str, Parameter] = {}
    for unit, d in by_unit.items():
        c = in_readout(d.calibration, readout)
        undetermined = unobservable_leading(c.null_directions)
        own = np.sqrt(np.diag(without_gravity(c, gravity_of(c))))
        time = d.date.timestamp() if c.provenance.recorded else np.nan
        for p, x, sigma in zip(c.parameters, c.values, own, strict=True):
            determined = p.label not in undetermined and 0 < sigma < np.inf
            if determined and is_in_counts(p, c.readout) == is_in_counts(p, readout):
                rows.setdefault(p.label, []).append((unit, time, float(x), float(sigma)))
                named[p.label] = p
    distributions = _distributions({named[label]: own for label, own in rows.items()})
    return Fleet(distributions, source, len(by_unit), readout, {unit: d.hashes for unit, d in by_unit.items()})


def _distributions(rows: Mapping[Parameter, Sequence[UnitEstimate]]) -> dict[str, Distribution]:
    """Return the distribution of each parameter of `MIN_UNITS` units or more, by its label."""
    enough = {p: own for p, own in rows.items() if len(own) >= MIN_UNITS}
    tried = sum(map(len, enough.values()))
    return {p.label: _distribution(p, own, tried) for p, own in enough.items()}


def gravity_of(c: Calibration) -> float:
    """Return one sigma of the relative error of gravity that a covariance contains."""
    return 1e-6 * (c.provenance.options.gravity_sigma_ppm or 0.0)


def _distribution(p: Parameter, rows: Sequence[UnitEstimate], tried: int) -> Distribution:
    """Return the distribution of one parameter, to which units that are outside do not belong."""
    time, x, sigma = (np.array([row[k] for row in rows]) for k in (1, 2, 3))
    inside = np.ones(len(x), dtype=bool)
    while True:
        tails = tail_of_others(x, sigma, inside)
        still = inside & (tails >= SIGNIFICANCE / tried)
        if still.all() or (~still).sum() > MAX_OUTSIDE * len(x):
            inside = inside if still.all() or inside.all() else np.ones_like(inside)
            break
        if np.array_equal(still, inside):
            break
        inside = still
    tails = tail_of_others(x, sigma, inside)
    posterior, mean, variance, tau = posterior_of_spread(x[inside], sigma[inside])
    mu = float(posterior @ mean)
    of_mean = float(posterior @ (variance + (mean - mu) ** 2))
    square = float(posterior @ tau**2)
    return Distribution(
        p, tuple(row[0] for row in rows), time, x, sigma, inside, tails, mu, sqrt(of_mean), float(posterior @ tau),
        sqrt(of_mean + square),
    )  # fmt: skip


def posterior_of_spread(x: Array, sigma: Array) -> tuple[Array, Array, Array, Array]:
    """Return the posterior (g,) of tau, the mean (g,) and its variance (g,) given it, and the grid (g,) of tau."""
    tau = _tau_grid(x, sigma)
    posterior, mean, variance = _posterior(x, sigma, tau, without_each=False)
    return posterior[0], mean[0], variance[0], tau


def tail_of_others(x: Array, sigma: Array, inside: Array) -> Array:
    """Return the two-sided tail (n,) of each unit in the distribution of all others that are inside."""
    from scipy.special import erfc

    tau = _tau_grid(x[inside], sigma[inside])
    own = np.where(inside, sigma, np.inf)
    posterior, mean, variance = _posterior(np.where(inside, x, 0.0), own, tau, without_each=True)
    off = np.abs(x[:, None] - mean) / np.sqrt(2 * (variance + tau**2 + sigma[:, None] ** 2))
    return np.asarray((posterior * erfc(off)).sum(axis=1))


def _tau_grid(x: Array, sigma: Array) -> Array:
    """Return the values (g,) of tau that may be likely."""
    return np.asarray(GRID * (float(x.std()) or float(sigma.min())))


def _posterior(x: Array, sigma: Array, tau: Array, *, without_each: bool) -> tuple[Array, Array, Array]:
    """Return the posterior (m, g) of tau (g,), the mean (m, g) and its variance (m, g) of units x (n,).

    Of all of them, m = 1, or without each in turn, m = n; one of infinite sigma takes no part.
    """
    known = np.isfinite(sigma)
    middle = float(np.mean(x[known]))
    variance = tau**2 + sigma[:, None] ** 2  # (n, g)
    w, y = 1 / variance, (x - middle)[:, None]
    log = np.where(known[:, None], np.log(np.where(known[:, None], variance, 1.0)), 0.0)
    W, S, Q, L = (a.sum(axis=0) - (a if without_each else np.zeros((1, 1))) for a in (w, w * y, w * y**2, log))
    density = -(L + Q - S**2 / W + np.log(W)) / 2
    posterior = np.exp(density - density.max(axis=1, keepdims=True)) * np.gradient(tau)  # trapezoids
    return posterior / posterior.sum(axis=1, keepdims=True), middle + S / W, 1 / W


# --- the fleet as prior of a unit -------------------------------------------------------------------------------------


def with_fleet(c: Calibration, known: Fleet, recordings: Sequence[Recording] = ()) -> Calibration:
    """Return a calibration of these recordings with the fleet as prior of its parameters; see the module.

    A unit of the fleet that was calibrated from the same recordings takes no part: none is its own prior. A parameter
    that is unusual for the fleet keeps the estimate of its own data alone, and `outcome` names it.
    """
    known = known.without(recordings)
    given, c = c, in_readout(c, known.readout)
    by_parameter = [
        known.distributions.get(p.label) if is_in_counts(p, c.readout) == is_in_counts(p, known.readout) else None
        for p in c.parameters
    ]
    if not any(by_parameter):
        return given
    e, own = gravity_of(c), without_gravity(c, gravity_of(c))
    e = 0.0 if own is c.covariance else e
    scale, x, sigma = np.array([p.sigma for p in c.parameters]), c.values, np.sqrt(np.diag(own))
    lam, V = np.linalg.eigh(own / np.outer(scale, scale))
    null = lam >= OBSERVABLE
    undetermined = unobservable_leading(c.null_directions)
    unusual = [
        i for i, (p, d) in enumerate(zip(c.parameters, by_parameter, strict=True))
        if d is not None and p.label not in undetermined
        and normal_tail(x[i] - d.mean, float(np.hypot(d.sigma, sigma[i]))) < SIGNIFICANCE / len(by_parameter)
    ]  # fmt: skip
    prior = [None if i in unusual else d for i, d in enumerate(by_parameter)]
    used = np.array([d is not None for d in prior])
    mean = np.array([0.0 if d is None else d.mean for d in prior]) / scale
    size = np.array([np.inf if d is None else d.sigma for d in prior]) / scale
    odd = [(d, float(x[i]), float(sigma[i])) for i, d in enumerate(by_parameter) if d is not None and i in unusual]
    words = [unusual_unit_in_words(odd)] if odd else []
    if not unusual and (p_value := _joint_tail(x / scale - mean, lam, V, null, size)) < SIGNIFICANCE:
        words = [f"its parameters jointly are unusual for the fleet (p = {p_value:.1g}), so this prior may mislead"]
    outcome = ". ".join(filter(None, [c.outcome, *words]))
    if not used.any():
        return replace(given, outcome=outcome)
    data = (V * np.where(null, 0.0, 1 / lam)) @ V.T
    of_grade = np.where(used[:, None] | used, 0.0, (V * null) @ V.T)
    P = np.linalg.inv(data + np.diag(size**-2) + of_grade)
    z = P @ (data @ (x / scale) + mean / size**2)
    parameters = tuple(
        p if d is None else replace(p, sigma=d.sigma, mean=d.mean) for p, d in zip(c.parameters, prior, strict=True)
    )
    u = scale_factor_direction(c)
    few = min(len(d.units) for d in prior if d is not None)
    origin = f"{few} units or more of {known.source} are the prior of {used.sum()} of {len(used)} parameters"
    own_sigma = np.sqrt(np.diag(without_gravity(given, gravity_of(given)))).tolist()
    alone = dict(
        zip([p.label for p in given.parameters], zip(given.values.tolist(), own_sigma, strict=True), strict=True)
    )
    combined = replace(
        c,
        effects=with_values(c.effects, parameters, z * scale, c.readout.gimbals),
        parameters=parameters,
        covariance=(P + P.T) / 2 * np.outer(scale, scale) + e**2 * np.outer(u, u),
        outcome=outcome,
        provenance=c.provenance.with_options(grade=AssumedGrade(FLEET, origin, alone)),
    )
    return in_readout(combined, given.readout)


def own_estimate(c: Calibration) -> Calibration:
    """Return a calibration without the fleet that was its prior, as its provenance states it, without correlations."""
    grade = c.provenance.options.grade
    if not rests_on_fleet(c) or grade is None or not grade.own:
        return c
    x, sigma = np.array([grade.own.get(p.label, (v, np.inf)) for p, v in zip(c.parameters, c.values, strict=True)]).T
    own = replace(
        c,
        effects=with_values(c.effects, c.parameters, x, c.readout.gimbals),
        provenance=c.provenance.with_options(grade=None),
    )
    u = gravity_of(c) * scale_factor_direction(own)
    return replace(own, covariance=np.diag(sigma**2) + np.outer(u, u))


def normal_tail(off: float, sigma: float) -> float:
    """Return the two-sided tail of a normal distribution."""
    from scipy.special import erfc

    return float(erfc(abs(off) / sigma / sqrt(2)))


def _joint_tail(off: Array, lam: Array, V: Array, null: Array, size: Array) -> float:
    """Return the tail of all directions that the data determine, about the mean of the fleet, in scaled units."""
    free = np.isinf(size)
    dof = int((~null).sum() - free.sum())
    W = V[:, ~null]
    r, C = W.T @ off, np.diag(lam[~null]) + W.T @ (np.where(free, FLAT_SIZE, size)[:, None] ** 2 * W)
    return probability(float(r @ np.linalg.solve(C, r)), dof)
