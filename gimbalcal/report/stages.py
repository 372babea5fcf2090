"""What each stage of a calibration added: tables and a picture for the page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from gimbalcal.report import wording
from gimbalcal.report.html import Picture, picture
from gimbalcal.report.rounding import last_place, minus, pdg, significant
from gimbalcal.report.wording import label_of
from gimbalcal.units import from_si


def stages(content: Mapping[str, Any], truth: Mapping[str, float] | None) -> dict[str, Any]:
    """Table and picture of what each stage added; stages that estimate other things come as tables of their own."""
    every = content.get("stages", [])
    parameters = content["parameters"]
    labels = {label_of(p): p for p in parameters}
    ours = [s for s in every if labels.keys() & s["values"].keys()]
    several = len(ours) > 1
    return {
        "stages": [_stage(s) for s in every],
        "stage_names": [_short(s["name"]) for s in ours] if several else [],
        "stage_rows": [_stage_row(p, i and parameters[i - 1], ours, truth) for i, p in enumerate(parameters)],
        "stage_figure": _stage_picture(labels, ours) if several else None,
        "coefficients": [_coefficients(s) for s in every if s["values"] and s not in ours],
    }


def _short(name: str) -> str:
    return name.replace("_", " ").replace("system level: ", "")


def _stage_picture(labels: Mapping[str, Mapping[str, Any]], stages: Sequence[Mapping[str, Any]]) -> Picture:
    from gimbalcal.report import figures

    ratio = [
        [float(from_si(s["sigmas"].get(k, np.nan), p["unit"])) / p["prior_sigma"] for k, p in labels.items()]
        for s in stages
    ]
    words = [wording.label_in_words(k) for k in labels]
    return picture(
        figures.sigma_by_stage(words, [_short(s["name"]) for s in stages], np.array(ratio)),
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


def _stage(s: Mapping[str, Any]) -> dict[str, str]:
    rms = from_si(s["rms"], "ug")
    text = f"{significant(float(rms), 3)} µg" if np.isfinite(rms) else "–"
    words = wording.typeset(s["in_words"])
    return {"name": _short(s["name"]), "count": str(len(s["values"])), "rms": text, "in_words": words}


def _stage_row(
    p: Mapping[str, Any], before: Any, stages: Sequence[Mapping[str, Any]], truth: Mapping[str, float] | None
) -> dict[str, Any]:
    label, unit = label_of(p), p["unit"]
    cells = []
    for s in stages:
        if label in s["values"]:
            value, sigma = pdg(float(from_si(s["values"][label], unit)), float(from_si(s["sigmas"][label], unit)))
            cells.append(minus(f"{value} ± {sigma}"))
        else:
            cells.append("–")
    places = max(0, -last_place(p["sigma"])) if p["sigma"] > 0 else 2
    known = "" if truth is None or label not in truth else minus(f"{float(from_si(truth[label], unit)):.{places}f}")
    return {
        "words": wording.named(p["name"], p["axis"].replace("_", " ")),
        "first": not before or before["name"] != p["name"],
        "cells": cells,
        "truth": known,
        "unit": wording.unit_in_print(unit),
    }
