"""A log of gyroscopes beside the angle, or the rate, of the table that turned them, where gravity tells nothing of it.

Without accelerometers, or about the vertical, the gyroscopes tell axis and sense of the table. What they felt is held
against every column that nothing else is known of, as angle or rate in its usual units, and every chain of those axes.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from gimbalcal.checks.driven_rates import UNLIKE, Turning, chains, turning
from gimbalcal.effects.history import integral
from gimbalcal.guess import gimbal_chain
from gimbalcal.guess.column_names import (
    FORCE,
    RATE,
    Guess,
    axis_word,
    commanded,
    estimated,
    plain,
    rate_word,
    unit_written,
)
from gimbalcal.guess.column_values import changes
from gimbalcal.guess.merged_logs import Columns
from gimbalcal.guess.unit_candidates import BESIDE, is_open
from gimbalcal.number import Array
from gimbalcal.platform import Platform
from gimbalcal.quantities import QUANTITIES
from gimbalcal.units import to_si

ANGLES, RATES = ("deg", "rad", "rev"), ("deg/s", "rad/s", "rev/min")  # that a readout without a unit may be in
BETTER = 0.7  # of what fewer axes leave: one more is believed in
EQUAL = 1.05  # of the least that is left: as good, and the simpler one is taken
SOME = 0.05  # rad; what turns by less is no axis
MOST_AXES, MOST_COLUMNS = 3, 6


@dataclass(frozen=True, eq=False)
class Readout:
    """One way to read a column: as an angle [rad] (n,) in `unit`, or in a unit of rate as one that is added up."""

    name: str
    unit: str
    angle: Array

    @property
    def added_up(self) -> bool:
        """Whether the column holds a rate."""
        return self.unit in QUANTITIES["angular_rate"].units


@dataclass(frozen=True, eq=False)
class Found:
    """A chain of axes, its readouts, and the share of what gyroscopes read that it leaves."""

    left: float
    readouts: tuple[Readout, ...]
    platform: Platform


@dataclass(frozen=True)
class OnTable:
    """The log with its axes among the guesses, its platform, and why."""

    columns: dict[str, Array]
    guesses: dict[str, Guess]
    platform: Platform
    why: str


def on_table(log: Columns) -> OnTable | None:
    """The table that turned these gyroscopes; None where no column turns as they felt it."""
    columns, guesses = log
    gyros = {g.axis: n for n, g in guesses.items() if g.quantity == RATE}
    if set(gyros) != set("xyz"):
        return None
    turned, counts = gimbal_chain.turned_counts(_candidates(columns, guesses))
    (clock,) = [n for n, g in guesses.items() if g.quantity == "time"]
    time = np.asarray(to_si(columns[clock], guesses[clock].unit))
    read = np.stack([columns[gyros[a]] for a in "xyz"], axis=-1)
    whole = np.isfinite(read).all(axis=1) & np.all([np.isfinite(x) for x in turned.values()], axis=0)
    if not turned or np.count_nonzero(whole) < len(time) / 2 or np.any(np.diff(time) <= 0):
        return None
    unit = guesses[gyros["x"]].unit
    best: tuple[Found, str] | None = None
    for u in dict.fromkeys((unit, *(BESIDE if is_open(guesses, RATE) else ()))):
        scale = None if unit == "count" else 1.0
        y = read if scale is None else np.asarray(to_si(read, u))
        tried = (_chain(time[whole], y[whole], {n: x[whole] for n, x in group.items()}, scale)
                 for group in _likeliest(turned))  # fmt: skip
        found = next(filter(None, tried), None)
        if found and (best is None or found.left < BETTER * best[0].left):
            best = found, u
    if best is None:
        return None
    found, u = best
    why = f"the gyroscopes feel the rig turn so, but for {100 * found.left:.2g} % of what they read"
    out, said = dict(columns), {n: g for n, g in guesses.items() if g.quantity != "gimbal_angle"}
    if u != unit:
        said = {n: replace(g, unit=u, why=f"{why}, in {u}", open=False) if g.quantity == RATE else g
                for n, g in said.items()}  # fmt: skip
    for readout in found.readouts:
        axis = _axis(readout.name)
        reason = f"{counts[readout.name]} counts a turn; {why}" if readout.name in counts else why
        if readout.added_up:
            name, rate = f"{plain(readout.name)}_added_up", np.where(whole, turned[readout.name], 0.0)
            out[name] = np.degrees(integral(np.asarray(to_si(rate, readout.unit)), time))
            said[name] = Guess("gimbal_angle", axis, "deg", f"{readout.name.strip()} in {readout.unit}, added up over "
                               f"time from zero; {reason}")  # fmt: skip
        else:
            out[readout.name] = turned[readout.name]
            said[readout.name] = Guess("gimbal_angle", axis, readout.unit, reason)
    return OnTable(out, said, found.platform, why)


def gravity_stays(columns: Mapping[str, Array], guesses: Mapping[str, Guess]) -> bool:
    """Whether accelerometers logged in time feel gravity where it was: nothing turned, or all about the vertical."""
    force = [columns[n] for n, g in guesses.items() if g.quantity == FORCE]
    if len(force) != 3 or any(g.quantity == "position" for g in guesses.values()):
        return False
    whole = np.isfinite(np.stack(force)).all(axis=0)
    return bool(whole.any()) and not changes([x[whole] for x in force])


def upright(guesses: Mapping[str, Guess]) -> str:
    """What tells how the table stands, as an aside."""
    if any(g.quantity == FORCE for g in guesses.values()):
        return " about the vertical: --method rate-table; the accelerometers tell which way is up"
    return "; without accelerometers nothing tells how it stands on the Earth"


def lacking(guesses: Mapping[str, Guess], joined: bool) -> str:
    """What a log of gyroscopes alone lacks, as an aside; `joined` from several logs."""
    if {g.axis for g in guesses.values() if g.quantity == RATE} != set("xyz"):
        return ""
    return (
        ", and no other column is the angle or the rate of a table that turned the gyroscopes about one of their axes "
        f"as they felt it, which would do without accelerometers{'; give the log of each mounting alone' * joined}"
    )


def _candidates(columns: Mapping[str, Array], guesses: Mapping[str, Guess]) -> dict[str, Array]:
    """Columns that may be angles or rates of a rig, and turn."""
    named = {n for n, g in guesses.items() if g.quantity == "gimbal_angle"}
    others = {n: x for n, x in columns.items() if (n not in guesses or n in named) and not estimated(n)}
    return {n: x for n, x in others.items() if np.isfinite(x).mean() > 0.5 and np.nanmin(x) < np.nanmax(x)}


def _likeliest(columns: Mapping[str, Array]) -> Iterator[dict[str, Array]]:
    """Columns that are called after axes of a rig, then those of any name, and last what the rig was told to do."""
    measured = {n: x for n, x in columns.items() if not commanded(n)}
    for group in ({n: x for n, x in measured.items() if axis_word(n)}, measured, columns):
        yield {n: group[n] for n in list(group)[:MOST_COLUMNS]}


def _readouts(name: str, x: Array, time: Array) -> Iterator[Readout]:
    """The ways to read a column: as its name says, else as an angle and as a rate in the usual units."""
    written = unit_written(plain(name))
    if rate_word(name) and written in QUANTITIES["gimbal_angle"].units:
        written += "/s"  # table_rate_rad
    angles = (written,) if written in QUANTITIES["gimbal_angle"].units else ANGLES
    rates = (written,) if written in QUANTITIES["angular_rate"].units else RATES
    if written not in QUANTITIES["angular_rate"].units:
        yield from (Readout(name, u, np.unwrap(np.asarray(to_si(x, u)))) for u in angles)
    if written not in QUANTITIES["gimbal_angle"].units:
        yield from (Readout(name, u, integral(np.asarray(to_si(x, u)), time)) for u in rates)


def _chain(time: Array, read: Array, columns: Mapping[str, Array], scale: float | None) -> Found | None:
    """The readouts and the chain that turn as the gyroscopes felt it, with as few axes as explain it."""
    every = {n: {r.unit: r for r in _readouts(n, x, time) if np.ptp(r.angle) > SOME} for n, x in columns.items()}
    best: Found | None = None
    for many in range(1, MOST_AXES + 1):
        found: list[Found] = []
        for group in combinations([n for n in every if every[n]], many):
            names = tuple(map(_axis, group))
            if len(set(names)) < many:  # an angle and its rate, a command and its readout
                continue
            for unit in (u for u in every[group[0]] if all(u in every[n] for n in group)):  # a rig logs axes alike
                readouts = tuple(every[n][unit] for n in group)
                T = turning(time, read, np.stack([r.angle for r in readouts], axis=-1), names)
                if chain := _best(T, scale):
                    found.append(Found(chain[0], readouts, chain[1]))
        least = min((f.left for f in found), default=np.inf)
        if least < (BETTER * best.left if best else np.inf):
            best = next(f for f in found if f.left <= EQUAL * least)
    return best


def _best(T: Turning, scale: float | None) -> tuple[float, Platform] | None:
    """What the first of the chains leaves that are as good as any, and that chain; None where none turns alike."""
    usual = gimbal_chain.usual(frozenset(T.names))
    known = [usual] if usual is not None and set(usual.axis_names) == set(T.names) else []
    tried = [(T.left(p, scale), p) for p in (*known, *chains(T.names))]
    least = min(left for left, _ in tried)
    left, platform = next((left, p) for left, p in tried if left <= EQUAL * least)
    return (left, platform) if T.off(platform, scale) < UNLIKE else None


def _axis(name: str) -> str:
    return axis_word(name) or "table"
