r"""Gyroscopes that stand still: the mean output of each dwell, less what the effects and the Earth say.

A unit at rest in many attitudes reads its bias, what gravity does to it, and the Earth,

.. math:: y_k = \varepsilon + G f_k + \Omega \sin L \, f_k / g + \Omega \cos L \, n_k + \nu_k,
          \qquad \nu_k^2 \sim \sigma^2 / n_k ,

with f_k the calibrated force of dwell k and n_k its samples. The Earth's vertical part is exactly a g-sensitivity
common to all axes: it is taken off where the latitude is known, and else a nuisance of one sigma Omega / sqrt 3. No
dwell says where north is, but the turns say how the unit turned from one dwell to the next, and gravity keeps the level
true. With h_k a horizontal direction in dwell k, carried by P_k from the one before, and d_k along gravity,

.. math:: h_k \propto (1 - d_k d_k^T) P_k h_{k-1}, \qquad
          \Omega \cos L \, n_k = \omega_1 h_k + \omega_2 \, d_k \times h_k

with two nuisances for all dwells that logged turns join, of variance (Omega cos L)^2 / 2 each; where the latitude is
not known, Omega^2 / 3. A bias is another after every switching on: the differences of the levels of power-ups are
nuisances without a prior.

On gimbals that stand on a level base the readouts say how the unit stands, C_k, and alpha, how far the base's x axis
points east of north, is the one nuisance:

.. math:: y_k = \varepsilon + C_k \, \Omega \, (\cos L \cos\alpha, -\cos L \sin\alpha, -\sin L)^T + \nu_k .

So the Earth's rate can also be taken off all readings there, with the heading that the dwells tell.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from gimbalcal.calibration import Calibration
from gimbalcal.earth import EARTH_RATE
from gimbalcal.effects import Effect, Stimulus
from gimbalcal.effects.baseline_effects import GYROSCOPE_BIAS
from gimbalcal.effects.effect import GYROSCOPE_STAGES
from gimbalcal.forward import Rows, gyroscopes, linearise
from gimbalcal.kinematics import stimulus_from_angles, stimulus_from_readings
from gimbalcal.number import Array
from gimbalcal.platform import BENCH
from gimbalcal.recording import Recording, dwell_means, dwells
from gimbalcal.recording.record import FORCE, RATE, RATES
from gimbalcal.rotation import normal_to
from gimbalcal.views.core import Measurement, View, nuisance, recording_fields
from gimbalcal.views.noise import NoiseModel, of_channels

VERTICAL, HEADING = "vertical rate", "heading"
MIN_RATE_SIGMA = 1e-9  # rad/s; below any gyroscope: where samples tell no noise, the scatter of the dwells is all of it
MAX_TURN_ERROR_RAD = 0.2  # by which a turn misses gravity: it was not what the gyroscopes say
REST_RATES = Measurement(
    "rest rates", "deg/h", "positions", channels="the rates at rest", channel="the rate about {axis} at rest",
    acts_on=(RATE,), patterns=frozenset({"fast time", "orientation", "temperature"}),
)  # fmt: skip


def horizontal_sigma(latitude: float | None) -> float:
    """One sigma [rad/s] of each component of the Earth's horizontal rate at a latitude [rad], or anywhere (None)."""
    return EARTH_RATE * float(np.sqrt(1 / 3) if latitude is None else abs(np.cos(latitude)) / np.sqrt(2))


def rest_rates(
    recording: Recording, accelerometers: Calibration, scale: float, turns: Mapping[int, Array] | None
) -> View:
    """Return the view of the mean rates of dwells; `accelerometers` calibrates the force, `scale` is rad/s per unit.

    turns: rotation of the frame (3, 3) into each dwell from the one before, where it was logged. The noise of a row is
    that of the mean of its samples, and `MIN_RATE_SIGMA` where one row per dwell says nothing of it.
    """
    means = dwell_means(recording)
    calibrated = dwell_means(accelerometers.apply(recording))
    force = calibrated.triad(FORCE)
    s = stimulus_from_readings(calibrated).at(force=force, rate=np.zeros_like(force))  # at rest
    latitude, g = recording.site.latitude, recording.site.gravity
    known = None if latitude is None else EARTH_RATE * np.sin(latitude)
    sigma = np.maximum(scale * sigma_of_means(recording), MIN_RATE_SIGMA)
    columns = [
        (nuisance("level of a power-up", a, "rad/s", np.inf), column)
        for c, a in enumerate("xyz")
        for column in _power_up_columns(means.session, sigma[:, c], c)
    ]
    if known is None:
        columns.append((nuisance(VERTICAL, "", "rad/s", EARTH_RATE / np.sqrt(3)), force / g))
    if not recording.platform.axes:  # gimbals tell the attitude, and no heading is carried through turns
        down = force / np.linalg.norm(force, axis=1, keepdims=True)
        rate = horizontal_sigma(latitude)
        columns += [(nuisance("horizontal rate", "", "rad/s", rate), x) for x in _heading_columns(down, turns or {})]
    N = np.stack([x for _, x in columns], axis=-1) if columns else None
    noise = NoiseModel(sigma, sample=sigma, wander=of_channels(len(sigma), 3), of_each_channel=True)
    y = scale * means.triad(RATE) - (known or 0.0) * force / g
    return _view(means, s, y, N, noise=noise, nuisances=tuple(p for p, _ in columns))


def rest_rates_on_gimbals(recording: Recording, sigma: Array) -> View:
    """Return the view of the mean rates of dwells whose attitude gimbals tell; sigma (m, 3) [rad/s]."""
    means = dwell_means(recording)
    C, L = means.platform.attitude(means.angles()), float(recording.site.latitude or 0.0)
    s, y = stimulus_from_angles(means), means.triad(RATE) + EARTH_RATE * np.sin(L) * C[..., 2]
    north, east = EARTH_RATE * np.cos(L) * C[..., 0], EARTH_RATE * np.cos(L) * C[..., 1]

    def about(x: Array) -> View:
        horizontal = north * np.cos(x[0]) - east * np.sin(x[0])
        slope = -north * np.sin(x[0]) - east * np.cos(x[0])
        noise, free = NoiseModel(sigma, scale_known=True), (nuisance(HEADING, "", "rad", np.inf),)
        return _view(means, s, y - horizontal, slope[..., None], noise=noise, about=about, nuisances=free)

    return about(np.zeros(1))


def _view(means: Recording, s: Stimulus, y: Array, N: Array | None, **fields: Any) -> View:
    def rows(effects: Sequence[Effect]) -> Rows:
        return replace(linearise(BENCH, s, effects, channels=RATES, read=y, stages=GYROSCOPE_STAGES), nuisance=N)

    return View(REST_RATES, channels=RATES, **recording_fields(means), stimulus=s, label=s.position,
                evaluate=rows, stages=GYROSCOPE_STAGES, baseline=GYROSCOPE_BIAS, groups=np.arange(len(y)),
                **fields)  # fmt: skip


def sigma_of_means(recording: Recording) -> Array:
    """One sigma (m, 3) of the mean rates of dwells by the scatter of the samples, in the unit of the readings."""
    y, root, means = recording.triad(RATE), np.sqrt(recording.weight)[:, None], dwell_means(recording)
    each = zip(dwells(recording), means.triad(RATE), strict=True)
    inside = np.concatenate([(y[d.rows] - m) * root[d.rows] for d, m in each])  # rows may be means themselves
    return np.asarray(np.sqrt((inside**2).mean(0)) / np.sqrt(means.weight)[:, None])


def _power_up_columns(session: Array, sigma: Array, channel: int) -> list[Array]:
    """Columns (m, 3) of how the level of each power-up is off the mean of all; none for a single one."""
    if not session.any():
        return []
    each, weight = np.equal.outer(session, np.unique(session)).astype(float), sigma**-2
    return list(np.einsum("ms,c->smc", each - weight @ each / weight.sum(), np.eye(3)[channel]))


def _heading_columns(down: Array, turns: Mapping[int, Array]) -> list[Array]:
    """Two columns (m, 3) for each group of dwells that turns join: unit rates across gravity, down (m, 3)."""
    columns: list[Array] = []
    heading = np.zeros(3)
    for k, d in enumerate(down):
        C = turns.get(k)
        if C is None or np.linalg.norm(C @ down[k - 1] - d) > MAX_TURN_ERROR_RAD:
            heading = normal_to(d)
            columns.append(np.zeros((2, len(down), 3)))
        else:
            heading = C @ heading
            heading = heading - d * (d @ heading)
            heading = heading / np.linalg.norm(heading)
        columns[-1][:, k] = heading, np.cross(d, heading)
    return [x for pair in columns if np.count_nonzero(np.abs(pair).sum(axis=(0, 2))) > 1 for x in pair]


def without_earth_rate(recording: Recording, gyro: Sequence[Effect] = ()) -> Recording:
    """Return rates less what the gyroscopes, with these effects, read of the Earth's rate; counts are unchanged."""
    L = recording.site.latitude
    if L is None or recording.counted(RATE):
        return recording
    rest = dwell_means(recording)
    A = EARTH_RATE * rest.platform.attitude(rest.angles())
    u = rest.triad(FORCE) / rest.site.gravity
    by_force = np.einsum("ij,nk->nijk", np.eye(3), u).reshape(len(u), 3, 9)
    level = np.concatenate([np.einsum("ij,n->nij", np.eye(3), np.ones(len(u))), by_force], axis=-1)
    columns = np.concatenate([np.cos(L) * A[..., :2], EARTH_RATE * level], axis=-1).reshape(3 * len(u), -1)
    north = np.linalg.lstsq(columns, rest.triad(RATE).ravel(), rcond=1e-9)[0][:2]
    size = float(np.hypot(*north))
    north = north / size if size > 0 else np.array([1.0, 0.0])
    earth = EARTH_RATE * recording.platform.attitude(recording.angles()) @ np.array([*(np.cos(L) * north), -np.sin(L)])
    readings = gyroscopes(earth, stimulus_from_readings(recording), gyro)
    rate = recording.triad(RATE) - readings
    channels = {**recording.channels, **{(RATE, a): rate[:, i] for i, a in enumerate("xyz")}}
    # at the equator the vertical has no part of the Earth's rate: nothing is left there to take off once more
    return replace(recording, channels=channels, site=replace(recording.site, latitude=0.0))
