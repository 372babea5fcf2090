"""Render a chart as SVG inside the page, with the letters and colours of the page, on a phone and in the dark.

The limits of the axes are data attributes, from which page.js computes the values under the pointer. Equal charts give
equal text.

Notebooks, `.plot()` and documents are drawn by matplotlib. A page is not: two thirds of the processor time of
`gimbalcal calibrate` went into it (3.2 s against 1.0 s, the 18 positions that ship), pages were five times as large
(507 kB against 99 kB), and its letters neither follow the page nor say what is under the pointer.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from html import escape

import numpy as np

from gimbalcal.number import Array
from gimbalcal.report.chart import (
    Band,
    Bars,
    Chart,
    Line,
    Points,
    Rule,
    Words,
    limits,
    log_ticks,
    tick_words,
    ticks,
)

WIDTH = 440.0
LETTER = 6.8  # width of a letter of 12 px, about, in the widest of the page's letters


To = Callable[[Array], Array]


def svg(chart: Chart) -> str:
    """Return the chart as an SVG element."""
    (x0, x1), (y0, y1) = limits(chart)
    across, up = ([], []) if chart.bare else (_ticks(chart, x0, x1, True), _ticks(chart, y0, y1, False))
    left = 14 + LETTER * max((len(w) for _, w in up), default=0) + (16 if chart.y_label else 0)
    legend = _legend(chart, left)
    crossed = _labels_are_vertical(across, WIDTH - left)
    foot = (max((len(w) for _, w in across), default=0) * LETTER if crossed else 16) + (20 if chart.x_label else 6)
    top = 6 + (18 if chart.title else 0) + legend[1] + (10 if any(isinstance(m, Words) for m in chart.marks) else 0)
    wide, high = WIDTH - left - 10, chart.height
    if chart.square:
        scale = min(wide / (x1 - x0), high / (y1 - y0))
        wide, high = scale * (x1 - x0), scale * (y1 - y0)

    def px(x: Array) -> Array:
        return np.asarray(left + wide * ((np.log10(x) if chart.log_x else np.asarray(x, float)) - x0) / (x1 - x0))

    def py(y: Array) -> Array:
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(top + high * (y1 - (np.log10(y) if chart.log_y else np.asarray(y, float))) / (y1 - y0))

    frame = (left, top, wide, high)
    parts = [
        *(
            [f'<text class="title" x="{_n(left)}" y="14">{escape(_fitted(chart.title, WIDTH - left, 7.4))}</text>']
            if chart.title
            else []
        ),
        *legend[0],
        *([] if chart.bare else _axes(chart, frame, across, up, crossed, (x0, x1, y0, y1))),
        *(part for m in chart.marks for part in _mark(m, px, py, frame)),
    ]
    data = " ".join(f"{v:.9g}" for v in (x0, x1, y0, y1, left, top, wide, high, chart.log_x, chart.log_y))
    body = "".join(parts)
    words = escape(f"{chart.x_label}|{chart.y_label}", quote=True)
    return (
        f'<svg viewBox="0 0 {WIDTH:g} {_n(top + high + foot)}" data-axes="{data}" data-words="{words}" '
        f'aria-hidden="true">{body}</svg>'
    )


def _n(v: float) -> str:
    return f"{v:.1f}".removesuffix(".0")


def _ticks(chart: Chart, low: float, high: float, across: bool) -> list[tuple[float, str]]:
    names, log = (chart.x_names, chart.log_x) if across else (chart.y_names, chart.log_y)
    if across and chart.x_ticks:
        return [(at, word) for at, word in chart.x_ticks if low <= at <= high]
    if names:
        # as many as fit
        room = (WIDTH - 60) / (LETTER * (max(map(len, names)) + 1.5)) if across else chart.height / 9
        every = max(1, int(np.ceil(len(names) / room))) if not across or max(map(len, names)) < 6 else 1
        return [(float(i), names[i]) for i in range(0, len(names), every)]
    if log:
        return log_ticks(low, high)
    most = 6 if across else max(2, int(chart.height / 36))
    values = next(v for k in range(most, 20) if len(v := ticks(low, high, k)) > 1)  # one alone gives no scale
    return list(zip(values, tick_words(values), strict=True))


def _labels_are_vertical(across: Sequence[tuple[float, str]], wide: float) -> bool:
    """Return whether words under the chart have to be vertical."""
    return sum(len(w) + 1.5 for _, w in across) * LETTER > wide


def _fitted(words: str, room: float, letter: float = LETTER) -> str:
    """Return words, cut where they would leave the picture."""
    most = int(room / letter)
    return words if len(words) <= most else f"{words[: most - 1].rstrip()}…"


def _axes(
    chart: Chart, frame: tuple[float, ...], across: Sequence[tuple[float, str]], up: Sequence[tuple[float, str]],
    crossed: bool, span: tuple[float, ...],
) -> Iterable[str]:  # fmt: skip
    left, top, wide, high = frame
    x0, x1, y0, y1 = span
    floor = top + high
    yield f'<path class="axis" d="M{_n(left)} {_n(top)}V{_n(floor)}H{_n(left + wide)}"/>'
    for at, word in up:
        y = top + high * (y1 - at) / (y1 - y0)
        yield f'<path class="grid" d="M{_n(left)} {_n(y)}h{_n(wide)}"/>'
        yield f'<text x="{_n(left - 5)}" y="{_n(y + 4)}" text-anchor="end">{escape(word)}</text>'
    for at, word in across:
        x = left + wide * (at - x0) / (x1 - x0)
        if crossed:
            where = f'transform="translate({_n(x + 4)} {_n(floor + 6)}) rotate(-90)" text-anchor="end"'
            yield f"<text {where}>{escape(word)}</text>"
        else:
            half = LETTER * len(word) / 2  # the last word ends with the picture
            at_x, anchor = (x, "middle") if x + half < WIDTH else (WIDTH, "end")
            yield f'<text x="{_n(at_x)}" y="{_n(floor + 15)}" text-anchor="{anchor}">{escape(word)}</text>'
    if chart.x_label:
        low = floor + (max((len(w) for _, w in across), default=0) * LETTER if crossed else 16) + 15
        middle = min(left + wide / 2, WIDTH - LETTER * len(chart.x_label) / 2)
        yield f'<text x="{_n(middle)}" y="{_n(low)}" text-anchor="middle">{escape(chart.x_label)}</text>'
    if chart.y_label:
        where = f'transform="translate(12 {_n(top + high / 2)}) rotate(-90)" text-anchor="middle"'
        yield f"<text {where}>{escape(chart.y_label)}</text>"


def _legend(chart: Chart, left: float) -> tuple[list[str], float]:
    """Return the names of marks under the title, in as many lines as needed, and their height."""
    named = [m for m in chart.marks if not isinstance(m, (Rule, Words)) and m.label]
    if any(left + 34 + LETTER * len(m.label) > WIDTH for m in named):
        left = 4.0  # long names of an axis leave no room for long labels
    parts: list[str] = []
    y, x = (34.0 if chart.title else 16.0), left
    for m in named:
        wide = 22 if isinstance(m, Line) else 14
        label = _fitted(m.label, WIDTH - left - wide - 12)
        long = wide + 12 + LETTER * (len(label) + 1)
        if x > left and x + long > WIDTH:
            x, y = left, y + 16
        at = f"{_n(x + 7)}", f"{_n(y - 4)}"
        if isinstance(m, Points):
            parts.append(_shape(m.shape, x + 7, y - 4, min(m.size + 0.5, 4), m.colour, ""))
        elif isinstance(m, Line):
            parts.append(f'<path class="{_classes("line", m.colour, m.dash)}" d="M{_n(x)} {at[1]}h22"/>')
        else:
            kind = "band" if isinstance(m, Band) else "column"
            parts.append(f'<rect class="{kind} {m.colour}" x="{_n(x)}" y="{_n(y - 9)}" width="14" height="9"/>')
        parts.append(f'<text x="{_n(x + wide + 4)}" y="{_n(y)}">{escape(label)}</text>')
        x += long
    return parts, (y - (18.0 if chart.title else 0.0) if named else 0.0)


def _mark(m: object, px: To, py: To, frame: tuple[float, ...]) -> Iterable[str]:
    left, top, wide, high = frame
    if isinstance(m, Rule):
        where = f"M{_n(float(px(np.array(m.at))))} {_n(top)}v{_n(high)}" if m.upright else (
            f"M{_n(left)} {_n(float(py(np.array(m.at))))}h{_n(wide)}")  # fmt: skip
        yield f'<path class="{_classes("rule", m.colour, "dashed" if m.dashed else "")}" d="{where}"/>'
    elif isinstance(m, Words):
        free = -np.inf
        for x, y, word in zip(px(m.x), m.y, m.words, strict=True):
            if np.isinf(y) and x - LETTER * len(word) / 2 < free:
                continue  # above the chart words form a line: those without room are omitted
            free = x + LETTER * (len(word) / 2 + 0.5) if np.isinf(y) else free
            at = top - 3 if np.isinf(y) else float(py(np.array(y))) + 4
            small = ' class="small"' if len(m.words) > 14 else ""
            yield f'<text{small} x="{_n(x)}" y="{_n(at)}" text-anchor="middle">{escape(word)}</text>'
    elif isinstance(m, Bars):
        yield from _bars(m, px, py)
    elif isinstance(m, Band):
        x, low, high_ = px(m.x), py(m.low), py(m.high)
        there = _svg_path(x, low) + _svg_path(x[::-1], high_[::-1]).replace("M", "L", 1) + "Z"
        yield f'<path class="band {m.colour}" d="{there}"/>'
    elif isinstance(m, Line):
        x, y = px(m.x), py(m.y)
        if m.step and x.size > 1:
            edge = np.concatenate([[x[0]], (x[1:] + x[:-1]) / 2, [x[-1]]])
            x, y = np.repeat(edge, 2)[1:-1], np.repeat(y, 2)
        name = f' data-name="{escape(m.label, quote=True)}"' if m.label else ""
        yield f'<path class="{_classes("line", m.colour, m.dash)}"{name} d="{_svg_path(x, y)}"/>'
    elif isinstance(m, Points):
        yield from _points(m, px, py, frame)


def _classes(*names: str) -> str:
    return " ".join(filter(None, names))


def _bars(m: Bars, px: To, py: To) -> Iterable[str]:
    half = m.width / 2
    for at, low, high in zip(m.x, m.low, m.high, strict=True):
        ends = (px(np.array([low, high])), py(np.array([at - half, at + half]))) if m.lying else (
            px(np.array([at - half, at + half])), py(np.array([low, high])))  # fmt: skip
        (a, b), (c, d) = (np.sort(e) for e in ends)
        yield f'<rect class="column {m.colour}" x="{_n(a)}" y="{_n(c)}" width="{_n(b - a)}" height="{_n(d - c)}"/>'


def _points(m: Points, px: To, py: To, frame: tuple[float, ...]) -> Iterable[str]:
    X, Y = px(m.x), py(m.y)
    if m.spread is not None:
        with np.errstate(invalid="ignore"):
            low, high = (np.clip(py(v), frame[1], frame[1] + frame[3]) for v in (m.y - m.spread, m.y + m.spread))
        ok = np.isfinite(low) & np.isfinite(high)
        bars = "".join(f"M{_n(x)} {_n(a)}V{_n(b)}" for x, a, b in zip(X[ok], low[ok], high[ok], strict=True))
        yield f'<path class="whisker {m.colour}" d="{bars}"/>'
    label = f' data-name="{escape(m.label, quote=True)}"' if m.label else ""
    yield f"<g{label}>"
    for i, (x, y) in enumerate(zip(X, Y, strict=True)):
        if np.isfinite(x) and np.isfinite(y):
            yield _shape(m.shape, x, y, m.size, m.colour, m.names[i] if m.names else "")
    yield "</g>"


def _shape(shape: str, x: float, y: float, r: float, colour: str, name: str) -> str:
    inside = f"><title>{escape(name)}</title></" if name else ""
    if shape in ("dot", "ring"):
        kind, hollow = "circle", " ring" if shape == "ring" else ""
        start = f'<circle class="{colour}{hollow}" cx="{_n(x)}" cy="{_n(y)}" r="{_n(r)}"'
    elif shape == "square":
        kind = "rect"
        start = f'<rect class="{colour}" x="{_n(x - r)}" y="{_n(y - r)}" width="{_n(2 * r)}" height="{_n(2 * r)}"'
    else:
        kind, s = "path", r * 1.35
        d = f"l{_n(s)} {_n(s)}l{_n(-s)} {_n(s)}l{_n(-s)} {_n(-s)}z" if shape == "diamond" else (
            f"l{_n(s)} {_n(1.8 * s)}h{_n(-2 * s)}z")  # fmt: skip
        start = f'<path class="{colour}" d="M{_n(x)} {_n(y - s)}{d}"'
    return f"{start}{inside}{kind}>" if inside else f"{start}/>"


def _svg_path(x: Array, y: Array) -> str:
    """Return a path through points, interrupted where one is not finite."""
    out, pen = [], "M"
    for a, b in zip(x, y, strict=True):
        if np.isfinite(a) and np.isfinite(b):
            out.append(f"{pen}{_n(a)} {_n(b)}")
            pen = "L"
        else:
            pen = "M"
    return "".join(out)
