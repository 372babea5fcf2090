r"""A recording held against the model: residuals, and exact derivatives by what is added at each stage.

The model is differentiated once, stage by stage: S_k = d(outputs) / d(addition at stage k), by the complex step through
the same code. The derivative by any parameter theta of an effect at that stage is then one product,

.. math:: \frac{\partial h}{\partial \theta} = S_k \, \frac{\partial c_\theta}{\partial \theta} ,

with c what the effect adds there, so that hundreds of candidates cost hundreds of small products. That holds row by
row; an effect that is there and follows other rows' force (`spans_rows`: a late time tag) couples the rows behind its
stage, and what acts in front of it is then differentiated through the whole model.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from gimbalcal.effects import CATALOGUE, Effect, Parameter, Stage, Stimulus, values, with_values, zero_effect
from gimbalcal.effects.effect import GYROSCOPE_STAGES
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

    residual (n, C); sensitivity: stage to (n, C, m) per unit of each of the m numbers added there, both in SI, or in
    sigmas after `over`; seen: what each stage experiences; reduction: a linear map of columns (n, C, p) to fewer rows,
    such as means over blocks, that `columns` end with and that the residual has been through.
    """

    platform: Platform
    kind: str
    stimulus: Stimulus
    effects: tuple[Effect, ...]
    channels: tuple[Key, ...]
    residual: Array
    seen: Mapping[Stage, Stimulus]
    sensitivity: Mapping[Stage, Array]
    sigma: Array | float = 1.0  # what residual and sensitivity have been divided by
    reduction: Callable[[Array], Array] | None = None
    nuisance: Array | None = None  # (n, C, m) by explicit parameters of no effect: a heading, a mounting, a lag
    fixed_columns: Callable[[Effect, Sequence[Parameter]], Array] | None = None  # `columns`, of affine rows

    def over(self, sigma: Array) -> Rows:
        """Return the rows in units of sigma (C,) or (n, C)."""
        return replace(
            self,
            residual=self.residual / sigma,
            sensitivity={k: S / sigma[..., None] for k, S in self.sensitivity.items()},
            sigma=self.sigma * sigma,
            nuisance=None if self.nuisance is None else self.nuisance / sigma[..., None],
        )

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
        """Return the effect of an addition (n, ...) at a stage on the channels (n, C), before any reduction."""
        S = self.sensitivity[stage]
        return np.asarray(np.einsum("ncm,nm->nc", S, added.reshape(len(S), -1)))

    def added(self, stage: Stage, index: int, basis: Array) -> Array:
        """Return the effect of each column of a basis, added to one number of a stage, on the channels (n, C, p).

        basis (n, p), or (n k, p) where each row sums what was added in k steps before it.
        """
        S, p = self.sensitivity[stage], basis.shape[1]
        n, C, k = *S.shape[:2], len(basis) // len(S)
        return self._mapped(np.einsum("nck,nkp->ncp", S.reshape(n, C, k, -1)[..., index], basis.reshape(n, k, p)))

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
            out.append(self.through(effect.stage, np.asarray(probe.contribution(s)).imag / STEP))
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
            if effect.stage in self.sensitivity:  # no channel shows the others
                out[:, :, mine] = self.columns(effect, [wanted[i] for i in mine])
        return out


def linearise(
    platform: Platform,
    s: Stimulus,
    effects: Sequence[Effect],
    kind: str = "multi-position",
    channels: Sequence[Key] | None = None,
    read: Array | None = None,
    stages: Iterable[Stage] = Stage,
) -> Rows:
    """Return the rows of a recording about the effects, with the sensitivity of every channel to each of the stages.

    channels: the quantities and axes that are looked at (default: all that the model predicts); read (n, C): what was
    read of them in SI (default: as predicted, for a recording that is only planned).
    """
    force = None if kind in OTHER_KINDS else block_force(platform, s, effects)
    quantities = {q for q, _ in channels} if channels is not None else set(SENSED_QUANTITIES)

    def outputs(effects: Sequence[Effect]) -> dict[str, Array]:
        if force is None:
            return predict(platform, s, effects, kind)
        return sensors(block_force(platform, s, effects), s, effects, quantities)

    unperturbed = outputs(effects) if force is None else sensors(force, s, effects, quantities)
    keys = tuple(channels) if channels is not None else _all_outputs(platform, unperturbed)
    predicted = wanted_channels(platform, unperturbed, keys)
    stimuli: dict[Stage, Stimulus] = {}
    sensitivity: dict[Stage, Array] = {}
    stages = sorted(stages, key=list(Stage).index)  # a set has another order in every run
    of_sensors = {} if force is None else sensitivities_of_sensors(s.at(force=force), effects, keys, stages)
    for stage in stages:
        if stage in ONLY_IN and not any(q == ONLY_IN[stage] for q, _ in keys):
            continue
        if stage in of_sensors:
            stimuli[stage], sensitivity[stage] = of_sensors[stage]
            continue
        columns = []
        shape = _shape_of_addition(stage, platform)
        for unit in np.eye(int(np.prod(shape))):
            probe = _PROBES[stage](value=(1j * STEP * unit).reshape(shape), met=stimuli)
            added = wanted_channels(platform, outputs((*effects, probe)), keys)
            columns.append(added.imag / STEP)
            if stage not in stimuli:
                break
        if stage in stimuli:
            sensitivity[stage] = np.stack(columns, axis=-1)
            met = stimuli[stage]
            stimuli[stage] = met.at(force=met.force.real, angle=met.angle.real, rate=met.rate.real)
    residual = np.zeros_like(predicted) if read is None else difference(read, predicted, keys)
    return Rows(platform, kind, s, tuple(effects), keys, residual, stimuli, sensitivity)


def sensitivities_of_sensors(
    s: Stimulus, effects: Sequence[Effect], keys: Sequence[Key], wanted: Sequence[Stage]
) -> dict[Stage, tuple[Stimulus, Array]]:
    """Return what the wanted stages of sensors that feel `s` experience, and the sensitivity (n, C, 3) to each.

    What is added at a stage goes through the stages behind it alone.
    """
    out = {}
    for quantity, (felt, stages) in SENSOR_CHAINS.items():
        shown = {i: AXES[quantity].index(axis) for i, (q, axis) in enumerate(keys) if q == quantity}
        met = s
        for k, stage in enumerate(stages if shown and not set(wanted).isdisjoint(stages) else ()):
            passed = reading_after_stages(felt, stages[k : k + 1], met, effects)
            if stage in wanted:
                S = np.zeros((len(passed), len(keys), 3))
                for number, unit in enumerate(np.eye(3)):
                    added = reading_after_stages(
                        felt, stages[k + 1 :], met.at(**{felt: passed + 1j * STEP * unit}), effects
                    )
                    S[:, [*shown], number] = added[:, [*shown.values()]].imag / STEP
                out[stage] = met, S
            met = met.at(**{felt: passed})
    return out


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
    stages = dict.fromkeys(CATALOGUE[p.effect].stage for p in wanted)
    rows = linearise(platform, s, effects, kind, stages=stages)
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
    return np.asarray(np.where(angle, (d + np.pi) % (2 * np.pi) - np.pi, d))


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
    """Adds a constant at a stage and remembers what the stage experienced."""

    value: Array
    met: dict[Stage, Stimulus]

    def contribution(self, s: Stimulus) -> Array:
        self.met[self.stage] = s
        return np.repeat(self.value[None], len(s.time), axis=0)


_PROBES = {stage: type(f"_Probe{stage.name}", (_Probe,), {"stage": stage}) for stage in Stage}
