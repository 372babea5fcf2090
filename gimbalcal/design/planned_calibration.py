r"""Information of a planned calibration, with each manoeuvre that could be added, and the base that navigates with it.

Positions and static runs of a platform add rows of the forward model. The velocity of a unit that is turned in its
place is known to be zero, so that errors which grow along the turns (`turning`, after Cai et al. 2016, Eq. (17)) become
information about its sensors; several sessions add up, each with an attitude of its own. A scenario without turns says
where and how the unit stands when it navigates, else it stands as its turns begin.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gimbalcal.design.position_observability import STATIC_SENSORS, information_at_rest, information_in_positions
from gimbalcal.design.turning import TurningExperiment, TurningNoise, rotation_at_place
from gimbalcal.earth import normal_gravity
from gimbalcal.effects import CATALOGUE, Parameter, parameters
from gimbalcal.effects.baseline_effects import BASELINE
from gimbalcal.errors import InputError
from gimbalcal.estimate.systematic.state_lists import LISTS, states
from gimbalcal.inference.information import Information
from gimbalcal.kinematics import required_latitude
from gimbalcal.navigate.space_stable_navigator import UNDAMPED
from gimbalcal.navigate.stationary_base import ideal_static_run, still_base, still_unit
from gimbalcal.platform import SPACE_STABLE
from gimbalcal.recording import Recording, Site
from gimbalcal.recording.record import COLOURED
from gimbalcal.schedule import ROTATIONS, Hold, RotationSchedule, Schedule
from gimbalcal.schedule.commands import standing_attitude
from gimbalcal.schedule.trajectory import trajectory
from gimbalcal.simulate import Scenario
from gimbalcal.simulate.timetable import planned_schedule as position_schedule
from gimbalcal.simulate.turned import schedule_of as turning_schedule
from gimbalcal.views.positions import Noise, planned_recording, position_parameters
from gimbalcal.views.segments import DEFAULT_VELOCITY_SIGMA_M_S

EXTRA_DWELL_S, EXTRA_RUN_S = 600.0, 86400.0  # manoeuvres: ten more minutes in a position, or a day at rest
Plans = Sequence[tuple[str, Scenario]]  # names and scenarios


@dataclass(frozen=True)
class PlannedManoeuvre:
    """Something that could be added to a calibration, what it takes [h], and the information with it."""

    what: str
    hours: float
    information: Information


@dataclass(frozen=True)
class PlannedCalibration:
    """Information of a calibration, with each of several manoeuvres, and a perfect recording that is navigated."""

    information: Information
    manoeuvres: tuple[PlannedManoeuvre, ...]
    base: Recording


def planned_calibration(plans: Plans, state_list: str, more: Sequence[str], hours: float) -> PlannedCalibration:
    """Return the information of scenarios of one kind; the base is at rest for `hours` after its alignment.

    state_list: the states of turns; more: effects that the calibration estimates too. Raises InputError for scenarios
    of another kind or platform, or without noise or latitude, and for effects that they do not show.
    """
    if any(s.recording_kind.rotating for _, s in plans):
        return _by_turns(plans, state_list or "51", more, hours)
    if state_list:
        raise InputError(f"--states {state_list}: of turns only; what a platform's calibration holds besides is --with")
    return _by_positions(plans, more, hours)


def _by_positions(plans: Plans, more: Sequence[str], hours: float) -> PlannedCalibration:
    """Return the information of positions and static runs of a platform.

    Manoeuvres are ten more minutes in one position of a schedule, or a day at rest; where no static run is planned, its
    samples and readouts are assumed as good as those of the positions.
    """
    extra = _extra_parameters(more)
    for name, scenario in plans:
        _refuse_platform(name, scenario)
    scenarios = [s for _, s in plans]
    site = _first_site(scenarios)
    # effects that no scenario shows stay at their prior
    total = _total_information(extra, [_of_scenario(s, site, extra) for s in scenarios])
    runs = [s for s in scenarios if s.recording_kind.stabilised]
    at_rest = _at_rest((*runs, *scenarios)[0], EXTRA_RUN_S, site, extra)
    what = f"{'another' if runs else 'a run of'} 24 h at rest"
    manoeuvres = [PlannedManoeuvre(what, EXTRA_RUN_S / 3600, total + at_rest)]
    for s in scenarios:
        if s.recording_kind.stabilised:
            continue
        schedule = position_schedule(s)
        for i, h in enumerate(schedule.holds):
            one = Schedule(schedule.name, schedule.platform, (Hold(h.angles, EXTRA_DWELL_S),))
            what = f"ten more minutes in position {i + 1} of {schedule.name}"
            manoeuvres.append(PlannedManoeuvre(what, EXTRA_DWELL_S / 3600, total + _in_positions(s, one, site)))
    return PlannedCalibration(total, tuple(manoeuvres), still_base(hours, site))


def _extra_parameters(ids: Sequence[str]) -> tuple[Parameter, ...]:
    """Return the parameters of effects beyond the baseline of a static run."""
    for i in ids:
        if i not in CATALOGUE or "static-run" not in CATALOGUE[i].kinds or CATALOGUE[i].requires:
            raise InputError(f"--with {i}: no effect of that name shows in a static run by its angles and forces alone")
    extra = [i for i in ids if i not in BASELINE["static-run"]]
    return tuple(p for i in extra for p in parameters(CATALOGUE[i], SPACE_STABLE.axis_names))


def _of_scenario(s: Scenario, site: Site, extra: Sequence[Parameter]) -> Information:
    if s.recording_kind.stabilised:
        return _at_rest(s, s.schedule.duration, site, extra)
    schedule = position_schedule(s)
    holds = [Hold(h.angles, s.schedule.dwell or h.duration) for h in schedule.holds] * s.schedule.sweeps
    return _in_positions(s, Schedule(schedule.name, schedule.platform, tuple(holds)), site)


def _in_positions(s: Scenario, schedule: Schedule, site: Site) -> Information:
    samples = schedule.holds[0].duration * s.schedule.rate
    noise = Noise(s.noise.accelerometer, s.noise.gimbal_angle)
    plan = planned_recording(schedule, max(samples, 1.0), site)
    return information_in_positions(plan, position_parameters(schedule.platform), noise)


def _at_rest(s: Scenario, seconds: float, site: Site, extra: Sequence[Parameter]) -> Information:
    run = ideal_static_run(seconds / 3600, float(site.latitude or 0.0), 1 / s.schedule.rate)
    baseline = tuple(p for e in BASELINE["static-run"] for p in parameters(CATALOGUE[e], run.platform.axis_names))
    noise = {sensor: float(getattr(s.noise, sensor)) for sensor in STATIC_SENSORS}
    return information_at_rest(
        run, (*baseline, *extra), {sensor: sigma for sensor, sigma in noise.items() if sigma > 0}
    )


def _refuse_platform(name: str, s: Scenario) -> None:
    """Raise InputError for a scenario that is neither positions nor a static run of a space-stable platform."""
    if not s.recording_kind.at_rest or s.platform.name != SPACE_STABLE.name:
        raise InputError(
            f"{name}: a {s.kind} of {s.platform.name!r} has no budget; give positions or a static run of a "
            "space-stable platform, or turns of a strapdown unit in its place, such as wei2022-30"
        )
    if not s.noise.accelerometer > 0:
        raise InputError(f"{name}: noise.accelerometer: without noise everything would be known; state it")


def _first_site(scenarios: Sequence[Scenario]) -> Site:
    """Return the first site with a latitude."""
    site = next((s.site for s in scenarios if s.site.latitude is not None), None)
    if site is None or site.latitude is None:
        raise InputError("a budget needs site.latitude in one of the scenarios")
    return _with_gravity(site.latitude, site.height, site.gravity)


def _with_gravity(latitude: float, height: float, gravity: float | None) -> Site:
    """Return a site with normal gravity unless it is stated."""
    return Site(latitude, height, float(normal_gravity(latitude, height)) if gravity is None else gravity)


def _total_information(wanted: Sequence[Parameter], each: Sequence[Information]) -> Information:
    """Return the information of all planned recordings about the wanted parameters."""
    return sum(each, start=Information(tuple(wanted), np.zeros((1, len(wanted) + 1)), 0))


@dataclass(frozen=True)
class _Session:
    """Turns, and the experiment that they are."""

    turns: RotationSchedule
    experiment: TurningExperiment

    @property
    def hours(self) -> float:
        """Duration of the turns."""
        return trajectory(self.turns).duration / 3600

    @property
    def information(self) -> Information:
        """Information of the turns about the states."""
        return self.experiment.information(self.turns)


def _by_turns(plans: Plans, state_list: str, more: Sequence[str], hours: float) -> PlannedCalibration:
    """Return the information of sessions of turns.

    Manoeuvres are the same turns once more, twice as long stops, or a session of another schedule. Raises InputError
    for a unit that is not turned in its place, for noise that is coloured or not stated, and where no scenario has
    turns.
    """
    for name, s in plans:
        _refuse_motion(name, s)
    at_rest = [s for _, s in plans if not turning_schedule(s.schedule).moves]
    turning = [(name, s) for name, s in plans if turning_schedule(s.schedule).moves]
    if not turning:
        raise InputError(
            f"{plans[0][0]}: a unit that only rests is not calibrated; give the turns of its calibration before it, "
            "such as wei2022-30"
        )
    if len(at_rest) > 1:
        raise InputError(f"{plans[-1][0]}: a budget navigates one unit at rest, got {len(at_rest)}; keep one of them")
    place = _rotation_without_rows(turning[0][1])
    for name in more:  # refuses what no turns show by the option that names it
        states(name, place.why_not_shown, option="--with")
    wanted = states(",".join((*LISTS.get(state_list.strip(), (state_list,)), *more)), place.why_not_shown)
    sessions = [
        _Session(
            turning_schedule(s.schedule), TurningExperiment(_rotation_without_rows(s), wanted, _white_noise(name, s))
        )
        for name, s in turning
    ]
    each = [s.information for s in sessions]
    total = _total_information(wanted, each)
    manoeuvres: list[PlannedManoeuvre] = []
    for k, own in enumerate(sessions):
        manoeuvres.append(PlannedManoeuvre(f"the turns of {own.turns.name} once more", own.hours, total + each[k]))
        moves = tuple(replace(m, stop=None if m.stop is None else 2 * m.stop) for m in own.turns.moves)
        slow = replace(own, turns=replace(own.turns, moves=moves, stop=2 * own.turns.stop))
        slower = f"stops of {slow.turns.stop:g} s in place of {own.turns.stop:g} s in {own.turns.name}"
        others = _total_information(wanted, [t for i, t in enumerate(each) if i != k])
        manoeuvres.append(PlannedManoeuvre(slower, slow.hours - own.hours, others + slow.information))
    for name in sorted(set(ROTATIONS) - {own.turns.name for own in sessions}):
        other = replace(sessions[0], turns=ROTATIONS[name])
        manoeuvres.append(PlannedManoeuvre(f"a session of {name} besides", other.hours, total + other.information))
    navigating = (at_rest or [s for _, s in plans])[0]
    site = _with_gravity(required_latitude(navigating.site.latitude), navigating.site.height, navigating.site.gravity)
    unit = still_unit(
        hours + UNDAMPED.alignment / 3600, site, standing_attitude(turning_schedule(navigating.schedule).start)
    )
    return PlannedCalibration(total, tuple(manoeuvres), unit)


def _rotation_without_rows(s: Scenario) -> Recording:
    return rotation_at_place(required_latitude(s.site.latitude), s.site.height)


def _white_noise(name: str, s: Scenario) -> TurningNoise:
    """Return the white noise of a scenario. Raises InputError where it is not stated, and for coloured noise."""
    n, rate = s.noise, s.schedule.rate
    force = float(np.hypot(n.accelerometer_density, n.accelerometer / np.sqrt(rate)))
    spin = float(np.hypot(n.gyroscope_density, n.gyroscope / np.sqrt(rate)))
    for what, size in (("accelerometer", force), ("gyroscope", spin)):
        if not size > 0:
            raise InputError(f"{name}: noise.{what}_density: without noise everything would be known; state it")
    for field in (f for f in COLOURED if not f.endswith("_tau")):
        if getattr(n, field) > 0:
            raise InputError(f"{name}: noise.{field}: the budget of turns knows white noise alone; leave this out")
    return TurningNoise(force, spin, n.velocity or DEFAULT_VELOCITY_SIGMA_M_S)


def _refuse_motion(name: str, s: Scenario) -> None:
    """Raise InputError for a scenario that is neither a unit turned in its place, nor one at rest."""
    if not s.recording_kind.rotating:
        raise InputError(
            f"{name}: a {s.kind} has no budget together with a unit turned in its place; give one or the other"
        )
    motion = s.schedule
    if motion.swing or motion.drive:
        raise InputError(
            f"{name}: a {'swing' if motion.swing else 'drive'} has no budget: of a strapdown unit it is drawn up for "
            "turns and stops, and for a rest that is navigated"
        )
    if not motion.turns:
        raise InputError(
            f"{name}: positions of a table have no budget for a strapdown unit; give turns and stops, such as "
            "wei2022-30"
        )
