r"""The diagnosis: locate, name, model, verify, recommend; one function, one frozen answer.

    observe ──> noise ──> library ──> search ──> decide ──> model ──> verify ──> recommend
                             └──> locate
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from gimbalcal.calibration import Calibration
from gimbalcal.diagnose.candidates import library
from gimbalcal.diagnose.decide import Decision, decide
from gimbalcal.diagnose.model import Fit, constant_value, fit
from gimbalcal.diagnose.noise import nodes, settle
from gimbalcal.diagnose.observations import BASELINE, Observations, observe
from gimbalcal.diagnose.search import Search, search
from gimbalcal.effects import CATALOGUE
from gimbalcal.errors import InputError
from gimbalcal.recording import Recording
from gimbalcal.units import from_si

Tell = Callable[[str], None]


@dataclass(frozen=True)
class Diagnosis:
    """The content of diagnosis.json (interfaces.md section 4)."""

    verdict: str
    mismatch: tuple[Mapping[str, Any], ...]
    findings: tuple[Mapping[str, Any], ...]
    unexplained: tuple[Mapping[str, Any], ...]
    fit: Mapping[str, Any]
    provenance: Mapping[str, Any] = field(default_factory=dict)
    in_words: str = ""

    def to_dict(self) -> dict[str, Any]:
        """The content of diagnosis.json."""
        return {
            "format": 1,
            "verdict": self.verdict,
            "mismatch": list(self.mismatch),
            "findings": list(self.findings),
            "unexplained": list(self.unexplained),
            "fit": dict(self.fit),
            "in_words": self.in_words,
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
    """Say where the recordings differ from the calibrated model and which physics was left out."""
    if not recordings:
        raise InputError("`diagnose` needs at least one recording")
    (recording,) = recordings
    o = settle(observe(recording, baseline, calibration.effects if calibration else ()))
    tell("comparing every cause of the catalogue")
    s = search(o, library(o, tuple(baseline) or BASELINE[o.kind]), nodes(o))
    d = decide(s)
    f = fit(s, d.hypothesis.members if d.hypothesis else ())
    return Diagnosis(d.verdict, (), findings(s, d, f), unexplained(s, d), {}, {"seed": seed}, d.verdict)


def findings(s: Search, d: Decision, f: Fit) -> tuple[dict[str, Any], ...]:
    """What is named: effect, axis, probability, significance, sizes, twins."""
    out, at = [], 0
    for j, m in enumerate(f.members):
        c = s.library.candidates[m]
        rows = []
        for p in c.parameters:
            scale = float(from_si(p.sigma, p.unit))
            rows.append({"name": p.name, "axis": p.axis, "value": float(f.x[at]) * scale,
                         "sigma": float(np.sqrt(f.covariance[at, at])) * scale, "unit": p.unit})  # fmt: skip
            at += 1
        units = {g.name: g.metadata["unit"] for g in CATALOGUE[c.effect].__dataclass_fields__.values() if g.metadata}
        rows += [
            {"name": name, "value": float(from_si(value, units[name])), "sigma": float(from_si(sigma, units[name])),
             "unit": units[name]}
            for name, value, sigma in constant_value(s, f, j)
        ]  # fmt: skip
        out.append({
            "effect": c.effect, "axis": c.axis, "probability": round(d.probability[j], 4),
            "sigma": round(f.significance[j], 2), "parameters": rows,
            "twins": [s.library.candidates[i].effect for i in d.twins[j]],
        })  # fmt: skip
    return tuple(out)


def unexplained(s: Search, d: Decision) -> tuple[dict[str, Any], ...]:
    """Shapes of what no cause explains."""
    out = []
    for i in d.shapes[:3]:
        c = s.library.candidates[i]
        out.append({"channel": f"{c.channel} {c.axis}", "shape": c.rival})
    return tuple(out)


def _unused(o: Observations) -> None:
    del o
