"""The palette as colour-blind readers and a dark screen have it: told apart, and seen against the paper."""

import re
from importlib.resources import files
from itertools import combinations

import numpy as np
import pytest

from gimbalcal.report.chart import COLOURS, DASHES, SHAPES

# Machado, Oliveira and Fernandes, IEEE TVCG 15 (2009) 1291, severity 1, on linear RGB
SEEN = {
    "all": np.eye(3),
    "protanopia": np.array(
        [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]]
    ),
    "deuteranopia": np.array(
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]]
    ),
}  # fmt: skip
APART = 10.0  # CIE 1976 difference: about four just noticeable ones


def palettes():
    """Light and dark, as style.css has them."""
    style = (files("gimbalcal.report") / "templates" / "style.css").read_text(encoding="utf-8")
    light, dark, *_ = re.findall(r":root \{([^}]*--paper[^}]*)\}", style)
    told = [dict(re.findall(r"--([\w-]+): (#[0-9a-f]{6})", text)) for text in (light, dark)]
    return {"light": told[0], "dark": told[0] | told[1]}


def linear(colour):
    v = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255
    return np.where(v <= 0.04045, v / 12.92, ((v + 0.055) / 1.055) ** 2.4)


def contrast(a, b):
    """Of WCAG 2: from 1 to 21."""
    low, high = sorted(float(linear(c) @ [0.2126, 0.7152, 0.0722]) for c in (a, b))
    return (high + 0.05) / (low + 0.05)


def lab(rgb):
    xyz = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]) @ np.clip(rgb, 0, 1)
    f = np.cbrt(xyz / [0.9505, 1.0, 1.089])
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


@pytest.mark.parametrize("mode", ["light", "dark"])
@pytest.mark.parametrize("eye", list(SEEN))
def test_colours_of_a_chart_are_told_apart(mode, eye):
    p = palettes()[mode]
    at = {c: lab(SEEN[eye] @ linear(p[c])) for c in (*COLOURS, "grey")}
    near = {f"{a} {b}": round(float(np.linalg.norm(at[a] - at[b])), 1) for a, b in combinations(at, 2)}
    assert {pair: d for pair, d in near.items() if d < APART} == {}


@pytest.mark.parametrize("mode", ["light", "dark"])
def test_text_and_marks_are_seen_on_their_paper(mode):
    p = palettes()[mode]
    for text, papers in (("ink", ("paper", "wash", "good-wash", "warn-wash")), ("soft", ("paper",)),
                         ("accent", ("paper",)), ("warn", ("paper", "warn-wash"))):  # fmt: skip
        assert all(contrast(p[text], p[on]) > 4.5 for on in papers), text
    assert {c: round(contrast(p[c], p["paper"]), 2) for c in (*COLOURS, "grey") if contrast(p[c], p["paper"]) < 3} == {}


def test_nothing_is_told_by_colour_alone():
    assert len(set(DASHES)) == len(COLOURS)
    style = (files("gimbalcal.report") / "templates" / "chart.css").read_text(encoding="utf-8")
    drawn = [re.search(rf"\.{d} \{{ stroke-dasharray: ([^;]+);", style) for d in DASHES if d]
    assert len({m[1] for m in drawn if m}) == len(DASHES) - 1
    assert len(set(SHAPES)) == len(SHAPES) >= 4
