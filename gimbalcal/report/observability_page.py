"""The page of what a schedule of turns sees: sigma against time, weak directions, degrees of observability."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

import gimbalcal
from gimbalcal.errors import amount
from gimbalcal.number import Array
from gimbalcal.references import cite
from gimbalcal.report.chart import Chart, sensible_time
from gimbalcal.report.figures import curves_by_group
from gimbalcal.report.html import picture as inside
from gimbalcal.report.html import render
from gimbalcal.report.rounding import significant
from gimbalcal.report.wording import direction_in_words, label_in_words, unit_in_print


def observability_report(content: Mapping[str, Any]) -> str:
    """The page for the content of the observability.json of a schedule of turns."""
    states = content["states"]
    named = [s for s in states if not s["parameter"].startswith(("attitude:", "velocity:", "place:"))]
    worst = min(named, key=lambda s: float(s["degree"]))
    high = sum(s["observability"] == "high" for s in named)
    unseen = [{"direction": direction_in_words(u["direction"]), "why": u["why"]} for u in content["unobservable"]]
    hours = named[0]["time_s"][-1] / 3600
    noise = content["noise"]
    answer = (
        f"{content['schedule']} sees {len(named) - len(unseen)} of {amount(len(named), 'combination')} of errors; "
        f"the observability of {high} of {len(named)} is high"
    )
    return render("observability.html", {
        "title": content["schedule"],
        "remark": f"gimbalcal {gimbalcal.__version__}",
        "answer": answer,
        "verdict": "fits" if not unseen and high == len(named) else "reserved",
        "facts": [
            (f"{hours:.2f} h", "long"),
            (significant(float(worst["degree"]), 3), f"lowest degree, of {label_in_words(worst['parameter'])}"),
            (f"{noise['gyroscope_deg_per_sqrt_h']:g} deg/√h", "noise of the gyroscopes"),
            (f"{noise['accelerometer_ug_per_sqrt_Hz']:g} µg/√Hz", "noise of the accelerometers"),
        ],
        "curves": inside(
            _curves(named),
            f"Sigma of {amount(len(named), 'state')} over {hours:.2f} h, on a logarithmic scale.",
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
    return {"rows": rows, "in_words": table["in_words"]}


def _curves(states: Sequence[Mapping[str, Any]]) -> list[Chart]:
    """A chart for each name and unit, a line for each axis."""
    groups: dict[tuple[str, str], list[tuple[str, Array]]] = {}
    for s in states:
        name, _, axis = s["parameter"].partition(":")
        groups.setdefault((name, s["unit"]), []).append((axis, np.asarray(s["sigma"])))
    time, unit = sensible_time(np.asarray(states[0]["time_s"]))
    told = [(f"{label_in_words(name)}  [{unit_in_print(of)}]", lines) for (name, of), lines in groups.items()]
    return curves_by_group(time, told, f"time [{unit}]")
