"""Table 5 of Wu et al. (2018) over many units: largest navigation errors before, after two and after three stages.

    python -m tests.benchmarks.bench_navigate [RUNS]

Every seed is a unit of its own: accelerometers with errors of the size of Tables 2 and 3 (one sigma: 150 ppm, 1e-3
m/s^2, 8 arcsec), zeros of 10 arcsec, a platform that stands 5 arcsec off the pole, gyroscopes that drift by 1e-4 deg/h
and whose cases turn every 8 min with 2 urad of residue. It is calibrated in 18 positions of 2 min, then left alone for
24 h, and navigates the next 24 h, a run that no calibration has seen. Rows of static runs are minute means of 10 ug and
0.5 arcsec. The third column is the third stage with the drift of the gyroscopes in its fit, `--with gyro_drift`; the
last is the run with the whole truth taken off, which no calibration betters: what is left is noise of the run.
"""

import sys
from typing import Any

import numpy as np

from gimbalcal.calibration import Calibration
from gimbalcal.calibration.calibration import Residual
from gimbalcal.earth import NAUTICAL_MILE
from gimbalcal.effects import Effect
from gimbalcal.estimate.extra_effects import extra_effects
from gimbalcal.navigate.navigation_errors import CHANNELS
from gimbalcal.navigate.space_stable_navigator import Aids
from gimbalcal.navigate.uncertainty import before_and_after
from gimbalcal.number import Array
from gimbalcal.pipeline import three_stage
from gimbalcal.recording import Recording
from gimbalcal.simulate import simulate

STAGES = ("two-stage", "three-stage", "with drift", "truth")
# Table 5: improvement of the largest error after two and three stages, per cent
PRINTED = {
    "longitude": (30.95, 60.71), "latitude": (30.23, 69.77), "north velocity": (17.65, 34.12),
    "east velocity": (10.34, 22.99), "roll": (43.82, 57.30), "pitch": (38.95, 54.74), "yaw": (32.50, 45.00),
}  # fmt: skip
SIZES = {  # one sigma in the unit of the catalogue
    "scale_factor": (150.0, ("x", "y", "z")), "bias": (102.0, ("x", "y", "z")),
    "scale_nonlinearity": (5.0, ("x", "y", "z")),
    "misalignment": (8.0, ("xy", "xz", "yz", "yx", "zx", "zy")),
    "gimbal_zero": (10.0, ("platform", "inner", "middle")),
    "polar_axis_misalignment": (5.0, ("equatorial_x", "equatorial_y")),
    "gyro_drift": (1e-4, ("equatorial_x", "equatorial_y", "polar")),
}  # fmt: skip
ONLY_STATIC = ("polar_axis_misalignment", "gyro_drift", "case_rotation_residue")


def unit(seed: int) -> tuple[Recording, Recording, Recording, tuple[Effect, ...]]:
    """18 positions, the static run of the calibration, and the run that is navigated, of one unit; and its truth."""
    rng = np.random.default_rng([seed, 5])
    truth: dict[str, Any] = {e: {a: s * rng.standard_normal() for a in axes} for e, (s, axes) in SIZES.items()}
    waves = {k: {a: 2.0 * rng.standard_normal() for a in SIZES["gyro_drift"][1]} for k in ("A", "B")}
    truth["case_rotation_residue"] = {**waves, "period": 8.0}
    site = {"latitude": {"value": 40.0, "unit": "deg"}}
    arcsec = {"value": 0.5, "unit": "arcsec"}
    device = {
        "format": 1, "kind": "multi-position", "site": site,
        "schedule": {"name": "wu2018-18", "dwell": {"value": 2.0, "unit": "min"}},
        "truth": {k: v for k, v in truth.items() if k not in ONLY_STATIC},
        "noise": {"accelerometer": {"value": 20.0, "unit": "ug"}, "gimbal_angle": {"value": 1.0, "unit": "arcsec"}},
    }  # fmt: skip
    run = {
        "format": 1, "kind": "static-run", "site": site, "truth": truth,
        "schedule": {"duration": {"value": 24.0, "unit": "h"}, "rate": {"value": 1 / 60, "unit": "Hz"}},
        "noise": {"accelerometer": {"value": 10.0, "unit": "ug"}, "gimbal_angle": arcsec, "attitude": arcsec},
    }  # fmt: skip
    return simulate(device, 3 * seed)[0], simulate(run, 3 * seed + 1)[0], *simulate(run, 3 * seed + 2)


def perfect(truth: tuple[Effect, ...]) -> Calibration:
    """The calibration that knows the truth."""
    return Calibration("truth", truth, (), np.zeros((0, 0)), (), Residual(0, 0, {}))


def largest(seed: int, damping: float = 0.5) -> Array:
    """Largest errors (5, 8) before and after each stage: seven channels in SI, and position [m]."""
    device, run, later, truth = unit(seed)
    more = extra_effects(("gyro_drift",), (device, run), ())
    made = (three_stage([device]), three_stage([device, run]), three_stage([device, run], more=more), perfect(truth))
    runs = before_and_after(later, tuple(zip(STAGES, made, strict=True)), Aids(damping=damping))
    return np.array([[*r.largest, r.position.max()] for r in runs])


def report(found: Array) -> list[str]:
    """Found (n, 5, 8): one line per row of Table 5."""
    improved = 100 * (1 - found[:, 1:] / found[:, :1])
    lines = [
        f"improvement of the largest error in per cent: mean, median [worst] of {len(found)} units,",
        "share of them that reach what is printed after three stages; what is printed",
        f"{'':16s}" + "".join(f"{s:>38s}" for s in STAGES),
    ]
    for i, name in enumerate((*(name for name, _ in CHANNELS), "position")):
        two, three = PRINTED.get(name, (np.nan, np.nan))
        cells = [
            f"{x.mean():6.1f} {np.median(x):6.1f} [{x.min():6.1f}]"
            + (f" {100 * np.mean(x >= three):4.0f} % {p:6.1f}" if np.isfinite(p) else f"{'':14s}")
            for x, p in zip(improved[:, :, i].T, (two, three, three, three), strict=True)
        ]
        lines.append(f"{name:16s}" + "  ".join(f"{c:>36s}" for c in cells))
    miles = np.median(found[:, :, 7], axis=0) / NAUTICAL_MILE
    told = ", ".join(f"{m:.3g} {s}" for m, s in zip(miles, ("before", *STAGES), strict=True))
    return [*lines, f"largest position error in 24 h, median [n mile]: {told}"]


def main() -> None:
    n = int(sys.argv[1]) if len(sys.argv) > 1 else 50
    found = np.array([largest(seed) for seed in range(n)])
    sys.stdout.write("\n".join(report(found)) + "\n")


if __name__ == "__main__":
    main()
