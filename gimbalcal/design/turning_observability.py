r"""Observability of a schedule of turns: sigma of every state against time, degree of observability, weak directions.

The degree of observability (Wei et al. 2022, Eqs. (23), (24), after Yan et al. 2018) is how many times better a state
is known than before the calibration,

.. math:: \sigma_k^j = \sqrt{P_0^{jj} / P_k^{jj}} ,

unobservable up to 1, low up to 2, moderate up to 10, high beyond. It is in proportion to the sigma that one starts
with, here the prior of the catalogue; sigmas themselves are not, and are the bounds that no unbiased estimate beats.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gimbalcal.design.position_observability import Observability, assess_information
from gimbalcal.design.turning import turning_experiment
from gimbalcal.display import Displayed, data_frame, panels
from gimbalcal.effects import Parameter
from gimbalcal.entries import Entry, Json, plain_json
from gimbalcal.errors import InputError
from gimbalcal.estimate.systematic.error_model import STATE_SCALE
from gimbalcal.inference.information import MIN_SIGNAL_TO_NOISE, information, name_directions
from gimbalcal.inference.innovations import Innovations
from gimbalcal.number import Array
from gimbalcal.schedule import RotationSchedule
from gimbalcal.schedule.file import read_rotation
from gimbalcal.schedule.trajectory import trajectory
from gimbalcal.units import from_si

if TYPE_CHECKING:
    from matplotlib.figure import Figure

HIGH_DEGREE = 10.0  # Wei et al. (2022): times better known than before
DEGREES = ((1.0, "unobservable"), (2.0, "low"), (HIGH_DEGREE, "moderate"), (np.inf, "high"))
DEGREE_ROUNDING = 1e-6
MAX_WEAK_DIRECTIONS = 3
MIN_TERM = 0.1  # of the largest term of a direction
MAX_CURVE_POINTS = 240
STATE_UNITS = {"attitude": "arcsec", "velocity": "m/s", "place": "m"}
NAVIGATION = tuple((f"{what}:{a}", unit) for what, unit in STATE_UNITS.items() for a in ("north", "east", "down"))
TABLE_2: Mapping[str, tuple[float, float]] = {  # Wei et al. (2022): degree with 18 and with 30 positions
    "gyro_bias:x": (22.37, 79.94), "gyro_bias:y": (23.08, 69.69), "gyro_bias:z": (25.05, 75.55),
    "bias:x": (181.52, 251.99), "bias:y": (197.31, 263.65), "bias:z": (170.47, 247.22),
    "gyro_scale_factor:x": (31.99, 80.49), "gyro_scale_factor:y": (65.02, 95.85),
    "gyro_scale_factor:z": (103.45, 186.40), "scale_factor:x": (64.07, 154.33), "scale_factor:y": (163.65, 318.26),
    "scale_factor:z": (103.46, 225.95), "gyro_misalignment:yz": (111.99, 100.50),
    "gyro_misalignment:zy": (158.46, 155.51), "gyro_misalignment:zx": (165.26, 282.83),
    "misalignment:yz": (274.16, 332.01), "misalignment:zy": (229.89, 261.05), "misalignment:xz": (452.96, 633.62),
    "misalignment:zx": (54.74, 102.71), "misalignment:xy": (174.74, 244.61), "misalignment:yx": (22.37, 79.94),
}  # fmt: skip
MISPRINTED = "misalignment:yx"  # its row repeats that of the first gyroscope's bias, in both columns


@dataclass(frozen=True, eq=False)
class SigmaCurve:
    """Sigma (T,) in SI of one state against time, and the prior sigma that it starts from."""

    parameter: str
    unit: str
    prior: float
    sigma: Array

    @property
    def degree(self) -> float:
        """Degree of observability at the end, sqrt(P_0 / P_k)."""
        return float(self.prior / self.sigma[-1])

    @property
    def printed(self) -> Array:
        """Sigma (T,) in the unit of print."""
        return np.asarray(from_si(self.sigma, self.unit))

    @property
    def word(self) -> str:
        """Wei's word for the degree."""
        return next(word for most, word in DEGREES if self.degree <= most * (1 + DEGREE_ROUNDING))


@dataclass(frozen=True)
class PublishedDegree(Entry):
    """A degree of observability as printed, as computed, and their ratio."""

    parameter: str
    printed: float
    degree: float
    ratio: float


@dataclass(frozen=True)
class PublishedDegrees(Entry):
    """A printed table of degrees against the computed ones: the factor of each group, and the spread about it."""

    source: str
    table: str
    rows: tuple[PublishedDegree, ...]
    factor: Mapping[str, float]
    spread: Mapping[str, float]
    in_words: str


@dataclass(frozen=True, eq=False, repr=False)
class TurningObservability(Displayed):
    """Observability of a schedule of turns: curves of every state at `time` (T,) [s], and weak directions."""

    bounds: Observability
    source: str
    time: Array
    curves: tuple[SigmaCurve, ...]
    navigation: tuple[SigmaCurve, ...]
    weak: tuple[tuple[dict[str, float], float], ...]

    def __str__(self) -> str:
        """Return the bound of each parameter and the answer, as the console has them."""
        from gimbalcal.words.answers import turning_answer
        from gimbalcal.words.tables import bounds_table

        return f"{bounds_table(self.bounds)}\n\n{turning_answer(self)}"

    def to_frame(self, kind: str = "polars") -> Any:
        """Return sigma over time: time_s, and a column for each state in its unit of print; "polars" or "pandas"."""
        return data_frame({"time_s": self.time, **{c.parameter: c.printed for c in self.curves}}, kind)

    def plot(self) -> Figure:
        """Return a matplotlib figure of the sigma of every state over time, a panel for each effect."""
        groups: dict[tuple[str, str], list[SigmaCurve]] = {}
        for c in self.curves:
            groups.setdefault((c.parameter.partition(":")[0], c.unit), []).append(c)
        figure, axes = panels([f"{name.replace('_', ' ')} [{unit}]" for name, unit in groups])
        for ax, own in zip(axes, groups.values(), strict=True):
            for c in own:
                ax.plot(self.time / 60, c.printed, lw=1, label=c.parameter.partition(":")[2])
            ax.set_yscale("log")
            ax.set_xlabel("time [min]", fontsize=8)
            ax.legend(fontsize=7, ncols=3)
        return figure

    @property
    def published(self) -> PublishedDegrees | None:
        """Comparison with Table 2 of Wei et al. for their schedule with their states; else None."""
        labels = {c.parameter for c in self.curves}
        return comparison_with_wei(self.curves) if self.source == "wei2022" and labels == set(TABLE_2) else None

    @property
    def in_words(self) -> str:
        """The answer in one paragraph."""
        states = {word: [c.parameter for c in self.curves if c.word == word] for _, word in DEGREES}
        counts = ", ".join(f"{word} for {len(names)}" for word, names in states.items() if names)
        lines = [self.bounds.in_words, f"degree of observability after {self.time[-1]:.0f} s: {counts} states"]
        lines += [f"{word}: {', '.join(states[word])}" for word in ("unobservable", "low", "moderate") if states[word]]
        for direction, degree in self.weak:
            terms = " ".join(f"{w:+.3g} {label}" for label, w in direction.items())
            lines.append(f"weak: {terms} is known {degree:.3g} times better than before")
        return "\n".join([*lines, *([self.published.in_words] if self.published else [])])

    def to_dict(self) -> Json:
        """Return the content of observability.json, in printed units."""
        out = self.bounds.to_dict()
        time = [float(t) for t in self.time]
        out["states"] = [
            {
                "parameter": c.parameter,
                "unit": c.unit,
                "sigma": c.printed.tolist(),
                "time_s": time,
                "degree": c.degree,
                "observability": c.word,
            }
            for c in (*self.curves, *self.navigation)
        ]
        out["weak"] = [{"direction": direction, "degree": degree} for direction, degree in self.weak]
        return out | {"published": plain_json(self.published) or {}, "in_words": self.in_words}


def observe_turning(
    schedule: RotationSchedule | str | Path,
    latitude: float,
    state_list: str = "51",
    rate_noise: float = 0.002,
    force_noise: float = 5.0,
    velocity: float = 1e-5,
) -> TurningObservability:
    """Return the observability of any states (`--states`) by a schedule of turns at `latitude` [deg].

    rate_noise [deg/sqrt(h)], force_noise [ug/sqrt(Hz)], velocity [m/s]: one sigma of that of the place. Raises
    InputError for schedules and states that do not exist.
    """
    turns = schedule if isinstance(schedule, RotationSchedule) else read_rotation(schedule)
    experiment = turning_experiment(latitude, state_list, rate_noise, force_noise, velocity)
    noise = {
        "gyroscope_deg_per_sqrt_h": rate_noise,
        "accelerometer_ug_per_sqrt_Hz": force_noise,
        "velocity_m_per_s": velocity,
    }
    wanted, model = experiment.wanted, experiment.stretches(trajectory(turns))
    innovations = model.innovations(experiment.noise)
    prior = np.array([p.sigma for p in wanted])
    rows = innovations.rows.reshape(-1, len(wanted))
    info = information(rows / prior, np.zeros(len(rows)), wanted)
    keep = np.unique(np.linspace(0, len(model.time) - 1, min(MAX_CURVE_POINTS, len(model.time))).round().astype(int))
    with np.errstate(invalid="ignore", over="ignore"):
        sigma, navigation = _sigmas_over_time(innovations, keep)
    if not (np.isfinite(sigma).all() and np.isfinite(navigation).all()):
        raise InputError(
            "these noises are too large, too small or too different to be computed with: "
            + ", ".join(f"{name} {value:g}" for name, value in noise.items())
        )
    curves = tuple(SigmaCurve(p.label, p.unit, p.sigma, p.sigma * s) for p, s in zip(wanted, sigma.T, strict=True))
    start = np.sqrt(np.diag(innovations.P[0])) * STATE_SCALE
    states = tuple(
        SigmaCurve(label, unit, float(start[i]), STATE_SCALE[i] * navigation[:, i])
        for i, (label, unit) in enumerate(NAVIGATION)
    )
    assessed, weak = (
        assess_information(turns.name, info, wanted, noise),
        _weakest_directions(info.rows[:, : len(wanted)], wanted),
    )
    return TurningObservability(assessed, turns.source, model.time[keep], curves, states, weak)


def _weakest_directions(R: Array, wanted: Sequence[Parameter]) -> tuple[tuple[dict[str, float], float], ...]:
    """Return the weakest observable directions, and how many times better known than before they are."""
    _, S, Vt = np.linalg.svd(R, full_matrices=True)
    S = np.concatenate([S, np.zeros(len(wanted) - len(S))])
    weak = np.flatnonzero((S >= MIN_SIGNAL_TO_NOISE) & (S < HIGH_DEGREE))[-MAX_WEAK_DIRECTIONS:]
    named = [name_directions(Vt[[i]].T, wanted, R)[0].direction for i in weak]
    return tuple(
        ({label: w for label, w in d.items() if abs(w) >= MIN_TERM}, float(S[i]))
        for d, i in zip(named, weak, strict=True)
    )


def _sigmas_over_time(innovations: Innovations, keep: Array) -> tuple[Array, Array]:
    """Return the sigmas (T, p) in prior sigmas, and (T, m) of navigation states, after the stretches `keep` (T,)."""
    p = innovations.rows.shape[2]
    F, done, sigma, navigation = np.eye(p), 0, [], []
    for k in keep:
        rows = innovations.rows[done : k + 1].reshape(-1, p)
        F, done = F + rows.T @ rows, int(k) + 1
        P, D = np.linalg.inv(F), innovations.D[k + 1]
        sigma.append(np.sqrt(np.diag(P)))
        navigation.append(np.sqrt(np.diag(innovations.P[k + 1] + D @ P @ D.T)))
    return np.array(sigma), np.array(navigation)


def comparison_with_wei(curves: Sequence[SigmaCurve]) -> PublishedDegrees:
    """Compare with Table 2 of Wei et al. (2022), 30 positions.

    A degree is proportional to the assumed P_0, and the paper prints neither P_0 nor noise, rate or stops: each group
    of three or six states has one free factor. The spread about it is reported.
    """
    rows, groups = [], dict[str, list[float]]()
    for c in curves:
        printed = TABLE_2[c.parameter][1]
        rows.append(PublishedDegree(c.parameter, printed, c.degree, printed / c.degree))
        if c.parameter != MISPRINTED:
            groups.setdefault(c.parameter.split(":")[0], []).append(np.log(printed / c.degree))
    factor = {name: float(np.exp(np.mean(x))) for name, x in groups.items()}
    spread = {name: float(np.exp(np.std(x))) for name, x in groups.items()}
    factors = ", ".join(
        f"{name.replace('_', ' ')} {factor[name]:.2g} (give or take a factor of {spread[name]:.2f})" for name in groups
    )
    words = (
        "What Wei et al. (2022), Table 2, print for 30 positions is these degrees times a factor of each group, its "
        f"own P0 and noise, which are not printed: {factors}; the row of delta A_a yz repeats that of epsilon_x and is "
        "a misprint"
    )
    return PublishedDegrees("wei2022", "Table 2", tuple(rows), factor, spread, words)
