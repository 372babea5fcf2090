"""The report of a unit's history, built from the content of compare.json: one picture a parameter, and the numbers."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from math import isnan

import numpy as np

from gimbalcal.earth import SOLAR_DAY, YEAR
from gimbalcal.history.compare import CalibrationStep, ComparedCalibration, PrintedComparison, PrintedHistory
from gimbalcal.report.chart import BLUE, VERMILION, Chart, Line, Mark, Points, Rule, date_ticks
from gimbalcal.report.html import Picture, picture, render
from gimbalcal.report.parameters import common_nominal_in_words, estimate, plus_minus
from gimbalcal.words import naming
from gimbalcal.words.rounding import duration_in_words, p_value, printed_number, significant


def history_report(c: PrintedComparison, diagnoses: Sequence[tuple[str, str]] = ()) -> str:
    """Return the page of a comparison of calibrations; `diagnoses`: date and result of each in the store."""
    calibrations = c.calibrations
    names = _names(calibrations)
    context = {
        "title": c.unit or naming.number_and_noun(len(calibrations), "calibration"),
        "answer": naming.as_sentences(c.in_words),
        "verdict": "fits" if c.agree else "misfit",
        "facts": _facts(c),
        "nominal": common_nominal_in_words(c.to_dict()),
        "pictures": _pictures(c.parameters, calibrations),
        "rows": [_history_row(p, names) for p in c.parameters],
        "steps": [_step(s, names) for s in c.steps],
        "calibrations": [
            {
                "date": _date_in_print(one.date),
                "name": one.name,
                "method": one.method,
                "outcome": naming.typeset(one.outcome),
            }
            for one in calibrations
        ],
        "diagnoses": [{"date": _date_in_print(date), "words": naming.typeset(words)} for date, words in diagnoses],
    }
    return render("compare.html", context)


def _names(calibrations: Sequence[ComparedCalibration]) -> list[str]:
    """Return dates, with the time of the day where two calibrations are of one day."""
    days = [c.date[:10] for c in calibrations]
    return [d if days.count(d) == 1 else _date_in_print(c.date) for d, c in zip(days, calibrations, strict=True)]


def _date_in_print(date: str) -> str:
    """Return a date of ISO 8601 as printed; midnight stands for an unknown time.

    >>> _date_in_print("2026-02-03T00:00:00+00:00"), _date_in_print("2026-02-03T14:05:00+00:00")
    ('2026-02-03', '2026-02-03 14:05')
    """
    return date[:16].replace("T", " ").removesuffix(" 00:00")


def _facts(c: PrintedComparison) -> list[tuple[str, str]]:
    dates = [datetime.fromisoformat(one.date) for one in c.calibrations]
    seconds = (dates[-1] - dates[0]).total_seconds()
    days = seconds / SOLAR_DAY
    p_values = [s.p_value for s in c.steps if not s.same_recording]
    facts = [
        (str(len(dates)), "calibrations"),
        (f"{significant(seconds / YEAR, 2)} years" if days > 365 else duration_in_words(seconds), "from first to last"),
        (f"{sum(bool(p.jumps) for p in c.parameters)} of {len(c.parameters)}", "parameters that jumped"),
    ]
    if p_values:
        facts.append((p_value(min(p_values)), "smallest p-value of a step"))
    if c.due:
        facts.append((c.due, "next calibration due"))
    return facts


def _history_row(p: PrintedHistory, names: Sequence[str]) -> dict[str, str]:
    change, spread = p.values[-1] - p.values[-2], float(np.hypot(p.sigmas[-2], p.sigmas[-1]))
    jumps = [f"jump by {names[k]}" for k in p.jumps]
    outliers = [f"{names[k]} is an outlier" for k in p.outliers]
    due = [f"due {p.due}"] if p.due else []
    return {
        **estimate(p.name, p.axis, p.values[-1], p.sigmas[-1], p.unit),
        "change": plus_minus(change, spread),
        "in_sigmas": printed_number(f"{change / spread:+.1f}"),
        "drift": "" if isnan(p.drift_per_year) else plus_minus(p.drift_per_year, p.drift_sigma),
        "scatter": significant(p.scatter, 2) if p.scatter else "none",
        "remark": "; ".join([*jumps, *outliers, *due]),
    }


def _step(s: CalibrationStep, names: Sequence[str]) -> dict[str, str]:
    p = "the same recording" if s.same_recording else p_value(s.p_value)
    return {"before": names[s.before], "after": names[s.after], "chi2": significant(s.chi2, 3), "dof": str(s.dof),
            "p": p}  # fmt: skip


def _pictures(parameters: Sequence[PrintedHistory], calibrations: Sequence[ComparedCalibration]) -> list[Picture]:
    """Return a picture of each parameter, those with the largest changes first."""
    dates = [datetime.fromisoformat(c.date) for c in calibrations]
    drawn = []
    for p in sorted(parameters, key=lambda p: -_largest_change(p)):
        words = naming.name_in_words(p.name, p.axis)
        change = "with a jump" if p.jumps else "with an outlier" if p.outliers else "without a jump"
        drawn.append(
            picture(_parameter_chart(p, dates, words), f"{words} over {len(p.values)} calibrations, {change}.")
        )
    return drawn


def _largest_change(p: PrintedHistory) -> float:
    return float(np.max(np.abs(np.diff(p.values)) / np.hypot(p.sigmas[1:], p.sigmas[:-1])))


def _parameter_chart(p: PrintedHistory, dates: Sequence[datetime], words: str) -> Chart:
    """Draw a parameter over the dates, with two sigmas, and its drift where that is significant."""
    days = np.array([d.timestamp() for d in dates]) / SOLAR_DAY
    t, x, sigma = days[list(p.calibrations)], np.array(p.values), np.array(p.sigmas)
    odd = np.isin(p.calibrations, [*p.jumps, *p.outliers])
    unit = naming.unit_in_print(p.unit)
    names = [
        f"{dates[k]:%Y-%m-%d}: {plus_minus(v, s)} {unit}" for k, v, s in zip(p.calibrations, x, sigma, strict=True)
    ]
    marks: list[Mark] = [Rule(float(x[0]), "pale")]
    for chosen, colour, shape in ((~odd, BLUE, "dot"), (odd, VERMILION, "diamond")):
        own = [n for n, c in zip(names, chosen, strict=True) if c]
        marks.append(Points(t[chosen], x[chosen], colour, shape, 3.6, 2 * sigma[chosen], own))  # type: ignore[arg-type]
    if p.due:
        years = (t - t[0]) * SOLAR_DAY / YEAR
        w = 1 / (sigma**2 + p.scatter**2)
        middle = float((w * (x - p.drift_per_year * years)).sum() / w.sum())
        marks.append(Line(t, middle + p.drift_per_year * years, "ink"))
    marks.append(Points(days[[0, -1]], np.full(2, np.nan)))  # all pictures over the same time
    return Chart(tuple(marks), f"{words}  [{unit}]", x_ticks=date_ticks(days[0], days[-1]), height=140)
