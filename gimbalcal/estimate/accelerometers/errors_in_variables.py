r"""Least squares on dwells: white noise of the samples, and a setting repeatability of the gimbals at every visit.

.. math:: y_d = h(x, \theta_d + e_d) + n_d, \qquad e_d \sim N(0, \sigma_\theta^2 I), \qquad
          n_d \sim N(0, \sigma_a^2 / n \, I)

The setting errors e_d are unknowns of their own with that prior, and are eliminated visit by visit: with
G_d = dh/de_d = U diag(s) V^T the rows U^T / sqrt(sigma_a^2 / n + sigma_theta^2 s^2) have unit noise, which is the
Schur complement of e_d without squaring anything. sigma_theta = 0 is the fit to exact angles; sigma_theta = infinity
drops the directions that a turn can reach and leaves the norm of the force, so one code covers good angles and poor
ones. Without gimbals it is the view of `views.norm`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gimbalcal.effects import CATALOGUE, Effect, Parameter, Stage, Stimulus, parameters, values, with_values
from gimbalcal.effects.baseline_effects import BASELINE
from gimbalcal.effects.process import Process, SettingError, WhiteNoise
from gimbalcal.effects.sensor_grades import GRADES, Grade
from gimbalcal.estimate.extra_effects import Cost, columns_of_sizes
from gimbalcal.estimate.fit import gauss_newton as iterate
from gimbalcal.estimate.fit import range_of_constants
from gimbalcal.forward import Rows
from gimbalcal.inference.information import Information, Solution, information, prior, solve
from gimbalcal.number import Array, apply_matrix
from gimbalcal.platform import Platform
from gimbalcal.readings import Readings, readings
from gimbalcal.recording import Recording, dwell_means
from gimbalcal.recording.record import FORCE

MIN_SINGULAR_RATIO = 1e-9  # of dh/de, below which a turn does not reach a direction; rounding leaves 1e-16
MAX_STEPS = 30  # Gauss-Newton steps; 1 arcsec takes 3, 3 degrees 5
START_ITERATIONS = 2  # the second leaves 10 arcsec of 6 degrees
SMALL_SETTING_RAD = 1e-3  # rad; below, the square of a setting error is less than 1 ug
ROUNDING = 1e-15  # of what is read: smaller steps are the rounding of numbers without noise
MAX_PRIOR_SIGMAS = 1e3  # beyond them the linearisation means nothing: 0.5 g of bias, 50 % of scale, 33 deg


@dataclass(frozen=True)
class Noise:
    """One sigma of a raw accelerometer sample [m/s^2] and of a gimbal setting [rad], and where each is from."""

    accelerometer: float
    setting: float
    accelerometer_from: str = "header"
    setting_from: str = "header"

    @property
    def of_samples(self) -> Process:
        """Process of every accelerometer, sample by sample."""
        return WhiteNoise(self.accelerometer)

    @property
    def of_settings(self) -> Process:
        """Process of every gimbal, or of every turn of a unit without gimbals, visit by visit."""
        return SettingError(self.setting)


@dataclass(frozen=True, eq=False)
class Problem:
    """A least-squares problem: readings (n, 3), `weight` (n,) raw samples each, `visit` (n,) = 0 ... m-1 of a row."""

    readings: Readings
    weight: Array
    visit: Array
    positions: Array  # (m,) name of the position of each visit
    effects: tuple[Effect, ...]
    parameters: tuple[Parameter, ...]

    @property
    def platform(self) -> Platform:
        """The gimbal chain."""
        return self.readings.recording.platform

    @property
    def grade(self) -> Grade:
        """The grade of the unit, which sets the usual sizes of its imperfections."""
        return self.readings.recording.grade

    @property
    def stimulus(self) -> Stimulus:
        """The stimulus of the hardware as far as the readouts determine it."""
        return self.readings.stimulus

    @property
    def force(self) -> Array:
        """Specific force read (n, 3) [m/s^2]."""
        return self.readings.value

    @property
    def visits(self) -> int:
        """Number of visits m."""
        return len(self.positions)

    @property
    def turns(self) -> int:
        """Number k of setting errors of a visit: one per gimbal."""
        return len(self.platform.axes)

    def without(self, visits: Sequence[int]) -> Problem:
        """The problem with some visits left out."""
        keep = ~np.isin(np.arange(self.visits), visits)
        rows = keep[self.visit]
        return replace(
            self,
            readings=self.readings.select(rows),
            weight=self.weight[rows],
            visit=(np.cumsum(keep) - 1)[self.visit[rows]],
            positions=self.positions[keep],
        )


def position_parameters(
    platform: Platform, effects: Sequence[str] = BASELINE["multi-position"], grade: Grade = GRADES["navigation"]
) -> tuple[Parameter, ...]:
    """Parameters of the named effects as large as they are in a unit of this grade.

    A gimbal next to a level base that turns about the vertical is left out.
    """
    wanted = [grade.usual(p) for name in effects for p in parameters(CATALOGUE[name], platform.axis_names)]
    vertical = [a.name for a in platform.axes[-1:] if a.direction == "z"]
    return tuple(p for p in wanted if not (p.effect == "gimbal_zero" and p.axis in vertical))


def problem(
    recording: Recording,
    wanted: Sequence[Parameter] | None = None,
    effects: Sequence[Effect] = (),
    averaged: bool = True,
) -> Problem:
    """The fit of a recording: of one mean per dwell, or of every row where what happens inside a dwell matters."""
    rows = dwell_means(recording) if averaged else recording
    if not averaged and recording.position is not None:
        rows = recording.select(recording.position > 0)
    rows.triad(FORCE)  # all three axes, or InputError
    read = readings(rows)
    visit = read.stimulus.visit
    return Problem(
        readings=read,
        weight=np.asarray(rows.weight, dtype=float),
        visit=visit,
        positions=np.asarray(read.stimulus.position)[np.flatnonzero(np.diff(visit, prepend=-1))],
        effects=tuple(effects),
        parameters=tuple(wanted if wanted is not None else position_parameters(rows.platform, grade=rows.grade)),
    )


def model(p: Problem, x: Array, e: Array) -> Array:
    """Readings (n, 3) [m/s^2] that parameters x (p,) and setting errors e (m, k) predict."""
    return set_off(p, e).predicted(_effects(p, x))


def _effects(p: Problem, x: Array) -> tuple[Effect, ...]:
    return with_values(p.effects, p.parameters, x, p.platform.axis_names)


def set_off(p: Problem, e: Array) -> Readings:
    """The readings when the gimbals stand off their readouts by e (m, k) [rad]."""
    s = p.stimulus
    angle = s.readout + e[p.visit]
    return replace(p.readings, stimulus=s.at(readout=angle, angle=angle))


@dataclass(frozen=True, eq=False)
class VisitRows:
    """The problem linearised at (x, e), by visit: y - h + G e + J x = r; inside each dwell the deviations from it."""

    J: Array  # (m, 3, p)
    r: Array  # (m, 3)
    G: Array  # (m, 3, k)
    weight: Array  # (m,)
    J_inside: Array  # (n, 3, p) times sqrt(weight), empty for means
    r_inside: Array  # (n, 3)


def by_visit(p: Problem, x: Array, e: Array) -> VisitRows:
    """Exact derivatives at parameters x and setting errors e, by visit."""
    _, *parts = _linear(p, x, e, p.parameters)
    return visit_rows(p, *parts)


def _linear(p: Problem, x: Array, e: Array, wanted: Sequence[Parameter]) -> tuple[Rows, Array, Array, Array]:
    """Rows about (x, e) with the stages of wanted parameters, J (n, 3, p), y - h + J x + G e (n, 3), and G (n, 3, k).

    G is the derivative by the setting errors of the row's own visit.
    """
    stages = dict.fromkeys((*(CATALOGUE[q.effect].stage for q in wanted), Stage.ENCODER))
    rows = set_off(p, e).rows(_effects(p, x), stages)
    J, G = rows.jacobian(p.parameters), rows.sensitivity[Stage.ENCODER]
    return rows, J, rows.residual + J @ x + apply_matrix(G, e[p.visit]), G


def visit_rows(p: Problem, J: Array, r: Array, G: Array) -> VisitRows:
    """Rows (n, 3) with their derivatives as means of each visit, and what is left inside it."""
    if len(p.force) == p.visits:
        return VisitRows(J, r, G, p.weight, J[:0], r[:0])
    weight = np.bincount(p.visit, p.weight)
    J_mean, r_mean, G_mean = (visit_means(p, a) for a in (J, r, G))
    root = np.sqrt(p.weight)
    inside = (root[:, None, None] * (J - J_mean[p.visit]), root[:, None] * (r - r_mean[p.visit]))
    return VisitRows(J_mean, r_mean, G_mean, weight, *inside)


def aim(p: Problem, x: Array, noise: Noise) -> Array:
    """Setting errors (m, k) that x alone would call for, so that poor angles do not throw the first step off."""
    e = np.zeros((p.visits, p.turns))
    for _ in range(START_ITERATIONS if noise.setting > SMALL_SETTING_RAD else 0):
        rows = set_off(p, e).rows(_effects(p, x), [Stage.ENCODER])
        G = rows.sensitivity[Stage.ENCODER]
        r = visit_means(p, rows.residual + apply_matrix(G, e[p.visit]))
        G, weight = visit_means(p, G), np.bincount(p.visit, p.weight)
        e = apply_matrix(whiten(VisitRows(G[..., :0], r, G, weight, G[:0, :, :0], r[:0]), noise).gain, r)
    return e


def visit_means(p: Problem, a: Array) -> Array:
    """Weighted means over the rows of each visit: (n, ...) to (m, ...)."""
    total = np.zeros((p.visits, *a.shape[1:]))
    np.add.at(total, p.visit, a * p.weight.reshape(-1, *[1] * (a.ndim - 1)))
    return np.asarray(total / np.bincount(p.visit, p.weight).reshape(-1, *[1] * (a.ndim - 1)))


@dataclass(frozen=True, eq=False)
class Whitened:
    """Rows of unit noise by visit, and what turns a misfit into setting errors."""

    W: Array  # (m, 3, 3)
    J: Array  # (m, 3, p) = W J
    r: Array  # (m, 3) = W r
    reached: Array  # (m, 3) whether a turn reaches the direction of the row
    gain: Array  # (m, k, 3): e = gain (r - J x) of the linear problem
    sigma: Array  # (m, 3) of the rows before whitening; inf where a free turn takes them away
    J_inside: Array  # (n, 3, p)
    r_inside: Array  # (n, 3)

    def information(self, wanted: Sequence[Parameter]) -> Information:
        """All rows as information. Deviations inside a dwell of n rows hold n - 1 independent ones."""
        P = len(wanted)
        J = np.concatenate([self.J.reshape(-1, P), self.J_inside.reshape(-1, P)])
        r = np.concatenate([self.r.ravel(), self.r_inside.ravel()])
        free = self.r_inside.size - (3 * len(self.r) if self.r_inside.size else 0)
        return replace(information(J, r, wanted), count=int(np.isfinite(self.sigma).sum()) + free)


def whiten(linear: VisitRows, noise: Noise) -> Whitened:
    """Scale to unit noise with the setting errors eliminated (module docstring)."""
    U, s, Vt = np.linalg.svd(linear.G, full_matrices=True)
    k = s.shape[-1]
    s = np.where(s > MIN_SINGULAR_RATIO * max(s.max(initial=0.0), 1e-300), s, 0.0)
    (sample,), (setting,) = noise.of_samples.initial(), noise.of_settings.initial()
    white = (sample / linear.weight)[:, None]
    # 0 * inf: a direction that no turn reaches keeps the white noise alone
    spread = np.where(s > 0, setting * np.where(s > 0, s, 1.0) ** 2, 0.0)
    variance = np.concatenate([white + spread, np.broadcast_to(white, (len(s), 3 - k))], axis=1)
    W = np.swapaxes(U, -1, -2) / np.sqrt(variance)[..., None]
    divisor = np.where(s > 0, s, 1.0)
    share = np.where(s > 0, 1 / (divisor + white / (setting or 1e-300) / divisor), 0.0)
    reached = np.concatenate([s > 0, np.zeros((len(s), 3 - k), dtype=bool)], axis=1)
    gain = np.swapaxes(Vt[:, :k], -1, -2) @ (share[..., None] * np.swapaxes(U, -1, -2)[:, :k])
    return Whitened(
        W, W @ linear.J, apply_matrix(W, linear.r), reached, gain, np.sqrt(variance),
        linear.J_inside / np.sqrt(sample), linear.r_inside / np.sqrt(sample),
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class PositionFit:
    """A converged fit: its solution, the setting errors (m, k) [rad] and the last linearisation."""

    solution: Solution
    setting: Array
    linear: VisitRows
    whitened: Whitened
    noise: Noise
    steps: int  # 0 where it did not converge


def gauss_newton(p: Problem, noise: Noise, start: Array | None = None) -> PositionFit:
    """Fit parameters and setting errors until a step is below 1e-3 of the noise; give up where it runs away."""
    mean, scale = prior(p.parameters)
    far, least = MAX_PRIOR_SIGMAS * scale, ROUNDING * p.stimulus.gravity
    x = start if start is not None and np.all(np.abs(start - mean) <= far) else mean
    e = aim(p, x, noise)
    linear: VisitRows | None = None
    w: Whitened

    def recovered(x: Array) -> Array:
        return e if linear is None else apply_matrix(w.gain, linear.r - linear.J @ x)

    def linearise(x: Array) -> Information:
        nonlocal e, linear, w
        e = recovered(x)
        linear = by_visit(p, x, e)
        w = whiten(linear, noise)
        return w.information(p.parameters)

    def arrived(x: Array, target: Array, solution: Solution) -> bool:
        assert linear is not None
        moved = np.abs(apply_matrix(linear.G, recovered(target) - e))
        quiet = noise.accelerometer / np.sqrt(linear.weight)[:, None]
        close = np.abs(target - x) <= 1e-3 * solution.sigma + ROUNDING * far
        return bool(np.all(close) and np.all(moved <= 1e-2 * quiet + least))

    def diverged(x: Array) -> bool:
        return not np.all(np.abs(x - mean) <= far)  # nor where it is no number any more

    bounds = range_of_constants(p.parameters, p.stimulus)
    found = iterate(linearise, x, bounds, limit=MAX_STEPS, arrived=arrived, diverged=diverged)
    assert linear is not None
    return PositionFit(found.solution, recovered(found.solution.x), linear, w, noise, found.steps)


def misfit_with_sizes(p: Problem, x: Array, e: Array, noise: Noise, sizes: Sequence[Parameter]) -> Cost:
    """Chi^2 of the rows about a fit (x, e) with the sizes of absent effects free beside its parameters."""
    wanted = (*p.parameters, *sizes)
    rows, J, r, G = _linear(p, x, e, wanted)

    def misfit(effects: Sequence[Effect]) -> float:
        every = np.concatenate([J, columns_of_sizes(rows, effects, sizes)], axis=-1)
        return solve(whiten(visit_rows(p, every, r, G), noise).information(wanted)).chi2

    return misfit


def starting_values(p: Problem, effects: Sequence[Effect]) -> Array:
    """Values (p,) of the problem's parameters in `effects`, the prior mean where absent."""
    return np.asarray(values(effects, p.parameters), dtype=float)
