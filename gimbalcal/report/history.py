"""The report of a unit's history, built from the content of compare.json: one picture a parameter, and the numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import datetime
from typing import TYPE_CHECKING, Any

import numpy as np

import gimbalcal
from gimbalcal.history.course import YEAR
from gimbalcal.report import wording
from gimbalcal.report.html import Picture, picture, render
from gimbalcal.report.rounding import minus, pdg, significant
from gimbalcal.report.style import BLUE, GREY, INK, PALE, STYLE, VERMILION, empty

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SIZE = (2.95, 1.45)  # inches: three beside each other on a page, one on a phone


def history_report(content: Mapping[str, Any], diagnoses: Sequence[tuple[str, str]] = ()) -> str:
    """The page for the content of a compare.json; `diagnoses`: date and answer of each that a store holds."""
    calibrations, steps, parameters = content["calibrations"], content["steps"], content["parameters"]
    names = _names(calibrations)
    context = {
        "title": content["unit"] or wording.counted(len(calibrations), "calibration"),
        "remark": f"gimbalcal {gimbalcal.__version__}",
        "answer": wording.typeset(content["in_words"]),
        "verdict": "fits" if content["agree"] else "misfit",
        "facts": _facts(content),
        "pictures": _pictures(parameters, calibrations),
        "rows": [_row(p, names) for p in parameters],
        "steps": [_step(s, names) for s in steps],
        "calibrations": [
            {"date": c["date"][:16].replace("T", " "), "name": c["name"], "method": c["method"],
             "outcome": wording.typeset(c["outcome"])}
            for c in calibrations
        ],
        "diagnoses": [{"date": date[:16].replace("T", " "), "words": wording.typeset(words)}
                      for date, words in diagnoses],
    }  # fmt: skip
    return render("compare.html", context)


def _names(calibrations: Sequence[Mapping[str, Any]]) -> list[str]:
    """Dates, with the time of the day where two calibrations are of one day."""
    days = [c["date"][:10] for c in calibrations]
    return [d if days.count(d) == 1 else c["date"][:16].replace("T", " ")
            for d, c in zip(days, calibrations, strict=True)]  # fmt: skip


def _facts(content: Mapping[str, Any]) -> list[tuple[str, str]]:
    dates = [datetime.fromisoformat(c["date"]) for c in content["calibrations"]]
    days = (dates[-1] - dates[0]).total_seconds() / 86400
    told = [s["p_value"] for s in content["steps"] if s["p_value"] is not None]
    facts = [
        (str(len(dates)), "calibrations"),
        (f"{significant(days / 365.25, 2)} years" if days > 365 else f"{significant(days, 2)} days", "apart"),
        (f"{sum(bool(p['jumps']) for p in content['parameters'])} of {len(content['parameters'])}",
         "parameters that jumped"),
    ]  # fmt: skip
    if told:
        facts.append((f"{min(told):.2g}" if min(told) >= 1e-4 else "< 0.0001", "least probable step"))
    if content["due"]:
        facts.append((content["due"], "next calibration due"))
    return facts


def _row(p: Mapping[str, Any], names: Sequence[str]) -> dict[str, str]:
    value, sigma = pdg(p["values"][-1], p["sigmas"][-1])
    change, spread = p["values"][-1] - p["values"][-2], float(np.hypot(*p["sigmas"][-2:]))
    moved, moved_sigma = pdg(change, spread)
    drift = ""
    if p["drift_per_year"] is not None:
        rate, rate_sigma = pdg(p["drift_per_year"], p["drift_sigma"])
        drift = f"{minus(rate)} ± {rate_sigma}"
    jumps = [f"jump by {names[k]}" for k in p["jumps"]]
    off = [f"{names[k]} off the others" for k in p["outliers"]]
    due = [f"due {p['due']}"] if p["due"] else []
    return {
        "words": wording.named(p["name"], p["axis"].replace("_", " ")), "value": minus(value), "sigma": sigma,
        "unit": wording.unit_in_print(p["unit"]), "change": f"{minus(moved)} ± {moved_sigma}",
        "in_sigmas": minus(f"{change / spread:+.1f}"), "drift": drift,
        "scatter": significant(p["scatter"], 2) if p["scatter"] else "none",
        "remark": "; ".join([*jumps, *off, *due]),
    }  # fmt: skip


def _step(s: Mapping[str, Any], names: Sequence[str]) -> dict[str, str]:
    p = "the same recording" if s["same_recording"] else f"{s['p_value']:.2g}"
    return {"before": names[s["before"]], "after": names[s["after"]], "chi2": significant(s["chi2"], 3),
            "dof": str(s["dof"]), "p": p}  # fmt: skip


def _pictures(parameters: Sequence[Mapping[str, Any]], calibrations: Sequence[Mapping[str, Any]]) -> list[Picture]:
    """One of each parameter, those that moved first."""
    dates = [datetime.fromisoformat(c["date"]) for c in calibrations]
    drawn = []
    for p in sorted(parameters, key=lambda p: -_moved(p)):
        words = wording.named(p["name"], p["axis"].replace("_", " "))
        said = "with a jump" if p["jumps"] else "with a value off the others" if p["outliers"] else "without a jump"
        drawn.append(picture(_course(p, dates, words), f"{words} over {len(p['values'])} calibrations, {said}."))
    return drawn


def _moved(p: Mapping[str, Any]) -> float:
    return float(np.max(np.abs(np.diff(p["values"])) / np.hypot(p["sigmas"][1:], p["sigmas"][:-1])))


def _course(p: Mapping[str, Any], dates: Sequence[datetime], words: str) -> Figure:
    """A parameter over the dates, with two sigma, and its drift where that stands clear."""
    import matplotlib as mpl
    from matplotlib.dates import AutoDateLocator, ConciseDateFormatter

    t = [dates[k] for k in p["calibrations"]]
    x, sigma = np.array(p["values"]), np.array(p["sigmas"])
    odd = np.isin(p["calibrations"], [*p["jumps"], *p["outliers"]])
    with mpl.rc_context(STYLE):
        figure = empty(*SIZE)
        ax = figure.subplots()
        ax.axhline(x[0], color=PALE, lw=0.8, zorder=1)
        ax.errorbar(t, x, 2 * sigma, fmt="none", ecolor=GREY, elinewidth=0.9, zorder=2)
        for chosen, color, marker in ((~odd, BLUE, "o"), (odd, VERMILION, "D")):
            ax.plot(np.array(t)[chosen], x[chosen], marker, ms=3.6, color=color, zorder=3)
        if p["due"]:
            years = np.array([(d - t[0]).total_seconds() for d in t]) / YEAR
            w = 1 / (sigma**2 + p["scatter"] ** 2)
            middle = float((w * (x - p["drift_per_year"] * years)).sum() / w.sum())
            ax.plot(t, middle + p["drift_per_year"] * years, color=INK, lw=0.9, zorder=2)
        ax.set_title(f"{words}  [{wording.unit_in_print(p['unit'])}]")
        locator = AutoDateLocator(maxticks=5)
        ax.xaxis.set_major_locator(locator)
        ax.xaxis.set_major_formatter(ConciseDateFormatter(locator))
        ax.plot(np.array([min(dates), max(dates)]), [x[0], x[0]], ls="none")  # all pictures over the same time
        ax.margins(x=0.07, y=0.15)
        return figure
