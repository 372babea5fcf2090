"""The picture of gyroscopes on a rate table: what each is off by over the rate, before and after."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gimbalcal.calibration import Calibration
from gimbalcal.calibration.readout import in_si
from gimbalcal.estimate.gyroscopes.steady import stretches_of
from gimbalcal.recording import Recording
from gimbalcal.report import wording
from gimbalcal.report.chart import COLOURS, Chart, Points, Rule
from gimbalcal.report.html import Picture, picture
from gimbalcal.report.rounding import rms
from gimbalcal.units import from_si


def rate_table_picture(recordings: Sequence[Recording], made: Calibration) -> Picture:
    """Reading less the table's rate at each stretch of steady turning, of all mountings, by gyroscope."""
    before = [stretches_of(in_si(r, made.readout)) for r in recordings]
    after = [stretches_of(made.apply(r)) for r in recordings]
    charts = []
    for i, axis in enumerate("xyz"):
        for when, each, unit in (("before", before, "deg/s"), ("after", after, "deg/h")):
            marks = []
            for k, (r, s) in enumerate(zip(recordings, each, strict=True)):
                along = s.rate[:, int(np.argmax(np.abs(s.rate).max(axis=0)))]
                off = np.asarray(from_si(s.reading[:, i], unit))
                marks.append(Points(np.degrees(along), off, COLOURS[k % 6], label=r.title if i == 0 else ""))
            left = rms(np.concatenate([np.asarray(from_si(s.reading[:, i], unit)) for s in each]))
            printed = wording.unit_in_print(unit)
            told = f"{axis}, {when}: {left} {printed} rms"
            charts.append(Chart((*marks, Rule(0.0)), told, "the table turns by [°/s]", f"[{printed}]", height=170))
    many = sum(len(s.time) for s in after)
    return picture(
        charts,
        f"What three gyroscopes read beyond the table's rate at {wording.counted(many, 'stretch')} of steady turning.",
        "Read less turned, at each stretch of steady turning: as logged, and corrected with the calibration. What is "
        "left holds the Earth's rate, whose direction in the horizontal nobody knows.",
    )
