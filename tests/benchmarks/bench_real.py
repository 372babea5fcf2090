"""Accelerometers of a real recording in one run: our terms, imu_tk's linear model, imucal's six faces.

    python -m tests.benchmarks.bench_real [RECORDING ...]     (default: data/xsens_positions)

The misfit is that of the norm of gravity over all rest positions [ug], with leave-one-out and condition number where
the method has them. imucal takes part where it is installed (`pip install imucal`); it needs an axis along gravity and
is given the positions that come nearest.
"""

import sys
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from gimbalcal.earth import G0
from gimbalcal.estimate.accelerometers.multiposition import LINEAR, left_out_rms, norm_fit
from gimbalcal.estimate.fit import ViewsFit
from gimbalcal.number import Array
from gimbalcal.recording import Recording, dwell_means, read
from gimbalcal.views.norm import norm, scaled_by_gravity

UG = 1e-6 * G0
SHIPPED = Path(__file__).parents[2] / "data" / "xsens_positions"
TERMS = (
    ("bias", "scale_factor"),
    LINEAR,
    (*LINEAR, "scale_nonlinearity"),
    (*LINEAR, "scale_nonlinearity", "cubic_nonlinearity"),
)


def imu_tk_style(y: Array, g: float) -> Array:
    """Misfit (m,) [m/s^2] of a = T K (y + b), T upper triangular with ones, by LM (tedaldi2014)."""

    def residual(x: Array) -> Array:
        T = np.array([[1, -x[0], x[1]], [0, 1, -x[2]], [0, 0, 1]])
        return np.asarray(g - np.linalg.norm((x[3:6] * (y + x[6:9])) @ T.T, axis=1))

    start = np.r_[np.zeros(3), np.ones(3), np.zeros(3)]
    return np.asarray(least_squares(residual, start, method="lm", x_scale=np.r_[[0.01] * 6, [0.1] * 3]).fun)


def imucal_style(y: Array, g: float) -> Array | None:
    """Misfit (m,) [m/s^2] of imucal's Ferraris calibration from the six positions nearest to faces; None without it."""
    try:
        import imucal  # type: ignore[import-not-found]
    except ImportError:
        return None
    faces = {f"{a}_{s}": y[np.argmax(sign * y[:, i])] for i, a in enumerate("xyz") for s, sign in (("p", 1), ("a", -1))}
    regions: dict[str, Any] = {f"acc_{k}": np.tile(v, (10, 1)) for k, v in faces.items()}
    regions |= {f"gyr_{k}": np.zeros((10, 3)) for k in faces}
    for i, a in enumerate("xyz"):  # no whole revolution was turned: a made-up one, which the accelerometers do not use
        regions[f"acc_{a}_rot"] = np.tile(faces[f"{a}_p"], (10, 1))
        regions[f"gyr_{a}_rot"] = -360.0 * np.tile(np.eye(3)[i], (10, 1))
    made = imucal.FerrarisCalibration(grav=g).compute(
        imucal.FerrarisSignalRegions(**regions), 10.0, from_acc_unit="m/s^2", from_gyr_unit="deg/s"
    )
    fitted = made.calibrate(y, np.zeros_like(y), "m/s^2", "deg/s")[0]
    return np.asarray(np.linalg.norm(fitted, axis=1) - g)


def compared(recording: Recording) -> list[str]:
    """One line per method."""
    means, _ = scaled_by_gravity(dwell_means(recording))
    y, g = means.triad("specific_force"), means.site.gravity
    lines = [f"{recording.title}: {len(y)} rest positions; misfit of gravity [ug rms], direction physics to reading"]
    for terms in TERMS:
        start = perf_counter()
        made: ViewsFit = norm_fit(norm(means), terms)
        seconds = perf_counter() - start
        rms = np.sqrt(np.mean(made.residual[0] ** 2)) / UG
        x, s = made.solution.x, made.solution.sigma
        extra = [abs(v / e) for q, v, e in zip(made.solution.parameters, x, s, strict=True) if "linearity" in q.effect]
        seen = f", largest second or third order {max(extra):.1f} sigma" if extra else ""
        lines.append(
            f"  {' + '.join(terms):82s} {rms:9.1f}   left out {left_out_rms(made) / UG:8.1f}   condition "
            f"{made.condition:5.0f}   {1e3 * seconds:4.0f} ms{seen}"
        )
    lines.append(f"  {'imu_tk model (T K b) on the means':82s} {np.sqrt(np.mean(imu_tk_style(y, g) ** 2)) / UG:9.1f}")
    other = imucal_style(y, g)
    words = "not installed" if other is None else f"{np.sqrt(np.mean(other**2)) / UG:9.1f}"
    lines.append(f"  {'imucal (Ferraris), the six positions nearest to faces taken for faces':82s} {words}")
    return lines


def test_all_linear_models_with_misalignment_reach_the_same_misfit() -> None:
    means, _ = scaled_by_gravity(dwell_means(read(SHIPPED)))
    ours = np.sqrt(np.mean(norm_fit(norm(means), LINEAR).residual[0] ** 2))
    theirs = np.sqrt(np.mean(imu_tk_style(means.triad("specific_force"), means.site.gravity) ** 2))
    assert abs(ours / theirs - 1) < 0.01  # ours weighs positions by their length, theirs does not


if __name__ == "__main__":
    folders = [Path(a) for a in sys.argv[1:]] or [SHIPPED]
    sys.stdout.write("\n".join(line for folder in folders for line in compared(read(folder))) + "\n")
