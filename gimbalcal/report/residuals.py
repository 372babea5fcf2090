"""Residuals of a calibration in a recording, as arrays in printed units for charts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gimbalcal.calibration import AssumedNoise, Calibration, Provenance, Readout
from gimbalcal.calibration.readout import in_si
from gimbalcal.earth import G0
from gimbalcal.effects import Effect, Stage
from gimbalcal.effects.effect import GYROSCOPE_STAGES
from gimbalcal.estimate.gyroscopes.rest_and_turn_fits import view_at_rest, view_of_turns
from gimbalcal.estimate.static_run.system import static_readings
from gimbalcal.forward import Rows, accelerometers, linearise
from gimbalcal.inversion import invert_response
from gimbalcal.kinematics import stimulus_from_readings
from gimbalcal.number import Array
from gimbalcal.recording import Recording, dwell_means
from gimbalcal.recording.record import RATE
from gimbalcal.report.figures import Curve
from gimbalcal.units import from_si, to_si
from gimbalcal.views.core import View
from gimbalcal.words.naming import unit_in_print

AT_REST = ("gyro_bias", "gyro_g_sensitivity_rate")  # by which the dwells give the level of a turn
MAX_POINTS = 288  # of a curve over time; more overlap on a page
STATIC_RUN_STAGES = (Stage.BASE, Stage.PLATFORM)  # attitude of base and platform in one static run


@dataclass(frozen=True)
class Spread:
    """Expected scatter of a position mean: noise of a sample, setting error, and excess scatter."""

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


def spread_of(recording: Recording, provenance: Provenance) -> Spread:
    """Return the noise that a calibration assumed, from its provenance, else from the recording."""
    noise = provenance.noise or AssumedNoise()
    force, setting = noise.accelerometer_ug, noise.known_setting_arcsec
    return Spread(
        recording.sigma("accelerometer") if force is None else float(to_si(force, "ug")),
        recording.sigma("gimbal_angle") or 0.0 if setting is None else float(to_si(setting, "arcsec")),
        provenance.options.excess_scatter or 0.0,
    )


def by_position(
    recording: Recording, effects: Sequence[Effect], provenance: Provenance, readout: Readout
) -> ByPosition:
    """Return position means of the accelerometers minus the model; minus g of their norm for a unit without gimbals."""
    means = in_si(dwell_means(recording), readout)
    noise = spread_of(means, provenance)
    s, measured = stimulus_from_readings(means), means.triad("specific_force")
    sigma = noise.accelerometer and np.hypot(noise.accelerometer / np.sqrt(means.weight), noise.excess)[:, None]
    if means.platform.axes:
        axes: tuple[str, ...] = ("x", "y", "z")
        channels = [("specific_force", a) for a in axes]
        own = [e for e in effects if e.stage not in STATIC_RUN_STAGES]
        bare = linearise(means.platform, s, (), channels=channels, read=measured)
        before = bare.residual
        after = linearise(means.platform, s, own, channels=channels, read=measured).residual
        sigma = None if sigma is None else np.hypot(sigma, setting_spread(bare, noise.setting))
    else:
        axes = ("|f| − g",)
        corrected = invert_response(lambda f: accelerometers(f, s, effects), measured)[0]
        before, after = (_norm(f) - s.gravity for f in (measured, corrected))
    unit = "mg" if np.sqrt(np.mean(after**2)) > 1e-3 * G0 else "ug"
    numbers = means.position if means.position is not None else np.arange(1, len(means.time) + 1)
    return ByPosition(
        labels=tuple(str(p) for p in numbers),
        axes=axes,
        before=np.asarray(from_si(before, unit)),
        after=np.asarray(from_si(after, unit)),
        sigma=None if sigma is None else np.asarray(from_si(np.broadcast_to(sigma, after.shape), unit)),
        unit=unit,
        angles=np.rad2deg(s.readout),
        axis_names=s.axis_names,
        gravity=-s.force / _norm(s.force),
    )


def of_gyroscopes(recording: Recording, c: Calibration) -> dict[str, ByPosition]:
    """Return the residuals of gyroscopes in words: mean rates of dwells, and directions of gravity after turns.

    Empty where the calibration has no gyroscopes, or the recording does not show one of them. The Earth's rate, where
    its direction is not known, is eliminated from the rates. Turns start from the level of the dwells, so that effects
    that show at rest are no part of them.
    """
    if not recording.has(RATE) or not any(e.stage in GYROSCOPE_STAGES for e in c.effects):
        return {}
    rotating = [e for e in c.effects if e.id not in AT_REST]
    views = {
        "rate at rest": (view_at_rest(recording, (), c), c.effects, "deg/h"),
        "direction of gravity after a turn": (view_of_turns(recording, c), rotating, "arcsec"),
    }
    return {what: _of_view(v, effects, unit) for what, (v, effects, unit) in views.items() if v is not None}


def _of_view(v: View, effects: Sequence[Effect], unit: str) -> ByPosition:
    """Return the residuals of a view of dwells or turns by the number of the dwell, in `unit`."""
    before, after = (np.asarray(from_si(v.evaluate(e).residual, unit)) for e in ((), effects))
    labels = range(1, len(before) + 1) if v.label is None else v.label
    none = np.zeros((len(before), 0))
    return ByPosition(
        tuple(map(str, labels)), tuple(axis for _, axis in v.channels), before, after, None, unit, none, (), none
    )


def setting_spread(rows: Rows, sigma: float) -> Array:
    """Return sigma (n, C) [m/s^2] of the force if every gimbal is set with an error of `sigma` [rad]."""
    return np.sqrt(((rows.sensitivity(Stage.ENCODER) * sigma) ** 2).sum(axis=-1))


def _norm(f: Array) -> Array:
    return np.asarray(np.sqrt((f**2).sum(axis=-1, keepdims=True)))


def over_time(recording: Recording, effects: Sequence[Effect]) -> tuple[Array, tuple[Curve, ...]]:
    """Return hours (m,) and deviations of a static run from perfect sensors: attitude errors, and force along gravity.

    Rows are averaged into at most `MAX_POINTS` blocks.
    """
    run = static_readings(recording)
    measured, residual = run.residual(), run.residual(effects)
    edges = np.unique(np.linspace(0, len(measured), MAX_POINTS + 1).astype(int))
    thin = np.sqrt(np.median(np.diff(edges)))
    curves = []
    for i, (quantity, axis) in enumerate(run.channels):
        if quantity == "attitude_error":
            columns = (measured[:, i], residual[:, i])
            curves.append(_curve(axis, "arcsec", columns, edges, float(np.median(run.sigma[:, i]) / thin)))
    force = run.columns("specific_force")
    if len(force) == 3:
        along = tuple((d[:, force] * run.direction).sum(axis=-1) for d in (measured, residual))
        sigma = np.sqrt(((run.sigma[:, force] * run.direction) ** 2).sum(axis=-1))
        curves.append(_curve("force along g", "ug", along, edges, float(np.median(sigma) / thin)))
    return _block_means(recording.time - recording.time[0], edges) / 3600, tuple(curves)


def _curve(name: str, unit: str, columns: Sequence[Array], edges: Array, sigma: float) -> Curve:
    """Return deviations (n,) in SI, measured and after the fit, as a curve in `unit`."""
    measured, residual = (np.asarray(from_si(_block_means(x, edges), unit)) for x in columns)
    return Curve(name, unit_in_print(unit), measured, measured - residual, float(from_si(sigma, unit)))


def _block_means(x: Array, edges: Array) -> Array:
    return np.asarray(np.add.reduceat(x, edges[:-1]) / np.diff(edges))
