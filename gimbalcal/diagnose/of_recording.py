r"""The views of one recording, in the order in which one needs what another has found, and their joint diagnosis.

    recording ──> views ──> a diagnosis of each ──> one diagnosis

At a known attitude the scatter of the samples gives the scale of the noise. Of telescopes and units turned by hand it
is fitted: accelerometers are compared with the norm of gravity, gyroscopes at rest and between rests. Where gimbals
determine the attitude, they also determine how the Earth's rate lies in the unit, up to the heading psi of the base,
which the dwells determine:

.. math:: \omega_{ie}^p = \Omega \, C_b^p \, (\cos L \cos\psi, \; -\cos L \sin\psi, \; -\sin L)^T
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gimbalcal.calibration import Calibration
from gimbalcal.diagnose.answer import Diagnosis
from gimbalcal.diagnose.estimated_noise import diagnose_selected, select_causes
from gimbalcal.diagnose.joint_diagnosis import calibration_of, joint_diagnosis
from gimbalcal.diagnose.known_noise import diagnose_known_noise
from gimbalcal.diagnose.laws.law_file import source_text
from gimbalcal.diagnose.result import Shape
from gimbalcal.diagnose.search.refit import start_with_baseline
from gimbalcal.diagnose.verdict.verify import row_sigma
from gimbalcal.diagnose.view_result import Contradiction, ViewDiagnosis
from gimbalcal.effects import CATALOGUE, Effect, known_effect, parameters, zero_effect
from gimbalcal.effects.baseline_effects import BASELINE
from gimbalcal.effects.effect import SENSOR_STAGES, followed_covariate
from gimbalcal.effects.loading import temporarily_loaded
from gimbalcal.errors import InputError
from gimbalcal.estimate.accelerometers.fit_summary import outliers_in_words
from gimbalcal.estimate.accelerometers.multiposition import usual_accelerometers
from gimbalcal.estimate.accelerometers.norm_outliers import norm_outliers, norm_outliers_in_words
from gimbalcal.estimate.caveats import position_faults
from gimbalcal.estimate.fit import fit
from gimbalcal.estimate.gyroscopes.rate_table import on_a_table
from gimbalcal.estimate.gyroscopes.rest_and_turn_fits import (
    MIN_RESTS,
    MIN_TURNS,
    view_at_rest,
    view_of_turns,
)
from gimbalcal.estimate.pointing.pattern import MISTAKEN, outlying_stars, why_far
from gimbalcal.estimate.systematic.calibrate import navigation_view
from gimbalcal.kinematics import ideal_force
from gimbalcal.number import Array
from gimbalcal.progress import Progress
from gimbalcal.recording import Recording, dwell_means
from gimbalcal.recording.dwell import attitudes, in_blocks, without_dwells
from gimbalcal.recording.kinds import MULTI_POSITION
from gimbalcal.recording.record import FORCE, RATE
from gimbalcal.units import from_si
from gimbalcal.views.core import View, by_triad, effects_of_another_day
from gimbalcal.views.known_attitude import view_at_known_attitude
from gimbalcal.views.norm import norm
from gimbalcal.views.pointing import MAX_FILTERED_STARS, means_of_tracking, outlying_frames
from gimbalcal.views.rest_rates import without_earth_rate
from gimbalcal.views.segments import turned_in_place
from gimbalcal.views.slews import view_of_slews
from gimbalcal.views.tilting_table import tilting_table
from gimbalcal.views.turns import TURNS
from gimbalcal.words import diagnosis_sentences
from gimbalcal.words.naming import capitalised

ROUNDS = 2  # in which stars are omitted: those that the first hid show in the second
MAX_OUTLIER_SHARE = 0.05  # of the stars, at the most; more are a pattern, or the tails of the seeing
MIN_OUTLIER_SCATTERS = 8.0  # median deviations, or five sigma, that the causes found leave of a rest that is an outlier
MIN_BLOCKS = 30  # dwells of one attitude, below which long ones are cut: a sweep is a curve
IDEAL_AT_GIMBALS = Calibration.ideal("gimbals")

Parts = tuple[list[ViewDiagnosis], list[str]]
"""Diagnoses of views, and notes on what was not analysed."""


@dataclass(frozen=True)
class DiagnosisRequest:
    """What is to be diagnosed: recordings of one unit, values to start from, ids of effects that the model holds.

    seed: of the simulated clean recordings; progress: where it is reported.
    """

    recordings: tuple[Recording, ...]
    calibration: Calibration | None
    baseline: tuple[str, ...]
    seed: int
    progress: Progress

    @property
    def recording(self) -> Recording:
        """The first recording, or the only one."""
        return self.recordings[0]

    def of(self, recording: Recording) -> DiagnosisRequest:
        """Return the same of one recording alone."""
        return replace(self, recordings=(recording,))


def lacks_known_attitude(recording: Recording) -> bool:
    """Return whether no sensor is read at a known attitude: stars, units without gimbals, and while a unit turns.

    The scale of the noise is then fitted, whatever `[noise]` states.
    """
    return recording.kind.sighting or (not recording.kind.stabilised and not recording.platform.axes)


def diagnose_recording(request: DiagnosisRequest) -> Diagnosis:
    """Diagnose every view of a recording, and return one diagnosis. Raises InputError where nothing is to compare."""
    recording, notes = request.recording, list[str]()
    if recording.kind.stabilised:
        parts = [diagnose_views(request, known_view(request, request.baseline))]
    elif recording.kind.view or (recording.kind.rotating and lacks_known_attitude(recording)):
        parts, notes = of_single_view(request)
    elif not lacks_known_attitude(recording):
        parts, notes = of_rotating_rig(request) if recording.kind.rotating else of_gimballed_unit(request)
    else:
        parts, notes = of_triads(request)
    if not parts:
        raise InputError(
            f"{recording.title!r} leaves nothing to compare: at rest it takes {FORCE} along x, y and z, and "
            f"{RATE} in a unit with a scale for the gyroscopes. {' '.join(notes)}".strip()
        )
    return joint_diagnosis(parts, notes, request.baseline, request.seed)


def known_view(request: DiagnosisRequest, baseline: Sequence[str]) -> View:
    """Return the view of forces at known attitude, whose scatter is seen about the values of a calibration."""
    recording = request.recording
    ids = tuple(baseline) or BASELINE.get(recording.kind, ())
    return view_at_known_attitude(recording, ids, effects_of_another_day(request.calibration, ids))


def diagnose_views(request: DiagnosisRequest, *views: View) -> ViewDiagnosis:
    """Diagnose a view, or views of several recordings that share the unit, by what is known of their noise."""
    if views[0].noise.scale_known:
        return diagnose_known_noise(views, request.calibration, request.seed, request.progress)
    (v,) = views
    return diagnose_selected(select_causes(v, request.progress), request.progress)


def diagnose_jointly(request: DiagnosisRequest) -> Diagnosis:
    """Diagnose several recordings of one unit at known attitude jointly; InputError if they are not that.

    Mountings on a rate table are one view of the gyroscopes.
    """
    if all(r.kind.rotating and r.platform.axes and not gravity_turns(r) for r in request.recordings):
        parts, notes = _on_table(request, on_a_table(request.recordings).view_in_scatter)
        return joint_diagnosis(parts, notes, request.baseline, request.seed)
    check_one_unit(request)
    alone = "its gyroscopes are not looked at together with other recordings; give it alone for them"
    for r in request.recordings:
        between_rests = r.kind.in_positions and r.has(RATE) and r.position is not None
        if r.platform.axes and (between_rests or r.kind.rotating):
            request.progress(f"{r.title}: {alone}")
    ids = [baseline_of(r, request.recordings, request.baseline) for r in request.recordings]
    views = [known_view(request.of(r), own) for r, own in zip(request.recordings, ids, strict=True)]
    diagnosis = diagnose_views(request, *views)
    return joint_diagnosis([diagnosis], [], [list(own) for own in ids], request.seed)


def check_one_unit(request: DiagnosisRequest) -> None:
    """Raise InputError where recordings are not of one unit at known attitude."""
    recordings, first = request.recordings, request.recording
    for r in recordings:
        if lacks_known_attitude(r):
            raise InputError(
                f"{r.title!r} is a {r.kind} recording of {r.platform.name!r}: `diagnose` combines multi-position and "
                "static-run recordings with gimbals; give this one alone"
            )
        if (r.platform.name, r.platform.axis_names) != (first.platform.name, first.platform.axis_names):
            raise InputError(
                f"{first.title!r} is of platform {first.platform.name!r} and {r.title!r} of {r.platform.name!r}: "
                "`diagnose` combines recordings of one unit; run it on each"
            )


def baseline_of(r: Recording, recordings: Sequence[Recording], wanted: Sequence[str]) -> tuple[str, ...]:
    """Return the effects that the model of one recording holds: those wanted that it can show, or the usual ones.

    A constant of the sensors that any of the recordings calibrates is part of the model in all of them.
    """
    if wanted:
        return tuple(i for i in wanted if not why_not_in_model(i, r)) or BASELINE[r.kind]
    every = [i for other in recordings for i in BASELINE[other.kind] if CATALOGUE[i].stage in SENSOR_STAGES]
    return tuple(dict.fromkeys([*BASELINE[r.kind], *(i for i in every if CATALOGUE[i].shows_in(r.kind))]))


def of_single_view(request: DiagnosisRequest) -> Parts:
    """Diagnose a recording of one view; of stars without those that are outliers, with a note on each.

    One star that is nine sigma off makes half of the scatter of eighty, and hides what is as large as that scatter; a
    few frames of a log that a gust threw off are a step with friction.
    """
    notes, rounds = list[str](), 0
    if request.recording.kind.sighting and (frames := outlying_frames(request.recording)).any():
        most = float(from_si(frames.max(), "arcsec"))
        notes.append(diagnosis_sentences.omitted_frames(request.recording.time[frames > 0], most))
        request.progress(notes[-1])
        request = request.of(request.recording.select(np.flatnonzero(frames == 0)))
    for rounds in range(ROUNDS, -1, -1):
        v = single_view(request)
        if not v.separate_settings or len(v) > MAX_FILTERED_STARS:
            d = diagnose_views(request, v)
            break
        c = select_causes(v, request.progress)  # formulas, which may follow a few outliers, are sought without these
        residual, number = c.with_shapes.residual, v.stimulus.position
        off = outlying_stars(residual / row_sigma(c.with_shapes)) if rounds else []
        if not 0 < len(off) <= MAX_OUTLIER_SHARE * len(v):
            d = diagnose_selected(c, request.progress)
            break
        size = [float(from_si(float(np.linalg.norm(residual[k])), v.unit)) for k in off]
        at, axis = v.stimulus.true_angle, v.stimulus.axis_names[0]
        why = MISTAKEN if at is None else why_far(residual, at[:, : len(v.channels)], off, axis)
        notes.append(diagnosis_sentences.omitted_stars([int(number[k]) for k in off], size, v.unit, why))
        request.progress(notes[-1])
        request = request.of(replace(request.recording, position=number).select(np.delete(np.arange(len(v)), off)))
    return [replace(d, used=request.recording if notes else None)], notes


def single_view(request: DiagnosisRequest) -> View:
    """Return the one view of a unit turned in its place, of a tilting table, or of a kind with one view."""
    recording, calibration, baseline = request.recording, request.calibration, request.baseline
    if recording.kind.sighting:
        recording = means_of_tracking(recording)
    if recording.kind.rotating:
        if not turned_in_place(recording):
            return tilting_table(recording, baseline)
        usual = tuple(baseline) or BASELINE["rotation"]
        known = tuple(e for e in effects_of_another_day(calibration, ()) if e.id not in usual)
        return navigation_view(recording, usual, request.progress, known)
    # every term is fitted anew: a calibration says which the model holds
    effects = tuple(dict.fromkeys(p.effect for p in calibration.parameters)) if calibration else ()
    return recording.kind.view_of(recording, baseline or effects).without_nuisances()


def of_triads(request: DiagnosisRequest) -> Parts:
    """Diagnose the views of a unit turned by hand, one after the other, and note what was not analysed.

    The gyroscopes are compared with accelerometers that include what was found there: both triads are one model. A
    baseline of gyroscope effects alone asks for the gyroscopes alone, and so on.
    """
    recording, mine = request.recording, by_triad(request.baseline)[0]
    if not (recording.has(FORCE) and (mine or not request.baseline)):
        return _with_gyroscopes(request, [])
    c = select_causes(norm(recording, mine), request.progress)
    if odd := [rest for rest in norm_outliers(recording) if _is_unexplained(c.end.residual, rest.dwell)]:
        recording = without_dwells(recording, [rest.dwell for rest in odd])
        c = select_causes(norm(recording, mine), request.progress)
    parts, notes = _with_gyroscopes(request.of(recording), [diagnose_selected(c, request.progress)])
    omitted = [f"{capitalised(words)}." for words in norm_outliers_in_words(odd)]
    return [replace(d, used=recording if odd else None) for d in parts], [*omitted, *notes]


def _is_unexplained(residual: Array, dwell: int) -> bool:
    """Return whether the causes found leave of a dwell far more than of most: residual (n, 1) of the norm of each.

    The first minutes of a unit that warms up deviate from all others too, until that is in the model.
    """
    off = np.abs(residual[:, 0])
    return bool(off[dwell] > MIN_OUTLIER_SCATTERS * np.median(off))


def _with_gyroscopes(request: DiagnosisRequest, diagnoses: list[ViewDiagnosis]) -> Parts:
    """Return the diagnosis of the forces, if there is one, and those of the gyroscopes at rest and in turns."""
    recording, progress = request.recording, request.progress
    _, gyro = by_triad(request.baseline)
    if not (recording.has(RATE) and recording.has(FORCE) and (gyro or not request.baseline)):
        return diagnoses, []
    recording = _at_one_attitude(recording)
    calibration = calibration_of(diagnoses, "") if diagnoses else request.calibration
    at_rest = view_at_rest(recording, gyro, calibration)
    if at_rest is None:
        note = diagnosis_sentences.gyroscopes_not_analysed(diagnosis_sentences.COUNTS_WITHOUT_SCALE)
        progress(note)
        return diagnoses, [note]
    still = diagnose_views(request, at_rest)
    diagnoses.append(still)
    if gyro:
        return diagnoses, []
    if diagnoses[0].verdict == "unexplained" and diagnoses[0] is not still:
        return diagnoses, [diagnosis_sentences.rate_not_analysed("no model explains the forces")]
    moving = view_of_turns(recording, calibration, found_at_rest(still))
    if moving is None or calibration is None:
        return diagnoses, [
            diagnosis_sentences.motion_not_analysed("too few turns were logged to say how the unit turned")
        ]
    diagnoses.append(diagnose_views(request, moving))
    turns = diagnoses[-1].model
    late, notes = of_slews(request, calibration, turns.effects if turns else ())
    return [*diagnoses, *late], notes


def _at_one_attitude(recording: Recording) -> Recording:
    """Return a unit that stays in one attitude, as for a sweep of temperature, with long dwells in means of blocks.

    What its accelerometers read differently there are errors of theirs, not a force that gyroscopes could follow.
    """
    means = dwell_means(recording)
    if attitudes(means.triad(FORCE)) > 1:
        return recording
    if len(means.time) < MIN_BLOCKS:
        means = dwell_means(in_blocks(recording, 2 * MIN_BLOCKS))
    level = {(FORCE, a): np.full_like(means.time, means.channels[FORCE, a].mean()) for a in "xyz"}
    return replace(means, channels={**means.channels, **level})


def of_slews(request: DiagnosisRequest, calibration: Calibration, gyro: Sequence[Effect], means: bool = False) -> Parts:
    """Diagnose delays between channels in the slews, or note why there are none to compare; see `view_of_slews`."""
    v = view_of_slews(request.recording, calibration, gyro, means)
    if isinstance(v, str):
        return [], [diagnosis_sentences.motion_not_analysed(v)]
    request.progress("the slews: do all channels agree in time")
    return [diagnose_views(request, v)], []


def found_at_rest(still: ViewDiagnosis) -> tuple[Effect, ...]:
    """Return the model at rest where a cause or a law was found in it; else the turns determine more.

    A law of a sensor at rest holds while the unit turns: where it is not in the model there, the turns show it again.
    """
    if still.model is None or not (still.findings or still.laws):
        return ()
    if not still.laws:
        return still.model.effects
    with temporarily_loaded(f"law of {still.view.title} at rest", source_text(still.laws)) as ids:
        sizes = [p for i in ids for p in parameters(CATALOGUE[i])]
        absent = (*still.model.effects, *(zero_effect(CATALOGUE[i]) for i in ids))
        return fit([still.view], (*still.model.parameters, *sizes), absent).effects


def of_rotating_rig(request: DiagnosisRequest) -> Parts:
    """Diagnose a rig that turns: rests and the turns between them, or gyroscopes on a table under constant gravity."""
    recording = request.recording
    positions = request.of(replace(recording, kind=MULTI_POSITION))
    rests = has_numbered_rests(recording)
    if gravity_turns(recording) or (rests and by_triad(request.baseline)[0]):
        return of_gimballed_unit(positions, means=not recording.instant)
    try:
        table = on_a_table([recording]).view_in_scatter
    except InputError as problem:
        if rests:
            return of_gimballed_unit(positions, means=not recording.instant)
        raise InputError(
            f"{problem}; to compare rests and the turns between them, number the rests in a `position` column that is "
            "0 on the way"
        ) from None
    return _on_table(request, table)


def has_numbered_rests(recording: Recording) -> bool:
    """Return whether any row is numbered as part of a rest."""
    return recording.position is not None and bool(np.any(recording.position > 0))


def gravity_turns(recording: Recording) -> bool:
    """Return whether gravity has several directions in the unit from rest to rest."""
    if not has_numbered_rests(recording):
        return False
    means = dwell_means(recording)
    return attitudes(ideal_force(means, means.angles())) > 1


def _on_table(request: DiagnosisRequest, table: View) -> Parts:
    """Diagnose gyroscopes on a rate table, whose angles say how it turns; accelerometers feel one direction there."""
    mine, gyro = by_triad(request.baseline)
    if mine and not gyro:
        raise InputError(
            f"--baseline names {mine[0]}, and a rate table under constant gravity shows gyroscopes alone; give it a "
            "gyroscope effect, or record rests in several attitudes"
        )
    request.progress(f"the gyroscopes: {table.measurement.channels}")
    part = diagnose_views(request, replace(table, baseline=tuple(gyro) or table.baseline))
    together = tuple(replace(table, source=r) for r in request.recordings) if len(request.recordings) > 1 else ()
    notes = [diagnosis_sentences.FORCES_NOT_ANALYSED] if any(r.has(FORCE) for r in request.recordings) else []
    return [replace(part, together=together)], notes


def of_gimballed_unit(request: DiagnosisRequest, means: bool = False) -> Parts:
    """Diagnose the forces at known attitude, then the gyroscopes at rest and between rests, then the slews.

    A baseline of gyroscope effects alone asks for the gyroscopes alone, and so on. means: whether rows are means.
    """
    recording = request.recording
    mine, gyro = by_triad(request.baseline)
    parts, notes = list[ViewDiagnosis](), list[str]()
    if (recording.has(FORCE) or not recording.has(RATE)) and (mine or not request.baseline):
        part, request = _diagnose_forces(request, mine)
        recording = request.recording
        parts.append(part)
    forces = parts[0].calibration if parts else None
    if recording.has(RATE) and not (mine and not gyro):
        calibration = request.calibration if forces is None else _accelerometer_calibration(forces)
        explained = not parts or parts[0].verdict != "unexplained"
        rates, notes = _diagnose_gyroscopes(request, calibration, gyro, explained)
        parts += rates
    turns = next((p.model for p in parts if p.view.measurement is TURNS), None)
    both = recording.has(RATE) and recording.has(FORCE)
    without = request.of(without_earth_rate(recording)) if both else request
    late, why_not = of_slews(without, forces or IDEAL_AT_GIMBALS, turns.effects if turns else (), means)
    for note in (*notes, *why_not):
        request.progress(note)
    return [*parts, *late], [*notes, *why_not]


def _diagnose_forces(request: DiagnosisRequest, baseline: Sequence[str]) -> tuple[ViewDiagnosis, DiagnosisRequest]:
    """Return the diagnosis of the forces, and what is to be diagnosed without positions that are mis-set.

    Where nothing explains the whole, positions that were not held where the readouts say are a fault of the recording;
    the rest of it is diagnosed.
    """
    whole = diagnose_views(request, known_view(request, baseline))
    if whole.verdict != "unexplained" or not (faults := position_faults(request.recording)):
        return whole, request
    in_words = " ".join(f"{capitalised(words)}." for words in outliers_in_words(faults))
    request.progress(in_words)
    used = without_dwells(request.recording, [visit for fault in faults for visit in fault.visits])
    request = request.of(used)
    rest = diagnose_views(request, known_view(request, baseline))
    shapes = tuple(Shape(f"position {n}", diagnosis_sentences.NOT_AS_READ) for f in faults for n in f.positions)
    contradictions = (Contradiction(in_words, shapes), *rest.contradictions)
    located = rest.mismatch or whole.mismatch
    return replace(rest, used=used, mismatch=located, contradictions=contradictions), request


def _accelerometer_calibration(calibration: Calibration) -> Calibration:
    """Return the accelerometers of a calibration of the forces, without the mount."""
    kept = tuple(e for e in calibration.effects if e.stage in SENSOR_STAGES and e.channel == FORCE)
    at = [i for i, p in enumerate(calibration.parameters) if p.effect in {e.id for e in kept}]
    wanted = tuple(calibration.parameters[i] for i in at)
    return replace(calibration, effects=kept, parameters=wanted, covariance=calibration.covariance[np.ix_(at, at)])


def _diagnose_gyroscopes(
    request: DiagnosisRequest, calibration: Calibration | None, gyro: Sequence[str], explained: bool
) -> Parts:
    """Diagnose the views of the gyroscopes, and note in sentences what was not analysed."""
    recording = request.recording
    rests = len(dwell_means(recording).time)
    if rests < MIN_RESTS:
        return [], [diagnosis_sentences.gyroscopes_not_analysed(f"that takes {MIN_RESTS} dwells, not {rests}")]
    if not recording.has(FORCE):
        force = ideal_force(recording, recording.angles())
        recording = replace(
            recording, channels={**recording.channels, **{(FORCE, a): force[:, i] for i, a in enumerate("xyz")}}
        )
        calibration = IDEAL_AT_GIMBALS
    calibration = calibration or usual_accelerometers(recording)
    turning = view_of_turns(without_earth_rate(recording), calibration) if explained and not gyro else None
    linear = start_with_baseline(turning).effects if turning else ()
    still = view_at_rest(without_earth_rate(recording, linear), gyro, calibration)
    if still is None:
        return [], [diagnosis_sentences.gyroscopes_not_analysed(diagnosis_sentences.COUNTS_WITHOUT_SCALE)]
    notes = []
    if turning is None and not gyro:
        why = f"fewer than {MIN_TURNS} turns between rests were logged" if explained else "nothing explains the forces"
        notes = [diagnosis_sentences.rate_not_analysed(why)]

    def looked(v: View) -> ViewDiagnosis:
        request.progress(f"the gyroscopes: {v.measurement.channels}")
        return diagnose_views(request, v)

    diagnoses = [looked(replace(still, missed_by_turns=None))]
    if turning and (at_rest := found_at_rest(diagnoses[0])):
        turning = view_of_turns(without_earth_rate(recording), calibration, at_rest)
    return [*diagnoses, *([looked(turning)] if turning else [])], notes


def why_not_in_model(effect_id: str, recording: Recording) -> str:
    """Return why the model of a recording cannot hold an effect, to follow "which"; empty where it can."""
    cls, logs = known_effect(effect_id, "baseline"), recording.axes("covariate")
    reason = recording.why_not_shown(cls)
    if not reason and followed_covariate(cls) == "" and len(logs) > 1:
        return f"follows one covariate, and {recording.title!r} has {len(logs)} of them"
    return reason
