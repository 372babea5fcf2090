"""The calibration of a diagnosis that found a law: the model with the law, estimated as `calibrate --with` does it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from hashlib import sha256

from gimbalcal.diagnose.answer import Diagnosis
from gimbalcal.diagnose.laws.law_file import source
from gimbalcal.effects.loading import EffectFile, loaded_meanwhile
from gimbalcal.errors import InputError
from gimbalcal.history.fleet import Fleet
from gimbalcal.methods import calibrate
from gimbalcal.pipeline import Tell, silent
from gimbalcal.recording import Recording
from gimbalcal.words import law_sentences

FILE = "law.py"  # that a diagnosis writes


def with_laws(
    d: Diagnosis, recordings: Sequence[Recording], baseline: Sequence[str], grade: str | Fleet, tell: Tell
) -> Diagnosis:
    """Return the diagnosis with a calibration that contains its laws and the known causes beside them.

    The constants of a law are fitted with all else. The catalogue holds a law only meanwhile: what is found in one
    recording changes nothing for the next, and every command takes it by `--effects law.py`. Where no method takes a
    law, the calibration stays as it is, and its outcome says so.
    """
    if not d.laws or d.calibration is None:
        return d
    text = source(d.laws)
    more = list(dict.fromkeys(one for law in d.laws for one in (*law.beside, law.with_)))
    tell("calibrating with the formula")
    try:
        with loaded_meanwhile(f"{FILE} of {recordings[0].title}", text) as ids:
            calibration, _ = calibrate(recordings, terms=baseline, more=more, grade=grade, tell=silent)
    except InputError as problem:
        outcome = law_sentences.NOT_CALIBRATED.format(outcome=d.calibration.outcome, problem=problem).strip()
        return replace(d, calibration=replace(d.calibration, outcome=outcome))
    file = EffectFile(FILE, sha256(text.encode()).hexdigest(), ids)
    provenance = replace(calibration.provenance, effects=(file,))
    outcome = " ".join(filter(None, [law_sentences.CAUSE_UNKNOWN, calibration.outcome]))
    return replace(d, calibration=replace(calibration, outcome=outcome, provenance=provenance))
