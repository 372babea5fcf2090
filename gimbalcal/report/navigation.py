"""What a navigator in its place did: how its sigmas fell, and whether its innovations are what they should be."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from gimbalcal.errors import amount
from gimbalcal.number import Array
from gimbalcal.report.chart import COLOURS, Chart, Mark, Points, Rule, sensible_time
from gimbalcal.report.figures import curves_by_group
from gimbalcal.report.html import Picture, picture
from gimbalcal.report.rounding import significant
from gimbalcal.report.wording import label_of, unit_in_print

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


def _innovations(n: Mapping[str, Any]) -> Picture:
    z = np.array(n["legs"]["innovation"])
    far = int(np.sum(np.abs(z) > BEYOND))
    drawn = innovations_by_leg(n["legs"]["name"], z)
    told = f"{amount(far, 'sum')} beyond {BEYOND:g} σ" if far else f"none beyond {BEYOND:g} σ"
    white = n["whiteness"]
    return picture(
        drawn,
        f"Sums of normalised velocity innovations over {amount(len(z), 'stop and turn', 'stops and turns')}: {told}.",
        f"Velocity innovations of the calibrated navigator, summed over each stop (dots) and turn (rings) in units of "
        f"their sigma; {told}. From one update to the next they correlate by {significant(white['lag_one'], 2)} "
        f"(sigma {significant(white['sigma'], 2)}).",
    )


def _sigmas(content: Mapping[str, Any], n: Mapping[str, Any]) -> Picture:
    groups: dict[tuple[str, str], dict[str, Sequence[float]]] = {}
    for p in content["parameters"]:
        of = groups.setdefault((p["name"].replace("_", " "), unit_in_print(p["unit"])), {})
        of[p["axis"]] = n["sigma"][label_of(p)]
    return picture(
        sigma_over_time(np.array(n["time_s"]), groups),
        f"Sigma of {amount(len(content['parameters']), 'parameter')} against time, by effect.",
        "How each parameter's sigma (√P of the filter) fell in the course of the recording: steps are turns that show "
        "what no stop before did.",
    )


def innovations_by_leg(names: Sequence[str], z: Array) -> Chart:
    """Sums z (n, 3) of normalised innovations over stops and turns, north, east, down."""
    x = np.arange(len(names), dtype=float)
    stop = np.array([name.startswith("stop") for name in names])
    marks: list[Mark] = [Rule(level, "grey", dashed=True) for level in (-BEYOND, BEYOND)]
    for i, colour in enumerate(COLOURS[:3]):
        at = x + 0.2 * (i - 1)
        for chosen, shape, label in ((stop, "dot", DIRECTIONS[i]), (~stop, "ring", "")):
            told = [f"{n}, {DIRECTIONS[i]}: {v:+.1f} σ" for n, v, c in zip(names, z[:, i], chosen, strict=True) if c]
            marks.append(Points(at[chosen], z[chosen, i], colour, shape, 3, names=told, label=label))  # type: ignore[arg-type]
    words = [name.removeprefix("stop ") if name.startswith("stop") else "" for name in names]
    return Chart((*marks, Rule(0.0)), x_label="stop, and the turn after it", y_label="innovation [σ]", x_names=words)


def sigma_over_time(seconds: Array, groups: Mapping[tuple[str, str], Mapping[str, Sequence[float]]]) -> list[Chart]:
    """One chart for each (effect, unit): the sigmas of its axes against time, logarithmic."""
    time, unit = sensible_time(seconds)
    told = [(f"{name}  [{of}]", [(axis, np.asarray(s)) for axis, s in c.items()]) for (name, of), c in groups.items()]
    return curves_by_group(time, told, f"time [{unit}]")
