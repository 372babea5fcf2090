"""One kind of measurement: residuals as a function of the effects in the model."""

from __future__ import annotations

from collections.abc import Callable, Container, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Any

import numpy as np

from gimbalcal.calibration import Calibration, Readout
from gimbalcal.effects import (
    CATALOGUE,
    Effect,
    Parameter,
    Stage,
    Stimulus,
    known_effect,
    parameters,
    values,
    with_values,
    zero_effect,
)
from gimbalcal.effects.effect import GYROSCOPE_STAGES, SENSOR_STAGES, constants, followed_covariate, lacking_quantity
from gimbalcal.effects.grids import limits
from gimbalcal.effects.sensor_grades import Grade, drift_rate_factor
from gimbalcal.errors import InputError
from gimbalcal.forward import Rows
from gimbalcal.number import Array
from gimbalcal.platform import zeros_of_axes
from gimbalcal.recording import Recording
from gimbalcal.recording.kinds import Kind
from gimbalcal.recording.record import FORCE, RATE, Key, since_power_up
from gimbalcal.views.local import Local
from gimbalcal.views.noise import NoiseModel

FLAT_PRIOR_SIGMAS = 1e6  # sigmas of all rows together that one sigma of a flat prior stands for
HISTORY_COSINES = 80  # cosines of the time history of a sensor: a 400th of a walk is beyond them
EXACT = 1e-12  # m/s^2, rad/s or rad; below it no instrument reads anything


@dataclass(frozen=True)
class Measurement:
    """What the rows of a kind of view are: the unit they are printed in, what they may follow, and their words.

    rows and channels are plural; channel holds `{axis}`. acts_on: quantities to which a law of no catalogue may be
    added. patterns: what a row may follow in addition to a slow trend, of "fast time", "orientation", "angles",
    "temperature" and "sensors" (the same along each accelerometer). reads_force: whether columns are made of forces
    that were read. timing: whether rows are delays, which time stamps correct and no calibration. law_suffix: of the
    ids of laws, where another kind of view tells laws of the same outputs. known_attitude: whether rows are readings of
    a platform whose attitude is known.
    """

    name: str
    unit: str
    rows: str = "rows"
    channels: str = "the readings"
    channel: str = "the reading along {axis}"
    acts_on: tuple[str, ...] = ()
    patterns: frozenset[str] = frozenset()
    reads_force: bool = False
    timing: bool = False
    law_suffix: str = ""
    known_attitude: bool = False


@dataclass(frozen=True, eq=False)
class View:
    """Residuals of one kind of measurement as a function of the effects in the model, and what their noise may be.

    evaluate: effects to `Rows` about them, of n rows and C channels in SI. reference: the same with columns that hold
    no noise of the readings, see `noise_free`. stimulus: what the hardware experienced in the samples that the rows are
    made of, which may be more than n. groups (n,): ordinal of the group of rows that is held out together.
    nuisances: explicit parameters of no effect (a heading, a mounting, a lag), of which `Rows.nuisance` are the
    columns; their prior sigma is in SI, infinite for a flat prior.
    """

    measurement: Measurement
    title: str
    kind: Kind  # of the recording, by which effects say where they show
    channels: tuple[Key, ...]
    time: Array  # (n,) s since the first row
    stimulus: Stimulus
    evaluate: Callable[[Sequence[Effect]], Rows]
    stages: frozenset[Stage]  # that show in these rows
    baseline: tuple[str, ...]  # effects that the model holds
    grade: Grade
    groups: Array
    noise: NoiseModel
    source: Recording  # what it was made of, for plans and provenance
    readout: Readout = field(default_factory=Readout)  # nominal scales of counts, names of gimbals
    label: Array | None = None  # (n,) number of the dwell or star of each row, if it is called by a number
    session: Array | None = None  # (n,) power-up of each row, if the time between them is unknown
    read_gimbals: tuple[str, ...] = ()  # whose angles were read
    gauge: frozenset[tuple[str, str]] = frozenset()  # (effect, axis) that these rows cannot show by convention
    nuisances: tuple[Parameter, ...] = ()
    about: Callable[[Array], View] | None = None  # the same rows at values (m,) of nuisances that are not linear
    local: Local | None = None  # parameters that each group of rows has for itself; only of a known scale
    acting: frozenset[str] | None = None  # effects that act in these rows, where a joint model holds others as well
    prior_factor: float = 1.0  # times the sizes of the unit's grade
    reference: Callable[[Sequence[Effect]], Rows] | None = None
    relinearise: Callable[[Effect, Sequence[Parameter]], View] | None = None  # with this in the model as well
    calibrate: Callable[[Sequence[Effect], Sequence[Parameter]], Calibration] | None = None  # a model, to convergence
    added: Callable[[str, str, Array], Array] | None = None  # columns of a basis added to a sensor that is no channel
    missed_by_turns: Callable[[Sequence[Effect]], float] | None = None  # rad of gravity, with these effects at rest
    cache: dict[Any, Any] = field(default_factory=dict)  # models of a search and columns that were scanned
    columns: dict[tuple[str, str, str], Array] = field(default_factory=dict)  # of sensors that are no channels

    def __len__(self) -> int:
        """Return the number of rows n."""
        return len(self.time)

    @property
    def name(self) -> str:
        """The kind of measurement, by which results go."""
        return self.measurement.name

    @property
    def unit(self) -> str:
        """The unit of print of the rows."""
        return self.measurement.unit

    @property
    def elapsed(self) -> Array:
        """Time (n,) [s] since the first row, or since the first of its power-up where pauses are unknown."""
        return self.time if self.session is None else since_power_up(self.time, self.session)

    @property
    def weight(self) -> Array:
        """Weights (n, C) in units of which all rows are equally sure; the surest have one."""
        return self.noise.weight((len(self), len(self.channels)))

    @property
    def separate_settings(self) -> bool:
        """Return whether a mount was set on one star after the other, so that no row resembles the one before."""
        return self.kind.sighting and not self.noise.own_memories

    @property
    def visits(self) -> Local:
        """The setting errors of the visits, of a view of positions."""
        assert self.local is not None
        return self.local

    @property
    def gimbals_with_readout(self) -> list[int]:
        """Return the ordinals of the gimbals whose angles were read."""
        return [i for i, a in enumerate(self.stimulus.axis_names) if a in self.read_gimbals]

    @property
    def local_sigma(self) -> float:
        """Return one sigma of the local parameters, SI; zero where there are none."""
        return 0.0 if self.local is None else self.local.sigma

    @property
    def sensors_may_walk(self) -> bool:
        """Return whether sensors may be asked for a random walk, a single one or all of a triad.

        Rows of a telescope are not sensors, and a walk between sessions of unknown separation has no known variance.
        """
        of_channels = self.noise.wander is not None and self.channels[0][0] in (FORCE, RATE)
        return self.session is None and (of_channels or self.added is not None)

    def of_scales(self, scales: Sequence[float] | Array = ()) -> View:
        """Return the view with these relative scales (C,) of its channels; without any, all scatter alike."""
        if not len(scales):
            return replace(self, noise=replace(self.noise, scales=())) if self.noise.scales else self
        least = min(scales)
        return replace(self, noise=replace(self.noise, scales=tuple(float(s / least) for s in scales)))

    def of_one_scale(self) -> View:
        """Return the view with one scale of all its channels."""
        return replace(self, noise=replace(self.noise, scales=(), one_scale=True))

    def of_own_scales(self) -> View:
        """Return the view with a scale of each channel where that is likelier, and no model fitted to it yet."""
        return replace(self, noise=replace(self.noise, of_each_channel=True), cache={})

    def parameters_of(self, effect_id: str) -> tuple[Parameter, ...]:
        """Return the parameters of an effect with the priors of the grade.

        Left out are those of gimbals that were not read and those that these rows cannot show. At known attitude a
        gimbal without a readout may be off as well, and a drift is as slow as the hour says.
        """
        names, known = self.stimulus.axis_names, self.measurement.known_attitude
        cls = known_effect(effect_id, "baseline")
        shown = (p for p in parameters(cls, names) if (p.effect, p.axis) not in self.gauge)
        candidates = (p for p in shown if known or p.axis not in names or p.axis in self.read_gimbals)
        drift_factor = 1.0 if known else drift_rate_factor(cls, float(np.ptp(self.stimulus.time)))
        usual = (self.grade.usual(p) for p in candidates)
        factors = ((p, self.prior_factor * (drift_factor if p.unit.endswith("/h") else 1.0)) for p in usual)
        return tuple(replace(p, sigma=factor * p.sigma) for p, factor in factors)

    @property
    def baseline_parameters(self) -> tuple[Parameter, ...]:
        """The parameters of the effects that the model holds."""
        return tuple(p for i in self.baseline for p in self.parameters_of(i))

    def starting_values(self, wanted: Sequence[Parameter]) -> Array:
        """Return the values (p,) [SI] from which a fit begins.

        Those of the zeros of a mount bring its readouts near its stars: its axes may count from anywhere, and the model
        is linear about small errors alone. All others are the means of their priors.
        """
        zeros = dict[str, float]()
        if self.kind.sighting and self.stimulus.true_angle is not None:
            read = self.gimbals_with_readout
            best = zeros_of_axes(self.stimulus.readout[:, read], self.stimulus.true_angle[:, read])
            zeros = dict(zip((self.stimulus.axis_names[i] for i in read), best.tolist(), strict=True))
        return np.array([zeros.get(p.axis, 0.0) if p.effect == "gimbal_zero" else p.mean for p in wanted])

    def time_history_of_sensor(self, quantity: str, axis: str) -> Array:
        """Return columns (n, C, HISTORY_COSINES) of a sensor that is no channel: cosines of its time history."""
        t = self.stimulus.time
        cosines = np.cos(np.pi * np.outer(t / (t[-1] or 1.0), np.arange(1, HISTORY_COSINES + 1)))
        return self.of_sensor("time history", quantity, axis, cosines)

    def of_sensor(self, name: str, quantity: str, axis: str, basis: Array) -> Array:
        """Return columns (n, C, m) of a basis of this name, added to a sensor that is no channel; computed once."""
        assert self.added is not None
        key = name, quantity, axis
        if key not in self.columns:
            self.columns[key] = self.added(quantity, axis, basis)
        return self.columns[key]

    def noise_free(self, effects: Sequence[Effect]) -> Rows:
        """Return rows whose columns hold no noise of the readings, for what is not in the model yet.

        A column made of readings varies with their noise, and where the model takes up all the rest of it, it is a copy
        of the misfit: a cause that explains everything. At rest the force is as long as gravity, whatever was read.
        """
        return (self.reference or self.evaluate)(effects)

    def without_nuisances(self, sigma: Array | float | None = None) -> View:
        r"""Return the view with linear nuisances eliminated: their contribution becomes noise of the rows.

        .. math:: r \to \Sigma \, (1 + N N^T)^{-1/2} \, \Sigma^{-1} r ,

        with N in units of one sigma Sigma of a row (default: by the scatter of its samples). If that is unknown, a
        prior cannot be weighted against the rows, and all nuisances are free.
        """
        if not self.nuisances:
            return self
        shape, unknown = (len(self), len(self.channels)), sigma is None and self.noise.sigma is None
        if sigma is None:
            sigma = 1.0 if self.noise.sigma is None else self.noise.sigma
        sigma = np.broadcast_to(sigma, shape).reshape(-1, 1)
        N = np.asarray(self.evaluate(()).nuisance).reshape(len(sigma), -1) / sigma
        flat = np.isinf(prior := np.array([p.sigma for p in self.nuisances])) | unknown
        U, S, _ = np.linalg.svd(
            N * np.where(flat, FLAT_PRIOR_SIGMAS / np.maximum(np.linalg.norm(N, axis=0), 1e-300), prior),
            full_matrices=False,
        )
        less = 1 - 1 / np.sqrt(1 + S**2)

        def clear(X: Array) -> Array:
            A = X.reshape(len(sigma), -1) / sigma
            return np.asarray((sigma * (A - (U * less) @ (U.T @ A))).reshape(X.shape))

        def evaluate(effects: Sequence[Effect]) -> Rows:
            return replace(self.evaluate(effects).reduced(clear), nuisance=None)

        return replace(self, nuisances=(), about=None, evaluate=evaluate)

    def linearised(self, effects: Sequence[Effect], wanted: Sequence[Parameter]) -> tuple[Array, Array]:
        """Return the misfit (n, C) about the effects and its derivative (n, C, p) by the wanted parameters."""
        rows = self.evaluate(effects)
        return rows.residual, rows.jacobian(wanted)


@dataclass(frozen=True, eq=False)
class Fit:
    """A model of a view: effects with the parameters that were fitted, what it leaves, and the derivatives there.

    residual (n, C) and jacobian (n, C, q) are in units of the noise where its scale is known, else in SI; behind those
    of the p parameters the jacobian may hold columns of no effect. covariance (p, p) in SI, empty if it was not
    requested.
    """

    view: View
    effects: tuple[Effect, ...]
    parameters: tuple[Parameter, ...]
    residual: Array
    jacobian: Array
    covariance: Array = field(default_factory=lambda: np.zeros((0, 0)))
    kept: Rows | None = None  # the rows about the effects, in the units of the residual, where they are asked for again

    @property
    def rows(self) -> Rows:
        """Rows about the effects, whose columns hold no noise of the readings, in the units of the residual."""
        return self.kept if self.kept is not None else self.view.noise_free(self.effects)

    @property
    def sigma(self) -> Array:
        """One sigma (C,) of a row of known noise scale, SI."""
        return np.asarray(self.view.noise.sigma)

    @property
    def x(self) -> Array:
        """Estimate (p,) of the parameters, SI."""
        return values(self.effects, self.parameters)

    @property
    def sigmas(self) -> Array:
        """One standard deviation (p,) of each parameter, SI."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    def shifted_effects(self, shift: Array) -> tuple[Effect, ...]:
        """Return the effects with the fitted parameters shifted by (p,) prior sigmas."""
        x = self.x + shift * np.array([p.sigma for p in self.parameters])
        return with_values(self.effects, self.parameters, x, self.view.stimulus.axis_names)

    @cached_property
    def Z(self) -> Array:
        """The jacobian (n, C, q), the column of each parameter times its prior sigma."""
        scale = np.ones(self.jacobian.shape[-1])
        scale[: len(self.parameters)] = [p.sigma for p in self.parameters]
        return self.jacobian * scale

    @property
    def rms(self) -> float:
        """Root mean square length of a row's residual."""
        return float(np.sqrt((self.residual**2).sum() / len(self.residual)))

    @property
    def rms_of_channels(self) -> Array:
        """Root mean square residual (C,) of each channel."""
        return np.asarray(np.sqrt(np.mean(self.residual**2, axis=0)))

    @property
    def scatter(self) -> float:
        """Rms residual of all channels, or geometric mean of theirs where they differ in scale.

        Rows have the weights of the fit, in which a better model leaves less: a short stretch may scatter ten times as
        much as a long one.
        """
        square = replace(self.view.noise, scales=()).weighted(self.residual) ** 2
        if not self.view.noise.scales:
            return float(np.sqrt(square.mean()))
        return float(np.exp(0.5 * np.log(square.mean(axis=0) + 1e-300).mean()))

    @property
    def exact(self) -> bool:
        """Return whether a residual in SI is the rounding of numbers that were made without noise."""
        return self.rms < EXACT

    def reduced(self, X: Array) -> Array:
        """Return columns (n, C, p) as rows (R, p) in which white noise is white: `NoiseModel.reduced`."""
        return self.view.noise.reduced(X)

    def expanded(self, X: Array) -> Array:
        """Return the columns (n, C, p) of reduced rows (n C, p), of unknown scale: what `reduced` undoes."""
        return np.asarray(X.reshape(*self.residual.shape, X.shape[-1]) / self.view.weight[..., None])


def nuisance(name: str, axis: str, unit: str, sigma: float) -> Parameter:
    """Return an explicit parameter of no effect, with prior sigma in SI; infinite for a flat prior."""
    return Parameter("", "", name, axis, 0, unit, sigma)


def by_triad(ids: Sequence[str]) -> tuple[list[str], list[str]]:
    """Effects of the forces, and those of the gyroscopes."""
    gyro = [i for i in ids if known_effect(i, "baseline").stage in GYROSCOPE_STAGES]
    return [i for i in ids if i not in gyro], gyro


def effects_of_another_day(calibration: Calibration | None, baseline: Sequence[str]) -> tuple[Effect, ...]:
    """Effects of a calibration that hold on another day: the baseline's and the sensors', not how the rig stood."""
    stages = SENSOR_STAGES | GYROSCOPE_STAGES
    if unknown := [e.id for e in (calibration.effects if calibration else ()) if e.id not in CATALOGUE]:
        raise InputError(
            f"calibration holds the effect {unknown[0]!r}, which the catalogue does not have; give the file that "
            "defines it with --effects law.py, or load it with load_effects"
        )
    return tuple(e for e in (calibration.effects if calibration else ()) if e.id in baseline or e.stage in stages)


def absent_effect(effect_id: str, s: Stimulus, source: str = "", **constants: float) -> Effect:
    """Return an effect of the catalogue with zero parameters, these constants, following covariate `source`."""
    named: dict[str, Any] = {"covariate": source} if source else {}
    return replace(zero_effect(CATALOGUE[effect_id], s.axis_names), **constants, **named)


def range_of_constants(wanted: Sequence[Parameter], *stimuli: Stimulus) -> Array | None:
    """Least and greatest value (2, p) of each parameter that any of these rows resolve; None without constants."""
    fields = {(p.effect, f.name): f for p in wanted for f in constants(CATALOGUE[p.effect])}
    each = [(p.effect, p.field) for p in wanted]
    if not any(key in fields for key in each):
        return None
    free = (-np.inf, np.inf)
    ranges = [[limits(fields[k], s) if k in fields else free for k in each] for s in stimuli]
    return np.stack([np.min(ranges, axis=0)[:, 0], np.max(ranges, axis=0)[:, 1]])


def gauge_parameters(stages: Container[Stage]) -> frozenset[tuple[str, str]]:
    """Return the parameters (effect, axis) that only turn a frame for which rows of these stages hold no reference."""
    return frozenset((i, axis) for i, cls in CATALOGUE.items() if cls.stage in stages for axis in cls.gauge)


def gyroscope_parameters_without(s: Stimulus, shown: Callable[[Effect], bool]) -> frozenset[tuple[str, str]]:
    """Return the parameters (effect, axis) of gyroscopes that do not pass a test of the effect at its usual size."""
    out = set()
    for cls in CATALOGUE.values():
        if cls.stage in GYROSCOPE_STAGES and not cls.spans_rows and not lacking_quantity(cls, s.carries):
            none = absent_effect(cls.id, s, next(iter(s.covariates)) if followed_covariate(cls) == "" else "")
            for p in parameters(cls, s.axis_names):
                (effect,) = with_values([none], (p,), np.array([p.sigma]), s.axis_names)
                if not shown(effect):
                    out.add((p.effect, p.axis))
    return frozenset(out)


def without_sizes(effect: Effect) -> Effect:
    """Return the effect with its constants and no size."""
    names = (*(f.name for f in constants(type(effect))), "covariate")
    kept = {f.name: getattr(effect, f.name) for f in fields(effect) if f.name in names}
    return replace(zero_effect(type(effect)), **kept)


def recording_fields(recording: Recording) -> dict[str, Any]:
    """Return the fields of a view that a recording with its rows tells: title, clock, grade and read gimbals."""
    return {
        "title": recording.title, "source": recording, "kind": recording.kind,
        "time": recording.time - recording.time[0],
        "session": recording.session if recording.restarts else None, "grade": recording.grade,
        "read_gimbals": recording.axes("gimbal_angle"), "readout": Readout(gimbals=recording.platform.axis_names),
    }  # fmt: skip
