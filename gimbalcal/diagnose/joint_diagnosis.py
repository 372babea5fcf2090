"""One diagnosis of several views of a recording: the verdict of the view that is off most, and what all have found."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import gimbalcal
from gimbalcal.calibration import Calibration
from gimbalcal.diagnose.answer import VERDICTS, Diagnosis
from gimbalcal.diagnose.verdict.joint_fit import provenance_of_fit
from gimbalcal.diagnose.verdict.view_calibration import calibrated_views
from gimbalcal.diagnose.view_result import ViewDiagnosis
from gimbalcal.effects import Effect, Parameter
from gimbalcal.effects.effect import constants
from gimbalcal.estimate.accelerometers.fit_summary import joined_sentences
from gimbalcal.views.core import Fit, View
from gimbalcal.words import diagnosis_sentences


def joint_diagnosis(
    parts: Sequence[ViewDiagnosis], notes: Sequence[str], baseline: Sequence[Any], seed: int
) -> Diagnosis:
    """Return the diagnosis of a recording from those of its views; notes: sentences on what was not analysed.

    baseline: effects that the model was asked to hold, for the provenance.
    """
    lead = max(parts, key=_verdict_rank)
    by_weight = [lead, *(p for p in parts if p is not lead)]
    findings = tuple(f for p in parts for f in p.findings)
    shapes = tuple(u for p in parts for u in p.unexplained)
    mismatch = tuple(m for p in by_weight for m in p.mismatch)
    outcome = joined_sentences([p.outcome for p in parts])
    answer = diagnosis_sentences.answer(lead.verdict, [(p.view, p.fit, p.findings) for p in parts], shapes, mismatch)
    limits = [u for p in parts for u in p.fit.unseen or ()] if lead.verdict == "adequate" else []
    contradictions = [x for p in parts for x in p.contradictions]
    words = [*(x.in_words for x in contradictions), answer, *(r for p in parts for r in p.remarks)]
    also = [
        diagnosis_sentences.limits_in_words(limits),
        diagnosis_sentences.delay_sentences(findings),
        f"{outcome}." if outcome else "",
        *notes,
    ]
    provenance = {
        "version": gimbalcal.__version__,
        "recordings": [file for v in _one_view_each(parts) for file in v.source.files],
        "options": {"baseline": list(baseline) or [i for p in parts for i in p.view.baseline], "seed": seed},
        **{key: value for p in parts if p.evidence for key, value in p.evidence.to_dict().items()},
        "views": [p.name for p in parts],
        **({"notes": list(notes)} if notes else {}),
    }
    return Diagnosis(
        "unexplained" if contradictions and lead.verdict == "adequate" else lead.verdict, mismatch, findings,
        (*shapes, *(u for x in contradictions for u in x.shapes)),
        replace(lead.fit, views={p.name: p.fit for p in parts}) if len(parts) > 1 else lead.fit, provenance,
        " ".join(filter(None, [*words, *also])), lead.curves,
        calibration_of(parts, diagnosis_sentences.reservation_sentence(lead.verdict, findings, shapes)),
        joined_sentences([*(x.in_words for x in contradictions), outcome]),
        laws=tuple(law for p in parts for law in p.laws),
        recommend=next(filter(None, (p.recommend for p in by_weight)), ""), without=refit_without(parts),
        other_curves=tuple(p.curves for p in by_weight[1:]),
        used=next((p.used for p in parts if p.used is not None), None),
    )  # fmt: skip


def _verdict_rank(p: ViewDiagnosis) -> tuple[int, float]:
    """Return verdict, then how far the baseline is off."""
    return VERDICTS.index(p.verdict), 0.0 if p.verdict == "adequate" else p.fit.chi2_reduced_before


def _one_view_each(parts: Sequence[ViewDiagnosis]) -> tuple[View, ...]:
    """Return one view of each recording."""
    return next((p.together for p in parts if p.together), (parts[0].view,))


def refit_without(parts: Sequence[ViewDiagnosis]) -> Callable[[str], Calibration] | None:
    """Return the calibration by a model without an effect as a function of its id; None where no view has one."""
    for p in parts:
        if p.without is not None:
            return p.without
        if p.view.calibrate is not None and p.model is not None:
            return partial(_calibration_of_navigator, p.view.calibrate, p.model)
    return None


def _calibration_of_navigator(
    calibrate: Callable[[Sequence[Effect], Sequence[Parameter]], Calibration], model: Fit, left_out: str = ""
) -> Calibration:
    """Return the calibration of a navigator with the effects of a model, one of them left out if it is named."""
    names = {e.id: {f.name for f in constants(type(e))} for e in model.effects}
    linear = [p for p in model.parameters if p.effect != left_out and p.field not in names[p.effect]]
    return calibrate([e for e in model.effects if e.id != left_out], linear)


def calibration_of(parts: Sequence[ViewDiagnosis], outcome: str) -> Calibration:
    """Return the calibration that the views end in."""
    forces = next((p.calibration for p in parts if p.calibration is not None), None)
    if forces is not None and len(parts) == 1:
        return replace(forces, outcome=" ".join(filter(None, [outcome, forces.outcome])))
    fitted = [(p.view, p.model) for p in parts if p.model is not None]
    causes = [f"{f.effect}:{f.axis}".rstrip(":") for p in parts if p.model is not None for f in p.findings]
    for v, model in fitted:
        if v.calibrate is not None:  # states of the navigator that the rows come from
            calibration = _calibration_of_navigator(v.calibrate, model)
            return replace(
                calibration,
                method="diagnosis",
                outcome=outcome or calibration.outcome,
                provenance=provenance_of_fit(_one_view_each(parts), causes),
            )
    # time stamps are shifted, not calibrated
    fits = [replace(m, view=v) for v, m in fitted if not v.measurement.timing]
    return calibrated_views(_one_view_each(parts), fits, causes, outcome, forces)
