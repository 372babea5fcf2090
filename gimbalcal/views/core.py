"""One kind of measurement: residuals as a function of the effects in the model."""

from __future__ import annotations

from collections.abc import Callable, Container, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from gimbalcal.calibration import Calibration
from gimbalcal.effects import CATALOGUE, Effect, Parameter, Stage, Stimulus, parameters
from gimbalcal.effects.grade import Grade, hurried
from gimbalcal.forward import Rows
from gimbalcal.number import Array
from gimbalcal.recording.record import Key
from gimbalcal.views.noise import NoiseModel


@dataclass(frozen=True, eq=False)
class View:
    """Residuals of one kind of measurement as a function of the effects in the model, and what their noise may be.

    evaluate: effects to `Rows` about them, of n rows and C channels in SI. reference: the same with columns that hold
    no noise of the readings, see `noise_free`. stimulus: what the hardware experienced in the samples that the rows are
    made of, which may be more than n. groups (n,): ordinal of the group of rows that is held out together.
    """

    name: str
    title: str
    kind: str  # of the recording, by which effects say where they show
    unit: str  # of print
    channels: tuple[Key, ...]
    time: Array  # (n,) s since the first row
    stimulus: Stimulus
    evaluate: Callable[[Sequence[Effect]], Rows]
    stages: frozenset[Stage]  # that show in these rows
    baseline: tuple[str, ...]  # effects that the model holds
    grade: Grade
    groups: Array
    noise: NoiseModel
    label: Array | None = None  # (n,) number of the dwell or star of each row, if it is called by a number
    session: Array | None = None  # (n,) power-up of each row, where nobody knows the time between them
    read_gimbals: tuple[str, ...] = ()  # whose angles were read
    gauge: frozenset[tuple[str, str]] = frozenset()  # (effect, axis) that these rows cannot show by convention
    prior_factor: float = 1.0  # times the sizes of the unit's grade
    reference: Callable[[Sequence[Effect]], Rows] | None = None
    finer: Callable[[], View] | None = None  # the same rows from physics in finer steps, for the last fit
    relinearise: Callable[[Effect, Sequence[Parameter]], View] | None = None  # with this in the model as well
    calibrate: Callable[[Sequence[Effect], Sequence[Parameter]], Calibration] | None = None  # a model, to convergence
    added: Callable[[str, str, Array], Array] | None = None  # columns of a basis added to a sensor that is no channel
    missed_by_turns: Callable[[Sequence[Effect]], float] | None = None  # rad of gravity, with these effects at rest
    cache: dict[Any, Any] = field(default_factory=dict)  # models of a search and columns that were scanned

    def __len__(self) -> int:
        """Return the number of rows n."""
        return len(self.time)

    @property
    def elapsed(self) -> Array:
        """Time (n,) [s] since the first row, or since the first of its power-up where pauses are unknown."""
        if self.session is None:
            return self.time
        _, first, session = np.unique(self.session, return_index=True, return_inverse=True)
        return np.asarray(self.time - self.time[first][session])

    @property
    def weight(self) -> Array:
        """Weights (n, C) in units of which all rows are equally sure; the surest have one."""
        return self.noise.weight((len(self), len(self.channels)))

    def parameters_of(self, effect_id: str) -> tuple[Parameter, ...]:
        """Return the parameters of an effect with the priors of the grade.

        Left out are those of gimbals that were not read and those that these rows cannot show.
        """
        names, cls = self.stimulus.axis_names, CATALOGUE[effect_id]
        seen = (p for p in parameters(cls, names) if (p.axis not in names or p.axis in self.read_gimbals)
                and (p.effect, p.axis) not in self.gauge)  # fmt: skip
        fast = hurried(cls, float(np.ptp(self.stimulus.time)))
        usual = (self.grade.usual(p) for p in seen)
        factors = ((p, self.prior_factor * (fast if p.unit.endswith("/h") else 1.0)) for p in usual)
        return tuple(replace(p, sigma=factor * p.sigma) for p, factor in factors)

    def noise_free(self, effects: Sequence[Effect]) -> Rows:
        """Return rows whose columns hold no noise of the readings, for what is not in the model yet.

        A column made of readings varies with their noise, and where the model takes up all the rest of it, it is a copy
        of the misfit: a cause that explains everything. At rest the force is as long as gravity, whatever was read.
        """
        return (self.reference or self.evaluate)(effects)

    def linearised(self, effects: Sequence[Effect], wanted: Sequence[Parameter]) -> tuple[Array, Array]:
        """Return the misfit (n, C) about the effects and its derivative (n, C, p) by the wanted parameters."""
        rows = self.evaluate(effects)
        return rows.residual, rows.jacobian(wanted)


def gauges(stages: Container[Stage]) -> frozenset[tuple[str, str]]:
    """Return the parameters (effect, axis) that only turn a frame for which rows of these stages hold no reference."""
    return frozenset((i, axis) for i, cls in CATALOGUE.items() if cls.stage in stages for axis in cls.gauge)
