"""The report of an error budget: the tornado that engineers draw, and which manoeuvre would shorten each bar."""

from __future__ import annotations

from typing import TYPE_CHECKING

import gimbalcal
from gimbalcal.design.budget import Budget
from gimbalcal.references import cite
from gimbalcal.report import wording
from gimbalcal.report.html import picture, render
from gimbalcal.report.rounding import significant
from gimbalcal.units import from_si

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LEAST = 0.02  # of the longest bar: shorter ones are in the table


def budget_report(made: Budget) -> str:
    """The page of a budget."""
    words = wording.typeset(made.in_words)
    rows = [
        {
            "name": wording.label_in_words(made.parameters[i].label),
            "sigma": significant(float(from_si(made.sigma[i], made.parameters[i].unit)), 2),
            "unit": wording.unit_in_print(made.parameters[i].unit),
            "parts": [significant(float(m), 3) for m in made.parts[:, i]],
            "share": f"{100 * made.share[i]:.1f} %",
            "what": made.manoeuvres[i]["what"],
            "to": significant(float(made.manoeuvres[i]["to_m"]), 3),
        }
        for i in map(int, made.order)
    ]
    facts = [
        (f"{significant(m, 3)} m", f"position error in {h:g} h, one sigma")
        for h, m in zip(made.hours, made.whole, strict=True)
    ]
    context = {
        "title": made.title,
        "remark": f"gimbalcal {gimbalcal.__version__}",
        "answer": f"{words[0].upper()}{words[1:]}.",
        "facts": facts,
        "picture": picture(
            tornado(made),
            f"Bars: position error by each parameter, {rows[0]['name']} the longest with {rows[0]['parts'][-1]} m.",
            f"What would be gone of the position error of {made.hours[-1]:g} h if a parameter were known exactly (one "
            "sigma), and what the best manoeuvre for it would leave (orange). The squares of bars add up where "
            "parameters are uncorrelated.",
        ),
        "hours": [f"{h:g} h" for h in made.hours],
        "rows": rows,
        "citations": cite("wu2018", "britting1971"),
    }
    return render("budget.html", context)


def tornado(made: Budget) -> Figure:
    """Bars of the position error [m] by parameter, both ways as it may go, the longest on top."""
    import matplotlib as mpl

    from gimbalcal.report.style import BLUE, FULL, INK, ORANGE, STYLE, empty

    shown = [int(i) for i in made.order if made.parts[-1, i] > LEAST * made.parts[-1].max()]
    with mpl.rc_context(STYLE):
        figure = empty(FULL, 0.9 + 0.24 * (len(shown) + 1))
        ax = figure.subplots()
        names = [wording.label_in_words(made.parameters[i].label) for i in shown]
        y = range(len(shown))
        part = [float(made.parts[-1, i]) for i in shown]
        left = [float(made.manoeuvres[i]["to_m"]) for i in shown]
        ax.barh(y, [2 * p for p in part], left=[-p for p in part], height=0.66, color=BLUE, label="as planned")
        ax.barh(y, [2 * p for p in left], left=[-p for p in left], height=0.22, color=ORANGE,
                label="with the best manoeuvre for it")  # fmt: skip
        ax.set_yticks(list(y), names)
        ax.invert_yaxis()
        ax.axvline(0, color=INK, lw=0.6)
        ax.set_xlabel(f"position error within {made.hours[-1]:g} h [m], one sigma")
        figure.legend(loc="outside upper left", ncols=2)
        return figure
