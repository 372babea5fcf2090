r"""Observability of a planned recording of positions or a static run: sigmas, null directions and confounded effects.

From the whitened Jacobian of the forward model, with the setting errors eliminated (`estimate.accelerometers`):

* the Cramer-Rao bound, the sigma that an unbiased estimate of each parameter cannot beat;
* null directions: combinations of parameters that change no reading;
* confounded: two parameters, or two effects, that cannot be distinguished, because their columns, with those of all
  other parameters projected out, are parallel (:math:`|\cos| > 0.99`); of effects with several parameters, all those
  of the smaller one;
* for effects outside the calibration: the signal-to-noise ratio of one at its prior size, and the share of it that the
  calibration absorbs.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gimbalcal.display import Displayed, data_frame, panels
from gimbalcal.effects import Parameter, known_effect, parameters
from gimbalcal.effects.baseline_effects import BASELINE
from gimbalcal.entries import Json, plain_json
from gimbalcal.errors import InputError, number_of
from gimbalcal.estimate.fit import information_of
from gimbalcal.forward import jacobian
from gimbalcal.inference.algebra import orthonormal
from gimbalcal.inference.information import MIN_SIGNAL_TO_NOISE, Information, Solution, Unobservable, information, solve
from gimbalcal.kinematics import stimulus_from_angles
from gimbalcal.navigate.stationary_base import ideal_static_run
from gimbalcal.number import Array
from gimbalcal.recording import SENSORS, Recording
from gimbalcal.schedule import Schedule
from gimbalcal.schedule.file import read_schedule
from gimbalcal.units import from_si, to_si
from gimbalcal.views.positions import Noise, planned_recording, position_parameters, view_of_positions

if TYPE_CHECKING:
    from matplotlib.figure import Figure

CONFOUNDED_COSINE = 0.99  # separating two then takes 7 times the signal of detecting one
STATIC_SENSORS = ("accelerometer", "gimbal_angle", "attitude")  # as [noise] calls them
DWELL_S = 600.0  # a position of Wu et al. (2018), to whose mean a stated noise belongs


@dataclass(frozen=True)
class PredictedSigma:
    """Cramer-Rao bound of a parameter in its unit of print, and the bounds of other schedules by name."""

    parameter: Parameter
    sigma: float
    others: Mapping[str, float] = field(default_factory=dict)

    @property
    def prior_sigma(self) -> float:
        """One sigma of the prior, in the unit of print."""
        return float(from_si(self.parameter.sigma, self.parameter.unit))

    def to_dict(self) -> Json:
        """Return a row of the parameters of a plan's JSON."""
        p = self.parameter
        return {"name": p.name, "axis": p.axis, "unit": p.unit, "sigma": self.sigma, "prior_sigma": self.prior_sigma}


def predicted_sigmas(
    wanted: Sequence[Parameter], sigma: Array, others: Mapping[str, Array] | None = None
) -> tuple[PredictedSigma, ...]:
    """Return the bounds of parameters from their sigmas (p,) in SI, and from those of other schedules."""
    each = {name: from_si_each(wanted, s) for name, s in (others or {}).items()}
    own = from_si_each(wanted, sigma)
    return tuple(PredictedSigma(p, own[i], {n: s[i] for n, s in each.items()}) for i, p in enumerate(wanted))


def from_si_each(wanted: Sequence[Parameter], sigma: Array) -> list[float]:
    """Return sigmas (p,) in SI, each in the unit of print of its parameter."""
    return [float(from_si(s, p.unit)) for p, s in zip(wanted, sigma, strict=True)]


@dataclass(frozen=True)
class Confounded:
    """Two parameters or effects with nearly parallel signals; their cosine, all else fitted."""

    one: str
    other: str
    cosine: float


@dataclass(frozen=True)
class NotCalibrated:
    """Signal-to-noise ratio at prior size of an effect outside the calibration, and the share that is absorbed."""

    effect: str
    strength: float
    absorbed: float


@dataclass(frozen=True, eq=False, repr=False)
class Observability(Displayed):
    """Cramer-Rao bounds of a schedule, unobservable and confounded parameters, and effects outside the calibration."""

    schedule: str
    solution: Solution
    confounded: tuple[Confounded, ...]
    candidates: tuple[NotCalibrated, ...]
    noise: dict[str, float]

    def __str__(self) -> str:
        """Return the bound of each parameter and the answer, as the console has them."""
        from gimbalcal.words.answers import plan_answer
        from gimbalcal.words.tables import bounds_table

        return f"{bounds_table(self)}\n\n{plan_answer(self)}"

    def to_frame(self, kind: str = "polars") -> Any:
        """Return a row for each parameter: name, axis, sigma and prior_sigma in `unit`; "polars" or "pandas"."""
        rows = [row.to_dict() for row in self.rows]
        names = ("name", "axis", "sigma", "prior_sigma", "unit")
        return data_frame({n: [r[n] for r in rows] for n in names}, kind, ("name", "axis", "unit"))

    def plot(self) -> Figure:
        """Return a matplotlib figure of how much better than its prior each parameter becomes known."""
        figure, (ax,) = panels(["prior sigma / sigma"], width=8, height=0.5 + 0.17 * len(self.rows))
        names = [f"{r.parameter.name} {r.parameter.axis}".replace("_", " ") for r in self.rows]
        ax.barh(names, [r.prior_sigma / r.sigma for r in self.rows])
        ax.set_xscale("log")
        ax.invert_yaxis()
        return figure

    @property
    def sigma(self) -> Array:
        """Cramer-Rao bound (p,) in SI; the prior's sigma in unobservable directions."""
        return self.solution.sigma

    @property
    def in_words(self) -> str:
        """The answer in one paragraph."""
        n, unobservable = len(self.solution.parameters), self.unobservable
        lines = [f"{self.schedule} sees {n - len(unobservable)} of {number_of(n, 'combination')} of parameters"]
        lines += [f"not observable: {u.why}" for u in unobservable]
        lines += [f"confounded: {t.one} and {t.other} (cosine {t.cosine:+.4f})" for t in self.confounded]
        hidden = [c.effect for c in self.candidates if c.strength < MIN_SIGNAL_TO_NOISE]
        lines += [f"would not show at their usual size: {', '.join(hidden)}"] if hidden else []
        return "\n".join(lines)

    @property
    def unobservable(self) -> tuple[Unobservable, ...]:
        """Combinations of parameters that the schedule does not determine."""
        return self.solution.unobservable

    @property
    def rows(self) -> tuple[PredictedSigma, ...]:
        """The bound of each parameter, in its unit of print."""
        return predicted_sigmas(self.solution.parameters, self.sigma)

    def to_dict(self) -> Json:
        """Return the content of observability.json, in printed units."""
        return {
            "format": 1,
            "schedule": self.schedule,
            "noise": self.noise,
            "parameters": [row.to_dict() | {"effect": row.parameter.effect} for row in self.rows],
            "unobservable": plain_json(self.unobservable),
            "twins": plain_json(self.confounded),
            "candidates": plain_json(self.candidates),
            "in_words": self.in_words,
        }


def observe(
    schedule: Schedule | str | Path,
    angle_sigma: float = 1.0,
    force_sigma: float = 2.0,
    effects: Sequence[str] = BASELINE["multi-position"],
    candidates: Sequence[str] = (),
) -> Observability:
    """Return the observability of a multi-position schedule.

    schedule: itself, the name of a published one, or a schedule.toml; angle_sigma [arcsec] setting error of a
    position (infinite: attitude unknown), force_sigma [ug] noise of the mean force of a position; effects: ids that the
    calibration estimates; candidates: ids of effects that may be there besides. Raises InputError for unknown ids.
    """
    positions = schedule if isinstance(schedule, Schedule) else read_schedule(schedule)
    recording = planned_recording(positions)
    calibrated = position_parameters(positions.platform, effects)
    others = _parameters_of(candidates, effects, recording)
    noise = Noise(to_si(force_sigma, "ug"), to_si(angle_sigma, "arcsec"))
    info = information_in_positions(recording, (*calibrated, *others), noise)
    stated = {"gimbal_angle_arcsec": angle_sigma, "accelerometer_ug": force_sigma}
    return assess_information(positions.name, info, calibrated, stated)


def observe_static(
    hours: float,
    latitude: float,
    noise: dict[str, float],
    effects: Sequence[str] = BASELINE["static-run"],
    candidates: Sequence[str] = (),
    sample_s: float = 1.0,
) -> Observability:
    """Return the observability of a static run of `hours` at `latitude` [rad].

    noise: one sigma of a sample in SI by sensor (accelerometer, gimbal_angle, attitude); a sensor that is not named is
    not used. sample_s [s] between samples.
    """
    recording = ideal_static_run(hours, latitude, sample_s)
    names = recording.platform.axis_names
    calibrated = tuple(q for e in effects for q in parameters(known_effect(e), names))
    others = _parameters_of(candidates, effects, recording)
    wanted = (*calibrated, *others)
    if set(noise) - set(STATIC_SENSORS) or not noise:
        raise InputError(f"the noise of a static run is stated for {', '.join(STATIC_SENSORS)}; got {', '.join(noise)}")
    info = information_at_rest(recording, wanted, noise)
    return assess_information(
        f"static run of {hours:g} h at {np.rad2deg(latitude):.4g} deg", info, calibrated, dict(noise)
    )


def information_in_positions(plan: Recording, wanted: Sequence[Parameter], noise: Noise) -> Information:
    """Return the information of planned positions about the parameters, setting errors eliminated."""
    return information_of([view_of_positions(plan, noise, [p.effect for p in wanted])], (), wanted)


def information_at_rest(plan: Recording, wanted: Sequence[Parameter], noise: Mapping[str, float]) -> Information:
    """Return the information of a planned static run; noise: one sigma of a sample in SI of the sensors it has."""
    J = jacobian(plan.platform, stimulus_from_angles(plan), (), wanted, "static-run")
    root = np.sqrt(plan.weight)[:, None, None]
    rows = np.concatenate([(J[SENSORS[k]] * root / s).reshape(-1, len(wanted)) for k, s in noise.items()])
    return information(rows, np.zeros(len(rows)), wanted)


def observe_any(
    schedule: Schedule | str | Path, angle_sigma: float, force_sigma: float, latitude: float,
    candidates: Sequence[str] = (),
) -> Observability:  # fmt: skip
    """Return the observability of a multi-position schedule, or of a static run such as "static-48h".

    angle_sigma [arcsec], force_sigma [ug]: of the mean over one position, or over as long of a static run (`DWELL_S`);
    latitude [deg].
    """
    run = re.fullmatch(r"static-(\d+(?:\.\d+)?)h", str(schedule)) if not isinstance(schedule, Schedule) else None
    if run is None:
        return observe(schedule, angle_sigma, force_sigma, candidates=candidates)
    if not abs(latitude) < 90:
        raise InputError(f"--latitude must be between -90 and 90 deg, got {latitude:g}")
    angle = to_si(angle_sigma, "arcsec")
    noise = {"accelerometer": to_si(force_sigma, "ug"), "gimbal_angle": angle, "attitude": angle}
    return observe_static(float(run[1]), np.deg2rad(latitude), noise, candidates=candidates, sample_s=DWELL_S)


def _parameters_of(candidates: Sequence[str], effects: Sequence[str], plan: Recording) -> tuple[Parameter, ...]:
    """Return the linear parameters of candidates that are not calibrated and need no other channel."""
    new = [cls for e in candidates if (cls := known_effect(e)).id not in effects]
    lacking = [cls.id for cls in new if not cls.shows_in(plan.kind) or cls.requires]
    if lacking:
        raise InputError(f"{lacking[0]} cannot be judged from the angles of a {plan.kind} schedule alone; leave it out")
    return tuple(q for cls in new for q in parameters(cls, plan.platform.axis_names))


def assess_information(
    name: str, info: Information, calibrated: Sequence[Parameter], noise: dict[str, float]
) -> Observability:
    """Return the observability of the calibrated parameters, the first of the information, and of candidates."""
    p = len(calibrated)
    rows = info.rows[:, :-1]
    solution = solve(Information(tuple(calibrated), np.column_stack([rows[:, :p], info.rows[:, -1]]), info.count))
    confounded = _confounded_parameters(rows[:, :p], solution)
    seen = orthonormal(rows[:, :p], MIN_SIGNAL_TO_NOISE)
    groups: dict[str, list[int]] = {}
    for i, q in enumerate(info.parameters[p:], start=p):
        groups.setdefault(q.effect, []).append(i)
    residual = {e: rows[:, i] - seen @ (seen.T @ rows[:, i]) for e, i in groups.items()}
    candidates = []
    for e, own in groups.items():
        whole, strength = float(np.linalg.norm(rows[:, own])), float(np.linalg.norm(residual[e]))
        candidates.append(NotCalibrated(e, strength, 1 - strength / whole if whole > 0 else 0.0))
    clear = (c.effect for c in candidates if c.strength > MIN_SIGNAL_TO_NOISE)
    visible = {effect: orthonormal(residual[effect], MIN_SIGNAL_TO_NOISE) for effect in clear}
    for one, other in combinations(visible, 2):
        cosine = float(np.linalg.svd(visible[one].T @ visible[other], compute_uv=False)[-1])
        if cosine > CONFOUNDED_COSINE:
            confounded.append(Confounded(one, other, cosine))
    return Observability(name, solution, tuple(confounded), tuple(candidates), noise)


def _confounded_parameters(rows: Array, solution: Solution) -> list[Confounded]:
    """Return pairs of parameters whose columns are parallel once all others are projected out, from (J^T J)^-1.

    With P = (J^T J)^-1 the cosine of the two is -P_ij / sqrt(P_ii P_jj). The prior's unit weight makes it exist where
    directions are not seen at all. Members of a null direction of three or more are named there and not once more.
    """
    P = np.linalg.inv(rows.T @ rows + np.eye(rows.shape[1]))
    d = np.sqrt(np.diag(P))
    cosine = -P / np.outer(d, d)
    labels = [q.label for q in solution.parameters]
    larger = [set(u.direction) for u in solution.unobservable if len(u.direction) > 2]
    return [
        Confounded(labels[i], labels[j], float(cosine[i, j]))
        for i, j in combinations(range(len(labels)), 2)
        if abs(cosine[i, j]) > CONFOUNDED_COSINE
        and not any({labels[i], labels[j]} <= direction for direction in larger)
    ]
