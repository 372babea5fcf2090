"""The way in: which kind of diagnosis a recording, or several, take."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from gimbalcal.calibration import Calibration
from gimbalcal.calibration.correction import refuse_other_gimbals
from gimbalcal.calibration.gravity_uncertainty import with_gravity
from gimbalcal.diagnose.answer import Diagnosis
from gimbalcal.diagnose.cost import with_cost
from gimbalcal.diagnose.law_calibration import with_laws
from gimbalcal.diagnose.of_recording import (
    DiagnosisRequest,
    diagnose_jointly,
    diagnose_recording,
    lacks_known_attitude,
    why_not_in_model,
)
from gimbalcal.diagnose.result import Shape
from gimbalcal.effects import CATALOGUE
from gimbalcal.effects.baseline_effects import ACCELEROMETER_TERMS
from gimbalcal.effects.effect import constants
from gimbalcal.effects.loading import files_outside
from gimbalcal.entries import plain_json
from gimbalcal.errors import InputError
from gimbalcal.estimate.accelerometers.fit_summary import joined_sentences
from gimbalcal.estimate.caveats import caveats, too_few_attitudes
from gimbalcal.estimate.grade import Graded, grade_of_unit, refuse_for_mounts
from gimbalcal.estimate.pointing.fit import usual_terms
from gimbalcal.estimate.pointing.mount import pointing_calibration
from gimbalcal.estimate.unit import inertial_unit, unit_of_sessions
from gimbalcal.history.fleet import Fleet, grade_and_fleet, with_fleet
from gimbalcal.pipeline import three_stage
from gimbalcal.progress import Progress, no_progress
from gimbalcal.recording import Recording, join, when_recorded, with_rests_as_positions
from gimbalcal.recording.columns import SPARSE
from gimbalcal.recording.joining import refuse_twice
from gimbalcal.unusual_constants import with_question
from gimbalcal.views.core import by_triad
from gimbalcal.views.pointing import read_axes, split_nights
from gimbalcal.views.segments import turned_in_place
from gimbalcal.words.naming import capitalised


def diagnose(
    recordings: Sequence[Recording],
    calibration: Calibration | None = None,
    baseline: Sequence[str] = (),
    seed: int = 1,
    progress: Progress = no_progress,
    grade: str | Fleet = "",
) -> Diagnosis:
    """Say where the recordings differ from the calibrated model and which physics was left out.

    Several recordings are those of one unit and are judged together. `calibration` gives values to start from,
    `baseline` the ids of the effects the model holds (the usual ones of the kind of recording otherwise), `grade` the
    name of the unit's grade (else it is estimated from the noise); with "fleet:FILE", or a fleet, its units are the
    prior of the refit. Raises InputError where there is nothing to compare.
    """
    grade, known = grade_and_fleet(grade)
    if not recordings:
        raise InputError("`diagnose` needs at least one recording")
    check_baseline(baseline, recordings)
    for r in recordings:
        check_finite(r)
        if calibration is not None and r.platform.axes:
            refuse_other_gimbals(calibration.effects, r)
    refuse_twice(recordings)
    recordings = [with_rests_as_positions(r) for r in recordings]
    request = DiagnosisRequest(tuple(recordings), calibration, tuple(baseline), seed, progress)
    date = when_recorded(recordings)
    provenance: dict[str, Any] = {"recorded": date} if date else {}
    if all(r.kind.sighting for r in recordings):
        refuse_for_mounts(grade)
        diagnosis = _diagnose_request(request)
    else:
        unit = grade_of_unit(recordings, grade)
        progress(unit.in_words)
        diagnosis = _with_question(
            _diagnose_request(replace(request, recordings=tuple(unit.of(recordings)))), request, unit
        )
        provenance["grade"] = unit.origin.to_dict()
    if known is not None and diagnosis.calibration is not None:
        diagnosis = replace(diagnosis, calibration=with_fleet(diagnosis.calibration, known, recordings))
    diagnosis = with_laws(diagnosis, request, known or grade)
    diagnosis = _with_effect_files(replace(diagnosis, provenance={**diagnosis.provenance, **provenance}))
    return with_cost(recordings, diagnosis, progress)


def _with_effect_files(diagnosis: Diagnosis) -> Diagnosis:
    """The diagnosis with the effect files that were compared in addition to the catalogue, and those in use."""
    if not (compared := files_outside()):
        return diagnosis
    calibration = diagnosis.calibration
    if calibration is not None:
        files = files_outside({p.effect for p in calibration.parameters})
        files = (*(calibration.provenance.effects or ()), *files)
        calibration = replace(calibration, provenance=replace(calibration.provenance, effects=files or None))
    return replace(
        diagnosis, calibration=calibration, provenance={**diagnosis.provenance, "effects": plain_json(compared)}
    )


def _with_question(diagnosis: Diagnosis, request: DiagnosisRequest, unit: Graded) -> Diagnosis:
    """Return the diagnosis, with a question if constants of its refit are implausible for any unit."""
    if diagnosis.calibration is None:
        return diagnosis
    if diagnosis.outcome and diagnosis.verdict == "unexplained":
        return diagnosis  # positions that were not held leave constants of any size
    calibration = with_gravity(diagnosis.calibration, request.recordings)
    causes = {f.effect for f in diagnosis.findings}
    doubted = with_question(calibration, request.recordings, unit, _quick_calibration, causes, diagnosis.outcome)
    question = doubted.provenance.options.question if doubted is not calibration else ""
    if not question:
        return replace(diagnosis, calibration=calibration)
    return replace(
        diagnosis,
        calibration=doubted,
        outcome="; ".join(filter(None, [question, diagnosis.outcome])),
        in_words=f"{diagnosis.in_words} But {question}.",
    )


def _quick_calibration(recordings: Sequence[Recording]) -> Calibration:
    """The usual constants of changed recordings."""
    gimbals = all(r.platform.axes and not r.kind.rotating for r in recordings)
    if not gimbals and (len(recordings) > 1 or not recordings[0].kind.in_positions):
        raise InputError("there is no calibration that is quick enough to try slips with")
    return three_stage(recordings) if gimbals else inertial_unit(recordings[0])


def _diagnose_request(request: DiagnosisRequest) -> Diagnosis:
    from threadpoolctl import threadpool_limits

    with threadpool_limits(limits=1):  # many small matrices: threads only get into each other's way
        diagnosis = _by_kind(request)
        return diagnosis if request.calibration else with_caveats(diagnosis, request.recordings, request.baseline)


def with_caveats(d: Diagnosis, recordings: Sequence[Recording], baseline: Sequence[str]) -> Diagnosis:
    """Return the diagnosis; where it is adequate and a calibration is not, with an `outcome` that says why.

    Where nothing explains a unit turned in its place, an input error that a calibration names is stated.
    """
    few = too_few_attitudes(recordings, baseline)
    if few:
        d = replace(d, in_words=f"{d.in_words} But {few}.")
    if d.verdict == "unexplained":
        slip = _outcome_in_place(d, recordings)[1]
        return replace(d, in_words=f"{d.in_words} {capitalised(slip)}.") if slip else d
    if d.verdict != "adequate":
        return d
    used = recordings if d.used is None else [d.used]
    every = [_outcome_in_place(d, recordings)[0], *(words for r in used for words in caveats(r, baseline))]
    reasons = list(dict.fromkeys(filter(None, every)))
    if few:
        return replace(d, outcome=joined_sentences([few, *reasons]), provenance={**d.provenance, "untested": True})
    if not reasons:
        return d
    outcome, stated = joined_sentences([d.outcome, *reasons]), any(r.noise for r in recordings)
    of = "stated noise" if stated else "noise of the samples"
    words = f"No catalogued cause is significant, but the residuals exceed the {of}. {outcome}."
    return replace(d, outcome=outcome, in_words=words, provenance={**d.provenance, "noise_stated": stated})


def _outcome_in_place(d: Diagnosis, recordings: Sequence[Recording]) -> tuple[str, str]:
    """Return what speaks against the model of a unit turned in its place, and the input error that is suspected."""
    if d.without is None or not turned_in_place(recordings[0]):
        return "", ""
    reason, _, slip = d.without("").outcome.partition("; ")
    return reason, "" if "`gimbalcal diagnose`" in slip else slip


def _by_kind(request: DiagnosisRequest) -> Diagnosis:
    if all(r.kind.sighting for r in request.recordings):
        return _diagnose_nights(request)
    if len(request.recordings) == 1:
        return diagnose_recording(request)
    by_hand = all(lacks_known_attitude(r) and r.kind.in_positions for r in request.recordings)
    return _diagnose_sessions(request) if by_hand else diagnose_jointly(request)


def _diagnose_sessions(request: DiagnosisRequest) -> Diagnosis:
    """Sessions of one unit turned by hand: their rests together, and whether they share their constants at all."""
    diagnosis = _diagnosed_as_one(request)
    terms = by_triad(request.baseline)[0] or ACCELEROMETER_TERMS
    compare = partial(unit_of_sessions, request.recordings, terms)
    return _with_agreement(diagnosis, "session", "agree on their constants", compare, request.progress)


def _diagnosed_as_one(request: DiagnosisRequest) -> Diagnosis:
    """Diagnose sessions or nights as one recording, and state the assumed time between them."""
    both = join(request.recordings)
    diagnosis = diagnose_recording(request.of(both))
    if len(request.recordings) == 1:
        return diagnosis
    remark = both.remarks[-1]
    return replace(diagnosis, in_words=f"{diagnosis.in_words} {capitalised(remark)}.")


def _diagnose_nights(request: DiagnosisRequest) -> Diagnosis:
    """Pointing runs of one mount: all nights together, and whether they share their terms at all.

    The terms are those of the result and those of `calibrate`: one that differs between nights need not show in all of
    them together.
    """
    diagnosis = _diagnosed_as_one(request)
    if diagnosis.calibration is None or sum(len(split_nights(r)) for r in request.recordings) == 1:
        return diagnosis
    effects = (p.effect for p in diagnosis.calibration.parameters)
    usual = (term.partition(":")[0] for term in usual_terms(read_axes(request.recording)))
    terms = tuple(
        e for e in dict.fromkeys((*effects, *usual)) if not constants(CATALOGUE[e])
    )  # the same constants would be sought in every night
    compare = partial(pointing_calibration, [replace(r, noise={}) for r in request.recordings], terms)
    diagnosis = _with_agreement(diagnosis, "night", "share their terms", compare, request.progress)
    if not diagnosis.outcome:
        return diagnosis
    shape = Shape("pointing", "terms that differ from night to night")
    verdict = "unexplained" if diagnosis.verdict == "adequate" else diagnosis.verdict
    return replace(diagnosis, verdict=verdict, unexplained=(*diagnosis.unexplained, shape))


def _with_agreement(
    d: Diagnosis, each: str, alike: str, compare: Callable[[], Calibration], progress: Progress
) -> Diagnosis:
    """Return the diagnosis of all recordings, and whether each agrees with the others."""
    progress(f"comparing each {each} with the others")
    try:
        shared = compare()
    except InputError as problem:
        return replace(d, in_words=f"{d.in_words} Whether the {each}s {alike} cannot be determined: {problem}.")
    compared = shared.provenance.nights or shared.provenance.options.sessions or ()
    unknown = f"whether the {each}s {alike} cannot be determined: fewer than two of them determine the terms"
    words = (shared.outcome or (f"the {each}s {alike}" if compared else unknown)).rstrip(".")
    listed = plain_json(compared)
    return replace(
        d,
        in_words=f"{d.in_words} {capitalised(words)}.",
        provenance={**d.provenance, f"{each}s": listed},
        outcome=shared.outcome,
    )


def check_baseline(ids: Sequence[str], recordings: Sequence[Recording]) -> None:
    """Raise InputError for an effect that none of the recordings can hold in its model."""
    for effect_id in ids:
        reasons = [why_not_in_model(effect_id, r) for r in recordings]
        if all(reasons):
            raise InputError(f"the baseline names {effect_id!r}, which {reasons[0]}; leave it out of --baseline")


def check_finite(recording: Recording) -> None:
    """Raise InputError, with row and channel, for a value that is no number."""
    for (quantity, axis), x in recording.channels.items():
        bad = np.flatnonzero(~np.isfinite(x)) if quantity not in SPARSE else np.zeros(0)
        if bad.size:
            name = f"{quantity} {axis}".strip()
            raise InputError(
                f"{recording.title!r}, row {bad[0] + 1}, {name}: the value is not a finite number; leave such rows out"
            )
