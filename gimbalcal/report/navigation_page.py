"""The report of a recording that was navigated: Figures 3 to 5 and Table 5 of Wu et al. (2018), on this recording."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from gimbalcal.navigate.navigation_errors import CHANNELS, NAUTICAL_MILE, NONE, Navigated
from gimbalcal.references import cite
from gimbalcal.report import wording
from gimbalcal.report.chart import COLOURS, DASHES, Band, Chart, Line, Mark, Rule, sensible_time, thin
from gimbalcal.report.html import picture, render
from gimbalcal.report.rounding import minus, significant
from gimbalcal.units import from_si


def navigation_report(content: Mapping[str, Any], runs: Sequence[Navigated], title: str) -> str:
    """The page for the content of a navigation.json and the runs behind it."""
    names = [run.label for run in runs]
    context = {
        "title": title,
        "answer": headline(content),
        "verdict": "found" if _helps(content) else "misfit",
        "facts": _facts(content),
        "picture": picture(
            curves(runs),
            "Errors of latitude, longitude, velocity, attitude and position over time, for each calibration.",
            "Navigator minus true; band: one sigma of what the calibration does not know. As Figures 3 to 5 of Wu et "
            "al. (2018).",
        ),
        "names": ["without" if name == NONE else name for name in names],
        "rows": [row for i in range(len(CHANNELS)) if (row := _row(content, names, i))],
        "position": _position(content),
        "damping": f"{content['damping']:g}" if content["damping"] else "",
        "alignment": f"{content['alignment_s'] / 60:g}",
        "strapdown": content["mechanisation"] == "strapdown",
        "provenance": [(str(k), str(v)) for k, v in content["provenance"].items() if k in ("samples", "seed")],
        "sources": content["provenance"].get("recordings", []),
        "citations": cite(
            "wu2018", *(("savage1998",) if content["mechanisation"] == "strapdown" else ("britting1971",))
        ),
    }
    return render("navigation.html", context)


def headline(content: Mapping[str, Any]) -> str:
    """What a navigation.json comes to: the largest error of position without and with each calibration."""
    text = wording.answered(content["in_words"])
    if _helps(content):
        return text
    return f"{text} A calibration makes it worse: is it of this unit, and of these days? See `gimbalcal compare`."


def _helps(content: Mapping[str, Any]) -> bool:
    """Whether no calibration makes the position worse."""
    first, *others = (float(p["max_nmi"]) for p in content["position"])
    return all(x <= first for x in others)


def _facts(content: Mapping[str, Any]) -> list[tuple[str, str]]:
    facts = [(f"{content['hours']:.3g} h", "navigated")]
    for row in content["position"]:
        name = "without calibration" if row["calibration"] == NONE else row["calibration"]
        facts.append((f"{significant(row['max_nmi'], 3)} n mile", f"largest position error, {name}"))
    return facts


def _row(content: Mapping[str, Any], names: Sequence[str], i: int) -> dict[str, Any] | None:
    """One line of Table 5: largest errors, improvement, sigma and drift; None for a channel that was not navigated."""
    name, unit = CHANNELS[i]
    mine = {c["calibration"]: c for c in content["channels"] if c["name"] == name}
    if not mine:
        return None
    return {"name": name, "unit": unit, "cells": [_cell(mine[label]) for label in names]}


def _cell(c: Mapping[str, Any]) -> dict[str, str]:
    better, sigma = c["improvement_percent"], c["sigma_linear"]
    told = "" if sigma is None else f"{significant(sigma, 2)} | {significant(c['sigma_sampled'], 2)}"
    return {
        "max": significant(c["max"], 3),
        "rms": significant(c["rms"], 3),
        "drift": minus(f"{significant(c['drift_per_day'], 2)}"),
        "better": "" if better is None else minus(f"{better:.1f} %"),
        "sigma": told,
    }


def _position(content: Mapping[str, Any]) -> dict[str, Any]:
    cells = [
        {
            "max": significant(p["max_nmi"], 3),
            "rms": significant(p["rms_nmi"], 3),
            "drift": "",
            "better": "" if p["improvement_percent"] is None else minus(f"{p['improvement_percent']:.1f} %"),
            "sigma": "",
        }
        for p in content["position"]
    ]
    return {"name": "position", "unit": "n mile", "cells": cells}


def curves(runs: Sequence[Navigated]) -> list[Chart]:
    """Figures 3 to 5 of Wu et al. (2018): each channel over time, a colour for each run, bands."""
    shown = [i for i in range(len(CHANNELS)) if np.all(np.isfinite(runs[0].error[:, i]))]
    return [_channel(runs, i) for i in [*shown, -1]]


def _channel(runs: Sequence[Navigated], i: int) -> Chart:
    """One channel, -1 for the horizontal position."""
    name, unit = (*CHANNELS, ("horizontal position", "n mile"))[i]
    marks: list[Mark] = [Rule(0.0)]
    hours = ""
    for run, colour, dash in zip(runs, ("grey", *COLOURS), ("dashed", *DASHES[:1], *DASHES[2:]), strict=False):
        few = thin(len(run.time))
        t, hours = sensible_time(run.time[few])
        y = np.asarray(run.position[few] / NAUTICAL_MILE if i < 0 else from_si(run.error[few, i], unit))
        if i >= 0 and run.linear is not None:
            band = np.asarray(from_si(run.linear[few, i], unit))
            marks.append(Band(t, y - band, y + band, colour))
        marks.append(Line(t, y, colour, "without calibration" if run.label == NONE else run.label, dash))
    return Chart(tuple(marks), f"{name}  [{unit}]", f"time [{hours}]", height=170)
