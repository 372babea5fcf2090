"""Read a recording folder: every row is checked as it streams by; the memory needed is that of the result."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from datetime import date
from math import ceil, pi
from pathlib import Path

import numpy as np

from gimbalcal.checks import column_checks
from gimbalcal.checks.check import make_checks
from gimbalcal.checks.dropouts import Dropouts
from gimbalcal.checks.jitter import MAX_ROUGHNESS, MIN_JITTER, jitter_of, regular_clock
from gimbalcal.checks.stream_checks import StreamChecks
from gimbalcal.errors import InputError, number_of
from gimbalcal.number import Array
from gimbalcal.recording.columns import SPARSE, UNITLESS, Column
from gimbalcal.recording.dates import Dates
from gimbalcal.recording.detection import MAX_NOISE_SHARE, detect_rests
from gimbalcal.recording.header import Header, read_header
from gimbalcal.recording.increments import Increments
from gimbalcal.recording.memory_limit import rows_in
from gimbalcal.recording.noise_levels import Scatter
from gimbalcal.recording.record import ANGLES, Recording, Source
from gimbalcal.recording.row_sigma import by_sigma
from gimbalcal.recording.samples import Batch, batches, column
from gimbalcal.recording.streamed_rows import AllRows, Blocks, Rests
from gimbalcal.units import celsius, from_si, is_raw, to_si

_DETECTED = Column(" position", "position", "", "1")  # a name that no header can hold


def read(folder: str | Path, average_s: float | None = None, most: int | None = None) -> Recording:
    """Return the recording in `folder`, in SI; with `average_s`, means over blocks of that many seconds.

    Blocks never reach across a gap or a change of position; `weight` says how many samples each row stands for. The
    rests of a multi-position recording of more than `most` rows come as means over so many rows that `SHARE_KEPT` of
    `most` are left, in bounded memory; what is on the way between them stays as it is. A multi-position recording
    without a position column is searched for dwells (see `detection`). `InputError` says in one sentence what is wrong
    with the folder, and where.
    """
    if average_s is not None and not average_s > 0:
        raise InputError(f"the time to average over must be positive, got {average_s} s")
    header, dates = read_header(Path(folder)), Dates()
    clock = header.column("time")
    stream = batches(header.samples, [c.name for c in header.columns], clock, dates)
    rests = 1 if average_s or not most else rows_of_a_mean(header, most)
    recording = assemble_recording(
        header, stream, lambda name: column(header.samples, name, clock), average_s, rests=rests
    )
    remarks = (RESTS.format(path=header.samples, rows=rests),) if rests > 1 else ()
    return with_dates(replace(recording, remarks=(*recording.remarks, *remarks)), header, dates)


SHARE_KEPT = 0.01  # of the most rows that are kept as they are: a diagnosis holds a hundred numbers for each
RESTS = "{path}: so many rows that each rest is kept as means over {rows} rows; what is on the way stays as it is"


def rows_of_a_mean(header: Header, most: int) -> int:
    """Return the rows over which dwells are averaged so that a recording of more than `most` rows fits; 1 if it does.

    Rests that are still to be found need every row.
    """
    if not header.kind.in_positions or not header.column("position"):
        return 1
    rows = rows_in(header.samples)
    return 1 if rows <= most else ceil(rows / (SHARE_KEPT * most))


def with_dates(recording: Recording, header: Header, dates: Dates) -> Recording:
    """Return the recording with its day and a remark on the zero of its seconds, where the clock held dates."""
    clock = header.column("time")
    if clock is None or dates.zoned is None:
        return recording
    remark = f"{header.samples}, column {clock.name}: dates, taken as seconds since {dates.start}"
    day = recording.date or dates.day
    known = dates.day or recording.date[:10]  # of times of a day the header may say which
    epoch = (date.fromisoformat(known) - date(1970, 1, 1)).total_seconds() if known else None
    other_sensors = tuple(replace(other, date=day, epoch=epoch) for other in recording.other_sensors)
    return replace(recording, remarks=(*recording.remarks, remark), date=day, epoch=epoch, other_sensors=other_sensors)


def assemble_recording(
    header: Header,
    stream: Iterable[Batch],
    whole: Callable[[str], Array],
    average_s: float | None,
    made_from: tuple[Source, ...] | None = None,
    rests: int = 1,
) -> Recording:
    """Return the recording whose rows are `stream`, checked; `whole` gives one complete column for a second look.

    made_from: what the rows came from, if not from the files of the header; rests: rows in a mean of a rest.
    """
    with ThreadPoolExecutor(1) as pool:  # hashing leaves the interpreter free
        files = (header.path, header.samples)
        digests = pool.map(Source.of, files, map(str, files)) if made_from is None else made_from
        dropouts = Dropouts(header)
        header, stream = by_sigma(header, dropouts.filled(stream), dropouts)
        increments = Increments(header, dropouts)
        columns, table, scatter, remarks = _rows(
            increments, increments.rates(stream), whole, average_s, dropouts, rests
        )
        source = tuple(digests)
    numbers = next((table.pop(c.name) for c in columns if c.quantity == "position"), None)
    position = numbers if numbers is None or numbers.dtype == np.int64 else np.rint(numbers).astype(np.int64)
    measured = [c for c in columns if c.quantity not in ("time", *UNITLESS)]
    weight = np.array(table.get(next((c.name for c in columns if c.quantity == "weight"), ""), ()), dtype=float)
    clock = next(c for c in columns if c.quantity == "time")
    time, values = _si(clock, table[clock.name]), {c.name: _si(c, table[c.name]) for c in measured}
    recordings = [
        Recording(
            kind=header.kind,
            title=f"{header.title} ({sensor})" if sensor else header.title,
            platform=header.platform,
            site=header.site,
            noise={**header.noise, **header.noise_of.get(sensor, {})},
            time=time,
            position=position,
            channels={c.key: values[c.name] for c in own},
            source=source,
            weight=weight,
            units={c.key: c.unit for c in own},
            scatter={c.key: to_si(scatter[c.name], c.unit) for c in own if c.name in scatter},
            remarks=header.remarks + remarks,
            sensor=sensor,
            instant=header.instant,
            corrected=header.corrected,
            date=header.date,
        )
        for sensor, own in _by_sensor(measured).items()
    ]
    return replace(recordings[0], other_sensors=tuple(replace(other, remarks=()) for other in recordings[1:]))


def _by_sensor(columns: Sequence[Column]) -> dict[str, tuple[Column, ...]]:
    """Return the columns of each sensor: its own, and of the quantities that it lacks those without a sensor."""
    names = list(dict.fromkeys(c.sensor for c in columns))
    triads = [c for c in columns if c.quantity in ("specific_force", "angular_rate")]
    several = {c.quantity for c in triads if c.sensor}
    if any(names) and not any(c.quantity in several and not c.sensor for c in triads):
        names = [name for name in names if name]  # what no sensor is named for belongs to all
    out = {}
    for name in names or [""]:
        own = {c.quantity for c in columns if c.sensor == name}
        out[name] = tuple(c for c in columns if c.sensor == name or (not c.sensor and c.quantity not in own))
    return out


def _rows(
    increments: Increments,
    stream: Iterable[Batch],
    whole: Callable[[str], Array],
    average_s: float | None,
    dropouts: Dropouts,
    rests: int,
) -> tuple[tuple[Column, ...], dict[str, Array], dict[str, float], tuple[str, ...]]:
    """Return columns, rows and scatter in the units of the file, and remarks."""
    header, whole = increments.header, increments.whole(whole)
    checks = StreamChecks(header, whole, dropouts)
    if not header.kind.in_positions or header.column("position"):
        table, scatter = _gather_rows(stream, header.columns, checks, average_s, rests)
        regular_clock = () if average_s or rests > 1 else _on_a_regular_clock(increments, table, checks)
        return header.columns, table, scatter, (*dropouts.remarks(), *checks.remarks(), *regular_clock)
    columns = (*header.columns, _DETECTED)
    table, _ = _gather_rows(stream, header.columns, checks, None)
    forces = [c for c in checks.sensors if c.quantity == "specific_force"]
    sensors = {c.name: table[c.name] for c in forces or checks.sensors}
    gyros = [c for c in checks.sensors if c.quantity == "angular_rate" and forces]
    unit = gyros[0].unit if gyros else "rad/s"  # where columns have several units, others are converted
    rates = {c.name: _in_unit(table[c.name], c.unit, unit) for c in gyros}
    size = 0.0 if any(is_raw(c.unit) for c in gyros) else to_si(1.0, unit)
    time = _in_unit(table[checks.clock.name], checks.clock.unit, "s")
    position = detect_rests(time, sensors, rates, size, bool(forces))
    table[_DETECTED.name] = position
    count, dwells = int(position.max(initial=0)), int(np.count_nonzero(np.diff(position, prepend=0) * position))
    at = f" at {number_of(count, 'position')}" if count < dwells else ""
    remark = (
        f"{header.samples}: there is no position column; {number_of(dwells, 'dwell')}{at} found where the "
        "sensors are quiet, numbered in order of time"
        if position.any()
        else f"{header.samples}: the unit is never at rest: its quietest stretches scatter more the longer they "
        f"are, as a motion does, or by more than {100 * MAX_NOISE_SHARE:g} % of the force in a row, as vibration does"
    )
    numbered = StreamChecks(replace(header, columns=columns), whole, dropouts)
    numbered.sensors, numbered.angles = [], []  # they have passed
    table, scatter = _gather_rows([table], columns, numbered, average_s)
    regular_clock = () if average_s else _on_a_regular_clock(increments, table, checks)
    return columns, table, scatter, (*dropouts.remarks(), *checks.remarks(), remark, *regular_clock)


def _on_a_regular_clock(increments: Increments, table: dict[str, Array], checks: StreamChecks) -> tuple[str, ...]:
    """Correct the clock of `table` where its stamps are times of arrival; return a remark. See `jitter`."""
    header, dropouts, clock = increments.header, checks.dropouts, checks.clock
    if not clock.regular and checks.longest - checks.shortest < 2 * MIN_JITTER * checks.shortest:
        return ()  # the scatter of the steps is at most half their range
    own = [table[c.name] for c in header.columns if c.quantity == "angular_rate"]
    own = own or [table[c.name] for c in header.columns if c.quantity == "specific_force"]
    if any(c.increments and c.quantity == "angular_rate" for c in header.columns):
        own = [x * increments.interval for x in own]  # by a clock that jitters they would be rough as rates
    time, column = to_si(table[clock.name], clock.unit), f"{header.samples}, column {clock.name}"
    if clock.regular:
        fitted = regular_clock(time, dropouts.kept, stated=True)
        if fitted is None:
            raise InputError(
                f"{column}: the stamps are those of no regular clock; take regular = true out of [columns]"
            )
        table[clock.name] = from_si(fitted, clock.unit)
        increments.on_clock(table, fitted)
        return (f"{column}: a regular clock is laid through the stamps, as [columns] asks for",)
    jitter = None if clock.regular is False or header.kind.sighting else jitter_of(time, dropouts.kept, own)
    if jitter is None or jitter.roughness > MAX_ROUGHNESS:
        return ()
    what = (
        f"{column}: the steps scatter by {100 * jitter.scatter:.2g} %, and the readings are {jitter.roughness:.2g} "
        f"times as rough on a regular clock of {jitter.rate:.6g} Hz: the stamps are times of arrival"
    )
    if jitter.clock is None:
        return (f"{what}, but they follow no regular clock closely: log the sensor's own counter as well",)
    table[clock.name] = from_si(jitter.clock, clock.unit)
    increments.on_clock(table, jitter.clock)
    return (f"{what}, and that clock is used; regular = false in [columns] keeps the stamps",)


def _gather_rows(
    stream: Iterable[Batch], columns: tuple[Column, ...], checks: StreamChecks, average_s: float | None, rests: int = 1
) -> tuple[dict[str, Array], dict[str, float]]:
    """Check every row and keep it, whole or in means; return the columns and the scatter."""
    weight = next((c.name for c in columns if c.quantity == "weight"), None)
    position = next((c.name for c in columns if c.quantity == "position"), None)
    kept: AllRows | Blocks = AllRows(rows_in(checks.header.samples), position)
    turns = {c.name: float(from_si(2 * pi, c.unit)) for c in columns if c.quantity in ANGLES}
    if average_s is not None:
        kept = Blocks(from_si(average_s, checks.clock.unit), checks.clock.name, weight, turns)
    elif rests > 1 and position:
        kept = Rests(rests, position, weight, turns)
    measured = [c.name for c in columns if c.quantity not in ("time", *UNITLESS, *SPARSE)]
    scatter = Scatter(np.array([turns.get(name, np.inf) for name in measured]))
    for batch in stream:
        begins = checks.see(batch)
        still = batch[position] > 0 if position else np.ones(len(begins), dtype=bool)
        weights = batch[weight] if weight else np.ones(len(begins))
        scatter.add([batch[name] for name in measured], begins, weights, still)
        kept.add(batch, begins)
    checks.scatter = dict(zip(measured, scatter.sigma(), strict=False))
    make_checks(checks, column_checks.CHECKS)
    return kept.table(), checks.scatter


def _in_unit(values: Array, unit: str, wanted: str) -> Array:
    """Return values in another unit, the same array where it is their own."""
    return values if unit == wanted else from_si(to_si(values, unit), wanted)


def _si(each: Column, values: Array) -> Array:
    """Return values in SI, in their own array where it may be written to."""
    if each.quantity == "temperature":
        return celsius(values, each.unit)
    factor = each.sign * to_si(1.0, each.unit)
    own = values if values.flags.writeable else None
    return values if own is not None and factor == 1.0 else np.multiply(values, factor, out=own)
