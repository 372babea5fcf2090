"""Pictures of data for the report: functions of arrays that return a matplotlib Figure; every axis has its unit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from gimbalcal.number import Array
from gimbalcal.report.style import BLUE, FULL, GREY, HALF, INK, ORANGE, PALE, SERIES, STYLE, VERMILION, empty, rms

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

OUTLIER = 3.5  # sigmas; of 54 readings, one in forty sets has one this far out by chance


@dataclass(frozen=True)
class Curve:
    """One channel over time in printed units, less what perfect sensors would read: measured, and as calibrated."""

    name: str
    unit: str
    measured: Array  # (n,)
    fitted: Array  # (n,)
    sigma: float | None = None


@dataclass(frozen=True)
class Panel:
    """Residuals (n,) of one channel over `x` in printed units, before and after something is added; one sigma (n,)."""

    name: str
    unit: str
    x: Array
    x_label: str
    before: Array
    after: Array
    sigma: Array | None = None


def residuals_by_position(
    positions: Sequence[str], before: Array, after: Array, sigma: Array | None, axes: Sequence[str], unit: str
) -> Figure:
    """Residual of each position (n, c) without and with the calibration, sigma (n, c) as bars, in printed `unit`."""
    import matplotlib as mpl

    with mpl.rc_context(STYLE):
        figure = empty(HALF, 0.9 + 1.5 * len(axes))
        grid = figure.subplots(len(axes), 2, sharex=True, sharey="col", squeeze=False)
        x = np.arange(len(positions))
        for i, axis in enumerate(axes):
            left, right = grid[i]
            left.bar(x, before[:, i], width=0.62, color=PALE, edgecolor=GREY, linewidth=0.5)
            bars = None if sigma is None else sigma[:, i]
            right.errorbar(x, after[:, i], yerr=bars, fmt="o", ms=3, lw=0.9, color=BLUE, ecolor=BLUE)
            if sigma is not None:
                far = np.abs(after[:, i]) > OUTLIER * sigma[:, i]
                right.plot(x[far], after[far, i], "o", ms=5.5, mfc="none", mec=VERMILION, mew=1.4, zorder=4)
            for ax in (left, right):
                ax.axhline(0, color=INK, lw=0.6, zorder=1)
            left.set_ylabel(f"{axis}  [{unit}]")
        _title(grid[0, 0], "Before", before, unit)
        _title(grid[0, 1], "After", after, unit, " (bars 1σ)" if sigma is not None else "")
        step = max(1, -(-len(positions) // 12))
        for ax in grid[-1]:
            ax.set_xticks(x[::step], list(positions)[::step])
            ax.set_xlabel("position")
        return figure


def _title(ax: Axes, word: str, residual: Array, unit: str, remark: str = "") -> None:
    ax.set_title(rf"$\bf{{{word}}}$: {rms(residual)} {unit} rms{remark}")


def before_after(panels: Sequence[Panel]) -> Figure:
    """One row a panel: residuals before (grey squares) and after (blue dots) over the same x, with sigma as bars."""
    import matplotlib as mpl

    with mpl.rc_context(STYLE):
        figure = empty(FULL, 0.8 + 1.7 * len(panels))
        grid = figure.subplots(len(panels), 1, squeeze=False)[:, 0]
        for ax, p in zip(grid, panels, strict=True):
            few = p.x.size <= 60
            ax.plot(p.x, p.before, "s", ms=4.5 if few else 2, color="#9a9a9a", label="before", zorder=2)
            bars = p.sigma if few else None
            size = 3.2 if few else 1.8
            ax.errorbar(p.x, p.after, bars, fmt="o", ms=size, lw=0.9, color=BLUE, label="after", zorder=3)
            if p.sigma is not None and not few:
                ax.fill_between(p.x, -p.sigma, p.sigma, color=BLUE, alpha=0.12, lw=0)
            ax.axhline(0, color=INK, lw=0.6, zorder=1)
            name = p.name.replace(" ", "~").replace("_", "~")
            ax.set_title(rf"$\bf{{{name}}}$: rms {rms(p.before)} before, {rms(p.after)} {p.unit} after")
            ax.set_ylabel(f"[{p.unit}]")
            ax.set_xlabel(p.x_label)
            if few and np.array_equal(p.x, np.round(p.x)):
                ax.set_xticks(np.unique(p.x)[:: max(1, p.x.size // 20)])
        handles, words = grid[0].get_legend_handles_labels()
        figure.legend(handles, words, loc="outside upper right", ncols=2)
        return figure


def formula(latex: str) -> Figure:
    """A formula by itself. Raises ValueError where it is beyond matplotlib's mathematics."""
    import matplotlib as mpl
    from matplotlib.font_manager import FontProperties
    from matplotlib.mathtext import MathTextParser

    with mpl.rc_context({**STYLE, "mathtext.fontset": "dejavuserif"}):
        width, height, *_ = MathTextParser("path").parse(f"${latex}$", dpi=72, prop=FontProperties(size=12))
        figure = empty((width + 16) / 72, (height + 14) / 72)
        figure.text(0.5, 0.5, f"${latex}$", ha="center", va="center", fontsize=12)
        return figure


def over_time(hours: Array, curves: Sequence[Curve]) -> Figure:
    """Channels over time (n,) [h]: data with the model through them at the left, what the model leaves at the right."""
    import matplotlib as mpl

    with mpl.rc_context(STYLE):
        figure = empty(FULL, 0.9 + 1.5 * len(curves))
        grid = figure.subplots(len(curves), 2, sharex=True, squeeze=False, width_ratios=(3, 2))
        for (left, right), curve in zip(grid, curves, strict=True):
            left.plot(hours, curve.measured, ".", ms=1.8, color=GREY, label="measured", rasterized=hours.size > 4000)
            left.axhline(0, color=ORANGE, lw=0.9, ls=(0, (4, 2)), label="perfect sensors")
            left.plot(hours, curve.fitted, color=BLUE, label="calibrated model")
            left.set_ylabel(f"{curve.name}\n[{curve.unit}]")
            rest = curve.measured - curve.fitted
            right.plot(hours, rest, ".", ms=1.8, color=BLUE)
            right.axhline(0, color=INK, lw=0.6)
            right.set_title(f"rms {rms(rest)} {curve.unit}")
            if curve.sigma:
                right.axhspan(-curve.sigma, curve.sigma, color=BLUE, alpha=0.12, lw=0)
        grid[0, 0].set_title(r"$\bf{Data\ and\ model}$")
        grid[0, 1].set_title(r"$\bf{What\ is\ left}$: " + grid[0, 1].get_title(loc="left"))
        handles, words = grid[0, 0].get_legend_handles_labels()
        figure.legend(handles, words, loc="outside upper left", ncols=3, markerscale=3)
        for ax in grid[-1]:
            ax.set_xlabel("time [h]")
        return figure


def schedule(labels: Sequence[str], angles: Array, axis_names: Sequence[str], gravity: Array) -> Figure:
    """What the platform did: gimbal angles (m, k) [deg] by position, and where gravity (m, 3) lay in platform axes."""
    import matplotlib as mpl

    with mpl.rc_context(STYLE):
        figure = empty(FULL, 3.2)
        left, up, down = figure.subplots(1, 3, width_ratios=(1.55, 1, 1))
        x = np.arange(len(labels))
        moving = [i for i in range(len(axis_names)) if np.ptp(angles[:, i]) > 0] or list(range(len(axis_names)))
        for k, i in enumerate(moving):
            left.step(x, angles[:, i], where="mid", color=SERIES[k % 6], label=axis_names[i], lw=1.3)
        step = max(1, -(-len(labels) // 10))
        left.set_xticks(x[::step], list(labels)[::step])
        left.set_xlabel("position")
        left.set_ylabel("gimbal angle [deg]")
        left.set_yticks(_angle_ticks(angles))
        left.legend(loc="lower left", bbox_to_anchor=(0, 1.0), ncols=4, handlelength=1.2, columnspacing=1)
        _hemisphere(up, labels, gravity, 1)
        _hemisphere(down, labels, gravity, -1)
        return figure


def _angle_ticks(angles: Array) -> Array:
    """Multiples of 90 degrees that span the angles."""
    low, high = np.floor(angles.min() / 90), np.ceil(angles.max() / 90)
    return np.asarray(90 * np.arange(low, high + 1, max(1, (high - low) // 6)))


def _hemisphere(ax: Axes, labels: Sequence[str], gravity: Array, side: int) -> None:
    """Gravity directions with z on this side (the equator counts as +z), seen along z; positions as numbers."""
    turn = np.linspace(0, 2 * np.pi, 181)
    ax.plot(np.cos(turn), np.sin(turn), color=GREY, lw=0.8)
    for r in (0.5, np.sqrt(0.75)):
        ax.plot(r * np.cos(turn), r * np.sin(turn), color=PALE, lw=0.5)
    ax.plot([-1, 1], [0, 0], color=PALE, lw=0.5)
    ax.plot([0, 0], [-1, 1], color=PALE, lw=0.5)
    here = np.flatnonzero(gravity[:, 2] > -1e-6 if side > 0 else gravity[:, 2] <= -1e-6)
    places: dict[tuple[float, float], list[str]] = {}
    for i in here:
        places.setdefault((round(gravity[i, 0], 2) + 0.0, round(gravity[i, 1], 2) + 0.0), []).append(labels[int(i)])
    for (gx, gy), who in places.items():
        ax.plot(gx, gy, "o", ms=5, color=BLUE, zorder=3)
        ax.annotate(",".join(who[:3]) + ("…" if len(who) > 3 else ""), (gx, gy), (5, 4), textcoords="offset points",
                    fontsize=7.5)  # fmt: skip
    ax.set_title(f"gravity, {'+' if side > 0 else '−'}z side")
    ax.set_xlim(-1.15, 1.3)
    ax.set_ylim(-1.2, 1.25)
    ax.set_aspect("equal")
    ax.set_xticks([-1, 0, 1])
    ax.set_yticks([-1, 0, 1])
    ax.set_xlabel("x [g]")
    ax.set_ylabel("y [g]")
