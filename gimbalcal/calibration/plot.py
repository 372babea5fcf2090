"""Draw the parameters of a calibration as a plain matplotlib figure; pages draw their own charts."""

from __future__ import annotations

from collections.abc import Sequence
from io import BytesIO
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

if TYPE_CHECKING:
    from gimbalcal.calibration.calibration import ParameterEstimate


class NotebookFigure(Figure):
    """A figure that a notebook shows as a picture even where pyplot has chosen no backend."""

    def _repr_png_(self) -> bytes:
        out = BytesIO()
        self.savefig(out, format="png", dpi=100)
        return out.getvalue()


def plot_parameters(estimates: Sequence[ParameterEstimate]) -> Figure:
    """Return a figure with a panel for each effect: its parameters with two sigmas."""
    groups: dict[tuple[str, str], list[ParameterEstimate]] = {}
    for e in estimates:
        groups.setdefault((e.parameter.name, e.parameter.unit), []).append(e)
    n = max(len(groups), 1)
    across = min(n, 3)
    figure = NotebookFigure(figsize=(3.2 * across, 2.1 * -(-n // across)), layout="constrained")
    panels = figure.subplots(-(-n // across), across, squeeze=False).ravel()
    for ax, ((name, unit), own) in zip(panels, groups.items(), strict=False):
        at = np.arange(len(own))
        ax.errorbar(at, [e.value for e in own], [2 * e.sigma for e in own], fmt="o", ms=4, capsize=2)
        ax.axhline(0, color="0.7", lw=0.8, zorder=0)
        ax.set_xticks(at, [e.parameter.axis or name for e in own])
        effect = own[0].parameter.effect
        single = sum(first[0].parameter.effect == effect for first in groups.values()) == 1
        title = effect if single or name == effect else f"{effect}, {name}"
        ax.set_title(f"{title.replace('_', ' ')} [{unit}]", fontsize=9, loc="left")
        ax.margins(x=0.15)
    for ax in panels[len(groups) :]:
        ax.set_visible(False)
    return figure
