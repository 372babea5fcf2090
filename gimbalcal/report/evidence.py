"""What a calibration leaves of a recording, as arrays in printed units ready to be drawn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from gimbalcal.earth import G0
from gimbalcal.effects import Effect, Stimulus
from gimbalcal.forward import accelerometers, predict, stimulus
from gimbalcal.number import STEP, Array
from gimbalcal.platform import Platform
from gimbalcal.recording import Recording, dwell_means
from gimbalcal.report.figures import Curve
from gimbalcal.report.wording import unit_in_print
from gimbalcal.units import from_si

BLOCKS = 288  # points a curve over time is drawn with; more cannot be told apart on a page


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


def by_position(recording: Recording, effects: Sequence[Effect]) -> ByPosition:
    """Position means of the accelerometers against the model; against |f| = g for a unit without gimbals."""
    means = dwell_means(recording)
    s = stimulus(means)
    measured = means.triad("specific_force")
    noise = recording.sigma("accelerometer")
    spread = None if noise is None else np.broadcast_to((noise / np.sqrt(means.weight))[:, None], measured.shape)
    if means.platform.axes:
        before = measured - predict(means.platform, s, ())["specific_force"]
        after = measured - predict(means.platform, s, effects)["specific_force"]
        axes: tuple[str, ...] = ("x", "y", "z")
        setting = setting_spread(means.platform, s, recording.sigma("gimbal_angle") or 0.0)
        spread = None if spread is None else np.hypot(spread, setting)
    else:
        before, after = (_norm(f) - s.gravity for f in (measured, corrected(measured, s, effects)))
        axes, spread = ("|f| − g",), None if spread is None else spread[:, :1]
    unit = "mg" if np.sqrt(np.mean(after**2)) > 1e-3 * G0 else "ug"
    numbers = means.position if means.position is not None else np.arange(1, len(means.time) + 1)
    return ByPosition(
        labels=tuple(str(p) for p in numbers),
        axes=axes,
        before=np.asarray(from_si(before, unit)),
        after=np.asarray(from_si(after, unit)),
        sigma=None if spread is None else np.asarray(from_si(spread, unit)),
        unit=unit,
        angles=np.rad2deg(s.readout),
        axis_names=s.axis_names,
        gravity=-s.force / _norm(s.force),
    )


def setting_spread(platform: Platform, s: Stimulus, sigma: float) -> Array:
    """Sigma (n, 3) [m/s^2] of the force when every gimbal is set with an error of `sigma` [rad]."""
    total = np.zeros(s.force.shape)
    for i in range(len(platform.axes)):
        step = np.zeros(len(platform.axes), dtype=complex)
        step[i] = 1j * STEP
        slope = predict(platform, s.at(readout=s.readout + step), ())["specific_force"].imag / STEP
        total += (slope * sigma) ** 2
    return np.sqrt(total)


def corrected(measured: Array, s: Stimulus, effects: Sequence[Effect]) -> Array:
    """Specific force f^p (n, 3) that the accelerometers turn into what was measured, by fixed-point iteration.

    Errors of 10 % shrink by 10 a step, so that 15 steps reach the last bit of a double.
    """
    force = measured
    for _ in range(15):
        force = force + measured - accelerometers(force, s, effects)
    return np.asarray(force)


def _norm(f: Array) -> Array:
    return np.asarray(np.sqrt((f**2).sum(axis=-1, keepdims=True)))


def over_time(recording: Recording, effects: Sequence[Effect]) -> tuple[Array, tuple[Curve, ...]]:
    """Hours (m,) and curves of a static run: attitude errors as far as recorded, and |f| - g.

    Rows are averaged into at most `BLOCKS` blocks; the model is taken at the middle of each.
    """
    edges = np.unique(np.linspace(0, recording.time.size, BLOCKS + 1).astype(int))
    middle = (edges[:-1] + edges[1:]) // 2
    thin = recording.select(middle)
    s = stimulus(thin)
    nominal = predict(thin.platform, s, (), "static-run")
    fitted = predict(thin.platform, s, effects, "static-run")
    edge = partial(_block_means, edges=edges)
    blocks = float(np.sqrt(np.median(np.diff(edges)) * np.median(recording.weight)))
    curves = []
    for i, axis in enumerate(("roll", "pitch", "yaw")):
        if ("attitude_error", axis) in recording.channels:
            seen = edge(recording.channels["attitude_error", axis])
            rows = (seen, nominal["attitude_error"][:, i], fitted["attitude_error"][:, i])
            curves.append(_curve(axis, "arcsec", rows, recording.sigma("attitude"), blocks))
    force = np.stack([edge(column) for column in recording.triad("specific_force").T], axis=-1)
    norms = [_norm(f)[:, 0] - s.gravity for f in (force, nominal["specific_force"], fitted["specific_force"])]
    curves.append(_curve("|f| − g", "ug", norms, recording.sigma("accelerometer"), blocks))
    return thin.time / 3600, tuple(curves)


def _curve(name: str, unit: str, rows: Sequence[Array], sigma: float | None, averaged: float) -> Curve:
    """Rows (measured, nominal, fitted) in SI as a curve in `unit`; `sigma` of a sample, `averaged` root count."""
    measured, nominal, fitted = (np.asarray(from_si(row, unit)) for row in rows)
    spread = None if sigma is None else float(from_si(sigma, unit)) / averaged
    return Curve(name, unit_in_print(unit), measured, nominal, fitted, spread)


def _block_means(x: Array, edges: Array) -> Array:
    return np.asarray(np.add.reduceat(x, edges[:-1]) / np.diff(edges))
