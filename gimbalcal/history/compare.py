r"""Changes of a unit's parameters between calibrations: jumps, drift, and when the next calibration is due.

Two calibrations with estimates x_k and covariances C_k of their common parameters, from different recordings, differ by

.. math:: \chi^2 = (x_2 - x_1)^T (C_1 + C_2)^{-1} (x_2 - x_1).

Calibrations at the same place share the error of gravity, which affects every scale factor and no difference: it is
removed from both covariances. Calibrations of a unit that outputs counts are brought to one nominal scale and offset.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from math import nan
from typing import Any

import numpy as np

from gimbalcal.calibration import Readout
from gimbalcal.calibration.common_readout import common_readout, in_readout, is_in_counts
from gimbalcal.calibration.gravity_uncertainty import common_gravity, without_gravity
from gimbalcal.earth import YEAR
from gimbalcal.effects import Parameter
from gimbalcal.entries import Entry, Json
from gimbalcal.errors import InputError
from gimbalcal.history.parameter_history import SIGNIFICANCE, ParameterHistory, parameter_history
from gimbalcal.history.unit_store import DatedCalibration
from gimbalcal.number import Array
from gimbalcal.p_value import probability
from gimbalcal.units import from_si, parse, to_si
from gimbalcal.words.history_sentences import comparison_in_words

LATEST_S = 253402300799.0  # the last second of the year 9999
FIXED_VALUE_SIGMAS = 1e-3  # a value nearer to zero was fixed there


@dataclass(frozen=True)
class CalibrationStep(Entry):
    """Difference of two successive calibrations: chi^2 over `dof` parameters, and its p-value.

    p_value: nan, null in compare.json, for two calibrations of the same recording, which are not independent.
    """

    before: int
    after: int
    chi2: float
    dof: int
    p_value: float
    same_recording: bool


@dataclass(frozen=True)
class ComparedCalibration(Entry):
    """A calibration in compare.json: file or date in a store, date of ISO 8601, and SHA-256 of its recordings."""

    name: str
    date: str
    method: str
    outcome: str
    recordings: tuple[str, ...] = ()


@dataclass(frozen=True)
class PrintedHistory(Entry):
    """A parameter over the calibrations in its unit of print: jumps and outliers are numbers of calibrations."""

    name: str
    axis: str
    effect: str
    unit: str
    calibrations: tuple[int, ...]
    values: tuple[float, ...]
    sigmas: tuple[float, ...]
    scatter: float
    drift_per_year: float  # nan without a drift
    drift_sigma: float
    jumps: tuple[int, ...]
    outliers: tuple[int, ...]
    due: str | None

    def to_dict(self) -> Json:
        """Return the entry of compare.json."""
        return {**super().to_dict(), "due": self.due}


@dataclass(frozen=True, kw_only=True)
class PrintedComparison(Entry):
    """The content of compare.json: numbers in printed units, dates of ISO 8601."""

    format: int = 1
    unit: str
    in_words: str
    agree: bool
    common_gravity_sigma_ppm: float
    due: str | None
    calibrations: tuple[ComparedCalibration, ...]
    steps: tuple[CalibrationStep, ...]
    parameters: tuple[PrintedHistory, ...]
    readout: Mapping[str, Any] = field(
        default_factory=Readout().to_dict
    )  # as in calibration.json: the nominal counts that the parameters are errors of

    def to_dict(self) -> Json:
        """Return the content of compare.json."""
        return {**super().to_dict(), "due": self.due}

    @property
    def columns(self) -> dict[str, list[Any]]:
        """Return the histories as columns, a row for each parameter of each calibration."""
        rows = [
            (self.calibrations[k].name, self.calibrations[k].date, p.name, p.axis, value, sigma, p.unit)
            for p in self.parameters
            for k, value, sigma in zip(p.calibrations, p.values, p.sigmas, strict=True)
        ]
        names = ("calibration", "date", "name", "axis", "value", "sigma", "unit")
        return {name: [row[i] for row in rows] for i, name in enumerate(names)}


@dataclass(frozen=True)
class UnitComparison:
    """Calibrations of one unit in order of time, the steps between them, and the history of each parameter."""

    unit: str
    calibrations: tuple[DatedCalibration, ...]
    steps: tuple[CalibrationStep, ...]
    histories: tuple[ParameterHistory, ...]
    gravity: float = 0.0  # relative sigma of gravity that all of them share
    readout: Readout = field(default_factory=Readout)  # that all of them are brought to

    @property
    def agree(self) -> bool:
        """Return whether no change exceeds the sigmas."""
        return not any(c.moved for c in self.histories) and not self.significant

    @property
    def significant(self) -> tuple[CalibrationStep, ...]:
        """Return the significant steps."""
        return tuple(s for s in self.steps if s.p_value < SIGNIFICANCE / len(self.steps))

    @property
    def due(self) -> datetime | None:
        """Return when the first parameter will exceed its allowed change."""
        first = min((c.due for c in self.histories if np.isfinite(c.due)), default=None)
        return None if first is None else _date(first)

    @property
    def in_words(self) -> str:
        """Return a summary: whether the unit changed, which parameters most, and when to calibrate."""
        return comparison_in_words(self)

    def to_dict(self) -> Json:
        """Return the content of compare.json."""
        return self.printed.to_dict()

    @property
    def printed(self) -> PrintedComparison:
        """Return the content of compare.json."""
        return PrintedComparison(
            unit=self.unit,
            in_words=self.in_words,
            agree=self.agree,
            common_gravity_sigma_ppm=1e6 * self.gravity,
            due=None if self.due is None else self.due.date().isoformat(),
            calibrations=tuple(
                ComparedCalibration(
                    d.name, d.date.isoformat(), d.calibration.method, d.calibration.outcome, tuple(sorted(d.hashes))
                )
                for d in self.calibrations
            ),
            steps=self.steps,
            parameters=tuple(_printed(c) for c in self.histories),
            readout=self.readout.to_dict(),
        )


def compare(
    calibrations: Sequence[DatedCalibration], unit: str = "", allowed: Mapping[str, str] | None = None
) -> UnitComparison:
    """Compare two or more calibrations of a unit, of any methods, in their common parameters.

    allowed: by the name of a parameter, its allowed change before the next calibration, "50 ug"; default: three sigmas
    of the last calibration. Raises InputError for fewer than two, or nothing shared.
    """
    if len(calibrations) < 2:
        raise InputError(f"to compare takes two calibrations, and {len(calibrations)} was given")
    ordered, readout = _about_one_readout(sorted(calibrations, key=lambda d: d.date))
    estimated_in: dict[str, list[int]] = {}
    named: dict[str, Parameter] = {}
    for k, d in enumerate(ordered):
        each = zip(d.calibration.parameters, d.calibration.values, d.calibration.sigmas, strict=True)
        for p, x, sigma in each:
            zero = abs(x) <= FIXED_VALUE_SIGMAS * sigma and not is_in_counts(p, d.calibration.readout)
            if sigma > 0 and not zero:  # unobservable parameters keep zero
                estimated_in.setdefault(p.label, []).append(k)
                named[p.label] = p
    common = {label: at for label, at in estimated_in.items() if len(at) > 1}
    if not common:
        raise InputError("these calibrations have no parameter in common that both of them determine")
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
    return UnitComparison(unit, ordered, steps, tuple(histories), gravity, readout)


def _about_one_readout(ordered: Sequence[DatedCalibration]) -> tuple[tuple[DatedCalibration, ...], Readout]:
    """Return calibrations with their parameters about a common nominal scale and offset, and these.

    Raises InputError where a triad outputs counts in some of them and SI in others.
    """
    outputs: dict[str, dict[bool, str]] = {}
    for d in ordered:
        for p in d.calibration.parameters:
            outputs.setdefault(p.label, {}).setdefault(is_in_counts(p, d.calibration.readout), d.name)
    for label, names in outputs.items():
        if len(names) > 1:
            raise InputError(
                f"{names[True]} was calibrated in counts and {names[False]} in SI units, so {label} has no common "
                "scale; compare calibrations of recordings that are logged alike"
            )
    readout = common_readout([d.calibration for d in ordered])
    return tuple(replace(d, calibration=in_readout(d.calibration, readout)) for d in ordered), readout


def _date(seconds: float) -> datetime:
    return datetime.fromtimestamp(min(seconds, LATEST_S), UTC)


def _step(ordered: Sequence[DatedCalibration], k: int, shared: bool) -> CalibrationStep:
    a, b = ordered[k].calibration, ordered[k + 1].calibration
    # by their names: what is usual of a parameter, and so the rest of it, may differ from one recording to the next
    of_a, of_b = ({p.label: i for i, p in enumerate(c.parameters) if c.sigmas[i] > 0} for c in (a, b))
    both = [label for label in of_a if label in of_b]
    if not both:
        return CalibrationStep(k, k + 1, 0.0, 0, nan if shared else 1.0, shared)
    i, j = ([of[label] for label in both] for of in (of_a, of_b))
    difference = b.values[j] - a.values[i]
    gravity = common_gravity(a, b)
    C = without_gravity(a, gravity)[np.ix_(i, i)] + without_gravity(b, gravity)[np.ix_(j, j)]
    size = np.sqrt(np.diag(C))
    lam, V = np.linalg.eigh(C / np.outer(size, size))
    different = lam > len(lam) * np.finfo(float).eps * lam[-1]  # not a direction that both hold exactly
    chi2 = float((((V.T @ (difference / size))[different]) ** 2 / lam[different]).sum())
    dof = int(different.sum())
    return CalibrationStep(k, k + 1, chi2, dof, nan if shared else probability(chi2, dof), shared)


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


def _printed(c: ParameterHistory) -> PrintedHistory:
    p = c.parameter

    def printed(x: Array) -> tuple[float, ...]:
        return tuple(float(from_si(v, p.unit)) for v in x)

    drift, drift_sigma, scatter = printed(np.array([c.rate * YEAR, c.rate_sigma * YEAR, c.scatter]))
    return PrintedHistory(
        p.name, p.axis, p.effect, p.unit, c.at, printed(c.value), printed(c.sigma), scatter, drift, drift_sigma,
        tuple(c.at[k] for k in c.jumps), tuple(c.at[k] for k in c.outliers),
        None if np.isnan(c.due) else _date(c.due).date().isoformat(),
    )  # fmt: skip
