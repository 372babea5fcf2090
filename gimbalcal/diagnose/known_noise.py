r"""Diagnosis of forces at known attitude in a known noise: a multi-position recording or a static run.

observe ──> noise ──> library ──> search ──> decide ──> model ──> verify ──> recommend
                                    └──> locate (before and after)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from gimbalcal.calibration import Calibration
from gimbalcal.diagnose.answer import Curves, in_print, plotted_against
from gimbalcal.diagnose.evidence.noises import noises
from gimbalcal.diagnose.evidence.odds import CLAIM
from gimbalcal.diagnose.evidence.stated_noise import settle
from gimbalcal.diagnose.laws.law_claims import Lawful, beyond_walk, lawful, misheld
from gimbalcal.diagnose.library.assemble import library
from gimbalcal.diagnose.library.candidates import Candidate
from gimbalcal.diagnose.result import Estimate, Finding, Shape, Shift, StatedNoiseFit
from gimbalcal.diagnose.rows.baseline import carried
from gimbalcal.diagnose.search.fitted_causes import (
    FittedCauses,
    JointCovariance,
    calibration_fit,
    constant_value,
    fit_causes,
    joint_covariance,
)
from gimbalcal.diagnose.search.ranking import Search, search
from gimbalcal.diagnose.search.relinearise import about_causes, about_settings
from gimbalcal.diagnose.search.single_axis_random_walk import wandering
from gimbalcal.diagnose.verdict.decide import Decision, bar, strained, unnamed
from gimbalcal.diagnose.verdict.detection_limits import detection_limits
from gimbalcal.diagnose.verdict.findings import axes_of, entry
from gimbalcal.diagnose.verdict.manoeuvres import advise, sentence
from gimbalcal.diagnose.verdict.mismatch_scan import LEFT, Scan, mismatches, scan
from gimbalcal.diagnose.verdict.random_walk import decide_with_walk, without_single_walks
from gimbalcal.diagnose.verdict.refit_calibration import calibrated, found_jointly
from gimbalcal.diagnose.verdict.threshold import clean_evidence
from gimbalcal.diagnose.verdict.verify import physical_columns, residual_rows, verify
from gimbalcal.diagnose.view_diagnosis import ViewDiagnosis
from gimbalcal.effects import CATALOGUE, Parameter
from gimbalcal.effects.baseline_effects import BASELINE
from gimbalcal.number import Array
from gimbalcal.pipeline import Tell
from gimbalcal.recording import Recording
from gimbalcal.units import from_si
from gimbalcal.views.core import Fit
from gimbalcal.views.known_attitude import fit_baseline
from gimbalcal.words.naming import spaced

MAX_CHI2_TO_LINEARISE = 100.0  # reduced chi^2 above which rows are linearised about nominal constants


def diagnose_known_noise(
    recording: Recording, calibration: Calibration | None, baseline: Sequence[str], seed: int, tell: Tell
) -> ViewDiagnosis:
    """Diagnose the forces, or what else is read, of a recording whose attitude and noise are known."""
    rng = np.random.default_rng(seed)
    ids = tuple(baseline) or BASELINE.get(recording.kind, ())
    s = searched(recording, calibration, ids, tell)
    tell("sending simulated clean recordings of this design through the same comparison")
    clean = clean_evidence(s, rng)
    held = without_single_walks(s)
    d, walk = decide_with_walk(s, held, bar(clean))
    if walk is not None and d.verdict == "adequate":  # unless a deterministic law is as probable as the random walk
        none, law, odds = beyond_walk([held], held, walk, seed, tell)
        made = _report(held, none, clean, rng, seed, tell, calibration, law)
        return made if odds > CLAIM else made.with_walk(walk, only=odds < -CLAIM)
    made = _report(s, d, clean, rng, seed, tell, calibration)
    if walk is not None:
        return made.with_walk(walk, only=False)
    assert isinstance(made.fit, StatedNoiseFit)
    if d.hypothesis is None or (made.fit.scan_p_after >= LEFT and strained(s, d.hypothesis.members) < CLAIM):
        return made
    none = unnamed(s)
    law = lawful([s], [none.shapes[:1]], s, none.verdict, seed, tell, instead=True)
    return _report(s, none, clean, rng, seed, tell, calibration, law) if law.laws else made


def searched(recording: Recording, calibration: Calibration | None, baseline: tuple[str, ...], tell: Tell) -> Search:
    """Every cause of the catalogue tried on one recording."""
    tell(f"fitting the model: {', '.join(spaced(i) for i in baseline)} (another: --baseline)")
    start = carried(calibration, baseline)
    o = settle(fit_baseline(recording, baseline, start))
    nominal = o.view.kind.stabilised and _misfit(o) > MAX_CHI2_TO_LINEARISE
    if nominal:
        o = settle(fit_baseline(recording, baseline, start, steps=0))
    o = about_settings(o)
    tell("comparing every cause of the catalogue, alone and in pairs")
    s = search(o, library(o), noises(o))
    if nominal:
        tell("again, about the constants that belong to what was found")
        o = about_causes(s)
        s = search(o, library(o), noises(o))
    if more := wandering(s):
        who = f"accelerometer {more[0].single_walk}" if more[0].single_walk else "all accelerometers"
        tell(f"again, as {who} may wander")
        s = search(o, library(o), (*noises(o), *more))
    return s


def _misfit(o: Fit) -> float:
    """Reduced chi^2 of the baseline alone."""
    Z, y = o.reduced(o.Z), o.reduced(o.residual[:, :, None])
    left = y - Z @ np.linalg.lstsq(Z, y, rcond=1e-9)[0]
    return float((left**2).sum() / max(len(y) - Z.shape[1], 1))


def _report(
    s: Search, d: Decision, clean: Array, rng: np.random.Generator, seed: int, tell: Tell,
    known: Calibration | None = None, law: Lawful | None = None,
) -> ViewDiagnosis:  # fmt: skip
    members = d.hypothesis.members if d.hypothesis else ()
    f = fit_causes(s, members)
    seen = fit_causes(s, members or tuple(d.shapes[:1]))  # the noise as it is once the shape is allowed for
    tell("locating the mismatch and checking held-out data")
    before, fitted, curves = measured(s, f, seen, rng)
    mismatch = () if d.verdict == "adequate" else mismatches(before, at_least=1)
    named = findings(s, d, f)
    shapes = tuple(shape(s.library.candidates[i]) for i in d.shapes[:3])
    if d.verdict == "adequate":
        fitted = replace(fitted, unseen=detection_limits(s.library.candidates, s.projections))
    law = law or lawful([s], [d.shapes[:1]], s, d.verdict, seed, tell)
    for law_fit, left in law.each:
        fitted = law_fit.summary(fitted)
        curves = replace(curves, after=left)
    tell("the model with what was found, as a calibration")
    sigma = np.broadcast_to(s.fit.sigma, curves.after.shape)
    return ViewDiagnosis(
        s.fit.view, d.verdict, mismatch, named, shapes, fitted, curves, sigma,
        calibration=calibrated_alone(s, f, "", known), laws=law.laws, recommend=law.recommend,
        outcome=misheld(s, d.verdict), evidence={**evidence_of(s, clean), "probability_unknown": round(d.unknown, 4)},
    )  # fmt: skip


def evidence_of(s: Search, clean: Array) -> dict[str, Any]:
    """Return the evidence of a search and of simulated clean recordings (draws,), for the provenance."""
    return {
        "ln_bayes_factor": round(s.ln_total, 3),
        "ln_bayes_factor_needed": round(bar(clean), 3),
        "false_alarm_rate_simulated": float(np.mean(clean >= CLAIM)),
        "causes_compared": len([c for c in s.library.candidates if not c.rival]),
        "excess_kurtosis": round(s.fit.view.noise.kurtosis, 3),
    }


def calibrated_alone(s: Search, f: FittedCauses, outcome: str, known: Calibration | None = None) -> Calibration:
    """The calibration of one recording with the causes of a fit."""
    causes = [s.library.candidates[m] for m in f.members]
    joint = joint_covariance(s, f)
    told = [_constants_of(s, f, joint, j) for j in range(len(causes))]
    found = found_jointly(causes, told, f.x, joint)
    return calibrated([(s.fit, f.projection.node, range(len(causes)))], found, outcome, known)[0]


def _constants_of(s: Search, f: FittedCauses, joint: JointCovariance, j: int) -> tuple[tuple[str, float, float], ...]:
    """Return the constants of member j: name, value and sigma in SI, of continuous ones with all else fitted."""
    sigma = joint.sigma_of(j)
    return tuple((name, value, sigma.get(name, spread)) for name, value, spread in constant_value(s, f, j))


def measured(
    s: Search, f: FittedCauses, seen: FittedCauses, rng: np.random.Generator
) -> tuple[Scan, StatedNoiseFit, Curves]:
    """Return where one recording is off before anything is added, the numbers of its fit, and its residuals.

    `f` is the fit of what was found, `seen` the same or that of a shape, whose noise counts.
    """
    physical, node = physical_columns(s, f), seen.projection.node
    before = scan(s.fit, s.rows, node, rng)
    after = scan(s.fit, s.rows, node, rng, s.library.X[:, list(f.index)]) if f.index else before
    fitted = verify(s, f if f.index else seen, physical).summary(node, before.p_value, after.p_value)
    fitted = replace(fitted, calibration_moved=moved(s, f) if f.index else ())
    left, rest = residual_rows(s.fit, physical @ f.x)
    sigma, units = in_print(s.fit.view.channels, np.broadcast_to(s.fit.sigma, left.shape))
    return (
        before,
        fitted,
        Curves(
            s.fit.view.stimulus.time,
            s.fit.view.stimulus.position,
            s.fit.view.channels,
            left,
            rest,
            sigma,
            units,
            plotted_against(s.fit.view.stimulus),
        ),
    )


def findings(s: Search, d: Decision, f: FittedCauses) -> tuple[Finding, ...]:
    """Return what is named: effect, axis, probability, significance, sizes, what fits alike and how to separate it."""
    joint, out, at = joint_covariance(s, f), [], 0
    for n, j in enumerate(d.judgements):
        c = j.cause
        size = f.x[at : at + len(c.parameters)]
        sigma = np.sqrt(np.diag(joint.covariance))[at : at + len(c.parameters)] / [p.sigma for p in c.parameters]
        at += len(c.parameters)
        advice = ""
        if j.alike:
            advice = sentence(advise(s.fit, c, f.variants[n], size, j.alike[0]), c, j.alike[0])
        rows = printed(c.parameters, size, sigma) + constants(c, _constants_of(s, f, joint, n))
        out.append(entry(j, axes_of(j), f.significance[n], rows, advice))
    return tuple(out)


def printed(parameters: Sequence[Parameter], size: Array, sigma: Array) -> list[Estimate]:
    """Parameters in printed units, from sizes and sigmas (p,) in prior sigmas; without those that nothing shows."""
    rows = []
    for p, x, e in zip(parameters, size, sigma, strict=True):
        if e == 0:
            continue
        scale = float(from_si(p.sigma, p.unit))
        rows.append(Estimate(p.name, p.axis, float(x) * scale, float(e) * scale, p.unit))
    return rows


def constants(c: Candidate, values: Sequence[tuple[str, float, float]]) -> list[Estimate]:
    """Non-linear constants in printed units, from name, value and sigma in SI."""
    units = {g.name: g.metadata["unit"] for g in CATALOGUE[c.effect].__dataclass_fields__.values() if g.metadata}
    return [
        Estimate(name, "", float(from_si(value, units[name])), float(from_si(spread, units[name])), units[name])
        for name, value, spread in values
    ]


def moved(s: Search, f: FittedCauses) -> tuple[Shift, ...]:
    """Return how far each calibration constant moves once the findings are in the model."""
    before, after, sigma = calibration_fit(s, f)
    out = []
    for p, b, a, e in zip(s.fit.parameters, before, after, sigma, strict=True):
        scale = float(from_si(p.sigma, p.unit))
        in_sigmas = round(float((a - b) / e), 2) if e > 0 else 0.0
        out.append(Shift(p.name, p.axis, float(a - b) * scale, float(e) * scale, p.unit, in_sigmas))
    return tuple(sorted(out, key=lambda row: -abs(row.in_sigmas)))


def shape(c: Candidate) -> Shape:
    """Return what remains unexplained."""
    return Shape(f"{c.channel} {c.axis}".strip(), c.rival)
