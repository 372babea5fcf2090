"""What a navigator in its place did: how its sigmas fell, and whether its innovations are what they should be."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from gimbalcal.errors import amount
from gimbalcal.number import Array
from gimbalcal.report.chart import COLOURS, SHAPES, Chart, Mark, Points, Rule, sensible_time
from gimbalcal.report.figures import curves_by_group
from gimbalcal.report.html import Picture, picture
from gimbalcal.report.rounding import minus, significant
from gimbalcal.report.wording import label_of, named, unit_in_print

SEEN_BY_CHANCE = 3.0  # sigmas of a check
USUAL = 5.0  # of a mean of few squares
REJECTED = 0.01  # share of updates that knocks explain
BEYOND = 3.5  # sigmas: of a hundred innovations one in twenty sets has one this far out by chance
DIRECTIONS = ("north", "east", "down")


def navigation_pictures(content: Mapping[str, Any]) -> list[Picture]:
    """Innovations by stop and turn, and sigma against time by effect; none where nothing was navigated."""
    navigation = content["residual"].get("navigation")
    return [_innovations(navigation), _sigmas(content, navigation)] if navigation else []


def navigation_facts(content: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Numbers of the first screen."""
    n = content["residual"].get("navigation")
    if not n:
        return []
    updates = f"{amount(n['updates'], 'update')} of the velocity, {n['rejected']} rejected"
    return [(significant(n["nis"]["ratio"], 3), f"innovations squared over their variance, mean ({updates})")]


def navigation_checks(content: Mapping[str, Any]) -> list[dict[str, str]]:
    """Whether the filter was consistent: NIS, NEES, rejected updates and whiteness, a number and a sentence each.

    Source: Bar-Shalom, Li, Kirubarajan, Estimation with Applications to Tracking and Navigation (2001), section 5.4.
    """
    n = content["residual"].get("navigation")
    if not n:
        return []
    nis, went, white = n["nis"], n["nees"]["position"], n["whiteness"]
    spread = np.sqrt(2 / nis["dof"])
    share = n["rejected"] / n["updates"]
    lag = white["lag_one"] / white["sigma"]
    return [
        _check(
            "NIS", f"{nis['ratio']:.3f} ± {spread:.3f}",
            "Squared velocity innovations over the variance that the filter expects, mean; one is expected, and "
            + _beside_one(nis["ratio"], SEEN_BY_CHANCE * spread),
        ),
        _check(
            "NEES", significant(went, 2),
            "How far the navigator believes it went from a place that it never left, squared over its variance, mean; "
            "of a walk there are few independent numbers in a run, so up to five is usual, and this is "
            + ("usual." if went <= USUAL else "more: its drift is not in its sigma."),
        ),
        _check(
            "rejected updates", f"{n['rejected']} of {n['updates']}",
            "Updates of the velocity that no noise explains, so that they were left out; "
            + ("there are none." if not n["rejected"] else "a knock is one or two." if share <= REJECTED else
               "so many are no knocks, but a wrong model or a place that moves."),
        ),
        _check(
            "whiteness", f"{white['lag_one']:.3f} ± {white['sigma']:.3f}",
            "Correlation of an innovation with the one before; none is expected, and this is "
            + ("none." if abs(lag) < SEEN_BY_CHANCE else f"{abs(lag):.2g} sigma of chance: "
               + ("what moves the velocity slowly is not in the model." if lag > 0 else
                  "they go to and fro, as where the place is stiller than stated.")),
        ),
    ]  # fmt: skip


def _check(name: str, number: str, sentence: str) -> dict[str, str]:
    return {"name": name, "number": minus(number), "sentence": sentence}


def _beside_one(ratio: float, within: float) -> str:
    """What a mean of squares that should be one says of the noise."""
    if abs(ratio - 1) <= within:
        return "this is one."
    if ratio > 1:
        return "this is more: the noise is larger than stated, or something is not in the model."
    return "this is less: sensors or place are quieter than stated, so the sigmas are on the safe side."


def _innovations(n: Mapping[str, Any]) -> Picture:
    z = np.array(n["legs"]["innovation"])
    far = int(np.sum(np.abs(z) > BEYOND))
    drawn = innovations_by_leg(n["legs"]["name"], z)
    told = f"{amount(far, 'sum')} beyond {BEYOND:g} σ" if far else f"none beyond {BEYOND:g} σ"
    white = n["whiteness"]
    return picture(
        drawn,
        f"Sums of normalised velocity innovations over {amount(len(z), 'stop and turn', 'stops and turns')}: {told}.",
        f"Velocity innovations of the calibrated navigator, summed over each stop (filled) and turn (rings) in units "
        f"of their sigma; {told}. From one update to the next they correlate by {significant(white['lag_one'], 2)} "
        f"(sigma {significant(white['sigma'], 2)}).",
    )


def _sigmas(content: Mapping[str, Any], n: Mapping[str, Any]) -> Picture:
    groups: dict[tuple[str, str], dict[str, Sequence[float]]] = {}
    for p in content["parameters"]:
        of = groups.setdefault((named(p["name"]), unit_in_print(p["unit"])), {})
        of[p["axis"]] = n["sigma"][label_of(p)]
    smoothed = n["attitude"].get("smoothed_arcsec")  # some calibration.json have none
    if smoothed:
        groups["attitude, smoothed", "arcsec"] = smoothed
    return picture(
        sigma_over_time(np.array(n["time_s"]), groups),
        f"Sigma of {amount(len(content['parameters']), 'parameter')} against time, by effect.",
        "How each parameter's sigma (√P of the filter) fell in the course of the recording: steps are turns that show "
        "what no stop before did. That of the attitude is the smoother's, from all updates before and after.",
    )


def innovations_by_leg(names: Sequence[str], z: Array) -> Chart:
    """Sums z (n, 3) of normalised innovations over stops and turns, north, east, down."""
    x = np.arange(len(names), dtype=float)
    stop = np.array([name.startswith("stop") for name in names])
    marks: list[Mark] = [Rule(level, "grey", dashed=True) for level in (-BEYOND, BEYOND)]
    for i, colour in enumerate(COLOURS[:3]):
        at = x + 0.2 * (i - 1)
        for chosen, shape, label in ((stop, SHAPES[i], DIRECTIONS[i]), (~stop, "ring", "")):
            told = [f"{n}, {DIRECTIONS[i]}: {v:+.1f} σ" for n, v, c in zip(names, z[:, i], chosen, strict=True) if c]
            marks.append(Points(at[chosen], z[chosen, i], colour, shape, 3, names=told, label=label))
    words = [name.removeprefix("stop ") if name.startswith("stop") else "" for name in names]
    return Chart((*marks, Rule(0.0)), x_label="stop, and the turn after it", y_label="innovation [σ]", x_names=words)


def sigma_over_time(seconds: Array, groups: Mapping[tuple[str, str], Mapping[str, Sequence[float]]]) -> list[Chart]:
    """One chart for each (effect, unit): the sigmas of its axes against time, logarithmic."""
    time, unit = sensible_time(seconds)
    told = [(f"{name}  [{of}]", [(axis, np.asarray(s)) for axis, s in c.items()]) for (name, of), c in groups.items()]
    return curves_by_group(time, told, f"time [{unit}]")
