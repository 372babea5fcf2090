r"""Simulated rest positions and revolutions of many inertial units at once: Wang et al. (2019), section 5.1.

Truths are drawn from the ranges of Tables 2 and 3. What the paper does not print is stated here: the white noise of
100 ug and 0.01 deg/h is that of one sample at 100 Hz; an accelerometer position lasts `REST` seconds, a gyroscope
position `GYRO_REST`, and each rotation is `REVOLUTIONS` turns at 10 deg/s each way. A turntable error tips the unit in
each position and tips each rotation axis; a whole revolution is closed against an index, so its angle is exact
(Eq. (29) knows theta: a table that closes it wrongly by some share makes the scale factors wrong by that share, and
no independence of the turntable that the paper speaks of covers this).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gimbalcal.earth import EARTH_RATE, G0
from gimbalcal.estimate.pulses.gravity_norm import (
    PulseFit,
    Pulses,
    accelerometer_pulses,
    apply_to_vectors,
    unit_lower_triangular,
)
from gimbalcal.estimate.pulses.whole_turns import Revolutions, gyroscope_pulses
from gimbalcal.number import Array, apply_matrix
from gimbalcal.rotation import exponential, normal_to
from gimbalcal.schedule.published import FIFTEEN_POSITIONS, REVOLUTION_AXES

POSITIONS: Array = -FIFTEEN_POSITIONS.gravity_directions()  # (15, 3) unit specific force in the sensor frame, Figure 2
RATE = 100.0  # Hz
REST = 200.0  # s in an accelerometer position: 100 ug become 0.7 ug
GYRO_REST = 5400.0  # s in a gyroscope position
REVOLUTIONS = 10
SPEED = np.deg2rad(10.0)  # rad/s of a revolution
ACCELEROMETER_NOISE = 100e-6 * G0  # m/s^2, one sample
GYROSCOPE_NOISE = np.deg2rad(0.01) / 3600  # rad/s, one sample
LATITUDE = np.deg2rad(32.0)  # Nanjing
BLOCKS = 72  # of a revolution, 5 deg each: midpoints on a period integrate N and N^2 to rounding


@dataclass(frozen=True)
class Trials:
    """Truth and estimate of r runs, with chi2 of the estimate's residuals."""

    truth: Pulses
    fit: PulseFit

    @property
    def error(self) -> Array:
        """Estimate minus truth (r, 15) in SI."""
        return self.fit.pulses.vector() - self.truth.vector()


def generators(seed: int, runs: range) -> list[np.random.Generator]:
    """One generator per run, from the seed and the number of the run: the same however runs are shared out."""
    return [np.random.default_rng([seed, run]) for run in runs]


def _stacked_draws(rngs: list[np.random.Generator], shape: tuple[int, ...]) -> Array:
    return np.stack([rng.standard_normal(shape) for rng in rngs])


def _uniform(rngs: list[np.random.Generator], low: float, high: float) -> Array:
    return np.stack([rng.uniform(low, high, 3) for rng in rngs])


def tipped_directions(directions: Array, tips: Array) -> Array:
    """Return unit vectors (..., 3) turned by the rotation vectors `tips` [rad]."""
    return apply_matrix(exponential(-tips), directions)


def accelerometer_truth(rngs: list[np.random.Generator]) -> Pulses:
    """Return triads drawn as Table 2 says, in SI (1 g = 9.80665 m/s^2)."""
    scales = ((1e-6, 5e-6), (-5e-15, 5e-15), (-5e-21, 5e-21), (-1e-2, 1e-2))
    K1, K2, K3, bias = (_uniform(rngs, low, high) * G0 for low, high in scales)
    return Pulses(K1, K2, K3, bias, _uniform(rngs, -5e-4, 5e-4))


def accelerometers(seed: int, runs: range, tilt: float, order: int = 3) -> Trials:
    """Return Table 2: fifteen positions tipped by `tilt` [rad, one sigma per axis], counted, averaged and fitted."""
    rngs = generators(seed, runs)
    truth = accelerometer_truth(rngs)
    force = tipped_directions(POSITIONS, tilt * _stacked_draws(rngs, POSITIONS.shape)) * G0
    sigma = ACCELEROMETER_NOISE / np.sqrt(REST * RATE)
    noise = sigma * _stacked_draws(rngs, POSITIONS.shape)
    # Eq. (2): what the counts stand for, plus the noise along the axes, is the true force
    counts = truth.counts(force - apply_to_vectors(unit_lower_triangular(truth.E), noise))
    return Trials(truth, accelerometer_pulses(counts, G0, sigma, order))


def gyroscope_truth(rngs: list[np.random.Generator]) -> Pulses:
    """Return triads drawn as Table 3 says, in SI (rad)."""
    degree = np.pi / 180
    K1, K2 = (_uniform(rngs, a * degree, b * degree) for a, b in ((1e-7, 5e-7), (-5e-17, 5e-17)))
    return Pulses(K1, K2, 0 * K1, _uniform(rngs, -5e-6 * degree, 5e-6 * degree), _uniform(rngs, -5e-4, 5e-4))


def gyroscope_revolutions(truth: Pulses, rngs: list[np.random.Generator], tilt: float) -> Revolutions:
    """Return counts of nine revolutions both ways and of fifteen dwells; turntable tipped by `tilt` [rad], Earth on."""
    axes = tipped_directions(REVOLUTION_AXES, tilt * _stacked_draws(rngs, REVOLUTION_AXES.shape))
    duration = REVOLUTIONS * 2 * np.pi / SPEED
    one, other = (_revolution(truth, axes, sign, duration, rngs) for sign in (1.0, -1.0))
    up = tipped_directions(POSITIONS, tilt * _stacked_draws(rngs, POSITIONS.shape))
    sigma = GYROSCOPE_NOISE / np.sqrt(GYRO_REST * RATE)
    noise = apply_to_vectors(unit_lower_triangular(truth.E), sigma * _stacked_draws(rngs, POSITIONS.shape))
    rest = truth.counts(_earth_at_rest(up) - noise)
    return Revolutions(one, other, rest, duration, SPEED * duration, GYROSCOPE_NOISE * np.sqrt(duration / RATE), sigma)


def gyroscopes(seed: int, runs: range, tilt: float, *, both_senses: bool = True) -> Trials:
    """Return Table 3: nine revolutions each way and fifteen rests, counted and fitted."""
    rngs = generators(seed, runs)
    truth = gyroscope_truth(rngs)
    return Trials(truth, gyroscope_pulses(gyroscope_revolutions(truth, rngs, tilt), both_senses=both_senses))


def _revolution(truth: Pulses, axes: Array, sign: float, duration: float, rngs: list[np.random.Generator]) -> Array:
    """Return integrals of N and N^2 (r, k, 2, 3) over the revolutions about each axis (r, k, 3), which points up."""
    phase = sign * 2 * np.pi * (np.arange(BLOCKS) + 0.5) / BLOCKS
    across = normal_to(axes)
    third = np.cross(axes, across)
    north = np.cos(phase)[:, None] * across[:, :, None] - np.sin(phase)[:, None] * third[:, :, None]
    earth = EARTH_RATE * (np.cos(LATITUDE) * north + np.sin(LATITUDE) * axes[:, :, None])
    rate = earth + sign * SPEED * axes[:, :, None]
    noise = GYROSCOPE_NOISE / np.sqrt(duration * RATE / BLOCKS) * _stacked_draws(rngs, rate.shape[1:])
    flat = (rate - noise @ np.swapaxes(unit_lower_triangular(truth.E), -1, -2)[:, None]).reshape(len(axes), -1, 3)
    N = truth.counts(flat).reshape(rate.shape)
    return np.stack([N.sum(2), (N**2).sum(2)], axis=2) * duration / BLOCKS


def _earth_at_rest(up: Array) -> Array:
    """Return Earth's rate (r, m, 3) [rad/s] in a unit with vertical `up`, headings spread by the golden angle."""
    across = normal_to(up)
    heading = np.pi * (3 - np.sqrt(5)) * np.arange(up.shape[-2])[:, None]
    north = np.cos(heading) * across + np.sin(heading) * np.cross(up, across)
    return np.asarray(EARTH_RATE * (np.cos(LATITUDE) * north + np.sin(LATITUDE) * up))
