"""The page of noise at rest: Allan deviation, its coefficients, and the lines for recording.toml."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gimbalcal.at_rest import ChannelNoise, Coefficient, RestNoise
from gimbalcal.references import cite
from gimbalcal.report.chart import COLOURS, DASHES, SHAPES, Chart, Line, Mark, Points
from gimbalcal.report.html import Context, picture, render
from gimbalcal.words import naming
from gimbalcal.words.answers import noise_answer
from gimbalcal.words.naming import unit_in_print
from gimbalcal.words.rounding import duration_in_words, p_value, pdg_rounded, significant

TITLES = {"specific_force": "Accelerometers", "angular_rate": "Gyroscopes"}


def noise_report(noise: RestNoise, title: str) -> str:
    """Return the page of the noise at rest."""
    misfits = [c for c in noise.channels if c.p_value < 1e-3]
    context = {
        "title": title,
        "answer": noise_answer(noise),
        "verdict": "unexplained" if misfits else "found",
        "facts": [
            (
                duration_in_words(noise.seconds),
                f"at rest, in {naming.number_and_noun(noise.rests, 'stretch', 'stretches')}",
            ),
            *([(duration_in_words(noise.longest_s), "longest rest")] if noise.rests > 1 else []),
            (_rate(noise.rate_hz), "logged"),
        ],
        "picture": picture(
            [
                _chart(noise.channels, quantity)
                for quantity in TITLES
                if _channels_of_quantity(noise.channels, quantity)
            ],
            "Allan deviation over averaging time, logarithmic, with the fitted noise as lines.",
            "Overlapping Allan deviation with one sigma, and the fitted noise: white noise falls with the root of "
            "time, bias instability (times 0.664) is level, random walk rises.",
        ),
        "rows": [_noise_row(c) for c in noise.channels],
        "header": noise.lines,
        "sources": noise.recordings,
        "citations": cite("ieee952", "groves2013"),
    }
    return render("noise.html", context)


def _rate(hertz: float) -> str:
    return f"{hertz:.4g} Hz" if hertz >= 0.1 else f"every {duration_in_words(1 / hertz)}"


def _channels_of_quantity(channels: Sequence[ChannelNoise], quantity: str) -> list[ChannelNoise]:
    return [c for c in channels if c.quantity == quantity]


def _chart(channels: Sequence[ChannelNoise], quantity: str) -> Chart:
    marks: list[Mark] = []
    mine = _channels_of_quantity(channels, quantity)
    for k, c in enumerate(mine):
        colour, tau, y = COLOURS[k % 6], np.array(c.tau_s), np.array(c.deviation)
        label = " ".join(filter(None, [c.axis, c.sensor]))
        names = [
            f"{label}, {duration_in_words(t)}: {significant(v)} {unit_in_print(c.unit)}"
            for t, v in zip(tau, y, strict=True)
        ]
        spread = np.array(c.sigma)
        marks.append(Line(tau, np.array(c.model), colour, dash=DASHES[k % 6]))
        marks.append(Points(tau, y, colour, SHAPES[k % 4], 3.0, spread, names, label))
    labels = "averaging time [s]", f"Allan deviation [{unit_in_print(mine[0].unit)}]"
    return Chart(tuple(marks), TITLES[quantity], *labels, log_x=True, log_y=True, height=300)


def _noise_row(c: ChannelNoise) -> Context:
    return {
        "name": " ".join(filter(None, [TITLES[c.quantity][:-1].lower(), c.axis, c.sensor])),
        "cells": [_cell(part) for part in (c.white_noise, c.bias_instability, c.random_walk)],
        "from": duration_in_words(c.fitted_from_s),
        "p": p_value(c.p_value),
    }


def _cell(part: Coefficient) -> str:
    unit = unit_in_print(part.unit)
    if not part.significant:
        return f"below {significant(part.below, 2)} {unit}"
    value, sigma = pdg_rounded(part.value, part.sigma)
    return f"{value} ± {sigma} {unit}"
