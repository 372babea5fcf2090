r"""The sequence of turns that sees most, for a two-axis table, found by search on the covariance.

A schedule is a start and a list of turns of the outer axis, which stays put in the room, and of the inner one, which
is along z of the unit, in multiples of a step. What is minimised is, over the groups of states g (all axes of one
parameter; of a sensitivity, its own axes and the others apart),

.. math:: \max_g \frac{\sigma_g}{\sigma_g^{\rm ref}} \quad \text{or} \quad
          \frac{1}{n} \sum_g \frac{\sigma_g}{\sigma_g^{\rm ref}}, \qquad \sigma_g = \max_{j \in g} \sigma_j ,

with the Cramer-Rao sigma of each state after the whole of the time, and as reference the best of other schedules in as
much time, or the usual size of each error. One candidate costs a few milliseconds: what a turn does to the navigation
errors depends on where it starts and is computed once; what a stop does, on its attitude alone. The search anneals:
turns are changed, exchanged, put in and left out, and the stops share the time that is left.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from gimbalcal.design.turning import Noise, Stretches, stretches
from gimbalcal.effects import Parameter
from gimbalcal.number import Array
from gimbalcal.recording import Recording
from gimbalcal.rotation import exponential
from gimbalcal.schedule import Move, RotationSchedule
from gimbalcal.schedule.rotation import direction, standing
from gimbalcal.schedule.trajectory import Trajectory, trajectory

START = ("east", "north", "up")
EAST = np.array([0.0, 1.0, 0.0])
Z = np.array([0.0, 0.0, 1.0])
STOP = 10.0  # s, the stretch of which stops are made up in the search
FEWEST = 8.0  # s, the shortest stop
COOL = 0.02  # of the objective: what a change may lose at first and still be kept
MIX = 0.05  # of the mean in the objective of the largest, which tells equal ones apart

Steps = tuple[int, int]  # outer, inner, in steps
Turn = tuple[int, int]  # axis (0 outer, 1 inner), steps


@dataclass(frozen=True)
class Table:
    """A rig: step [rad] of its turns, limit [rad] of either axis from its zero, rate [rad/s], ramp [s], total [s]."""

    step: float
    limit: float
    rate: float
    ramp: float
    total: float


@dataclass(frozen=True)
class Tour:
    """A candidate: where the axes are at the start, and how they turn."""

    start: Steps
    turns: tuple[Turn, ...]


@dataclass(eq=False)
class Search:
    """The table, what is to be estimated there, and every piece of a schedule that was looked at so far."""

    table: Table
    like: Recording
    wanted: tuple[Parameter, ...]
    noise: Noise
    pieces: dict[tuple[int, ...], Stretches] = field(default_factory=dict)

    @property
    def groups(self) -> dict[str, list[int]]:
        """Indices of the states of each group."""
        out: dict[str, list[int]] = {}
        for i, p in enumerate(self.wanted):
            own = len(p.axis) == 2 and p.axis[0] == p.axis[1]
            two = {q.axis for q in self.wanted if q.name == p.name and len(q.axis) == 2}
            mixed = any(a[0] == a[1] for a in two) and any(a[0] != a[1] for a in two)
            out.setdefault(f"{p.name}, own axis" if own and mixed else p.name, []).append(i)
        return out

    def attitude(self, at: Steps) -> Array:
        """C_bn (3, 3) of the unit with the axes there."""
        outer, inner = (self.table.step * k for k in at)
        return exponential(-outer * EAST) @ standing(START) @ exponential(-inner * Z)

    def turning_time(self, turn: Turn) -> float:
        """How long a turn takes [s]."""
        angle, rate, ramp = abs(turn[1]) * self.table.step, self.table.rate, self.table.ramp
        return 2 * np.sqrt(angle * ramp / rate) if angle < rate * ramp else angle / rate + ramp

    def stop(self, tour: Tour) -> float:
        """How long each stop lasts [s], that the tour may take the whole of the time."""
        left = self.table.total - sum(map(self.turning_time, tour.turns))
        return float(left / (len(tour.turns) + 1))

    def sigma(self, tour: Tour) -> Array:
        """Sigmas (p,) in prior sigmas after a tour, but for how finely stops are cut."""
        stop, at = self.stop(tour), tour.start
        count = max(1, round(stop / STOP))
        parts = [(self._still(at, stop / count), count)]
        for axis, steps in tour.turns:
            parts.append((self._turning(at, (axis, steps)), 1))
            at = (at[0] + steps, at[1]) if axis == 0 else (at[0], at[1] + steps)
            parts.append((self._still(at, stop / count), count))
        whole = Stretches(*(
            np.concatenate([np.repeat(getattr(part, name), n, axis=0) for part, n in parts])
            for name in ("time", "Phi", "Psi", "Q")
        ))  # fmt: skip
        rows = whole.innovations(self.noise).rows.reshape(-1, len(self.wanted))
        return np.sqrt(np.diag(np.linalg.inv(np.eye(len(self.wanted)) + rows.T @ rows)))

    def _still(self, at: Steps, step: float) -> Stretches:
        """A stretch of a stop, with one update of the velocity."""
        full = round(2 * np.pi / self.table.step)
        key = (0, at[0] % full, at[1] % full, round(step * 1e4))
        if key not in self.pieces:
            none = np.zeros(0)
            path = Trajectory(np.zeros((0, 3)), none, none, none, none, self.attitude(at)[None], step)
            self.pieces[key] = stretches(path, self.like, self.wanted, self.noise, step)
        return self.pieces[key]

    def _turning(self, at: Steps, turn: Turn) -> Stretches:
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
            self.pieces[key] = stretches(path, self.like, self.wanted, self.noise)
        return self.pieces[key]

    def schedule(self, tour: Tour, name: str = "designed") -> RotationSchedule:
        """A tour as a schedule; one that starts between the faces begins with turns that lead there."""
        C = self.attitude(tour.start)
        x, y, z = (direction(column) for column in C.T)
        axes = ("outer", "inner")
        moves = [Move(axes[axis], steps * self.table.step) for axis, steps in tour.turns]
        made = RotationSchedule(name, (x, y, z), tuple(moves), self.table.rate, self.table.ramp, 1.0, "east")
        return replace(made, stop=self.stop(tour))


def allowed(table: Table, tour: Tour) -> bool:
    """Whether the table can make the tour: its limits are kept, stops last, no turn undoes nothing."""
    at, most = list(tour.start), table.limit / table.step * (1 + 1e-9)
    for axis, steps in tour.turns:
        at[axis] += steps
        if abs(at[axis]) > most or steps == 0:
            return False
    return all(abs(k) <= most for k in tour.start)


def anneal(
    search: Search, first: Sequence[Tour], reference: Array, criterion: str, tries: int, seed: int,
    tell: Callable[[str], None] = lambda _: None,
) -> tuple[Tour, float]:  # fmt: skip
    """The best tour found from `first`, and its objective; reference (g,) in prior sigmas, in the order of `groups`."""
    rng = np.random.default_rng(seed)
    groups = list(search.groups.values())

    def value(tour: Tour) -> float:
        sigma = search.sigma(tour)
        ratio = np.array([sigma[i].max() for i in groups]) / reference
        return float(ratio.max() + MIX * ratio.mean() if criterion == "max" else ratio.mean())

    start = [(value(tour), tour) for tour in first]
    now, here = min(start, key=lambda pair: pair[0])
    best, found = now, here
    for k in range(tries):
        tour = changed(here, rng, round(np.pi / search.table.step))
        if not allowed(search.table, tour) or search.stop(tour) < FEWEST:
            continue
        worth = value(tour)
        warmth = COOL * best * (1 - k / tries) ** 2
        if worth < now + warmth * rng.exponential():
            now, here = worth, tour
        if worth < best:
            best, found = worth, tour
        if k % 500 == 499:
            tell(f"{k + 1} of {tries} candidates: {best:.4g} with {len(found.turns)} turns")
            now, here = best, found
    return found, best


def changed(tour: Tour, rng: np.random.Generator, half: int) -> Tour:
    """A neighbour of a tour: a turn changed, put in, left out, exchanged or reversed, or another start."""
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


def as_tour(schedule: RotationSchedule, table: Table) -> Tour | None:
    """A published schedule as a tour of this table; None where it is none."""
    quarter = round(np.pi / 2 / table.step)
    if not np.isclose(quarter * table.step, np.pi / 2):
        return None
    goal, C = schedule.attitudes(), standing(START)
    starts = [(a * quarter, b * quarter) for a in (0, 1, -1, 2) for b in (0, 1, -1, 2)]

    def stands(at: Steps) -> Array:
        return exponential(-table.step * at[0] * EAST) @ C @ exponential(-table.step * at[1] * Z)

    start = next((at for at in starts if np.allclose(stands(at), goal[0])), None)
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


def stretched(schedule: RotationSchedule, total: float, table: Table | None = None) -> RotationSchedule:
    """A schedule with longer or shorter stops, all alike, so that it takes `total` [s]; on a table, at its rate."""
    own = schedule if table is None else replace(schedule, rate=table.rate, ramp=table.ramp)
    moves = tuple(replace(m, stop=None) for m in own.moves)
    turning = trajectory(replace(own, moves=moves, stop=0.0)).duration
    return replace(own, moves=moves, stop=max(0.0, (total - turning) / (len(moves) + 1)))
