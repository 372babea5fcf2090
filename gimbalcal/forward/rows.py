r"""A recording held against the model: residuals, and exact derivatives by what is added at each stage.

The model is differentiated stage by stage, each when it is first asked for: S_k = d(outputs) / d(addition at stage k),
by the complex step through the same code. The derivative by any parameter theta of an effect at that stage is one
product,

.. math:: \frac{\partial h}{\partial \theta} = S_k \, \frac{\partial c_\theta}{\partial \theta} ,

with c what the effect adds there, so that hundreds of candidates cost hundreds of small products. That holds row by
row; an effect that is there and follows other rows' force (`spans_rows`: a late time tag) couples the rows behind its
stage, and what acts in front of it is then differentiated through the whole model.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cache

import numpy as np

from gimbalcal.effects import CATALOGUE, Effect, Parameter, Stage, Stimulus, values, with_values, zero_effect
from gimbalcal.effects.effect import GYROSCOPE_STAGES, SENSOR_STAGES
from gimbalcal.forward.model import (
    OTHER_KINDS,
    SENSED_QUANTITIES,
    SENSOR_CHAINS,
    block_force,
    predict,
    reading_after_stages,
    sensors,
)
from gimbalcal.number import STEP, Array, complex_step
from gimbalcal.platform import Platform
from gimbalcal.recording.record import Key
from gimbalcal.rotation import within_half_turn

AXES: Mapping[str, tuple[str, ...]] = {
    "specific_force": ("x", "y", "z"),
    "angular_rate": ("x", "y", "z"),
    "attitude_error": ("roll", "pitch", "yaw"),
    "pointing": ("across", "along"),
}  # of each quantity, in the order of `predict`; gimbal angles are named after the platform's axes
ANGLES = ("gimbal_angle", "attitude_error")  # a difference of these is within half a turn
ONLY_IN = {  # stages that one quantity alone shows
    **dict.fromkeys(GYROSCOPE_STAGES, "angular_rate"),
    Stage.ATTITUDE: "attitude_error",
    Stage.LINE_OF_SIGHT: "pointing",
}


@dataclass(frozen=True, eq=False)
class Rows:
    """C channels of n rows about a model: what was read less what is predicted, and how they answer each stage.

    residual (n, C) in SI, or in sigmas after `over`; seen: what each stage experiences that shows in the channels;
    sensitivity: each of these to (n, C, m) in the units of the residual per unit of each of the m numbers added there;
    reduction: a linear map of columns (n, C, p) to fewer rows, such as means over blocks, that `columns` end with and
    that the residual has been through.
    """

    platform: Platform
    kind: str
    stimulus: Stimulus
    effects: tuple[Effect, ...]
    channels: tuple[Key, ...]
    residual: Array
    seen: Mapping[Stage, Stimulus]
    sensitivity: Callable[[Stage], Array]
    sigma: Array | float = 1.0  # what residual and sensitivity have been divided by
    reduction: Callable[[Array], Array] | None = None
    nuisance: Array | None = None  # (n, C, m) by explicit parameters of no effect: a heading, a mounting, a lag
    fixed_columns: Callable[[Effect, Sequence[Parameter]], Array] | None = None  # `columns`, of affine rows

    def over(self, sigma: Array) -> Rows:
        """Return the rows in units of sigma (C,) or (n, C); reduced rows in those of the reduced ones."""
        reduction = self.reduction
        rows = replace(
            self,
            residual=self.residual / sigma,
            nuisance=None if self.nuisance is None else self.nuisance / sigma[..., None],
        )
        if reduction is not None:
            return replace(rows, reduction=lambda X: reduction(X) / sigma[..., None])
        sensitivity = cache(lambda stage: self.sensitivity(stage) / sigma[..., None])
        return replace(rows, sensitivity=sensitivity, sigma=self.sigma * sigma)

    def reduced(self, reduction: Callable[[Array], Array]) -> Rows:
        """Return the rows with columns (n, C, p), and the residual as one of them, mapped linearly to fewer rows."""
        before = self.reduction
        return replace(
            self,
            residual=reduction(self.residual[:, :, None])[:, :, 0],
            reduction=reduction if before is None else lambda X: reduction(before(X)),
            nuisance=None if self.nuisance is None else reduction(self.nuisance),
        )

    def through(self, stage: Stage, added: Array) -> Array:
        """Return the effect of an addition (n, ...) at a stage on the channels (n, C)."""
        return self._mapped(self._before_reduction(stage, added)[:, :, None])[:, :, 0]

    def _before_reduction(self, stage: Stage, added: Array) -> Array:
        S = self.sensitivity(stage)
        return np.asarray(np.einsum("ncm,nm->nc", S, added.reshape(len(S), -1)))

    def added(self, stage: Stage, index: int, basis: Array) -> Array:
        """Return the effect of each column of a basis, added to one number of a stage, on the channels (n, C, p).

        basis (n, p), or (n k, p) where each row sums what was added in k steps before it.
        """
        S, p = self.sensitivity(stage), basis.shape[1]
        n, C, k = *S.shape[:2], len(basis) // len(S)
        return self._mapped(np.einsum("nck,nkp->ncp", S.reshape(n, C, k, -1)[..., index], basis.reshape(n, k, p)))

    def added_at_instants(self, stage: Stage, index: int, basis: Array) -> Array:
        """Return the effect of each column of a basis as `added` does; basis (n p, m): at p instants, in whose mean a
        row of the n that the stage experiences has it.
        """
        n = len(self.seen[stage].time)
        return self.added(stage, index, basis.reshape(n, -1, basis.shape[1]).mean(axis=1))

    def columns(self, effect: Effect, wanted: Sequence[Parameter]) -> Array:
        """Return derivative (n, C, p) of the channels by the wanted parameters of one effect, at its present values."""
        if self.fixed_columns is not None:
            return self.fixed_columns(effect, wanted)
        s, names = self.seen[effect.stage], self.stimulus.axis_names
        if any(e.spans_rows and e.stage is not effect.stage and _has_size(e) for e in self.effects):
            return self._through_all(effect, wanted)
        if not len(wanted):
            return np.zeros((*self.residual.shape, 0))
        x0, out = values([effect], wanted), []
        for unit in np.eye(len(wanted)):
            (probe,) = with_values([effect], wanted, x0 + 1j * STEP * unit, names)
            out.append(self._before_reduction(effect.stage, np.asarray(probe.contribution(s)).imag / STEP))
        return self._mapped(np.stack(out, axis=-1))

    def _through_all(self, effect: Effect, wanted: Sequence[Parameter]) -> Array:
        """Return the columns through the whole model, however the rows are coupled."""
        effects = (*(e for e in self.effects if e.id != effect.id), effect)

        def read(x: Array) -> Array:
            nudged = with_values(effects, wanted, x, self.stimulus.axis_names)
            return wanted_channels(
                self.platform, predict(self.platform, self.stimulus, nudged, self.kind), self.channels
            )

        X = complex_step(read, values([effect], wanted))
        return self._mapped(X / np.asarray(self.sigma)[..., None])

    def _mapped(self, X: Array) -> Array:
        return X if self.reduction is None else self.reduction(X)

    def jacobian(self, wanted: Sequence[Parameter]) -> Array:
        """Return the derivative (n, C, p) of the channels by parameters of any effects; absent ones count as zero."""
        by_id, names = {e.id: e for e in self.effects}, self.stimulus.axis_names
        out = np.zeros((*self.residual.shape, len(wanted)))
        for effect_id in dict.fromkeys(p.effect for p in wanted):
            effect = by_id.get(effect_id) or zero_effect(CATALOGUE[effect_id], names)
            mine = [i for i, p in enumerate(wanted) if p.effect == effect_id]
            if effect.stage in self.seen:  # no channel shows the others
                out[:, :, mine] = self.columns(effect, [wanted[i] for i in mine])
        return out


def linearise(
    platform: Platform,
    s: Stimulus,
    effects: Sequence[Effect],
    kind: str = "multi-position",
    channels: Sequence[Key] | None = None,
    read: Array | None = None,
    stages: Container[Stage] = frozenset(Stage),
) -> Rows:
    """Return the rows of a recording about the effects; what is added at other than these stages does not count.

    channels: the quantities and axes that are looked at (default: all that the model predicts); read (n, C): what was
    read of them in SI (default: as predicted, for a recording that is only planned).
    """
    met: dict[Stage, Stimulus] = {}
    witnessed = (*effects, *(_PROBES[stage](np.zeros(()), met) for stage in Stage))
    force = None if kind in OTHER_KINDS else block_force(platform, s, witnessed)
    quantities = {q for q, _ in channels} if channels is not None else set(SENSED_QUANTITIES)
    if force is None:
        outputs = predict(platform, s, witnessed, kind)
    else:
        outputs = sensors(force, s, witnessed, quantities)
    keys = tuple(channels) if channels is not None else _all_outputs(platform, outputs)
    predicted = wanted_channels(platform, outputs, keys)
    shown = {q for q, _ in keys}
    seen = {k: met[k] for k in Stage if k in stages and k in met and ONLY_IN.get(k) in (None, *shown)}

    @cache
    def sensitivity(stage: Stage) -> Array:
        if force is not None and stage in SENSOR_STAGES | GYROSCOPE_STAGES:
            return _sensitivity_of_sensors(stage, met[stage], effects, keys)
        shape, columns = _shape_of_addition(stage, platform), []
        for unit in np.eye(int(np.prod(shape))):
            added = np.broadcast_to((1j * STEP * unit).reshape(shape), (len(s.time), *shape))
            probed = (*effects, _PROBES[stage](added))
            if force is None:
                there = predict(platform, s, probed, kind)
            else:
                there = sensors(block_force(platform, s, probed), s, probed, quantities)
            columns.append(wanted_channels(platform, there, keys).imag / STEP)
        return np.stack(columns, axis=-1)

    residual = np.zeros_like(predicted) if read is None else difference(read, predicted, keys)
    return Rows(platform, kind, s, tuple(effects), keys, residual, seen, sensitivity)


def _sensitivity_of_sensors(stage: Stage, met: Stimulus, effects: Sequence[Effect], keys: Sequence[Key]) -> Array:
    """Return the sensitivity (n, C, 3) to a stage of sensors that experiences `met`.

    What is added there goes through the stages behind it alone.
    """
    quantity, (felt, stages) = next(item for item in SENSOR_CHAINS.items() if stage in item[1][1])
    shown = {i: AXES[quantity].index(axis) for i, (q, axis) in enumerate(keys) if q == quantity}
    passed, behind = reading_after_stages(felt, [stage], met, effects), stages[stages.index(stage) + 1 :]
    S = np.zeros((len(passed), len(keys), 3))
    for number, unit in enumerate(np.eye(3)):
        added = reading_after_stages(felt, behind, met.at(**{felt: passed + 1j * STEP * unit}), effects)
        S[:, [*shown], number] = added[:, [*shown.values()]].imag / STEP
    return S


def jacobian(
    platform: Platform,
    s: Stimulus,
    effects: Sequence[Effect],
    wanted: Sequence[Parameter],
    kind: str = "multi-position",
) -> dict[str, Array]:
    """Return the exact derivatives of `predict` by the wanted parameters, which may belong to effects that are absent.

    Returns channel to (n, c, p), SI per SI.
    """
    rows = linearise(platform, s, effects, kind)
    full = rows.jacobian(wanted)
    quantities = dict.fromkeys(q for q, _ in rows.channels)
    return {q: full[:, [i for i, key in enumerate(rows.channels) if key[0] == q]] for q in quantities}


def _has_size(effect: Effect) -> bool:
    """Return whether any parameter of an effect differs from zero."""
    return any(np.any(np.asarray(getattr(effect, f.name)) != 0) for f in fields(effect) if "sigma" in f.metadata)


def difference(read: Array, predicted: Array, channels: Sequence[Key]) -> Array:
    """Read minus predicted (n, C); angles within half a turn."""
    d = read - predicted
    angle = np.array([q in ANGLES for q, _ in channels], dtype=bool)
    return np.asarray(np.where(angle, within_half_turn(d), d))


def wanted_channels(platform: Platform, outputs: Mapping[str, Array], channels: Sequence[Key]) -> Array:
    """Return the wanted channels (n, C) of what `predict` returns."""
    names = platform.axis_names
    return np.stack([outputs[q][:, AXES.get(q, names).index(a)] for q, a in channels], axis=1)


def _all_outputs(platform: Platform, outputs: Mapping[str, Array]) -> tuple[Key, ...]:
    return tuple((q, a) for q in outputs for a in AXES.get(q, platform.axis_names))


def _shape_of_addition(stage: Stage, platform: Platform) -> tuple[int, ...]:
    """Return the shape of what an effect adds to one row at a stage."""
    k = len(platform.axes)
    return {Stage.ENCODER: (k,), Stage.AXIS_TILT: (k, 3)}.get(stage, (3,))


@dataclass(frozen=True)
class _Probe(Effect):
    """Adds a value at a stage and notes in `met` what the stage experienced."""

    value: Array
    met: dict[Stage, Stimulus] = field(default_factory=dict)

    def contribution(self, s: Stimulus) -> Array:
        self.met[self.stage] = s
        return self.value


_PROBES = {stage: type(f"_Probe{stage.name}", (_Probe,), {"stage": stage}) for stage in Stage}
