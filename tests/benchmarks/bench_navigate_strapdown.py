"""Strapdown units navigated before and after: Cai et al.'s five days, Wei et al.'s 48 h, Wang et al.'s motions.

    python -m tests.benchmarks.bench_navigate_strapdown [cai2016 | laboratory | wei2022 | drive | swing] ...

Each unit is calibrated from its own scenario and navigates another; seeds 1 to 3. Cai and Wei: 30 and 51 states,
aligned for an hour; laboratory: Cai's turns and five days with the terms of their Table 3. Wang: method 2 has the
linear terms of both triads alone, from the same rests and revolutions (a term in the square of the rate cancels between
the two senses of a revolution, to 0.3 ppm of scale here, so leaving it out of the fit or out of its result is the
same); method 3 all of Table 4.
"truth": every error of the sensors taken off, so that noise and alignment remain.
"""

import sys
import tomllib
from dataclasses import replace
from typing import Any

import numpy as np

from gimbalcal.calibration import Calibration
from gimbalcal.earth import NAUTICAL_MILE
from gimbalcal.estimate.systematic.calibrate import systematic
from gimbalcal.methods import calibrate
from gimbalcal.navigate.uncertainty import navigation_errors, sigma_bands, usual_references
from gimbalcal.recording import Recording
from gimbalcal.simulate import simulate
from gimbalcal.simulate.scenario import find
from tests.benchmarks.bench_navigate import perfect

SEEDS = (1, 2, 3)
LINEAR = ("scale_factor", "bias", "misalignment", "gyro_bias", "gyro_scale_factor", "gyro_misalignment")
LABORATORY = {  # Table 3 of Cai et al. (2016): 1e-5 deg/h/g, ug/g^2 and mm
    "gyro_g_sensitivity_rate": {
        "xx": 0.09e-5, "xy": 0.25e-5, "xz": -0.22e-5, "yx": 0.35e-5, "yy": 0.81e-5, "yz": -0.24e-5, "zx": -0.07e-5,
        "zy": -0.50e-5, "zz": -1.02e-5,
    },
    "quadratic_nonlinearity": {"x": 17.1, "y": -20.4, "z": 25.2},
    "cross_coupling": {"xy": -2.0, "xz": -22.6, "yx": 7.8, "yz": 16.5, "zx": -0.5, "zy": 1.6},
    "accelerometer_lever_arm": {"xx": -41.0, "yy": 22.0, "zz": -24.0},
}  # fmt: skip
Calibrations = list[tuple[str, Calibration | None]]


def in_the_laboratory(scenario: str) -> dict[str, Any]:
    """A scenario of Cai et al. with the terms beyond 30 states that they found in a real unit."""
    content = tomllib.loads(find(scenario).read_text(encoding="utf-8"))
    return {**content, "truth": {**content["truth"], **LABORATORY}}


def by_states(scenario: str | dict[str, Any], seed: int) -> Calibrations:
    """30 and 51 states of a unit turned in its place."""
    recording, _ = simulate(scenario, seed)
    return [("none", None), *((f"{s} states", systematic(recording, s)) for s in ("30", "51"))]


def by_methods(seed: int) -> Calibrations:
    """Methods 2 and 3 of Wang et al.: a linear model, and the full one."""
    recording, _ = simulate("wang2019-unit", seed)
    full, _ = calibrate([recording], "multiposition")
    line, _ = calibrate([recording], "multiposition", terms=LINEAR)
    linear = replace(line, effects=tuple(e for e in line.effects if e.id in LINEAR))
    return [("none", None), ("method 2", linear), ("method 3", full)]


def told(run: Recording, made: Calibrations, alignment: float) -> list[str]:
    """One line for each calibration."""
    aids, out = usual_references(run, None, alignment), []
    for label, calibration in made:
        n = navigation_errors(run, calibration, aids)
        north, east = np.rad2deg(n.largest[:2]) * 60
        line = f"  {label:10s} {n.position.max() / NAUTICAL_MILE:10.4g} n mile"
        line += f"   latitude {north:8.3g}'  longitude {east:8.3g}'"
        if label.endswith("states"):
            assert calibration is not None
            (_, linear), (_, sampled) = sigma_bands(run, calibration, aids, 20, 1)
            one, other = (np.rad2deg(x[:, :2].max(0)) * 60 for x in (linear, sampled))
            line += f"   one sigma {one[0]:.3g}', {one[1]:.3g}'; sampled {other[0]:.3g}', {other[1]:.3g}'"
        out.append(line)
    return out


def main() -> None:
    asked = sys.argv[1:] or ["cai2016", "laboratory", "wei2022", "drive", "swing"]
    turns: dict[str, str | dict[str, Any]] = {
        "cai2016": "cai2016-18", "wei2022": "wei2022-30", "laboratory": in_the_laboratory("cai2016-18"),
    }  # fmt: skip
    for name in asked:
        for seed in SEEDS[: 1 if name == "swing" else None]:
            paper = name in turns
            scenario = f"{name}-static" if paper else f"wang2019-{name}"
            given = in_the_laboratory("cai2016-static") if name == "laboratory" else scenario
            run, truth = simulate(given, seed + 1000)
            made = [*(by_states(turns[name], seed) if paper else by_methods(seed)), ("truth", perfect(truth))]
            lines = [f"{scenario}, unit {seed}", *told(run, made, 3600.0 if paper else 600.0)]
            sys.stdout.write("\n".join(lines) + "\n")
            sys.stdout.flush()


if __name__ == "__main__":
    main()
