"""The answer: what is said of a recording, and the residuals behind its picture."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gimbalcal.atomic import write_json
from gimbalcal.calibration import Calibration
from gimbalcal.diagnose.result import Finding, FitSummary, LawResult, Mismatch, Shape
from gimbalcal.display import Displayed, data_frame
from gimbalcal.effects import Stimulus
from gimbalcal.entries import Json, plain_json
from gimbalcal.errors import InputError
from gimbalcal.number import Array
from gimbalcal.units import from_si

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from gimbalcal.recording import Recording

VERDICTS = ("adequate", "not-identifiable", "unexplained", "missing-physics")  # of two views the later one is reported


@dataclass(frozen=True)
class Curves:
    """Residuals of one recording for a picture: time (n,) s, position (n,), channels, residual in sigma (n, C).

    sigma (n, C) in `units` of each channel makes them physical; `against` is what a person would plot them over, a name
    with its unit to (n,); `words` names the channels where their quantity and axis do not.
    """

    time: Array
    position: Array
    channels: tuple[tuple[str, str], ...]
    before: Array
    after: Array
    sigma: Array | None = None
    units: tuple[str, ...] = ()
    against: Mapping[str, Array] = field(default_factory=dict)
    words: tuple[str, ...] = ()


PRINTED = {"specific_force": "ug", "angular_rate": "deg/h"}  # units of residuals; angles are in arcsec


def in_print(channels: Sequence[tuple[str, str]], sigma: Array) -> tuple[Array, tuple[str, ...]]:
    """One sigma (n, C) of SI channels in printed units, and those units."""
    units = tuple(PRINTED.get(quantity, "arcsec") for quantity, _ in channels)
    columns = [from_si(s, u) for s, u in zip(np.asarray(sigma).T, units, strict=True)]
    return np.stack(columns, axis=-1), units


def plotted_against(s: Stimulus) -> dict[str, Array]:
    """Return what a residual may follow, in printed units: temperature, other logged channels, readouts that move."""
    variables = {} if s.temperature is None else {"temperature [°C]": s.temperature}
    variables |= {f"{name.replace('_', ' ')} (as logged)": v for name, v in s.covariates.items()}
    variables |= {f"{name.replace('_', ' ')} [°]": np.degrees(s.readout[:, i]) for i, name in enumerate(s.axis_names)}
    return {name: np.asarray(v) for name, v in variables.items() if np.ptp(v) > 1e-6 * max(1.0, float(np.abs(v).max()))}


@dataclass(frozen=True, repr=False)
class Diagnosis(Displayed):
    """The content of diagnosis.json (interfaces.md section 4), and the residuals behind its picture."""

    verdict: str
    mismatch: tuple[Mismatch, ...]
    findings: tuple[Finding, ...]
    unexplained: tuple[Shape, ...]
    fit: FitSummary
    provenance: Mapping[str, Any] = field(default_factory=dict)
    in_words: str = ""
    curves: Curves | None = None
    calibration: Calibration | None = None  # the refit: the model with what was found in it
    outcome: str = ""  # what else speaks against the recording or its model: a fault, a larger noise, an odd constant
    laws: tuple[LawResult, ...] = ()  # where nothing known explains it
    recommend: str = ""  # what would determine a law, where these data do not
    without: Callable[[str], Calibration] | None = field(default=None, compare=False)  # the refit without an effect
    other_curves: tuple[Curves, ...] = field(default=(), compare=False)  # of the views that do not lead
    used: Recording | None = field(default=None, compare=False)  # where rows of a recording were omitted: the others
    printer: Callable[[Diagnosis], str] | None = field(default=None, compare=False)  # how it prints itself

    def __str__(self) -> str:
        """The answer as the console has it; else its numbers, and each finding with its sizes."""
        if self.printer is not None:
            return self.printer(self)
        lines = [self.in_words, *filter(None, [self.outcome])]
        for f in self.findings:
            sizes = "; ".join(f"{p.name} {p.axis} {p.value:.4g} +- {p.sigma:.2g} {p.unit}" for p in f.parameters)
            lines.append(f"{f.effect} {f.axis}: probability {f.probability:.2g}, {f.sigma:.3g} sigma; {sizes}")
        return "\n".join(lines)

    __repr__ = __str__

    def to_frame(self, kind: str = "polars") -> Any:
        """Return a row for each parameter of each finding: effect, axis, probability, significance, value and sigma.

        kind: "polars" or "pandas".
        """
        rows = [
            {"effect": f.effect, "axis": f.axis, "probability": f.probability, "in_sigmas": f.sigma,
             "parameter": f"{p.name} {p.axis}".strip(), "value": p.value, "sigma": p.sigma, "unit": p.unit}
            for f in self.findings for p in f.parameters
        ]  # fmt: skip
        names = ("effect", "axis", "probability", "in_sigmas", "parameter", "value", "sigma", "unit")
        return data_frame({n: [r[n] for r in rows] for n in names}, kind, ("effect", "axis", "parameter", "unit"))

    def write(self, path: str | Path) -> None:
        """Write diagnosis.json atomically."""
        write_json(path, self.to_dict())

    def plot(self) -> Figure:
        """Return residuals in sigma over time, before and after what was found, as a matplotlib figure."""
        from gimbalcal.figure import NotebookFigure

        if self.curves is None:
            raise InputError("this diagnosis holds no residuals: it was read from a file")
        c = self.curves
        figure = NotebookFigure(figsize=(8, max(2.8, 1.7 * len(c.channels))), layout="constrained")
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

    def to_dict(self) -> Json:
        """The content of diagnosis.json."""
        return {
            "format": 1,
            "verdict": self.verdict,
            "in_words": self.in_words,
            "outcome": self.outcome,
            "mismatch": plain_json(self.mismatch),
            "findings": plain_json(self.findings),
            "unexplained": plain_json(self.unexplained),
            **(
                {"laws": plain_json(self.laws), "recommend": self.recommend}
                if self.verdict == "unexplained" or self.laws
                else {}
            ),
            "fit": self.fit.to_dict(),
            "provenance": dict(self.provenance),
        }
