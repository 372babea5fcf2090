"""Results that show themselves: their text on a console, text and figure in a notebook, and tables as data frames.

matplotlib, polars and pandas are imported when they are asked for.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from io import StringIO
from typing import TYPE_CHECKING, Any

from gimbalcal.errors import InputError
from gimbalcal.number import Array

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FRAMES = ("polars", "pandas")


class Displayed:
    """A result with a text and a figure, both of which a notebook shows."""

    def plot(self) -> Figure:
        """Return a matplotlib figure of the result. Raises InputError where nothing can be drawn."""
        raise NotImplementedError

    def __repr__(self) -> str:
        return str(self)

    def _repr_html_(self) -> str:
        try:
            picture = svg(self.plot())
        except InputError:
            picture = ""
        return f'<pre style="white-space: pre-wrap">{escape(str(self))}</pre>{picture}'


def svg(figure: Figure) -> str:
    """Return a figure as an SVG element for a page."""
    out = StringIO()
    figure.savefig(out, format="svg")
    return out.getvalue()[out.getvalue().index("<svg") :]


def panels(titles: Sequence[str], across: int = 3, width: float = 3.2, height: float = 2.1) -> tuple[Figure, list[Any]]:
    """Return a figure with a titled panel (axes) for each of `titles`, and the panels."""
    from gimbalcal.figure import NotebookFigure

    n = max(len(titles), 1)
    across = min(n, across)
    down = -(-n // across)
    figure = NotebookFigure(figsize=(width * across, height * down), layout="constrained")
    axes = list(figure.subplots(down, across, squeeze=False).ravel())
    for ax, title in zip(axes, titles, strict=False):
        ax.set_title(title, fontsize=9, loc="left")
        ax.tick_params(labelsize=8)
    for ax in axes[len(titles) :]:
        ax.set_visible(False)
    return figure, axes[: len(titles)]


def data_frame(columns: Mapping[str, Sequence[Any] | Array], kind: str, text: Sequence[str] = ()) -> Any:
    """Return columns as a data frame of polars or of pandas; `text` names those that hold strings, others hold floats.

    Raises InputError for another kind, and where pandas is not installed.
    """
    if kind not in FRAMES:
        raise InputError(f"no data frame is of kind {kind!r}; take {' or '.join(FRAMES)}")
    if kind == "pandas":
        try:
            import pandas as pd  # type: ignore[import-not-found, import-untyped, unused-ignore]
        except ImportError:
            raise InputError("pandas is not installed; take polars, or install pandas") from None
        return pd.DataFrame({n: list(x) if n in text else x for n, x in columns.items()})
    import polars as pl

    return pl.DataFrame({n: pl.Series(n, x, dtype=pl.String if n in text else pl.Float64) for n, x in columns.items()})
