"""A recording proposed from undescribed logs: columns guessed, several logs on one clock, and the kind.

What is proposed passes the checks of every recording. Where these refuse the gyroscopes in the guessed unit and accept
them in another, that one is proposed.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from gimbalcal.checks.check import Examined, make_checks
from gimbalcal.checks.forces import lacks_gravity, unit_of_every_row
from gimbalcal.checks.input_errors import MIN_AGREEMENT, Correction
from gimbalcal.checks.measured_turns import MeasuredTurns, turns_of
from gimbalcal.checks.rates import turns_explained
from gimbalcal.checks.table import CHECKS, refuse_implausible
from gimbalcal.errors import InputError, list_of_alternatives, number_of
from gimbalcal.guess.attitude import motion_cost, turning_ratio, with_reference
from gimbalcal.guess.celestial import axis_angles, refuse_below_horizon, refuse_single_places
from gimbalcal.guess.column_guess import guess_columns, left_out_in_words, with_units
from gimbalcal.guess.column_names import by_name, is_estimated, quantity_of_log
from gimbalcal.guess.column_values import MAX_BIAS_DEG_S, changes_direction
from gimbalcal.guess.gimbal_chain import chain_among, encoder_angles, gimbal_chain
from gimbalcal.guess.log import Guess, Log
from gimbalcal.guess.merged_logs import are_parts, concatenated_logs, on_one_clock, slowest_first
from gimbalcal.guess.novatel import rawimu_counts
from gimbalcal.guess.pointing_run import (
    PointingRun,
    angles_in,
    one_axis_run,
    pointing_proposal,
    refuse_single_angles,
    with_unnamed_angles,
)
from gimbalcal.guess.space_stable import static_run
from gimbalcal.guess.stored_arrays import arrays_tables, is_text
from gimbalcal.guess.text_table import Table, head_of, table_of_files, tables_of
from gimbalcal.guess.turned_by_table import (
    TurnedLog,
    gravity_follows,
    gravity_is_constant,
    missing_table,
    orientation_note,
    turned_by_table,
)
from gimbalcal.guess.unit_candidates import unit_candidates
from gimbalcal.importers.mmt import import_mmt
from gimbalcal.importers.phd2 import import_phd2, is_guide_log
from gimbalcal.importers.tpoint import import_tpoint
from gimbalcal.number import Array
from gimbalcal.quantities import refuse_unit
from gimbalcal.recording import Recording, dwell_means, dwells, from_frame
from gimbalcal.recording.dates import Dates
from gimbalcal.recording.detection import LEAST_AT_REST
from gimbalcal.recording.dwell import UP_AND_DOWN, Dwell, in_several_attitudes, visited_positions
from gimbalcal.recording.frames import Rig
from gimbalcal.recording.record import ANGLE, FORCE, RATE

SELF_DESCRIBING = {  # its importer, and what marks a file of this kind although it is refused: the start of a line
    "TPOINT's observations": (import_tpoint, re.compile(r"\s*:\s*(ALTAZ|EQUAT)", re.IGNORECASE)),
    "a pointing run of the MMT": (import_mmt, re.compile("RAA:")),
}
MAX_BYTES = 20_000_000  # of such a file: a hundred thousand stars
MIN_MARGIN, MAX_EXCESS = 2.0, 8.0  # nats, up to which two choices of units are hardly distinguished; or one is refused
MAX_PHYSICAL_COST = 30.0  # nats, of turns none of which fits gravity
BLOCK_S, MAX_CHANGE_RAD_S = 0.5, np.radians(0.5)  # means of gyroscopes at rest change by less from one to the next
FACTOR_COST = 5.0  # nats, of turns that fit gravity at some factor of all rates
FACTORS = np.geomspace(1 / 3, 3, 89)  # of all rates, in steps of 2.5 %
MAX_TRIAL_ROWS, MAX_TRIAL_MEAN = 300_000, 5  # rows of a log that is tried in several units, and in one mean of it
MAX_DWELL_ROWS = 1000  # at either end of a dwell: enough for its mean and for the floor of the noise
GUESSED_UNITS = ("time", FORCE, RATE)
NOISE_FROM_ROWS = "taken from the rows, where nothing is stated"


class _MovingUnitError(InputError):
    """The unit never rests, or moves even where its accelerometers are quiet; no unlikely unit would change that."""


@dataclass(frozen=True)
class Proposal:
    """A recording, the guess about each column by its name in the log, columns left out, and other notes.

    notes: by the line of recording.toml that it belongs to, "kind", "platform", "noise", ... turns: between its rests.
    """

    recording: Recording
    guesses: Mapping[str, Guess]
    left_out: tuple[str, ...]
    notes: Mapping[str, str] = field(default_factory=dict)
    turns: MeasuredTurns | None = None


@dataclass(frozen=True)
class StatedByUser:
    """What a user states: the place, deg, east positive, and m, None where it is not stated; and units by quantity."""

    latitude: float | None = None
    height: float | None = None
    longitude: float | None = None
    units: Mapping[str, str] = field(default_factory=dict)

    @property
    def site(self) -> dict[str, tuple[float, str]]:
        """Return the section [site] of a recording.toml; a height without a latitude says nothing."""
        if self.latitude is None:
            return {}
        return {"latitude": (self.latitude, "deg"), **({"height": (self.height, "m")} if self.height else {})}


@dataclass(frozen=True)
class _Context:
    """What holds for the whole of a proposal, whatever units its columns turn out to have."""

    title: str
    site: Mapping[str, tuple[float, str]]
    notes: Mapping[str, str]
    left_out: tuple[str, ...]

    def recording(
        self, log: Log, platform: Rig = "bench", reversed_columns: Sequence[str] = (), kind: str = "multi-position"
    ) -> Recording:
        """Return the columns of the log that are known as a recording."""
        return from_frame(
            log.columns,
            _entries(log.guesses, reversed_columns),
            kind=kind,
            platform=platform,
            title=self.title,
            site=self.site,
            called=self.title,
        )

    def noting(self, what: str, note: str) -> _Context:
        """Return the context with another note, if it says anything."""
        return replace(self, notes={**self.notes, what: note}) if note else self

    def proposal(self, recording: Recording, log: Log, notes: Mapping[str, str]) -> Proposal:
        """Return the proposal of a recording that needs no choice of units, if it is plausible."""
        recording = replace(recording, remarks=(*recording.remarks, *refuse_implausible(recording)))
        unused = (*self.left_out, *(name for name in log.unknown if name not in self.left_out))
        left_out = tuple(name for name in unused if name not in log.guesses)
        return Proposal(recording, log.guesses, left_out, {**notes, "noise": NOISE_FROM_ROWS})


def propose_recording(
    logs: Sequence[Path],
    title: str = "",
    rate: float = 0.0,
    latitude: float | None = None,
    height: float | None = None,
    longitude: float | None = None,
    units: Mapping[str, str] | None = None,
) -> Proposal:
    """Return the recording in one log, or several of one unit.

    rate: of the rows [Hz], instead of a clock. latitude, longitude [deg] and height [m] of the place. units: by
    quantity, not guessed. Raises InputError where neither accelerometers nor the axes of a mount are found, where
    logs do not overlap, or where nothing that is guessed makes a recording, with what to write into a header by hand.
    """
    if folders := [path for path in logs if path.is_dir()]:
        raise InputError(f"{folders[0]} is a folder; give its logs, as {folders[0]}/*.csv")
    if absent := [path for path in logs if not path.is_file()]:
        raise InputError(f"{absent[0]} does not exist or is not a file; give the log of a unit")
    title = title or logs[0].stem
    place = StatedByUser(latitude, height, longitude, units or {})
    if len(logs) == 1 and (known := _self_describing(logs[0], title, place)):
        return known
    if all(map(is_text, logs)) and (of_files := table_of_files(logs)):
        return of_tables({logs[0]: of_files}, title, rate, place)
    dates = Dates()
    tables: dict[Path, Table] = {}
    for path in logs:
        if arrays := arrays_tables(path):
            tables |= arrays
        else:
            whole = rawimu_counts(path)
            tables |= {path: whole} if whole else tables_of(path, dates)
    return of_tables(tables, title, rate, place)


def of_tables(tables: Mapping[Path, Table], title: str, rate: float, place: StatedByUser) -> Proposal:
    """Return the proposal of tables by the path, or the name, of their logs, as `propose_recording` does."""
    for quantity, unit in place.units.items():
        if quantity not in GUESSED_UNITS:
            raise InputError(
                f"the unit of {quantity!r} is not guessed; {list_of_alternatives(GUESSED_UNITS)} may be stated"
            )
        refuse_unit(unit, quantity)
    first = next(iter(tables))
    if len(tables) == 1 and (pointing := _pointing(first, tables[first], title, place)):
        return pointing
    elsewhere = {
        g.quantity
        for path, table in tables.items()
        for name in table.columns
        if (g := by_name(name, quantity_of_log(path.stem)))
    }
    read = {path: guess_columns(path, table, rate, elsewhere, place.units) for path, table in tables.items()}
    skipped = sum(table.skipped for table in tables.values())
    notes = {"lines": f"{number_of(skipped, 'line')} skipped: of another kind, or empty"} if skipped else {}
    notes |= {k: f"{path.name}: {n}" for path, each in read.items() if path != first for k, n in each.notes.items()}
    if are_parts([each.log for each in read.values()]):
        whole, notes["samples"] = concatenated_logs({path: each.bare for path, each in read.items()})
        read = {first: replace(read[first], log=with_units(whole, place.units))}
        title = f"{title} and {len(tables) - 1} more" if title == first.stem else title
    (_, log), *others = slowest_first([(path, each.log) for path, each in read.items()])
    for path, other in others:
        known = {(g.quantity, g.axis) for g in log.guesses.values()}
        if further := [
            n for n in other.names(FORCE, RATE) if (other.guesses[n].quantity, other.guesses[n].axis) in known
        ]:
            notes["further"] = f"{path.name}: {left_out_in_words(further)}"
        if not tables[path].named and not other.without("time").guesses:
            raise InputError(
                f"{path}: its columns have no names, and their numbers alone do not show what they are; name them "
                "(gyro_x, gyro_y, gyro_z, temperature, ref_qw, ref_qx, ref_qy, ref_qz of a reference, the angles of a "
                "rig), or leave the log out"
            )
        log = on_one_clock(path, log, other)
    left_out = tuple(name for each in read.values() for name in each.left_out)
    context = _Context(title, place.site, {**notes, **read[first].notes}, left_out)
    missing = [a for a in "xyz" if a not in {log.guesses[n].axis for n in log.names(FORCE)}]
    if (len(missing) == 3 or gravity_is_constant(log)) and (table := turned_by_table(log)):
        return _recording_on_table(table, context)
    above = [line for table in tables.values() for line in table.above]
    rates = {log.guesses[n].axis for n in log.names(RATE)}
    if len(missing) == 3 and rates == set("xyz") and not log.has("gimbal_angle"):
        gyroscopes = context.noting("sensors", f"gyroscopes alone{missing_table(log, 'samples' in notes)}")
        return _multi_position(log, gyroscopes, above)
    if missing:
        lacking = (
            "no three columns are a triad of accelerometers or gyroscopes by their names, and no two an axis with its "
            "measurement"
            if len(missing) == 3 and not rates
            else f"no column is an accelerometer along {' and '.join(missing)} by its name"
        )
        raise InputError(
            f"{first}: {lacking} ({', '.join(tables[first].columns)}){missing_table(log, 'samples' in notes)}; name "
            "the columns acc_x, acc_y, acc_z, gyro_x, ..., time, or those of a mount az_true, el_true, az_encoder, "
            "el_encoder, or write a header and use `gimbalcal import csv`"
        )
    if still := static_run(log, place.latitude):
        recording = context.recording(still[0], "space-stable", kind="static-run")
        return context.proposal(recording, still[0], {"kind": still[1], **context.notes})
    if rates == set("xyz"):
        referenced, note = with_reference(log)
        if referenced is not None:
            return _with_attitude_reference(referenced, context.noting("rows", note), above)
        context = context.noting("attitude", note)
    try:
        return _multi_position(log, context, above)
    except _MovingUnitError:
        table = turned_by_table(log)
        if not table or not gravity_follows(table):
            raise
        return _recording_on_table(table, context)


def _pointing(path: Path, table: Table, title: str, place: StatedByUser) -> Proposal | None:
    """Return the pointing run in a table; None where it holds no pair of axes of a mount."""
    table, assumed = axis_angles(with_unnamed_angles(table), place.longitude)
    angles = angles_in(table)
    if not angles:
        guesses = [g for name in table.columns if (g := by_name(name, quantity_of_log(path.stem)))]
        axes = {(g.quantity, g.axis) for g in guesses if g.quantity in (FORCE, RATE)}
        if axes <= {(FORCE, "z")}:  # Az may be an azimuth
            refuse_single_places(path, table)
            refuse_single_angles(path, table)
        axis = None if axes else one_axis_run(path, table, title)
        return _of_run(axis, {}) if axis else None
    latitude = None if place.latitude is None else float(np.radians(place.latitude))
    run = pointing_proposal(path, table, angles, title, latitude, place.height)
    if "sidereal" in assumed:
        refuse_below_horizon(path, run.recording, assumed["sidereal"])
    return _of_run(run, assumed)


def _of_run(run: PointingRun, assumed: Mapping[str, str]) -> Proposal:
    guesses = {
        name: Guess(q, axis, run.recording.units.get((q, axis), "s"), why)
        for (q, axis), (name, why) in run.guesses.items()
    }
    return Proposal(run.recording, guesses, run.left_out, {**run.notes, **assumed})


def _self_describing(path: Path, title: str, place: StatedByUser) -> Proposal | None:
    """Return the recording in a file of a kind that describes itself; None for others.

    Raises InputError for a file with the marks of such a kind that lacks something.
    """
    if path.stat().st_size > MAX_BYTES or not is_text(path):
        return None
    head = head_of(path)
    if is_guide_log(head):
        stated = {} if place.latitude is None else {"latitude": str(place.latitude)}
        return _described_run("a guide log of PHD2", import_phd2([path], stated), title)
    for kind, (read, mark) in SELF_DESCRIBING.items():
        try:
            return _described_run(kind, read([path], {}), title)
        except InputError:
            if any(map(mark.match, head)):
                raise
    return None


def _described_run(kind: str, run: Recording, title: str) -> Proposal:
    guesses = {"time": Guess("time", "", "s", f"the form of the file, {kind}")}
    guesses |= {f"{q} {a}": Guess(q, a, "deg", f"the form of the file, {kind}") for q, a in run.channels}
    return Proposal(replace(run, title=title), guesses, (), {"kind": f"the file is {kind}"})


def _recording_on_table(table: TurnedLog, context: _Context) -> Proposal:
    """Return the recording of gyroscopes that a table turned."""
    recording = context.recording(table.log, table.platform, kind="rotation")
    kind = (
        f"rotation, gyroscopes that a table turned{orientation_note(table.log)}. Give the recordings of all mountings "
        "together"
    )
    return context.proposal(recording, table.log, {**context.notes, "kind": kind, "platform": table.why})


def _with_attitude_reference(log: Log, context: _Context, above: Sequence[str]) -> Proposal:
    """Return the recording of a unit that moved with a reference of its attitude."""
    log = replace(log, guesses={n: log.guesses[n] for n in log.names("time", FORCE, RATE, "temperature", "attitude")})
    best = min(unit_candidates(log, above), key=lambda c: c.cost + motion_cost(c.log))
    recording = context.recording(best.log, kind="rotation")
    kind = "rotation, for a reference of the attitude was logged with the sensors: --method attitude"
    return context.proposal(recording, best.log, {**context.notes, "kind": kind})


def _multi_position(log: Log, context: _Context, above: Sequence[str]) -> Proposal:
    """Return the recording of a unit at rest in several attitudes, in the units that numbers and turns make likeliest.

    A log of more rows than `MAX_TRIAL_ROWS` is tried in each choice of units by means over successive rows; once dwells
    are found in them, by `MAX_DWELL_ROWS` at either end of each. Raises InputError where the likeliest units are
    refused and no others are nearly as likely.
    """
    refused: list[tuple[float, InputError]] = []
    best: tuple[float, Proposal, Log] | None = None
    runner_up, of_means, at_rest = (np.inf, log), False, tuple[Dwell, ...]()
    whole: Log | None = None  # whose means are those of candidates with the same columns
    means, shown = log, dict[str, tuple[float, float]]()  # of the turns, by the unit of the clock
    candidates = unit_candidates(log, above)
    for candidate in candidates:
        if best and candidate.cost > best[0] + MIN_MARGIN:
            break
        if whole is None or any(whole.columns.get(n) is not x for n, x in candidate.log.columns.items()):
            whole = candidate.log
            means = whole.thinned(MAX_TRIAL_ROWS, MAX_TRIAL_MEAN) if len(candidates) > 1 else whole
            shown.clear()
        trial = candidate.log if means is whole else replace(means, guesses=candidate.log.guesses)
        cost = candidate.cost
        if log.has_open_unit(RATE):
            clock = trial.guesses[trial.clock].unit
            shown[clock] = shown.get(clock) or turning_ratio(trial)
            cost += motion_cost(trial, shown[clock])
        if best and cost > best[0] + MIN_MARGIN:
            continue
        try:
            trial = trial.shortened(at_rest, MAX_DWELL_ROWS) if at_rest else trial
            proposal, used = _tried_recording(trial, candidate.log, context)
        except InputError as problem:
            moving = isinstance(problem, _MovingUnitError)
            refused.append((cost + (MIN_MARGIN - MAX_EXCESS if moving else 0.0), problem))
            continue
        if not at_rest and used is not candidate.log and len(proposal.recording.time) == len(trial.seconds):
            at_rest = dwells(proposal.recording)
        cost += _physical_cost(proposal, log.has_open_unit("time"))
        if best is None or cost < best[0]:
            runner_up = (best[0], best[2]) if best else runner_up
            best, of_means = (cost, proposal, candidate.log), used is not candidate.log
        elif cost < runner_up[0]:
            runner_up = cost, candidate.log
    least, likeliest = min(refused, key=lambda each: each[0], default=(np.inf, InputError("")))
    if best is None or best[0] > least + MAX_EXCESS:
        if "the clock jumps back" in str(likeliest) or "the clock stands still" in str(likeliest):
            raise InputError(f"{likeliest}; or --rate HZ counts the rows, where none are missing") from None
        raise likeliest
    cost, proposal, chosen = best
    if of_means:
        del best, whole, means, trial, proposal  # half of the memory that a long log takes is free again
        proposal = _in_units(chosen, context)
    notes = dict(proposal.notes)
    if runner_up[0] < cost + MIN_MARGIN:
        other = runner_up[1].guesses
        units = {g.quantity: other[n].unit for n, g in chosen.guesses.items() if n in other and other[n].unit != g.unit}
        words = " and ".join(f"{quantity.replace('_', ' ')} in {unit}" for quantity, unit in units.items())
        options = " ".join(f"--unit {quantity}={unit}" for quantity, unit in units.items())
        notes["unit"] = f"the numbers hardly distinguish it from {words}: state it, {options}"
    explained = turns_explained(proposal.recording, proposal.turns)
    if explained and explained[0] < MIN_AGREEMENT * explained[1] and not proposal.recording.counted(FORCE):
        well, turns = explained
        notes["gyroscopes"] = common_factor(proposal.turns) or (
            f"{turns - well} of {turns} turns between rests fit gravity in no unit: are these gyroscopes, is the "
            "clock right, and are all rows there?"
        )
    elif explained and explained[0] >= MIN_AGREEMENT * explained[1] and log.has_open_unit(RATE):
        fitting = {
            n: replace(g, why=f"{g.why}; the turns between rests fit gravity in {g.unit}")
            for n, g in proposal.guesses.items()
            if g.quantity == RATE and g.unit != "count"
        }
        proposal = replace(proposal, guesses={**proposal.guesses, **fitting})
    return replace(proposal, notes=notes)


def _tried_recording(trial: Log, whole: Log, context: _Context) -> tuple[Proposal, Log]:
    """Return the recording of a log of means, or of the whole log where that is refused, and which of them it is."""
    try:
        return _in_units(trial, context), trial
    except InputError:
        if trial is whole:
            raise
        return _in_units(whole, context), whole  # dwells of a second are too short for means


def _physical_cost(proposal: Proposal, clock_is_open: bool) -> float:
    """Return how unlikely a choice of units is by the turns between rests, in nats."""
    recording, explained = proposal.recording, turns_explained(proposal.recording, proposal.turns)
    if explained is not None:
        share = explained[0] / explained[1]
        most = 1.0 if recording.counted(FORCE) else MAX_PHYSICAL_COST  # counts show the direction of gravity poorly
        most = FACTOR_COST if share < MIN_AGREEMENT and common_factor(proposal.turns) else most
        return 0.0 if share >= MIN_AGREEMENT else most * (1 - share)
    if clock_is_open and len(dwells(recording)) < 2 and recording.has(FORCE):  # a single rest shows no unit of a clock
        return 4.0 if changes_direction([recording.channels[FORCE, axis] for axis in "xyz"]) else 0.0
    return 0.0


def common_factor(turns: MeasuredTurns | None) -> str:
    """Return a sentence on the factor of all rates at which the turns fit gravity; empty where there is none."""
    if turns is None or (fitting := turns.fitting_factor(FACTORS)) is None:
        return ""
    factor, agreeing = fitting
    return (
        f"{agreeing} of {len(turns.reading)} turns between rests fit gravity at {factor:.3g} times their rate, so "
        f"the gyroscopes read {1 / factor:.2f} of what turned, all alike, as where the range is another than the "
        "one that was read; the calibration finds it as a scale error"
    )


def _in_units(log: Log, context: _Context) -> Proposal:
    """Return the multi-position recording of a log whose units are chosen, with its rig if gravity shows one."""
    notes, platform = dict(context.notes), None
    angles, counts = encoder_angles(_angle_candidates(log))
    log = replace(log, columns={**log.columns, **angles})
    chain, gimbals, outside = _rig(log, context)
    gimbals = {
        n: replace(g, why=f"{counts[n]} counts a turn; {g.why}") if n in counts else g for n, g in gimbals.items()
    }
    reversed_columns: list[str] = []
    if chain is not None:
        log = log.including(gimbals)
        platform, notes["platform"] = chain.platform, chain.words
        column_of = {log.guesses[n].axis: n for n in log.names("gimbal_angle")}
        if len(column_of) == 1:
            notes["platform"] += (
                "; turns about one axis show few errors: mount the unit otherwise too for the others; steady turns "
                "calibrate gyroscopes, --method rate-table, all mountings together"
            )
        reversed_columns = [column_of[axis] for axis in chain.reversed(ANGLE) if axis in column_of]
        reversed_columns += log.names(FORCE) if chain.reversed(FORCE) else []
    used = replace(log, guesses={name: g for name, g in log.guesses.items() if name not in outside})
    recording = context.recording(used, platform or "bench", reversed_columns)
    examined = Examined(recording)
    explained = turns_explained(recording, examined.once(turns_of))
    unfit = explained is not None and explained[0] < MIN_AGREEMENT * explained[1]  # then these are no gyroscopes
    removed = 0
    if log.has(FORCE) and not log.has("position") and not unfit:
        recording, removed = without_moving_rests(recording)
        examined = Examined(recording) if removed else examined
    rests = len(dwells(recording))
    if removed:
        quiet = number_of(removed, "quiet stretch", "quiet stretches")
        notes["rests"] = f"{quiet} in which the gyroscopes turn are no rests"
    if not rests:
        if log.has(FORCE) and not recording.counted(FORCE) and lacks_gravity(examined):
            raise _MovingUnitError(f"{context.title}: {unit_of_every_row(examined)}")
        turn = "; where the accelerometers are quiet the gyroscopes show turns" if removed else ""
        hold = "hold the unit still for some seconds in each of six or more attitudes"
        hold = hold if log.has(FORCE) else "leave the gyroscopes alone for some minutes for `gimbalcal noise`"
        own = f"; {attitude}" if (attitude := notes.get("attitude")) else ""
        raise _MovingUnitError(
            f"{context.title}: no rest is found that lasts a second and takes some {100 * LEAST_AT_REST:g} % of the "
            f'time{turn}; {hold}, or write a header with kind = "rotation" and use `gimbalcal import csv`{own}'
        )
    if platform is None and log.has(FORCE):
        notes["signs"] = (
            "an axis that points up is taken to read +g, as accelerometers do; where a log holds gravity itself, write "
            "sign = -1 at all three: no rest shows it"
        )
    if not log.has(FORCE):
        at_rest = (recording.triad(RATE, rows=d.rows) for d in dwells(recording))
        rates = [np.median(w, axis=0) for w in at_rest]  # of a steady turn each
        turns = np.degrees(np.linalg.norm(rates, axis=1))
        turns = turns[turns > (np.inf if recording.counted(RATE) else MAX_BIAS_DEG_S)]
        where = "throughout" if len(turns) == rests else f"in {len(turns)} of {rests} rests"
        notes["kind"] = "gyroscopes without accelerometers are enough for `gimbalcal noise`" + (
            f"; they read {np.median(turns):.4g} deg/s {where}, a turn: a column with the angle or the rate of the "
            "table that turned them would calibrate them"
            if len(turns)
            else "; they are taken as at rest"
        )
    positions = visited_positions(recording)
    where = f" at {number_of(positions, 'position')}" if 0 < positions < rests else ""
    are_found = f"{number_of(rests, 'rest')}{where} {'is' if rests == 1 else 'are'} found"
    single = f"{are_found}: enough for `gimbalcal noise`; a calibration takes six or more in different attitudes"
    several = f"multi-position, for {are_found}; rotation is for turns that are navigated sample by sample"
    notes.setdefault("kind", several if in_several_attitudes(recording, UP_AND_DOWN) else single)
    notes["noise"] = NOISE_FROM_ROWS
    if rests == len(recording.time) and not log.has("sigma"):
        state = 'accelerometer = { value = 10, unit = "ug" }'
        notes["noise"] = f"a row for each rest shows no noise: state it, {state} of such a row"
    if log.has("gimbal_angle"):
        state = 'gimbal_angle = { value = 1, unit = "arcsec" }'
        notes["noise"] += f"; state how well positions are set: {state}, no row shows it"
    recording = replace(recording, remarks=(*recording.remarks, *make_checks(examined, CHECKS)))
    left_out = (*(n for n in context.left_out if n not in gimbals), *outside)
    return Proposal(recording, used.guesses, left_out, notes, examined.once(turns_of))


def without_moving_rests(recording: Recording) -> tuple[Recording, int]:
    """Return the recording without the rests in which its gyroscopes turn, and their number.

    At rest the means of half a second are alike; a vehicle that drives smoothly, or a hand that turns slowly, is quiet
    to accelerometers alone.
    """
    if not recording.has(RATE) or recording.counted(RATE) or recording.position is None or len(recording.time) < 2:
        return recording, 0
    visits = dwells(recording)
    block = max(1, round(BLOCK_S / recording.step))
    kept = []
    for d in visits:
        w = recording.triad(RATE, rows=d.rows)
        means = np.array([part.mean(axis=0) for part in np.array_split(w, max(1, len(w) // block))])
        noise = np.median(np.abs(np.diff(w, axis=0)), axis=0).max() / np.sqrt(block) if len(w) > 1 else 0.0
        kept.append(bool(means.std(axis=0).max() - 2 * noise < MAX_CHANGE_RAD_S))
    position = np.zeros_like(recording.position)
    for number, (d, still) in enumerate(zip(visits, kept, strict=True)):
        position[d.rows] = 1 + sum(kept[:number]) if still else 0
    removed = len(kept) - sum(kept)
    return (replace(recording, position=position) if removed else recording), removed


def _angle_candidates(log: Log) -> dict[str, Array]:
    """Return columns that may be angles of a rig although nothing calls them so."""
    return {n: x for n, x in log.unknown.items() if np.all(np.isfinite(x)) and not is_estimated(n)}


def _rig(log: Log, context: _Context) -> tuple[Correction | None, dict[str, Guess], tuple[str, ...]]:
    """Return the rig, gimbals that are found by their content, and columns called gimbals that no platform has."""
    named = log.names("gimbal_angle")
    unknown, chain = _angle_candidates(log) if log.has(FORCE) else {}, None
    if named:
        axes = [log.guesses[n].axis for n in named]
        platform = {"axes": [{"name": axis, "direction": "zxy"[k % 3]} for k, axis in enumerate(axes)]}
        means = dwell_means(context.recording(log, platform))
        chain = gimbal_chain({a: means.channels["gimbal_angle", a] for a in axes}, means.triad(FORCE))
        if chain.platform is not None:
            return chain, {}, ()
        if not unknown:
            return chain, {}, tuple(named)
        unknown |= {n: log.columns[n] for n in named}
    if not unknown:
        return None, {}, ()
    covariates = {n: Guess("covariate", f"u{i}", "1", "") for i, n in enumerate(unknown)}
    free = context.recording(log.without("gimbal_angle").including(covariates))
    if not in_several_attitudes(free):  # any small angle would go with the force
        return chain, {}, tuple(named)
    columns = {n: free.channels["covariate", g.axis] for n, g in covariates.items()}
    among = chain_among(columns, [d.rows for d in dwells(free)], dwell_means(free).triad(FORCE))
    if among is None:
        return chain, {}, tuple(named)
    why = "standing still at rests, and gravity goes as it says"
    gimbals = {n: Guess("gimbal_angle", axis, unit, why) for n, (axis, unit) in among[1].items()}
    return among[0], gimbals, tuple(n for n in named if n not in gimbals)


def _entries(guesses: Mapping[str, Guess], reversed_columns: Sequence[str]) -> dict[str, dict[str, object]]:
    """Return columns as a recording.toml has them."""
    return {
        name: {
            "quantity": g.quantity,
            **({"axis": g.axis} if g.axis and g.quantity != "sigma" else {}),
            **({"of": FORCE} if g.quantity == "sigma" else {}),
            **({"unit": g.unit} if g.unit else {}),
            **({"sign": -1} if name in reversed_columns else {}),
        }
        for name, g in guesses.items()
    }
