"""A matplotlib figure that shows itself as the result of a notebook's cell, whether or not pyplot was loaded."""

from __future__ import annotations

from io import BytesIO

from matplotlib.figure import Figure


class Shown(Figure):
    """A figure; a notebook shows a plain one as a picture only where pyplot has chosen a backend before."""

    def _repr_png_(self) -> bytes:
        out = BytesIO()
        self.savefig(out, format="png", dpi=100)
        return out.getvalue()
