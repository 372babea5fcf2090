r"""How the parameters of a unit move from calibration to calibration: jumps, drift, and when to calibrate next.

Two calibrations with estimates x_k and covariances C_k of their common parameters, from different recordings, differ by

.. math:: \chi^2 = (x_2 - x_1)^T (C_1 + C_2)^{-1} (x_2 - x_1).

Made in one place they share the error of its gravity, which is in every scale factor and in no difference: it is taken
out of both covariances.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

import numpy as np

from gimbalcal.calibration.gravity import common_gravity, without_gravity
from gimbalcal.effects import CATALOGUE, Parameter, parameters
from gimbalcal.errors import InputError
from gimbalcal.history.dated_calibration import DatedCalibration, day_of
from gimbalcal.history.parameter_history import DAY, SURPRISE, YEAR, ParameterHistory, parameter_history
from gimbalcal.units import from_si, parse, to_si

LATEST = 253402300799.0  # s; the last second of the year 9999
UNSEEN = 1e-3  # of its sigma: a value that is nearer to zero was held there


@dataclass(frozen=True)
class CalibrationStep:
    """Two calibrations that follow each other: chi^2 of their difference over `dof` parameters, and its chance."""

    before: int
    after: int
    chi2: float
    dof: int
    chance: float
    shared: bool  # recordings: then the two are not independent and the chance says nothing


@dataclass(frozen=True)
class Comparison:
    """Calibrations of one unit in order of time, each step between them, and the course of each parameter."""

    unit: str
    calibrations: tuple[DatedCalibration, ...]
    steps: tuple[CalibrationStep, ...]
    histories: tuple[ParameterHistory, ...]
    gravity: float = 0.0  # one sigma of gravity, as a share of it, that all of them have in common

    @property
    def agree(self) -> bool:
        """Whether nothing moved by more than the sigmas allow."""
        return not any(c.moved for c in self.histories) and not self.odd

    @property
    def odd(self) -> tuple[CalibrationStep, ...]:
        """Steps that chance does not explain."""
        return tuple(s for s in self.steps if not s.shared and s.chance < SURPRISE / len(self.steps))

    @property
    def due(self) -> datetime | None:
        """When the first parameter will have moved by more than is allowed."""
        first = min((c.due for c in self.histories if np.isfinite(c.due)), default=None)
        return None if first is None else _date(first)

    @property
    def in_words(self) -> str:
        """The answer in a few sentences: whether the unit stayed as it was, what moved most, and when to calibrate."""
        n, of = len(self.calibrations), f" of {self.unit}" if self.unit else ""
        made = self.calibrations
        first, last = (day_of(d.date, made) for d in (made[0], made[-1]))
        start = f"{n} calibrations{of} from {first} to {last}"
        moved = sorted((c for c in self.histories if c.moved), key=lambda c: -c.clear)
        if not moved and not self.odd:
            said = f"{start} agree within their sigmas in all {len(self.histories)} parameters."
        elif not moved:
            worst = min(self.odd, key=lambda s: s.chance)
            names = [self.calibrations[k].name for k in (worst.before, worst.after)]
            said = (
                f"{start} do not agree: {names[0]} and {names[1]} differ in their parameters together "
                f"(p = {worst.chance:.2g}), though no parameter does by itself."
            )
        else:
            more = f", and {len(moved) - 3} more" if len(moved) > 3 else ""
            said = f"{start} do not agree: {'; '.join(_moved(c, self.calibrations) for c in moved[:3])}{more}."
            said += f" Next: {_next(moved[0], self.calibrations)}."
        if any(s.shared for s in self.steps):
            said += " Some were made from the same recording and are not held against each other."
        if self.gravity:
            said += (
                f" All took the same gravity, good to {1e6 * self.gravity:.3g} ppm: that is in each scale factor, and "
                "not in how they differ."
            )
        said += self._dates_in_words
        if self.due is not None:
            said += f" The next calibration is due by {self.due:%Y-%m-%d}."
        return said

    @property
    def _dates_in_words(self) -> str:
        """What is to be said of dates that are not those of the recordings; empty where nothing hangs on them."""
        told = [d for d in self.calibrations if "recorded" in d.calibration.provenance]
        write = "write date = 2026-11-18, say, into each recording.toml and calibrate again."
        if told and len(told) < len(self.calibrations):
            few = "one of them says" if len(told) == 1 else f"{len(told)} of them say"
            return f" Only {few} when it was recorded; others stand at the day they were computed: {write}"
        one_day = np.ptp([d.date.timestamp() for d in self.calibrations]) < DAY
        if not told and one_day and len(self.calibrations) > 2:
            return (
                f" When they were recorded is not said, and all were computed within a day: no drift is told; {write}"
            )
        return ""

    def to_dict(self) -> dict[str, Any]:
        """The content of compare.json; numbers in printed units."""
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
                 "p_value": None if s.shared else s.chance, "same_recording": s.shared}
                for s in self.steps
            ],
            "parameters": [_row(c) for c in self.histories],
        }  # fmt: skip


def compare(
    calibrations: Sequence[DatedCalibration], unit: str = "", allowed: Mapping[str, str] | None = None
) -> Comparison:
    """How a unit changed over its calibrations, two or more, of any methods, as far as they share parameters.

    allowed: by the name of a parameter, how far it may move before the next calibration, "50 ug"; without it three
    sigmas of the last calibration, which a new one would show. Raises InputError for fewer than two, or nothing shared.
    """
    if len(calibrations) < 2:
        raise InputError(f"to compare takes two calibrations, and {len(calibrations)} was given")
    made = tuple(sorted(calibrations, key=lambda d: d.date))
    held: dict[str, list[int]] = {}
    named: dict[str, Parameter] = {}
    for k, d in enumerate(made):
        each = zip(d.calibration.parameters, d.calibration.values, d.calibration.sigmas, strict=True)
        for p, x, sigma in each:
            if sigma > 0 and abs(x) > UNSEEN * sigma:  # what nothing shows keeps its prior's zero
                held.setdefault(p.label, []).append(k)
                named[p.label] = p
    common = {label: at for label, at in held.items() if len(at) > 1}
    if not common:
        raise InputError("these calibrations have no parameter in common that both of them tell")
    limits = _limits(allowed or {}, named.values())
    time = np.array([d.date.timestamp() for d in made])
    independent = [not (made[i].hashes & made[i + 1].hashes) for i in range(len(made) - 1)]
    tried = sum(len(at) - 1 for at in common.values())
    alike = min((common_gravity(made[0].calibration, d.calibration) for d in made[1:]), default=0.0)
    own = [np.sqrt(np.diag(without_gravity(d.calibration, alike))) for d in made]
    places = [{p.label: i for i, p in enumerate(d.calibration.parameters)} for d in made]
    histories = []
    for label, at in common.items():
        p = named[label]
        there = [(k, places[k][label]) for k in at]
        x = np.array([made[k].calibration.values[i] for k, i in there])
        sigma = np.array([own[k][i] for k, i in there])
        limit = limits.get(label, limits.get(p.name, np.inf))
        histories.append(parameter_history(p, at, time[at], x, sigma, tried, independent, limit))
    steps = tuple(_step(made, k, not told) for k, told in enumerate(independent))
    return Comparison(unit, made, steps, tuple(histories), alike)


def _date(seconds: float) -> datetime:
    return datetime.fromtimestamp(min(seconds, LATEST), UTC)


def _step(made: Sequence[DatedCalibration], k: int, shared: bool) -> CalibrationStep:
    from scipy.special import chdtrc

    a, b = made[k].calibration, made[k + 1].calibration
    # by their names: what is usual of a parameter, and so the rest of it, may differ from one recording to the next
    of_a, of_b = ({p.label: i for i, p in enumerate(c.parameters) if c.sigmas[i] > 0} for c in (a, b))
    both = [label for label in of_a if label in of_b]
    if not both:
        return CalibrationStep(k, k + 1, 0.0, 0, 1.0, shared)
    i, j = ([of[label] for label in both] for of in (of_a, of_b))
    difference = b.values[j] - a.values[i]
    alike = common_gravity(a, b)
    C = without_gravity(a, alike)[np.ix_(i, i)] + without_gravity(b, alike)[np.ix_(j, j)]
    size = np.sqrt(np.diag(C))
    lam, V = np.linalg.eigh(C / np.outer(size, size))
    seen = lam > len(lam) * np.finfo(float).eps * lam[-1]  # a direction that both hold exactly has no difference
    chi2 = float((((V.T @ (difference / size))[seen]) ** 2 / lam[seen]).sum())
    dof = int(seen.sum())
    return CalibrationStep(k, k + 1, chi2, dof, float(chdtrc(dof, chi2)), shared)


def _limits(allowed: Mapping[str, str], known: Iterable[Parameter]) -> dict[str, float]:
    """How far parameters may move, SI, by label or name."""
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


def _rounded(size: float, sigma: float) -> str:
    """A signed size to the second digit of its sigma.

    >>> _rounded(-11.4412, 0.7032), _rounded(1234.5, 432.1)
    ('-11.44 +- 0.70', '+1234 +- 432')
    """
    places = max(0, 1 - int(np.floor(np.log10(sigma)))) if sigma > 0 else 3
    return f"{size:+.{places}f} +- {sigma:.{places}f}"


def _moved(c: ParameterHistory, made: Sequence[DatedCalibration]) -> str:
    """What one parameter did."""
    unit, called = c.parameter.unit, _called(c.parameter)
    days = [day_of(made[k].date, made) for k in c.at]
    when = [f" between {days[k - 1]} and {days[k]}" if len(made) > 2 else "" for k in c.jumps]
    told = [f"jumped by {_sized(size, unit)}{w}" for size, w in zip(c.sizes, when, strict=False)]
    if c.drifts:
        told.append(f"drifts by {_sized((c.rate * YEAR, c.rate_sigma * YEAR), unit)} a year")
    off = c.sizes[len(c.jumps) :]
    told += [f"is off the others by {_sized(size, unit)} on {days[k]}" for k, size in zip(c.outliers, off, strict=True)]
    if not told:
        size, sigma = (float(from_si(v, unit)) for v in (c.scatter, float(np.median(c.sigma))))
        told = [f"scatters by {size:.3g} {unit} beyond its sigma of {sigma:.2g}"]
    return f"{called} {' and '.join(told)}"


def _sized(size: tuple[float, float], unit: str) -> str:
    return f"{_rounded(*(float(from_si(v, unit)) for v in size))} {unit}"


def _next(c: ParameterHistory, made: Sequence[DatedCalibration]) -> str:
    """What to do about a parameter that moved."""
    if c.jumps:
        after = day_of(made[c.at[c.jumps[-1]]].date, made)
        return f"use the calibration of {after} and later for what was recorded since, and look for what happened then"
    if c.drifts:
        return "use the last one, as long as it holds"
    if c.outliers:
        return f"look at the report of {day_of(made[c.at[c.outliers[0]]].date, made)}, and leave it out"
    return "count on this scatter from one switching-on to the next, not on the sigmas"


def _called(p: Parameter) -> str:
    """A parameter by its effect, as everywhere; by its own name where the effect has several."""
    several = p.effect not in CATALOGUE or len({q.name for q in parameters(CATALOGUE[p.effect], ("inner",))}) > 1
    return f"{p.name if several else p.effect} {p.axis}".replace("_", " ").strip()


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
    """The histories of a compare.json as one table, a row for each parameter of each calibration, by column."""
    out: dict[str, list[Any]] = {c: [] for c in ("calibration", "date", "name", "axis", "value", "sigma", "unit")}
    for row in content["parameters"]:
        for k, value, sigma in zip(row["calibrations"], row["values"], row["sigmas"], strict=True):
            told = content["calibrations"][k]
            each = (told["name"], told["date"], row["name"], row["axis"], value, sigma, row["unit"])
            for column, cell in zip(out.values(), each, strict=True):
                column.append(cell)
    return out
