"""Draw frames and axes of the platforms, and how to record: pictures/frames_*.svg, pictures/record_*.svg.

    python docs/draw_frames.py

Attitudes are those of `gimbalcal.platform`, so that a drawing shows what the program computes. All vectors are north,
east, down.
"""

from __future__ import annotations

import io
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

from gimbalcal.importers.tpoint import equatorial
from gimbalcal.number import Array
from gimbalcal.platform import KNOWN, SPACE_STABLE
from gimbalcal.schedule.published import EIGHTEEN_POSITIONS

# colours of Okabe and Ito, which colour-blind readers and grey print distinguish
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
    """Return the figure as SVG; equal arrays give equal bytes."""
    out = io.BytesIO()
    with mpl.rc_context(STYLE):
        # Figure.savefig draws twice, once with no ink, for what the SVG of a whole figure does not need
        FigureCanvasSVG(figure).print_svg(out, metadata={"Date": None, "Creator": None})
    return out.getvalue()


def empty(width: float, height: float) -> Figure:
    """Return an empty figure [inch] without touching the global state of pyplot."""
    return Figure(figsize=(width, height), layout="constrained", facecolor="white")


PICTURES = Path(__file__).parent / "pictures"
COLOURS = {"x": BLUE, "y": GREEN, "z": VERMILION}
DOWN, UP = np.array([0, 0, 1.0]), np.array([0, 0, -1.0])
EYE = (np.radians(30), np.radians(24))  # the camera looks north, 30 deg to the east, and down


def seen(points: Array, eye: tuple[float, float] = EYE) -> Array:
    """Points (..., 3), north, east, down, on paper (..., 2): a parallel projection."""
    a, e = eye
    right = np.array([-np.sin(a), np.cos(a), 0])
    up = np.array([np.cos(a) * np.sin(e), np.sin(a) * np.sin(e), -np.cos(e)])
    return np.stack([np.asarray(points) @ right, np.asarray(points) @ up], axis=-1)


def arrow(ax: Axes, start: Array, end: Array, words: str = "", colour: str = INK, width: float = 1.6) -> None:
    """An arrow in space, with a word at its tip."""
    (x0, y0), (x1, y1) = seen(np.asarray(start, float)), seen(np.asarray(end, float))
    style = {"arrowstyle": "-|>", "color": colour, "lw": width, "shrinkA": 0, "shrinkB": 0}
    ax.annotate("", (x1, y1), (x0, y0), arrowprops=style, zorder=4)
    ax.plot([x0, x1], [y0, y1], alpha=0)  # an arrow by itself does not widen the picture
    if words:
        length = np.hypot(x1 - x0, y1 - y0) or 1
        say(ax, (x1 + 0.13 * (x1 - x0) / length, y1 + 0.13 * (y1 - y0) / length), words, colour)


def say(ax: Axes, place: Sequence[float] | Array, words: str, colour: str = INK) -> None:
    """A word at a place on paper, on white."""
    ax.plot(*place, "o", ms=16, alpha=0)
    ax.text(*place, words, ha="center", va="center", fontsize=8.5, color=colour, zorder=6,
            bbox={"fc": "white", "ec": "none", "pad": 0.8, "alpha": 0.85})  # fmt: skip


def circle(
    ax: Axes, normal: Array, radius: float, colour: str = GREY, width: float = 1.0, about: Array | None = None,
    part: tuple[float, float] = (0, 2 * np.pi), begin: Array | None = None, turn: bool = False,
) -> None:  # fmt: skip
    """A circle in space about `normal`; with `turn` an arc from `begin` with an arrow in the right-handed sense."""
    n = np.asarray(normal, float) / np.linalg.norm(normal)
    one = np.cross(n, [0.3, 0.5, 0.8]) if begin is None else np.asarray(begin, float) - n * (n @ begin)
    one = one / np.linalg.norm(one)
    t = np.linspace(*part, 121)[:, None]
    path = seen((0 if about is None else about) + radius * (np.cos(t) * one + np.sin(t) * np.cross(n, one)))
    ax.plot(path[:, 0], path[:, 1], color=colour, lw=width, zorder=2, solid_capstyle="round")
    if turn:
        style = {"arrowstyle": "-|>", "color": colour, "lw": width, "shrinkA": 0, "shrinkB": 0}
        ax.annotate("", path[-1], path[-6], arrowprops=style, zorder=4)


def triad(ax: Axes, attitude: Array, at: Array | None = None, size: float = 1.0, names: str = "xyz") -> None:
    """The axes of a frame whose rows are `attitude` (3, 3), components north, east, down."""
    origin = np.zeros(3) if at is None else at
    for axis, name, row in zip("xyz", names, attitude, strict=True):
        arrow(ax, origin, origin + size * row, name, COLOURS[axis], 1.9)


def box(ax: Axes, attitude: Array, at: Array, size: Sequence[float] = (0.42, 0.3, 0.16)) -> None:
    """A block whose edges lie along the rows of `attitude`."""
    corner = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)])
    points = at + (corner * size) @ attitude
    camera = np.array([np.cos(EYE[0]) * np.cos(EYE[1]), np.sin(EYE[0]) * np.cos(EYE[1]), np.sin(EYE[1])])
    for axis in range(3):
        for side in (-1, 1):
            if side * attitude[axis] @ camera < 0:  # turned towards the eye
                face = points[corner[:, axis] == side][[0, 1, 3, 2]]
                xy = seen(face)
                ax.fill(xy[:, 0], xy[:, 1], facecolor=("#f4f4f4", "#e6e6e6", "#d6d6d6")[axis], edgecolor=GREY, lw=0.8,
                        zorder=1)  # fmt: skip


def sheet(width: float, height: float, panels: int = 1) -> tuple[Figure, list[Axes]]:
    """Empty panels of equal scale without axes."""
    figure = empty(width, height)
    panes = figure.subplots(1, panels, squeeze=False)[0]
    for ax in panes:
        ax.set_aspect("equal")
        ax.axis("off")
    return figure, list(panes)


def compass(ax: Axes, at: Array, size: float = 0.45) -> None:
    """North, east and down, small and grey."""
    for row, word in zip(np.eye(3), ("north", "east", "down"), strict=True):
        arrow(ax, at, at + size * row, word, GREY, 0.9)


def bench() -> Figure:
    """A unit on a bench: what the accelerometers read at rest, and the sense of the rates."""
    figure, (left, right) = sheet(9.2, 3.9, 2)
    for ax, title, attitude in (
        (left, "z down: f = (0, 0, −g)", np.eye(3)),
        (right, "x up: f = (g, 0, 0)", KNOWN["alt-az"].attitude([np.pi / 2, 0])),
    ):
        box(ax, attitude, np.zeros(3))
        triad(ax, attitude, size=0.95)
        arrow(ax, [0.9, 0.9, -0.2], [0.9, 0.9, 0.6], "gravity g", INK)
        arrow(ax, [-0.5, 1.5, 0.6], [-0.5, 1.5, -0.2], "f = a − g", ORANGE)
        ax.set_title(title)
    for axis, row in zip("xyz", np.eye(3), strict=True):
        circle(left, row, 0.17, COLOURS[axis], 1.2, 0.6 * row, (0.6, 5.6), turn=True)
    compass(left, np.array([-0.6, -1.6, 0.3]))
    return figure


def gimbals() -> Figure:
    """The four gimbals of the space-stable platform at zero readouts, from the base inwards."""
    figure, (left, right) = sheet(9.2, 5.2, 2)
    e = np.eye(3)
    rings = (("z", e[0], 1.62), ("y", e[2], 1.3), ("x", e[1], 0.98))  # outer, middle, inner
    for axis, normal, radius in rings:
        circle(left, normal, radius, INK, 1.4)
        row = e["xyz".index(axis)]
        for side in (-1, 1):
            start, end = side * (radius + 0.24) * row, side * radius * row
            left.plot(*seen(np.array([start, end])).T, color=COLOURS[axis], lw=3, zorder=3)
    left.plot(*seen(np.array([e[2] * 0.66, e[2] * 0.98])).T, color=VERMILION, lw=3, zorder=3)
    left.plot(*seen(np.array([-e[2] * 0.66, -e[2] * 0.98])).T, color=VERMILION, lw=3, zorder=3)
    circle(left, e[2], 0.66, GREY, 1.4)
    triad(left, e, size=0.6)
    named = {
        "outer gimbal\nabout z, to the base": [0, 0, -2.2],
        "middle, about y": [0, 2.0, 0.05],
        "inner, about x": [1.62, -0.4, -0.05],
        "platform, about z": [0.3, -0.62, 0.62],
    }
    for words, place in named.items():
        say(left, seen(np.array(place)), words)
    left.set_title("the chain, all readouts 0: x north, y east, z down")
    right.set_title("positions 1, 3, 5, 7 of Wu et al. (2018) and where gravity is")
    for k, (number, place) in enumerate(zip((1, 3, 5, 7), ((0, 0), (0, 2.6), (0, 0), (0, 2.6)), strict=True)):
        at = np.array([place[0], place[1], 0.0 if k < 2 else 2.9])
        C = SPACE_STABLE.attitude(EIGHTEEN_POSITIONS.holds[number - 1].angles)
        box(right, C, at)
        triad(right, C, at, 0.85)
        arrow(right, at + 0.95 * e[1] - 0.35 * DOWN, at + 0.95 * e[1] + 0.25 * DOWN, "g", INK, 1.1)
        g = np.round(C @ DOWN).astype(int) + 0
        say(right, seen(at + 1.3 * DOWN), f"{number}: gravity = ({g[0]}, {g[1]}, {g[2]}) g")
    return figure


def static_run() -> Figure:
    """The same platform left alone in inertial space: the Earth turns, the platform does not."""
    figure, (left, right) = sheet(9.2, 4.6, 2)
    L = np.radians(40)
    _earth(left, L)
    x, y, z = np.diag([1.0, -1.0, -1.0])  # of the platform: z to the pole
    begin = np.radians(105)
    for hours, colour in ((0, INK), (6, ORANGE)):
        s = np.radians(15 * hours) + begin
        up = np.cos(s) * np.cos(L) * x + np.sin(s) * np.cos(L) * y + np.sin(L) * z
        arrow(left, up, 1.42 * up, f"{hours} h: f", colour)
        for axis, row in zip("xyz", (x, y, z), strict=True):
            arrow(left, up, up + 0.34 * row, "", COLOURS[axis], 1.5)
    left.set_title("seen from outside: the axes of the platform keep their directions")
    right.set_aspect("auto")
    right.axis("on")
    t = np.linspace(0, 24, 200)
    S = begin + 2 * np.pi * t / 23.934
    for axis, f in zip("xyz", (np.cos(S) * np.cos(L), np.sin(S) * np.cos(L), np.full_like(t, np.sin(L))), strict=True):
        right.plot(t, f, color=COLOURS[axis], lw=1.6)
        right.text(t[-1] + 0.4, f[-1], axis, color=COLOURS[axis], va="center")
    right.set_xlabel("time [h]")
    right.set_ylabel("ideal force [g]")
    right.set_xticks([0, 6, 12, 18, 24])
    right.set_title("f/g = (cos St cos L, sin St cos L, sin L), L = 40°")
    return figure


def _earth(ax: Axes, latitude: float) -> None:
    """A globe with its axis, equator and one parallel."""
    outline = np.linspace(0, 2 * np.pi, 181)
    ax.plot(np.cos(outline), np.sin(outline), color=GREY, lw=1)
    circle(ax, DOWN, 1.0, PALE)
    circle(ax, DOWN, np.cos(latitude), GREY, 0.9, UP * np.sin(latitude))
    arrow(ax, UP, 1.6 * UP, "pole", GREY, 1.2)
    circle(ax, UP, 0.16, INK, 1.2, 1.3 * UP, (0.5, 5.8), turn=True)


def altaz() -> Figure:
    """Azimuth from north through east, elevation from the horizon up."""
    figure, (ax,) = sheet(5.9, 4.3)
    e = np.eye(3)
    azimuth, elevation = np.radians(62), np.radians(42)
    tube = KNOWN["alt-az"].attitude([elevation, azimuth])[0]
    level = KNOWN["alt-az"].attitude([0.0, azimuth])[0]
    circle(ax, DOWN, 1.0, PALE)
    for row, word in ((e[0], "north"), (e[1], "east")):
        arrow(ax, 0 * row, 1.12 * row, word, GREY, 1.2)
    arrow(ax, 0 * UP, 1.15 * UP, "zenith", GREY, 1.2)
    circle(ax, DOWN, 0.62, BLUE, 1.8, part=(0, azimuth), begin=e[0], turn=True)
    y = KNOWN["alt-az"].attitude([0.0, azimuth])[1]
    circle(ax, y, 0.8, VERMILION, 1.8, part=(0, elevation), begin=level, turn=True)
    ax.plot(*seen(np.array([0 * level, level])).T, color=GREY, lw=0.9, ls=(0, (4, 3)))
    arrow(ax, -0.25 * tube, 1.25 * tube, "line of sight, x", INK, 2.4)
    arrow(ax, 0 * y, 0.5 * y, "y: elevation axis", GREEN)
    _between(ax, 0.5, e[0], level, "azimuth", BLUE)
    _between(ax, 0.98, level, tube, "elevation", VERMILION)
    return figure


def equatorial_mount() -> Figure:
    """Hour angle about the polar axis, westwards from the meridian; declination from the equator to the pole."""
    figure, (ax,) = sheet(5.9, 4.6)
    L, hour, declination = np.radians(50), np.radians(-48), np.radians(35)
    mount = equatorial(float(L))

    def sight(d: float, h: float) -> Array:
        return np.asarray(mount.attitude([d, h, 0.0])[0])

    pole = sight(np.pi / 2, 0.0)
    e = np.eye(3)
    circle(ax, DOWN, 1.0, PALE)
    for row, word in ((e[0], "north"), (e[1], "east"), (-e[0], "south")):
        arrow(ax, 0 * row, 1.1 * row, word, GREY, 1.0)
    arrow(ax, 0 * pole, 1.3 * pole, "pole: polar axis", INK, 2.0)
    circle(ax, pole, 1.0, PALE, 1.2)
    say(ax, 1.08 * seen(sight(0.0, float(np.radians(70)))), "equator", GREY)
    turn = -1 if np.cross(sight(0.0, 0.0), sight(0.0, 0.3)) @ pole < 0 else 1
    start, end = sight(0.0, 0.0), sight(0.0, float(hour))
    sense = pole * turn * np.sign(hour)
    circle(ax, sense, 0.72, BLUE, 1.8, part=(0, abs(hour)), begin=start, turn=True)
    tube = sight(float(declination), float(hour))
    circle(ax, np.cross(end, tube), 0.85, VERMILION, 1.8, part=(0, declination), begin=end, turn=True)
    for row in (start, end):
        ax.plot(*seen(np.array([0 * row, row])).T, color=GREY, lw=0.9, ls=(0, (4, 3)))
    say(ax, 1.1 * seen(start), "meridian", GREY)
    arrow(ax, -0.2 * tube, 1.3 * tube, "line of sight, x", INK, 2.4)
    _between(ax, 0.55, start, end, "hour angle (negative: east)", BLUE)
    _between(ax, 1.02, end, tube, "declination", VERMILION)
    return figure


def _between(ax: Axes, radius: float, one: Array, other: Array, words: str, colour: str) -> None:
    middle = (one + other) / np.linalg.norm(one + other)
    say(ax, seen(radius * middle), words, colour)


def attitudes() -> Figure:
    """Twelve attitudes of a box that are enough: six faces, six edges."""
    figure, (ax,) = sheet(9.2, 5.0)
    euler = ((0, 0), (180, 0), (90, 0), (-90, 0), (0, 90), (0, -90),
             (45, 0), (135, 0), (-45, 0), (-135, 0), (0, 45), (0, -45))  # fmt: skip
    words = ("z down", "z up", "y down", "y up", "x up", "x down", *["on an edge"] * 6)
    for k, ((roll, pitch), word) in enumerate(zip(euler, words, strict=True)):
        right, down = 2.3 * (k % 6), 3.0 * (k // 6)
        at = np.array([-np.sin(EYE[0]), np.cos(EYE[0]), 0]) * right + DOWN * down
        C = _rx(np.radians(roll)) @ _ry(np.radians(pitch))
        box(ax, C, at, (0.5, 0.36, 0.2))
        triad(ax, C, at, 0.78)
        say(ax, seen(at) - np.array([0, 1.25]), f"{k + 1}: {word}")
    return figure


def _rx(a: float) -> Array:
    return np.array([[1, 0, 0], [0, np.cos(a), np.sin(a)], [0, -np.sin(a), np.cos(a)]])


def _ry(a: float) -> Array:
    return np.array([[np.cos(a), 0, -np.sin(a)], [0, 1, 0], [np.sin(a), 0, np.cos(a)]])


def timeline() -> Figure:
    """What a good recording looks like over time: warm, still, turn, still."""
    figure = empty(9.2, 2.5)
    ax = figure.subplots()
    rng = np.random.default_rng(4)
    t = np.arange(0, 62, 0.05)
    levels, begins = (0.0, -0.98, 0.7, 0.98, -0.7, 0.0), (0, 20, 30, 40, 50, 62)
    f = np.select([t < end for end in begins[1:]], levels[:5], levels[5]) + 0.012 * rng.standard_normal(len(t))
    for begin in begins[1:5]:
        turning = np.abs(t - begin) < 1.3
        f[turning] += 0.35 * np.sin(6 * (t[turning] - begin)) + 0.12 * rng.standard_normal(turning.sum())
    ax.plot(t, f, color=BLUE, lw=0.7)
    for begin, end in zip((0, *(b + 1.6 for b in begins[1:5])), (b - 1.6 for b in begins[1:]), strict=True):
        ax.axvspan(begin, end, color=GREEN, alpha=0.12, lw=0)
    ax.text(10, 1.22, "first rest twice as long", ha="center", fontsize=8.5)
    for middle in (25, 35, 45, 56):
        ax.text(middle, 1.22, "still 7 s or more", ha="center", fontsize=8.5)
    ax.text(30.2, -1.35, "turn in 2 to 3 s", ha="center", fontsize=8.5, color=GREY)
    ax.set_ylim(-1.55, 1.5)
    ax.set_xlabel("time [s]")
    ax.set_ylabel("one axis [g]")
    return figure


DRAWINGS = {
    "frames_bench": bench,
    "frames_gimbals": gimbals,
    "frames_static_run": static_run,
    "frames_altaz": altaz,
    "frames_equatorial": equatorial_mount,
    "record_attitudes": attitudes,
    "record_timeline": timeline,
}

if __name__ == "__main__":
    with mpl.rc_context(STYLE):
        for name, draw in DRAWINGS.items():
            (PICTURES / f"{name}.svg").write_bytes(svg(draw()))
    sys.stdout.write(f"wrote {len(DRAWINGS)} drawings\n")
