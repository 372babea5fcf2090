"""What a navigator in its place did: how its sigmas fell, and whether its innovations are what they should be."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from gimbalcal.errors import amount
from gimbalcal.report.html import Picture, picture
from gimbalcal.report.rounding import significant
from gimbalcal.report.style import BLUE, FULL, GREEN, GREY, HALF, INK, SERIES, STYLE, VERMILION, empty
from gimbalcal.report.wording import label_of, unit_in_print

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLUMNS = 3
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
        sigma_over_time(np.array(n["time_s"]) / 60, groups),
        f"Sigma of {amount(len(content['parameters']), 'parameter')} against time, by effect.",
        "How each parameter's sigma (√P of the filter) fell in the course of the recording: steps are turns that show "
        "what no stop before did.",
    )


def innovations_by_leg(names: Sequence[str], z: np.ndarray[Any, Any]) -> Figure:
    """Sums z (n, 3) of normalised innovations over stops and turns, north, east, down."""
    import matplotlib as mpl

    with mpl.rc_context(STYLE):
        figure = empty(HALF, 2.6)
        ax = figure.subplots()
        x = np.arange(len(names))
        stop = np.array([name.startswith("stop") for name in names])
        for i, colour in enumerate((BLUE, VERMILION, GREEN)):
            at = x + 0.2 * (i - 1)
            ax.plot(at[stop], z[stop, i], "o", ms=3, color=colour, label=DIRECTIONS[i])
            ax.plot(at[~stop], z[~stop, i], "o", ms=3, mfc="none", color=colour)
        for level in (-BEYOND, BEYOND):
            ax.axhline(level, color=GREY, lw=0.6, ls="--")
        ax.axhline(0, color=INK, lw=0.6)
        step = max(1, 2 * -(-len(names) // 24))
        ax.set_xticks(x[::step], [name.removeprefix("stop ") for name in names[::step]])
        ax.set_xlabel("stop, and the turn after it")
        ax.set_ylabel("innovation  [σ]")
        ax.legend(loc="upper left", ncols=3)
        return figure


def sigma_over_time(
    minutes: np.ndarray[Any, Any], groups: Mapping[tuple[str, str], Mapping[str, Sequence[float]]]
) -> Figure:
    """One panel for each (effect, unit): the sigmas of its axes against time, logarithmic."""
    import matplotlib as mpl

    with mpl.rc_context(STYLE):
        rows = -(-len(groups) // COLUMNS)
        figure = empty(FULL, 0.4 + 1.8 * rows)
        grid = figure.subplots(rows, COLUMNS, sharex=True, squeeze=False)
        for ax, ((name, unit), curves) in zip(grid.flat, groups.items(), strict=False):
            for i, (axis, sigma) in enumerate(curves.items()):
                style = "-" if i < len(SERIES) else "--"
                ax.semilogy(minutes, sigma, style, lw=0.9, color=SERIES[i % len(SERIES)], label=axis)
            ax.set_title(f"{name}  [{unit}]")
            ax.legend(loc="upper right", ncols=3, handlelength=1, columnspacing=0.8)
        for ax in list(grid.flat)[len(groups) :]:
            ax.set_visible(False)
        for ax in list(grid.flat)[max(0, len(groups) - COLUMNS) : len(groups)]:  # the lowest of each column
            ax.set_xlabel("time  [min]")
            ax.xaxis.set_tick_params(labelbottom=True)
        return figure
