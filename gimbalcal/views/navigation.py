r"""A unit that is turned in its place: the innovations of a navigator with the calibrated sensors.

Its true velocity is zero, so what it computes is misfit: of rows e (n, 3), white where the model is right, in a noise
that the header states or the stops show. The rows are linear about the constants at which the navigator was run.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace

import numpy as np
from numpy.typing import NDArray

from gimbalcal.effects import CATALOGUE, Effect, Parameter, Stimulus, parameters, values
from gimbalcal.effects.effect import GYROSCOPE_STAGES, SENSOR_STAGES, constants, zero_effect
from gimbalcal.forward import Rows
from gimbalcal.number import Array
from gimbalcal.recording import Recording
from gimbalcal.recording.record import FORCE, RATE
from gimbalcal.views.core import Measurement, View, without_sizes
from gimbalcal.views.noise import NoiseModel

CHANNELS = tuple(("velocity", axis) for axis in ("north", "east", "down"))


@dataclass(frozen=True, eq=False)
class InnovationRows:
    """n rows of three innovations [m/s], north, east, down, with sigma (n, 3), in the middle of `time` (n,).

    felt: force and rate behind the readings, a row for each group of intervals; stop (n,): ordinal, -1 while turning.
    """

    felt: Stimulus
    rows: Rows  # of both triads about the fitted effects, a row for each group
    residual: Array
    sigma: Array
    time: Array
    stop: NDArray[np.int64]
    reading_jacobian: Array  # derivative of the readings by force and rate (g, 6, 6), about the fitted effects
    response: Callable[[Array], Array]  # rows (n, 3, p) by additions (g, 6, p) to force and rate, per unit of each


NAVIGATION = Measurement(
    "navigation", "mm/s", "stops and turns", channels="the velocity of a unit at rest",
    channel="the velocity {axis} of a unit at rest", acts_on=(FORCE, RATE),
)  # fmt: skip


def navigation(
    recording: Recording, innovations: InnovationRows, fitted: Mapping[Parameter, float], baseline: Sequence[str],
    gauge: frozenset[tuple[str, str]], stated: bool,
) -> View:  # fmt: skip
    """Return the view of innovations about fitted values [SI]; stated: whether the header tells their noise."""
    columns = _Responses(innovations)
    base, residual = innovations.rows, innovations.residual
    known = {p.label: x for p, x in fitted.items()}

    def rows(effects: Sequence[Effect]) -> Rows:
        out = residual.copy()
        wanted = tuple(p for e in effects for p in parameters(type(e)))
        every = (*fitted, *(p for p in wanted if p.label not in known))
        sizes = values(tuple(effects), every) - np.array([known.get(p.label, 0.0) for p in every])
        by_id = {e.id: e for e in effects}
        for effect_id in dict.fromkeys(p.effect for p in every):
            at = [i for i, p in enumerate(every) if p.effect == effect_id and sizes[i] != 0]
            if at:
                effect = by_id.get(effect_id) or zero_effect(CATALOGUE[effect_id])
                out -= columns.of(effect, [every[i] for i in at]) @ sizes[at]
        return replace(
            base, effects=tuple(effects), residual=out, fixed_columns=columns.of
        )  # about the fitted constants

    w = innovations
    return View(
        NAVIGATION, recording.title, recording.kind, CHANNELS, w.time - w.time[0], w.felt, rows,
        SENSOR_STAGES | GYROSCOPE_STAGES, tuple(baseline), recording.grade,
        np.cumsum(np.diff(w.stop, prepend=w.stop[0]) != 0), NoiseModel(w.sigma, sample=w.sigma if stated else None),
        recording, gauge=gauge, added=columns.added,
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Responses:
    """Columns of causes (n, 3) per unit, each computed once."""

    innovations: InnovationRows
    cache: dict[tuple[object, ...], Array] = field(default_factory=dict)

    def of(self, effect: Effect, wanted: Sequence[Parameter]) -> Array:
        """Return columns (n, 3, p) of an effect's parameters; of its nonlinear constants at its present size."""
        smooth = {f.name for f in constants(type(effect))}
        none = without_sizes(effect)
        key = effect.id, *(getattr(none, f.name) for f in fields(none) if f.name in (*smooth, "covariate"))
        linear = [p for p in wanted if p.field not in smooth]
        if any((*key, p.field, p.axis) not in self.cache for p in linear):
            every = parameters(type(effect))
            computed = self._through(none, every)
            self.cache.update({(*key, p.field, p.axis): computed[..., i] for i, p in enumerate(every)})
        out = [
            self.cache[*key, p.field, p.axis] if p.field not in smooth else self._through(effect, [p])[..., 0]
            for p in wanted
        ]
        return np.stack(out, axis=-1) if out else np.zeros((*self.innovations.residual.shape, 0))

    def _through(self, effect: Effect, wanted: Sequence[Parameter]) -> Array:
        """Return the response (n, 3, p) to what an effect apparently adds to force and rate, per unit."""
        w = self.innovations
        return w.response(np.linalg.solve(w.reading_jacobian, np.nan_to_num(w.rows.columns(effect, wanted))))

    def added(self, quantity: str, axis: str, basis: Array) -> Array:
        """Return columns (n, 3, m) of what is added (g, m) to force or rate along an axis."""
        D = np.zeros((len(basis), 6, basis.shape[1]))
        D[:, 3 * (quantity == RATE) + "xyz".index(axis)] = basis
        return self.innovations.response(D)
