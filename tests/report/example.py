"""A realistic calibration to draw: 18 positions and a static day with known errors, solved by linear least squares."""

from functools import cache
from typing import Any

import numpy as np

from gimbalcal.calibration import Calibration, Options, Provenance, Readout, Residual, StageResult
from gimbalcal.earth import EARTH_RATE, G0
from gimbalcal.effects import CATALOGUE, parameters, with_values
from gimbalcal.forward import jacobian, predict
from gimbalcal.inference.information import information, solve
from gimbalcal.kinematics import stimulus_from_angles
from gimbalcal.platform import SPACE_STABLE_INERTIAL
from gimbalcal.recording import Recording, Site, Source
from gimbalcal.schedule import EIGHTEEN_POSITIONS

EFFECTS = ("scale_factor", "bias", "scale_nonlinearity", "misalignment", "gimbal_zero")
ARCSEC = np.pi / 648000
SITE = Site(latitude=np.deg2rad(40.0), height=60.0, gravity=9.80146)
NOISE = {"accelerometer": 20e-6 * G0, "gimbal_angle": ARCSEC, "attitude": 0.5 * ARCSEC}


def unknowns() -> tuple[Any, ...]:
    """The 18 coefficients of Wu et al. (2018): of the four gimbals the outer one is vertical and not among them."""
    platform = EIGHTEEN_POSITIONS.platform
    every = [p for i in EFFECTS for p in parameters(CATALOGUE[i], platform.axis_names)]
    return tuple(p for p in every if p.label != "gimbal_zero:outer")


def recordings(truth: np.ndarray, rng: np.random.Generator) -> tuple[Recording, Recording]:
    """Position means of 400 samples each, and a day of minute means, both with white noise and setting errors."""
    platform, angles = EIGHTEEN_POSITIONS.platform, EIGHTEEN_POSITIONS.angles
    names, n = platform.axis_names, len(angles)
    effects = with_values((), unknowns(), truth, names)
    still = _recording("multi-position", "18 positions, laboratory", platform, angles, 600.0 * np.arange(n), 400.0)
    set_at = stimulus_from_angles(still).at(readout=angles + rng.normal(0, ARCSEC, angles.shape))
    force = predict(platform, set_at, effects)["specific_force"] + rng.normal(0, NOISE["accelerometer"] / 20, (n, 3))
    still.channels.update(zip([("specific_force", a) for a in "xyz"], force.T, strict=True))  # type: ignore[attr-defined]

    time = 60.0 * np.arange(1440)
    turned = np.stack([EARTH_RATE * time, 0 * time, np.full(1440, SITE.latitude), 0 * time], axis=-1)
    run = _recording("static-run", "static day", SPACE_STABLE_INERTIAL, turned, time, 60.0)
    out = predict(SPACE_STABLE_INERTIAL, stimulus_from_angles(run), effects, "static-run")
    force = out["specific_force"] + rng.normal(0, NOISE["accelerometer"] / 60**0.5, (1440, 3))
    attitude = out["attitude_error"] + rng.normal(0, NOISE["attitude"] / 60**0.5, (1440, 3))
    run.channels.update(zip([("specific_force", a) for a in "xyz"], force.T, strict=True))  # type: ignore[attr-defined]
    run.channels.update(zip([("attitude_error", a) for a in ("roll", "pitch")], attitude.T[:2], strict=True))  # type: ignore[attr-defined]
    return still, run


def _recording(kind: str, title: str, platform: Any, angles: np.ndarray, time: np.ndarray, weight: float) -> Recording:
    n = len(time)
    channels = {("gimbal_angle", name): angles[:, i] for i, name in enumerate(platform.axis_names)}
    channels |= {("specific_force", a): np.zeros(n) for a in "xyz"}
    position = np.arange(1, n + 1) if kind == "multi-position" else None
    source = (Source(f"{kind}/samples.csv", "0123456789abcdef" * 4),)
    return Recording(kind, title, platform, SITE, NOISE, time, position, channels, source, np.full(n, weight))


@cache
def example() -> tuple[Calibration, tuple[Recording, Recording], dict[str, float]]:
    """A calibration, the recordings behind it, and the truth by label in SI."""
    rng = np.random.default_rng(20181)
    wanted = unknowns()
    truth = rng.normal(0, [p.sigma / 3 for p in wanted])
    both = recordings(truth, rng)
    still, names = both[0], both[0].platform.axis_names
    s = stimulus_from_angles(still)
    origin = with_values((), wanted, np.zeros(len(wanted)), names)
    stages = []
    x = np.zeros(len(wanted))
    for name, use in (("coarse", 15), ("fine", 18), ("joint", 18)):
        some = [p for p in wanted if use == 18 or p.effect != "scale_nonlinearity"]
        index = [wanted.index(p) for p in some]
        sigma = np.hypot(NOISE["accelerometer"] / 20, {"coarse": 40, "fine": 12, "joint": 5}[name] * 1e-6 * G0)
        effects = with_values(origin, wanted, x, names)
        rest = still.triad("specific_force") - predict(still.platform, s, effects)["specific_force"]
        J = jacobian(still.platform, s, effects, some)["specific_force"].reshape(-1, len(some))
        solution = solve(information(J / sigma, (rest.ravel() + J @ x[index]) / sigma, some))
        x[index] = solution.x
        rms = float(np.sqrt(np.mean(rest**2)))
        labels = tuple(p.label for p in some)
        stages.append(
            StageResult(name, labels, solution.x, solution.sigma, rms, f"{len(some)} unknowns, one linear step")
        )
    coefficients, spread = np.array([1.5e-4, -3e-6]), np.array([2e-7, 4e-7])
    stages.append(StageResult("combined coefficients", ("x1", "phi_1s"), coefficients, spread, rms))
    calibration = Calibration(
        method="three-stage",
        effects=with_values((), wanted, x, names),
        parameters=wanted,
        covariance=solution.covariance,
        unobservable=solution.unobservable,
        residual=Residual(solution.chi2, solution.dof, {"specific_force:x": rms}),
        provenance=Provenance(
            recordings=tuple(r.source[0] for r in both), version="0.1.0", seed=1,
            options=Options(method="three-stage"), created="2026-11-21T10:00:00Z",
        ),
        stages=tuple(stages),
        readout=Readout(gimbals=names),
    )  # fmt: skip
    return calibration, both, dict(zip((p.label for p in wanted), truth.tolist(), strict=True))
