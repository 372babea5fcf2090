"""Pictures of parameters for the report: what each stage adds, and how estimates hang together."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from gimbalcal.number import Array
from gimbalcal.report.style import GREY, HALF, INK, PALE, SERIES, STYLE, empty

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LEGEND = 85  # characters that go beside each other across a column


def sigma_by_stage(labels: Sequence[str], stages: Sequence[str], ratio: Array) -> Figure:
    """What each stage leaves of the prior sigma: ratio (stages, p), dots on a logarithmic axis, one row a parameter.

    NaN where a stage does not estimate a parameter.
    """
    import matplotlib as mpl

    with mpl.rc_context(STYLE):
        beside = sum(map(len, stages)) + 5 * len(stages) <= LEGEND
        figure = empty(HALF, 0.8 + 0.21 * len(labels) + (0 if beside else 0.2 * (len(stages) - 1)))
        ax = figure.subplots()
        y = np.arange(len(labels))[::-1]
        low, high = np.where(np.isnan(ratio), 1.0, ratio).min(axis=0), np.ones(len(labels))
        ax.hlines(y, low, high, color=PALE, lw=1.2, zorder=1)
        markers = ("o", "s", "D", "^", "v")
        for k, (stage, row) in enumerate(zip(stages, ratio, strict=True)):
            ax.plot(row, y, markers[k % 5], ms=4.2, color=SERIES[k % 6], label=stage, ls="none", zorder=3)
        ax.axvline(1, color=GREY, lw=0.8, ls=(0, (3, 2)))
        ax.text(1, len(labels) - 0.35, "prior ", ha="right", va="bottom", color=GREY, fontsize=8)
        ax.set_xscale("log")
        ax.set_yticks(y, list(labels))
        ax.tick_params(axis="y", length=0)
        ax.spines["left"].set_visible(False)
        ax.set_ylim(-0.7, len(labels) - 0.3)
        ax.set_xlabel("sigma / prior sigma (further left is better known)")
        figure.legend(loc="outside upper left", ncols=len(stages) if beside else 1, handletextpad=0.1)
        return figure


def correlation(labels: Sequence[str], matrix: Array) -> Figure:
    """Correlation matrix (p, p); strong off-diagonal values are written into their cells."""
    import matplotlib as mpl

    p = len(labels)
    with mpl.rc_context(STYLE):
        side = min(2.2 + 0.22 * p, HALF)
        figure = empty(side + 0.3, 0.92 * side)
        ax = figure.subplots()
        image = ax.pcolormesh(
            np.arange(p + 1), np.arange(p + 1), matrix, cmap="RdBu_r", vmin=-1, vmax=1, edgecolors="white", lw=0.6
        )
        letters = min(8.0, 0.6 * 72 * side / p)  # 60 % of the width of a cell is for letters, in points
        for i, j in zip(*np.nonzero(np.abs(matrix) >= 0.3), strict=True):
            if i != j:
                colour = "white" if abs(matrix[i, j]) > 0.6 else INK
                text = f"{matrix[i, j]:.1f}".replace("0.", ".").replace("1.0", "1").replace("-", "−")
                ax.text(j + 0.5, i + 0.5, text, ha="center", va="center", fontsize=0.8 * letters, color=colour)
        ax.set_xticks(np.arange(p) + 0.5, list(labels), rotation=90, fontsize=letters)
        ax.set_yticks(np.arange(p) + 0.5, list(labels), fontsize=letters)
        ax.tick_params(length=0)
        ax.invert_yaxis()
        ax.set_aspect("equal", anchor="N")
        for spine in ax.spines.values():
            spine.set_visible(False)
        bar = figure.colorbar(image, ax=ax, shrink=0.5, aspect=18, ticks=[-1, -0.5, 0, 0.5, 1])
        bar.set_label("correlation")
        bar.outline.set_visible(False)
        return figure
