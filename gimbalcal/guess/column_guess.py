"""What the columns of one log hold: by their names, by similar names, by their order, and units by their numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gimbalcal.errors import InputError, number_of
from gimbalcal.guess import clocks
from gimbalcal.guess.column_names import (
    body_rates,
    by_name,
    by_turn,
    counted_from_one,
    is_anonymous,
    plain_name,
    quantity_of_log,
    unit_written,
)
from gimbalcal.guess.column_values import (
    attitude_columns,
    by_order,
    by_similar_names,
    in_another_unit,
    is_unit_of,
    signed_counts,
    unit_of_force,
)
from gimbalcal.guess.log import Guess, Log, filled_rows
from gimbalcal.guess.merged_logs import DWELL_ROWS, without_duplicates
from gimbalcal.guess.text_table import Table
from gimbalcal.guess.unit_candidates import rate_costs
from gimbalcal.inference.ellipsoid import design
from gimbalcal.number import Array
from gimbalcal.recording.columns import ROW_STEP_S
from gimbalcal.recording.detection import step_of_most_changes
from gimbalcal.recording.increments import intervals
from gimbalcal.recording.record import FORCE, RATE
from gimbalcal.units import to_si

JOINED_CLOCK = "time of two columns"
MIN_STEP = 0.05  # of the norm of the force, from row to row: no log is so slow, but a table of positions is
MAX_NORM_SPREAD = 0.1  # of the force at all but a few dwells
MAX_DWELLS = 2000  # rows of such a table
MIN_DWELL_STEP_S = 0.5  # from one of its rows to the next
# rows that show an ellipsoid, and how far from it most rests are, in g
MIN_ELLIPSOID_ROWS, MAX_OFF_ELLIPSOID = 30, 0.02
MIN_CLOCK_ROWS, MAX_RESTARTS = 20, 3  # of a clock without a name that begins again
MAX_NUMBERED = 100  # rows that are numbered as positions although the force hardly turns: a count of samples has more
MIN_REPEATED, MIN_READ_ROWS, UNLIKE_REPEATS = 0.4, 100, 3.0  # of the rows; others; times the usual number
FIRST_ROWS = 1000  # within which a column that is no clock falls
MAX_SHORT = 0.1  # rows of little force, of the number of those without any, which are lost readings then
MIN_HELD_ROWS, MIN_PROBABILITY = 20, 1e-6  # equal rows of all sensors that may be held, and that chance leaves so


@dataclass(frozen=True, eq=False)
class GuessedLog:
    """A log with guesses, the columns that are left out, and notes by the line of recording.toml they belong to.

    bare: the log without the units that no name states.
    """

    log: Log
    bare: Log
    left_out: tuple[str, ...]
    notes: Mapping[str, str]


def guess_columns(path: Path, table: Table, rate: float, elsewhere: Set[str], units: Mapping[str, str]) -> GuessedLog:
    """Guess what the columns of a log hold.

    rate: of the rows [Hz], which then replaces a clock. elsewhere: quantities that columns of any of the logs are named
    after. units: by quantity, as a user states them. Raises InputError where no column is a clock and rows are not
    those of positions.
    """
    columns, signed = signed_counts(table.columns)
    varying = [x for n, x in columns.items() if n not in table.dates and not _grows(x)]
    if (lost := _lost_rows(varying)).any():
        columns = {n: x[~lost] for n, x in columns.items()}
    table = replace(table, columns=columns)
    notes = {"counts": f"{', '.join(signed)}: two's complement of 16 bits, logged without sign"} if signed else {}
    rows = number_of(int(lost.sum()), "row")
    notes |= {"lost": f"{rows} are left out, in which all sensors read zero"} if lost.any() else {}
    log, joined = _by_names(path, table)
    log, note = clocks.single_sensor(log)
    notes |= {"sensor": note} if note else {}
    every = _by_values(_in_seconds(log, table), elsewhere, quantity_of_log(path.stem))
    log = without_duplicates(every)
    further = [n for n in every.names(FORCE, RATE) if n not in log.guesses]
    notes |= {"further": left_out_in_words(further)} if further else {}
    log, note = _timed_rows(log)
    notes |= {"time": note} if note else {}
    if log.has("time"):
        time, note = clocks.spread_stamps(log.columns[log.clock], _is_sampled(log))
        log = log.including({}, {log.clock: time})
        notes |= {"clock": note} if note else {}
    dwell_rows = _rows_are_dwells(log)
    if dwell_rows:
        log = _table_of_dwells(log)
    elif _numbers_each_row(log):  # a count of rows, whatever it is called
        log = log.without("position")
    log = _means_of_increments(_with_row_clock(path, log, rate, dwell_rows, table.rate))
    log, note = _without_lost_rows(log)
    notes |= {"lost": note} if note else {}
    log, note = _without_held_rows(log)
    notes |= {"held": note} if note else {}
    log, note = _without_repeated_rows(log)
    notes |= {"repeated": note} if note else {}
    if not dwell_rows:  # the standard deviation of single samples follows from the rows
        log = log.without("sigma", "weight")
    elif log.has("sigma"):
        notes["sigma"] = (
            "standard deviations are of single samples, and a mean of N is better by sqrt(N)"
            if log.has("weight")
            else "standard deviations are taken for those of the means; of single samples, add a column with their "
            'number, quantity = "weight"'
        )
    used = {*log.guesses, *joined}
    if dwell_rows:
        used |= {name for name in log.columns if (g := by_name(name)) and g.quantity == "sigma"}
    left_out = tuple(name for name in (*table.columns, *table.others) if name not in used)
    return GuessedLog(with_units(log, units), log, left_out, notes)


def left_out_in_words(further: Sequence[str]) -> str:
    """Return what to do about columns of sensors beyond the first triad of each kind, which are left out."""
    return (
        f"{', '.join(further)} are of another unit, or the same in another form, and are left out; give `new` a table "
        "without the columns that are taken for a recording of them"
    )


def _means_of_increments(log: Log) -> Log:
    """Return the log with mean forces and rates where columns hold increments; counts of these stay, as any counts.

    They are means over the intervals that a recording of increments divides by, in the likeliest unit of the clock.
    """
    names = [
        n for n, g in log.guesses.items() if g.increments and not np.all(log.columns[n] == np.round(log.columns[n]))
    ]
    if not names or len(log.columns[log.clock]) < 2:
        return log
    if not is_unit_of("time", log.guesses[log.clock].unit):
        log = clocks.in_unit(log, clocks.unit_of_time(log.columns[log.clock])[0])
    dt, _ = intervals(log.seconds)
    means = {n: to_si(log.columns[n], log.guesses[n].unit or "1") / dt for n in names}
    why = "an increment since the row before, divided by the time since then"
    guesses = {n: replace(log.guesses[n], why=f"{log.guesses[n].why}, {why}", increments=False) for n in names}
    return log.including({n: replace(g, unit="rad/s" if g.unit else "") for n, g in guesses.items()}, means)


def _by_names(path: Path, table: Table) -> tuple[Log, tuple[str, ...]]:
    """Return the log with guesses by the names of its columns, and the two columns that make up its clock, if any."""
    columns, two = dict(table.columns), clocks.two_column_clock(table.columns)
    if two:
        columns = {JOINED_CLOCK: two[2], **{n: x for n, x in columns.items() if n not in two[:2]}}
    hint = quantity_of_log(path.stem)
    guesses = {
        name: g
        for name, x in columns.items()
        if (g := by_name(name, hint)) is not None and not (g.quantity == "time" and len(x) > 1 and np.ptp(x) == 0)
    }
    log = Log(columns, guesses | counted_from_one(columns))
    if two:
        why = f"its names {two[0]!r} and {two[1]!r}, whole seconds and {two[3]}, counted from the first row"
        return log.preceded_by(JOINED_CLOCK, Guess("time", "", "s", why)), two[:2]
    if not log.has("time") and (clock := _column_of_dates(log, table)):
        log = log.preceded_by(clock, Guess("time", "", "s", "its cells, which are times of day"))
    return log, ()


def _column_of_dates(log: Log, table: Table) -> str:
    """Return a column whose cells are dates, or times of day that go on past midnight at most; empty if none."""
    for name, x in log.columns.items():
        if name in table.dates or (
            name in table.sexagesimal and np.all(np.diff(clocks.unwrapped_clock(3600 * x)[0]) > 0)
        ):
            return name
    return ""


def _in_seconds(log: Log, table: Table) -> Log:
    """Return the log with clocks continued where they wrap; dates, times of day and known ticks are in seconds."""
    for name in log.names("time"):
        g, x = log.guesses[name], log.columns[name]
        x, at = clocks.unwrapped_clock(3600 * x if name in table.sexagesimal else x)
        wrap = f"; it begins again at {at}, and is taken to go on" if at else ""
        ticks = clocks.UNIT_OF_NAME.get(plain_name(name), "")
        if ticks:
            x, wrap = clocks.UNITS[ticks] * x, f", which counts {ticks}{wrap}"
        in_seconds = bool(ticks) or name in table.dates or name in table.sexagesimal
        log = log.including({name: replace(g, unit="s" if in_seconds else g.unit, why=g.why + wrap)}, {name: x})
    return log


def _by_values(log: Log, elsewhere: Set[str], hint: str) -> Log:
    """Return the log with triads and a clock among the columns that no name identified."""
    if not log.has(RATE):
        log = log.including(body_rates({name: plain_name(name) for name in log.unknown}))
    if FORCE not in elsewhere:
        similar = by_similar_names(log.unknown)
        log = log.including({n: g for n, g in similar.items() if g.quantity not in elsewhere})
    if not log.has(FORCE, RATE) and not elsewhere & {FORCE, RATE}:
        labelled = log.names("time", "temperature")
        others = {name: x for name, x in log.columns.items() if name not in labelled and is_anonymous(name)}
        computed = attitude_columns(others)  # by the unit or a tracker: neither sensors nor angles of a rig
        log = replace(log, columns={name: x for name, x in log.columns.items() if name not in computed})
        log = log.including(by_order({n: x for n, x in others.items() if n not in computed}, hint) if others else {})
    if not log.has("time") and (clock := clocks.regular_column(log)):
        why = "the column that grows evenly from row to row"
        log = log.preceded_by(clock, Guess("time", "", unit_written(plain_name(clock)), why))
    return log


def _timed_rows(log: Log) -> tuple[Log, str]:
    """Return the rows that have a time, and a note on the others."""
    timed = np.isfinite(log.columns[log.clock]) if log.has("time") else np.ones(0, dtype=bool)
    if timed.all():
        return log, ""
    return log.rows(timed), f"{np.count_nonzero(~timed)} of {len(timed)} rows have no time and are left out"


def _lost_rows(columns: Sequence[Array]) -> NDArray[np.bool_]:
    """Return in which rows (n,) three columns or more read zero, as where a packet was lost; none where most do.

    A unit that falls freely, or whose gravity was taken off, reads little in other rows, too.
    """
    if len(columns) < 3:
        return np.zeros(0, dtype=bool)
    lost = np.logical_and.reduce([x == 0 for x in columns])
    rows = int(np.count_nonzero(lost))
    if 0 < 2 * rows <= len(lost):
        read = np.sqrt(sum(x[~lost] ** 2 for x in columns))
        if np.count_nonzero(read < np.median(read) / 2) <= MAX_SHORT * rows:
            return lost
    return np.zeros_like(lost)


def _grows(x: Array) -> bool:
    """Return whether a column never falls, as a clock does; most that do fall do so within the first rows."""
    return all(bool(np.all(part[1:] >= part[:-1])) for part in (x[:FIRST_ROWS], x))


def _without_lost_rows(log: Log) -> tuple[Log, str]:
    """Return the log without rows in which all accelerometers read zero, and a note on them."""
    lost = _lost_rows(log.values(FORCE))
    if not lost.any():
        return log, ""
    return log.rows(~lost), f"{number_of(int(lost.sum()), 'row')} are left out, in which all accelerometers read zero"


def _without_held_rows(log: Log) -> tuple[Log, str]:
    """Return the log without rows that a recorder held, and a note on them.

    They repeat a row of all sensors for longer than noise does, which leaves no two of other rows alike so long: a run
    of L among n rows, of which others repeat the one before with probability p, is expected n p^(L - 1) times. Sensors
    whose readings change by single steps repeat rows at rest by themselves.
    """
    sensors = [*log.values(FORCE), *log.values(RATE)]
    if len(sensors) < 3:
        return log, ""
    alike = np.logical_and.reduce([x[1:] == x[:-1] for x in sensors])
    first, last = np.flatnonzero(np.diff(alike, prepend=False, append=False)).reshape(-1, 2).T  # of rows alike
    length = last - first + 1
    long = length >= MIN_HELD_ROWS
    if not long.any() or np.mean([step_of_most_changes(x)[0] > 0 for x in sensors]) > 0.5:
        return log, ""
    n = len(alike) + 1
    others = n - int(length[long].sum())
    p = float((length[~long] - 1).sum()) / others if others else 1.0
    held = long & (n * p ** (length - 1.0) < MIN_PROBABILITY)
    repeated = np.zeros(n, dtype=bool)
    for start, stop in zip(first[held] + 1, last[held] + 1, strict=True):
        repeated[start:stop] = True
    rows = int(np.count_nonzero(repeated))
    if not rows or 2 * rows > n:
        return log, ""
    where = f"{number_of(int(np.count_nonzero(held)), 'stretch', 'stretches')} in which the recorder held a row"
    return log.rows(~repeated), f"{number_of(rows, 'row')} are left out, {where}"


def _without_repeated_rows(log: Log) -> tuple[Log, str]:
    r"""Return the log without rows of a logger that writes more often than its sensors are read, and a note on them.

    All sensors then repeat the row before at once, about as often each time. Where each does by itself, as at rest in
    coarse steps, they do with the product of their probabilities, :math:`\ln P = \sum_c \ln p_c`; half of that is
    between the two. What repeats for as long as a rest lasts is one without noise.
    """
    sensors = [*log.values(FORCE), *log.values(RATE)]
    same = [same for x in sensors if not (same := x[1:] == x[:-1]).all()]
    alike = np.append(False, np.all(same, axis=0)) if len(same) >= 3 else np.zeros(1, dtype=bool)
    if np.mean(alike) < MIN_REPEATED or np.count_nonzero(~alike) < MIN_READ_ROWS:
        return log, ""
    together, independent = np.log(np.mean(alike[1:])), sum(np.log(max(float(np.mean(s)), 1e-9)) for s in same)
    times = np.sort(np.diff(np.flatnonzero(~alike), append=len(alike)))
    usual = times[np.searchsorted(np.cumsum(times), len(alike) / 2)]  # of a row
    if together < independent / 2 or usual > UNLIKE_REPEATS * np.median(times):
        return log, ""
    share = f"{100 * float(np.mean(alike)):.0f} % of the rows"
    return log.rows(~alike), f"{share} repeat the one before in all sensors, and are left out"


def _rows_are_dwells(log: Log) -> bool:
    """Return whether each row is the mean of a position: numbered, or with a force that turns from row to row."""
    force = log.values(FORCE)
    if len(force) != 3:
        return False
    return (_numbers_each_row(log) and len(force[0]) <= MAX_NUMBERED) or (
        _turns_each_row(force) and not _is_sampled(log)
    )


def _is_sampled(log: Log) -> bool:
    """Return whether the clock, in its likeliest unit, ticks faster than a unit is turned from rest to rest."""
    if not log.has("time") or len(log.columns[log.clock]) < 2:
        return False
    step, unit = float(np.median(np.diff(log.columns[log.clock]))), log.guesses[log.clock].unit
    if not is_unit_of("time", unit):
        unit = clocks.unit_of_time(log.columns[log.clock])[0] if step > 0 else "s"
    return 0 < step * clocks.UNITS[unit] < MIN_DWELL_STEP_S


def _numbers_each_row(log: Log) -> bool:
    """Return whether a column of positions holds another number in each row."""
    return any(len(np.unique(x)) == len(x) > 1 for x in log.values("position"))


def _turns_each_row(force: Sequence[Array]) -> bool:
    filled = filled_rows(force)
    if not 2 < len(filled[0]) <= MAX_DWELLS:
        return False
    f = np.stack(filled, axis=-1)
    step, norm = np.linalg.norm(np.diff(f, axis=0), axis=1), np.linalg.norm(f, axis=1)
    alike = np.quantile(np.abs(norm / np.median(norm) - 1), 0.9) < MAX_NORM_SPREAD
    turns = np.mean(step > MIN_STEP * np.median(norm)) > 0.5
    return bool(alike and turns and (len(f) < MIN_ELLIPSOID_ROWS or _on_an_ellipsoid(f / np.median(norm))))


def _on_an_ellipsoid(f: Array) -> bool:
    """Return whether forces (n, 3) lie on the ellipsoid through them, as means at rest do whatever the sensors are."""
    A = design(f)
    off = A @ np.linalg.lstsq(A, np.ones(len(A)), rcond=None)[0] - 1
    return bool(np.quantile(np.abs(off) / 2, 0.8) < MAX_OFF_ELLIPSOID)


def _table_of_dwells(log: Log) -> Log:
    """Return the log with angles called after turns, which in a log of samples are estimates, and its positions."""
    numbered = log.has("position")
    log = log.including({n: g for n in log.unknown if (g := by_turn(n))})
    if numbered:
        return log
    return log.preceded_by(
        "position", Guess("position", "", "", DWELL_ROWS), np.arange(1.0, len(log.values(FORCE)[0]) + 1)
    )


def _with_row_clock(path: Path, log: Log, rate: float, dwell_rows: bool, stated: tuple[float, str] | None) -> Log:
    """Return the log with a clock that counts the rows, at a rate [Hz], or if they are dwells without another clock.

    stated: the rate that a line of the log states, and that line.
    """
    why = f"--rate {rate:g}"
    if rate > 0:
        log = log.without("time")
    elif log.has("time"):
        return log
    elif dwell_rows:
        why = f"its rows, {ROW_STEP_S:g} s each as no column is a clock: rates of drift mean nothing"
    elif stated:
        rate, why = stated[0], f"its rows, {stated[0]:g} in a second as the log says ({stated[1]!r})"
    else:
        restarting = _restarting_clock(log)
        raise InputError(
            f"{path}: no column is a clock by its name ({', '.join(log.columns)}){restarting}; give --rate HZ"
        )
    rows = np.arange(len(next(iter(log.columns.values()))))
    return log.preceded_by("time", Guess("time", "", "s", why), rows / rate if rate > 0 else ROW_STEP_S * rows)


def _restarting_clock(log: Log) -> str:
    """Return where a column that grows evenly as clocks do begins again, in words; empty if none does."""
    for name, x in log.unknown.items():
        filled = np.flatnonzero(np.isfinite(x))
        back = filled[np.flatnonzero(np.diff(x[filled]) < 0) + 1]
        even = len(filled) >= MIN_CLOCK_ROWS and clocks.clock_jitter(x[filled]) < 0.5
        if even and 0 < len(back) <= MAX_RESTARTS and not clocks.counts_rows(x[filled[filled < back[0]]]):
            return f"; {name} grows as one and goes back at row {back[0] + 1}"
    return ""


def with_units(log: Log, stated: Mapping[str, str]) -> Log:
    """Return the log with units by quantity as stated, and where no name states one from the numbers.

    Where forces have the length of gravity in another unit than the one in their names, they are in that other unit.
    Those of clock and gyroscopes that follow from their numbers stay open.
    """
    log = log.including(
        {
            n: replace(g, unit=stated[g.quantity], why=f"{g.why}; --unit {g.quantity}={stated[g.quantity]}")
            for n, g in log.guesses.items()
            if g.quantity in stated
        }
    )
    names = log.names(FORCE)
    named = {log.guesses[n].unit for n in names}
    triad = filled_rows(log.values(FORCE))
    unknown = not all(is_unit_of(FORCE, unit) for unit in named)
    if unknown or (len(named) == 1 and FORCE not in stated and in_another_unit(triad, *named)):
        unit, why = unit_of_force(triad)
        log = log.including({n: replace(log.guesses[n], unit=unit, why=f"{log.guesses[n].why}; {why}") for n in names})
    rates = log.names(RATE)
    if rates and not all(is_unit_of(RATE, log.guesses[n].unit) for n in rates):
        costs = rate_costs(log)
        unit = min(costs, key=lambda u: costs[u][0])
        log = log.including({n: replace(log.guesses[n], unit=unit, open=True) for n in rates})
    force = next((log.guesses[n].unit for n in log.names(FORCE)), "m/s^2")
    for name in log.names("sigma"):
        g = log.guesses[name]
        if not is_unit_of(FORCE, g.unit):
            log = log.including({name: replace(g, unit=force, why=f"{g.why}; the unit is that of the forces")})
    g = log.guesses[log.clock]
    if not is_unit_of("time", g.unit):
        unit, why = clocks.unit_of_time(log.columns[log.clock])
        log = clocks.in_unit(log, unit)
        log = log.including({log.clock: replace(log.guesses[log.clock], why=f"{g.why}; {why}", open=True)})
    return log
