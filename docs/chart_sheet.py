"""Write charts of the report side by side as one SVG file, for the documents."""

from __future__ import annotations

import re
from collections.abc import Sequence
from importlib.resources import files

from gimbalcal.report.chart import Chart
from gimbalcal.report.svg import WIDTH, svg

COLOURS = ("ink", "soft", "line", "c0", "c1", "c2", "c3", "c4", "c5", "grey", "pale")
GAP = 16.0  # px between charts


def style() -> str:
    """Return the style of charts with the colours of the page on paper."""
    page, charts = (
        (files("gimbalcal.report") / "templates" / name).read_text(encoding="utf-8")
        for name in ("style.css", "chart.css")
    )
    light = dict(re.findall(r"--([\w-]+): (#[0-9a-f]{6})", page.partition("@media")[0]))
    colours = " ".join(f"--{name}: {light[name]};" for name in COLOURS)
    return f"svg {{ {colours} font-family: sans-serif; }} {charts}"


def sheet(charts: Sequence[Chart], columns: int = 2) -> str:
    """Return charts side by side as an SVG file that needs no page; equal charts give equal bytes."""
    drawn = [svg(c) for c in charts]
    heights = [float(re.findall(r'viewBox="0 0 \S+ ([\d.]+)"', d)[0]) for d in drawn]
    parts, y = [], GAP / 2
    for k in range(0, len(drawn), columns):
        for i, d in enumerate(drawn[k : k + columns]):
            where = f'x="{i * (WIDTH + GAP) + GAP / 2:g}" y="{y:g}" width="{WIDTH:g}" height="{heights[k + i]:g}"'
            parts.append(d.replace("<svg ", f"<svg {where} ", 1))
        y = round(y + max(heights[k : k + columns]) + GAP / 2, 1)
    width = min(columns, len(drawn)) * (WIDTH + GAP)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:g} {y:g}" width="{width:g}" height="{y:g}">'
        f'<style>{style()}</style><rect width="100%" height="100%" style="fill:#fff"/>{"".join(parts)}</svg>\n'
    )
