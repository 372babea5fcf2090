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
from gimbalcal.effects import Effect, Parameter, known_effect, parameters, with_values
from gimbalcal.effects.baseline_effects import BASELINE
from gimbalcal.effects.sensor_grades import GRADES, Grade
from gimbalcal.number import Array
from gimbalcal.platform import Platform
from gimbalcal.recording import Recording, Site, dwell_means
from gimbalcal.recording.kinds import MULTI_POSITION
from gimbalcal.recording.record import FORCE
from gimbalcal.schedule import Schedule
from gimbalcal.views.core import View
from gimbalcal.views.known_attitude import readings, view_of_readings
from gimbalcal.views.local import VisitRows, group_means
from gimbalcal.views.noise import NoiseModel


@dataclass(frozen=True)
class Noise:
    """One sigma of a raw accelerometer sample [m/s^2] and of a gimbal setting [rad], and where each is from."""

    accelerometer: float
    setting: float
    accelerometer_from: str = "header"
    setting_from: str = "header"


def position_parameters(
    platform: Platform, effects: Sequence[str] = BASELINE["multi-position"], grade: Grade = GRADES["navigation"]
) -> tuple[Parameter, ...]:
    """Parameters of the named effects as large as they are in a unit of this grade.

    A gimbal next to a level base that turns about the vertical is left out.
    """
    wanted = [grade.usual(p) for name in effects for p in parameters(known_effect(name), platform.axis_names)]
    vertical = [a.name for a in platform.axes[-1:] if a.direction == "z"]
    return tuple(p for p in wanted if not (p.effect == "gimbal_zero" and p.axis in vertical))


def view_of_positions(
    recording: Recording, noise: Noise, effects: Sequence[str] = BASELINE["multi-position"], averaged: bool = True
) -> View:
    """Return the view of positions in which these effects act; the setting errors of a visit are its local parameters.

    Rows are the means of dwells; not `averaged`, every row at rest, where what happens inside a dwell matters.
    """
    rows = dwell_means(recording) if averaged else recording
    if not averaged and recording.position is not None:
        rows = recording.select(recording.position > 0)
    rows.triad(FORCE)  # all three axes, or InputError
    read = readings(rows)
    view = view_of_readings(read, _noise_model(noise, rows), setting=noise.setting)
    return replace(view, acting=frozenset(effects))


def in_noise(view: View, noise: Noise) -> View:
    """Return a view of positions in another noise."""
    return replace(view, noise=_noise_model(noise, view.source), local=replace(view.visits, sigma=noise.setting))


def _noise_model(noise: Noise, rows: Recording) -> NoiseModel:
    return NoiseModel(noise.accelerometer / np.sqrt(np.asarray(rows.weight, dtype=float))[:, None], scale_known=True)


def without_visits(view: View, visits: Sequence[int]) -> View:
    """Return a view of positions without some visits; what effects follow from visit to visit stays as it was."""
    keep = ~np.isin(view.visits.group, visits)
    read = replace(readings(view.source.select(keep)), stimulus=view.stimulus.select(keep))
    noise = replace(view.noise, sigma=np.asarray(view.noise.sigma)[keep])
    few = view_of_readings(read, noise, setting=view.visits.sigma)
    return replace(few, acting=view.acting)


def numbers_of_visits(view: View) -> Array:
    """Return the number (m,) of the position of each visit."""
    return np.asarray(view.label)[view.visits.first]


def by_visit(
    view: View, effects: Sequence[Effect], wanted: Sequence[Parameter], x: Array, e: Array | None = None
) -> VisitRows:
    """Return the rows y - h + G e + J x about parameters x (p,) and setting errors e (m, k; none: zero), by visit."""
    e = view.visits.zero_values if e is None else e
    rows = view.visits.evaluate(with_values(effects, wanted, x, view.stimulus.axis_names), e)
    linear = view.visits.by_group(view, rows, rows.jacobian(wanted), e)
    return replace(linear, r=linear.r + linear.J @ x, r_inside=linear.r_inside + linear.J_inside @ x)


def force_of_visits(view: View) -> Array:
    """Return the mean specific force (m, 3) [m/s^2] read at each visit."""
    return group_means(view.source.triad(FORCE), view.visits.group, view.source.weight)


def planned_recording(schedule: Schedule, samples: float = 1.0, site: Site | None = None) -> Recording:
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
