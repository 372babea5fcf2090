"""How estimates hang together: the correlation matrix as cells, blue together and vermilion against each other."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

import numpy as np
from markupsafe import Markup

from gimbalcal.number import Array

SEEN = 0.1  # smaller correlations stay empty
WRITTEN = 0.3
CELL = 22.0


def correlation(labels: Sequence[str], matrix: Array) -> Markup:
    """Correlation matrix (p, p) as SVG; each cell tells its pair, strong ones are written."""
    p = len(labels)
    cell = min(CELL, 660.0 / p)
    letter = min(11.0, 0.8 * cell)
    edge = 0.56 * letter * max(map(len, labels), default=0) + 8
    parts = []
    for i, label in enumerate(labels):
        at = edge + (i + 0.5) * cell
        size = f'style="font-size:{letter:.1f}px"'
        parts.append(
            f'<text {size} x="{edge - 5:.1f}" y="{at + letter / 3:.1f}" text-anchor="end">{escape(label)}</text>'
        )
        turned = f'transform="translate({at + letter / 3:.1f} {edge - 5:.1f}) rotate(-90)"'
        parts.append(f"<text {size} {turned}>{escape(label)}</text>")
    for i, j in zip(*np.nonzero(np.abs(matrix) >= SEEN), strict=True):
        r, x, y = float(matrix[i, j]), edge + j * cell, edge + i * cell
        told = escape(f"{labels[i]} with {labels[j]}: {r:+.2f}".replace("-", "−"))
        side, strength = ("c1" if r < 0 else "c0"), min(abs(r), 1.0) * (0.35 if i == j else 0.9)
        parts.append(f'<rect class="{side}" fill-opacity="{strength:.2f}" x="{x + 0.5:.1f}" y="{y + 0.5:.1f}" '
                     f'width="{cell - 1:.1f}" height="{cell - 1:.1f}"><title>{told}</title></rect>')  # fmt: skip
        if i != j and abs(r) >= WRITTEN:
            text = f"{r:.1f}".replace("0.", ".").replace("1.0", "1").replace("-", "−")
            where = f'x="{x + cell / 2:.1f}" y="{y + cell / 2 + letter / 3:.1f}"'
            parts.append(f'<text class="in" style="font-size:{0.82 * letter:.1f}px" {where} '
                         f'text-anchor="middle">{text}</text>')  # fmt: skip
    whole = edge + p * cell + 4
    frame = f'<path class="axis" d="M{edge:.1f} {edge:.1f}h{p * cell:.1f}v{p * cell:.1f}h{-p * cell:.1f}z"/>'
    wide = f'style="max-width:{min(whole, 640):.0f}px" viewBox="0 0 {whole:.0f} {whole:.0f}"'
    return Markup(f'<svg class="matrix" {wide} aria-hidden="true">{frame}{"".join(parts)}</svg>')  # noqa: S704  escaped above
