"""The calibration of a diagnosis that found a law: the model with the law, estimated as `calibrate --with` does it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from hashlib import sha256

from gimbalcal.diagnose.answer import Diagnosis
from gimbalcal.diagnose.laws.law_file import as_calibrated, source_text
from gimbalcal.diagnose.of_recording import DiagnosisRequest
from gimbalcal.effects.loading import EffectFile, temporarily_loaded
from gimbalcal.errors import InputError
from gimbalcal.estimate.accelerometers.fit_summary import joined_sentences
from gimbalcal.history.fleet import Fleet
from gimbalcal.method_table import METHODS
from gimbalcal.methods import calibrate, usual_method
from gimbalcal.progress import no_progress
from gimbalcal.recording import Recording
from gimbalcal.views.core import effects_of_another_day
from gimbalcal.words import law_sentences

FILE = "law.py"  # that a diagnosis writes


def with_laws(d: Diagnosis, request: DiagnosisRequest, grade: str | Fleet) -> Diagnosis:
    """Return the diagnosis with a calibration that contains its laws and the known causes that were fitted with them.

    The constants of a law are fitted with all else, to the rows that were diagnosed. The catalogue holds a law during
    this fit alone, so that a law of one recording changes nothing for the next; commands take it by `--effects law.py`.
    Where no method takes a law, the calibration stays as it is, and its outcome says so.
    """
    if not d.laws or d.calibration is None:
        return d
    recordings, text = [d.used] if d.used is not None else request.recordings, source_text(d.laws)
    request.progress("calibrating with the formula")
    try:
        terms, further = _model(request, recordings)
        more = dict.fromkeys([*further, *(one for law in d.laws for one in (*law.known_effects, law.with_))])
        with temporarily_loaded(f"{FILE} of {recordings[0].title}", text) as ids:
            calibration, _ = calibrate(recordings, terms=terms, more=list(more), grade=grade, progress=no_progress)
    except InputError as problem:
        reason = law_sentences.NOT_CALIBRATED.format(problem=problem)
        return replace(d, calibration=replace(d.calibration, outcome=joined_sentences([d.calibration.outcome, reason])))
    file = EffectFile(FILE, sha256(text.encode()).hexdigest(), ids)
    provenance = replace(calibration.provenance, effects=(file,))
    outcome = joined_sentences([law_sentences.CAUSE_UNKNOWN, calibration.outcome])
    laws = tuple(as_calibrated(law, calibration) for law in d.laws)
    return replace(d, laws=laws, calibration=replace(calibration, outcome=outcome, provenance=provenance))


def _model(request: DiagnosisRequest, recordings: Sequence[Recording]) -> tuple[Sequence[str], list[str]]:
    """Return the terms of the model as a method takes them, and effects of a given calibration beyond these."""
    start, terms = request.calibration, request.baseline
    if start is not None and recordings[0].kind.sighting:
        return terms or tuple(dict.fromkeys(p.effect for p in start.parameters)), []
    if "terms" not in METHODS[usual_method(recordings)].options:
        terms = ()
    if start is None:
        return terms, []
    modelled = {p.effect for p in calibrate(recordings, terms=terms, progress=no_progress)[0].parameters}
    return terms, [e.id for e in effects_of_another_day(start, ()) if e.id not in modelled]
