r"""The diagnosis of several recordings of one unit.

recording 1 ──> search ─┐                       ┌─> fit, verify, locate ─┐
recording 2 ──> search ─┴─> combine ──> decide ─┴─> fit, verify, locate ─┴─> sizes pooled ──> one diagnosis
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

import gimbalcal
from gimbalcal.calibration import Calibration
from gimbalcal.diagnose.answer import Curves, Diagnosis
from gimbalcal.diagnose.evidence.odds import CLAIM
from gimbalcal.diagnose.known_noise import constants, measured, printed, searched, shape
from gimbalcal.diagnose.laws.law_claims import APART, Lawful, beyond_walk, lawful
from gimbalcal.diagnose.of_recording import has_gyroscopes, has_unstated_noise
from gimbalcal.diagnose.result import (
    Finding,
    Mismatch,
    RecordingFit,
    RecordingSize,
    SeparateVerdict,
    Shape,
    SizeAgreement,
    StatedNoiseFit,
)
from gimbalcal.diagnose.rows.baseline import unfit
from gimbalcal.diagnose.search.combine import CombinedRanking, combine
from gimbalcal.diagnose.search.fitted_causes import fit_causes
from gimbalcal.diagnose.verdict.agreement import ConstantsAgreement
from gimbalcal.diagnose.verdict.decide import Decision, bar
from gimbalcal.diagnose.verdict.findings import axes_of, entry
from gimbalcal.diagnose.verdict.manoeuvres import advise, sentence
from gimbalcal.diagnose.verdict.mismatch_scan import LISTED, Scan, mismatches
from gimbalcal.diagnose.verdict.pooled_sizes import Part, agreement_on_size, common_constants, parts, pooled
from gimbalcal.diagnose.verdict.random_walk import RandomWalkFinding, decide_with_walk, without_single_walks
from gimbalcal.diagnose.verdict.refit_calibration import calibrated, found_of
from gimbalcal.diagnose.verdict.threshold import clean_evidence_jointly
from gimbalcal.effects import CATALOGUE
from gimbalcal.effects.baseline_effects import BASELINE
from gimbalcal.effects.effect import SENSOR_STAGES
from gimbalcal.errors import InputError
from gimbalcal.number import Array
from gimbalcal.pipeline import Tell
from gimbalcal.recording import Recording
from gimbalcal.words import diagnosis_sentences

AVERAGED = ("chi2_reduced", "heldout")  # numbers of a fit that are averages over its rows


@dataclass(frozen=True)
class Share:
    """One recording in the common answer: its part of the fit, what it alone would have said, and its numbers."""

    part: Part
    alone: Decision
    walk: RandomWalkFinding | None  # of a single accelerometer, by this recording alone
    needed: float
    before: Scan
    fit: StatedNoiseFit
    curves: Curves


def diagnose_several(
    recordings: Sequence[Recording], calibration: Calibration | None, baseline: tuple[str, ...], seed: int, tell: Tell
) -> Diagnosis:
    """One diagnosis from several recordings of one unit; InputError if they are not that."""
    _check(recordings)
    rng = np.random.default_rng(seed)
    ids = [baseline_of(r, recordings, baseline) for r in recordings]
    searches = []
    for k, (r, mine) in enumerate(zip(recordings, ids, strict=True)):
        tell(f"recording {k + 1} of {len(recordings)}: {r.title}")
        if has_gyroscopes(r):
            tell("its gyroscopes are not looked at together with other recordings; give it alone for them")
        searches.append(searched(r, calibration, mine, tell))
    tell("adding up the evidence of all recordings")
    c = combine(searches)
    tell("sending simulated clean recordings of these designs through the same comparison")
    clean, alone = clean_evidence_jointly(c, rng)
    steady = [without_single_walks(s) for s in searches]
    held = c if all(a is b for a, b in zip(steady, searches, strict=True)) else combine(steady)
    d, walk = decide_with_walk(c, held, bar(clean))
    separate = [decide_with_walk(s, h, bar(x)) for s, h, x in zip(searches, steady, alone, strict=True)]
    odds = 0.0
    if walk is not None and d.verdict == "adequate":
        c = held
        d, law, odds = beyond_walk(steady, held, walk, seed, tell)
    else:
        law = lawful(c.searches, [c.within(d.shapes, k)[:1] for k in range(len(searches))], c, d.verdict, seed, tell)
    tell("locating the mismatch and checking held-out data")
    shares = _with_law(_shares(c, d, separate, alone, rng), law)
    options = {"baseline": [list(i) for i in ids], "seed": seed}
    tell("the model with what was found, as a calibration")
    made = _report(c, d, clean, shares, options, calibration, law)
    return made if walk is None or odds > CLAIM else _with_walk(made, walk, only=odds < -CLAIM)


def _with_walk(made: Diagnosis, walk: RandomWalkFinding, only: bool) -> Diagnosis:
    """Return the diagnosis with the walk of a sensor in one recording as the `only` explanation, or as another one."""
    words = diagnosis_sentences.walk_as_explanation(walk, only)
    return replace(
        made, unexplained=(walk.shape, *made.unexplained), in_words=f"{made.in_words} {words}.",
        outcome="; ".join(filter(None, [words, made.outcome])),
    )  # fmt: skip


def _with_law(shares: tuple[Share, ...], law: Lawful) -> tuple[Share, ...]:
    """The shares with what a law that no catalogue holds, if there is one, makes of their numbers."""
    each = zip(shares, law.each, strict=True) if law.each else ()
    made = (replace(x, fit=law.summary(x.fit), curves=replace(x.curves, after=r)) for x, (law, r) in each)
    return tuple(made) or shares


def _check(recordings: Sequence[Recording]) -> None:
    first = recordings[0]
    for r in recordings:
        if has_unstated_noise(r):
            raise InputError(
                f"{r.title!r} is a {r.kind} recording of {r.platform.name!r}: `diagnose` combines multi-position and "
                "static-run recordings with gimbals; give this one alone"
            )
        if (r.platform.name, r.platform.axis_names) != (first.platform.name, first.platform.axis_names):
            raise InputError(
                f"{first.title!r} is of platform {first.platform.name!r} and {r.title!r} of {r.platform.name!r}: "
                "`diagnose` combines recordings of one unit; run it on each"
            )
    files = [s for r in recordings for s in r.source if not s.path.endswith(".toml")]  # headers may well be alike
    seen = [s.sha256 for s in files]
    twice = next((s.path for s in files if seen.count(s.sha256) > 1), "")
    if twice or len({id(r) for r in recordings}) < len(recordings):
        raise InputError(f"{twice or first.title!r} is given twice: the same data are no more evidence; give it once")


def baseline_of(r: Recording, recordings: Sequence[Recording], wanted: Sequence[str]) -> tuple[str, ...]:
    """Effects that the model of one recording holds: those wanted that it can show, or the usual ones of its kind.

    A constant of the sensors that any of the recordings calibrates is part of the model in all of them.
    """
    if wanted:
        return tuple(i for i in wanted if not unfit(i, r)) or BASELINE[r.kind]
    every = [i for other in recordings for i in BASELINE[other.kind] if CATALOGUE[i].stage in SENSOR_STAGES]
    return tuple(dict.fromkeys([*BASELINE[r.kind], *(i for i in every if CATALOGUE[i].shows_in(r.kind))]))


def _shares(
    c: CombinedRanking, d: Decision, separate: Sequence[tuple[Decision, RandomWalkFinding | None]],
    clean: Sequence[Array], rng: np.random.Generator,
) -> tuple[Share, ...]:  # fmt: skip
    members = d.hypothesis.members if d.hypothesis else ()
    out = []
    for k, part in enumerate(parts(c, members)):
        s = c.searches[k]
        seen = part.fit
        if not members and (shapes := c.within(d.shapes, k)):
            seen = fit_causes(s, shapes[:1])  # the noise as it is once the shape is allowed for
        verdict, walk = separate[k]
        out.append(Share(part, verdict, walk, bar(clean[k]), *measured(part.search, part.fit, seen, rng)))
    return tuple(out)


def _report(
    c: CombinedRanking, d: Decision, clean: Array, shares: tuple[Share, ...], options: dict[str, Any],
    known: Calibration | None, law: Lawful,
) -> Diagnosis:  # fmt: skip
    lead = min(range(len(shares)), key=lambda k: (shares[k].before.p_value, -shares[k].before.statistic.max()))
    mismatch = () if d.verdict == "adequate" else _mismatch(shares, lead)
    named = _findings(c, d, [x.part for x in shares])
    unexplained = tuple(_shape(c, i) for i in d.shapes[:3])
    fitted = replace(_sums(shares, lead), recordings=tuple(_row(c, k, x) for k, x in enumerate(shares)))
    provenance = {
        "version": gimbalcal.__version__,
        "recordings": [row for s in c.searches for row in s.fit.view.source.files],
        "options": options,
        "ln_bayes_factor": round(c.ln_total, 3),
        "ln_bayes_factor_needed": round(bar(clean), 3),
        "false_alarm_rate_simulated": float(np.mean(clean >= CLAIM)),
        "probability_unknown": round(d.unknown, 4),
        "causes_compared": len({(x.effect, x.axis, x.source) for x in c.library.candidates if not x.rival}),
        "excess_kurtosis": round(max(s.fit.view.noise.kurtosis for s in c.searches), 3),
    }
    words = [diagnosis_sentences.answer(d.verdict, [(c.searches[lead].fit.view, fitted, named)], unexplained, mismatch)]
    words += [f.agreement.in_words for f in named if f.agreement and f.agreement.in_words]
    words.append(_each_alone(shares))
    made, between = _calibrated(c, d, shares, diagnosis_sentences.reservation(d.verdict, named, unexplained), known)
    fitted = replace(fitted, constants=between)
    verdict, differ, recommend = d.verdict, between.in_words, law.recommend
    if verdict == "adequate" and (only := _shown_by_one(c, shares)):
        verdict, unexplained = "unexplained", only
        words.insert(0, "What one recording shows by itself is contradicted by the others.")
    if differ:
        recommend = recommend or APART
        words.insert(0, differ)
        unexplained += (Shape("all", "constants that differ between the recordings"),)
        verdict = "unexplained" if verdict == "adequate" else verdict
    return Diagnosis(
        verdict, mismatch, named, unexplained, fitted, provenance, " ".join(words), shares[lead].curves, made,
        differ.rstrip("."), laws=law.laws, recommend=recommend,
    )  # fmt: skip


def _calibrated(
    c: CombinedRanking, d: Decision, shares: Sequence[Share], outcome: str, known: Calibration | None
) -> tuple[Calibration, ConstantsAgreement]:
    """The calibration of the unit from all recordings, with their common sizes, and how well these agree."""
    members, each = d.hypothesis.members if d.hypothesis else (), [x.part for x in shares]
    causes = [c.library.candidates[m] for m in members]
    x, C = pooled(each, [len(cause.parameters) for cause in causes])
    told = [common_constants(c, members, each, j) for j in range(len(causes))]
    seen = [(p.search.fit, p.fit.projection.node, p.slots) for p in each]
    made, between = calibrated(seen, found_of(causes, told, x, C), outcome, known)
    assert between is not None  # there are several
    return made, between


def _mismatch(shares: Sequence[Share], lead: int) -> tuple[Mismatch, ...]:
    """Return where each recording is off, the one that is off most first."""
    out = []
    for k in sorted(range(len(shares)), key=lambda k: k != lead):
        for m in mismatches(shares[k].before, at_least=int(k == lead)):
            words = f"In recording {k + 1}, {m.in_words[0].lower()}{m.in_words[1:]}"
            out.append(replace(m, recording=k + 1, in_words=words))
    return tuple(out[:LISTED])


def _findings(c: CombinedRanking, d: Decision, shares: Sequence[Part]) -> tuple[Finding, ...]:
    """Return the findings, with the size by all recordings and the size by each."""
    members = d.hypothesis.members if d.hypothesis else ()
    counts = [len(c.library.candidates[m].parameters) for m in members]
    x, C = pooled(shares, counts)
    starts, out = np.cumsum([0, *counts]), []
    for j, m in enumerate(members):
        cause, at = c.library.candidates[m], slice(starts[j], starts[j + 1])
        rows = printed(cause.parameters, x[at], np.sqrt(np.diag(C))[at])
        rows += constants(cause, common_constants(c, members, shares, j))
        significance = float(np.sqrt(sum(p.fit.significance[p.slots.index(j)] ** 2 for p in shares if j in p.slots)))
        advice = _advice(c, d, shares, j, x[at])
        made = entry(d.judgements[j], axes_of(d.judgements[j]), significance, rows, advice)
        out.append(replace(made, recordings=_sizes(shares, j), agreement=_agreement(shares, j, made)))
    return tuple(out)


def _sizes(shares: Sequence[Part], slot: int) -> tuple[RecordingSize, ...]:
    """The size that each recording gives a member."""
    out = []
    for k, p in enumerate(shares):
        if slot in p.slots:
            n, at = p.slots.index(slot), p.span(slot)
            sigma = np.sqrt(np.diag(p.fit.covariance))[at]
            rows = printed(p.search.library.candidates[n].parameters, p.fit.x[at], sigma)
            out.append(RecordingSize(k + 1, round(p.fit.significance[n], 2), tuple(rows)))
    return tuple(out)


def _agreement(shares: Sequence[Part], slot: int, found: Finding) -> SizeAgreement:
    a = agreement_on_size(shares, slot)
    return SizeAgreement(
        round(a.chi2, 3), a.dof, a.p_value, a.against(diagnosis_sentences.cause_in_words(found.effect, found.axis))
    )


def _advice(c: CombinedRanking, d: Decision, shares: Sequence[Part], slot: int, size: Array) -> str:
    """Return what would separate a member from the cause most like it, in the recording that shows it best."""
    for fits in d.judgements[slot].alike[:1]:
        alike = next(i for i, one in enumerate(c.library.candidates) if one is fits)
        both = [k for k in c.sees(alike) if slot in shares[k].slots]
        for k in sorted(both, key=lambda k: -shares[k].fit.significance[shares[k].slots.index(slot)])[:1]:
            found = shares[k].search.library.candidates[shares[k].slots.index(slot)]
            other = c.searches[k].library.candidates[int(c.place[alike, k])]
            return sentence(advise(c.searches[k].fit, found, 0, size, other), found, other)
    return ""


def _shape(c: CombinedRanking, i: int) -> Shape:
    """A shape without a cause, and which recordings show it."""
    seen = [k + 1 for k in c.sees(i)]
    where = f"recording {seen[0]}" if len(seen) == 1 else "every recording that could show it"
    rest = shape(c.library.candidates[i])
    return replace(rest, channel=f"{rest.channel} of {where}", recordings=tuple(seen))


def _sums(shares: Sequence[Share], lead: int) -> StatedNoiseFit:
    """The numbers of all recordings together; noise and calibration are those of the recording that is off most."""
    sums: dict[str, Any] = {}
    sizes = [x.part.search.rows.Q.shape for x in shares]
    for what in AVERAGED:
        for when in ("before", "after"):
            fitted = [len(x.part.fit.index) if when == "after" else 0 for x in shares]
            weight = [R - (q + p if what == "chi2_reduced" else 0) for (R, q), p in zip(sizes, fitted, strict=True)]
            key = f"{what}_{when}"
            sums[key] = float(np.average([getattr(x.fit, key) for x in shares], weights=weight))
    for when in ("before", "after"):
        p = [getattr(x.fit, f"scan_p_{when}") for x in shares]
        sums[f"scan_p_{when}"] = float(-np.expm1(len(p) * np.log1p(-min(*p, 1 - 1e-15))))
    return replace(shares[lead].fit, **sums, heldout_by=" and ".join(dict.fromkeys(x.fit.heldout_by for x in shares)))


def _row(c: CombinedRanking, k: int, x: Share) -> RecordingFit:
    """One recording in `fit`: what it is, its numbers, and what it alone would have said."""
    s = c.searches[k]
    walks = x.walk is not None and x.alone.verdict == "adequate"
    verdict = "unexplained" if walks else x.alone.verdict
    alone = SeparateVerdict(verdict, _called(x), round(s.ln_total, 3), round(x.needed, 3))
    return RecordingFit(k + 1, s.fit.view.source.title, s.fit.view.kind, x.fit, alone)


def _called(x: Share) -> str:
    """Return the verdict on one recording by itself in a few words."""
    d = x.alone
    if x.walk is not None and d.verdict == "adequate":
        return diagnosis_sentences.walk_in_words(x.walk)
    if d.verdict == "adequate":
        return "nothing is missing"
    if d.hypothesis is None:
        return "something is missing that no cause of the catalogue explains"
    return " and ".join(
        diagnosis_sentences.cause_in_words(j.cause.effect, j.cause.axis, j.confounded) for j in d.judgements
    )


def _shown_by_one(c: CombinedRanking, shares: Sequence[Share]) -> tuple[Shape, ...]:
    """Return, as shapes, what recordings show by themselves beyond the odds that one of so many shows it by chance."""
    odds = float(np.log(len(shares)))
    return tuple(
        Shape(f"recording {k + 1}", _called(x), (k + 1,))
        for k, x in enumerate(shares)
        if x.alone.verdict != "adequate" and c.searches[k].ln_total > x.needed + odds
    )


def _each_alone(shares: Sequence[Share]) -> str:
    """One sentence: what each recording would have said by itself."""
    verdicts = "; ".join(f"recording {k + 1}: {_called(x)}" for k, x in enumerate(shares))
    return f"With this model each alone would have said: {verdicts}."
