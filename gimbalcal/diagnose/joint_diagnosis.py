"""One diagnosis of several views of a recording: the verdict of the view that is off most, and what all have found.

The last models of the views become one calibration: what was fitted in each, with its covariance, and how the unit is
read. Views say different things of a unit (its accelerometers, its gyroscopes at rest, its gyroscopes on the way), so
what they tell stands side by side, without correlations between them. Views that share parameters are fitted together:
each has these in a frame of its own where its rows hold no reference, so that estimates of one do not go with those of
another.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

import gimbalcal
from gimbalcal.calibration import Calibration, Readout, Residual
from gimbalcal.diagnose.answer import VERDICTS, Diagnosis
from gimbalcal.diagnose.verdict.joint_fit import provenance_of_fit
from gimbalcal.diagnose.view_result import ViewDiagnosis
from gimbalcal.effects import Effect, Parameter, parameters, values, with_values
from gimbalcal.estimate.accelerometers.fit_summary import joined_sentences, rotations_of_the_triad
from gimbalcal.estimate.fit import fit
from gimbalcal.estimate.sharing import with_widest_priors
from gimbalcal.inference.algebra import block_diagonal
from gimbalcal.inference.information import Unobservable, keeps_prior
from gimbalcal.number import Array
from gimbalcal.views.core import Fit, View
from gimbalcal.words import diagnosis_sentences


def joint_diagnosis(
    parts: Sequence[ViewDiagnosis], notes: Sequence[str], baseline: Sequence[Any], seed: int
) -> Diagnosis:
    """Return the diagnosis of a recording from those of its views; notes: sentences on what was not analysed.

    baseline: effects that the model was asked to hold, for the provenance.
    """

    def rank(p: ViewDiagnosis) -> tuple[int, float]:
        return VERDICTS.index(p.verdict), 0.0 if p.verdict == "adequate" else p.fit.chi2_reduced_before

    lead = max(parts, key=rank)
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
        recommend=next(filter(None, (p.recommend for p in by_weight)), ""),
        without=next((p.without for p in parts if p.without is not None), None),
        other_curves=tuple(p.curves for p in by_weight[1:]),
        used=next((p.used for p in parts if p.used is not None), None),
    )  # fmt: skip


def _one_view_each(parts: Sequence[ViewDiagnosis]) -> tuple[View, ...]:
    """Return one view of each recording."""
    return next((p.together for p in parts if p.together), (parts[0].view,))


def calibration_of(parts: Sequence[ViewDiagnosis], outcome: str) -> Calibration:
    """Return the calibration that the views end in."""
    forces = next((p.calibration for p in parts if p.calibration is not None), None)
    if forces is not None and len(parts) == 1:
        return replace(forces, outcome=" ".join(filter(None, [outcome, forces.outcome])))
    fitted = [p for p in parts if p.model is not None]
    causes = [f"{f.effect}:{f.axis}".rstrip(":") for p in fitted for f in p.findings]
    for p in fitted:
        if p.without is not None:  # states of the navigator that the rows come from
            calibration, provenance = p.without(""), provenance_of_fit(_one_view_each(parts), causes)
            outcome = outcome or calibration.outcome
            return replace(calibration, method="diagnosis", outcome=outcome, provenance=provenance)
    # time stamps are shifted, not calibrated
    fits = [replace(p.model, view=p.view) for p in fitted if p.model is not None and not p.view.measurement.timing]
    return calibrated_views(_one_view_each(parts), fits, causes, outcome, forces)


Block = tuple[tuple[Effect, ...], tuple[Parameter, ...], Array]
"""Effects, their parameters and the covariance of these."""


def calibrated_views(
    views: Sequence[View],
    fits: Sequence[Fit],
    causes: Sequence[str],
    outcome: str,
    forces: Calibration | None = None,
) -> Calibration:
    """Return the calibration of what was seen in some of the views of a unit.

    forces: the calibration of the accelerometers at known attitude.
    """
    readout = _readout(views, fits)
    blocks = [_model(group, readout.gimbals) for group in _groups_that_share(fits)]
    if forces is not None:
        blocks.insert(0, (forces.effects, forces.parameters, forces.covariance))
    effects: tuple[Effect, ...] = ()
    wanted: tuple[Parameter, ...] = ()
    P = np.zeros((0, 0))
    for theirs, fitted, covariance in blocks:
        new = [i for i, p in enumerate(fitted) if p not in wanted]
        effects = (*effects, *(e for e in theirs if e.id not in {o.id for o in effects}))
        mine = tuple(fitted[i] for i in new)
        effects = with_values(effects, mine, values(theirs, mine), readout.gimbals)
        P = block_diagonal([P, covariance[np.ix_(new, new)]])
        wanted = (*wanted, *mine)
    P[np.diag_indices_from(P)] = np.maximum(np.diag(P), 0.0)  # of numbers without noise variances are their rounding
    return Calibration(
        method="diagnosis",
        effects=tuple(e for e in effects if e.id in {p.effect for p in wanted}),
        parameters=wanted,
        covariance=P,
        unobservable=(*(forces.unobservable if forces else ()), *_unseen_parameters(fits)),
        residual=_residual(fits, forces),
        outcome=outcome,
        provenance=provenance_of_fit(views, causes),
        readout=readout,
    )


def _groups_that_share(fits: Sequence[Fit]) -> list[list[Fit]]:
    """Return the models in groups that share linear parameters."""
    out: list[list[Fit]] = []
    for m in fits:
        labels = {p.label for p in m.parameters}
        alike = [group for group in out if labels & {p.label for o in group for p in o.parameters}]
        out = [*(group for group in out if group not in alike), [*(o for group in alike for o in group), m]]
    return out


def _model(group: Sequence[Fit], gimbals: Sequence[str]) -> Block:
    """Return what was fitted in views that share parameters, the model of their joint fit where there are several.

    Constants that were chosen (epochs, whole numbers) have a sigma of zero.
    """
    effects, wanted, covariance = group[-1].effects, group[-1].parameters, group[-1].covariance
    if len(group) > 1:
        wanted = with_widest_priors(p for m in group for p in m.parameters)
        effects = tuple({e.id: e for m in group for e in m.effects}.values())
        last = {p.label: x for m in group for p, x in zip(m.parameters, m.x, strict=True)}
        start = with_values(effects, wanted, np.array([last[p.label] for p in wanted]), gimbals)
        fitted = fit([m.view for m in group], wanted, start)
        effects, wanted, covariance = fitted.effects, fitted.parameters, fitted.covariance
    linear, ids = {p for e in effects for p in parameters(type(e), gimbals)}, {p.effect for p in wanted}
    constants = (p for e in effects if e.id in ids for p in parameters(type(e), gimbals, constants=True))
    chosen = tuple(p for p in constants if p not in linear and p not in wanted)
    return effects, (*wanted, *chosen), block_diagonal([covariance, np.zeros((len(chosen), len(chosen)))])


def _unseen_parameters(fits: Sequence[Fit]) -> list[Unobservable]:
    """Parameters of which these rows say nothing: they keep their prior; and what turns a triad as a whole."""
    out: list[Unobservable] = []
    for s in fits:
        sigma = np.sqrt(np.maximum(np.diag(s.covariance), 0.0))
        silent = keeps_prior(s.parameters, s.x, sigma)
        labels = [p.label for p, at_prior in zip(s.parameters, silent, strict=True) if at_prior]
        out += [Unobservable({one: 1.0}, f"{one} does not show in {s.view.name}") for one in labels]
        turned = {effect for effect, _ in s.view.gauge}  # of the accelerometers, as a triad
        if "misalignment" in turned and any(p.effect == "misalignment" for p in s.parameters):
            out += rotations_of_the_triad()
    return out


def _residual(fits: Sequence[Fit], forces: Calibration | None) -> Residual:
    """Misfit by channel, SI. Where nobody stated the noise it is the misfit, and chi^2 its degrees of freedom."""
    rms = dict(forces.residual.rms) if forces else {}
    for s in fits:
        scatter = np.sqrt(np.mean(s.residual**2, axis=0))
        rms |= {f"{s.view.name} {' '.join(c)}".strip(): float(v) for c, v in zip(s.view.channels, scatter, strict=True)}
    if forces is not None:
        return replace(forces.residual, rms=rms)
    dof = max(sum(s.residual.size - len(s.parameters) for s in fits), 0)
    return Residual(float(dof), dof, rms)


def _readout(views: Sequence[View], fits: Sequence[Fit]) -> Readout:
    """Return nominal scales of what counts, as the first of the views that were seen had them, and the gimbals."""
    each = [s.view.readout for s in fits]
    forces = next((r.accelerometers for r in each if r.accelerometers), None)
    rates = next((r.gyroscopes for r in each if r.gyroscopes), None)
    return Readout(forces, rates, views[0].readout.gimbals)
