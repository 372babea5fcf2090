r"""Accelerometers from rest in many positions, no angles needed: the norm of the force is gravity at any attitude.

Wang et al. (2019), section 4.1, with the effects of the catalogue instead of one polynomial: every dwell has an
attitude of its own that is not known, and what the three readings of a dwell say beyond that attitude is one number,
the misfit of the norm. Direction: physics to reading, as everywhere in `effects`; `wang2019.pulses` is the other one.

Terms beyond bias, scale factor and misalignment are taken up one at a time, and only while the positions support them:
a coefficient must stand clear of its sigma (`support`), and positions left out must be predicted no worse.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gimbalcal.calibration import Calibration, Counts, Readout, Residual, StageResult
from gimbalcal.calibration.readout import in_si
from gimbalcal.effects import CATALOGUE, Effect, Parameter, parameters, with_values
from gimbalcal.effects.effect import SENSOR_STAGES, tied
from gimbalcal.errors import InputError, amount
from gimbalcal.estimate.accelerometers.account import noise_record, rotations_of_the_triad
from gimbalcal.estimate.accelerometers.noise import ATTITUDE, HEADER, SAMPLES
from gimbalcal.estimate.accelerometers.setting import FORCE, Noise, PositionFit, Problem, gauss_newton, problem
from gimbalcal.estimate.accelerometers.unsteady import noise_of_a_mean, scatter_in_words
from gimbalcal.estimate.added import Added, Beside, with_constants, with_told
from gimbalcal.estimate.support import coefficients, needed, refusal, scatter
from gimbalcal.kinematics import stimulus_from_angles, stimulus_from_readings
from gimbalcal.number import Array
from gimbalcal.platform import BENCH
from gimbalcal.recording import Recording, dwell_means
from gimbalcal.wang2019.fit import ellipsoid

LINEAR = ("scale_factor", "bias", "misalignment")
WIDE = 100.0  # times the prior scale of a navigation platform: low-cost units reach 50 mg, 5 % and 3 deg
TERMS = (*LINEAR, "scale_nonlinearity", "cubic_nonlinearity")
# x of the orthogonal frame lies along the first input axis, y in the plane of the first two: Eq. (5)


@dataclass(frozen=True, eq=False)
class NormFit:
    """A fit with what says whether to trust it: condition number (columns of length one), leave-one-out rms [m/s^2]."""

    fit: PositionFit
    problem: Problem
    excess: float  # m/s^2 scatter of the positions beyond the noise of their means
    condition: float
    left_out: float

    @property
    def misfit(self) -> Array:
        """Misfit of the norm of each position (m,) [m/s^2]."""
        return np.asarray(_rows(self)[1] * self.sigma)

    @property
    def sigma(self) -> Array:
        """Noise of the norm of each position (m,) [m/s^2]."""
        return np.asarray(self.fit.noise.accelerometer / np.sqrt(self.problem.weight))


def multiposition(recording: Recording, terms: Sequence[str] = (), more: Sequence[Added] = ()) -> Calibration:
    """Calibrate an accelerometer triad from rest positions of unknown attitude.

    terms: ids of effects that act on the force along an axis (default bias, scale_factor, misalignment,
    scale_nonlinearity, cubic_nonlinearity). Those that the positions do not support are declined with a sentence in
    `unobservable`; what `more` adds is fitted without being asked. Raises InputError for an effect that needs
    angles, for too few positions, or for no gravity.
    """
    asked = {a.effect for a in more}
    wanted = tuple(t for t in (tuple(dict.fromkeys(terms)) or TERMS) if t not in asked)
    _check(wanted)
    _check(tuple(asked), "--with")
    means = dwell_means(recording)
    means, counts = scaled_by_gravity(means)
    base = tuple(t for t in wanted if t in LINEAR) or ("bias",)
    beside, constants = _added(means, base, more)
    best = norm_fit(means, base, beside)
    tried, declined = [(base, best)], []
    for term in (t for t in wanted if t not in base):
        candidate = _attempt(means, (*tried[-1][0], term), beside)
        why = _refusal(term, best, candidate, coefficients(wanted) - coefficients(base))
        if why:
            declined.append((term, why))
        else:
            assert candidate is not None
            best = candidate
            tried.append(((*tried[-1][0], term), candidate))
    return with_told(_calibration(recording, best, tried, declined, counts), constants)


def _added(
    means: Recording, base: tuple[str, ...], more: Sequence[Added]
) -> tuple[Beside, dict[Parameter, tuple[float, float]]]:
    """What is added to a fit, with the constants that leave the smallest misfit, and these with their sigma."""
    wanted = tuple(p for a in more for p in a.parameters(()))

    def misfit(effects: Sequence[Effect]) -> float:
        made = norm_fit(means, base, (wanted, tuple(effects)))
        return float(((made.misfit / made.sigma) ** 2).sum())

    if not more:
        return ((), ()), {}
    at_rest = stimulus_from_readings(means) if not means.platform.axes else stimulus_from_angles(means)
    effects, told = with_constants(more, at_rest.at(axis_names=()), misfit)
    return (wanted, effects), told


def _check(terms: Sequence[str], option: str = "--terms") -> None:
    for term in terms:
        cls = CATALOGUE.get(term)
        allowed = [i for i, c in CATALOGUE.items() if _without_angles(c)]
        if cls is None or not _without_angles(cls):
            raise InputError(
                f"{option} names {term!r}, which is not an effect that rest positions without angles can show; "
                f"choose from {', '.join(allowed)}"
            )


def _without_angles(cls: type[Effect]) -> bool:
    return cls.stage in SENSOR_STAGES and cls.channel == FORCE


def unknowns(terms: Sequence[str]) -> tuple[Parameter, ...]:
    """Parameters of the terms; of the six misalignments the three that the norm can see."""
    found = [p for t in terms for p in parameters(CATALOGUE[t])]
    return tuple(replace(p, sigma=WIDE * p.sigma) for p in tied(found))


def norm_fit(means: Recording, terms: Sequence[str], beside: Beside = ((), ())) -> NormFit:
    """Fit the terms to one row per dwell in SI. The scatter beyond the noise of the means is estimated with it."""
    wanted = (*unknowns(terms), *beside[0])
    y, g = means.triad(FORCE), means.site.gravity
    if len(y) < len(wanted):
        raise InputError(
            f"{means.title!r} holds {amount(len(y), 'rest position')} for "
            f"{amount(len(wanted), 'parameter')} ({', '.join(terms)}): hold more positions or name fewer --terms"
        )
    bench = replace(means, platform=BENCH, channels={k: v for k, v in means.channels.items() if k[0] != "gimbal_angle"})
    p = problem(bench, wanted, beside[1])
    towards = y / np.linalg.norm(y, axis=1, keepdims=True)
    p = replace(p, readings=replace(p.readings, stimulus=p.stimulus.at(force=g * towards)))
    sample = means.sigma("accelerometer") or 1e-6 * g  # no scatter known: far below any rig, the excess takes over
    source = HEADER if "accelerometer" in means.noise else SAMPLES
    return _with_excess(p, Noise(sample, np.inf, source, ATTITUDE), _start(y, wanted, g))


def _start(y: Array, wanted: Sequence[Parameter], g: float) -> Array:
    """Linear start [SI] from the ellipsoid through the readings y (m, 3), turned to the direction of the effects."""
    found = ellipsoid(y[None] / g)[0] if len(y) >= 9 else np.full(9, np.nan)
    if not np.isfinite(found).all():
        return np.zeros(len(wanted))
    K1, bias, (yx, zx, zy) = found[:3], found[3:6], found[6:]
    start = {("scale_factor", i): K1[i] - 1 for i in range(3)} | {("bias", i): -g * bias[i] / K1[i] for i in range(3)}
    inverse = {"yz": yx, "zy": -(zx - zy * yx), "zx": zy}  # the inverse of Eq. (5), in the betas of Wu et al.'s Eq. (5)
    return np.array(
        [inverse[q.axis] if q.effect == "misalignment" else start.get((q.effect, q.index), 0.0) for q in wanted]
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
            new = scatter(r, noise.accelerometer**2 / count, dof)
        if abs(new - excess) <= 1e-3 * excess:
            break
        excess, start = new, fit.solution.x
    made = NormFit(fit, replace(p, weight=weight), excess, 0.0, 0.0)
    J, r = _rows(made)
    size = np.sqrt((J**2).sum(0))
    J = J / np.where(size > 0, size, 1.0)
    Q = np.linalg.qr(J)[0]
    slack = 1 - (Q**2).sum(1)  # exact for a linear model: the misfit of a position that took no part
    left = r / np.where(slack > 1e-9, slack, np.nan) * made.sigma if len(r) > J.shape[1] else np.full(len(r), np.nan)
    return replace(made, condition=float(np.linalg.cond(J)), left_out=float(np.sqrt(np.mean(left**2))))


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


def _attempt(means: Recording, terms: Sequence[str], beside: Beside) -> NormFit | None:
    try:
        return norm_fit(means, terms, beside)
    except InputError:
        return None


def _refusal(term: str, without: NormFit, candidate: NormFit | None, tried: int) -> str:
    """Why the positions do not support a term, of `tried` coefficients in all; empty where they do."""
    positions = len(without.problem.force)
    if candidate is None:
        return f"{term} is left out: {positions} positions are fewer than the parameters it would make"
    solution = candidate.fit.solution
    return refusal(
        term, f"{positions} positions", solution.parameters, solution.x, solution.sigma,
        (without.left_out, candidate.left_out), "m/s^2", (without.condition, candidate.condition),
        needed(tried, solution.dof if candidate.excess > 0 else np.inf),
    )  # fmt: skip


def scaled_by_gravity(means: Recording) -> tuple[Recording, Counts | None]:
    """Readings in counts or pulses become m/s^2 by the ellipsoid's scale and offset, which are kept as nominal."""
    if not means.counted(FORCE):
        return means, None
    N = means.triad(FORCE)
    spread = (N.max(0) - N.min(0)).mean() / 2
    middle = (N.max(0) + N.min(0)) / 2
    found = ellipsoid(((N - middle) / spread)[None])[0] if len(N) >= 9 else np.full(9, np.nan)
    if not np.isfinite(found).all():
        unit = means.units.get((FORCE, "x"), "m/s^2")
        raise InputError(
            f"{means.title!r} reads in {unit} and "
            f"{amount(len(N), 'rest position')} cannot fix its scale: hold at least nine that turn "
            "every axis up and down, or give the columns in m/s^2"
        )
    scale = found[:3] * means.site.gravity / spread
    offset = middle - found[3:6] / found[:3] * spread
    counts = Counts(tuple(map(float, scale)), tuple(map(float, offset)))
    return in_si(means, Readout(accelerometers=counts)), counts


def _calibration(
    recording: Recording,
    best: NormFit,
    tried: Sequence[tuple[tuple[str, ...], NormFit]],
    declined: Sequence[tuple[str, str]],
    counts: Counts | None,
) -> Calibration:
    from gimbalcal import __version__

    solution = best.fit.solution
    unobservable: list[dict[str, Any]] = [u.to_dict() for u in solution.unobservable]
    if any(q.effect == "misalignment" for q in solution.parameters):
        unobservable += rotations_of_the_triad()
    unobservable += [{"direction": {q.label: 1.0 for q in unknowns([t])}, "why": why} for t, why in declined]
    own = noise_of_a_mean(recording, best.fit.noise.accelerometer, counts)
    options = {
        "gravity": recording.site.gravity,
        "direction": "physics to reading",
        "excess_scatter": best.excess,
        "excess_over_noise": best.excess / own if own else None,
        "condition": best.condition,
        "leave_one_out_rms": best.left_out if np.isfinite(best.left_out) else None,
        "declined": dict(declined),
    }
    if counts is not None:
        options["nominal"] = {"scale": list(counts.scale), "offset": list(counts.offset)}
    return Calibration(
        method="multiposition",
        effects=with_values(best.problem.effects, solution.parameters, solution.x),
        parameters=solution.parameters,
        covariance=solution.covariance,
        unobservable=tuple(unobservable),
        residual=Residual(solution.chi2, solution.dof, {FORCE: float(np.sqrt(np.mean(best.misfit**2)))}),
        outcome=_outcome(recording, best, own),
        provenance={"recordings": recording.files,
                    "version": __version__, "noise": noise_record(best.fit.noise), "options": options},
        stages=tuple(_stage(terms, made) for terms, made in tried),
        readout=Readout(accelerometers=counts, gimbals=recording.platform.axis_names),
    )  # fmt: skip


def _outcome(recording: Recording, best: NormFit, own: float) -> str:
    if best.fit.steps == 0:
        return "the fit did not settle: the positions do not determine these terms together"
    words = scatter_in_words(recording, best.excess, own)
    scaled = "; all sigma are scaled to that scatter, and `gimbalcal diagnose` looks for what the model misses"
    return words and words + scaled


def _stage(terms: Sequence[str], made: NormFit) -> StageResult:
    solution = made.fit.solution
    left = f", {made.left_out:.2g} m/s^2 for a position left out" if np.isfinite(made.left_out) else ""
    return StageResult(
        name=" + ".join(terms),
        labels=tuple(q.label for q in solution.parameters),
        values=solution.x,
        sigmas=solution.sigma,
        rms=float(np.sqrt(np.mean(made.misfit**2))),
        in_words=f"norm of gravity at {len(made.problem.force)} positions; condition number {made.condition:.0f}{left}",
    )
