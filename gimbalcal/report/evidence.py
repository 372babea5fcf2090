"""What a calibration leaves of a recording, as arrays in printed units ready to be drawn."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from gimbalcal.calibration import Readout
from gimbalcal.calibration.readout import in_si
from gimbalcal.earth import G0
from gimbalcal.effects import Effect, Stage, Stimulus
from gimbalcal.estimate.static_run.run import static_readings
from gimbalcal.forward import accelerometers, predict
from gimbalcal.inversion import invert
from gimbalcal.kinematics import stimulus_from_readings
from gimbalcal.number import Array, complex_step
from gimbalcal.platform import Platform
from gimbalcal.recording import Recording, dwell_means
from gimbalcal.report.figures import Curve
from gimbalcal.report.naming import unit_in_print
from gimbalcal.units import from_si, to_si

BLOCKS = 288  # points a curve over time is drawn with; more cannot be told apart on a page
OF_ONE_RUN = (Stage.BASE, Stage.PLATFORM)  # how the base and the platform stood in a static run


@dataclass(frozen=True)
class Spread:
    """What a position mean is expected to scatter by: noise of a sample, setting error, and what is beyond both."""

    accelerometer: float | None = None  # m/s^2
    setting: float = 0.0  # rad
    excess: float = 0.0  # m/s^2


@dataclass(frozen=True)
class ByPosition:
    """Residuals (n, c) in `unit` at each position, without and with the calibration, and their sigma."""

    labels: tuple[str, ...]
    axes: tuple[str, ...]
    before: Array
    after: Array
    sigma: Array | None
    unit: str
    angles: Array  # (n, k) deg
    axis_names: tuple[str, ...]
    gravity: Array  # (n, 3) unit vectors, platform axes


def spread_of(recording: Recording, provenance: Mapping[str, Any]) -> Spread:
    """The noise that a calibration was made with, as its provenance tells it, else as the recording does."""
    noise, options = provenance.get("noise", {}), provenance.get("options", {})
    force, setting = noise.get("accelerometer_ug"), noise.get("gimbal_angle_arcsec")
    return Spread(
        recording.sigma("accelerometer") if force is None else float(to_si(force, "ug")),
        recording.sigma("gimbal_angle") or 0.0 if setting is None else float(to_si(setting, "arcsec")),
        options.get("excess_scatter") or 0.0,
    )


def by_position(
    recording: Recording, effects: Sequence[Effect], provenance: Mapping[str, Any], readout: Readout
) -> ByPosition:
    """Position means of the accelerometers against the model; against |f| = g for a unit without gimbals."""
    means = in_si(dwell_means(recording), readout)
    s, spread = stimulus_from_readings(means), spread_of(means, provenance)
    measured = means.triad("specific_force")
    shape = measured.shape
    sigma = spread.accelerometer and np.hypot(spread.accelerometer / np.sqrt(means.weight), spread.excess)
    bars = None if sigma is None else np.broadcast_to(np.asarray(sigma)[:, None], shape)
    if means.platform.axes:
        own = tuple(e for e in effects if e.stage not in OF_ONE_RUN)
        before = measured - predict(means.platform, s, ())["specific_force"]
        after = measured - predict(means.platform, s, own)["specific_force"]
        axes: tuple[str, ...] = ("x", "y", "z")
        bars = None if bars is None else np.hypot(bars, setting_spread(means.platform, s, spread.setting))
    else:
        before, after = (
            _norm(f) - s.gravity for f in (measured, invert(lambda f: accelerometers(f, s, effects), measured)[0])
        )
        axes, bars = ("|f| − g",), None if bars is None else bars[:, :1]
    unit = "mg" if np.sqrt(np.mean(after**2)) > 1e-3 * G0 else "ug"
    numbers = means.position if means.position is not None else np.arange(1, len(means.time) + 1)
    return ByPosition(
        labels=tuple(str(p) for p in numbers),
        axes=axes,
        before=np.asarray(from_si(before, unit)),
        after=np.asarray(from_si(after, unit)),
        sigma=None if bars is None else np.asarray(from_si(bars, unit)),
        unit=unit,
        angles=np.rad2deg(s.readout),
        axis_names=s.axis_names,
        gravity=-s.force / _norm(s.force),
    )


def setting_spread(platform: Platform, s: Stimulus, sigma: float) -> Array:
    """Sigma (n, 3) [m/s^2] of the force when every gimbal is set with an error of `sigma` [rad]."""
    slope = complex_step(lambda angle: predict(platform, s.at(readout=angle), ())["specific_force"], s.readout)
    return np.sqrt(((slope * sigma) ** 2).sum(axis=-1))


def _norm(f: Array) -> Array:
    return np.asarray(np.sqrt((f**2).sum(axis=-1, keepdims=True)))


def over_time(recording: Recording, effects: Sequence[Effect]) -> tuple[Array, tuple[Curve, ...]]:
    """Hours (m,) and departures of a static run from perfect sensors: attitude errors, and force along gravity.

    Rows are averaged into at most `BLOCKS` blocks.
    """
    run = static_readings(recording)
    measured, left = run.residual(), run.residual(effects)
    edges = np.unique(np.linspace(0, len(measured), BLOCKS + 1).astype(int))
    thin = np.sqrt(np.median(np.diff(edges)))
    curves = []
    for i, (quantity, axis) in enumerate(run.channels):
        if quantity == "attitude_error":
            columns = (measured[:, i], left[:, i])
            curves.append(_curve(axis, "arcsec", columns, edges, float(np.median(run.sigma[:, i]) / thin)))
    force = run.columns("specific_force")
    if len(force) == 3:
        along = tuple((d[:, force] * run.direction).sum(axis=-1) for d in (measured, left))
        sigma = np.sqrt(((run.sigma[:, force] * run.direction) ** 2).sum(axis=-1))
        curves.append(_curve("force along g", "ug", along, edges, float(np.median(sigma) / thin)))
    return _block_means(recording.time - recording.time[0], edges) / 3600, tuple(curves)


def _curve(name: str, unit: str, columns: Sequence[Array], edges: Array, sigma: float) -> Curve:
    """Departures (n,) in SI, measured and left by the fit, as a curve in `unit`."""
    measured, left = (np.asarray(from_si(_block_means(x, edges), unit)) for x in columns)
    return Curve(name, unit_in_print(unit), measured, measured - left, float(from_si(sigma, unit)))


def _block_means(x: Array, edges: Array) -> Array:
    return np.asarray(np.add.reduceat(x, edges[:-1]) / np.diff(edges))
