"""The answer: what is said of a recording, and the residuals behind its picture."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from gimbalcal.calibration import Calibration
from gimbalcal.errors import InputError
from gimbalcal.number import Array

if TYPE_CHECKING:
    import polars as pl
    from matplotlib.figure import Figure

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

    def __str__(self) -> str:
        """The answer in words, and each finding with its sizes."""
        lines = [self.in_words, *filter(None, [self.outcome])]
        for f in self.findings:
            sizes = "; ".join(f"{p['name']} {p['axis']} {p['value']:.4g} +- {p['sigma']:.2g} {p['unit']}"
                              for p in f["parameters"])  # fmt: skip
            lines.append(
                f"{f['effect']} {f['axis']}: probability {f['probability']:.2g}, {f['sigma']:.3g} sigma; {sizes}"
            )
        return "\n".join(lines)

    def to_frame(self) -> pl.DataFrame:
        """One row for each parameter of each finding: effect, axis, probability, significance, value and sigma."""
        import polars as pl

        rows = [
            {"effect": f["effect"], "axis": f["axis"], "probability": f["probability"], "in_sigmas": f["sigma"],
             "parameter": f"{p['name']} {p['axis']}".strip(), "value": p["value"], "sigma": p["sigma"],
             "unit": p["unit"]}
            for f in self.findings for p in f["parameters"]
        ]  # fmt: skip
        names = ("effect", "axis", "probability", "in_sigmas", "parameter", "value", "sigma", "unit")
        return pl.DataFrame(rows) if rows else pl.DataFrame({n: [] for n in names})

    def plot(self) -> Figure:
        """Residuals in sigma over time, before and after what was found, as a matplotlib figure."""
        from matplotlib.figure import Figure

        if self.curves is None:
            raise InputError("this diagnosis holds no residuals: it was read from a file")
        c = self.curves
        figure = Figure(figsize=(8, 1.7 * len(c.channels)), layout="constrained")
        for ax, (quantity, axis), k in zip(
            figure.subplots(len(c.channels), 1, sharex=True, squeeze=False).ravel(), c.channels,
            range(len(c.channels)), strict=True,
        ):  # fmt: skip
            ax.plot(c.time, c.before[:, k], ".", ms=3, color="0.7", label="before")
            ax.plot(c.time, c.after[:, k], ".", ms=3, label="after")
            ax.set_ylabel(f"{quantity.replace('_', ' ')} {axis} [sigma]", fontsize=8)
        ax.set_xlabel("time [s]")
        ax.legend(loc="upper right", fontsize=8)
        return figure

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
