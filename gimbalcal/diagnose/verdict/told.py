"""What one view says: its verdict, what was found in it, and how well the model then fits rows it has not seen."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gimbalcal.diagnose import wording
from gimbalcal.diagnose.answer import Curves, FoundLaw, plotted_against
from gimbalcal.diagnose.library.unknown_noise import causes
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
    mismatch: tuple[dict[str, Any], ...]
    findings: tuple[dict[str, Any], ...]
    unexplained: tuple[dict[str, Any], ...]
    fit: dict[str, Any]
    before: Array
    after: Array
    sigma: Array  # (n, C) of a row, SI
    model: Model
    laws: tuple[FoundLaw, ...] = ()
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
    shapes = tuple(
        {"channel": f"{s.channel if v.added else v.channels[0][0]} {s.axis}".strip(), "shape": s.rival} for s in c.left
    )
    verdict = "adequate"
    if found:
        verdict = "missing-physics" if any(not f["twins"] for f in found) else "not-identifiable"
    elif shapes or lacking:
        verdict = "unexplained"
    sigma = _sigma(v, c.described)
    fit, lawful = _fit(v, c, sigma), Lawful()
    if verdict == "adequate" and not c.start.exact:
        known, X = causes(v, c.end.effects, c.end.fitted)
        fit["unseen"] = unseen(known, projections(v, c.end, X))
    if verdict == "unexplained" and formulas:
        tell(SOUGHT)
        lawful, with_law = laws_of_view(v, c.end, sigma)
        c_law = replace(c, described=with_law)
        fit_law = _fit(v, c_law, _sigma(v, with_law)) if lawful.laws else fit
        lawful = told_heldout(lawful, fit_law)
        if lawful.laws:
            c, fit, sigma = c_law, fit_law, _sigma(v, with_law)
    if verdict == "missing-physics" and fit["heldout_rms_after"] > max(
        fit["heldout_rms_before"], wording.MISSED * fit["rms_after"]
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


def _fit(v: View, c: Course, sigma: Array) -> dict[str, Any]:
    before, after = c.start, c.described
    out: dict[str, Any] = {
        "chi2_reduced_before": _reduced(before, sigma),
        "chi2_reduced_after": _reduced(after, sigma),
        **_outside("before", v, before, sigma),
        **_outside("after", v, after, sigma),
        "noise": {"of": v.name, "sigma_of_a_row": float(from_si(float(np.median(sigma)), v.unit)), "unit": v.unit,
                  "from": "the scatter about the last model"},
        "rms_before": float(from_si(before.rms, v.unit)),
        "rms_after": float(from_si(after.rms, v.unit)),
        "steps": [
            {"effect": s.taken[0].effect, "axis": s.taken[0].axis, "rms": float(from_si(s.model.rms, v.unit)),
             "unit": v.unit}
            for s in c.steps
        ],
        "calibration_moved": moved(before, after) if c.steps else [],
    }  # fmt: skip
    if v.name == "slews":
        told = {axis: (float(from_si(x, "ms")), float(from_si(s, "ms"))) for axis, (x, s) in lateness(v).items()}
        out["late"] = {axis: {"value": x, "sigma": s, "unit": "ms"} for axis, (x, s) in told.items()}
    if v.missed_by_turns is not None and c.steps:
        with suppress(InputError):  # turns too few, or all about one axis, prove nothing
            missed = [float(from_si(v.missed_by_turns(e), "arcsec")) for e in ((), after.effects)]
            out["turns"] = {"rms_before": missed[0], "rms_after": missed[1], "unit": "arcsec"}
    if v.noise.sample is not None:
        n = len(before.r)
        for name, m in (("before", before), ("after", after)):
            Q = basis(m.J / v.noise.sample[..., None]).reshape(n, len(v.channels), -1)
            fitted = (Q**2).sum(axis=(0, 2))  # how many parameters each channel has told
            chi2 = ((m.r / v.noise.sample) ** 2).sum(axis=0) / np.maximum(n - fitted, 1)
            out[f"chi2_of_samples_{name}"] = dict(zip([a for _, a in v.channels], chi2.tolist(), strict=True))
    return out


def _reduced(m: Model, sigma: Array) -> float:
    rank = basis(m.J / sigma[..., None]).shape[1]
    return float(((m.r / sigma) ** 2).sum() / max(m.r.size - rank, 1))


def _outside(when: str, v: View, m: Model, sigma: Array) -> dict[str, float]:
    """Misfit of rows that a fit without them has not seen: mean square in sigma, and rms length of a row in print."""
    left = heldout(v, m, sigma)
    rms = float(np.sqrt(((left * sigma) ** 2).sum() / len(left)))
    return {f"heldout_{when}": float(np.mean(left**2)), f"heldout_rms_{when}": float(from_si(rms, v.unit))}


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


def moved(before: Model, after: Model) -> list[dict[str, Any]]:
    """How far each constant of the baseline moves once what was found is in the model."""
    new = {(r["name"], r["axis"]): r for r in sizes(after)}
    out = []
    seen = np.abs(before.J).max(axis=(0, 1)) > 1e-9  # means taken off leave rounding of a bias
    for r in (row for row, there in zip(sizes(before), seen, strict=True) if there):
        n = new[r["name"], r["axis"]]
        shift = n["value"] - r["value"]
        ratio = round(shift / n["sigma"], 2) if n["sigma"] > 0 else 0.0
        row = {"moved": shift, "sigma": n["sigma"], "in_sigmas": ratio}
        out.append({"name": r["name"], "axis": r["axis"], "unit": r["unit"], **row})
    return sorted(out, key=lambda row: -abs(row["in_sigmas"]))


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
