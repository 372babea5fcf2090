"""Charts as data: marks on axes; `draw` renders them as SVG.

Colours are numbers of the palette in style.css, that of Okabe and Ito, which colour-blind readers distinguish; marks
also differ in shape and lines in dashes, for grey print.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Literal

import numpy as np

from gimbalcal.earth import SOLAR_DAY
from gimbalcal.number import Array
from gimbalcal.words.rounding import printed_number

Colour = Literal["c0", "c1", "c2", "c3", "c4", "c5", "grey", "pale", "ink"]
Shape = Literal["dot", "square", "diamond", "triangle", "ring"]
COLOURS: tuple[Colour, ...] = ("c0", "c1", "c2", "c3", "c4", "c5")
Dash = Literal["", "dashed", "dotted", "dashdot", "long", "sparse"]
DASHES: tuple[Dash, ...] = ("", "dashed", "dotted", "dashdot", "long", "sparse")
SHAPES: tuple[Shape, ...] = ("dot", "square", "diamond", "triangle")
POINTS = 600  # of a curve; more overlap on a page

BLUE, VERMILION, GREEN, ORANGE = COLOURS[:4]


@dataclass(frozen=True, eq=False)
class Points:
    """Marks at x, y (n,), with a bar of `spread` (n,) each way; `names` (n) say in words what each is."""

    x: Array
    y: Array
    colour: Colour = "c0"
    shape: Shape = "dot"
    size: float = 3.0
    spread: Array | None = None
    names: Sequence[str] = ()
    label: str = ""


@dataclass(frozen=True, eq=False)
class Line:
    """A curve through x, y (n,); `step` keeps each value until halfway to the next; `dash` is its pattern."""

    x: Array
    y: Array
    colour: Colour = "c0"
    label: str = ""
    dash: Dash = ""
    step: bool = False


@dataclass(frozen=True, eq=False)
class Band:
    """An area between `low` and `high` (n,) over x (n,)."""

    x: Array
    low: Array
    high: Array
    colour: Colour = "c0"
    label: str = ""


@dataclass(frozen=True, eq=False)
class Bars:
    """Bars from `low` to `high` (n,) at x (n,), upright, or lying where `lying`; width in units of the axis."""

    x: Array
    low: Array
    high: Array
    colour: Colour = "pale"
    width: float = 0.64
    lying: bool = False
    label: str = ""


@dataclass(frozen=True)
class Rule:
    """A straight line over the whole chart at a value of one axis."""

    at: float
    colour: Colour = "ink"
    upright: bool = False
    dashed: bool = False


@dataclass(frozen=True, eq=False)
class Words:
    """Words at x, y (n,), centred there; ones above the chart have y infinite."""

    x: Array
    y: Array
    words: Sequence[str]
    colour: Colour = "ink"


Mark = Points | Line | Band | Bars | Rule | Words


@dataclass(frozen=True, eq=False)
class Chart:
    """Marks on two axes. `x_names`, `y_names`: a word at 0, 1, ... instead of numbers; `square`: equal scales."""

    marks: tuple[Mark, ...]
    title: str = ""
    x_label: str = ""
    y_label: str = ""
    x_names: Sequence[str] = ()
    y_names: Sequence[str] = ()
    log_x: bool = False
    log_y: bool = False
    square: bool = False
    height: float = 230.0  # at a width of 440
    x_ticks: Sequence[tuple[float, str]] = ()
    bare: bool = False  # no axes


def thinning_slice(n: int) -> slice:
    """Return a slice of n rows that keeps at most `POINTS` of them."""
    return slice(None, None, max(1, -(-n // POINTS)))


def envelope(x: Array, y: Array) -> tuple[Array, Array]:
    """Return a long curve by the minimum and the maximum of each stretch, so that spikes remain visible."""
    if len(x) <= POINTS:
        return x, y
    edges = np.linspace(0, len(x), POINTS // 2 + 1).astype(int)[:-1]
    low, high = np.minimum.reduceat(y, edges), np.maximum.reduceat(y, edges)
    return np.repeat(x[edges], 2), np.stack([low, high], axis=1).ravel()


def limits(chart: Chart) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the limits of both axes: all marks and a margin, as logarithms where an axis is logarithmic."""
    xs: list[Array] = []
    ys: list[Array] = []
    for m in chart.marks:
        if isinstance(m, Rule):
            (xs if m.upright else ys).append(np.array([m.at]))
        elif isinstance(m, Band):
            xs, ys = [*xs, m.x], [*ys, m.low, m.high]
        elif isinstance(m, Bars):
            ends, at = [m.low, m.high], [m.x - m.width / 2, m.x + m.width / 2]
            xs, ys = [*xs, *(ends if m.lying else at)], [*ys, *(at if m.lying else ends)]
        else:
            xs, ys = [*xs, m.x], [*ys, m.y]
            if isinstance(m, Points) and m.spread is not None:
                ys += [m.y - m.spread, m.y + m.spread] if not chart.log_y else []
    x = _value_span(xs, chart.log_x, 0.02 if any(isinstance(m, Line) for m in chart.marks) else 0.05)
    return x, _value_span(ys, chart.log_y, 0.06)


def _value_span(values: Sequence[Array], log: bool, beyond: float) -> tuple[float, float]:
    every = np.concatenate([np.ravel(np.asarray(v, dtype=float)) for v in values]) if values else np.zeros(1)
    every = every[np.isfinite(every)]
    if log:
        every = np.log10(every[every > 0])
    low, high = (float(every.min()), float(every.max())) if every.size else (0.0, 1.0)
    wide = (high - low) or (0.0 if log else abs(high)) or 1.0
    return low - beyond * wide, high + beyond * wide


def ticks(low: float, high: float, most: int = 6) -> list[float]:
    """Return round numbers between two, in steps of 1, 2, 2.5 or 5 times a power of ten, at most `most` of them.

    >>> ticks(-0.31, 0.94)
    [-0.25, 0.0, 0.25, 0.5, 0.75]
    """
    rough = (high - low) / most
    power = 10.0 ** np.floor(np.log10(rough))
    step = float(next(s * power for s in (1, 2, 2.5, 5, 10) if s * power >= rough * (1 - 1e-9)))
    first = int(np.ceil(low / step - 1e-9))
    return [float(f"{k * step:.12g}") for k in range(first, int(np.floor(high / step + 1e-9)) + 1)]


def tick_words(values: Sequence[float]) -> list[str]:
    """Return the numbers at ticks in words; large and small ones as powers of ten.

    >>> tick_words([0.0, 0.25, 0.5]), tick_words([-20000.0, 0.0])
    (['0', '0.25', '0.5'], ['−20 000', '0'])
    """
    top = max((abs(v) for v in values), default=0.0)
    if top >= 1e6 or 0 < top < 1e-3:
        return [printed_number(f"{v:.3g}") for v in values]
    return [f"{v:,.6g}".replace(",", " ").replace("-", "−") for v in values]


def date_ticks(first: float, last: float) -> list[tuple[float, str]]:
    """Return a few dates between two days, counted since 1970, in words."""
    days = np.linspace(first, last, 4 if last - first >= 3 else 2)
    forms = ((300, "%Y-%m"), (3, "%Y-%m-%d"), (0.05, "%m-%d %H:%M"), (-1, "%H:%M:%S"))
    form = next(f for least, f in forms if last - first > least)
    return [(float(d), datetime.fromtimestamp(SOLAR_DAY * float(d), UTC).strftime(form)) for d in days]


def log_ticks(low: float, high: float) -> list[tuple[float, str]]:
    """Return powers of ten between two logarithms, with 2 and 5 between them where there are few."""
    span = high - low
    every = max(1, int(np.ceil(span / 7)))
    powers = [k for k in range(int(np.floor(low)), int(np.ceil(high)) + 1) if k % every == 0]
    parts = (1, 2, 5) if span < 2.2 else (1,)
    values = [(k + np.log10(p), p * 10.0**k) for k in powers for p in parts]
    return [(float(at), _power(v)) for at, v in values if low <= at <= high]


def _power(v: float) -> str:
    return f"{v:g}" if 1e-3 <= v < 1e5 else printed_number(f"{v:.0e}")
