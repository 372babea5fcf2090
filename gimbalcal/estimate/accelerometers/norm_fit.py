"""The fit of a triad to the norm of gravity: one row for each rest, whose attitude is not known.

Rests may scatter beyond the noise of their means; how far is estimated with the terms, and widens their sigmas.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gimbalcal.effects import CATALOGUE, Effect, Parameter, parameters, with_values
from gimbalcal.effects.effect import tied
from gimbalcal.errors import InputError, amount
from gimbalcal.estimate.accelerometers.errors_in_variables import Noise, PositionFit, Problem, gauss_newton, problem
from gimbalcal.estimate.accelerometers.noise import ATTITUDE, HEADER, SAMPLES
from gimbalcal.estimate.extra_effects import NO_EXTENSION, Extension
from gimbalcal.estimate.fit import excess_sigma
from gimbalcal.inference.ellipsoid import MIN_POINTS, ellipsoid
from gimbalcal.number import Array
from gimbalcal.platform import BENCH
from gimbalcal.recording import Recording
from gimbalcal.recording.record import FORCE

LINEAR = ("scale_factor", "bias", "misalignment")
PRIOR_FACTOR = 100.0  # times the prior scale of a navigation platform: low-cost units reach 50 mg, 5 % and 3 deg
# x of the orthogonal frame lies along the first input axis, y in the plane of the first two: Eq. (5)


@dataclass(frozen=True, eq=False)
class NormFit:
    """A fit with what says whether to trust it: condition number (columns of length one), leave-one-out rms [m/s^2]."""

    fit: PositionFit
    problem: Problem
    excess: float  # m/s^2 scatter of the positions beyond the noise of their means
    condition: float
    left_out: float
    slack: Array  # (m,) one less the leverage of each position: how little of it the fit takes from itself

    @property
    def effects(self) -> tuple[Effect, ...]:
        """Physics to reading, with the estimates."""
        return with_values(self.problem.effects, self.fit.solution.parameters, self.fit.solution.x)

    @property
    def misfit(self) -> Array:
        """Misfit of the norm of each position (m,) [m/s^2]."""
        return np.asarray(_rows(self)[1] * self.sigma)

    @property
    def sigma(self) -> Array:
        """Noise of the norm of each position (m,) [m/s^2]."""
        return np.asarray(self.fit.noise.accelerometer / np.sqrt(self.problem.weight))


def unknowns(terms: Sequence[str]) -> tuple[Parameter, ...]:
    """Parameters of the terms; of the six misalignments the three that the norm can see."""
    found = [p for t in terms for p in parameters(CATALOGUE[t])]
    return tuple(replace(p, sigma=PRIOR_FACTOR * p.sigma) for p in tied(found))


def norm_fit(means: Recording, terms: Sequence[str], extra: Extension = NO_EXTENSION) -> NormFit:
    """Fit the terms to one row per dwell in SI. The scatter beyond the noise of the means is estimated with it."""
    wanted = (*unknowns(terms), *extra.parameters)
    y, g = means.triad(FORCE), means.site.gravity
    if len(y) < len(wanted):
        raise InputError(
            f"{means.title!r} holds {amount(len(y), 'rest position')} for "
            f"{amount(len(wanted), 'parameter')} ({', '.join(terms)}): hold more positions, or estimate less, as with "
            "--terms bias,scale_factor, which takes six"
        )
    bench = replace(means, platform=BENCH, channels={k: v for k, v in means.channels.items() if k[0] != "gimbal_angle"})
    p = problem(bench, wanted, extra.effects)
    towards = y / np.linalg.norm(y, axis=1, keepdims=True)
    p = replace(p, readings=replace(p.readings, stimulus=p.stimulus.at(force=g * towards)))
    sample = means.sigma("accelerometer") or 1e-6 * g  # no scatter known: far below any rig, the excess takes over
    source = HEADER if "accelerometer" in means.noise else SAMPLES
    return _with_excess(p, Noise(sample, np.inf, source, ATTITUDE), _start(y, wanted, g))


def _start(y: Array, wanted: Sequence[Parameter], g: float) -> Array:
    """Linear start [SI] from the ellipsoid through the readings y (m, 3), turned to the direction of the effects."""
    found = ellipsoid(y[None] / g)[0] if len(y) >= MIN_POINTS else np.full(9, np.nan)
    if not np.isfinite(found).all():
        return np.array([q.mean for q in wanted])
    K1, bias, (yx, zx, zy) = found[:3], found[3:6], found[6:]
    start = {("scale_factor", i): K1[i] - 1 for i in range(3)} | {("bias", i): -g * bias[i] / K1[i] for i in range(3)}
    inverse = {"yz": yx, "zy": -(zx - zy * yx), "zx": zy}  # the inverse of Eq. (5), in the betas of Wu et al.'s Eq. (5)
    return np.array(
        [inverse[q.axis] if q.effect == "misalignment" else start.get((q.effect, q.index), q.mean) for q in wanted]
    )


def _with_excess(p: Problem, noise: Noise, start: Array) -> NormFit:
    """Fit, and let positions scatter by `excess` beyond their noise so that chi^2 equals its degrees of freedom."""
    count, excess = p.weight, 0.0
    for _ in range(8):
        weight = noise.accelerometer**2 / (noise.accelerometer**2 / count + excess**2)
        fit = gauss_newton(replace(p, weight=weight), noise, start)
        dof = fit.solution.dof
        chi2, new = fit.solution.chi2, excess
        if dof > 0 and (excess > 0 or chi2 > dof + 3 * np.sqrt(2 * dof)):
            r = _misfit_si(fit, weight)
            new = excess_sigma(r, noise.accelerometer**2 / count, dof)
        if abs(new - excess) <= 1e-3 * excess:
            break
        excess, start = new, fit.solution.x
    made = NormFit(fit, replace(p, weight=weight), excess, 0.0, 0.0, np.ones(len(weight)))
    J, r = _rows(made)
    size = np.sqrt((J**2).sum(0))
    J = J / np.where(size > 0, size, 1.0)
    Q = np.linalg.qr(J)[0]
    slack = 1 - (Q**2).sum(1)  # exact for a linear model: the misfit of a position that took no part
    left = r / np.where(slack > 1e-9, slack, np.nan) * made.sigma if len(r) > J.shape[1] else np.full(len(r), np.nan)
    rms = float(np.sqrt(np.mean(left**2)))
    return replace(made, condition=float(np.linalg.cond(J)), left_out=rms, slack=np.maximum(slack, 1e-9))


def _misfit_si(fit: PositionFit, weight: Array) -> Array:
    rows = fit.whitened.r - (fit.whitened.J @ fit.solution.x)
    kept = np.isfinite(fit.whitened.sigma)
    return np.asarray((np.where(kept, rows, 0.0)).sum(1) * fit.noise.accelerometer / np.sqrt(weight))


def _rows(made: NormFit) -> tuple[Array, Array]:
    """The one row of each position that a free attitude leaves: whitened Jacobian (m, p) and misfit (m,)."""
    w = made.fit.whitened
    kept = np.isfinite(w.sigma)[..., None]
    J = np.where(kept, w.J, 0.0).sum(1)
    r = np.where(kept[..., 0], w.r, 0.0).sum(1)
    return J, r - J @ made.fit.solution.x
