"""Draw the pictures of docs/navigation.md, and compute its table of what Eq. (28) of Wu et al. (2018) neglects.

python docs/build_navigation.py && python docs/build_measured.py
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from chart_sheet import sheet

from gimbalcal.earth import EARTH_RATE, normal_gravity, radii
from gimbalcal.navigate.space_stable_navigator import Aids, InertialSite, schuler_rate
from gimbalcal.navigate.uncertainty import before_and_after, navigation_errors
from gimbalcal.pipeline import load, three_stage
from gimbalcal.report.chart import BLUE, DASHES, VERMILION, Chart, Line, Rule
from gimbalcal.report.navigation_page import curves
from gimbalcal.simulate import simulate

LATITUDE = 40.0
RUN = {
    "format": 1, "kind": "static-run", "site": {"latitude": {"value": LATITUDE, "unit": "deg"}},
    "schedule": {"duration": {"value": 48.0, "unit": "h"}, "rate": {"value": 1 / 60, "unit": "Hz"}},
    "truth": {"bias": {"x": 100.0}, "scale_factor": {"x": 100.0}},
}  # fmt: skip


def answers(damping: float) -> dict[str, tuple[complex, complex]]:
    """North and east answer at one and two turns a day to a bias across the pole, over the quasi-static one."""
    L = np.deg2rad(LATITUDE)
    g = float(normal_gravity(L))
    k = 2 * damping * schuler_rate(InertialSite(L, 0.0, g, 0.0))
    turn, (M, N) = 2 * EARTH_RATE * np.sin(L), radii(L)
    out = {}
    for times in (1, 2):
        w = times * EARTH_RATE
        A = np.array([[g / M - w**2 + 1j * w * k, 1j * w * turn], [-1j * w * turn, g / N - w**2 + 1j * w * k]])
        a = np.array([-np.sin(L), 1j])  # what a bias in the plane of the equator does, turning westwards
        ratio = np.linalg.solve(A, a) / (a * np.array([M, N]) / g)
        out[f"{24 // times} h"] = (complex(ratio[0]), complex(ratio[1]))
    return out


def table() -> list[str]:
    """Return the rows of docs/measured/quasi_static.md."""
    lines = ["| damping | period | north: amplitude, lag | east: amplitude, lag |", "|---|---|---|---|"]
    for damping in (0.0, 0.1, 0.5):
        for period, both in answers(damping).items():
            cells = [f"{100 * (abs(r) - 1):+.2f} %, {_rounded(-np.degrees(np.angle(r)))} deg" for r in both]
            lines.append(f"| {damping:g} | {period} | {cells[0]} | {cells[1]} |")
    return lines


def _rounded(angle: float) -> float:
    """Return an angle to a tenth; zero has no sign, since the sign of a rounding error depends on the processor."""
    return round(float(angle), 1) + 0.0


def picture(path: Path) -> None:
    """Roll by Eq. (28) and by the navigator, damped and not, and the difference."""
    run, _ = simulate(RUN)
    static = -np.rad2deg(run.channels["attitude_error", "roll"]) * 3600
    full = {d: np.rad2deg(navigation_errors(run, aids=Aids(damping=d)).error[:, 4]) * 3600 for d in (0.0, 0.5)}
    few = slice(None, None, 3)  # 28 points of each swing
    hours = run.time[few] / 3600
    above, below = [], []
    for (damping, roll), colour in zip(full.items(), ("grey", BLUE), strict=True):
        above.append(Line(hours, roll[few], colour, f"navigator, damping {damping:g}"))
        below.append(Line(hours, (roll - static)[few], colour, f"navigator, damping {damping:g}"))
    above.append(Line(hours, static[few], VERMILION, "Eq. (28)", dash=DASHES[1]))
    titles = ("roll error by 100 µg and 100 ppm on x  [arcsec]", "navigator minus Eq. (28)  [arcsec]")
    charts = [Chart((Rule(0.0), *marks), t, "time [h]") for t, marks in zip(titles, (above, below), strict=True)]
    path.write_text(sheet(charts), encoding="utf-8")


def before_after(path: Path) -> None:
    """The recording that ships, navigated without calibration, after two stages and after the fused estimate."""
    data = Path(__file__).parents[1] / "data"
    device, run = load([data / "space_stable_18", data / "space_stable_static"])
    made = [("two-stage", three_stage([device])), ("fused", three_stage([device, run]))]
    path.write_text(sheet(curves(before_and_after(run, made, samples=2))), encoding="utf-8")


if __name__ == "__main__":
    picture(Path(__file__).parent / "pictures" / "quasi_static.svg")
    before_after(Path(__file__).parent / "pictures" / "navigation.svg")
    (Path(__file__).parent / "measured" / "quasi_static.md").write_text("\n".join(table()) + "\n", encoding="utf-8")
