"""The result of an estimator: effects with their covariance, unobservable directions, residual and provenance."""

from __future__ import annotations

import hashlib
import json
import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

import numpy as np

from gimbalcal.atomic import write_json
from gimbalcal.calibration.arrays import FrameT, correct_arrays, correct_frame
from gimbalcal.calibration.content_checks import (
    CalibrationFile,
    HistoryRow,
    StageRow,
    refuse_misfit,
    refuse_mount,
    refuse_other_definitions,
    refuse_unsound,
)
from gimbalcal.calibration.correction import correct, corrupt, extrapolations
from gimbalcal.calibration.matrices import TriadCorrection, corrections
from gimbalcal.calibration.provenance import Provenance
from gimbalcal.calibration.readout import Readout, from_content
from gimbalcal.display import Displayed, data_frame, panels
from gimbalcal.effects import CATALOGUE, Effect, Parameter, parameters, values, with_values
from gimbalcal.effects.effect import stated_law
from gimbalcal.entries import Json, entry_from, plain_json, read_json
from gimbalcal.errors import InputError
from gimbalcal.inference.information import Unobservable
from gimbalcal.number import Array
from gimbalcal.platform import KNOWN
from gimbalcal.recording import Recording
from gimbalcal.recording.frames import Entry as ColumnEntry
from gimbalcal.units import LARGER_OF_SENSOR, from_si, printed_unit, to_si

if TYPE_CHECKING:
    from matplotlib.figure import Figure

IDENTITY_DIGITS = 16
FORMAT = 2  # of calibration.json: true = SF x reading for both triads


@dataclass(frozen=True)
class Residual:
    """Weighted misfit and, per channel, the rms residual in SI; statistics of the filter of a navigator."""

    chi2: float
    dof: int
    rms: Mapping[str, float]
    navigation: Json = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class StageHistory:
    """Estimates and sigmas (m, p) of the unknowns of a stage over time (m,) [s], SI."""

    time: Array
    values: Array
    sigmas: Array


@dataclass(frozen=True)
class StageResult:
    """One stage of a calibration for the record: estimate and sigma (SI, order of `labels`), rms residual [m/s^2].

    history: the estimates of a sequential stage, row by row.
    """

    name: str
    labels: tuple[str, ...]
    values: Array
    sigmas: Array
    rms: float
    in_words: str = ""
    history: StageHistory | None = None

    def to_dict(self) -> Json:
        """Return the stage as it stands in calibration.json."""

        def by_label(x: Array) -> Json:
            return dict(zip(self.labels, np.asarray(x).T.tolist(), strict=True))

        content: Json = {
            "name": self.name, "values": by_label(self.values), "sigmas": by_label(self.sigmas), "rms": self.rms,
            "in_words": self.in_words,
        }  # fmt: skip
        if self.history is not None:
            values, sigmas = by_label(self.history.values), by_label(self.history.sigmas)
            content["history"] = {"time_s": self.history.time.tolist(), "values": values, "sigmas": sigmas}
        return content

    def value_of(self, label: str) -> float:
        """Return the estimate of a parameter of this stage, SI."""
        return float(self.values[self.labels.index(label)])

    def sigma_of(self, label: str) -> float:
        """Return one sigma of a parameter, SI; nan for a parameter that this stage does not estimate."""
        return float(self.sigmas[self.labels.index(label)]) if label in self.labels else float("nan")


SENSOR_AXES = ("misalignment", "gyro_misalignment")
"""Effects, and names, of the misalignments of input axes."""


@dataclass(frozen=True)
class ParameterEstimate:
    """A parameter with its value, one sigma and the sigma of its prior, in its unit of print."""

    parameter: Parameter
    value: float
    sigma: float

    @property
    def prior_sigma(self) -> float:
        """One sigma of the prior, in the unit of print."""
        return float(from_si(self.parameter.sigma, self.parameter.unit))

    @property
    def in_words(self) -> str:
        """The effect of a scale factor error on the reading, in words; empty for any other parameter.

        >>> scale = next(p for p in parameters(CATALOGUE["gyro_scale_factor"]))
        >>> ParameterEstimate(scale, -4000.0, 10.0).in_words
        'reads 0.402 % too much'
        """
        x = float(to_si(self.value, self.parameter.unit))
        if self.parameter.effect not in ("scale_factor", "gyro_scale_factor") or x <= -1:
            return ""
        percent = 100 * (1 / (1 + x) - 1)
        return f"reads {abs(percent):.3g} % too {'much' if percent > 0 else 'little'}"

    def to_dict(self) -> Json:
        """Return a row of the parameters of calibration.json."""
        p = self.parameter
        row = {"name": p.name, "axis": p.axis, "value": self.value, "sigma": self.sigma, "unit": p.unit,
               "prior_sigma": self.prior_sigma, "effect": p.effect}  # fmt: skip
        return row | ({"in_words": self.in_words} if self.in_words else {})


@dataclass(frozen=True, repr=False)
class Calibration(Displayed):
    """Result of an estimator; `outcome` is a sentence where it is to be used with care, and empty otherwise."""

    method: str
    effects: tuple[Effect, ...]
    parameters: tuple[Parameter, ...]
    covariance: Array  # (p, p) SI, order of `parameters`
    unobservable: tuple[Unobservable, ...]
    residual: Residual
    outcome: str = ""
    provenance: Provenance = field(default_factory=Provenance)
    stages: tuple[StageResult, ...] = ()
    readout: Readout = field(default_factory=Readout)
    printer: Callable[[Calibration], str] | None = field(default=None, compare=False)  # of str(calibration)

    @classmethod
    def ideal(cls, method: str) -> Calibration:
        """Return the calibration of ideal sensors: no effects."""
        return cls(method, (), (), np.zeros((0, 0)), (), Residual(0.0, 0, {}))

    @property
    def values(self) -> Array:
        """Estimates (p,) in SI."""
        return values(self.effects, self.parameters)

    @property
    def sigmas(self) -> Array:
        """One standard deviation (p,) in SI."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def estimates(self) -> tuple[ParameterEstimate, ...]:
        """Parameters with values and sigmas in their units of print, in the order of `parameters`."""
        return tuple(
            ParameterEstimate(p, float(from_si(v, p.unit)), float(from_si(s, p.unit)))
            for p, v, s in zip(self.parameters, self.values, self.sigmas, strict=True)
        )

    @property
    def matrices(self) -> dict[str, TriadCorrection]:
        """Misalignment matrix T, scales K and bias b of each triad whose linear terms were estimated."""
        readout = {"accelerometers": self.readout.accelerometers, "gyroscopes": self.readout.gyroscopes}
        counts = {t: (np.array(c.scale), np.array(c.offset)) for t, c in readout.items() if c is not None}
        return corrections(self.effects, self.parameters, counts)

    @property
    def in_printed_units(self) -> Calibration:
        """The calibration with the misalignments of each triad in the unit in which the largest is printed."""
        largest = dict.fromkeys(SENSOR_AXES, 0.0)
        for e in self.estimates:
            if e.parameter.effect in largest:
                largest[e.parameter.effect] = max(largest[e.parameter.effect], abs(e.value))
        parameters = tuple(
            replace(p, unit=printed_unit(largest[p.effect], p.unit, LARGER_OF_SENSOR)) if p.effect in largest else p
            for p in self.parameters
        )
        return replace(self, parameters=parameters)

    @property
    def identity(self) -> str:
        """Return the beginning of the SHA-256 of what it corrects by: parameters, their values, and the readout."""
        rows = [(p.label, value) for p, value in zip(self.parameters, self.values.tolist(), strict=True)]
        text = json.dumps([rows, self.readout.to_dict()], sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:IDENTITY_DIGITS]

    @property
    def explained(self) -> bool:
        """Return whether the model explains the data: nothing to be careful of, no pattern in what is left of stars."""
        return not self.outcome and self.provenance.pattern is None

    @property
    def null_directions(self) -> tuple[Unobservable, ...]:
        """Entries of `unobservable` among the estimated parameters; the others concern parameters that were fixed."""
        labels = {p.label for p in self.parameters}
        return tuple(u for u in self.unobservable if labels.issuperset(u.direction))

    def __str__(self) -> str:
        """Return the text of the console; without a printer parameters, unobservable directions and outcome."""
        if self.printer is not None:
            return self.printer(self)
        names = [f"{p.name} {p.axis}".strip() for p in self.parameters]
        wide = max(map(len, names), default=0)
        lines = zip(names, self.estimates, strict=True)
        table = [f"{n:{wide}s} {_rounded_columns(e.value, e.sigma)} {e.parameter.unit}" for n, e in lines]
        labels = {p.label for p in self.parameters}
        fixed: dict[str, list[str]] = {}
        for label in (label for u in self.unobservable for label in u.direction if label not in labels):
            fixed.setdefault(label.partition(":")[0], []).append(label.partition(":")[2])
        estimated = {p.label.partition(":")[0] for p in self.parameters}
        named = [f"{name} {', '.join(axes)}" if name in estimated else name for name, axes in fixed.items()]
        remarks = [f"not determined separately: {', '.join(d)}" for d in (u.direction for u in self.null_directions)]
        remarks += [f"not estimated: {'; '.join(named)}"] if fixed else []
        return "\n".join([f"{self.method} calibration", *table, *remarks, *filter(None, [self.outcome])])

    def to_frame(self, kind: str = "polars") -> Any:
        """Return a row for each parameter: effect, name, axis, value, sigma and prior_sigma in `unit`.

        kind: "polars" or "pandas".
        """
        columns = ("effect", "name", "axis", "value", "sigma", "prior_sigma", "unit")
        rows = [e.to_dict() for e in self.estimates]
        return data_frame({c: [r[c] for r in rows] for c in columns}, kind, ("effect", "name", "axis", "unit"))

    def plot(self) -> Figure:
        """Return a matplotlib figure with a panel for each name: its parameters with two sigmas, in their unit."""
        groups: dict[tuple[str, str], list[ParameterEstimate]] = {}
        for e in self.estimates:
            groups.setdefault((e.parameter.name, e.parameter.unit), []).append(e)
        named = Counter(own[0].parameter.effect for own in groups.values())
        first = [own[0].parameter for own in groups.values()]
        titles = [p.effect if named[p.effect] == 1 or p.name == p.effect else f"{p.effect}, {p.name}" for p in first]
        figure, axes = panels([f"{t.replace('_', ' ')} [{p.unit}]" for t, p in zip(titles, first, strict=True)])
        for ax, own in zip(axes, groups.values(), strict=True):
            at = np.arange(len(own))
            ax.errorbar(at, [e.value for e in own], [2 * e.sigma for e in own], fmt="o", ms=4, capsize=2)
            ax.axhline(0, color="0.7", lw=0.8, zorder=0)
            ax.set_xticks(at, [e.parameter.axis or e.parameter.name for e in own])
            ax.margins(x=0.15)
        return figure

    @overload
    def apply(self, recording: Recording) -> Recording: ...
    @overload
    def apply(self, recording: Mapping[str, Any], units: Mapping[str, str] | None = None) -> dict[str, Array]: ...
    @overload
    def apply(self, recording: FrameT, *, columns: Mapping[str, ColumnEntry] | None = None) -> FrameT: ...
    def apply(
        self,
        recording: Recording | Mapping[str, Any] | FrameT,
        units: Mapping[str, str] | None = None,
        columns: Mapping[str, ColumnEntry] | None = None,
    ) -> Recording | dict[str, Array] | FrameT:
        """Return the recording corrected, readings to physics: force [m/s^2], rate [rad/s] and true gimbal angles.

        A mapping of arrays, {"time": (n,), "specific_force": (n, 3), "angular_rate": (n, 3), ...}, gives arrays in
        the same units: SI, or `units` by quantity as in `from_arrays`. Further arrays (temperature (n,), a gimbal_angle
        by axis) are used where an effect needs them.

        A data frame (pandas, polars) gives such a frame: columns of force and rate corrected in place, in their own
        units, all others as they are. columns: what they hold, as in `from_frame`; without, they are interpreted as
        there.
        """
        if isinstance(recording, Recording):
            marked = (*recording.corrected, self.identity)
            corrected = correct(self, recording)
            remarks = [*recording.remarks]
            if recording.corrected:
                which = "this" if self.identity in recording.corrected else "another"
                remarks.append(
                    f"{recording.title!r} has been corrected by {which} calibration already, and is now corrected "
                    "again: give the recording as it was logged, or undo that with --inverse"
                )
            return replace(corrected, corrected=marked, remarks=(*remarks, *extrapolations(self, corrected)))
        if isinstance(recording, Mapping):
            return correct_arrays(self, recording, units)
        if units is not None and hasattr(recording, "columns"):
            raise InputError("of a data frame give columns, as in columns={'ax': 'specific_force x [g]'}, not units")
        return correct_frame(self, recording, columns)

    def corrupt(self, recording: Recording) -> Recording:
        """Return what this unit would have read, physics to readings: the exact inverse of `apply`."""
        before = list(recording.corrected)
        if self.identity in before:
            before.reverse()
            before.remove(self.identity)
            before.reverse()
        return replace(corrupt(self, recording), corrected=tuple(before))

    def effect_class(self, effect_id: str) -> type[Effect]:
        """Return the class of an effect, which the catalogue need not hold any more: that of a law that was found."""
        own = (type(e) for e in self.effects if e.id == effect_id)
        return next(own, None) or CATALOGUE[effect_id]

    def to_dict(self) -> Json:
        """Return the content of calibration.json: values in printed units, covariance in SI."""
        covariates = {e.id: getattr(e, "covariate", "") for e in self.effects}
        rows = [
            e.to_dict() | ({"covariate": name} if (name := covariates.get(e.parameter.effect)) else {})
            for e in self.estimates
        ]
        residual: Json = {"chi2": self.residual.chi2, "dof": self.residual.dof, "rms": dict(self.residual.rms)}
        if self.residual.navigation:
            residual["navigation"] = dict(self.residual.navigation)
        return {
            "format": FORMAT,
            "method": self.method,
            "outcome": self.outcome,
            "parameters": rows,
            "model": [stated_law(self.effect_class(i)) for i in dict.fromkeys(p.effect for p in self.parameters)],
            "matrices": {triad: m.to_dict() for triad, m in self.matrices.items()},
            "covariance": np.asarray(self.covariance).tolist(),
            "unobservable": plain_json(self.unobservable),
            "residual": residual,
            "stages": [s.to_dict() for s in self.stages],
            "readout": self.readout.to_dict(),
            "provenance": self.provenance.to_dict(),
        }

    def write(self, path: str | Path) -> None:
        """Write calibration.json atomically."""
        write_json(path, self.to_dict())


def _rounded_columns(value: float, sigma: float) -> str:
    """Return a number and its sigma to two digits of the sigma, in columns."""
    digits = 1 - math.floor(math.log10(sigma)) if 0 < sigma < math.inf else 6
    rounded = [f"{round(x, digits):.{max(digits, 0)}f}" for x in (value, sigma)]
    return f"{rounded[0]:>14s} +- {rounded[1]:<10s}"


def from_dict(content: object) -> Calibration:
    """Return the calibration in the content of calibration.json. Raises InputError, see `content_checks`."""
    version = content.get("format") if isinstance(content, dict) else None
    if not isinstance(content, dict) or version != FORMAT:
        raise InputError(f"calibration has format {version!r}, this version reads format {FORMAT}")
    file = entry_from(CalibrationFile, content, "")
    readout, rows = from_content(content), file.parameters
    gimbals = readout.gimbals or gimbals_of([(r.name, r.axis) for r in rows])
    known = {(p.name, p.axis): p for cls in CATALOGUE.values() for p in parameters(cls, gimbals, constants=True)}
    missing = [f"{r.name}:{r.axis}" for r in rows if (r.name, r.axis) not in known]
    origin = Provenance.read(file.provenance)
    if origin.mount:
        refuse_mount(origin.mount)
    refuse_other_definitions([r.effect for r in rows if r.effect is not None], origin.effects or ())
    if missing:
        raise InputError(f"the calibration has parameters that this version does not know: {', '.join(missing)}")
    chosen = tuple(known[r.name, r.axis] for r in rows)
    refuse_unsound(rows, chosen, file.covariance)
    refuse_misfit(file.residual)
    x = np.array([to_si(r.value, r.unit) for r in rows], dtype=float)
    covariates = {r.effect: r.covariate for r in rows if r.covariate}
    effects = with_values((), chosen, x, gimbals)
    return Calibration(
        method=file.method,
        effects=tuple(
            replace(e, covariate=covariates[e.id]) if e.id in covariates else e  # type: ignore[call-arg]
            for e in effects
        ),
        parameters=chosen,
        covariance=np.array(file.covariance, dtype=float),
        unobservable=file.unobservable,
        residual=Residual(file.residual.chi2, file.residual.dof, file.residual.rms, file.residual.navigation or {}),
        outcome=file.outcome,
        provenance=origin,
        stages=tuple(map(_stage_of_row, file.stages)),
        readout=readout,
    )


def _stage_of_row(s: StageRow) -> StageResult:
    if s.values.keys() != s.sigmas.keys():
        raise InputError(f"stages / {s.name}: there must be a sigma for each of its values, by the same names")
    estimates, sigmas = (np.array([*x.values()], dtype=float) for x in (s.values, s.sigmas))
    history = _stage_history(s.history, tuple(s.values)) if s.history else None
    rms = math.nan if s.rms is None else s.rms
    return StageResult(s.name, tuple(s.values), estimates, sigmas, rms, s.in_words, history)


def _stage_history(row: HistoryRow, labels: tuple[str, ...]) -> StageHistory:
    time = np.array(row.time_s, dtype=float)
    lists = [by_label.get(label, []) for by_label in (row.values, row.sigmas) for label in labels]
    if any(len(x) != len(time) for x in lists):
        raise InputError("stages / history: each of its lists must have a number for each of time_s")
    both = np.array(lists, dtype=float).T
    return StageHistory(time, both[:, : len(labels)], both[:, len(labels) :])


def gimbals_of(named: Sequence[tuple[str, str]]) -> tuple[str, ...]:
    """Return the gimbals of the first known platform with those of the parameters (name, axis), else these alone."""
    any_gimbal = "?"
    by_gimbal = {p.name for cls in CATALOGUE.values() for p in parameters(cls, (any_gimbal,)) if p.axis == any_gimbal}
    axes = tuple(dict.fromkeys(axis for name, axis in named if name in by_gimbal))
    having = (platform.axis_names for platform in KNOWN.values() if set(axes) <= set(platform.axis_names))
    return next(having, axes)


def read(path: Path) -> Calibration:
    """Return the calibration in a calibration.json. Raises InputError, which names the file, if it cannot be read."""
    content = read_json(path, "a calibration.json that `gimbalcal calibrate` wrote")
    try:
        return from_dict(content)
    except InputError as problem:
        raise InputError(f"{path}: {problem}") from None
