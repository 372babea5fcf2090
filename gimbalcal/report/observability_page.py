"""The page of what a schedule of turns sees: sigma against time, weak directions, degrees of observability."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from gimbalcal.errors import amount
from gimbalcal.number import Array
from gimbalcal.references import cite
from gimbalcal.report.chart import Chart, lasting, sensible_time
from gimbalcal.report.figures import curves_by_group
from gimbalcal.report.html import picture as inside
from gimbalcal.report.html import render
from gimbalcal.report.reach import reach
from gimbalcal.report.rounding import significant
from gimbalcal.report.wording import (
    counted,
    direction_in_words,
    label_in_words,
    sentence,
    typeset,
    unit_in_print,
    unobservable_leading,
    why_in_words,
)

MOST = 4  # states that a headline names


def observability_report(content: Mapping[str, Any]) -> str:
    """The page for the content of the observability.json of a schedule of turns."""
    states = content["states"]
    named = _errors(content)
    worst = min(named, key=lambda s: float(s["degree"]))
    high = sum(s["observability"] == "high" for s in named)
    unseen = [
        {"direction": direction_in_words(u["direction"]), "why": why_in_words(u)} for u in content["unobservable"]
    ]
    last = float(named[0]["time_s"][-1])
    noise = content["noise"]
    return render("observability.html", {
        "title": content["schedule"],
        "answer": headline(content),
        "verdict": "fits" if not unseen and high == len(named) else "reserved",
        "facts": [
            (lasting(last), "all turns and stops"),
            (f"{significant(float(worst['degree']), 3)} times",
             f"better known at least: {label_in_words(worst['parameter'])}"),
            (f"{noise['gyroscope_deg_per_sqrt_h']:g} °/√h", "noise of the gyroscopes"),
            (f"{noise['accelerometer_ug_per_sqrt_Hz']:g} µg/√Hz", "noise of the accelerometers"),
        ],
        "curves": inside(
            _curves(named),
            f"Sigma of {amount(len(named), 'state')} over {lasting(last)}, on a logarithmic scale.",
            "One sigma of each state against time, from its usual size on; each step down is a turn.",
        ),
        "unobservable": unseen,
        "weak": [
            {
                "direction": direction_in_words(w["direction"]),
                "why": f"known {significant(float(w['degree']), 3)} times better than before",
            }
            for w in content["weak"]
        ],
        "rows": [_row(s) for s in states],
        "published": _published(content["published"]),
        "citations": cite("wei2022", "yan2018", "friedland1969"),
    })  # fmt: skip


def headline(content: Mapping[str, Any]) -> str:
    """What the observability.json of a schedule of turns comes to: what it tells, how well, what next."""
    named = _errors(content)
    lost, unseen = unobservable_leading(content["unobservable"]), len(content["unobservable"])
    low = [s for s in named if s["observability"] != "high" and s["parameter"] not in lost]
    seen = f"{len(named) - unseen} of {len(named)} combinations" if unseen else f"all {counted(len(named), 'error')}"
    text = f"{content['schedule']} tells {seen} of the unit in {lasting(float(named[0]['time_s'][-1]))}."
    told = [(s["parameter"].partition(":")[0], s) for s in named if s["parameter"] not in lost]
    text += reach((kind, float(s["sigma"][-1]), s["unit"]) for kind, s in told)
    if unseen:
        text += f" {counted(unseen, 'combination').capitalize()} cannot be seen: turn about another axis as well."
    if low:
        text += f" Hardly better known than before: {', '.join(label_in_words(s['parameter']) for s in low[:MOST])}"
        text += f" and {len(low) - MOST} more." if len(low) > MOST else "."
    return text if unseen or low else f"{text} Next: record it, then `gimbalcal calibrate` the recording."


def _errors(content: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """The states that are errors of the unit, not of where and how it stands."""
    return [s for s in content["states"] if not s["parameter"].startswith(("attitude:", "velocity:", "place:"))]


def _row(state: Mapping[str, Any]) -> dict[str, str]:
    return {
        "words": label_in_words(state["parameter"]),
        "sigma": significant(float(state["sigma"][-1]), 3),
        "unit": unit_in_print(state["unit"]),
        "degree": significant(float(state["degree"]), 3),
        "word": state["observability"],
    }


def _published(table: Mapping[str, Any]) -> dict[str, Any]:
    if not table:
        return {}
    rows = [
        {
            "words": label_in_words(r["parameter"]),
            "printed": f"{r['printed']:.2f}",
            "degree": significant(float(r["degree"]), 3),
            "ratio": significant(float(r["ratio"]), 2),
        }
        for r in table["rows"]
    ]
    return {"rows": rows, "in_words": sentence(typeset(table["in_words"]))}


def _curves(states: Sequence[Mapping[str, Any]]) -> list[Chart]:
    """A chart for each name and unit, a line for each axis."""
    groups: dict[tuple[str, str], list[tuple[str, Array]]] = {}
    for s in states:
        name, _, axis = s["parameter"].partition(":")
        groups.setdefault((name, s["unit"]), []).append((axis, np.asarray(s["sigma"])))
    time, unit = sensible_time(np.asarray(states[0]["time_s"]))
    told = [(f"{label_in_words(name)}  [{unit_in_print(of)}]", lines) for (name, of), lines in groups.items()]
    return curves_by_group(time, told, f"time [{unit}]")
