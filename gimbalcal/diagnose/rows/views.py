r"""Recordings of unknown noise or without gimbals, as rows of misfit to be explained.

A view is one function: effects in, the `Rows` about them out.

* *pointing*: what is seen of a star against where it is, across and along, `estimate.pointing.run`;
* *norm* (rest positions of unknown attitude): the corrected force is as long as gravity,
  :math:`r = |h^{-1}(y)| - g`, with sensitivity :math:`u^T H^{-1} S_k` for h what the accelerometers read;
* *table* (force and rate while a table tilts): force against that of a level unit at rest.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from gimbalcal.calibration import Calibration
from gimbalcal.effects import CATALOGUE, Effect, Parameter, Stage, Stimulus
from gimbalcal.effects.baseline import ACCELEROMETER_BIAS, ACCELEROMETER_TERMS, BASELINE
from gimbalcal.effects.effect import MATRIX_AXES, SENSOR_STAGES
from gimbalcal.errors import InputError
from gimbalcal.estimate.accelerometers.norm_fit import scaled_by_gravity
from gimbalcal.estimate.pointing.run import CHANNELS, STAGES, against_stars, calmer, on_stars
from gimbalcal.forward import Rows, accelerometers, linearise
from gimbalcal.inversion import invert
from gimbalcal.kinematics import stimulus_from_readings, stimulus_from_truth
from gimbalcal.number import Array
from gimbalcal.platform import BENCH
from gimbalcal.recording import Recording, dwell_means
from gimbalcal.recording.record import FORCE, RATE
from gimbalcal.units import is_raw

BLOCK = 1.0  # s; a table is tilted over seconds, what is faster shakes building and floor
POLE = 0.02  # cosine of the inner angle beyond which a mount points along its outer axis
MANY = 1000  # rows of a pointing run, a log of guiding: noises that are filtered row by row would take half of the time
FEWEST = 3  # means of a table that can differ from one another in more than a trend
BY_HAND = 3.0  # times the sizes of one unit: sensors of different makers, bolted together
COARSE, FINE = 0.04, 0.01  # s; steps at which the physics of a tilting table is evaluated, for search and last fit
SIZE_EFFECT = "accelerometer_lever_arm"  # of which a table that tilts about one axis shows what lever_arm is


@dataclass(frozen=True)
class View:
    """Rows of misfit: channels (C), their unit in print, the stages that show in them, and the baseline's effects."""

    name: str
    recording: Recording
    stimulus: Stimulus
    channels: tuple[tuple[str, str], ...]
    unit: str
    sigma: Array | None  # (n, C) of each row where the samples tell it
    stages: frozenset[Stage]
    baseline: tuple[str, ...]
    rows: Callable[[Sequence[Effect]], Rows]
    unobservable: frozenset[tuple[str, str]] = frozenset()  # (effect, axis) that these rows cannot show by convention
    wide: float = 1.0  # times the sizes of the unit's grade
    wander: Array | None = None  # (n, C, m) how what m sensors wander from row to row shows in it, of unit length
    lone: tuple[tuple[str, float, float, float], ...] = ()  # sensors that may walk alone: `evidence.memories`
    noise: Array | None = None  # (n, C) what the samples' scatter alone makes of a row, where it is known
    finer: Callable[[], View] | None = None  # the same rows from physics in finer steps, for the last fit
    ideal: Callable[[Sequence[Effect]], Rows] | None = None  # rows at what is known to be felt: see `about`
    fits: dict[Any, Any] = field(default_factory=dict)  # models of a course, by the causes in them
    scanned: dict[str, Array] = field(default_factory=dict)  # columns of whole numbers that were scanned, by effect
    beside: Callable[[Effect, Sequence[Parameter]], View] | None = None  # linearised with this in the model as well
    settled: Callable[[Sequence[Effect], Sequence[Parameter]], Calibration] | None = None  # a model to convergence
    added: Callable[[str, str, Array], Array] | None = None  # columns of a basis added to a sensor that is no channel
    turns: Callable[[Sequence[Effect]], float] | None = None  # rad by which turns miss gravity with these at rest

    @property
    def weight(self) -> Array:
        """Weights (n, C) in units of which all rows are equally sure; the surest have one."""
        return (
            np.ones((len(self.recording.time), len(self.channels)))
            if self.sigma is None
            else self.sigma.min() / self.sigma
        )

    def about(self, effects: Sequence[Effect]) -> Rows:
        """Rows whose columns hold no noise of the readings, for what is not in the model yet.

        A column made of readings varies with their noise, and where the model takes up all the rest of it, it is a copy
        of the misfit: a cause that explains everything. At rest the force is as long as gravity, whatever was read.
        """
        return (self.ideal or self.rows)(effects)

    def linear(self, effects: Sequence[Effect], wanted: Sequence[Parameter]) -> tuple[Array, Array]:
        """Misfit (n, C) about the effects and its derivative (n, C, p) by the wanted parameters."""
        rows = self.rows(effects)
        return rows.residual, rows.jacobian(wanted)


def of_channels(n: int, C: int) -> Array:
    """How a wander of each channel by itself shows in n rows, (n, C, C)."""
    return np.asarray(np.broadcast_to(np.eye(C), (n, C, C)))


def gauges(stages: Container[Stage]) -> frozenset[tuple[str, str]]:
    """Parameters (effect, axis) that only turn a frame for which these rows hold no reference."""
    return frozenset((i, axis) for i, cls in CATALOGUE.items() if cls.stage in stages for axis in cls.gauge)


def pointing(recording: Recording, baseline: Sequence[str] = ()) -> View:
    """A pointing run; every star is a visit of its own."""
    s = on_stars(recording)
    calm = calmer(recording)

    def rows(effects: Sequence[Effect]) -> Rows:
        return against_stars(recording, s, effects)

    def ideal(effects: Sequence[Effect]) -> Rows:
        found = rows(effects)
        there = s.at(readout=s.readout + ~calm * _beside(found))
        return replace(against_stars(recording, there, effects), residual=found.residual)

    return View(
        "pointing",
        recording,
        s,
        CHANNELS,
        "arcsec",
        _by_weight(recording),
        STAGES,
        tuple(baseline) or BASELINE["pointing"],
        rows,
        gauges({Stage.BASE}),
        ideal=ideal,
        wander=of_channels(len(recording.time), len(CHANNELS)) if len(recording.time) <= MANY else None,
    )


def _beside(rows: Rows) -> Array:
    """By how much the readouts (n, k) miss the angles at which the mount with these effects is on its stars [rad].

    Near the pole of the outer axis no readout is told by where the star is: there they stay.
    """
    S = rows.sensitivity[Stage.ENCODER]
    square = S[:, :, : S.shape[1]]  # what is read are the innermost axes
    told = np.abs(np.linalg.det(square)) > POLE
    out = np.zeros((len(S), S.shape[2]))
    out[told, : S.shape[1]] = np.linalg.solve(square[told], rows.residual[told][..., None])[..., 0]
    return out


def _by_weight(recording: Recording) -> Array | None:
    """Sigma (n, 2) of stars in units of the typical one; None where all weigh alike."""
    if np.all(recording.weight == recording.weight[0]):
        return None
    return np.repeat(1 / np.sqrt(recording.weight)[:, None], len(CHANNELS), axis=1)


def norm(recording: Recording, baseline: Sequence[str] = ()) -> View:
    """Rest positions of unknown attitude: one row each."""
    means, _ = scaled_by_gravity(dwell_means(recording))
    y, g = means.triad(FORCE), means.site.gravity
    s = stimulus_from_readings(means).at(rate=np.zeros_like(y))  # at rest

    channels = tuple((FORCE, a) for a in "xyz")

    def rows(effects: Sequence[Effect], ideal: bool = False) -> Rows:
        f, H = solved(lambda f: accelerometers(f, s, effects), y)
        length = np.linalg.norm(f, axis=-1)
        towards = np.linalg.solve(np.swapaxes(H, -1, -2), (f / length[:, None])[..., None])[..., 0]
        felt = f * (g / length[:, None] if ideal else 1.0)
        felt = linearise(BENCH, s.at(force=felt), effects, channels=channels, stages=SENSOR_STAGES)
        along = felt.reduced(lambda X: np.einsum("nc,ncp->np", towards, X)[:, None])
        return replace(along, residual=(length - g)[:, None])

    sample = means.sigma("accelerometer")
    noise = (sample / np.sqrt(means.weight))[:, None] if sample else None  # a channel of few levels may not scatter
    ids = tuple(baseline) or ACCELEROMETER_TERMS
    return View(
        "norm", means, s, ((FORCE, "norm"),), "mg", None, SENSOR_STAGES, ids, rows, gauges(SENSOR_STAGES), noise=noise,
        ideal=lambda effects: rows(effects, ideal=True), wander=(y / np.linalg.norm(y, axis=1)[:, None])[:, None],
    )  # fmt: skip


def table(recording: Recording, baseline: Sequence[str] = (), step: float = COARSE) -> View:
    """Force and rate of a unit that starts level and is tilted, in means over `BLOCK`; the mean force is not known.

    What a lever arm makes of a block's mean is the change of rate between its ends: means of the rate over `step` blur
    these, so that the sizes come from `FINE` steps, while `COARSE` ones tell the causes apart.
    """
    whole = recording
    refuse_table(recording)
    recording = averaged(recording, step)
    rate = recording.triad(RATE)  # what is read of the turning, as nothing else tells it
    s = stimulus_from_truth(recording, -recording.site.gravity * np.eye(3)[2] + 0 * rate, rate)
    size = _rows_in(recording, BLOCK)

    def centred(x: Array) -> Array:
        return np.asarray(x - x.mean(axis=0))

    y = recording.triad(FORCE)

    channels = tuple((FORCE, a) for a in "xyz")

    def rows(effects: Sequence[Effect]) -> Rows:
        fine = linearise(recording.platform, s, effects, channels=channels, read=y, stages=stages)
        return fine.reduced(lambda X: centred(_means(X, size)))

    stages = frozenset({Stage.PLATFORM, *SENSOR_STAGES})
    ids = tuple(baseline) or ACCELEROMETER_BIAS
    return View(
        "table", averaged(recording, BLOCK), s, channels, "ug", None, stages, ids, rows,
        frozenset({(SIZE_EFFECT, a) for a in MATRIX_AXES}), BY_HAND,
        finer=(lambda: table(whole, baseline, FINE)) if step > FINE else None,
    )  # fmt: skip


def refuse_table(recording: Recording) -> None:
    """Raise InputError for a table that is logged too shortly, or in counts."""
    logged = next((u for u in recording.units.values() if is_raw(u)), "")
    if logged:
        raise InputError(
            f"{recording.title!r} reads in {logged}: a tilting table needs m/s^2 and rad/s; give the scale of its "
            "columns, or a `position` column if the unit was turned from rest to rest"
        )
    lasts = float(recording.time[-1] - recording.time[0])
    if lasts < FEWEST * BLOCK:
        raise InputError(
            f"{recording.title!r} lasts {lasts:.2g} s: a tilting table is judged by means over {BLOCK:g} s, so give "
            f"{FEWEST} s or more"
        )


def averaged(recording: Recording, duration: float) -> Recording:
    """Means over blocks of rows of about this duration [s]; a last, shorter block is left out."""
    size = _rows_in(recording, duration)
    return replace(
        recording, time=_means(recording.time, size), position=None, weight=_means(recording.weight, size) * size,
        channels={k: _means(x, size) for k, x in recording.channels.items()},
    )  # fmt: skip


def _rows_in(recording: Recording, duration: float) -> int:
    return max(1, round(duration / float(np.median(np.diff(recording.time)))))


def _means(x: Array, size: int) -> Array:
    n = len(x) // size
    return np.asarray(x[: n * size].reshape(n, size, *x.shape[1:]).mean(axis=1))


def solved(h: Callable[[Array], Array], y: Array) -> tuple[Array, Array]:
    """f (n, 3) with h(f) = y, and dh/df (n, 3, 3) there. Raises InputError where different forces read the same."""
    f, H, flat = invert(h, y)
    if np.any(flat):
        raise InputError(
            "in the model of the accelerometers different forces read the same; name bias, scale_factor and "
            "misalignment in --baseline, and no dead_zone"
        )
    return f, H
