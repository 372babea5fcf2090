"""Pages of a navigated recording (Figures 3 to 5 and Table 5 of Wu et al. 2018) and of an error budget."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gimbalcal.design.budget import Budget, length_in_words
from gimbalcal.earth import NAUTICAL_MILE
from gimbalcal.navigate.navigation_errors import CHANNELS, NONE, Navigated
from gimbalcal.navigate.summary import ChannelError, NavigationSummary, PositionError
from gimbalcal.references import cite
from gimbalcal.report.chart import COLOURS, DASHES, Band, Chart, Line, Mark, Rule, thinning_slice
from gimbalcal.report.figures import tornado
from gimbalcal.report.html import picture, render
from gimbalcal.units import from_si
from gimbalcal.words import naming
from gimbalcal.words.answers import navigation_answer
from gimbalcal.words.rounding import printed_number, sensible_time, significant


def navigation_report(s: NavigationSummary) -> str:
    """Return the page of navigations of one recording."""
    names = {p.calibration: "without" if p.calibration == NONE else p.calibration for p in s.position}
    strapdown = s.mechanisation == "strapdown"
    context = {
        "title": s.title,
        "answer": navigation_answer(s),
        "verdict": "misfit" if s.increased else "found",
        "facts": [(f"{s.hours:.3g} h", "navigated"), *map(_position_fact, s.position)],
        "picture": picture(
            curves(s.runs),
            "Errors of latitude, longitude, velocity, attitude and position over time, for each calibration.",
            "Navigator minus true; band: one sigma of the calibration's uncertainty. As Figures 3 to 5 of Wu et "
            "al. (2018).",
        ),
        "names": list(names.values()),
        "rows": [
            {"name": name, "unit": unit, "cells": [_cell(c) for c in s.channels if c.name == name]}
            for name, unit in CHANNELS if any(c.name == name for c in s.channels)
        ],
        "position": {"name": "position", "unit": "n mile", "cells": [
            {"max": significant(p.max_nmi, 3), "rms": significant(p.rms_nmi, 3), "drift": "", "sigma": "",
             "better": _percent(p.improvement_percent)} for p in s.position
        ]},
        "damping": f"{s.damping:g}" if s.damping else "",
        "alignment": f"{s.alignment_s / 60:g}",
        "strapdown": strapdown,
        "provenance": [(k, str(v)) for k, v in s.provenance.to_dict().items() if k in ("samples", "seed")],
        "sources": s.provenance.recordings,
        "citations": cite("wu2018", "savage1998" if strapdown else "britting1971"),
    }  # fmt: skip
    return render("navigation.html", context)


def _position_fact(p: PositionError) -> tuple[str, str]:
    name = "without calibration" if p.calibration == NONE else p.calibration
    return f"{significant(p.max_nmi, 3)} n mile", f"largest position error, {name}"


def _cell(c: ChannelError) -> dict[str, str]:
    """Return one cell of Table 5: largest and rms error, improvement, sigma, drift."""
    sigma = "" if c.sigma_linear is None or c.sigma_sampled is None else (
        f"{significant(c.sigma_linear, 2)} | {significant(c.sigma_sampled, 2)}")  # fmt: skip
    return {"max": significant(c.max, 3), "rms": significant(c.rms, 3), "sigma": sigma,
            "drift": printed_number(significant(c.drift_per_day, 2)),
            "better": _percent(c.improvement_percent)}  # fmt: skip


def _percent(improvement: float | None) -> str:
    return "" if improvement is None else printed_number(f"{improvement:.1f} %")


def curves(runs: Sequence[Navigated]) -> list[Chart]:
    """Draw Figures 3 to 5 of Wu et al. (2018): each channel over time, a colour for each run, with bands."""
    shown = [i for i in range(len(CHANNELS)) if np.all(np.isfinite(runs[0].error[:, i]))]
    return [_channel(runs, i) for i in [*shown, -1]]


def _channel(runs: Sequence[Navigated], i: int) -> Chart:
    """Draw one channel, -1 for the horizontal position."""
    name, unit = (*CHANNELS, ("horizontal position", "n mile"))[i]
    marks: list[Mark] = [Rule(0.0)]
    hours = ""
    for run, colour, dash in zip(runs, ("grey", *COLOURS), ("dashed", *DASHES[:1], *DASHES[2:]), strict=False):
        few = thinning_slice(len(run.time))
        t, hours = sensible_time(run.time[few])
        y = np.asarray(run.position[few] / NAUTICAL_MILE if i < 0 else from_si(run.error[few, i], unit))
        if i >= 0 and run.linear is not None:
            band = np.asarray(from_si(run.linear[few, i], unit))
            marks.append(Band(t, y - band, y + band, colour))
        marks.append(Line(t, y, colour, "without calibration" if run.label == NONE else run.label, dash))
    return Chart(tuple(marks), f"{name}  [{unit}]", f"time [{hours}]", height=170)


# --- an error budget --------------------------------------------------------------------------------------------------

PLATFORM = "Largest one sigma up to the hour, for a base at rest and the platform’s navigator of"
STRAPDOWN = (
    "Largest one sigma up to the hour after ten minutes of alignment, which absorbs part of the errors, for a unit at "
    "rest, undamped unless requested; noise of the navigated run adds to it. The strapdown navigator of"
)
MIN_BAR = 0.02  # of the longest; shorter bars are in the table alone


def budget_report(budget: Budget) -> str:
    """Return the page of a budget: bars of the position error by parameter, and the best manoeuvre for each."""
    rows = [
        {
            "name": naming.label_in_words(budget.parameters[i].label),
            "sigma": significant(float(from_si(budget.sigma[i], budget.parameters[i].unit)), 2),
            "unit": naming.unit_in_print(budget.parameters[i].unit),
            "parts": [significant(float(m), 3) for m in budget.parts[:, i]],
            "share": f"{100 * budget.share[i]:.1f} %" if budget.share[i] >= 5e-4 else "< 0.1 %",
            "what": budget.manoeuvres[i].what,
            "to": significant(budget.manoeuvres[i].to_m, 3),
        }
        for i in map(int, budget.order)
    ]
    facts = [
        (length_in_words(m), f"position error in {h:g} h, one sigma")
        for h, m in zip(budget.hours, budget.whole, strict=True)
    ]
    context = {
        "title": budget.title,
        "answer": naming.as_sentences(budget.in_words),
        "verdict": "found",
        "facts": facts,
        "picture": picture(
            _budget_tornado(budget),
            f"Bars: position error by each parameter, {rows[0]['name']} the longest: "
            f"{length_in_words(budget.parts[-1].max())}.",
            f"Part of the position error of {budget.hours[-1]:g} h (one sigma) that would vanish if a parameter were "
            "known exactly, and that part after the best manoeuvre for it (orange). The squares of bars add up where "
            "parameters are uncorrelated.",
        ),
        "hours": [f"{h:g} h" for h in budget.hours],
        "rows": rows,
        "unseen": ", ".join(naming.label_in_words(budget.parameters[i].label) for i in budget.unseen),
        "base": STRAPDOWN if budget.strapdown else PLATFORM,
        "citations": cite("cai2016", "wei2022") if budget.strapdown else cite("wu2018", "britting1971"),
    }
    return render("budget.html", context)


def _budget_tornado(budget: Budget) -> Chart:
    """Draw the position error by parameter, the longest bar on top."""
    shown = [int(i) for i in budget.order if budget.parts[-1, i] > MIN_BAR * budget.parts[-1].max()]
    scale, unit = (1e3, "km") if budget.parts[-1].max() > 1e4 else (1.0, "m")
    return tornado(
        [naming.label_in_words(budget.parameters[i].label) for i in shown],
        np.array([float(budget.parts[-1, i]) for i in shown]) / scale,
        np.array([budget.manoeuvres[i].to_m for i in shown]) / scale,
        f"position in {budget.hours[-1]:g} h [{unit}]",
    )
