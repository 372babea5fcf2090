"""Sum up a batch: the distribution of each parameter over the units, units outside it, verdicts and failures."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import isfinite
from typing import TYPE_CHECKING, Any

import numpy as np

from gimbalcal.earth import YEAR
from gimbalcal.entries import Entry
from gimbalcal.history import DIAGNOSIS, FAILURE, DatedCalibration, StoredResult, dated_calibrations
from gimbalcal.history.fleet import SIGNIFICANCE, Distribution, Fleet, fleet, normal_tail, own_estimate, rests_on_fleet
from gimbalcal.units import from_si
from gimbalcal.words.fleet_sentences import fleet_in_words

if TYPE_CHECKING:
    import polars as pl


@dataclass(frozen=True)
class UnitReport(Entry):
    """A report states the outcome of the calibration and of the diagnosis of one unit, or why one of them failed.

    date: when it was recorded, empty where that is not stated.
    """

    recording: str
    unit: str
    date: str
    method: str
    outcome: str
    verdict: str
    in_words: str
    failure: str


@dataclass(frozen=True)
class FleetParameter(Entry):
    """The distribution of a parameter over the units that are inside, in its unit of print.

    mean and spread (one sigma of the units) with the sigma of the mean; sigma: of a further unit; own_sigma: median
    sigma of one calibration; trend_per_year: slope over the dates of the units, null where these do not differ; drifts:
    whether the trend is significant over all parameters together.
    """

    name: str
    axis: str
    effect: str
    unit: str
    units: int
    mean: float
    mean_sigma: float
    spread: float
    sigma: float
    own_sigma: float
    trend_per_year: float | None
    trend_sigma: float | None
    drifts: bool
    outside: tuple[str, ...]


@dataclass(frozen=True)
class OutsideUnit(Entry):
    """A unit is outside the distribution of all others in one parameter; value and sigma in its unit of print."""

    unit: str
    name: str
    axis: str
    value: float
    sigma: float
    value_unit: str
    p_value: float


@dataclass(frozen=True, kw_only=True)
class FleetSummary(Entry):
    """The content of fleet.json; with_prior: units with a fleet as prior, which is taken out of the distributions."""

    format: int = 1
    recordings: int
    units: int
    with_prior: int
    failed: int
    verdicts: Mapping[str, int]
    in_words: str
    parameters: tuple[FleetParameter, ...]
    outside: tuple[OutsideUnit, ...]
    reports: tuple[UnitReport, ...]
    readout: Mapping[str, Any]  # as in calibration.json: the nominal counts that the parameters are errors of

    @property
    def ordinary(self) -> bool:
        """Return whether every recording has a result and an adequate model, and no unit is outside."""
        adequate = set(self.verdicts) <= {"adequate"} and not any(r.outcome for r in self.reports)
        return not self.failed and not self.outside and adequate


def fleet_summary(each: Mapping[str, Sequence[StoredResult]]) -> tuple[FleetSummary, Fleet, pl.DataFrame]:
    """Return the summary of recordings with their entries, the distributions, and a row for each parameter of each.

    Of a unit with several recordings the last one is taken for the distributions.
    """
    reported = [pair for folder, entries in each.items() for pair in _sensor_reports(folder, entries)]
    latest: dict[str, DatedCalibration] = {}
    for report, calibration in reported:
        if calibration is not None and (report.unit not in latest or calibration.date >= latest[report.unit].date):
            latest[report.unit] = calibration
    own = {unit: replace(d, calibration=own_estimate(d.calibration)) for unit, d in latest.items()}
    known = fleet(own)
    few = len(known.distributions)
    parameters = tuple(_parameter(d, few) for d in known.distributions.values())
    outside = tuple(_unit_outside(d, int(i)) for d in known.distributions.values() for i in np.flatnonzero(~d.inside))
    reports = tuple(report for report, _ in reported)
    verdicts = dict(Counter(r.verdict for r in reports if r.verdict).most_common())
    summary = FleetSummary(
        recordings=len(each),
        units=len({r.unit for r in reports}),
        with_prior=sum(rests_on_fleet(d.calibration) for d in latest.values()),
        failed=len({r.recording for r in reports if r.failure}),
        verdicts=verdicts,
        in_words="",
        parameters=parameters,
        outside=tuple(sorted(outside, key=lambda o: o.p_value)),
        reports=reports,
        readout=known.readout.to_dict(),
    )
    return replace(summary, in_words=fleet_in_words(summary)), known, _table(reported, known)


def _sensor_reports(folder: str, entries: Sequence[StoredResult]) -> list[tuple[UnitReport, DatedCalibration | None]]:
    """Return the report of each sensor of a recording, with its calibration."""
    by_unit: dict[str, list[StoredResult]] = {}
    for entry in entries:
        by_unit.setdefault(entry.unit, []).append(entry)
    out = []
    for unit, own in by_unit.items():
        of_kind = {entry.kind: entry.content for entry in reversed(own)}
        diagnosis, failure = of_kind.get(DIAGNOSIS, {}), of_kind.get(FAILURE, {})
        calibration = next(iter(dated_calibrations(own)), None)
        report = UnitReport(
            folder, unit, str(own[0].content["provenance"].get("recorded") or ""),
            calibration.calibration.method if calibration else "",
            calibration.calibration.outcome if calibration else "",
            str(diagnosis.get("verdict", "")), str(diagnosis.get("in_words", "")), str(failure.get("in_words", "")),
        )  # fmt: skip
        out.append((report, calibration))
    return out


def _parameter(d: Distribution, tried: int) -> FleetParameter:
    p = d.parameter
    mean, mean_sigma, spread, sigma, own = (
        float(from_si(v, p.unit)) for v in (d.mean, d.mean_sigma, d.spread, d.sigma, np.median(d.own_sigma))
    )
    slope, slope_sigma = d.trend
    known = isfinite(slope)
    return FleetParameter(
        p.name, p.axis, p.effect, p.unit, len(d.units), mean, mean_sigma, spread, sigma, own,
        float(from_si(slope * YEAR, p.unit)) if known else None,
        float(from_si(slope_sigma * YEAR, p.unit)) if known else None,
        known and normal_tail(slope, slope_sigma) < SIGNIFICANCE / tried,
        tuple(d.units[i] for i in np.flatnonzero(~d.inside)),
    )  # fmt: skip


def _unit_outside(d: Distribution, i: int) -> OutsideUnit:
    p = d.parameter
    value, sigma = (float(from_si(v[i], p.unit)) for v in (d.value, d.own_sigma))
    return OutsideUnit(d.units[i], p.name, p.axis, value, sigma, p.unit, float(d.p_value[i]))


def _table(reported: Sequence[tuple[UnitReport, DatedCalibration | None]], known: Fleet) -> pl.DataFrame:
    """Return a row for each parameter of each recording, and one without for a recording that failed."""
    import polars as pl

    tails = {label: dict(zip(d.units, d.p_value.tolist(), strict=True)) for label, d in known.distributions.items()}
    rows = []
    for report, calibration in reported:
        head = {**report.to_dict()}
        estimates = calibration.calibration.estimates if calibration else ()
        rows += [
            head | {"effect": e.parameter.effect, "name": e.parameter.name, "axis": e.parameter.axis, "value": e.value,
                    "sigma": e.sigma, "value_unit": e.parameter.unit,
                    "p_value": tails.get(e.parameter.label, {}).get(report.unit)}
            for e in estimates
        ] or [head]  # fmt: skip
    texts = (*head, "effect", "name", "axis", "value_unit") if rows else ()
    schema = dict.fromkeys(texts, pl.String) | dict.fromkeys(("value", "sigma", "p_value"), pl.Float64)
    return pl.DataFrame(rows, schema=schema)
