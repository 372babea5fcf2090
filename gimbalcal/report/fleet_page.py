"""The page of a fleet: distribution and trend of each parameter, units outside, recordings that failed."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from gimbalcal.earth import SOLAR_DAY, YEAR
from gimbalcal.errors import number_of
from gimbalcal.fleet.fleet_summary import FleetParameter, FleetSummary
from gimbalcal.history.fleet import Distribution, Fleet
from gimbalcal.report.chart import BLUE, VERMILION, Bars, Chart, Line, Mark, Points, Rule, date_ticks, thinning_slice
from gimbalcal.report.html import Context, Picture, picture, render
from gimbalcal.report.parameters import common_nominal_in_words, plus_minus
from gimbalcal.units import from_si
from gimbalcal.words import naming
from gimbalcal.words.fleet_sentences import prior_in_words
from gimbalcal.words.rounding import p_value, significant

MIN_BINS, MAX_BINS = 5, 40  # of a histogram


def fleet_report(f: FleetSummary, known: Fleet) -> str:
    """Return the page for the content of a fleet.json and the distributions behind it."""
    distributions = {(d.parameter.name, d.parameter.axis): d for d in known.distributions.values()}
    ordered = sorted(f.parameters, key=lambda p: (not p.outside, not p.drifts))
    reserved = [r for r in f.reports if not r.failure and (r.outcome or r.verdict != "adequate")]
    context: Context = {
        "title": number_of(f.units, "unit"),
        "answer": naming.as_sentences(f.in_words),
        "verdict": "fits" if f.ordinary else "reserved" if f.failed < f.recordings else "misfit",
        "facts": _facts(f),
        "prior": prior_in_words(f),
        "nominal": common_nominal_in_words(f.to_dict()),
        "pictures": [_picture(p, distributions[p.name, p.axis]) for p in ordered],
        "rows": [*map(_row, f.parameters)],
        "outside": [
            {"unit": o.unit, "words": naming.name_in_words(o.name, o.axis), "value": plus_minus(o.value, o.sigma),
             "value_unit": naming.unit_in_print(o.value_unit), "fleet": _of_others(f, o.name, o.axis),
             "p": p_value(o.p_value)}
            for o in f.outside
        ],
        "failures": [{"recording": r.recording, "words": naming.typeset(r.failure)} for r in f.reports if r.failure],
        "reserved": [{"unit": r.unit, "recording": r.recording, "words": naming.typeset(r.outcome or r.in_words)}
                     for r in reserved],
    }  # fmt: skip
    return render("fleet.html", context)


def _facts(f: FleetSummary) -> list[tuple[str, str]]:
    facts = [(str(f.recordings), "recordings"), (str(f.failed), "failed")]
    facts += [
        (str(count), naming.without_underscores(verdict.replace("-", " "))) for verdict, count in f.verdicts.items()
    ]
    return [*facts, (str(len({o.unit for o in f.outside})), "units outside the distribution")]


def _row(p: FleetParameter) -> Context:
    trend = ""
    if p.drifts and p.trend_per_year is not None and p.trend_sigma is not None:
        trend = plus_minus(p.trend_per_year, p.trend_sigma)
    return {
        "group": p.name, "words": naming.name_in_words(p.name, p.axis),
        "mean": plus_minus(p.mean, p.mean_sigma), "spread": significant(p.spread, 2),
        "own": significant(p.own_sigma, 2), "unit": naming.unit_in_print(p.unit), "trend": trend,
        "outside": str(len(p.outside)) if p.outside else "none", "units": str(p.units),
    }  # fmt: skip


def _of_others(f: FleetSummary, name: str, axis: str) -> str:
    p = next(p for p in f.parameters if (p.name, p.axis) == (name, axis))
    return plus_minus(p.mean, p.spread)


def _picture(p: FleetParameter, d: Distribution) -> Picture:
    words, unit = naming.name_in_words(p.name, p.axis), naming.unit_in_print(p.unit)
    value, sigma = (np.asarray(from_si(x, p.unit), dtype=float) for x in (d.value, d.own_sigma))
    labels = {
        bool(side): [
            f"{n}: {plus_minus(v, s)} {unit}"
            for n, v, s, i in zip(d.units, value, sigma, d.inside, strict=True)
            if i == side
        ]
        for side in (True, False)
    }
    charts = [_histogram(p, value, d.inside, labels[False], f"{words}  [{unit}]")]
    dated = d.time[np.isfinite(d.time)]
    if dated.size and np.ptp(dated) > SOLAR_DAY:
        charts.append(_over_dates(p, d, value, labels, f"{words} over the date  [{unit}]"))
    outside = f", {number_of(len(p.outside), 'unit')} outside" if p.outside else ""
    return picture(charts, f"{words} of {number_of(p.units, 'unit')}{outside}.")


def _histogram(p: FleetParameter, value: np.ndarray, inside: np.ndarray, names: list[str], title: str) -> Chart:
    """Draw the number of units by value, the density of the distribution, and the units outside as diamonds."""
    low, high = float(value.min()), float(value.max())
    own = value[inside]
    bins = int(np.clip(np.sqrt(len(own)), MIN_BINS, MAX_BINS))
    count, edges = np.histogram(own, bins)
    wide = float(edges[1] - edges[0])
    x = np.linspace(min(low, p.mean - 4 * p.sigma), max(high, p.mean + 4 * p.sigma), 200)
    scatter = np.hypot(p.spread, p.own_sigma)
    density = len(own) * wide * np.exp(-(((x - p.mean) / scatter) ** 2) / 2) / (np.sqrt(2 * np.pi) * scatter)
    marks: list[Mark] = [
        Bars((edges[1:] + edges[:-1]) / 2, np.zeros(bins), count.astype(float), "pale", 0.92 * wide),
        Line(x, density, BLUE),
        Rule(0.0),
    ]
    if names:
        marks.append(Points(value[~inside], np.zeros(len(names)), VERMILION, "diamond", 4.5, names=names))
    return Chart(tuple(marks), title, "", "units", height=150)


def _over_dates(
    p: FleetParameter, d: Distribution, value: np.ndarray, labels: Mapping[bool, list[str]], title: str
) -> Chart:
    """Draw each unit over its date, and the trend where it is significant."""
    days = d.time / SOLAR_DAY
    first, last = float(np.nanmin(days)), float(np.nanmax(days))
    few = thinning_slice(int(d.inside.sum()))
    marks: list[Mark] = [
        Points(days[d.inside][few], value[d.inside][few], BLUE, "dot", 2.2, names=labels[True][few]),
        Points(days[~d.inside], value[~d.inside], VERMILION, "diamond", 4.5, names=labels[False]),
    ]
    if p.drifts and p.trend_per_year is not None:
        known = d.inside & np.isfinite(days)
        w = 1 / (np.asarray(from_si(d.own_sigma[known], p.unit)) ** 2 + p.spread**2)
        years = (days - first) * SOLAR_DAY / YEAR
        middle = float(np.average(value[known] - p.trend_per_year * years[known], weights=w))
        ends = np.array([0.0, (last - first) * SOLAR_DAY / YEAR])
        marks.append(Line(np.array([first, last]), middle + p.trend_per_year * ends, "ink"))
    return Chart(tuple(marks), title, x_ticks=date_ticks(first, last), height=150)
