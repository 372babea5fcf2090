"""A calibration: effects with their covariance, what was not seen, how well it fits, and where it came from."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from gimbalcal.atomic import write_json
from gimbalcal.calibration.correction import correct, corrupt
from gimbalcal.effects import CATALOGUE, Effect, Parameter, parameters, values, with_values
from gimbalcal.errors import InputError
from gimbalcal.number import Array
from gimbalcal.recording import Recording
from gimbalcal.units import from_si, to_si

FORMAT = 1
GIMBAL_NAMES = ("platform", "inner", "middle", "outer")


@dataclass(frozen=True)
class Residual:
    """Weighted misfit and, per channel, the rms of what is left in SI."""

    chi2: float
    dof: int
    rms: Mapping[str, float]


@dataclass(frozen=True)
class Stage:
    """One stage of a calibration for the record: estimate and sigma (SI, order of `labels`), rms residual [m/s^2]."""

    name: str
    labels: tuple[str, ...]
    values: Array
    sigmas: Array
    rms: float
    in_words: str = ""


@dataclass(frozen=True)
class Calibration:
    """Result of an estimator. A failed estimate is one whose `outcome` is a sentence; success is the empty string."""

    method: str
    effects: tuple[Effect, ...]
    parameters: tuple[Parameter, ...]
    covariance: Array  # (p, p) SI, order of `parameters`
    unobservable: tuple[Mapping[str, Any], ...]  # {"direction": {label: weight}, "why": sentence}
    residual: Residual
    outcome: str = ""
    provenance: Mapping[str, Any] = field(default_factory=dict)
    stages: tuple[Stage, ...] = ()

    @property
    def values(self) -> Array:
        """Estimates (p,) in SI."""
        return values(self.effects, self.parameters)

    @property
    def sigmas(self) -> Array:
        """One standard deviation (p,) in SI."""
        return np.sqrt(np.diag(self.covariance))

    def apply(self, recording: Recording) -> Recording:
        """The recording corrected, readings to physics: force [m/s^2], rate [rad/s] and gimbal angles as they were."""
        return correct(self, recording)

    def corrupt(self, recording: Recording) -> Recording:
        """What this unit would have read, physics to readings: the exact inverse of `apply`."""
        return corrupt(self, recording)

    def to_dict(self) -> dict[str, Any]:
        """The content of calibration.json (interfaces.md section 3): values in printed units, covariance in SI."""
        rows = [
            {
                "name": p.name,
                "axis": p.axis,
                "value": float(from_si(v, p.unit)),
                "sigma": float(from_si(s, p.unit)),
                "unit": p.unit,
                "prior_sigma": float(from_si(p.sigma, p.unit)),
                "effect": p.effect,
            }
            for p, v, s in zip(self.parameters, self.values, self.sigmas, strict=True)
        ]
        residual = {"chi2": self.residual.chi2, "dof": self.residual.dof, "rms": dict(self.residual.rms)}
        return {
            "format": FORMAT,
            "method": self.method,
            "outcome": self.outcome,
            "parameters": rows,
            "covariance": np.asarray(self.covariance).tolist(),
            "unobservable": [dict(u) for u in self.unobservable],
            "residual": residual,
            "stages": [
                {
                    "name": s.name,
                    "values": dict(zip(s.labels, np.asarray(s.values).tolist(), strict=True)),
                    "sigmas": dict(zip(s.labels, np.asarray(s.sigmas).tolist(), strict=True)),
                    "rms": s.rms,
                    "in_words": s.in_words,
                }
                for s in self.stages
            ],
            "provenance": dict(self.provenance),
        }

    def write(self, path: Path) -> None:
        """Write calibration.json whole or not at all."""
        write_json(path, self.to_dict())


def from_dict(content: Mapping[str, Any], gimbals: Sequence[str] = GIMBAL_NAMES) -> Calibration:
    """A calibration from the content of calibration.json; InputError for another format or unknown parameter."""
    if content.get("format") != FORMAT:
        raise InputError(f"calibration has format {content.get('format')!r}, this version reads format {FORMAT}")
    known = {(p.name, p.axis): p for cls in CATALOGUE.values() for p in parameters(cls, gimbals, constants=True)}
    rows = content["parameters"]
    missing = [f"{r['name']}:{r['axis']}" for r in rows if (r["name"], r["axis"]) not in known]
    if missing:
        raise InputError(f"calibration holds parameters that this version does not know: {', '.join(missing)}")
    chosen = tuple(known[r["name"], r["axis"]] for r in rows)
    x = np.array([to_si(r["value"], r["unit"]) for r in rows], dtype=float)
    stages = tuple(
        Stage(s["name"], tuple(s["values"]), np.array(list(s["values"].values())),
              np.array(list(s["sigmas"].values())), s["rms"], s["in_words"])
        for s in content.get("stages", [])
    )  # fmt: skip
    return Calibration(
        method=content["method"],
        effects=with_values((), chosen, x, gimbals),
        parameters=chosen,
        covariance=np.array(content["covariance"], dtype=float),
        unobservable=tuple(content["unobservable"]),
        residual=Residual(content["residual"]["chi2"], content["residual"]["dof"], content["residual"]["rms"]),
        outcome=content["outcome"],
        provenance=content["provenance"],
        stages=stages,
    )


def read(path: Path) -> Calibration:
    """The calibration in a calibration.json. Raises InputError, naming the file, when it cannot be read."""
    try:
        return from_dict(json.loads(path.read_text()))
    except FileNotFoundError:
        raise InputError(f"there is no {path}; give a calibration.json that `gimbalcal calibrate` wrote") from None
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as problem:
        raise InputError(
            f"{path} is not a calibration.json written by `gimbalcal calibrate` ({type(problem).__name__}: {problem})"
        ) from None
