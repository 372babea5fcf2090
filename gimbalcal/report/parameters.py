"""Tables of parameters: of a calibration, and of each of its stages."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from gimbalcal.calibration import Counts
from gimbalcal.calibration.readout import from_content
from gimbalcal.effects import CATALOGUE
from gimbalcal.effects.effect import GYROSCOPE_STAGES
from gimbalcal.report.figures import by_stage
from gimbalcal.report.html import Picture, picture
from gimbalcal.units import from_si, to_si
from gimbalcal.words import naming
from gimbalcal.words.naming import label_of
from gimbalcal.words.rounding import distinct_from_zero, last_place, minus, pdg, significant

Row = Mapping[str, Any]


def plus_minus(value: float, sigma: float) -> str:
    """Return value ± sigma as printed."""
    return " ± ".join(map(minus, pdg(value, sigma)))


def estimate(name: str, axis: str | None, value: float, sigma: float, unit: str) -> dict[str, str]:
    """Return name, value, sigma and unit of an estimate as printed."""
    printed, spread = pdg(value, sigma)
    return {"words": naming.named(name, axis or ""), "value": minus(printed), "sigma": spread,
            "unit": naming.unit_in_print(unit)}  # fmt: skip


# --- of a calibration -------------------------------------------------------------------------------------------------


def rows(content: Mapping[str, Any], truth: Mapping[str, float] | None) -> list[dict[str, Any]]:
    """Return the rows; `first` opens a group, `below` the parameters that the data do not determine one by one."""
    in_unobservable = naming.unobservable_leading(naming.unobservable_of(content))
    determined = [p for p in content["parameters"] if label_of(p) not in in_unobservable]
    rest = [p for p in content["parameters"] if label_of(p) in in_unobservable]
    nominal = from_content(content).accelerometers
    out: list[dict[str, Any]] = []
    for part in (determined, rest):
        for i, p in enumerate(part):
            new = not i or p["name"] != part[i - 1]["name"]
            out.append(
                {**_row(p, nominal, truth), "first": new, "unobservable": part is rest, "below": part is rest and not i}
            )
    return out


def _row(p: Row, nominal: Counts | None, truth: Mapping[str, float] | None) -> dict[str, Any]:
    value, sigma, unit = as_printed(p, p["value"], p["sigma"], nominal)
    moved = p["value"] / p["prior_sigma"] if p["prior_sigma"] else 0.0
    error = ""
    if truth is not None and label_of(p) in truth and p["sigma"] > 0:
        error = in_sigmas((p["value"] - float(from_si(truth[label_of(p)], p["unit"]))) / p["sigma"], 1)
    own = unit == naming.unit_in_print(p["unit"])  # else counted from a nominal value that the same data gave
    return {
        "words": naming.named(p["name"], p["axis"]) + (", as stated" if p["sigma"] == 0 else ""),
        "means": naming.typeset(p.get("in_words", "")) if own and distinct_from_zero(p["value"], p["sigma"]) else "",
        "value": value,
        "sigma": sigma,
        "unit": unit,
        "prior": significant(p["prior_sigma"], 2) if own else "",
        "moved": moved,
        "moved_text": in_sigmas(moved, 2 if abs(moved) < 1000 else 0) if own else "",
        "error": error,
    }


def in_sigmas(x: float, places: int) -> str:
    """Return a signed number of sigmas as printed; zero has no sign.

    >>> in_sigmas(-1.26, 1), in_sigmas(-0.01, 1)
    ('−1.3 σ', '0.0 σ')
    """
    text = f"{x:+.{places}f}"
    return minus(text if text.strip("+-0.") else text[1:]) + " σ"


def as_printed(p: Row, value: float, sigma: float, nominal: Counts | None) -> tuple[str, str, str]:
    """Return value, sigma and unit of a parameter as printed, from its value and sigma in its own unit.

    Where readings are counts N of nominal scale k and offset N_0, the model reads k (N - N_0) = f / (1 + s) + b, so
    that f = k (1 + s) (N - N_0 - b / k): then the scale k (1 + s) and the offset N_0 + b / k are printed.
    """
    unit = naming.unit_in_print(p["unit"])
    if nominal is not None and p.get("effect") in ("scale_factor", "bias") and p["axis"] in ("x", "y", "z"):
        k, zero = (x["xyz".index(p["axis"])] for x in (nominal.scale, nominal.offset))
        x, dx = float(to_si(value, p["unit"])), float(to_si(sigma, p["unit"]))
        if p["effect"] == "scale_factor":
            value, sigma, unit = 1e6 * k * (1 + x), 1e6 * abs(k) * dx, "µm/s²/count"
        else:
            value, sigma, unit = zero + x / k, dx / abs(k), "counts"
    printed, spread = pdg(value, sigma)
    return minus(printed), spread, unit


def nominal_in_words(content: Mapping[str, Any]) -> str:
    """Return what the parameters of a unit that outputs counts mean, in sentences; empty for any other."""
    sentences = []
    readout = from_content(content)
    if readout.accelerometers is not None:
        counts = readout.accelerometers
        scale, offset = (", ".join(f"{v:.7g}" for v in x) for x in (counts.scale, counts.offset))
        sentences.append(
            "The accelerometers output counts: scale factor is the acceleration of one count, bias the count at zero "
            f"acceleration. In calibration.json both are errors of a nominal {scale} m/s² per count from {offset} "
            "counts (x, y, z), which were estimated from this recording, and so are nearly zero there."
        )
    if readout.gyroscopes is not None:
        scale = f"{float(from_si(readout.gyroscopes.scale[0], 'deg/s')):.7g}"
        sentences.append(f"The gyroscopes output counts: their parameters apply to a nominal {scale} °/s per count.")
    return " ".join(sentences)


# --- of its stages ---------------------------------------------------------------------------------------------------

RATE_RESIDUALS = ("rate-table", "two-position")  # methods whose residuals are rates


def stages(content: Mapping[str, Any], truth: Mapping[str, float] | None) -> dict[str, Any]:
    """Return tables and a picture of the stages; one that estimates other coefficients has a table of its own."""
    every = content.get("stages", [])
    parameters = content["parameters"]
    labels = {label_of(p) for p in parameters}
    ours = [s for s in every if labels & s["values"].keys()]
    staged = [p for p in parameters if any(label_of(p) in s["values"] for s in ours)]
    several, nominal = len(ours) > 1, from_content(content).accelerometers
    return {
        "stages": [_stage(s, parameters, content["method"] in RATE_RESIDUALS) for s in every],
        "stage_names": [_short(s["name"]) for s in ours] if several else [],
        "stage_rows": [_stage_row(p, i and staged[i - 1], ours, nominal, truth) for i, p in enumerate(staged)],
        "stage_figure": _stage_picture(staged, ours) if several else None,
        "stage_rest": _elsewhere(p for p in parameters if p not in staged) if several else "",
        "coefficients": [_coefficients(s) for s in every if s["values"] and s not in ours],
    }


def _elsewhere(parameters: Iterable[Mapping[str, Any]]) -> str:
    """Return a sentence on the parameters that no stage lists; empty where there are none."""
    rest = dict.fromkeys(naming.named(p["name"]) for p in parameters)
    return f"Estimated in one step, outside these stages: {naming.listed(list(rest))}." if rest else ""


def _short(name: str) -> str:
    return name.replace("_", " ").replace("system level: ", "")


def _stage_picture(parameters: Sequence[Mapping[str, Any]], stages: Sequence[Mapping[str, Any]]) -> Picture:
    ratio = [
        [float(from_si(s["sigmas"].get(label_of(p), np.nan), p["unit"])) / p["prior_sigma"] for p in parameters]
        for s in stages
    ]
    words = [naming.label_in_words(label_of(p)) for p in parameters]
    return picture(
        by_stage(words, [_short(s["name"]) for s in stages], np.array(ratio)),
        f"Sigma of each parameter after each of {naming.counted(len(stages), 'stage')}, relative to its prior.",
        "Uncertainty after each stage, relative to the prior.",
    )


def _coefficients(s: Mapping[str, Any]) -> dict[str, Any]:
    """Return the combined coefficients that a stage estimates instead of parameters, in microradians."""
    rows = []
    for name, value in s["values"].items():
        v, sigma = pdg(float(from_si(value, "urad")), float(from_si(s["sigmas"][name], "urad")))
        rows.append({"words": name.replace("_", " "), "value": minus(v), "sigma": sigma, "unit": "µrad"})
    return {"name": _short(s["name"]), "rows": rows}


def _stage(s: Mapping[str, Any], parameters: Sequence[Mapping[str, Any]], rates: bool) -> dict[str, str]:
    """Return a row of the table of stages; residuals are rates or angles of gyroscopes, or forces."""
    effects = {p["effect"] for p in parameters if label_of(p) in s["values"]}
    turned = effects and all(CATALOGUE[e].stage in GYROSCOPE_STAGES for e in effects)
    unit = "deg/h" if rates else "arcsec" if turned else "ug"
    rms = float(from_si(s["rms"], unit))
    text = f"{significant(rms, 3)} {naming.unit_in_print(unit)}" if np.isfinite(rms) else "–"
    words = naming.as_sentence(s["in_words"])
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
        "words": naming.named(p["name"], p["axis"]),
        "first": not before or before["name"] != p["name"],
        "cells": cells,
        "truth": known,
        "unit": printed,
    }
