r"""What a planned calibration by turns will tell, and the unit at rest that is navigated with it, for an error budget.

The velocity of a unit that is turned in its place is known to be zero, so that errors which grow along the turns
(`design.turning`, after Cai et al. 2016, Eq. (17)) become information about its sensors. Several sessions add up, each
with an attitude of its own, as in `estimate.systematic.joint_recordings`. A scenario without turns says where and how
the unit stands when it navigates, else it stands as its turns begin; its attitude is found in the first minutes and
takes up what it can.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gimbalcal.design.turning import Noise, plan, stretches
from gimbalcal.earth import normal_gravity
from gimbalcal.effects import Parameter
from gimbalcal.errors import InputError
from gimbalcal.estimate.systematic.segments import DEFAULT_VELOCITY_SIGMA_M_S
from gimbalcal.estimate.systematic.state_lists import LISTS, states
from gimbalcal.inference.information import Information, information
from gimbalcal.kinematics import required_latitude
from gimbalcal.navigate.space_stable import ALONE
from gimbalcal.navigate.stationary_base import still_unit
from gimbalcal.recording import Recording, Site
from gimbalcal.schedule import ROTATIONS, RotationSchedule
from gimbalcal.schedule.rotation import standing
from gimbalcal.schedule.trajectory import trajectory
from gimbalcal.simulate import Scenario
from gimbalcal.simulate.turned import schedule_of

COLOURED = (
    "accelerometer_random_walk", "accelerometer_flicker", "accelerometer_gauss_markov", "gyroscope_random_walk",
    "gyroscope_flicker", "gyroscope_gauss_markov",
)  # fmt: skip
Plans = Sequence[tuple[str, Scenario]]


@dataclass(frozen=True)
class _Session:
    """Turns at a latitude and height [rad, m] with their noise."""

    turns: RotationSchedule
    site: tuple[float, float]
    noise: Noise

    @property
    def hours(self) -> float:
        """How long it takes."""
        return trajectory(self.turns).duration / 3600

    def tells(self, wanted: Sequence[Parameter]) -> Information:
        """What the velocity, known every second, says of these parameters."""
        found = stretches(trajectory(self.turns), plan(*self.site), wanted, self.noise).innovations(self.noise)
        rows = found.rows.reshape(-1, len(wanted)) / np.array([p.sigma for p in wanted])
        return information(rows, np.zeros(len(rows)), wanted)


def turned(
    plans: Plans, asked: str, more: Sequence[str], hours: float
) -> tuple[Information, list[tuple[dict[str, Any], Information]], Recording]:
    """What scenarios of turns tell of the states `asked` and `more`, the same with each manoeuvre, and who navigates.

    A manoeuvre is the same turns once more, twice as long stops, or a session of another schedule besides. The unit is
    at rest for `hours` after its alignment. Raises InputError for what is not turned in its place, for noise that is
    not white or not stated, and where no scenario has turns.
    """
    for name, s in plans:
        _refuse(name, s)
    still = [s for _, s in plans if not schedule_of(s.schedule).moves]
    sessions = [_session(name, s) for name, s in plans if schedule_of(s.schedule).moves]
    if not sessions:
        raise InputError(
            f"{plans[0][0]}: a unit that only rests is not calibrated; give the turns of its calibration before it, "
            "such as wei2022-30"
        )
    if len(still) > 1:
        raise InputError(f"{plans[-1][0]}: a budget navigates one unit at rest, got {len(still)}; keep one of them")
    wanted = _states(asked, more, plan(*sessions[0].site))
    tell = [s.tells(wanted) for s in sessions]
    whole = _sum(wanted, tell)
    besides: list[tuple[dict[str, Any], Information]] = []
    for k, own in enumerate(sessions):
        besides.append(({"what": f"the turns of {own.turns.name} once more", "hours": own.hours}, whole + tell[k]))
        slow = replace(own, turns=_with_longer_stops(own.turns))
        slower = f"stops of {slow.turns.stop:g} s in place of {own.turns.stop:g} s in {own.turns.name}"
        rest = _sum(wanted, [t for i, t in enumerate(tell) if i != k])
        besides.append(({"what": slower, "hours": slow.hours - own.hours}, rest + slow.tells(wanted)))
    for name in sorted(set(ROTATIONS) - {own.turns.name for own in sessions}):
        other = replace(sessions[0], turns=ROTATIONS[name])
        what = {"what": f"a session of {name} besides", "hours": other.hours}
        besides.append((what, whole + other.tells(wanted)))
    at = (still or [s for _, s in plans])[0]
    C_bn = standing(schedule_of(at.schedule).start)
    return whole, besides, still_unit(hours + ALONE.alignment / 3600, _site(at), C_bn)


def _states(asked: str, more: Sequence[str], like: Recording) -> tuple[Parameter, ...]:
    """The parameters of `--states`, and those of effects that are asked for with `--with`."""
    for said in more:
        states(said, like, option="--with")
    return states(",".join((*LISTS.get(asked.strip(), (asked,)), *more)), like)


def _sum(wanted: Sequence[Parameter], each: Sequence[Information]) -> Information:
    return sum(each, start=Information(tuple(wanted), np.zeros((1, len(wanted) + 1)), 0))


def _with_longer_stops(turns: RotationSchedule) -> RotationSchedule:
    moves = tuple(replace(m, stop=None if m.stop is None else 2 * m.stop) for m in turns.moves)
    return replace(turns, moves=moves, stop=2 * turns.stop)


def _session(name: str, s: Scenario) -> _Session:
    n, rate = s.noise, s.schedule.rate
    force = float(np.hypot(n.accelerometer_density, n.accelerometer / np.sqrt(rate)))
    spin = float(np.hypot(n.gyroscope_density, n.gyroscope / np.sqrt(rate)))
    for what, size in (("accelerometer", force), ("gyroscope", spin)):
        if not size > 0:
            raise InputError(f"{name}: noise.{what}_density: without noise everything would be known; state it")
    for field in COLOURED:
        if getattr(n, field) > 0:
            raise InputError(f"{name}: noise.{field}: the budget of turns knows white noise alone; leave this out")
    return _Session(
        schedule_of(s.schedule),
        (_latitude(s), s.site.height),
        Noise(force, spin, n.velocity or DEFAULT_VELOCITY_SIGMA_M_S),
    )


def _site(s: Scenario) -> Site:
    L, height = _latitude(s), s.site.height
    return Site(L, height, float(normal_gravity(L, height)) if s.site.gravity is None else s.site.gravity)


def _latitude(s: Scenario) -> float:
    return required_latitude(s.site.latitude)


def _refuse(name: str, s: Scenario) -> None:
    """Raise InputError for a scenario that is no unit turned in its place, nor one at rest."""
    if s.kind != "rotation":
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
