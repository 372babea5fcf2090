"""The look of matplotlib pictures in the documents (pages draw their own), and a picture as SVG.

Colours are those of Okabe and Ito, told apart by colour-blind readers and in grey print.
"""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure

BLUE, VERMILION, GREEN, ORANGE = "#0072B2", "#D55E00", "#009E73", "#E69F00"
INK, GREY, PALE = "#222222", "#7a7a7a", "#d9d9d9"

STYLE: Any = {
    "font.size": 8.5,
    "axes.titlesize": 9,
    "axes.titlelocation": "left",
    "axes.labelsize": 8.5,
    "axes.edgecolor": GREY,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.unicode_minus": True,
    "xtick.color": GREY,
    "ytick.color": GREY,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
    "text.color": INK,
    "axes.labelcolor": INK,
    "legend.frameon": False,
    "legend.fontsize": 8,
    "lines.linewidth": 1.1,
    "svg.fonttype": "path",  # the same letters on every machine
    "svg.hashsalt": "gimbalcal",  # the same bytes for the same picture
}


def svg(figure: Figure) -> bytes:
    """The figure as SVG; equal arrays give equal bytes."""
    import matplotlib as mpl
    from matplotlib.backends.backend_svg import FigureCanvasSVG

    out = io.BytesIO()
    with mpl.rc_context(STYLE):
        # Figure.savefig draws twice, once with no ink, for what the SVG of a whole figure does not need
        FigureCanvasSVG(figure).print_svg(out, metadata={"Date": None, "Creator": None})
    return out.getvalue()


def empty(width: float, height: float) -> Figure:
    """An empty figure [inch]; the global state of pyplot is not touched."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained", facecolor="white")
