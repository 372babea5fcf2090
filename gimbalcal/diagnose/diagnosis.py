r"""The diagnosis: locate, name, model, verify, recommend; one function, one frozen answer.

    observe ──> noise ──> library ──> search ──> decide ──> model ──> verify ──> recommend
                                        └──> locate (before and after)
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

import gimbalcal
from gimbalcal.calibration import Calibration
from gimbalcal.diagnose import wording
from gimbalcal.diagnose.candidates import library
from gimbalcal.diagnose.decide import CLAIM, Decision, decide
from gimbalcal.diagnose.locate import scan, told
from gimbalcal.diagnose.model import Fit, calibration_fit, constant_value, fit
from gimbalcal.diagnose.noise import nodes, settle
from gimbalcal.diagnose.observations import BASELINE, observe
from gimbalcal.diagnose.recommend import advise, sentence
from gimbalcal.diagnose.search import Search, search
from gimbalcal.diagnose.threshold import clean_evidence
from gimbalcal.diagnose.unstated import applies, diagnose_unstated
from gimbalcal.diagnose.verify import physical_columns, residual_rows, verify
from gimbalcal.effects import CATALOGUE
from gimbalcal.errors import InputError
from gimbalcal.number import Array
from gimbalcal.recording import Recording
from gimbalcal.units import from_si

Tell = Callable[[str], None]


@dataclass(frozen=True)
class Curves:
    """Residuals of one recording for a picture: time (n,) s, position (n,), channels, residual in sigma (n, C)."""

    time: Array
    position: Array
    channels: tuple[tuple[str, str], ...]
    before: Array
    after: Array


@dataclass(frozen=True)
class Diagnosis:
    """The content of diagnosis.json (interfaces.md section 4), and the residuals behind its picture."""

    verdict: str
    mismatch: tuple[Mapping[str, Any], ...]
    findings: tuple[Mapping[str, Any], ...]
    unexplained: tuple[Mapping[str, Any], ...]
    fit: Mapping[str, Any]
    provenance: Mapping[str, Any] = field(default_factory=dict)
    in_words: str = ""
    curves: Curves | None = None

    def to_dict(self) -> dict[str, Any]:
        """The content of diagnosis.json."""
        return {
            "format": 1,
            "verdict": self.verdict,
            "in_words": self.in_words,
            "mismatch": [dict(m) for m in self.mismatch],
            "findings": [dict(f) for f in self.findings],
            "unexplained": [dict(u) for u in self.unexplained],
            "fit": dict(self.fit),
            "provenance": dict(self.provenance),
        }


def _silent(_: str) -> None:
    pass


def diagnose(
    recordings: Sequence[Recording],
    calibration: Calibration | None = None,
    baseline: Sequence[str] = (),
    seed: int = 1,
    tell: Tell = _silent,
) -> Diagnosis:
    """Say where the recordings differ from the calibrated model and which physics was left out.

    `calibration` gives values to start from, `baseline` the ids of the effects the model holds (the usual ones of the
    kind of recording otherwise). Raises InputError where there is nothing to compare.
    """
    if not recordings:
        raise InputError("`diagnose` needs at least one recording")
    if len(recordings) > 1:
        raise InputError("`diagnose` takes one recording at a time; run it on each and compare")
    from threadpoolctl import threadpool_limits

    with threadpool_limits(limits=1):  # many small matrices: threads only get into each other's way
        return _diagnose(recordings[0], calibration, tuple(baseline), seed, tell)


def _diagnose(
    recording: Recording, calibration: Calibration | None, baseline: tuple[str, ...], seed: int, tell: Tell
) -> Diagnosis:
    if applies(recording):
        return diagnose_unstated(recording, calibration, baseline, seed, tell)
    rng = np.random.default_rng(seed)
    ids = tuple(baseline) or BASELINE.get(recording.kind, ())
    tell("fitting the calibrated model")
    o = settle(observe(recording, ids, calibration.effects if calibration else ()))
    tell("comparing every cause of the catalogue, alone and in pairs")
    s = search(o, library(o, ids), nodes(o))
    tell("sending simulated clean recordings of this design through the same comparison")
    clean = clean_evidence(s.rows, s.projections, s.library.candidates, s.share, s.null, rng)
    d = decide(s, float(np.quantile(clean, 0.99)))
    return _report(s, d, clean, rng, {"baseline": list(ids), "seed": seed}, tell)


def _report(
    s: Search, d: Decision, clean: Array, rng: np.random.Generator, options: Mapping[str, Any], tell: Tell
) -> Diagnosis:
    members = d.hypothesis.members if d.hypothesis else ()
    f = fit(s, members)
    seen = fit(s, members or tuple(d.shapes[:1]))  # the noise as it is once the shape is allowed for
    physical = physical_columns(s, f)
    tell("locating the mismatch and checking held-out data")
    before = scan(s.o, s.rows, seen.projection.node, rng)
    after = scan(s.o, s.rows, seen.projection.node, rng, s.library.X[:, list(f.index)]) if f.index else before
    mismatch = () if d.verdict == "adequate" else told(before, at_least=1)
    verification = verify(s, f if f.index else seen, physical).to_dict()
    fitted = {
        **verification,
        "scan_p_before": before.p_value,
        "scan_p_after": after.p_value,
        "noise": dict(seen.projection.node.name),
        "calibration_moved": moved(s, f) if f.index else [],
    }
    named = findings(s, d, f)
    shapes = tuple(_shape(s, i) for i in d.shapes[:3])
    provenance = {
        "version": gimbalcal.__version__,
        "recordings": [{"path": r.path, "sha256": r.sha256} for r in s.o.recording.source],
        "options": dict(options),
        "ln_bayes_factor": round(s.ln_total, 3),
        "ln_bayes_factor_needed": round(max(CLAIM, float(np.quantile(clean, 0.99))), 3),
        "false_alarm_rate_simulated": float(np.mean(clean >= CLAIM)),
        "probability_unknown": round(d.unknown, 4),
        "causes_compared": len([c for c in s.library.candidates if not c.rival]),
        "excess_kurtosis": round(s.o.heavy, 3),
    }
    words = wording.answer(d.verdict, named, shapes, mismatch, fitted)
    left, rest = residual_rows(s.o, physical, f.x)
    curves = Curves(s.o.stimulus.time, s.o.stimulus.position, s.o.channels, left, rest)
    return Diagnosis(d.verdict, mismatch, named, shapes, fitted, provenance, words, curves)


def findings(s: Search, d: Decision, f: Fit) -> tuple[dict[str, Any], ...]:
    """What is named: effect, axis, probability, significance, sizes, twins, physics, and what would separate them."""
    candidates, out, at = s.library.candidates, [], 0
    for j, m in enumerate(f.members):
        c = candidates[m]
        size = f.x[at : at + len(c.parameters)]
        sigma = np.sqrt(np.diag(f.covariance))[at : at + len(c.parameters)]
        at += len(c.parameters)
        twins = [candidates[i] for i in d.twins[j]]
        axes = list(dict.fromkeys(a for a in [c.axis, *(t.axis for t in twins)] if a))
        axes = [a for n, a in enumerate(axes) if not any(a in b for b in axes[:n])]
        advice = ""
        if twins:
            a = advise(s.o, c, f.variants[j], size, twins[0])
            advice = sentence(a, c, twins[0])
        out.append({
            "effect": c.effect, "axis": " / ".join(axes), "probability": round(min(d.probability[j], 0.9999), 4),
            "sigma": round(f.significance[j], 2), "parameters": _sizes(s, f, j, size, sigma),
            "twins": [t.effect for t in twins], "physics": wording.physics(c.effect),
            "equation": wording.equation(c.effect), "separate_by": advice,
        })  # fmt: skip
    return tuple(out)


def _sizes(s: Search, f: Fit, j: int, size: Array, sigma: Array) -> list[dict[str, Any]]:
    """Parameters of member j in printed units, then its non-linear constants."""
    c = s.library.candidates[f.members[j]]
    rows = []
    for p, x, e in zip(c.parameters, size, sigma, strict=True):
        scale = float(from_si(p.sigma, p.unit))
        value, sigma_ = float(x) * scale, float(e) * scale
        rows.append({"name": p.name, "axis": p.axis, "value": value, "sigma": sigma_, "unit": p.unit})
    units = {g.name: g.metadata["unit"] for g in CATALOGUE[c.effect].__dataclass_fields__.values() if g.metadata}
    return rows + [
        {"name": name, "axis": "", "value": float(from_si(value, units[name])),
         "sigma": float(from_si(spread, units[name])), "unit": units[name]}
        for name, value, spread in constant_value(s, f, j)
    ]  # fmt: skip


def moved(s: Search, f: Fit) -> list[dict[str, Any]]:
    """How far each calibration constant moves once what was found is in the model."""
    before, after, sigma = calibration_fit(s, f)
    out = []
    for p, b, a, e in zip(s.o.constants, before, after, sigma, strict=True):
        scale = float(from_si(p.sigma, p.unit))
        out.append({
            "name": p.name, "axis": p.axis, "moved": float(a - b) * scale, "sigma": float(e) * scale, "unit": p.unit,
            "in_sigmas": round(float((a - b) / e), 2) if e > 0 else 0.0,
        })  # fmt: skip
    return sorted(out, key=lambda row: -abs(row["in_sigmas"]))


def _shape(s: Search, i: int) -> dict[str, str]:
    c = s.library.candidates[i]
    return wording.shape(c.rival, c.channel, c.axis)
