"""What each stage of a calibration added: tables and a picture for the page."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from gimbalcal.calibration import Counts
from gimbalcal.calibration.readout import from_content
from gimbalcal.effects import CATALOGUE
from gimbalcal.effects.effect import GYROSCOPE_STAGES
from gimbalcal.report import wording
from gimbalcal.report.html import Picture, picture
from gimbalcal.report.parameter_rows import as_printed
from gimbalcal.report.rounding import last_place, minus, pdg, significant
from gimbalcal.report.wording import label_of
from gimbalcal.units import from_si

RATES_LEFT = ("rate-table", "two-position")  # methods whose residuals are rates


def stages(content: Mapping[str, Any], truth: Mapping[str, float] | None) -> dict[str, Any]:
    """Table and picture of what each stage added; stages that estimate other things come as tables of their own."""
    every = content.get("stages", [])
    parameters = content["parameters"]
    labels = {label_of(p) for p in parameters}
    ours = [s for s in every if labels & s["values"].keys()]
    staged = [p for p in parameters if any(label_of(p) in s["values"] for s in ours)]
    several, nominal = len(ours) > 1, from_content(content).accelerometers
    return {
        "stages": [_stage(s, parameters, content["method"] in RATES_LEFT) for s in every],
        "stage_names": [_short(s["name"]) for s in ours] if several else [],
        "stage_rows": [_stage_row(p, i and staged[i - 1], ours, nominal, truth) for i, p in enumerate(staged)],
        "stage_figure": _stage_picture(staged, ours) if several else None,
        "stage_rest": _elsewhere(p for p in parameters if p not in staged) if several else "",
        "coefficients": [_coefficients(s) for s in every if s["values"] and s not in ours],
    }


def _elsewhere(parameters: Iterable[Mapping[str, Any]]) -> str:
    """A sentence on the parameters that no stage lists; empty where there are none."""
    names = dict.fromkeys(wording.named(p["name"]) for p in parameters)
    return f"Found apart from these stages, in one step: {wording.listed(list(names))}." if names else ""


def _short(name: str) -> str:
    return name.replace("_", " ").replace("system level: ", "")


def _stage_picture(parameters: Sequence[Mapping[str, Any]], stages: Sequence[Mapping[str, Any]]) -> Picture:
    from gimbalcal.report.figures import by_stage

    ratio = [
        [float(from_si(s["sigmas"].get(label_of(p), np.nan), p["unit"])) / p["prior_sigma"] for p in parameters]
        for s in stages
    ]
    words = [wording.label_in_words(label_of(p)) for p in parameters]
    return picture(
        by_stage(words, [_short(s["name"]) for s in stages], np.array(ratio)),
        f"Sigma of each parameter after each of {wording.counted(len(stages), 'stage')}, relative to its prior.",
        "What each stage leaves of the prior uncertainty.",
    )


def _coefficients(s: Mapping[str, Any]) -> dict[str, Any]:
    """Combined coefficients that a stage estimates instead of parameters, in microradians."""
    rows = []
    for name, value in s["values"].items():
        v, sigma = pdg(float(from_si(value, "urad")), float(from_si(s["sigmas"][name], "urad")))
        rows.append({"name": name.replace("_", " "), "value": minus(v), "sigma": sigma})
    return {"name": _short(s["name"]), "rows": rows}


def _stage(s: Mapping[str, Any], parameters: Sequence[Mapping[str, Any]], rates: bool) -> dict[str, str]:
    """A row of the table of stages; one of gyroscopes alone leaves rates, or angles, others forces."""
    effects = {p["effect"] for p in parameters if label_of(p) in s["values"]}
    turned = effects and all(CATALOGUE[e].stage in GYROSCOPE_STAGES for e in effects)
    unit = "deg/h" if rates else "arcsec" if turned else "ug"
    rms = float(from_si(s["rms"], unit))
    text = f"{significant(rms, 3)} {wording.unit_in_print(unit)}" if np.isfinite(rms) else "–"
    words = wording.sentence(wording.typeset(s["in_words"]))
    return {"name": _short(s["name"]), "count": str(len(s["values"])), "rms": text, "in_words": words}


def _stage_row(
    p: Mapping[str, Any],
    before: Any,
    stages: Sequence[Mapping[str, Any]],
    nominal: Counts | None,
    truth: Mapping[str, float] | None,
) -> dict[str, Any]:
    label, unit, printed = label_of(p), p["unit"], ""
    cells = []
    for s in stages:
        if label in s["values"]:
            own, spread = (float(from_si(s[key][label], unit)) for key in ("values", "sigmas"))
            value, sigma, printed = as_printed(p, own, spread, nominal)
            cells.append(f"{value}\u00a0±\u00a0{sigma}")
        else:
            cells.append("–")
    places = max(0, -last_place(p["sigma"])) if p["sigma"] > 0 else 2
    known = "" if truth is None or label not in truth else minus(f"{float(from_si(truth[label], unit)):.{places}f}")
    return {
        "words": wording.named(p["name"], p["axis"].replace("_", " ")),
        "first": not before or before["name"] != p["name"],
        "cells": cells,
        "truth": known,
        "unit": printed,
    }
