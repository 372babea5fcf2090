"""Planned recordings of a schedule, and the information that a recording loses by skipping positions."""

from __future__ import annotations

import numpy as np

from gimbalcal.earth import G0
from gimbalcal.effects import with_values
from gimbalcal.estimate.accelerometers.errors_in_variables import Noise, Problem, problem, view_of_positions
from gimbalcal.estimate.fit import information_of
from gimbalcal.inference.information import Solution, solve
from gimbalcal.number import Array, apply_matrix
from gimbalcal.recording import Recording, Site
from gimbalcal.recording.kinds import MULTI_POSITION
from gimbalcal.schedule import SCHEDULES, Schedule

NOTABLE_SIGMA_RATIO = 1.5  # every sigma that grew by more than this is told; else the one that grew most
SAME_DIRECTION_RAD = np.deg2rad(10.0)  # angle between two forces within which they count as one position of a schedule


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


def lost(p: Problem, noise: Noise, solution: Solution) -> str:
    """Return in a sentence what skipped positions of a published schedule would have added."""
    schedule = next((s for s in SCHEDULES.values() if _follows(p, s)), None)
    missing = sorted(set(range(1, len(schedule.holds) + 1)) - {int(q) for q in p.positions}) if schedule else []
    if schedule is None or not missing:
        return ""
    extra = planned(schedule, float(np.median(p.weight))).select(np.array(missing) - 1)
    views = [view_of_positions(q, noise) for q in (p, problem(extra, p.parameters, p.effects))]
    effects = with_values(p.effects, p.parameters, solution.x, p.platform.axis_names)
    full = solve(information_of(views, effects, p.parameters))
    grown = solution.sigma / full.sigma
    worst = [i for i in np.argsort(-grown) if grown[i] > NOTABLE_SIGMA_RATIO] or [int(np.argmax(grown))]
    cost = ", ".join(f"{p.parameters[i].label} by {grown[i]:.2g}" for i in worst)
    names = ", ".join(map(str, missing))
    plural = "s" if len(missing) > 1 else ""
    words = f"position{plural} {names} of schedule {schedule.name} missing: sigma grows most for "
    more = len(solution.unobservable) - len(full.unobservable)
    return words + cost + (f"; {more} further direction{'s' if more > 1 else ''} not seen at all" if more > 0 else "")


def _follows(p: Problem, schedule: Schedule) -> bool:
    """Return whether positions of the recording are those of the schedule under the same numbers."""
    if schedule.platform != p.platform or p.positions.min() < 1 or p.positions.max() > len(schedule.holds):
        return False
    mine = -apply_matrix(p.platform.attitude(_readouts(p)), np.array([0.0, 0.0, 1.0]))
    theirs = -schedule.gravity_directions()[p.positions - 1]
    return bool(np.all((mine * theirs).sum(axis=-1) > np.cos(SAME_DIRECTION_RAD)))


def _readouts(p: Problem) -> Array:
    first = np.flatnonzero(np.diff(p.visit, prepend=-1))
    return np.asarray(p.stimulus.readout[first])
