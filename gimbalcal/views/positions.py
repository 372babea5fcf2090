r"""Dwells at the angles of gimbals: white noise of the samples, and a setting repeatability at every visit.

.. math:: y_d = h(x, \theta_d + e_d) + n_d, \qquad e_d \sim N(0, \sigma_\theta^2 I), \qquad
          n_d \sim N(0, \sigma_a^2 / n \, I)

The setting errors e_d are unknowns of their own with that prior, and are eliminated visit by visit: they are `Local`
parameters of the view. sigma_theta = 0 is the fit to exact angles; sigma_theta = infinity drops the directions that a
turn can reach and leaves the norm of the force, so one code covers good angles and poor ones. Without gimbals it is the
view of `views.norm`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gimbalcal.earth import G0
from gimbalcal.effects import CATALOGUE, Effect, Parameter, Stage, Stimulus, parameters, values, with_values
from gimbalcal.effects.baseline_effects import BASELINE
from gimbalcal.effects.sensor_grades import GRADES, Grade
from gimbalcal.number import Array, apply_matrix
from gimbalcal.platform import Platform
from gimbalcal.readings import Readings, readings
from gimbalcal.recording import Recording, Site, dwell_means
from gimbalcal.recording.kinds import MULTI_POSITION
from gimbalcal.recording.record import FORCE
from gimbalcal.schedule import Schedule
from gimbalcal.views.core import View
from gimbalcal.views.known_attitude import view_of_readings
from gimbalcal.views.local import Local, VisitRows, Whitened, eliminate, group_means, visit_rows
from gimbalcal.views.noise import NoiseModel


@dataclass(frozen=True)
class Noise:
    """One sigma of a raw accelerometer sample [m/s^2] and of a gimbal setting [rad], and where each is from."""

    accelerometer: float
    setting: float
    accelerometer_from: str = "header"
    setting_from: str = "header"


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


def by_visit(p: Problem, x: Array, e: Array) -> VisitRows:
    """Exact derivatives at parameters x and setting errors e, by visit."""
    stages = dict.fromkeys((*(CATALOGUE[q.effect].stage for q in p.parameters), Stage.ENCODER))
    rows = set_off(p, e).rows(_effects(p, x), stages)
    J, G = rows.jacobian(p.parameters), rows.sensitivity[Stage.ENCODER]
    return visit_rows(J, rows.residual + J @ x + apply_matrix(G, e[p.visit]), G, p.visit, p.weight)


def visit_means(p: Problem, a: Array) -> Array:
    """Weighted means over the rows of each visit: (n, ...) to (m, ...)."""
    return group_means(a, p.visit, p.weight)


def whiten(linear: VisitRows, noise: Noise) -> Whitened:
    """Scale to unit noise with the setting errors eliminated, see `views.local`."""
    return eliminate(linear, noise.accelerometer**2, noise.setting**2)


def view_of_positions(p: Problem, noise: Noise) -> View:
    """Return the view of the readings, with the setting error of each visit as local parameters."""
    stages = dict.fromkeys((*(CATALOGUE[q.effect].stage for q in p.parameters), Stage.ENCODER))
    sigma = noise.accelerometer / np.sqrt(p.weight)[:, None]

    def about(e: Array) -> View:
        view = view_of_readings(set_off(p, e), NoiseModel(sigma, scale_known=True), stages=stages)
        ids = (*(e.id for e in p.effects), *(q.effect for q in p.parameters))
        local = Local(p.visit, noise.setting, lambda rows: rows.sensitivity[Stage.ENCODER], about)
        return replace(view, local=local, acting=frozenset(ids))

    return about(np.zeros((p.visits, p.turns)))


def starting_values(p: Problem, effects: Sequence[Effect]) -> Array:
    """Values (p,) of the problem's parameters in `effects`, the prior mean where absent."""
    return np.asarray(values(effects, p.parameters), dtype=float)


def planned(schedule: Schedule, samples: float = 1.0, site: Site | None = None) -> Recording:
    """A perfect recording of a schedule, one row per hold, `samples` raw samples behind each."""
    site = site or Site(gravity=G0)
    angles, m = schedule.angles, len(schedule.holds)
    force = -site.gravity * schedule.gravity_directions()
    channels = {("specific_force", axis): force[:, i] for i, axis in enumerate("xyz")}
    channels |= {("gimbal_angle", name): angles[:, i] for i, name in enumerate(schedule.platform.axis_names)}
    time = np.cumsum([0.0, *(h.duration for h in schedule.holds)])[:-1]
    return Recording(
        kind=MULTI_POSITION, title=schedule.name, platform=schedule.platform, site=site, noise={}, time=time,
        position=np.arange(1, m + 1), channels=channels, weight=np.full(m, samples),
    )  # fmt: skip
