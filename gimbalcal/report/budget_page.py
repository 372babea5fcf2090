"""The report of an error budget: the tornado that engineers draw, and which manoeuvre would shorten each bar."""

from __future__ import annotations

import numpy as np

from gimbalcal.design.budget import Budget, length
from gimbalcal.references import cite
from gimbalcal.report import wording
from gimbalcal.report.chart import Chart
from gimbalcal.report.figures import tornado
from gimbalcal.report.html import picture, render
from gimbalcal.report.rounding import significant
from gimbalcal.units import from_si

PLATFORM = "Largest one sigma up to the hour, still base, the platform’s navigator of"
STRAPDOWN = (
    "Largest one sigma up to the hour after ten minutes of alignment, which takes up of the errors what it can, of a "
    "unit at rest, undamped unless asked; noise of the run that is navigated comes on top. The strapdown navigator of"
)
LEAST = 0.02  # of the longest bar: shorter ones are in the table


def budget_report(made: Budget) -> str:
    """The page of a budget."""
    rows = [
        {
            "name": wording.label_in_words(made.parameters[i].label),
            "sigma": significant(float(from_si(made.sigma[i], made.parameters[i].unit)), 2),
            "unit": wording.unit_in_print(made.parameters[i].unit),
            "parts": [significant(float(m), 3) for m in made.parts[:, i]],
            "share": f"{100 * made.share[i]:.1f} %" if made.share[i] >= 5e-4 else "< 0.1 %",
            "what": made.manoeuvres[i]["what"],
            "to": significant(float(made.manoeuvres[i]["to_m"]), 3),
        }
        for i in map(int, made.order)
    ]
    facts = [(length(m), f"position error in {h:g} h, one sigma") for h, m in zip(made.hours, made.whole, strict=True)]
    context = {
        "title": made.title,
        "answer": wording.answered(made.in_words),
        "verdict": "found",
        "facts": facts,
        "picture": picture(
            _tornado(made),
            f"Bars: position error by each parameter, {rows[0]['name']} the longest: {length(made.parts[-1].max())}.",
            f"What would be gone of the position error of {made.hours[-1]:g} h if a parameter were known exactly (one "
            "sigma), and what the best manoeuvre for it would leave (orange). The squares of bars add up where "
            "parameters are uncorrelated.",
        ),
        "hours": [f"{h:g} h" for h in made.hours],
        "rows": rows,
        "unseen": ", ".join(wording.label_in_words(made.parameters[i].label) for i in made.unseen),
        "base": STRAPDOWN if made.strapdown else PLATFORM,
        "citations": cite("cai2016", "wei2022") if made.strapdown else cite("wu2018", "britting1971"),
    }
    return render("budget.html", context)


def _tornado(made: Budget) -> Chart:
    """Bars of the position error by parameter, the longest on top."""
    shown = [int(i) for i in made.order if made.parts[-1, i] > LEAST * made.parts[-1].max()]
    scale, unit = (1e3, "km") if made.parts[-1].max() > 1e4 else (1.0, "m")
    return tornado(
        [wording.label_in_words(made.parameters[i].label) for i in shown],
        np.array([float(made.parts[-1, i]) for i in shown]) / scale,
        np.array([float(made.manoeuvres[i]["to_m"]) for i in shown]) / scale,
        f"position in {made.hours[-1]:g} h [{unit}]",
    )
