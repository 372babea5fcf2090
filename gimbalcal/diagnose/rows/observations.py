r"""What was measured, minus what the calibrated model says, in units of its noise; and how it answers each stage.

A recording becomes y (n, C): every channel of every row, residual over one sigma of a row. Derivatives by the input
of a stage of the forward model are taken once (complex step through the same code); the column of any effect is that
sensitivity times what the effect adds there, so hundreds of candidates cost hundreds of small products.

Rows are reduced without loss for slow physics: a dwell to a few block means, a static run to the orthonormal cosine
transform of each channel, in which white noise stays white and a random walk becomes diagonal.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gimbalcal.diagnose.rows.baseline import known_effect
from gimbalcal.effects import CATALOGUE, Effect, Parameter, Stage, Stimulus, absent, parameters, values, with_values
from gimbalcal.errors import InputError
from gimbalcal.estimate.static_run.run import with_phase_of_force
from gimbalcal.forward import jacobian, predict
from gimbalcal.inference.information import information, solve
from gimbalcal.kinematics import lost_to_averaging, refuse_other_platform, stimulus_from_readings
from gimbalcal.number import STEP, Array
from gimbalcal.recording import SENSORS, Recording, block_means, dwells

Key = tuple[str, str]
BASELINE: Mapping[str, tuple[str, ...]] = {
    "multi-position": ("scale_factor", "bias", "scale_nonlinearity", "misalignment", "gimbal_zero"),
    "static-run": (
        "scale_factor", "bias", "misalignment", "gimbal_zero", "base_tilt", "polar_axis_misalignment",
    ),
}  # fmt: skip
SENSOR_OF = {quantity: sensor for sensor, quantity in SENSORS.items()}
CHANNELS: Mapping[str, tuple[str, ...]] = {
    "multi-position": ("specific_force",),
    "static-run": ("specific_force", "gimbal_angle", "attitude_error"),
}
ATTITUDE_AXES = ("roll", "pitch", "yaw")
BLOCKS_IN_ALL = 108  # block means of a multi-position recording: 6 in each of 18 dwells, at least 2 in each of many
MOST_ROWS = 4000  # of a static run: 48 h come as minute means, and half a gigabyte of columns is enough


@dataclass(frozen=True)
class Observations:
    """Whitened residuals y (n, C) of one recording about its calibrated baseline, and its sensitivities."""

    recording: Recording
    stimulus: Stimulus
    channels: tuple[Key, ...]
    sigma: Array  # (C,) SI, one row
    y: Array  # (n, C)
    Z: Array  # (n, C, q) derivatives by the calibration constants, each times its prior sigma
    baseline: tuple[Effect, ...]
    constants: tuple[Parameter, ...]
    seen: Mapping[Stage, Stimulus]
    sensitivity: Mapping[Stage, Array]  # (n, C, m)
    block: Array  # (n,) ordinal of the block of each row; empty for a static run
    heavy: float = 0.0  # excess kurtosis of the samples
    weight: Array | None = None  # (n, C) of mean one where tails are heavy; None: all alike

    @property
    def kind(self) -> str:
        """Kind of the recording."""
        return self.recording.kind

    @property
    def starts(self) -> Array:
        """First row of each block."""
        return np.flatnonzero(np.diff(self.block, prepend=-1))

    def reduce(self, columns: Array) -> Array:
        """Columns (n, C, p) to rows (R, p): weighted block means times the root of their count, or cosine transform."""
        n, C, p = columns.shape
        if self.kind == "static-run":
            from scipy.fft import dct

            return np.asarray(dct(self.single(columns), axis=0, norm="ortho")).reshape(n * C, p)
        count = np.diff(np.append(self.starts, n))
        if self.weight is None:
            total = np.add.reduceat(columns, self.starts, axis=0) / np.sqrt(count)[:, None, None]
        else:
            share = np.sqrt(count)[:, None] / np.add.reduceat(self.weight, self.starts, axis=0)
            total = np.add.reduceat(columns * self.weight[:, :, None], self.starts, axis=0) * share[:, :, None]
        return np.asarray(total.reshape(len(count) * C, p))

    def single(self, columns: Array) -> Array:
        """Columns (n, C, p) such that white noise has unit variance in every row: times the root of its weight."""
        return columns if self.weight is None else np.asarray(columns * np.sqrt(self.weight)[:, :, None])

    def through(self, stage: Stage, added: Array) -> Array:
        """What an addition (n, ...) at a stage does to the channels, in sigma: (n, C)."""
        flat = added.reshape(len(added), -1)
        return np.asarray(np.einsum("ncm,nm->nc", self.sensitivity[stage], flat))

    def columns(self, effect: Effect, wanted: Sequence[Parameter]) -> Array:
        """Whitened derivative (n, C, p) by the wanted parameters of an effect, at its present values."""
        s, names = self.seen[effect.stage], self.stimulus.axis_names
        x0 = values([effect], wanted)
        out = []
        for unit in np.eye(len(wanted)):
            (probe,) = with_values([effect], wanted, x0 + 1j * STEP * unit, names)
            out.append(self.through(effect.stage, np.asarray(probe.contribution(s)).imag / STEP))
        return np.stack(out, axis=-1)


@dataclass(frozen=True)
class _Probe(Effect):
    """Adds a constant at a stage and remembers what the stage experienced."""

    value: Array
    met: dict[Stage, Stimulus]

    def contribution(self, s: Stimulus) -> Array:
        self.met[self.stage] = s
        n = len(s.time)
        return np.broadcast_to(self.value, (n, *np.shape(self.value)))


_PROBES = {stage: type(f"_Probe{stage.name}", (_Probe,), {"stage": stage}) for stage in Stage}


def observe(
    recording: Recording, baseline: Sequence[str] = (), known: Sequence[Effect] = (), steps: int = 2
) -> Observations:
    """Fit the baseline of this kind of recording and return residuals and sensitivities about it.

    `known` are values to start from, `steps` the Gauss-Newton steps (none for a recording that is only planned).
    Raises InputError for a kind without a forward model or with missing channels.
    """
    recording = _at_rest(recording)
    channels = measured_channels(recording)
    unread = recording.kind == "static-run" and ("gimbal_angle", "platform") not in channels
    s = stimulus_from_readings(with_phase_of_force(recording) if unread else recording)
    measured = _measured(recording, channels, s.force)
    sigma = row_sigma(recording, channels, measured, s.visit)
    ids = tuple(baseline) or BASELINE[recording.kind]
    constants = tuple(p for i in ids for p in parameters(known_effect(i), s.axis_names) if _has_axis(p, recording))
    effects = with_values(tuple(known), constants, values(tuple(known), constants), s.axis_names)
    for _ in range(steps):
        y, Z = _linear(recording, s, effects, constants, channels, measured, sigma)
        found = solve(information(Z, y.ravel(), constants))
        effects = with_values(effects, constants, values(effects, constants) + found.x, s.axis_names)
    y, Z = _linear(recording, s, effects, constants, channels, measured, sigma)
    seen, sensitivity = _sensitivities(recording, s, effects, channels, sigma)
    Z = Z * np.array([p.sigma for p in constants])
    o = Observations(recording, s, channels, sigma, y, Z, effects, constants, seen, sensitivity, _blocks(recording))
    refuse_too_little(recording, o.reduce(Z))
    return o


def _at_rest(recording: Recording) -> Recording:
    """The rows that stand still, a long static run as means of blocks. Raises InputError where there are none."""
    if recording.kind not in CHANNELS:
        raise InputError(f"{recording.title!r} is a {recording.kind} recording; `diagnose` takes {', '.join(CHANNELS)}")
    if recording.kind == "static-run":
        refuse_other_platform(recording)
    if recording.position is not None and np.any(recording.position == 0):
        recording = recording.select(recording.position > 0)
    if not len(recording.time):
        raise InputError(f"{recording.title!r} has no dwell: every row has position 0, so nothing in it is at rest")
    if recording.kind == "static-run" and len(recording.time) > MOST_ROWS:
        return block_means(recording, -(-len(recording.time) // MOST_ROWS))
    return recording


def _measured(recording: Recording, channels: Sequence[Key], force: Array) -> Array:
    """Readings (n, C) in SI, with what averaging took from a turning force (n, 3) put back."""
    measured = np.stack([recording.channels[key] for key in channels], axis=-1)
    if recording.kind == "static-run":
        at = [i for i, (q, _) in enumerate(channels) if q == "specific_force"]
        lost = lost_to_averaging(recording, force)
        measured[:, at] += lost[:, ["xyz".index(channels[i][1]) for i in at]]
    return measured


def refuse_too_little(recording: Recording, Z: Array) -> None:
    """Raise InputError where the constants of the model, columns Z (N, q), take up all N numbers."""
    if len(Z) <= Z.shape[-1] and np.linalg.matrix_rank(Z / (np.linalg.norm(Z, axis=0) + 1e-300)) == len(Z):
        raise InputError(
            f"{recording.title!r} gives {len(Z)} numbers, and the constants of the model take up {len(Z)} of them: "
            "nothing is left to compare; give a longer recording, or a --baseline of fewer effects"
        )


def _has_axis(p: Parameter, recording: Recording) -> bool:
    """A gimbal that was not recorded has no zero to fit."""
    return p.axis not in recording.platform.axis_names or p.axis in recording.axes("gimbal_angle")


def measured_channels(recording: Recording) -> tuple[Key, ...]:
    """Channels of this kind of recording that the forward model predicts and the recording has."""
    keys = [(quantity, axis) for quantity in CHANNELS[recording.kind] for axis in _axes(quantity, recording)]
    out = [key for key in keys if key in recording.channels]
    if recording.kind == "multi-position" and not recording.has("gimbal_angle"):
        raise InputError(
            f"{recording.title!r} has no gimbal_angle column, so its attitude is not known; add the readouts to "
            "[columns], or name the platform 'bench'"
        )
    if not any(q == "specific_force" for q, _ in out):
        raise InputError(f"{recording.title!r} has no specific_force channel: there is nothing to explain")
    return tuple(out)


def _axes(quantity: str, recording: Recording) -> tuple[str, ...]:
    """Axes of a quantity in the order in which the forward model returns them."""
    order = {"specific_force": ("x", "y", "z"), "attitude_error": ATTITUDE_AXES}
    return order.get(quantity, recording.platform.axis_names)


def row_sigma(recording: Recording, channels: Sequence[Key], measured: Array, visit: Array) -> Array:
    """One sigma (C,) of a row: the header's over the root of the samples in a row, else successive differences.

    Differences are taken of measured (n, C) within a visit (n,). Raises InputError where there are none.
    """
    inside = visit[2:] == visit[:-2]
    out = []
    for (quantity, _), x in zip(channels, measured.T, strict=True):
        stated = recording.noise.get(SENSOR_OF[quantity])
        if stated is not None:
            out.append(stated / np.sqrt(np.median(recording.weight)))
        else:
            second = np.diff(x, 2)[inside]
            if not len(second):
                raise InputError(
                    f"{recording.title!r} states no noise of the {SENSOR_OF[quantity]} and holds too few rows in a "
                    "position to show it: write it into [noise] of recording.toml"
                )
            out.append(np.median(np.abs(second)) / 0.6745 / np.sqrt(6) + 1e-15)
    return np.array(out)


def select(predicted: Mapping[str, Array], recording: Recording, channels: Sequence[Key]) -> Array:
    """The wanted channels (n, C, ...) of what the forward model returns."""
    return np.stack([predicted[q][:, _axes(q, recording).index(a)] for q, a in channels], axis=1)


def _difference(measured: Array, predicted: Array, channels: Sequence[Key]) -> Array:
    d = measured - predicted
    angle = np.array([q != "specific_force" for q, _ in channels])
    return np.asarray(np.where(angle, (d + np.pi) % (2 * np.pi) - np.pi, d))


def _linear(
    recording: Recording, s: Stimulus, effects: Sequence[Effect], constants: Sequence[Parameter],
    channels: Sequence[Key], measured: Array, sigma: Array,
) -> tuple[Array, Array]:  # fmt: skip
    predicted = select(predict(recording.platform, s, effects, recording.kind), recording, channels)
    J = jacobian(recording.platform, s, effects, constants, recording.kind)
    y = _difference(measured, predicted, channels) / sigma
    return y, select(J, recording, channels) / sigma[:, None]


def _sensitivities(
    recording: Recording, s: Stimulus, effects: Sequence[Effect], channels: Sequence[Key], sigma: Array
) -> tuple[dict[Stage, Stimulus], dict[Stage, Array]]:
    met: dict[Stage, Stimulus] = {}
    out = {}
    for stage, probe in _PROBES.items():
        shape = _added(stage, recording)
        rows = []
        for unit in np.eye(int(np.prod(shape))):
            added = probe(value=(1j * STEP * unit).reshape(shape), met=met)
            outputs = predict(recording.platform, s, (*effects, added), recording.kind)
            rows.append(select({q: v.imag / STEP for q, v in outputs.items()}, recording, channels))
            if stage not in met:
                break
        if stage in met:
            out[stage] = np.stack(rows, axis=-1) / sigma[:, None]
            met[stage] = _real(met[stage])
    return met, out


def _added(stage: Stage, recording: Recording) -> tuple[int, ...]:
    """Shape of what an effect adds to one row at a stage."""
    k = len(recording.platform.axes)
    shapes: dict[Stage, tuple[int, ...]] = {Stage.ENCODER: (k,), Stage.AXIS_TILT: (k, 3)}
    return shapes.get(stage, (3,))


def _real(s: Stimulus) -> Stimulus:
    return s.at(force=s.force.real, angle=s.angle.real)


def _blocks(recording: Recording) -> Array:
    """Ordinal of the block (n,) that each row belongs to: equal parts of each dwell."""
    if recording.kind == "static-run":
        return np.zeros(0, dtype=int)
    stays = dwells(recording)
    parts = max(2, min(6, BLOCKS_IN_ALL // max(1, len(stays))))
    out = np.zeros(len(recording.time), dtype=int)
    for i, d in enumerate(stays):
        n = d.stop - d.start
        out[d.start : d.stop] = i * parts + np.arange(n) * parts // n
    return out


def absent_effect(effect_id: str, s: Stimulus, source: str = "", **constants: float) -> Effect:
    """An effect of the catalogue with zero parameters, these non-linear constants, following covariate `source`."""
    named: dict[str, Any] = {"covariate": source} if source else {}
    return replace(absent(CATALOGUE[effect_id], s.axis_names), **constants, **named)


def restimulated(o: Observations, shift: Array, stage: Stage) -> Stimulus:
    """What a stage experiences once the calibration constants are shifted by (q,) prior sigmas."""
    x = values(o.baseline, o.constants) + shift * np.array([p.sigma for p in o.constants])
    effects = with_values(o.baseline, o.constants, x, o.stimulus.axis_names)
    met: dict[Stage, Stimulus] = {}
    probe = _PROBES[stage](value=np.zeros(_added(stage, o.recording)), met=met)
    predict(o.recording.platform, o.stimulus, (*effects, probe), o.kind)
    return met[stage]
