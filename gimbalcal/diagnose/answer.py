"""The answer: what is said of a recording, and the residuals behind its picture."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from gimbalcal.calibration import Calibration
from gimbalcal.number import Array

VERDICTS = ("adequate", "not-identifiable", "unexplained", "missing-physics")  # of two views the later one is told


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
    calibration: Calibration | None = None  # the refit: the model with what was found in it
    outcome: str = ""  # one sentence where the verdict is adequate and yet something speaks against the model

    def to_dict(self) -> dict[str, Any]:
        """The content of diagnosis.json."""
        return {
            "format": 1,
            "verdict": self.verdict,
            "in_words": self.in_words,
            "outcome": self.outcome,
            "mismatch": [dict(m) for m in self.mismatch],
            "findings": [dict(f) for f in self.findings],
            "unexplained": [dict(u) for u in self.unexplained],
            "fit": dict(self.fit),
            "provenance": dict(self.provenance),
        }
