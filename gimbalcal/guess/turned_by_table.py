"""Gyroscopes logged with the angle, or the rate, of the table that turned them, where gravity shows nothing of it.

Without accelerometers, or about the vertical, the gyroscopes determine axis and sense of the table. Their readings are
compared with every column of unknown content, as angle or rate in its usual units, and every chain of those axes.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, permutations

import numpy as np

from gimbalcal.checks.driven_rates import MAX_RESIDUAL, DrivenTurn, driven_turn
from gimbalcal.checks.input_errors import successful_trials
from gimbalcal.effects.history import integral
from gimbalcal.guess.attitude import quaternions
from gimbalcal.guess.column_names import (
    axis_word,
    by_name,
    differ_in_axis,
    is_anonymous,
    is_commanded,
    is_estimated,
    plain_name,
    rate_word,
    unit_written,
)
from gimbalcal.guess.column_values import MAX_GRAVITY_ERROR, RATE_UNIT_COSTS, changes_direction
from gimbalcal.guess.gimbal_chain import MAX_AXES, MAX_COLUMNS, QUARTER_TURNS, chains, encoder_angles, usual_platform
from gimbalcal.guess.log import Guess, Log, filled_rows
from gimbalcal.number import Array, apply_matrix
from gimbalcal.platform import Platform
from gimbalcal.quantities import QUANTITIES
from gimbalcal.recording.record import FORCE, RATE
from gimbalcal.units import to_si

ANGLE_UNITS, RATE_UNITS_OF_TABLE = ("deg", "rad", "rev"), ("deg/s", "rad/s", "rev/min")  # of an unnamed readout
MAX_MISFIT_RATIO = 0.7  # of a model with fewer axes, from which one more is believed in
EQUAL_MISFIT_RATIO = 1.05  # of the smallest misfit: as good, and the simpler model is taken
MAX_UNEXPLAINED = 0.9  # of what gyroscopes read, noise included; a column that leaves more fits by chance
MAX_LENGTH_CHANGE = 0.3  # of a vector, of what its widest component changes by
MIN_TRAVEL = 0.05  # rad, of an axis
MIN_RATE_CHANGE = np.radians(0.5)  # rad/s, within which a drift moves gyroscopes that nothing turned


@dataclass(frozen=True, eq=False)
class TableReadout:
    """One way to read a column: as an angle [rad] (n,) in `unit`, or, in a unit of rate, as the integral of a rate."""

    name: str
    unit: str
    angle: Array

    @property
    def is_rate(self) -> bool:
        """Return whether the column holds a rate."""
        return self.unit in QUANTITIES[RATE].units


@dataclass(frozen=True, eq=False)
class TableFit:
    """A chain of axes, its readouts, and the share of the gyroscopes' readings that it leaves."""

    misfit: float
    readouts: tuple[TableReadout, ...]
    platform: Platform


@dataclass(frozen=True, eq=False)
class TurnedLog:
    """A log with the axes of a table among the guesses, its platform, and why."""

    log: Log
    platform: Platform
    why: str


def turned_by_table(log: Log) -> TurnedLog | None:
    """Return the log with the table that turned its gyroscopes; None where no column turns as they felt it."""
    gyros = {log.guesses[n].axis: n for n in log.names(RATE)}
    if set(gyros) != set("xyz"):
        return None
    stated_unit = log.guesses[gyros["x"]].unit
    columns, counts = encoder_angles(_axis_candidates(log))
    time = log.seconds
    readings = np.stack([log.columns[gyros[a]] for a in "xyz"], axis=-1)
    whole = np.isfinite(readings).all(axis=1) & np.all([np.isfinite(x) for x in columns.values()], axis=0)
    changes = np.ptp(to_si(readings[whole], stated_unit), axis=0) if whole.any() else np.zeros(3)
    still = stated_unit != "count" and bool(np.all(changes < MIN_RATE_CHANGE))
    if still or not columns or np.count_nonzero(whole) < len(time) / 2 or np.any(np.diff(time) <= 0):
        return None
    best: tuple[TableFit, str] | None = None
    for unit in dict.fromkeys((stated_unit, *(RATE_UNIT_COSTS if log.has_open_unit(RATE) else ()))):
        scale = None if stated_unit == "count" else 1.0
        y = readings if scale is None else np.asarray(to_si(readings, unit))
        fits = (
            _fit(time[whole], y[whole], {n: x[whole] for n, x in group.items()}, scale)
            for group in _by_likelihood(columns)
        )
        fit = next(filter(None, fits), None)
        if fit and (best is None or fit.misfit < MAX_MISFIT_RATIO * best[0].misfit):
            best = fit, unit
    if best is None:
        return None
    fit, unit = best
    why = f"the gyroscopes feel the rig turn so, but for {100 * fit.misfit:.2g} % of what they read"
    turned = log.without("gimbal_angle")
    if unit != stated_unit:
        turned = turned.including(
            {n: replace(turned.guesses[n], unit=unit, why=f"{why}, in {unit}", open=False) for n in turned.names(RATE)}
        )
    for readout in fit.readouts:
        axis, values = _axis(readout.name), columns[readout.name]
        reason = f"{counts[readout.name]} counts a turn; {why}" if readout.name in counts else why
        if readout.is_rate:
            rate = np.asarray(to_si(np.where(whole, values, 0.0), readout.unit))
            reason = f"{readout.name.strip()} in {readout.unit}, added up over time from zero; {reason}"
            name, guess = f"{plain_name(readout.name)}_added_up", Guess("gimbal_angle", axis, "deg", reason)
            values = np.degrees(integral(rate, time))
        else:
            name, guess = readout.name, Guess("gimbal_angle", axis, readout.unit, reason)
        turned = turned.including({name: guess}, {name: values})
    return TurnedLog(turned, fit.platform, why)


def gravity_is_constant(log: Log) -> bool:
    """Return whether accelerometers logged in time feel one gravity: nothing turned, or all about the vertical."""
    force = log.values(FORCE)
    if len(force) != 3 or log.has("position"):
        return False
    filled = filled_rows(force)
    return len(filled[0]) > 0 and not changes_direction(filled)


def gravity_follows(table: TurnedLog) -> bool:
    """Return whether the accelerometers of a log feel one gravity of the base, as the axes of the table turn it."""
    log = table.log
    angle_of = {log.guesses[n].axis: to_si(log.columns[n], log.guesses[n].unit) for n in log.names("gimbal_angle")}
    f = np.stack(log.values(FORCE), axis=-1)
    C = table.platform.attitude(np.stack([angle_of[a] for a in table.platform.axis_names], axis=-1))
    whole = np.isfinite(f).all(axis=1) & np.isfinite(C).all(axis=(1, 2))
    f, C = f[whole], C[whole]
    gravity = np.median(apply_matrix(C.swapaxes(-1, -2), f), axis=0)
    off = np.linalg.norm(f - apply_matrix(C, gravity), axis=1)
    return bool(np.median(off) < MAX_GRAVITY_ERROR * np.linalg.norm(gravity))


def orientation_note(log: Log) -> str:
    """Return how the orientation of the table on the Earth follows, as an aside."""
    if log.has(FORCE):
        about = "the vertical" if gravity_is_constant(log) else "an axis that is not vertical"
        return f" about {about}: --method rate-table; the accelerometers show which way is up"
    return "; without accelerometers nothing shows how it stands on the Earth"


def missing_table(log: Log, parts: bool) -> str:
    """Return what a log of gyroscopes alone lacks, as an aside; parts: of several logs."""
    if {log.guesses[n].axis for n in log.names(RATE)} != set("xyz"):
        return ""
    return (
        ", and no other column is the angle or the rate of a table that turned the gyroscopes about one of their axes "
        f"as they felt it, which would do without accelerometers{'; give the log of each mounting alone' * parts}"
    )


def _axis_candidates(log: Log) -> dict[str, Array]:
    """Return columns that may be angles or rates of a rig, and turn."""
    named = {n: log.columns[n] for n in log.names("gimbal_angle")}
    of_attitude = {n for _, names, _ in quaternions(log) for n in names}
    names = list(log.columns)
    triples = tuple(zip(names, names[1:], names[2:], strict=False))
    of_vector = {n for t in triples if differ_in_axis(t, ("xyz",)) or _is_vector(log, t) for n in t}
    others = of_attitude | of_vector  # of a magnetometer, which follows the turns as well
    unnamed = [n for n in log.unknown if n not in others and not is_estimated(n) and not _is_of_a_sensor(n)]
    candidates = {n: x for n, x in log.columns.items() if n in named or n in unnamed}
    return {n: x for n, x in candidates.items() if np.isfinite(x).mean() > 0.5 and np.nanmin(x) < np.nanmax(x)}


def _is_vector(log: Log, names: Sequence[str]) -> bool:
    """Return whether three columns without names hold a vector that turns and keeps its length, as a magnetometer's."""
    if not all(n in log.unknown and is_anonymous(n) for n in names):
        return False
    x = np.stack([log.columns[n] for n in names])
    x = x[:, np.isfinite(x).all(axis=0)]
    if x.shape[1] < 2 or np.any(np.mean(np.diff(x) != 0, axis=1) < 0.5):  # a readout that stands still is no sensor's
        return False
    return bool(np.std(np.linalg.norm(x, axis=0)) < MAX_LENGTH_CHANGE * np.std(x, axis=1).max())


def _is_of_a_sensor(name: str) -> bool:
    """Return whether a name is that of an accelerometer or a gyroscope: of a second unit, which turns alike."""
    guess = by_name(name)
    return guess is not None and guess.quantity in (FORCE, RATE) and not rate_word(name)


def _by_likelihood(columns: Mapping[str, Array]) -> Iterator[dict[str, Array]]:
    """Yield columns that are called after axes of a rig, then those of any name, and last the commands to a rig."""
    measured = {n: x for n, x in columns.items() if not is_commanded(n)}
    for group in ({n: x for n, x in measured.items() if axis_word(n)}, measured, columns):
        yield {n: group[n] for n in list(group)[:MAX_COLUMNS]}


def _readouts(name: str, x: Array, time: Array) -> Iterator[TableReadout]:
    """Yield the ways to read a column: as its name says, else as an angle and as a rate in the usual units."""
    written, angles, rates = unit_written(plain_name(name)), QUANTITIES["gimbal_angle"].units, QUANTITIES[RATE].units
    if rate_word(name) and written in angles:
        written += "/s"  # table_rate_rad
    if written not in rates:
        for unit in (written,) if written in angles else ANGLE_UNITS:
            yield TableReadout(name, unit, np.unwrap(np.asarray(to_si(x, unit))))
    if written not in angles:
        for unit in (written,) if written in rates else RATE_UNITS_OF_TABLE:
            yield TableReadout(name, unit, integral(np.asarray(to_si(x, unit)), time))


def _fit(time: Array, readings: Array, columns: Mapping[str, Array], scale: float | None) -> TableFit | None:
    """Return the readouts and the chain that turn as the gyroscopes felt it, with as few axes as explain it."""
    readouts = {
        n: {r.unit: r for r in _readouts(n, x, time) if np.ptp(r.angle) > MIN_TRAVEL} for n, x in columns.items()
    }
    best: TableFit | None = None
    for count in range(1, MAX_AXES + 1):
        fits: list[TableFit] = []
        for group in combinations([n for n in readouts if readouts[n]], count):
            names = tuple(map(_axis, group))
            if len(set(names)) < count:  # an angle and its rate, a command and its readout
                continue
            for unit in (u for u in readouts[group[0]] if all(u in readouts[n] for n in group)):  # alike for all axes
                own = tuple(readouts[n][unit] for n in group)
                turns = driven_turn(time, readings, np.stack([r.angle for r in own], axis=-1), names)
                if chain := _best_chain(turns, scale):
                    fits.append(TableFit(chain[0], own, chain[1]))
        least = min((f.misfit for f in fits), default=np.inf)
        if least < (MAX_MISFIT_RATIO * best.misfit if best else np.inf):
            best = successful_trials(fits, lambda f: f.misfit, tolerance=EQUAL_MISFIT_RATIO)[0].candidate
    return best


def _best_chain(turns: DrivenTurn, scale: float | None) -> tuple[float, Platform] | None:
    """Return the first chain that is as good as any, after its misfit; None where none turns alike."""
    usual = usual_platform(frozenset(turns.names))
    known = [usual] if usual is not None and set(usual.axis_names) == set(turns.names) else []
    offsets = [*[QUARTER_TURNS] * (len(turns.names) - 1), (0.0,)]  # what the outermost stands on turns nothing
    platforms = (*known, *chains(permutations(turns.names), offsets))
    (best,) = successful_trials(platforms, lambda p: turns.residual(p, scale), tolerance=EQUAL_MISFIT_RATIO)
    explains = best.misfit < MAX_UNEXPLAINED and turns.misfit(best.candidate, scale) < MAX_RESIDUAL
    return (best.misfit, best.candidate) if explains else None


def _axis(name: str) -> str:
    return axis_word(name) or "table"
