"""What one view says: its verdict, what was found in it, and how well the model then fits rows it has not seen."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from gimbalcal.diagnose import wording
from gimbalcal.diagnose.answer import Curves, plotted_against
from gimbalcal.diagnose.library.unknown_noise import causes
from gimbalcal.diagnose.result import (
    Delay,
    Finding,
    LawResult,
    Mismatch,
    RowNoise,
    SearchStep,
    Shape,
    Shift,
    TurnMisfit,
    ViewFit,
)
from gimbalcal.diagnose.rows.slews import lateness
from gimbalcal.diagnose.search.refit import Model, basis, projections, weighted
from gimbalcal.diagnose.search.stepwise import Course, refined
from gimbalcal.diagnose.verdict.alternatives import Judgement
from gimbalcal.diagnose.verdict.findings import confirmed, drifts_as_one, finding, sizes
from gimbalcal.diagnose.verdict.laws import SOUGHT, Lawful, laws_of_view, told_heldout
from gimbalcal.diagnose.verdict.locate_unknown_noise import mismatches
from gimbalcal.diagnose.verdict.unseen import unseen
from gimbalcal.errors import InputError
from gimbalcal.number import Array
from gimbalcal.pipeline import Tell
from gimbalcal.units import from_si
from gimbalcal.views.core import View


@dataclass(frozen=True)
class Told:
    """The report of one view: verdict, mismatch, findings, shapes, fit, misfits in sigma before and after (n, C)."""

    view: View
    verdict: str
    mismatch: tuple[Mismatch, ...]
    findings: tuple[Finding, ...]
    unexplained: tuple[Shape, ...]
    fit: ViewFit
    before: Array
    after: Array
    sigma: Array  # (n, C) of a row, SI
    model: Model
    laws: tuple[LawResult, ...] = ()
    recommend: str = ""
    outcome: str = ""  # what else there is to say, as of a diagnosis


def told_of(v: View, c: Course, tell: Tell) -> Told:
    """What a course through a view says."""
    return told_as(v, *confirmed(v, c, tell), tell)


def told_as(
    v: View, c: Course, verdicts: Sequence[Judgement], tell: Tell, lacking: bool = False, formulas: bool = True
) -> Told:
    """What a course says of which each cause has been judged. Where there is none, formulas are sought, or not.

    lacking: something is missing even if it has no shape either.
    """
    if v.finer is not None:
        tell("refitting at the full resolution")
        v = v.finer()
        c = refined(v, c)
    found = drifts_as_one([finding(v, c, j) for j in verdicts])
    shapes = tuple(Shape(f"{s.channel if v.added else v.channels[0][0]} {s.axis}".strip(), s.rival) for s in c.left)
    verdict = "adequate"
    if found:
        verdict = "missing-physics" if any(not f.twins for f in found) else "not-identifiable"
    elif shapes or lacking:
        verdict = "unexplained"
    sigma = _sigma(v, c.described)
    fit, lawful = _fit(v, c, sigma), Lawful()
    if verdict == "adequate" and not c.start.exact:
        known, X = causes(v, c.end.effects, c.end.fitted)
        fit = replace(fit, unseen=unseen(known, projections(v, c.end, X)))
    if verdict == "unexplained" and formulas:
        tell(SOUGHT)
        lawful, with_law = laws_of_view(v, c.end, sigma)
        c_law = replace(c, described=with_law)
        fit_law = _fit(v, c_law, _sigma(v, with_law)) if lawful.laws else fit
        lawful = told_heldout(lawful, fit_law)
        if lawful.laws:
            c, fit, sigma = c_law, fit_law, _sigma(v, with_law)
    if verdict == "missing-physics" and fit.heldout_rms_after > max(
        fit.heldout_rms_before, wording.MISSED * fit.rms_after
    ):
        verdict = "not-identifiable"  # what was named makes rows that took no part worse
    mismatch = () if verdict == "adequate" else mismatches(v, c.start, sigma)
    before, after = c.start.r / sigma, c.described.r / sigma
    return Told(v, verdict, mismatch, found, shapes, fit, before, after, sigma, c.end, lawful.laws,
                lawful.recommend)  # fmt: skip


def _sigma(v: View, end: Model) -> Array:
    """One sigma of each row and channel (n, C): the scatter about the last model, spread as the samples' noise is."""
    r = weighted(v, end.r)
    free = max(r.size - basis(end.J).shape[1], 1)
    return np.asarray(np.sqrt((r**2).sum() / free) / v.weight)


def _fit(v: View, c: Course, sigma: Array) -> ViewFit:
    before, after = c.start, c.described
    (held_before, held_rms_before), (held_after, held_rms_after) = (_outside(v, m, sigma) for m in (before, after))
    late = turns = None
    if v.name == "slews":
        every = {axis: (float(from_si(x, "ms")), float(from_si(s, "ms"))) for axis, (x, s) in lateness(v).items()}
        late = {axis: Delay(x, s, "ms") for axis, (x, s) in every.items()}
    if v.missed_by_turns is not None and c.steps:
        with suppress(InputError):  # turns too few, or all about one axis, prove nothing
            missed = [float(from_si(v.missed_by_turns(e), "arcsec")) for e in ((), after.effects)]
            turns = TurnMisfit(missed[0], missed[1], "arcsec")
    return ViewFit(
        chi2_reduced_before=_reduced(before, sigma),
        chi2_reduced_after=_reduced(after, sigma),
        heldout_before=held_before,
        heldout_after=held_after,
        heldout_rms_before=held_rms_before,
        heldout_rms_after=held_rms_after,
        noise=RowNoise(v.name, float(from_si(float(np.median(sigma)), v.unit)), v.unit),
        rms_before=float(from_si(before.rms, v.unit)),
        rms_after=float(from_si(after.rms, v.unit)),
        steps=tuple(
            SearchStep(s.taken[0].effect, s.taken[0].axis, float(from_si(s.model.rms, v.unit)), v.unit) for s in c.steps
        ),
        calibration_moved=moved(before, after) if c.steps else (),
        late=late,
        turns=turns,
        chi2_of_samples_before=_against_samples(v, before),
        chi2_of_samples_after=_against_samples(v, after),
    )


def _against_samples(v: View, m: Model) -> dict[str, float] | None:
    """Reduced chi^2 of each channel in the noise that the scatter of the samples makes; None where it is not known."""
    if v.noise.sample is None:
        return None
    n = len(m.r)
    Q = basis(m.J / v.noise.sample[..., None]).reshape(n, len(v.channels), -1)
    fitted = (Q**2).sum(axis=(0, 2))  # degrees of freedom that the parameters take of each channel
    chi2 = ((m.r / v.noise.sample) ** 2).sum(axis=0) / np.maximum(n - fitted, 1)
    return dict(zip([a for _, a in v.channels], chi2.tolist(), strict=True))


def _reduced(m: Model, sigma: Array) -> float:
    rank = basis(m.J / sigma[..., None]).shape[1]
    return float(((m.r / sigma) ** 2).sum() / max(m.r.size - rank, 1))


def _outside(v: View, m: Model, sigma: Array) -> tuple[float, float]:
    """Misfit of rows that a fit without them has not seen: mean square in sigma, and rms length of a row in print."""
    left = heldout(v, m, sigma)
    rms = float(np.sqrt(((left * sigma) ** 2).sum() / len(left)))
    return float(np.mean(left**2)), float(from_si(rms, v.unit))


def heldout(v: View, m: Model, sigma: Array) -> Array:
    """Misfit (n, C) in sigma of each group of rows to a fit without it."""
    n, C = m.r.shape
    Q = basis(m.J / sigma[..., None]).reshape(n, C, -1)
    r = m.r / sigma
    left = []
    for rows in np.split(np.arange(n), np.flatnonzero(np.diff(v.groups)) + 1):
        e = r[rows].ravel()
        q = Q[rows].reshape(len(e), Q.shape[-1])
        left.append(np.linalg.lstsq(np.eye(len(e)) - q @ q.T, e, rcond=1e-6)[0])
    return np.concatenate(left).reshape(n, C)


def moved(before: Model, after: Model) -> tuple[Shift, ...]:
    """How far each constant of the baseline moves once what was found is in the model."""
    new = {(r.name, r.axis): r for r in sizes(after)}
    out = []
    seen = np.abs(before.J).max(axis=(0, 1)) > 1e-9  # means taken off leave rounding of a bias
    for r in (row for row, there in zip(sizes(before), seen, strict=True) if there):
        n = new[r.name, r.axis]
        shift = n.value - r.value
        ratio = round(shift / n.sigma, 2) if n.sigma > 0 else 0.0
        out.append(Shift(r.name, str(r.axis), shift, n.sigma, r.unit, ratio))
    return tuple(sorted(out, key=lambda row: -abs(row.in_sigmas)))


def curves_of(t: Told) -> Curves:
    """Misfits of a view for a picture."""
    n = len(t.before)
    number = np.ones(n) if t.view.label is None else np.arange(1, n + 1)
    if t.view.name == "pointing":
        number = t.view.stimulus.position
    sigma = np.asarray(from_si(t.sigma, t.view.unit))
    units = (t.view.unit,) * len(t.view.channels)
    return Curves(
        t.view.time, number, t.view.channels, t.before, t.after, sigma, units, plotted_against(t.view.stimulus)
        if len(t.view.stimulus.time) == n else {},
    )  # fmt: skip
