r"""Forces, and what else is read, of a platform whose attitude is known: dwells at gimbal angles, or a static run.

The rows are those of `forward.linearise`: residuals (n, C) and the sensitivity of every channel to every stage, from
which the column of any candidate is one product.

Rows may be means over blocks of time. Gimbal angles and attitude errors are as good as linear over a minute; the
specific force of an inertially fixed platform turns with the Earth, and what the mean of a turning vector loses is put
back. Without a readout of its platform gimbal the force itself tells the phase of a static run.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gimbalcal.effects import Effect, Stage, Stimulus
from gimbalcal.effects.process import SettingError
from gimbalcal.errors import InputError
from gimbalcal.forward import AXES, Rows, difference, linearise, predict, wanted_channels
from gimbalcal.inference.noise_processes import one_sigma
from gimbalcal.kinematics import lost_to_averaging, refuse_other_platform, stimulus_from_readings, with_phase_of_force
from gimbalcal.number import Array
from gimbalcal.recording import Recording, block_means, dwells
from gimbalcal.recording.dwell import rests_are_means, whole_means
from gimbalcal.recording.noise_levels import SETTING_SIGMA_RAD, header_noise, sample_sigma
from gimbalcal.recording.record import FORCE, SENSOR_OF, Key
from gimbalcal.views.core import Measurement, View, nuisance, recording_fields
from gimbalcal.views.local import Local
from gimbalcal.views.noise import NoiseModel

POSITIONS = Measurement("positions", "", acts_on=(FORCE, "gimbal_angle"), known_attitude=True)
STATIC_RUN = Measurement("static run", "", acts_on=(FORCE,), known_attitude=True)
FOLDS = 12  # stretches of a static run that are held out in turn
BLOCKS_IN_ALL = 108  # block means of a multi-position recording: 6 in each of 18 dwells, at least 2 in each of many
NOISELESS = 1e-11  # of gravity: what a simulation without noise leaves
STUCK_SIGMA = 1e-15  # one sigma of a channel that always reads the same, SI
LATITUDE_STEP_RAD = 1e-5  # over which the derivative of the force by the latitude is taken
MOST_ROWS = 4000  # of a static run: 48 h come as minute means, and half a gigabyte of columns is enough


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

    def rows(self, effects: Sequence[Effect] = ()) -> Rows:
        """The rows about a model: residuals and sensitivities in SI."""
        platform = self.recording.platform
        return linearise(platform, self.stimulus, effects, self.recording.kind, self.channels, self.value)

    def by_latitude(self) -> Array:
        """Return the derivative (n, C, 1) of the readings of error-free sensors by the latitude, SI per rad."""
        site = self.recording.site
        assert site.latitude is not None  # a static run is refused without it
        moved = replace(self.recording, site=replace(site, latitude=site.latitude + LATITUDE_STEP_RAD))
        there = replace(self, recording=moved, stimulus=stimulus_from_readings(moved)).predicted()
        return difference(there, self.predicted(), self.channels)[..., None] / LATITUDE_STEP_RAD

    def predicted(self, effects: Sequence[Effect] = ()) -> Array:
        """Return the readings (n, C) that the model predicts."""
        platform = self.recording.platform
        return wanted_channels(platform, predict(platform, self.stimulus, effects, self.recording.kind), self.channels)

    def residual(self, effects: Sequence[Effect] = ()) -> Array:
        """Read minus predicted (n, C); angles within half a turn."""
        return difference(self.value, self.predicted(effects), self.channels)

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


def view_at_known_attitude(recording: Recording, baseline: Sequence[str] = (), known: Sequence[Effect] = ()) -> View:
    """Return the view of dwells at known angles or of a static run; `known` are values that its scatter is seen about.

    Raises InputError for a kind without a forward model or with missing channels.
    """
    recording = at_rest(recording)
    if recording.kind.in_positions and not recording.has("gimbal_angle"):
        raise InputError(
            f"{recording.title!r} has no gimbal_angle column, so its attitude is not known; add the readouts to "
            "[columns], or name the platform 'bench'"
        )
    read = readings(recording)
    if not read.columns("specific_force"):
        raise InputError(f"{recording.title!r} has no specific_force channel: there is nothing to explain")
    noise = NoiseModel(row_sigma(read, known), scale_known=True, block=_block_ordinals(recording))
    setting = one_sigma(header_noise(recording).get("gimbal_angle", (SettingError(SETTING_SIGMA_RAD),)))
    return view_of_readings(read, noise, baseline, setting=None if recording.kind.stabilised else setting)


def view_of_readings(
    read: Readings, noise: NoiseModel, baseline: Sequence[str] = (), setting: float | None = None
) -> View:
    """Return the view of readings at known attitude with this noise.

    setting: one sigma [rad] by which gimbals are set at each visit of a position; None where no row is set anew. A
    latitude that is stated with a sigma is eliminated: an error of it resembles scale factors and zeros.
    """
    recording, s, n = read.recording, read.stimulus, len(read.recording.time)
    visit = np.unique(s.visit, return_inverse=True)[1]

    def off(effects: Sequence[Effect], e: Array) -> Rows:
        angle = s.readout + e[visit]
        return replace(read, stimulus=s.at(readout=angle, angle=angle)).rows(effects)

    local = None
    if setting is not None:
        local = Local(visit, s.readout.shape[1], setting, lambda rows: rows.sensitivity(Stage.ENCODER), off)
    view = View(
        STATIC_RUN if recording.kind.stabilised else POSITIONS, channels=read.channels, **recording_fields(recording),
        stimulus=s, evaluate=read.rows, stages=frozenset(Stage), noise=noise, label=s.position,
        baseline=tuple(baseline) or recording.kind.baseline,
        groups=np.arange(n) * FOLDS // n if recording.kind.stabilised else s.visit,
        local=local,
    )  # fmt: skip
    if not recording.kind.stabilised or not recording.site.latitude_sigma:
        return view
    derivative, latitude = read.by_latitude(), nuisance("latitude", "", "deg", recording.site.latitude_sigma)
    uncertain = replace(
        view, nuisances=(latitude,), evaluate=lambda effects: replace(read.rows(effects), nuisance=derivative)
    )
    return uncertain.without_nuisances()


def at_rest(recording: Recording) -> Recording:
    """The rows that stand still, a long static run as means of blocks. Raises InputError where there are none."""
    if not recording.kind.at_rest:
        raise InputError(
            f"{recording.title!r} is a {recording.kind} recording; `diagnose` takes multi-position, static-run"
        )
    if recording.kind.stabilised:
        refuse_other_platform(recording)
    if recording.position is not None and np.any(recording.position == 0):
        recording = whole_means(recording) if rests_are_means(recording) else recording.select(recording.position > 0)
    if not len(recording.time):
        raise InputError(f"{recording.title!r} has no dwell: every row has position 0, so nothing in it is at rest")
    if recording.kind.stabilised and len(recording.time) > MOST_ROWS:
        return block_means(recording, -(-len(recording.time) // MOST_ROWS))
    return recording


def row_sigma(read: Readings, known: Sequence[Effect] = ()) -> Array:
    """One sigma (C,) of a row. Raises InputError where neither the header nor three rows in a position tell it.

    A stated noise of zero tells none: rows that scatter at all would then be infinitely many sigmas off.
    """
    stated, visit = header_noise(read.recording), read.stimulus.visit
    silent = [q for q, _ in read.channels if q not in stated]
    if silent and not np.any(visit[2:] == visit[:-2]):
        raise InputError(
            f"{read.recording.title!r} states no noise of the {SENSOR_OF[silent[0]]} and holds too few rows in a "
            "position to show it: write it into [noise] of recording.toml"
        )
    one = sample_sigma(read.recording, read.channels, read.residual(known))
    force = [i for i, (q, _) in enumerate(read.channels) if q == FORCE]
    if force and max(one[i] for i in force) < NOISELESS * read.recording.site.gravity:
        lack = "do not scatter" if FORCE in silent else "are stated to have no noise"
        raise InputError(
            f"the accelerometers of {read.recording.title!r} {lack}, and without a noise nothing can be weighed: write "
            "it into [noise] of recording.toml"
        )
    return np.maximum(one, STUCK_SIGMA) / np.sqrt(np.median(read.recording.weight))


def _block_ordinals(recording: Recording) -> Array:
    """Ordinal of the block (n,) that each row belongs to: equal parts of each dwell, single rows of one with few."""
    if recording.kind.stabilised:
        return np.zeros(0, dtype=int)
    visits = dwells(recording)
    parts = max(2, min(6, BLOCKS_IN_ALL // max(1, len(visits))))
    out = np.zeros(len(recording.time), dtype=int)
    for i, d in enumerate(visits):
        n = d.stop - d.start
        out[d.start : d.stop] = i * parts + np.arange(n) * parts // n
    return np.asarray(np.cumsum(np.diff(out, prepend=out[0]) != 0))
