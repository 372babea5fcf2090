"""The page of a pointing run: what is left of each star over the axes, terms as TPOINT names them, night by night."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from gimbalcal.effects import Effect
from gimbalcal.estimate.pointing.fit import fit
from gimbalcal.estimate.pointing.run import against_stars, on_stars, read_axes
from gimbalcal.estimate.pointing.terms import wanted_parameters
from gimbalcal.number import Array
from gimbalcal.recording import Recording
from gimbalcal.report import wording
from gimbalcal.report.chart import BLUE, Chart, Points, Rule
from gimbalcal.report.figures import sky
from gimbalcal.report.html import Picture, picture
from gimbalcal.report.rounding import minus, pdg, rms, signed, significant
from gimbalcal.units import from_si

UNIT = "arcsec"


def pointing_picture(recordings: Sequence[Recording], effects: Sequence[Effect]) -> Picture:
    """What zeros alone leave of each star, and what all terms do, over both axes of the mount."""
    axes = read_axes(recordings[0])
    angles, left, titles = [], [], []
    for r in recordings:
        night = f"“{r.title}”, " if len(recordings) > 1 else ""
        titles += [f"{night}star {k}" for k in range(1, len(r.time) + 1)]
        angles.append(np.degrees(np.stack([r.channels["true_angle", a] for a in axes], axis=1)))
        left.append(np.asarray(from_si(against_stars(r, on_stars(r), effects).residual, UNIT)))
    zeros = fit(recordings, wanted_parameters(recordings[0].platform, axes, ("gimbal_zero",)))
    before = np.asarray(from_si(np.concatenate(zeros.residuals), UNIT))
    after, at = np.concatenate(left), np.concatenate(angles)
    told = [significant(float(np.sqrt((x**2).sum(axis=1).mean())), 3) for x in (before, after)]
    names = [a.replace("_", " ") for a in axes]
    return picture(
        _over_axes(at, before, after, names, titles),
        f"Misfit of {wording.counted(len(after), 'star')} over {wording.listed(names)}: {told[0]} arcsec on the sky "
        f"with zeros alone, {told[1]} arcsec with all terms.",
        "Where each star was seen against its target, across the plane of the innermost axis and along it: with the "
        f"zeros alone (pale, {told[0]} arcsec rms on the sky) and with all terms (blue, {told[1]} arcsec).",
    )


def _over_axes(at: Array, before: Array, after: Array, names: Sequence[str], titles: Sequence[str]) -> list[Chart]:
    """Misfit (n, 2) [arcsec] before and after over the angles (n, 2) [deg] of both axes, and on the sky."""
    size = 2.6 if len(at) <= 400 else 1.5
    charts = [sky(at[:, 1], at[:, 0], after[:, 0], after[:, 1], UNIT, titles, "azimuth" in names)]
    for i, across in enumerate(("across", "along")):
        for k, name in enumerate(names):
            told = [f"{t}: {signed(a)} {UNIT}" for t, a in zip(titles, after[:, i], strict=True)]
            charts.append(Chart(
                (Points(at[:, k], before[:, i], "pale", "square", size, label="zeros alone"),
                 Points(at[:, k], after[:, i], BLUE, "dot", size, names=told, label="all terms"), Rule(0.0)),
                f"{across}: {rms(before[:, i])} → {rms(after[:, i])} {UNIT} rms", f"{name} [°]", f"[{UNIT}]",
                height=170,
            ))  # fmt: skip
    return charts


def named_terms(content: Mapping[str, Any]) -> list[dict[str, str]]:
    """Terms as TPOINT names and signs them, value and sigma as printed; none for another calibration."""
    rows = []
    for term in content["provenance"].get("tpoint", ()):
        value, sigma = pdg(term["value"], term["sigma"])
        rows.append({"term": term["term"], "value": minus(value), "sigma": sigma, "unit": term["unit"]})
    return rows


def night_by_night(content: Mapping[str, Any]) -> dict[str, Any]:
    """Terms of each night by name, and in words whether the nights share them; empty for a single night."""
    nights = content["provenance"].get("nights", ())
    if not nights:
        return {"nights": [], "night_rows": [], "nights_in_words": ""}
    rows = []
    for label, first in nights[0]["terms"].items():
        cells = [_cell(n["terms"][label]) for n in nights]
        change = [_change(n["terms"][label]) for n in nights[1:]]
        unit = wording.unit_in_print(first["unit"])
        rows.append({"words": wording.label_in_words(label), "cells": cells, "changes": change, "unit": unit})
    p = content["provenance"]["same_terms_every_night"]
    chance = f"{p:.2g}" if p >= 1e-4 else "less than 0.0001"
    words = f"The probability that all nights share one set of terms is {chance}."
    heads = [f"{n['title']}, {n['stars']} stars, {significant(n['rms_arcsec'], 3)} arcsec" for n in nights]
    return {"nights": heads, "night_rows": rows, "nights_in_words": words}


def _cell(term: Mapping[str, Any]) -> str:
    value, sigma = pdg(term["value"], term["sigma"])
    return f"{minus(value)} ± {sigma}"


def _change(term: Mapping[str, Any]) -> str:
    value, sigma = pdg(term["change"], term["change_sigma"])
    sign = "" if value.startswith("-") else "+"
    return minus(f"{sign}{value} ± {sigma}")
