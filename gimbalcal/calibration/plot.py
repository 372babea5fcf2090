"""Draw the parameters of a calibration as a plain matplotlib figure; pages draw their own charts."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from gimbalcal.display import panels

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from gimbalcal.calibration.calibration import ParameterEstimate


def plot_parameters(estimates: Sequence[ParameterEstimate]) -> Figure:
    """Return a figure with a panel for each effect: its parameters with two sigmas."""
    groups: dict[tuple[str, str], list[ParameterEstimate]] = {}
    for e in estimates:
        groups.setdefault((e.parameter.name, e.parameter.unit), []).append(e)
    figure, axes = panels([_title(own, groups.values()) for own in groups.values()])
    for ax, own in zip(axes, groups.values(), strict=True):
        at = np.arange(len(own))
        ax.errorbar(at, [e.value for e in own], [2 * e.sigma for e in own], fmt="o", ms=4, capsize=2)
        ax.axhline(0, color="0.7", lw=0.8, zorder=0)
        ax.set_xticks(at, [e.parameter.axis or e.parameter.name for e in own])
        ax.margins(x=0.15)
    return figure


def _title(own: Sequence[ParameterEstimate], groups: Iterable[Sequence[ParameterEstimate]]) -> str:
    """Return the effect, with the name of the parameter where it has several, and the unit."""
    p = own[0].parameter
    single = sum(first[0].parameter.effect == p.effect for first in groups) == 1
    title = p.effect if single or p.name == p.effect else f"{p.effect}, {p.name}"
    return f"{title.replace('_', ' ')} [{p.unit}]"
