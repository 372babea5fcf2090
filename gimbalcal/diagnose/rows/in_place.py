r"""A unit that is turned in its place as a view: the innovations of a navigator with the calibrated sensors.

Its true velocity is zero, so what it computes is misfit: of rows e (n, 3), white where the model is right, in a noise
that the header states or the stops show. The model is linear about the constants to which `systematic` settles.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields, replace

import numpy as np

from gimbalcal.calibration import Calibration
from gimbalcal.effects import CATALOGUE, Effect, Parameter, parameters, values
from gimbalcal.effects.effect import GYROSCOPE_STAGES, SENSOR_STAGES, absent, constants
from gimbalcal.estimate.systematic.calibrate import calibrated
from gimbalcal.estimate.systematic.innovation_rows import InnovationRows, innovation_rows
from gimbalcal.estimate.systematic.iterate import SystematicFit, iterate
from gimbalcal.estimate.systematic.segments import stops
from gimbalcal.estimate.systematic.state_lists import KEPT, SAME, states
from gimbalcal.forward import Rows
from gimbalcal.number import Array
from gimbalcal.recording import Recording
from gimbalcal.recording.record import FORCE, RATE
from gimbalcal.views.core import View
from gimbalcal.views.noise import NoiseModel

NAME = "navigation"
FEWEST = 2  # stops
CHANNELS = tuple(("velocity", axis) for axis in ("north", "east", "down"))


def turned_in_place(recording: Recording) -> bool:
    """Whether a recording is of a unit turned from stop to stop at a known latitude; a table goes on tilting."""
    if not recording.kind.rotating or recording.platform.axes or recording.site.latitude is None:
        return False
    if any(not recording.has(q) or recording.counted(q) for q in (FORCE, RATE)):
        return False
    return len(stops(recording)) >= FEWEST


def in_place(
    recording: Recording, ids: tuple[str, ...], tell: Callable[[str], None], held: tuple[Effect, ...] = ()
) -> View:
    """The view of a unit turned through stops, whose model fits the effects `ids` and holds others, with their sizes.

    Raises InputError where a navigator cannot take the recording.
    """
    usual = states(",".join(ids), recording)

    def known(more: Sequence[Effect] = ()) -> tuple[Effect, ...]:
        return (*(e for e in held if e.id not in {m.id for m in more}), *more)

    def relinearise(effect: Effect, wanted: Sequence[Parameter]) -> View:
        return replace(
            view_of(recording, iterate(recording, (*usual, *wanted), known([effect]), tell), ids), calibrate=converged
        )

    first = iterate(recording, usual, held, tell)

    def converged(effects: Sequence[Effect], fitted: Sequence[Parameter]) -> Calibration:
        more = tuple(p for p in fitted if p.label not in {u.label for u in usual})
        fresh = [emptied(e) for e in effects if e.id in {p.effect for p in more}]
        return calibrated(iterate(recording, (*usual, *more), known(fresh), tell) if more else first)

    return replace(view_of(recording, first, ids), relinearise=relinearise, calibrate=converged)


def view_of(recording: Recording, settled: SystematicFit, ids: tuple[str, ...]) -> View:
    """The view about what `iterate` found."""
    w = innovation_rows(settled)
    answers = _Answers(w)
    base = w.rows
    y = w.residual

    def rows(effects: Sequence[Effect]) -> Rows:
        left = y.copy()
        wanted = tuple(p for e in effects for p in parameters(type(e)))
        known = dict(zip((p.label for p in settled.wanted), settled.theta.tolist(), strict=True))
        every = (*settled.wanted, *(p for p in wanted if p.label not in known))
        sizes = values(tuple(effects), every) - np.array([known.get(p.label, 0.0) for p in every])
        by_id = {e.id: e for e in effects}
        for effect_id in dict.fromkeys(p.effect for p in every):
            at = [i for i, p in enumerate(every) if p.effect == effect_id and sizes[i] != 0]
            if at:
                effect = by_id.get(effect_id) or absent(CATALOGUE[effect_id])
                left -= answers.columns(effect, [every[i] for i in at]) @ sizes[at]
        return _Linear(**{**vars(base), "effects": tuple(effects), "residual": left}, answers=answers)

    gauge = {(i, p.axis) for i, kept in KEPT.items() for p in parameters(CATALOGUE[i]) if p.axis not in kept}
    gauge |= {(i, p.axis) for i in SAME for p in parameters(CATALOGUE[i])}
    return View(
        NAME, recording.title, recording.kind, "mm/s", CHANNELS, w.time - w.time[0], w.felt, rows,
        SENSOR_STAGES | GYROSCOPE_STAGES, ids, recording.grade, np.cumsum(np.diff(w.stop, prepend=w.stop[0]) != 0),
        NoiseModel(w.sigma, sample=w.sigma if settled.segments.stated else None), recording, gauge=frozenset(gauge),
        added=answers.added,
    )  # fmt: skip


def emptied(effect: Effect) -> Effect:
    """The effect with its constants and no size."""
    kept = (*(f.name for f in constants(type(effect))), "covariate")
    held = {f.name: getattr(effect, f.name) for f in fields(effect) if f.name in kept}
    return replace(absent(type(effect)), **held)


@dataclass(frozen=True, eq=False)
class _Answers:
    """How the rows answer causes (n, 3) per unit, each worked out once."""

    whitened: InnovationRows
    kept: dict[tuple[object, ...], Array] = field(default_factory=dict)

    def columns(self, effect: Effect, wanted: Sequence[Parameter]) -> Array:
        """Columns (n, 3, p) of an effect's parameters; of its non-linear constants at its present size."""
        smooth = {f.name for f in constants(type(effect))}
        none = emptied(effect)
        key = effect.id, *(getattr(none, f.name) for f in fields(none) if f.name in (*smooth, "covariate"))
        linear = [p for p in wanted if p.field not in smooth]
        if any((*key, p.field, p.axis) not in self.kept for p in linear):
            every = parameters(type(effect))
            made = self._through(none, every)
            self.kept.update({(*key, p.field, p.axis): made[..., i] for i, p in enumerate(every)})
        out = [
            self.kept[*key, p.field, p.axis] if p.field not in smooth else self._through(effect, [p])[..., 0]
            for p in wanted
        ]
        return np.stack(out, axis=-1) if out else np.zeros((*self.whitened.residual.shape, 0))

    def _through(self, effect: Effect, wanted: Sequence[Parameter]) -> Array:
        return -self.whitened.response(self.whitened.addition(effect, wanted))

    def added(self, quantity: str, axis: str, basis: Array) -> Array:
        """Columns (n, 3, m) of what is added (g, m) to force or rate along an axis."""
        D = np.zeros((len(basis), 6, basis.shape[1]))
        D[:, 3 * (quantity == RATE) + "xyz".index(axis)] = basis
        return self.whitened.response(D)


@dataclass(frozen=True, eq=False)
class _Linear(Rows):
    """Rows whose columns are those about the settled constants, whatever else is in the model."""

    answers: _Answers | None = None

    def columns(self, effect: Effect, wanted: Sequence[Parameter]) -> Array:
        """Derivative (n, 3, p)."""
        assert self.answers is not None
        return self.answers.columns(effect, wanted)
