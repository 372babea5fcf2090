r"""Changes of a unit's parameters between calibrations: jumps, drift, and when the next calibration is due.

Two calibrations with estimates x_k and covariances C_k of their common parameters, from different recordings, differ by

.. math:: \chi^2 = (x_2 - x_1)^T (C_1 + C_2)^{-1} (x_2 - x_1).

Calibrations at the same place share the error of gravity, which affects every scale factor and no difference: it is
removed from both covariances.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

import numpy as np

from gimbalcal.calibration.gravity_uncertainty import common_gravity, without_gravity
from gimbalcal.earth import YEAR
from gimbalcal.effects import Parameter
from gimbalcal.errors import InputError
from gimbalcal.history.dated_calibration import DatedCalibration
from gimbalcal.history.parameter_history import SIGNIFICANCE, ParameterHistory, parameter_history
from gimbalcal.units import from_si, parse, to_si
from gimbalcal.words.history_sentences import comparison_in_words

LATEST_S = 253402300799.0  # the last second of the year 9999
FIXED_VALUE_SIGMAS = 1e-3  # a value nearer to zero was fixed there


@dataclass(frozen=True)
class CalibrationStep:
    """Difference of two successive calibrations: chi^2 over `dof` parameters, and its p-value."""

    before: int
    after: int
    chi2: float
    dof: int
    p_value: float
    shared: bool  # the same recording: then the two are not independent and the p-value is meaningless


@dataclass(frozen=True)
class Comparison:
    """Calibrations of one unit in order of time, the steps between them, and the history of each parameter."""

    unit: str
    calibrations: tuple[DatedCalibration, ...]
    steps: tuple[CalibrationStep, ...]
    histories: tuple[ParameterHistory, ...]
    gravity: float = 0.0  # relative sigma of gravity that all of them share

    @property
    def agree(self) -> bool:
        """Return whether no change exceeds the sigmas."""
        return not any(c.moved for c in self.histories) and not self.significant

    @property
    def significant(self) -> tuple[CalibrationStep, ...]:
        """Return the significant steps."""
        return tuple(s for s in self.steps if not s.shared and s.p_value < SIGNIFICANCE / len(self.steps))

    @property
    def due(self) -> datetime | None:
        """Return when the first parameter will exceed its allowed change."""
        first = min((c.due for c in self.histories if np.isfinite(c.due)), default=None)
        return None if first is None else _date(first)

    @property
    def in_words(self) -> str:
        """Return a summary: whether the unit changed, which parameters most, and when to calibrate."""
        return comparison_in_words(self)

    def to_dict(self) -> dict[str, Any]:
        """Return the content of compare.json; numbers in printed units."""
        return {
            "format": 1,
            "unit": self.unit,
            "in_words": self.in_words,
            "agree": self.agree,
            "common_gravity_sigma_ppm": 1e6 * self.gravity,
            "due": None if self.due is None else self.due.date().isoformat(),
            "calibrations": [
                {"name": d.name, "date": d.date.isoformat(), "method": d.calibration.method,
                 "outcome": d.calibration.outcome, "recordings": sorted(d.hashes)}
                for d in self.calibrations
            ],
            "steps": [
                {"before": s.before, "after": s.after, "chi2": s.chi2, "dof": s.dof,
                 "p_value": None if s.shared else s.p_value, "same_recording": s.shared}
                for s in self.steps
            ],
            "parameters": [_row(c) for c in self.histories],
        }  # fmt: skip


def compare(
    calibrations: Sequence[DatedCalibration], unit: str = "", allowed: Mapping[str, str] | None = None
) -> Comparison:
    """Compare two or more calibrations of a unit, of any methods, in their common parameters.

    allowed: by the name of a parameter, its allowed change before the next calibration, "50 ug"; default: three sigmas
    of the last calibration. Raises InputError for fewer than two, or nothing shared.
    """
    if len(calibrations) < 2:
        raise InputError(f"to compare takes two calibrations, and {len(calibrations)} was given")
    ordered = tuple(sorted(calibrations, key=lambda d: d.date))
    estimated_in: dict[str, list[int]] = {}
    named: dict[str, Parameter] = {}
    for k, d in enumerate(ordered):
        each = zip(d.calibration.parameters, d.calibration.values, d.calibration.sigmas, strict=True)
        for p, x, sigma in each:
            if sigma > 0 and abs(x) > FIXED_VALUE_SIGMAS * sigma:  # unobservable parameters keep zero
                estimated_in.setdefault(p.label, []).append(k)
                named[p.label] = p
    common = {label: at for label, at in estimated_in.items() if len(at) > 1}
    if not common:
        raise InputError("these calibrations have no parameter in common that both of them tell")
    limits = _limits(allowed or {}, named.values())
    time = np.array([d.date.timestamp() for d in ordered])
    independent = [not (ordered[i].hashes & ordered[i + 1].hashes) for i in range(len(ordered) - 1)]
    tried = sum(len(at) - 1 for at in common.values())
    gravity = min((common_gravity(ordered[0].calibration, d.calibration) for d in ordered[1:]), default=0.0)
    own = [np.sqrt(np.diag(without_gravity(d.calibration, gravity))) for d in ordered]
    places = [{p.label: i for i, p in enumerate(d.calibration.parameters)} for d in ordered]
    histories = []
    for label, at in common.items():
        p = named[label]
        there = [(k, places[k][label]) for k in at]
        x = np.array([ordered[k].calibration.values[i] for k, i in there])
        sigma = np.array([own[k][i] for k, i in there])
        limit = limits.get(label, limits.get(p.name, np.inf))
        histories.append(parameter_history(p, at, time[at], x, sigma, tried, independent, limit))
    steps = tuple(_step(ordered, k, not own) for k, own in enumerate(independent))
    return Comparison(unit, ordered, steps, tuple(histories), gravity)


def _date(seconds: float) -> datetime:
    return datetime.fromtimestamp(min(seconds, LATEST_S), UTC)


def _step(ordered: Sequence[DatedCalibration], k: int, shared: bool) -> CalibrationStep:
    from scipy.special import chdtrc

    a, b = ordered[k].calibration, ordered[k + 1].calibration
    # by their names: what is usual of a parameter, and so the rest of it, may differ from one recording to the next
    of_a, of_b = ({p.label: i for i, p in enumerate(c.parameters) if c.sigmas[i] > 0} for c in (a, b))
    both = [label for label in of_a if label in of_b]
    if not both:
        return CalibrationStep(k, k + 1, 0.0, 0, 1.0, shared)
    i, j = ([of[label] for label in both] for of in (of_a, of_b))
    difference = b.values[j] - a.values[i]
    gravity = common_gravity(a, b)
    C = without_gravity(a, gravity)[np.ix_(i, i)] + without_gravity(b, gravity)[np.ix_(j, j)]
    size = np.sqrt(np.diag(C))
    lam, V = np.linalg.eigh(C / np.outer(size, size))
    different = lam > len(lam) * np.finfo(float).eps * lam[-1]  # not a direction that both hold exactly
    chi2 = float((((V.T @ (difference / size))[different]) ** 2 / lam[different]).sum())
    dof = int(different.sum())
    return CalibrationStep(k, k + 1, chi2, dof, float(chdtrc(dof, chi2)), shared)


def _limits(allowed: Mapping[str, str], known: Iterable[Parameter]) -> dict[str, float]:
    """Return allowed changes in SI, by label or name."""
    units = {key: p.unit for p in known for key in (p.label, p.name)}
    out = {}
    for name, text in allowed.items():
        if name not in units:
            raise InputError(f"--allow {name}={text}: no parameter of these calibrations is called {name!r}")
        number, _, unit = text.strip().partition(" ")
        try:
            value = float(number)
        except ValueError:
            raise InputError(
                f"--allow {name}={text}: write a number and a unit, as in {name}='50 {units[name]}'"
            ) from None
        unit = unit.strip() or units[name]
        if parse(unit).dimension != parse(units[name]).dimension or value <= 0:
            raise InputError(f"--allow {name}={text}: give a positive number in {units[name]}")
        out[name] = float(to_si(value, unit))
    return out


def _row(c: ParameterHistory) -> dict[str, Any]:
    p = c.parameter
    number = {key: None if np.isnan(v) else float(from_si(v * YEAR, p.unit))
              for key, v in (("drift_per_year", c.rate), ("drift_sigma", c.rate_sigma))}  # fmt: skip
    return {
        "name": p.name, "axis": p.axis, "effect": p.effect, "unit": p.unit, "calibrations": list(c.at),
        "values": [float(from_si(v, p.unit)) for v in c.value],
        "sigmas": [float(from_si(v, p.unit)) for v in c.sigma],
        "scatter": float(from_si(c.scatter, p.unit)),
        **number,
        "jumps": [c.at[k] for k in c.jumps],
        "outliers": [c.at[k] for k in c.outliers],
        "due": None if np.isnan(c.due) else _date(c.due).date().isoformat(),
    }  # fmt: skip


def flat(content: Mapping[str, Any]) -> dict[str, list[Any]]:
    """Return the histories of a compare.json as columns, a row for each parameter of each calibration."""
    out: dict[str, list[Any]] = {c: [] for c in ("calibration", "date", "name", "axis", "value", "sigma", "unit")}
    for row in content["parameters"]:
        for k, value, sigma in zip(row["calibrations"], row["values"], row["sigmas"], strict=True):
            source = content["calibrations"][k]
            each = (source["name"], source["date"], row["name"], row["axis"], value, sigma, row["unit"])
            for column, cell in zip(out.values(), each, strict=True):
                column.append(cell)
    return out
