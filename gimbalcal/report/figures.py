"""Charts of data for the report: functions of arrays in printed units; every axis has its unit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from typing import TYPE_CHECKING

import numpy as np
from markupsafe import Markup

from gimbalcal.number import Array
from gimbalcal.report.chart import (
    BLUE,
    COLOURS,
    DASHES,
    ORANGE,
    SHAPES,
    VERMILION,
    Band,
    Bars,
    Chart,
    Line,
    Mark,
    Points,
    Rule,
    Words,
    thinning_slice,
)
from gimbalcal.words.rounding import rms, signed, significant

if TYPE_CHECKING:
    from gimbalcal.diagnose.result import LawCurve

OUTLIER = 3.5  # sigmas; of 54 readings, one in forty sets has one this far out by chance
MAX_BARS = 60  # points that are drawn with a bar each
MAX_BAR_RATIO = 3.0  # times the residual, or the median sigma: a longer bar is cut
MIN_DRAWN = 0.1  # smaller correlations are left blank
MIN_WRITTEN = 0.3  # correlation from which on its value is written
MAX_CELL = 22.0  # px of a correlation matrix


@dataclass(frozen=True)
class Curve:
    """One channel over time in printed units, minus the output of perfect sensors: measured, and as calibrated."""

    name: str
    unit: str
    measured: Array  # (n,)
    fitted: Array  # (n,)
    sigma: float | None = None


@dataclass(frozen=True)
class Panel:
    """Residuals (n,) of one channel over `x` in printed units, before and after something is added; one sigma (n,)."""

    name: str
    unit: str
    x: Array
    x_label: str
    before: Array
    after: Array
    sigma: Array | None = None
    names: Sequence[str] = field(default=())  # what each point is, where a number does not say it

    @property
    def changed(self) -> bool:
        """Return whether before and after differ."""
        return not np.array_equal(self.before, self.after, equal_nan=True)


def residuals_by_position(
    positions: Sequence[str], before: Array, after: Array, sigma: Array | None, axes: Sequence[str], unit: str
) -> list[Chart]:
    """Draw the residual (n, c) of each position without and with the calibration, sigma (n, c) as bars, in `unit`."""
    x = np.arange(len(positions), dtype=float)
    charts = []
    for i, axis in enumerate(axes):
        height = 118.0 if len(axes) > 1 else 210.0
        named = [f"position {p}, {axis}: {signed(b)} {unit}" for p, b in zip(positions, before[:, i], strict=True)]
        still = [f"position {p}, {axis}: {signed(a)} {unit}" for p, a in zip(positions, after[:, i], strict=True)]
        charts.append(Chart(
            (Bars(x, np.minimum(before[:, i], 0), np.maximum(before[:, i], 0), "pale"), Rule(0.0),
             Points(x, before[:, i], "grey", "square", 2.0, names=named)),
            f"{axis}, before: {rms(before[:, i])} {unit} rms", "position", f"[{unit}]", x_names=positions,
            height=height,
        ))  # fmt: skip
        bars = None if sigma is None else sigma[:, i]
        marks: list[Mark] = [Rule(0.0), Points(x, after[:, i], BLUE, size=3, spread=bars, names=still)]
        if bars is not None:
            far = np.abs(after[:, i]) > OUTLIER * bars
            marks += [Points(x[far], after[far, i], VERMILION, "ring", 6)] if far.any() else []
        remark = " (bars 1σ)" if sigma is not None else ""
        title = f"{axis}, after: {rms(after[:, i])} {unit} rms{remark}"
        charts.append(Chart(tuple(marks), title, "position", f"[{unit}]", x_names=positions, height=height))
    return charts


def before_after(panels: Sequence[Panel]) -> list[Chart]:
    """Draw residuals before (grey squares) and after (blue dots) over the same x, with sigma as bars or band.

    Where nothing was added they are equal and are drawn once.
    """
    return [_before_after(p) for p in panels]


def _before_after(p: Panel) -> Chart:
    few = p.x.size <= MAX_BARS
    size, order = (3.2 if few else 1.8), np.argsort(p.x, kind="stable")
    both = ((p.before, " before"), (p.after, " after" if p.changed else ""))
    points = [tuple(f"{n}: {signed(v)} {p.unit}{w}" for n, v in zip(p.names, y, strict=False)) for y, w in both]
    sigma = _in_view(p)
    band = [Band(p.x[order], -sigma[order], sigma[order], BLUE, "one σ")] if sigma is not None and not few else []
    first = [Points(p.x, p.before, "grey", "square", size, names=points[0], label="before")] if p.changed else []
    sizes = f"{rms(p.before)} → {rms(p.after)}" if p.changed else rms(p.after)
    return Chart(
        (*band, *first, Rule(0.0),
         Points(p.x, p.after, BLUE, "dot", size, sigma if few else None, points[1], "after" if p.changed else "")),
        f"{p.name}: {sizes} {p.unit} rms", p.x_label, f"[{p.unit}]",
    )  # fmt: skip


def _in_view(p: Panel) -> Array | None:
    """Return one sigma, cut where a few are so large that the others and the residuals would vanish."""
    if p.sigma is None:
        return None
    residual = np.abs(np.concatenate([p.before, p.after]))
    return np.minimum(
        p.sigma, max(MAX_BAR_RATIO * float(residual.max(initial=0.0)), MAX_BAR_RATIO * float(np.median(p.sigma)))
    )


def formula_over_variable(c: LawCurve, title: str, unit: str) -> Chart:
    """Draw a formula with its sigma over what it follows, and formulas that fit as well.

    About it stand partial residuals and, in each part of the domain, what it predicts if it is fitted to the others.
    """
    order = np.argsort(c.x, kind="stable")
    line = order[thinning_slice(len(order))]

    def means(v: Array) -> tuple[Array, Array]:
        shown = order[np.isfinite(v[order])]
        groups = [g for g in np.array_split(shown, min(shown.size, MAX_BARS) or 1) if g.size]
        return np.array([c.x[g].mean() for g in groups]), np.array([v[g].mean() for g in groups])

    drawn = (
        Points(*means(c.predicted), ORANGE, "square", 3.0, label="predicted from the other parts"),
        Points(*means(c.observed), "ink", size=2.4, label="observed"),
    )
    points = [p for p in drawn if len(p.x)]
    others = [Line(c.x[line], other[line], "grey", text, DASHES[k + 1]) for k, (text, other) in enumerate(c.others)]
    band = Band(c.x[line], (c.law - c.sigma)[line], (c.law + c.sigma)[line], BLUE, "one σ")
    return Chart((band, *others, Line(c.x[line], c.law[line], BLUE, "formula"), *points), title, c.x_label, f"[{unit}]")


def over_time(time: Array, curves: Sequence[Curve], unit: str = "h") -> list[Chart]:
    """Draw channels over time (n,): data with the model through them, and the residual of the model, chart by chart."""
    charts = []
    for c in curves:
        residual = c.measured - c.fitted
        charts.append(Chart(
            (Points(time, c.measured, "grey", size=1.4, label="measured"), Rule(0.0),
             Line(time, c.fitted, BLUE, "calibrated model")),
            f"{c.name}: data and model", f"time [{unit}]", f"[{c.unit}]", height=170,
        ))  # fmt: skip
        wide = [Band(time, np.full(len(time), -c.sigma), np.full(len(time), c.sigma), BLUE, "one σ")] if c.sigma else []
        charts.append(Chart(
            (*wide, Points(time, residual, BLUE, size=1.4), Rule(0.0)),
            f"{c.name}, residual: {rms(residual)} {c.unit} rms", f"time [{unit}]", f"[{c.unit}]", height=170,
        ))  # fmt: skip
    return charts


def schedule(
    labels: Sequence[str], angles: Array, axis_names: Sequence[str], gravity: Array, of: str = "platform",
    by: str = "position",
) -> list[Chart]:  # fmt: skip
    """Draw the angles (m, k) [deg] of the axes by position, and the direction of gravity (m, 3) in platform axes."""
    x = np.arange(len(labels), dtype=float)
    moving = [i for i in range(len(axis_names)) if np.ptp(angles[:, i]) > 0] or list(range(len(axis_names)))
    lines = tuple(
        Line(x, angles[:, i], COLOURS[k % 6], axis_names[i], DASHES[k % 6], step=True) for k, i in enumerate(moving)
    )
    by_position = Chart(lines, "gimbal angles" if of == "platform" else "angles of the axes", by, "[°]", x_names=labels)
    return [by_position, *(c for side in (1, -1) if (c := _hemisphere(labels, gravity, side, of, by)))]


def _hemisphere(labels: Sequence[str], gravity: Array, side: int, of: str, by: str) -> Chart | None:
    """Draw gravity directions with z on this side (the equator counts as +z), seen along z; positions as numbers."""
    here = np.flatnonzero(gravity[:, 2] > -1e-6 if side > 0 else gravity[:, 2] <= -1e-6)
    if not here.size:
        return None
    turn = np.linspace(0, 2 * np.pi, 121)
    rings: list[Mark] = [
        Line(r * np.cos(turn), r * np.sin(turn), "grey" if r == 1 else "pale") for r in (1.0, 0.5, np.sqrt(0.75))
    ]
    places: dict[tuple[float, float], list[str]] = {}
    for i in here:
        places.setdefault((round(gravity[i, 0], 2) + 0.0, round(gravity[i, 1], 2) + 0.0), []).append(labels[int(i)])
    at = np.array(list(places), dtype=float)
    who = [",".join(w[:3]) + ("…" if len(w) > 3 else "") for w in places.values()]
    every = [f"{by} {', '.join(w)}" for w in places.values()]
    marks = (*rings, Points(at[:, 0], at[:, 1], BLUE, size=4, names=every), Words(at[:, 0] + 0.1, at[:, 1] + 0.1, who))
    title = f"gravity in {of} axes, {'+' if side > 0 else '−'}z side"
    return Chart(marks, title, "x [g]", "y [g]", square=True, height=260)


def curves_by_group(x: Array, groups: Sequence[tuple[str, Sequence[tuple[str, Array]]]], x_label: str) -> list[Chart]:
    """Draw a chart for each group (title, lines by name), a colour for each line, over the same x."""
    few = thinning_slice(len(x))
    return [
        Chart(tuple(Line(x[few], np.asarray(y)[few], COLOURS[i % 6], name, DASHES[i % 6]) for i, (name, y) in
                    enumerate(lines)), title, x_label, log_y=True, height=170)
        for title, lines in groups
    ]  # fmt: skip


def tornado(names: Sequence[str], planned: Array, reduced: Array, x_label: str) -> Chart:
    """Draw bars of a size by name, symmetric about zero, the first on top; within each bar its reduced size."""
    y = np.arange(len(names), dtype=float)[::-1]
    return Chart(
        (Bars(y, -planned, planned, BLUE, 0.66, lying=True, label="as planned"),
         Bars(y, -reduced, reduced, ORANGE, 0.24, lying=True, label="with the best manoeuvre for it"),
         Rule(0.0, upright=True)),
        x_label=x_label, y_names=list(names)[::-1], height=20.0 * len(names) + 12,
    )  # fmt: skip


def sky(
    around: Array, up: Array, across: Array, along: Array, unit: str, names: Sequence[str], zenith: bool = True,
    when: str = "on the sky",
) -> Chart:  # fmt: skip
    """Draw misfits (n,) across and along the innermost axis as arrows on the sky, seen from below.

    around, up (n,) [deg]: azimuth and elevation, the zenith in the middle, or hour angle and declination, the pole
    there. The longest arrow is a sixth of the radius.
    """
    turn, a = np.linspace(0, 2 * np.pi, 121), np.deg2rad(around)
    whole = max(90.0, float((90 - up).max()))
    r = (90 - up) / whole
    x, y = -r * np.sin(a), r * np.cos(a)
    longest = float(np.hypot(across, along).max())
    size = 0.17 / max(longest, 1e-30)
    # across: along the circle of equal height; along: towards the middle
    dx, dy = size * (-across * np.cos(a) + along * np.sin(a)), size * (-across * np.sin(a) - along * np.cos(a))
    tails = np.stack([x, x + dx, np.full_like(x, np.nan)], axis=1).ravel()
    heads = np.stack([y, y + dy, np.full_like(y, np.nan)], axis=1).ravel()
    rings = [Line(k * np.cos(turn), k * np.sin(turn), "pale") for k in (1 / 3, 2 / 3)]
    words = ("N", "E", "S", "W") if zenith else ("0°", "90°", "180°", "270°")
    points = [f"{n}: {significant(v)} {unit}" for n, v in zip(names, np.hypot(across, along), strict=True)]
    return Chart(
        (*rings, Line(np.cos(turn), np.sin(turn), "grey"), Line(tails, heads, VERMILION),
         Points(x, y, BLUE, size=2, names=points),
         Words(np.array([0.0, -1.12, 0.0, 1.12]), np.array([1.1, 0.0, -1.1, 0.0]), words)),
        f"{when}, {'zenith' if zenith else 'pole'} in the middle; longest {significant(longest)} {unit}",
        square=True, height=320, bare=True,
    )  # fmt: skip


def dots_by_name(
    names: Sequence[str], series: Mapping[str, Array], x_label: str, means: str, marks: Sequence[Mark] = (),
    log: bool = True,
) -> Chart:  # fmt: skip
    """Draw values (p,) of each series by name, one row for each, the first on top; NaN where there is none.

    means: what a value is, in the words under the pointer; marks: what else is drawn, such as a rule at one.
    """
    y = np.arange(len(names), dtype=float)[::-1]
    dots = [
        Points(values, y, COLOURS[k % 6], SHAPES[k % 4], 3.6, label=label,
               names=[f"{name}: {v:.2g} {means}" for name, v in zip(names, values, strict=True)])
        for k, (label, values) in enumerate(series.items())
    ]  # fmt: skip
    return Chart((*marks, *dots), x_label=x_label, y_names=list(names)[::-1], log_x=log, height=14.0 * len(names) + 14)


AS_BEFORE = Rule(1.0, "grey", upright=True, dashed=True)  # where a sigma is as large as that of its prior


def correlation(labels: Sequence[str], matrix: Array) -> Markup:
    """Return a correlation matrix (p, p) as SVG: blue is positive, vermilion negative, strong values are written."""
    p = len(labels)
    cell = min(MAX_CELL, 660.0 / p)
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
    for i, j in zip(*np.nonzero(np.abs(matrix) >= MIN_DRAWN), strict=True):
        r, x, y = float(matrix[i, j]), edge + j * cell, edge + i * cell
        pair = escape(f"{labels[i]} with {labels[j]}: {r:+.2f}".replace("-", "−"))
        side, strength = ("c1" if r < 0 else "c0"), min(abs(r), 1.0) * (0.35 if i == j else 0.9)
        box = f'x="{x + 0.5:.1f}" y="{y + 0.5:.1f}" width="{cell - 1:.1f}" height="{cell - 1:.1f}"'
        parts.append(f'<rect class="{side}" fill-opacity="{strength:.2f}" {box}><title>{pair}</title></rect>')
        if i != j and abs(r) >= MIN_WRITTEN:
            text = f"{r:.1f}".replace("0.", ".").replace("1.0", "1").replace("-", "−")
            where = f'x="{x + cell / 2:.1f}" y="{y + cell / 2 + letter / 3:.1f}"'
            parts.append(
                f'<text class="in" style="font-size:{0.82 * letter:.1f}px" {where} text-anchor="middle">{text}</text>'
            )
    whole = edge + p * cell + 4
    frame = f'<path class="axis" d="M{edge:.1f} {edge:.1f}h{p * cell:.1f}v{p * cell:.1f}h{-p * cell:.1f}z"/>'
    wide = f'style="max-width:{min(whole, 640):.0f}px" viewBox="0 0 {whole:.0f} {whole:.0f}"'
    return Markup(f'<svg class="matrix" {wide} aria-hidden="true">{frame}{"".join(parts)}</svg>')  # noqa: S704  escaped above
