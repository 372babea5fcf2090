"""Sections of the page of a calibration that depend on the kind of its recordings: pictures, nights, the navigator.

`pictures` is the only place that knows which kind shows what.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from gimbalcal.calibration import Calibration
from gimbalcal.errors import number_of
from gimbalcal.number import Array
from gimbalcal.recording import Recording
from gimbalcal.report import figures
from gimbalcal.report.chart import BLUE, COLOURS, SHAPES, Band, Chart, Line, Mark, Points, Rule
from gimbalcal.report.html import Context, Picture, picture
from gimbalcal.report.parameters import MAX_SHOWN_SIGMA, plus_minus
from gimbalcal.units import from_si
from gimbalcal.words.naming import (
    label_in_words,
    list_in_words,
    name_in_words,
    number_and_noun,
    unit_in_print,
    unobservable_leading,
    without_underscores,
)
from gimbalcal.words.rounding import p_value, rms, sensible_time, signed, significant

Pictures = tuple[list[Picture], list[Picture]]  # of the first screen; of the section on the data


def pictures(c: Calibration, recordings: Sequence[Recording]) -> Pictures:
    """Return the pictures of the residuals, for the first screen, and of the data behind them."""
    if recordings and c.method == "rate-table":
        return [rate_table_picture(recordings, c)], []
    if recordings and all(r.kind.sighting for r in recordings):
        return [pointing_picture(recordings, c)], []
    leading: list[Picture] = []
    others: list[Picture] = []
    for r in recordings:
        first, more = (run_pictures if r.kind.stabilised else position_pictures)(r, c)
        leading, others = leading + first, others + more
    others += navigation_pictures(c)
    return (leading, others) if leading else (others[:2], others[2:])


# --- positions and a static run ---------------------------------------------------------------------------------------


def position_pictures(r: Recording, c: Calibration) -> Pictures:
    """Return the residual at each position, and the positions where the platform has gimbals."""
    from gimbalcal.report.residuals import by_position

    if r.position is None or not r.has("specific_force"):
        return [], []
    e = by_position(r, c.effects, c.provenance, c.readout)
    unit, count = unit_in_print(e.unit), number_and_noun(len(e.labels), "position")
    far = 0 if e.sigma is None else int(np.sum(np.abs(e.after) > figures.OUTLIER * e.sigma))
    circled = f"; circled: {number_and_noun(far, 'reading')} beyond {figures.OUTLIER} σ" if far else ""
    residuals = picture(
        figures.residuals_by_position(e.labels, e.before, e.after, e.sigma, e.axes, unit),
        f"Residuals of {count} by axis: {rms(e.before)} {unit} rms before, {rms(e.after)} {unit} rms after.",
        f"Measured minus model at each position of “{r.title}”: before, against perfect sensors, and after, with the "
        f"calibration (each with its own scale{circled}).",
    )
    if not r.platform.axes:
        return [residuals, *gyroscope_pictures(r, c)], []
    motion = picture(
        figures.schedule(e.labels, e.angles, e.axis_names, e.gravity),
        f"Gimbal angles at {count}, and the direction of gravity in platform axes.",
        "Motion of the platform: gimbal angles by position, and the direction of gravity in platform axes, along z.",
    )
    return [residuals], [motion]


def gyroscope_pictures(r: Recording, c: Calibration) -> list[Picture]:
    """Return the residuals of gyroscopes: of the rates at rest, and of gravity after the turns between dwells."""
    from gimbalcal.report.residuals import of_gyroscopes

    out = []
    for what, e in of_gyroscopes(r, c).items():
        unit = unit_in_print(e.unit)
        out.append(picture(
            figures.residuals_by_position(e.labels, e.before, e.after, e.sigma, e.axes, unit),
            f"Residuals of {what} by axis: {rms(e.before)} {unit} rms before, {rms(e.after)} {unit} rms after.",
            f"{what.capitalize()}, measured minus model at each position: before, against perfect gyroscopes, and "
            "after, with the calibration.",
        ))  # fmt: skip
    return out


def run_pictures(r: Recording, c: Calibration) -> Pictures:
    """Return the residual of a static run, and the model through the data."""
    from gimbalcal.report.residuals import over_time

    hours, curves = over_time(r, c.effects)
    time, unit = sensible_time(3600 * hours)
    sizes = [(c.name, float(np.std(c.measured - c.fitted)), c.unit) for c in curves]
    residual = ", ".join(f"{name} {significant(size, 2)} {of}" for name, size, of in sizes)
    charts, run = figures.over_time(time, curves, unit), f"Static run of {hours[-1] - hours[0]:.1f} h"
    return [], [
        picture(
            charts[1::2],
            f"{run}, residual of the calibrated model: {residual}.",
            f"“{r.title}”, measured minus model. The band is one σ of the noise, averaged as the points are.",
        ),
        picture(
            charts[::2],
            f"{run} with the calibrated model through it.",
            f"“{r.title}”: the harmonics of the Earth's rotation in attitude and force, minus the output of perfect "
            "sensors, and the calibrated model through them.",
        ),
    ]


# --- a rate table -----------------------------------------------------------------------------------------------------


def rate_table_picture(recordings: Sequence[Recording], c: Calibration) -> Picture:
    """Return reading minus the table's rate at each stretch of steady turning, of all mountings, by gyroscope."""
    from gimbalcal.calibration.readout import in_si
    from gimbalcal.views.rate_table import stretches_of

    before = [stretches_of(in_si(r, c.readout)) for r in recordings]
    after = [stretches_of(c.apply(r)) for r in recordings]
    charts = []
    for i, axis in enumerate("xyz"):
        for when, each, unit in (("before", before, "deg/s"), ("after", after, "deg/h")):
            marks = []
            off = [np.asarray(from_si(s.reading[:, i], unit)) for s in each]
            for k, (r, s) in enumerate(zip(recordings, each, strict=True)):
                along = s.rate[:, int(np.argmax(np.abs(s.rate).max(axis=0)))]
                marks.append(Points(np.degrees(along), off[k], COLOURS[k % 6], label=r.title if i == 0 else ""))
            printed = unit_in_print(unit)
            title = f"{axis}, {when}: {rms(np.concatenate(off))} {printed} rms"
            charts.append(Chart((*marks, Rule(0.0)), title, "rate of the table [°/s]", f"[{printed}]", height=170))
    stretches = number_and_noun(sum(len(s.time) for s in after), "stretch", "stretches")
    return picture(
        charts,
        f"Output of three gyroscopes minus the table's rate at {stretches} of steady turning.",
        "Output minus the table's rate at each stretch of steady turning: as logged, and corrected with the "
        "calibration. The residual contains the Earth's rate, whose horizontal direction is unknown.",
    )


# --- a telescope mount ------------------------------------------------------------------------------------------------

UNIT = "arcsec"
WAYS = {"across": "across the plane of the innermost axis", "along": "along the plane of the innermost axis"}


def pointing_picture(recordings: Sequence[Recording], c: Calibration) -> Picture:
    """Return the residual of each star with zeros alone and with all terms, over each axis of the mount."""
    from gimbalcal.estimate.pointing.fit import fit_terms, wanted_parameters
    from gimbalcal.views.pointing import pointing, read_axes

    axes = read_axes(recordings[0])
    views = [pointing(r) for r in recordings]
    angles, residual, titles = [], [], []
    for r, v in zip(recordings, views, strict=True):
        night = f"“{r.title}”, " if len(recordings) > 1 else ""
        titles += [f"{night}star {k}" for k in range(1, len(r.time) + 1)]
        angles.append(np.degrees(np.stack([r.channels["true_angle", a] for a in axes], axis=1)))
        residual.append(np.asarray(from_si(v.evaluate(c.effects).residual, UNIT)))
    zeros = fit_terms(views, wanted_parameters(recordings[0].platform, axes, ("gimbal_zero",)))
    before = np.asarray(from_si(np.concatenate(zeros.residual), UNIT))
    after = np.concatenate(residual)
    sizes = [significant(float(np.sqrt((x**2).sum(axis=1).mean())), 3) for x in (before, after)]
    names = [a.replace("_", " ") for a in axes]
    ways = [axis for _, axis in views[0].channels]
    directions = f"{WAYS['across']} and along it" if len(ways) == 2 else WAYS[ways[0]]
    return picture(
        _over_axes(np.concatenate(angles), before, after, names, ways, titles),
        f"Residuals of {number_and_noun(len(after), 'star')} over {list_in_words(names)}: {sizes[0]} arcsec on the "
        f"sky with zeros alone, {sizes[1]} arcsec with all terms.",
        f"Observed minus target direction of each star, {directions}: with the "
        f"zeros alone (pale, {sizes[0]} arcsec rms on the sky) and with all terms (blue, {sizes[1]} arcsec).",
    )


def _over_axes(
    at: Array, before: Array, after: Array, names: Sequence[str], ways: Sequence[str], titles: Sequence[str]
) -> list[Chart]:
    """Draw residuals (n, C) [arcsec] before and after over the angles (n, k) [deg] of each axis, and of two on the sky.

    ways: in which directions the residuals are, "across" the plane of the innermost axis or "along" it.
    """
    size = 2.6 if len(at) <= 400 else 1.5
    charts = []
    if len(names) == after.shape[1] == 2:
        charts.append(figures.sky(at[:, 1], at[:, 0], after[:, 0], after[:, 1], UNIT, titles, "azimuth" in names))
    for i, way in enumerate(ways):
        points = [f"{t}: {signed(a)} {UNIT}" for t, a in zip(titles, after[:, i], strict=True)]
        charts += [
            Chart(
                (Points(at[:, k], before[:, i], "pale", "square", size, label="zeros alone"),
                 Points(at[:, k], after[:, i], BLUE, "dot", size, names=points, label="all terms"), Rule(0.0)),
                f"{way}: {rms(before[:, i])} → {rms(after[:, i])} {UNIT} rms", f"{name} [°]", f"[{UNIT}]",
                height=170,
            ) for k, name in enumerate(names)
        ]  # fmt: skip
    return charts


def night_by_night(c: Calibration) -> Context:
    """Return the terms of each night by name, and whether the nights agree; empty for a single night."""
    nights, p = c.provenance.nights, c.provenance.same_terms_every_night
    if not nights or p is None:
        return {"nights": [], "night_rows": [], "nights_in_words": ""}
    rows = []
    for label, first in nights[0].terms.items():
        terms = [n.terms[label] for n in nights]
        changes = [(t.change or 0.0, t.change_sigma or 0.0) for t in terms[1:]]
        rows.append({
            "words": label_in_words(label), "unit": unit_in_print(first.unit),
            "cells": [plus_minus(t.value, t.sigma) for t in terms],
            "changes": [f"{'' if change < 0 else '+'}{plus_minus(change, sigma)}" for change, sigma in changes],
        })  # fmt: skip
    return {
        "nights": [f"{n.title}, {n.stars} stars, {significant(n.rms_arcsec, 3)} arcsec" for n in nights],
        "night_rows": rows,
        "nights_in_words": f"The hypothesis that all nights share one set of terms has a p-value of {p_value(p)}.",
    }


# --- a navigator in place ---------------------------------------------------------------------------------------------

OUTLIER_SIGMAS = 3.5  # of a hundred innovations one in twenty sets has one this far out by chance
DIRECTIONS = ("north", "east", "down")


def navigation_pictures(c: Calibration) -> list[Picture]:
    """Return innovations by stop and turn, estimates and sigmas against time by effect; none without a navigator."""
    navigation = c.residual.navigation
    if not navigation:
        return []
    # A calibration.json of an earlier version has no estimates.
    estimates = [_estimates_picture(c, navigation)] if "estimate" in navigation else []
    return [_innovations_picture(navigation), *estimates, _sigmas_picture(c, navigation)]


def navigation_facts(c: Calibration) -> list[tuple[str, str]]:
    """Return the numbers of the first screen."""
    n = c.residual.navigation
    if not n:
        return []
    updates = f"{number_of(n['updates'], 'velocity update')}, {n['rejected']} rejected"
    return [(significant(n["nis"]["ratio"], 3), f"normalised innovation squared, mean ({updates})")]


def _innovations_picture(n: Mapping[str, Any]) -> Picture:
    z, white = np.array(n["legs"]["innovation"]), n["whiteness"]
    far = int(np.sum(np.abs(z) > OUTLIER_SIGMAS))
    outliers = f"{number_of(far, 'sum')} beyond {OUTLIER_SIGMAS:g} σ" if far else f"none beyond {OUTLIER_SIGMAS:g} σ"
    return picture(
        innovations_by_leg(n["legs"]["name"], z),
        f"Sums of normalised velocity innovations, {number_of(len(z), 'stop and turn', 'stops and turns')}: "
        f"{outliers}.",
        f"Velocity innovations of the calibrated navigator, summed over each stop (filled) and turn (rings) in units "
        f"of their sigma; {outliers}. The correlation of successive updates is {significant(white['lag_one'], 2)} "
        f"(sigma {significant(white['sigma'], 2)}).",
    )


def _estimates_picture(c: Calibration, n: Mapping[str, Any]) -> Picture:
    """Return the estimates of the filter against time with one sigma, a chart for each effect."""
    time, unit = sensible_time(np.array(n["time_s"]))
    unknown, groups = unobservable_leading(c.null_directions), dict[tuple[str, str], list[Mark]]()
    for p in c.parameters:
        if p.label in unknown:
            continue
        marks = groups.setdefault((name_in_words(p.name), unit_in_print(p.unit)), [])
        colour = COLOURS[len(marks) // 2 % len(COLOURS)]
        x, sigma = np.array(n["estimate"][p.label]) - n["estimate"][p.label][-1], np.array(n["sigma"][p.label])
        t, x, sigma = (a[sigma < MAX_SHOWN_SIGMA * sigma[-1]] for a in (time, x, sigma))
        marks += [Band(t, x - sigma, x + sigma, colour), Line(t, x, colour, without_underscores(p.axis))]
    charts = [
        Chart((*marks, Rule(0.0)), f"{name}  [{of}]", f"time [{unit}]", height=170)
        for (name, of), marks in groups.items()
    ]
    omitted = (
        f" Not drawn: {number_and_noun(len(unknown), 'parameter')} that the data do not determine." if unknown else ""
    )
    return picture(
        charts,
        f"Estimates of {number_of(len(c.parameters) - len(unknown), 'parameter')} against time with one sigma, "
        "by effect.",
        "Estimates of the filter in the last pass less their last value, with a band of one σ, from where σ is below "
        f"{MAX_SHOWN_SIGMA:g} times its last value. As Figures 4 and 6 of Cai et al. (2016) and 1 and 4 of Wei et al. "
        f"(2022).{omitted}",
    )


def _sigmas_picture(c: Calibration, n: Mapping[str, Any]) -> Picture:
    groups: dict[tuple[str, str], dict[str, Sequence[float]]] = {}
    for p in c.parameters:
        groups.setdefault((name_in_words(p.name), unit_in_print(p.unit)), {})[p.axis] = n["sigma"][p.label]
    if smoothed := n["attitude"].get("smoothed_arcsec"):  # some calibration.json have none
        groups["attitude, smoothed", "arcsec"] = smoothed
    return picture(
        sigma_over_time(np.array(n["time_s"]), groups),
        f"Sigma of {number_of(len(c.parameters), 'parameter')} against time, by effect.",
        "Sigma of each parameter (√P of the filter) over the recording: steps are turns that determine what no "
        "earlier stop did. That of the attitude is the smoother's, from all updates before and after.",
    )


def innovations_by_leg(names: Sequence[str], z: Array) -> Chart:
    """Draw sums z (n, 3) of normalised innovations over stops and turns, north, east, down."""
    x = np.arange(len(names), dtype=float)
    stop = np.array([name.startswith("stop") for name in names])
    marks: list[Mark] = [Rule(level, "grey", dashed=True) for level in (-OUTLIER_SIGMAS, OUTLIER_SIGMAS)]
    for i, colour in enumerate(COLOURS[:3]):
        at = x + 0.2 * (i - 1)
        for chosen, shape, label in ((stop, SHAPES[i], DIRECTIONS[i]), (~stop, "ring", "")):
            points = [f"{n}, {DIRECTIONS[i]}: {v:+.1f} σ" for n, v, c in zip(names, z[:, i], chosen, strict=True) if c]
            marks.append(Points(at[chosen], z[chosen, i], colour, shape, 3, names=points, label=label))
    words = [name.removeprefix("stop ") if name.startswith("stop") else "" for name in names]
    return Chart((*marks, Rule(0.0)), x_label="stop, and the turn after it", y_label="innovation [σ]", x_names=words)


def sigma_over_time(seconds: Array, groups: Mapping[tuple[str, str], Mapping[str, Sequence[float]]]) -> list[Chart]:
    """Draw one chart for each (effect, unit): the sigmas of its axes against time, logarithmic."""
    time, unit = sensible_time(seconds)
    lines = [(f"{name}  [{of}]", [(axis, np.asarray(s)) for axis, s in c.items()]) for (name, of), c in groups.items()]
    return figures.curves_by_group(time, lines, f"time [{unit}]")
