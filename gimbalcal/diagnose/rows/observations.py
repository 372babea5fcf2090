r"""What was measured, minus what the calibrated model says, in units of its noise; and how it answers each stage.

The baseline is fitted, and the rows of `forward.linearise` about it are put in units of one sigma of a row: residuals
y (n, C) and the sensitivity of every channel to every stage, from which the column of any candidate is one product.

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
from gimbalcal.effects.baseline import BASELINE
from gimbalcal.effects.effect import SENSOR_STAGES
from gimbalcal.errors import InputError
from gimbalcal.forward import Rows, experienced
from gimbalcal.inference.information import information, solve
from gimbalcal.kinematics import refuse_other_platform
from gimbalcal.number import Array
from gimbalcal.readings import SENSOR_OF, Readings, readings
from gimbalcal.recording import Recording, block_means, dwells
from gimbalcal.recording.dwell import rests_are_means, whole_means
from gimbalcal.recording.noise import sample_sigma, stated
from gimbalcal.recording.record import FORCE, Key

KINDS = ("multi-position", "static-run")  # whose attitude and noise are known
BLOCKS_IN_ALL = 108  # block means of a multi-position recording: 6 in each of 18 dwells, at least 2 in each of many
NOISELESS = 1e-11  # of gravity: what a simulation without noise leaves
STUCK = 1e-15  # one sigma of a channel that always reads the same, SI
MOST_ROWS = 4000  # of a static run: 48 h come as minute means, and half a gigabyte of columns is enough


@dataclass(frozen=True, eq=False)
class Observations:
    """The rows of one recording about its calibrated baseline, in sigmas, with the calibration's own columns.

    Z (n, C, q): derivatives by the calibration constants, each times its prior sigma; block (n,): ordinal of the block
    of each row, empty for a static run; heavy: excess kurtosis of the samples; weight (n, C): of mean one where the
    tails are heavy, None where all rows weigh alike. turned: the readings at the angles that each visit really had,
    where these count, and told: the variance of what is not known of them, over that of a setting.
    """

    recording: Recording
    rows: Rows
    constants: tuple[Parameter, ...]
    Z: Array
    block: Array
    heavy: float = 0.0
    weight: Array | None = None
    turned: Readings | None = None
    told: float = 1.0

    @property
    def read(self) -> Readings:
        """What was read, at the angles that it is linearised about."""
        return self.turned or readings(self.recording)

    @property
    def kind(self) -> str:
        """Kind of the recording."""
        return self.recording.kind

    @property
    def stimulus(self) -> Stimulus:
        """What the hardware experienced."""
        return self.rows.stimulus

    @property
    def channels(self) -> tuple[Key, ...]:
        """Quantity and axis of each channel."""
        return self.rows.channels

    @property
    def sigma(self) -> Array:
        """One sigma (C,) of a row, SI."""
        return np.asarray(self.rows.sigma)

    @property
    def y(self) -> Array:
        """Residuals (n, C) in sigmas."""
        return self.rows.residual

    @property
    def baseline(self) -> tuple[Effect, ...]:
        """The fitted model."""
        return self.rows.effects

    @property
    def seen(self) -> Mapping[Stage, Stimulus]:
        """What each stage experiences."""
        return self.rows.seen

    @property
    def sensitivity(self) -> Mapping[Stage, Array]:
        """Derivative (n, C, m) of the channels, in sigmas, by what is added at each stage."""
        return self.rows.sensitivity

    @property
    def starts(self) -> Array:
        """First row of each block."""
        return np.flatnonzero(np.diff(self.block, prepend=-1))

    def over(self, sigma: Array) -> Observations:
        """The same in units of sigma (C,) times the present ones."""
        return replace(self, rows=self.rows.over(sigma), Z=self.Z / sigma[:, None])

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
        return self.rows.through(stage, added)

    def columns(self, effect: Effect, wanted: Sequence[Parameter]) -> Array:
        """Derivative (n, C, p) in sigmas by the wanted parameters of an effect, at its present values."""
        return self.rows.columns(effect, wanted)


def fit_baseline(
    recording: Recording, baseline: Sequence[str] = (), known: Sequence[Effect] = (), steps: int = 2
) -> Observations:
    """Fit the baseline of this kind of recording and return residuals and sensitivities about it.

    `known` are values to start from, `steps` the Gauss-Newton steps (none for a recording that is only planned).
    Raises InputError for a kind without a forward model or with missing channels.
    """
    recording = _at_rest(recording)
    refuse_unknown_attitude(recording)
    read = readings(recording)
    if not read.columns("specific_force"):
        raise InputError(f"{recording.title!r} has no specific_force channel: there is nothing to explain")
    sigma = row_sigma(read, known)
    names = recording.platform.axis_names
    ids = tuple(baseline) or BASELINE[recording.kind]
    every = (recording.grade.usual(p) for i in ids for p in parameters(known_effect(i), names))
    constants = tuple(p for p in every if _has_axis(p, recording))
    effects = with_values(tuple(known), constants, values(tuple(known), constants), names)
    for _ in range(steps):
        x = values(effects, constants)
        effects = with_values(effects, constants, x + _step(read, effects, constants, sigma), names)
    rows = read.rows(effects).over(sigma)
    Z = rows.jacobian(constants) * np.array([p.sigma for p in constants])
    o = Observations(recording, rows, constants, Z, _blocks(recording))
    refuse_too_little(recording.title, o.reduce(Z))
    return o


Sized = tuple[Effect, Sequence[Parameter], Array]  # an effect without size, linear parameters, their sizes (p,) in SI


def linearised_at(o: Observations, shift: Array, found: Sequence[Sized]) -> Observations:
    """The rows about constants shifted by (q,) prior sigmas and with causes in the model: what the whole model leaves.

    Products of a large cause with itself and with the constants, which are many sigmas, are in these derivatives. What
    a cause adds to a sensor's output is left out of those by the constants: it changes them by its own small size, and
    where two of them are alike (bias and scale of a sensor in a steady force) their difference would be a copy of it.
    """
    names = o.stimulus.axis_names
    x = values(o.baseline, o.constants) + shift * np.array([p.sigma for p in o.constants])
    effects = with_values(o.baseline, o.constants, x, names)
    made = [with_values((e,), wanted, size, names)[0] for e, wanted, size in _once(found)]
    read = readings(o.recording)
    rows = replace(read.rows((*effects, *made)).over(o.sigma), effects=effects)
    moving = [e for e in made if e.stage not in SENSOR_STAGES]
    about = rows if len(moving) == len(made) else replace(read.rows((*effects, *moving)).over(o.sigma), effects=effects)
    return replace(o, rows=rows, Z=about.jacobian(o.constants) * np.array([p.sigma for p in o.constants]))


def given_back(o: Observations, found: Sequence[Sized]) -> Observations:
    """The rows of `linearised_at` with what the causes explain back in the residuals, to first order about there."""
    taken = sum((o.columns(e, wanted) @ size for e, wanted, size in _once(found)), start=0 * o.y)
    return replace(o, rows=replace(o.rows, residual=o.y + taken))


def _once(found: Sequence[Sized]) -> Sequence[Sized]:
    """The first of each effect, which has its constants once."""
    return tuple({e.id: (e, wanted, size) for e, wanted, size in reversed(found)}.values())


def _step(read: Readings, effects: Sequence[Effect], constants: Sequence[Parameter], sigma: Array) -> Array:
    """Gauss-Newton step (q,) of the calibration constants, SI; directions that the rows do not see stay."""
    rows = read.rows(effects, dict.fromkeys(CATALOGUE[p.effect].stage for p in constants)).over(sigma)
    return solve(information(rows.jacobian(constants), rows.residual.ravel(), constants)).x


def _at_rest(recording: Recording) -> Recording:
    """The rows that stand still, a long static run as means of blocks. Raises InputError where there are none."""
    if recording.kind not in KINDS:
        raise InputError(f"{recording.title!r} is a {recording.kind} recording; `diagnose` takes {', '.join(KINDS)}")
    if recording.kind == "static-run":
        refuse_other_platform(recording)
    if recording.position is not None and np.any(recording.position == 0):
        recording = whole_means(recording) if rests_are_means(recording) else recording.select(recording.position > 0)
    if not len(recording.time):
        raise InputError(f"{recording.title!r} has no dwell: every row has position 0, so nothing in it is at rest")
    if recording.kind == "static-run" and len(recording.time) > MOST_ROWS:
        return block_means(recording, -(-len(recording.time) // MOST_ROWS))
    return recording


def refuse_too_little(title: str, Z: Array) -> None:
    """Raise InputError where the constants of the model, columns Z (N, q), take up all N numbers."""
    if len(Z) <= Z.shape[-1] and np.linalg.matrix_rank(Z / (np.linalg.norm(Z, axis=0) + 1e-300)) == len(Z):
        raise InputError(
            f"{title!r} gives {len(Z)} numbers, and the constants of the model take up {len(Z)} of them: "
            "nothing is left to compare; give a longer recording, or a --baseline of fewer effects"
        )


def _has_axis(p: Parameter, recording: Recording) -> bool:
    """A gimbal that was not recorded has no zero to fit."""
    return p.axis not in recording.platform.axis_names or p.axis in recording.axes("gimbal_angle")


def refuse_unknown_attitude(recording: Recording) -> None:
    """Raise InputError for positions without a readout of any gimbal."""
    if recording.kind == "multi-position" and not recording.has("gimbal_angle"):
        raise InputError(
            f"{recording.title!r} has no gimbal_angle column, so its attitude is not known; add the readouts to "
            "[columns], or name the platform 'bench'"
        )


def row_sigma(read: Readings, known: Sequence[Effect] = ()) -> Array:
    """One sigma (C,) of a row. Raises InputError where neither the header nor three rows in a position tell it."""
    told, visit = stated(read.recording), read.stimulus.visit
    silent = [q for q, _ in read.channels if q not in told]
    if silent and not np.any(visit[2:] == visit[:-2]):
        raise InputError(
            f"{read.recording.title!r} states no noise of the {SENSOR_OF[silent[0]]} and holds too few rows in a "
            "position to show it: write it into [noise] of recording.toml"
        )
    one = sample_sigma(read.recording, read.channels, read.residual(known))
    force = [i for i, (q, _) in enumerate(read.channels) if q == FORCE and q in silent]
    if force and max(one[i] for i in force) < NOISELESS * read.recording.site.gravity:
        raise InputError(
            f"the accelerometers of {read.recording.title!r} do not scatter, and without a noise nothing can be "
            "weighed: write it into [noise] of recording.toml"
        )
    return np.maximum(one, STUCK) / np.sqrt(np.median(read.recording.weight))


def read_gimbals(o: Observations) -> list[int]:
    """Ordinals of the gimbals whose angles were read."""
    return [i for i, a in enumerate(o.stimulus.axis_names) if ("gimbal_angle", a) in o.recording.channels]


def _blocks(recording: Recording) -> Array:
    """Ordinal of the block (n,) that each row belongs to: equal parts of each dwell, single rows of one with few."""
    if recording.kind == "static-run":
        return np.zeros(0, dtype=int)
    stays = dwells(recording)
    parts = max(2, min(6, BLOCKS_IN_ALL // max(1, len(stays))))
    out = np.zeros(len(recording.time), dtype=int)
    for i, d in enumerate(stays):
        n = d.stop - d.start
        out[d.start : d.stop] = i * parts + np.arange(n) * parts // n
    return np.asarray(np.cumsum(np.diff(out, prepend=out[0]) != 0))


def absent_effect(effect_id: str, s: Stimulus, source: str = "", **constants: float) -> Effect:
    """An effect of the catalogue with zero parameters, these non-linear constants, following covariate `source`."""
    named: dict[str, Any] = {"covariate": source} if source else {}
    return replace(absent(CATALOGUE[effect_id], s.axis_names), **constants, **named)


def restimulated(o: Observations, shift: Array, stage: Stage) -> Stimulus:
    """What a stage experiences once the calibration constants are shifted by (q,) prior sigmas."""
    x = values(o.baseline, o.constants) + shift * np.array([p.sigma for p in o.constants])
    effects = with_values(o.baseline, o.constants, x, o.stimulus.axis_names)
    return experienced(o.recording.platform, o.stimulus, effects, stage, o.kind)
