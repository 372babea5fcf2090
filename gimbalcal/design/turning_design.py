r"""Design a sequence of turns for a two-axis table, by a search on the covariance, and compare it with published ones.

A schedule is a start and a list of turns of the outer axis, which is fixed in the room, and of the inner one, which
is along z of the unit, in multiples of a step. What is minimised is, over the groups of states g (all axes of one
parameter; of a sensitivity, its own axes and the others separately),

.. math:: \max_g \frac{\sigma_g}{\sigma_g^{\rm ref}} \quad \text{or} \quad
          \frac{1}{n} \sum_g \frac{\sigma_g}{\sigma_g^{\rm ref}}, \qquad \sigma_g = \max_{j \in g} \sigma_j ,

with the Cramer-Rao sigma of each state after the whole of the time, and as reference the best of other schedules in as
much time, or the usual size of each error. One candidate costs a few milliseconds: the transition of the navigation
errors over a turn depends on where it starts and is computed once; over a stop, on its attitude alone. The search is
simulated annealing: turns are changed, exchanged, inserted and removed, and the stops share the remaining time.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from gimbalcal.design.turning import StretchModel, TurningExperiment, cramer_rao_sigmas, turning_experiment
from gimbalcal.entries import Entry, Json, plain_json
from gimbalcal.errors import InputError, number_of
from gimbalcal.number import Array
from gimbalcal.progress import Progress, no_progress
from gimbalcal.rotation import exponential
from gimbalcal.schedule import ROTATIONS, Move, RotationSchedule
from gimbalcal.schedule.commands import direction, standing_attitude
from gimbalcal.schedule.file import read_rotation
from gimbalcal.schedule.trajectory import Trajectory, trajectory
from gimbalcal.units import from_si

START_AXES = ("east", "north", "up")
EAST = np.array([0.0, 1.0, 0.0])
Z = np.array([0.0, 0.0, 1.0])
STOP_STRETCH_S = 10.0  # of which stops consist in the search
MIN_STOP_S = 8.0
INITIAL_TEMPERATURE = 0.02  # of the objective
MEAN_SHARE = 0.05  # of the mean ratio in the objective of the largest, which ranks equal ones

Steps = tuple[int, int]  # outer, inner, in steps
Turn = tuple[int, int]  # axis (0 outer, 1 inner), steps


@dataclass(frozen=True)
class TwoAxisTable:
    """A table: step [rad] of its turns, limit [rad] of either axis from its zero, rate [rad/s], ramp [s], total [s]."""

    step: float
    limit: float
    rate: float
    ramp: float
    total: float


@dataclass(frozen=True)
class Tour:
    """A candidate: position of the axes at the start, and their turns."""

    start: Steps
    turns: tuple[Turn, ...]


@dataclass(eq=False)
class TurningSearch:
    """The table, the experiment, and the error models of all pieces of schedules computed so far.

    at_rest: mean readings and their derivatives at positions of the axes, which are the same however long a stop is.
    """

    table: TwoAxisTable
    experiment: TurningExperiment
    pieces: dict[tuple[int, ...], StretchModel] = field(default_factory=dict)
    at_rest: dict[tuple[int, ...], tuple[Array, Array]] = field(default_factory=dict)

    @property
    def groups(self) -> dict[str, list[int]]:
        """Indices of the states of each group."""
        out: dict[str, list[int]] = {}
        for i, p in enumerate(self.experiment.wanted):
            own = len(p.axis) == 2 and p.axis[0] == p.axis[1]
            two = {q.axis for q in self.experiment.wanted if q.name == p.name and len(q.axis) == 2}
            mixed = any(a[0] == a[1] for a in two) and any(a[0] != a[1] for a in two)
            out.setdefault(f"{p.name}, own axis" if own and mixed else p.name, []).append(i)
        return out

    def attitude(self, at: Steps) -> Array:
        """Return C_bn (3, 3) of the unit at a position of the axes."""
        outer, inner = (self.table.step * k for k in at)
        return exponential(-outer * EAST) @ standing_attitude(START_AXES) @ exponential(-inner * Z)

    def turning_time(self, turn: Turn) -> float:
        """Return the duration of a turn [s]."""
        angle, rate, ramp = abs(turn[1]) * self.table.step, self.table.rate, self.table.ramp
        return 2 * np.sqrt(angle * ramp / rate) if angle < rate * ramp else angle / rate + ramp

    def stop(self, tour: Tour) -> float:
        """Return the duration of each stop [s] for which the tour takes the whole of the time."""
        remaining = self.table.total - sum(map(self.turning_time, tour.turns))
        return float(remaining / (len(tour.turns) + 1))

    def sigma(self, tour: Tour) -> Array:
        """Return the sigmas (p,) in prior sigmas after a tour, with a coarser division of the stops."""
        stop, at = self.stop(tour), tour.start
        count = max(1, round(stop / STOP_STRETCH_S))
        parts = [(self._still(at, stop / count), count)]
        for axis, steps in tour.turns:
            parts.append((self._turning(at, (axis, steps)), 1))
            at = (at[0] + steps, at[1]) if axis == 0 else (at[0], at[1] + steps)
            parts.append((self._still(at, stop / count), count))
        times = np.repeat([n for _, n in parts], [len(part.time) for part, _ in parts])
        each = np.repeat(np.arange(len(times)), times)  # a stop is one stretch, many times
        whole = StretchModel(*(
            np.concatenate([getattr(part, name) for part, _ in parts])[each] for name in ("time", "Phi", "Psi", "Q")
        ))  # fmt: skip
        return cramer_rao_sigmas(whole.innovations(self.experiment.noise).rows.reshape(-1, len(self.experiment.wanted)))

    def _still(self, at: Steps, step: float) -> StretchModel:
        """Return the model of a part of a stop, with one update of the velocity."""
        full = round(2 * np.pi / self.table.step)
        key = (0, at[0] % full, at[1] % full, round(step * 1e4))
        if key not in self.pieces:
            none = np.zeros(0)
            path = Trajectory(np.zeros((0, 3)), none, none, none, none, self.attitude(at)[None], step)
            if key[1:3] not in self.at_rest:
                self.at_rest[key[1:3]] = self.experiment.mean_readings(path, np.array([step]), np.array([step]))
            self.pieces[key] = self.experiment.stretches(path, step, self.at_rest[key[1:3]])
        return self.pieces[key]

    def _turning(self, at: Steps, turn: Turn) -> StretchModel:
        """Return the model of a turn."""
        full = round(2 * np.pi / self.table.step)
        key = (1, at[0] % full, at[1] % full, *turn)
        if key not in self.pieces:
            C = self.attitude(at)
            axis = C.T @ EAST if turn[0] == 0 else Z
            angle, length = turn[1] * self.table.step, self.turning_time(turn)
            ramp = min(self.table.ramp, length / 2)
            path = Trajectory(
                axis[None], np.array([angle]), np.zeros(1), np.array([length]), np.array([ramp]),
                np.stack([C, C @ exponential(-angle * axis)]), length,
            )  # fmt: skip
            self.pieces[key] = self.experiment.stretches(path)
        return self.pieces[key]

    def schedule(self, tour: Tour, name: str = "designed") -> RotationSchedule:
        """Return a tour as a schedule."""
        C = self.attitude(tour.start)
        x, y, z = (direction(column) for column in C.T)
        axes = ("outer", "inner")
        moves = [Move(axes[axis], steps * self.table.step) for axis, steps in tour.turns]
        return RotationSchedule(
            name, (x, y, z), tuple(moves), self.table.rate, self.table.ramp, self.stop(tour), "east"
        )


def keeps_table_limits(table: TwoAxisTable, tour: Tour) -> bool:
    """Return whether the tour keeps the limits of the table and has no turn of zero."""
    at, limit = list(tour.start), table.limit / table.step * (1 + 1e-9)
    for axis, steps in tour.turns:
        at[axis] += steps
        if abs(at[axis]) > limit or steps == 0:
            return False
    return all(abs(k) <= limit for k in tour.start)


def anneal(
    search: TurningSearch, first: Sequence[Tour], reference: Array, criterion: str, tries: int, seed: int,
    progress: Progress,
) -> tuple[Tour, float]:  # fmt: skip
    """Return the best tour of a search from `first`, and its objective; reference (g,) in prior sigmas, as `groups`."""
    rng = np.random.default_rng(seed)
    groups = list(search.groups.values())

    def value(tour: Tour) -> float:
        sigma = search.sigma(tour)
        ratio = np.array([sigma[i].max() for i in groups]) / reference
        return float(ratio.max() + MEAN_SHARE * ratio.mean() if criterion == "max" else ratio.mean())

    start = [(value(tour), tour) for tour in first]
    value_now, current = min(start, key=lambda pair: pair[0])
    value_best, best = value_now, current
    for k in range(tries):
        tour = neighbouring_tour(current, rng, round(np.pi / search.table.step))
        if not keeps_table_limits(search.table, tour) or search.stop(tour) < MIN_STOP_S:
            continue
        candidate = value(tour)
        temperature = INITIAL_TEMPERATURE * value_best * (1 - k / tries) ** 2
        if candidate < value_now + temperature * rng.exponential():
            value_now, current = candidate, tour
        if candidate < value_best:
            value_best, best = candidate, tour
        if k % 500 == 499:
            progress(f"{k + 1} of {tries} candidates: {value_best:.4g} with {len(best.turns)} turns")
            value_now, current = value_best, best
    return best, value_best


def neighbouring_tour(tour: Tour, rng: np.random.Generator, half: int) -> Tour:
    """Return a neighbour of a tour: a turn changed, inserted, removed, exchanged or reversed, or another start."""
    turns = list(tour.turns)
    i = int(rng.integers(len(turns)))
    what = rng.choice(["change", "insert", "drop", "swap", "reverse", "start"], p=[0.35, 0.15, 0.15, 0.2, 0.1, 0.05])
    new = int(rng.integers(2)), int(rng.choice([-1, 1]) * rng.integers(1, half + 1))
    if what == "change":
        turns[i] = new
    elif what == "insert":
        turns.insert(i, new)
    elif what == "drop" and len(turns) > 2:
        del turns[i]
    elif what == "swap":
        j = int(rng.integers(len(turns)))
        turns[i], turns[j] = turns[j], turns[i]
    elif what == "reverse":
        j = int(rng.integers(len(turns)))
        low, high = min(i, j), max(i, j) + 1
        turns[low:high] = [(axis, -steps) for axis, steps in turns[low:high]]
    else:
        quarter = max(1, half // 2)
        return Tour((quarter * int(rng.integers(-1, 3)), quarter * int(rng.integers(-1, 3))), tour.turns)
    return Tour(tour.start, tuple(turns))


def as_tour(schedule: RotationSchedule, table: TwoAxisTable) -> Tour | None:
    """Return a published schedule as a tour of this table; None where the table cannot make it."""
    quarter = round(np.pi / 2 / table.step)
    if not np.isclose(quarter * table.step, np.pi / 2):
        return None
    goal, C = schedule.attitudes(), standing_attitude(START_AXES)
    starts = [(a * quarter, b * quarter) for a in (0, 1, -1, 2) for b in (0, 1, -1, 2)]

    def attitude(at: Steps) -> Array:
        return exponential(-table.step * at[0] * EAST) @ C @ exponential(-table.step * at[1] * Z)

    start = next((at for at in starts if np.allclose(attitude(at), goal[0])), None)
    if start is None:
        return None
    turns = []
    for i, move in enumerate(schedule.moves):
        axis, steps = schedule.axis(i, goal[i]), move.angle / table.step
        n = goal[i] @ axis
        which = 0 if np.isclose(abs(n @ EAST), 1) else 1 if np.isclose(abs(axis @ Z), 1) else None
        if which is None or not np.isclose(steps, round(steps)):
            return None
        sign = n @ EAST if which == 0 else axis @ Z
        turns.append((which, round(float(sign * steps))))
    return Tour(start, tuple(turns))


def with_total_duration(
    schedule: RotationSchedule, total: float, table: TwoAxisTable | None = None
) -> RotationSchedule:
    """Return a schedule with equal stops for which it takes `total` [s]; on a table, at its rate."""
    own = schedule if table is None else replace(schedule, rate=table.rate, ramp=table.ramp)
    moves = tuple(replace(m, stop=None) for m in own.moves)
    turning = trajectory(replace(own, moves=moves, stop=0.0)).duration
    return replace(own, moves=moves, stop=max(0.0, (total - turning) / (len(moves) + 1)))


def table_of(step: float, limit: float, rate: float, ramp: float, total: float) -> TwoAxisTable:
    """Return a two-axis table from step, limit [deg], rate [deg/s], ramp and total [s].

    Raises InputError where not every axis of the unit could point up and down.
    """
    if not np.isclose(90 / step, round(90 / step)) or step > 90:
        raise InputError(f"--step {step:g} deg must divide 90 deg, so that each axis of the unit can point up and down")
    if limit < 180:
        raise InputError(
            f"--limit {limit:g} deg: with less than half a turn either way not every axis comes to point up"
        )
    return TwoAxisTable(np.deg2rad(step), np.deg2rad(limit), np.deg2rad(rate), ramp, total)


def design_turning(
    table: TwoAxisTable,
    latitude: float,
    state_list: str = "51",
    against: Sequence[str] = (),
    criterion: str = "max",
    noise: tuple[float, float, float] = (0.002, 5.0, 1e-5),
    tries: int = 4000,
    seed: int = 1,
    progress: Progress = no_progress,
) -> TurnsDesign:
    """Return the schedule of turns with the smallest sigmas of the states `state_list` at `latitude` [deg].

    against: schedules to compare with, in as much time, each at its own rate or at the table's, whichever is better;
    none: the usual size of each error. noise: deg/sqrt(h), ug/sqrt(Hz), m/s. Raises InputError for what does not exist
    and for too little time.
    """
    search = TurningSearch(table, turning_experiment(latitude, state_list, *noise))
    others = {  # in the whole of the time, at its own rate or the table's, the smaller sigmas
        name: np.minimum(
            *(search.experiment.sigma(with_total_duration(read_rotation(name), table.total, t)) for t in (None, table))
        )
        for name in against
    }
    reference = (
        np.min([_largest_of_groups(search, s) for s in others.values()], axis=0)
        if others
        else np.ones(len(search.groups))
    )
    known = [as_tour(schedule, table) for schedule in (*ROTATIONS.values(), *map(read_rotation, against))]
    first = [tour for tour in known if tour is not None and keeps_table_limits(table, tour) and search.stop(tour) > 0]
    if not first:
        raise InputError(f"--total {table.total:g} s is too short for a schedule of turns at this rate; give it more")
    tour, _ = anneal(search, first, reference, criterion, tries, seed, progress)
    schedule = search.schedule(tour)
    sigma, groups = _largest_of_groups(search, search.experiment.sigma(schedule)), []
    for (name, members), mine, ref in zip(search.groups.items(), sigma, reference, strict=True):
        p = search.experiment.wanted[members[0]]
        unit = float(from_si(p.sigma, p.unit))
        theirs = {other: float(s[members].max() * unit) for other, s in others.items()}
        groups.append(GroupSigma(name, p.unit, float(mine * unit), theirs, float(mine / ref)))
    return TurnsDesign(schedule, trajectory(schedule).duration, tuple(groups), tuple(others))


def _largest_of_groups(search: TurningSearch, sigma: Array) -> Array:
    return np.array([sigma[i].max() for i in search.groups.values()])


@dataclass(frozen=True)
class GroupSigma(Entry):
    """Largest sigma of a group of states in its unit of print, also of other schedules; `ratio` to the reference."""

    group: str
    unit: str
    sigma: float
    against: Mapping[str, float]
    ratio: float


@dataclass(frozen=True)
class TurnsDesign:
    """A schedule of turns that takes `duration` [s], the largest sigma of each group, and the schedules compared."""

    schedule: RotationSchedule
    duration: float
    groups: tuple[GroupSigma, ...]
    others: tuple[str, ...]

    @property
    def comparison(self) -> str:
        """The comparison with the other schedules in one sentence; empty without others."""
        if not self.others:
            return ""
        worst = max(self.groups, key=lambda g: g.ratio)
        verdict = "better in every group" if worst.ratio < 1 else f"not better in {worst.group}"
        return f"{verdict} than {' and '.join(self.others)} in as much time: {worst.ratio:.3f} of theirs at worst"

    @property
    def in_words(self) -> str:
        """The answer in one paragraph."""
        turns = number_of(len(self.schedule.moves), "turn")
        words = [f"{turns} with stops of {self.schedule.stop:.1f} s take {self.duration:.0f} s"]
        for g in self.groups:
            compared = ", ".join(f"{other} {value:.3g}" for other, value in g.against.items())
            words.append(f"{g.group}: {g.sigma:.3g} {g.unit}{f' ({compared})' if compared else ''}")
        return "\n".join([*words, *filter(None, [self.comparison])])

    def to_dict(self) -> Json:
        """Return the report of the design."""
        return {
            "format": 1,
            "schedule": self.schedule.name,
            "turns": len(self.schedule.moves),
            "stop_s": self.schedule.stop,
            "total_s": self.duration,
            "groups": plain_json(self.groups),
            "in_words": self.in_words,
        }
