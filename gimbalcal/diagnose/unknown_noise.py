"""Diagnosis of recordings whose noise nobody states: pointing runs, units turned by hand, tilting tables.

    recording ──> views ──> steps (what is taken up, exchanged, dropped) ──> each cause judged ──> diagnosis

A unit turned by hand has two views: its accelerometers through the norm of gravity, its gyroscopes at rest.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

import gimbalcal
from gimbalcal.calibration import Calibration
from gimbalcal.diagnose.answer import VERDICTS, Diagnosis
from gimbalcal.diagnose.rows.baseline import by_triad, carried
from gimbalcal.diagnose.rows.rest_rates import rest_rates
from gimbalcal.diagnose.rows.slews import view_of_slews
from gimbalcal.diagnose.rows.turns import view_of_turns
from gimbalcal.diagnose.search.relinearise import about_first_cause
from gimbalcal.diagnose.search.stepwise import stepwise
from gimbalcal.diagnose.verdict.detection_limits import limits_in_words
from gimbalcal.diagnose.verdict.refit_calibration import origin
from gimbalcal.diagnose.verdict.view_calibration import Seen, calibrated_views
from gimbalcal.diagnose.view_diagnosis import ViewDiagnosis, curves_of, diagnose_view, diagnosis_of
from gimbalcal.effects import CATALOGUE, Effect
from gimbalcal.effects.baseline_effects import BASELINE
from gimbalcal.effects.effect import constants
from gimbalcal.errors import InputError
from gimbalcal.estimate.accelerometers.fit_summary import joined
from gimbalcal.estimate.pointing.pattern import MISTAKEN, strays, why_far
from gimbalcal.estimate.systematic.calibrate import navigation_view
from gimbalcal.estimate.systematic.segments import turned_in_place
from gimbalcal.pipeline import Tell
from gimbalcal.recording import Recording
from gimbalcal.recording.record import FORCE, RATE
from gimbalcal.units import from_si
from gimbalcal.views.core import View
from gimbalcal.views.norm import norm
from gimbalcal.views.pointing import MAX_FILTERED_STARS, pointing
from gimbalcal.views.tilting_table import tilting_table
from gimbalcal.words import diagnosis_sentences

ROUNDS = 2  # in which stars are left out: those that the first hid show in the second
STRAYS = 0.05  # of the stars, at the most; more are a pattern, or the tails of the seeing


def applies(recording: Recording) -> bool:
    """Whether a recording is one of these: pointing, a unit without gimbals, or forces and rates while it turns."""
    return recording.kind.sighting or (not recording.kind.stabilised and not recording.platform.axes)


def diagnose_unknown_noise(
    recording: Recording, calibration: Calibration | None, baseline: Sequence[str], seed: int, tell: Tell
) -> Diagnosis:
    """What was left out of the models of such a recording."""
    if recording.kind.sighting or recording.kind.rotating:
        told, notes = without_norm_outliers(recording, calibration, baseline, tell)
    else:
        told, notes = of_triads(recording, calibration, baseline, tell)
    if not told:
        raise InputError(
            f"{recording.title!r} leaves nothing to compare: at rest it takes {FORCE} along x, y and z, and "
            f"{RATE} in a unit with a scale for the gyroscopes"
        )
    return _together(recording, told, notes, baseline, seed)


def without_norm_outliers(
    recording: Recording, calibration: Calibration | None, baseline: Sequence[str], tell: Tell
) -> tuple[list[ViewDiagnosis], list[str]]:
    """What the one view of a recording says, and a note on each star that was left out as far off all others.

    One that is nine sigma off is half of the scatter of eighty: what is as large as that scatter does not show beside.
    """
    notes: list[str] = []
    while True:
        v = alone(recording, calibration, baseline, tell)
        told = diagnosis_of(about_first_cause(stepwise(v, tell), tell), tell)
        n = len(v)
        off = strays(told.after) if recording.kind.sighting and n <= MAX_FILTERED_STARS and len(notes) < ROUNDS else []
        if not 0 < len(off) <= STRAYS * n:
            return [told], notes
        number = v.stimulus.position
        size = [float(from_si(float(np.linalg.norm(told.after[k] * told.sigma[k])), v.unit)) for k in off]
        at, axis = v.stimulus.true_angle, v.stimulus.axis_names[0]
        why = MISTAKEN if at is None else why_far(told.after * told.sigma, at[:, :2], off, axis)
        notes.append(diagnosis_sentences.omitted_stars([int(number[k]) for k in off], size, v.unit, why))
        tell(notes[-1])
        recording = replace(recording, position=number).select(np.delete(np.arange(n), off))


def alone(recording: Recording, calibration: Calibration | None, baseline: Sequence[str], tell: Tell) -> View:
    """The one view of a pointing run, of a unit turned in its place, or of a tilting table."""
    if recording.kind.rotating:
        if not turned_in_place(recording):
            return tilting_table(recording, baseline)
        usual = tuple(baseline) or BASELINE["rotation"]
        return navigation_view(recording, usual, tell, tuple(e for e in carried(calibration, ()) if e.id not in usual))
    # every term is fitted anew: a calibration says which the model holds
    held = tuple(dict.fromkeys(p.effect for p in calibration.parameters)) if calibration else ()
    return pointing(recording, baseline or held)


def of_triads(
    recording: Recording, calibration: Calibration | None, baseline: Sequence[str], tell: Tell
) -> tuple[list[ViewDiagnosis], list[str]]:
    """What the views of a unit turned by hand say, one after the other, and notes on what was not looked at.

    The gyroscopes are held against accelerometers with what was found there: both triads are one model. A baseline of
    gyroscope effects alone asks for the gyroscopes alone, and so on.
    """
    mine, gyro = by_triad(baseline)
    told: list[ViewDiagnosis] = []
    if recording.has(FORCE) and (mine or not baseline):
        told.append(diagnose_view(norm(recording, mine), tell))
    if not (recording.has(RATE) and recording.has(FORCE) and (gyro or not baseline)):
        return told, []
    made = calibration_of(recording, told, "") if told else calibration
    at_rest = rest_rates(recording, gyro, made)
    if at_rest is None:
        note = diagnosis_sentences.gyroscopes_not_analysed(diagnosis_sentences.COUNTS_WITHOUT_SCALE)
        tell(note)
        return told, [note]
    still = diagnose_view(at_rest, tell)
    told.append(still)
    if gyro:
        return told, []
    if told[0].verdict == "unexplained" and told[0] is not still:
        return told, [diagnosis_sentences.rate_not_analysed("no model explains the forces")]
    moving = view_of_turns(recording, made, found_at_rest(still))
    if moving is None or made is None:
        return told, [diagnosis_sentences.motion_not_analysed("too few turns were logged to say how the unit turned")]
    told.append(diagnosis_of(stepwise(moving, tell), tell))
    late, notes = on_the_way(recording, made, told[-1].model.effects, tell)
    return [*told, *late], notes


def on_the_way(
    recording: Recording, made: Calibration, gyro: Sequence[Effect], tell: Tell, means: bool = False
) -> tuple[list[ViewDiagnosis], list[str]]:
    """What the slews say of delays between channels, or a note why they say nothing; see `view_of_slews`."""
    v = view_of_slews(recording, made, gyro, means)
    if isinstance(v, str):
        return [], [diagnosis_sentences.motion_not_analysed(v)]
    tell("the slews: do all channels agree in time")
    return [diagnosis_of(stepwise(v, tell), tell)], []


def found_at_rest(still: ViewDiagnosis) -> tuple[Effect, ...]:
    """The model of the rests where something beyond the baseline was found; nothing where the neighbours tell more."""
    return still.model.effects if still.findings else ()


def _together(
    recording: Recording, told: Sequence[ViewDiagnosis], notes: Sequence[str], baseline: Sequence[str], seed: int
) -> Diagnosis:
    lead = max(told, key=lambda t: VERDICTS.index(t.verdict))
    verdict = lead.verdict
    fit = lead.fit if len(told) == 1 else replace(lead.fit, views={t.view.name: t.fit for t in told})
    found = tuple(f for t in told for f in t.findings)
    shapes = tuple(u for t in told for u in t.unexplained)
    mismatch = tuple(m for t in (lead, *(t for t in told if t is not lead)) for m in t.mismatch)
    provenance = {
        "version": gimbalcal.__version__,
        "recordings": recording.files,
        "options": {"baseline": list(baseline) or [i for t in told for i in t.view.baseline], "seed": seed},
        "views": [t.view.name for t in told],
        **({"notes": list(notes)} if notes else {}),
    }
    words = diagnosis_sentences.answer_of_views(verdict, [(t.view, t.fit, t.findings) for t in told], shapes, mismatch)
    hidden = limits_in_words([u for t in told for u in t.fit.unseen or ()]) if verdict == "adequate" else ""
    also = outcome_of(told)
    words = " ".join(
        filter(None, [words, hidden, diagnosis_sentences.delays(found), f"{also}." if also else "", *notes])
    )
    made = calibration_of(recording, told, diagnosis_sentences.reservation(verdict, found, shapes))
    recommend = next(filter(None, (t.recommend for t in (lead, *told))), "")
    return Diagnosis(verdict, mismatch, found, shapes, fit, provenance, words, curves_of(lead), made, outcome=also,
                     laws=tuple(law for t in told for law in t.laws), recommend=recommend)  # fmt: skip


def outcome_of(told: Sequence[ViewDiagnosis]) -> str:
    """What else the views say, in sentences."""
    return joined([t.outcome for t in told if t.outcome])


def calibration_of(
    recording: Recording, told: Sequence[ViewDiagnosis], outcome: str, forces: Calibration | None = None
) -> Calibration:
    """The calibration that the views end in, with what another road says of the forces."""
    causes = [f"{f.effect}:{f.axis}".rstrip(":") for t in told for f in t.findings]
    for t in told:
        if t.view.calibrate is not None:  # states of the navigator that the rows come from
            linear = [p for p in t.model.parameters if p.field not in {f.name for f in constants(CATALOGUE[p.effect])}]
            found = t.view.calibrate(t.model.effects, linear)
            return replace(
                found, method="diagnosis", outcome=outcome or found.outcome, provenance=origin([recording], causes)
            )
    carried = [Seen(t.view, t.model) for t in told if t.view.name != "slews"]  # stamps are shifted, not calibrated
    return calibrated_views(recording, carried, causes, outcome, forces)
