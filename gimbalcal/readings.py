r"""Readings of a recording in the channels that the forward model predicts, and their residuals about a model.

Rows may be means over blocks of time. Gimbal angles and attitude errors are as good as linear over a minute; the
specific force of an inertially fixed platform turns with the Earth, and what the mean of a turning vector loses is put
back. Without a readout of its platform gimbal the force itself tells the phase of a static run.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from gimbalcal.effects import CATALOGUE, Effect, Parameter, Stage, Stimulus
from gimbalcal.errors import InputError
from gimbalcal.forward import AXES, Rows, difference, linearise, predict, wanted_channels
from gimbalcal.kinematics import lost_to_averaging, refuse_other_platform, stimulus_from_readings, with_phase_of_force
from gimbalcal.number import Array
from gimbalcal.recording import Recording
from gimbalcal.recording.record import Key


@dataclass(frozen=True, eq=False)
class Readings:
    """C channels of n rows as they were read, with one sigma of each and what the hardware experienced.

    value (n, C) in SI; sigma (n, C), ones where nobody has said yet.
    """

    recording: Recording
    stimulus: Stimulus
    channels: tuple[Key, ...]
    value: Array
    sigma: Array

    @property
    def phase(self) -> Array:
        """Sidereal angle S_t (n,) [rad] of a static run."""
        return np.arctan2(self.stimulus.force[:, 1], self.stimulus.force[:, 0])

    @property
    def direction(self) -> Array:
        """Ideal specific force in units of gravity (n, 3)."""
        return np.asarray(self.stimulus.force / self.stimulus.gravity)

    def rows(self, effects: Sequence[Effect] = (), stages: Iterable[Stage] = Stage) -> Rows:
        """The rows about a model: residuals and sensitivities in SI."""
        platform = self.recording.platform
        return linearise(platform, self.stimulus, effects, self.recording.kind, self.channels, self.value, stages)

    def predicted(self, effects: Sequence[Effect] = ()) -> Array:
        """Return the readings (n, C) that the model predicts."""
        platform = self.recording.platform
        return wanted_channels(platform, predict(platform, self.stimulus, effects, self.recording.kind), self.channels)

    def residual(self, effects: Sequence[Effect] = ()) -> Array:
        """Read minus predicted (n, C); angles within half a turn."""
        return difference(self.value, self.predicted(effects), self.channels)

    def jacobian(self, effects: Sequence[Effect], wanted: Sequence[Parameter]) -> Array:
        """Derivative of the predictions (n, C, p)."""
        return self.rows(effects, dict.fromkeys(CATALOGUE[p.effect].stage for p in wanted)).jacobian(wanted)

    def columns(self, quantity: str) -> list[int]:
        """Indices of the channels of one quantity."""
        return [i for i, (q, _) in enumerate(self.channels) if q == quantity]


def readings(recording: Recording) -> Readings:
    """The readings of a recording, of one sigma each. Raises InputError where the model predicts nothing in it."""
    if recording.kind.stabilised:
        refuse_other_platform(recording)
    channels = measured_channels(recording)
    if recording.kind.stabilised and ("gimbal_angle", "platform") not in channels:
        recording = with_phase_of_force(recording)
    s = stimulus_from_readings(recording)
    value = np.stack([recording.channels[key] for key in channels], axis=1)
    out = Readings(recording, s, channels, value, np.ones(value.shape))
    force = out.columns("specific_force")
    if recording.kind.stabilised and force:
        lost = lost_to_averaging(recording, s.force)
        value[:, force] += lost[:, ["xyz".index(channels[i][1]) for i in force]]
    return out


def measured_channels(recording: Recording) -> tuple[Key, ...]:
    """Return the channels of a recording that the forward model predicts for its kind."""
    axes = {**AXES, "gimbal_angle": recording.platform.axis_names}
    keys = [(q, a) for q in recording.kind.predicted for a in axes[q]]
    logged = tuple(key for key in keys if key in recording.channels)
    if not logged:
        raise InputError(f"{recording.title!r} has no {' and no '.join(recording.kind.predicted)} channel")
    return logged
