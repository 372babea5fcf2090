"""A log that nobody described yet: read, its columns guessed, several logs on one clock, and what kind it is.

What is proposed passes the checks of every recording. Where these refuse the gyroscopes in the guessed unit and take
them in another, that one is proposed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from gimbalcal.checks.axes import NEARLY_ALL
from gimbalcal.checks.rates import turns_explained
from gimbalcal.checks.table import refuse_implausible
from gimbalcal.errors import InputError
from gimbalcal.guess import gimbal_chain, log_parts
from gimbalcal.guess.celestial import of_the_axes, refuse_below_horizon
from gimbalcal.guess.column_guess import guessed
from gimbalcal.guess.column_names import FORCE, Guess, by_name, estimated, hinted
from gimbalcal.guess.merged_logs import Columns, on_one_clock, slowest_first
from gimbalcal.guess.novatel import rawimu
from gimbalcal.guess.pointing_run import angles_in, pointing_proposal
from gimbalcal.guess.rate_table import OnTable, gravity_stays, lacking, on_table, upright
from gimbalcal.guess.static_run import as_static_run
from gimbalcal.guess.text_table import Table, tables_of
from gimbalcal.guess.unit_candidates import in_likely_units, is_open
from gimbalcal.importers.mmt import import_mmt
from gimbalcal.importers.tpoint import import_tpoint
from gimbalcal.number import Array
from gimbalcal.platform import Platform
from gimbalcal.recording import Recording, dwell_means, dwells, from_frame
from gimbalcal.recording.dates import Dates

FOREIGN = {
    "TPOINT's observations": import_tpoint,
    "a pointing run of the MMT": import_mmt,
}  # files that name themselves


@dataclass(frozen=True)
class Proposal:
    """A recording, what each column is taken for (by its name in the log), columns left out, and what else was guessed.

    notes: by the line of recording.toml that it belongs to, "kind", "platform", "noise", ...
    """

    recording: Recording
    guesses: Mapping[str, Guess]
    left_out: tuple[str, ...]
    notes: Mapping[str, str] = field(default_factory=dict)


def propose(
    logs: Sequence[Path], title: str = "", rate: float = 0.0, latitude: float | None = None,
    height: float | None = None, longitude: float | None = None,
) -> Proposal:  # fmt: skip
    """The recording in one log or several of one unit; rate [Hz] of its rows instead of a clock; the place, deg and m.

    Raises InputError where neither accelerometers nor the axes of a mount are found, where logs do not overlap, or
    where nothing that is guessed makes a recording, with what to write into a header by hand.
    """
    if folders := [path for path in logs if path.is_dir()]:
        raise InputError(f"{folders[0]} is a folder; give its logs, as {folders[0]}/*.csv")
    if absent := [path for path in logs if not path.is_file()]:
        raise InputError(f"{absent[0]} does not exist or is not a file; give the log of a unit")
    title = title or logs[0].stem
    if len(logs) == 1 and (known := _foreign(logs[0], title)):
        return known
    dates = Dates()
    tables: dict[Path, Table] = {}
    for path in logs:
        raw = rawimu(path)
        tables |= {path: raw} if raw else tables_of(path, dates)
    return of_tables(tables, title, rate, latitude, height, longitude)


def of_tables(logs: Mapping[Path, Table], title: str, rate: float = 0.0, latitude: float | None = None,
              height: float | None = None, longitude: float | None = None) -> Proposal:  # fmt: skip
    """As `propose`, of tables by the path, or the name, of their logs."""
    paths, place = list(logs), None if latitude is None else float(np.radians(latitude))
    stars, assumed = of_the_axes(logs[paths[0]], longitude) if len(logs) == 1 else (Table({}), {})
    if angles := angles_in(stars):
        run = pointing_proposal(paths[0], stars, angles, title, place, height)
        if "sidereal" in assumed:
            refuse_below_horizon(paths[0], run.recording, assumed["sidereal"])
        guesses = {name: Guess(q, axis, run.recording.units.get((q, axis), "s"), why)
                   for (q, axis), (name, why) in run.guesses.items()}  # fmt: skip
        return Proposal(run.recording, guesses, run.left_out, {**run.notes, **assumed})
    named = {g.quantity for path, table in logs.items() for n in table.columns if (g := by_name(n, hinted(path.stem)))}
    read = {path: guessed(path, table, rate, named) for path, table in logs.items()}
    follow = ""
    if log_parts.alike({path: each[1] for path, each in read.items()}):
        clock = next(n for n, g in read[paths[0]][1].items() if g.quantity == "time")
        whole, follow = log_parts.joined(logs, clock, rate)
        read = {paths[0]: guessed(paths[0], whole, 0.0, named)}
        title = f"{title} and {len(logs) - 1} more" if title == paths[0].stem else title
    (_, (columns, guesses)), *others = slowest_first([(path, each[:2]) for path, each in read.items()])
    left, notes = [name for each in read.values() for name in each[2]], {**read[paths[0]][3]}
    if follow:
        notes["samples"] = follow
    for path, other in others:
        columns, guesses = on_one_clock(path, (columns, guesses), other)
    missing = [a for a in "xyz" if not any((g.quantity, g.axis) == (FORCE, a) for g in guesses.values())]
    site = {} if latitude is None else {"latitude": (latitude, "deg"), **({"height": (height, "m")} if height else {})}
    if (len(missing) == 3 or gravity_stays(columns, guesses)) and (table := on_table((columns, guesses))):
        return _turned(table, title, site, notes, left)
    if missing:
        raise InputError(
            f"{paths[0]}: no column is an accelerometer along {' and '.join(missing)} by its name "
            f"({', '.join(logs[paths[0]].columns)}){lacking(guesses, bool(follow))}; name the columns "
            "acc_x, acc_y, acc_z, gyro_x, ..., time, or those of a mount az_true, el_true, az_encoder, el_encoder, or "
            "write a header and use `gimbalcal import csv`"
        )
    if alone := as_static_run(columns, guesses, latitude):
        return _static_run((columns, alone[0]), title, site, {"kind": alone[1], **notes}, left)
    above = [line for table in logs.values() for line in table.above]
    fallback: Proposal | None = None
    refused: InputError | None = None
    for log in in_likely_units(columns, guesses, above):
        try:
            made, told, (gimbals, outside) = _made(log, title, site, notes)
        except InputError as problem:
            refused = refused or problem
            continue
        held = {n: x for n, x in {**log[1], **gimbals}.items() if n not in outside}
        unused = (*(n for n in left if n not in gimbals), *outside)
        proposal = Proposal(made, held, unused, told)
        explained = turns_explained(made)
        lone = is_open(guesses, "time") and len(dwells(made)) < 2
        if not lone and (explained is None or explained[0] >= NEARLY_ALL * explained[1]):
            return proposal
        if refused is None and fallback is None:  # another unit has to be told
            fallback = proposal
            if explained is not None:
                well, turns = explained
                unfit = f"{turns - well} of {turns} turns between rests fit gravity in no unit: are they gyroscopes?"
                fallback = replace(proposal, notes={**told, "gyroscopes": unfit})
    if fallback is not None:
        return fallback
    assert refused is not None
    if "the clock jumps back" in str(refused) or "the clock stands still" in str(refused):
        raise InputError(f"{refused}; or --rate HZ counts the rows, where none are missing") from None
    raise refused


def _static_run(log: Columns, title: str, site: Mapping[str, tuple[float, str]], notes: Mapping[str, str],
                left: Sequence[str]) -> Proposal:  # fmt: skip
    """The recording of a platform that was left alone among the stars."""
    columns, guesses = log
    made = from_frame(columns, _entries(guesses), title=title, called=title, kind="static-run", site=site,
                      platform="space-stable")  # fmt: skip
    told = {**notes, "noise": "taken from the rows, where nothing is stated"}
    made = replace(made, remarks=(*made.remarks, *refuse_implausible(made)))
    unused = (*left, *(n for n in columns if n not in guesses and n not in left))
    return Proposal(made, guesses, unused, told)


def _turned(table: OnTable, title: str, site: Mapping[str, tuple[float, str]], notes: Mapping[str, str],
            left: Sequence[str]) -> Proposal:  # fmt: skip
    """The recording of gyroscopes that a table turned."""
    made = from_frame(table.columns, _entries(table.guesses), title=title, called=title, kind="rotation", site=site,
                      platform=_spelt(table.platform))  # fmt: skip
    told = {
        **notes,
        "kind": f"rotation, gyroscopes that a table turned{upright(table.guesses)}. Give the recordings of all "
                "mountings together",
        "platform": table.why,
        "noise": "taken from the rows, where nothing is stated",
    }  # fmt: skip
    made = replace(made, remarks=(*made.remarks, *refuse_implausible(made)))
    unused = (*left, *(n for n in table.columns if n not in table.guesses and n not in left))
    return Proposal(made, table.guesses, tuple(n for n in unused if n not in table.guesses), told)


def _foreign(path: Path, title: str) -> Proposal | None:
    """The recording in a file of a kind that names itself."""
    for what, importer in FOREIGN.items():
        try:
            run = importer([path], {})
        except (InputError, UnicodeDecodeError, OSError):
            continue
        guesses = {f"{q} {a}": Guess(q, a, "deg", f"the form of the file, {what}") for q, a in run.channels}
        return Proposal(replace(run, title=title), guesses, (), {"kind": f"the file is {what}"})
    return None


def _made(
    log: Columns, title: str, site: Mapping[str, tuple[float, str]], notes: Mapping[str, str]
) -> tuple[Recording, dict[str, str], tuple[dict[str, Guess], tuple[str, ...]]]:
    """The recording, what was guessed of the whole, gimbals found by what they hold, and gimbal columns left out."""
    columns, guesses = log
    gimbals = {g.axis: name for name, g in guesses.items() if g.quantity == "gimbal_angle"}
    told, platform = dict(notes), None
    turning, counts = gimbal_chain.turned_counts(_unknown(columns, guesses))
    columns = {**columns, **turning}
    found, theirs, outside = _rig(columns, guesses, gimbals, title)
    theirs = {n: replace(g, why=f"{counts[n]} counts a turn; {g.why}") if n in counts else g for n, g in theirs.items()}
    reverse: tuple[str, ...] = ()
    turned: tuple[str, ...] = ()
    if found is not None:
        guesses, gimbals = {**guesses, **theirs}, {**gimbals, **{g.axis: name for name, g in theirs.items()}}
        told["platform"], turned, platform = found.why, found.backwards, found.platform
        if len(gimbals) == 1:
            told["platform"] += "; turns about one axis show few errors: mount the unit otherwise too for the others; "
            told["platform"] += "steady turns calibrate gyroscopes, --method rate-table, all mountings together"
        reverse = tuple(n for n, g in guesses.items() if g.quantity == FORCE) if found.reversed else ()
    kept = {name: g for name, g in guesses.items() if name not in outside}
    made = from_frame(columns, _entries(kept, (*(gimbals[a] for a in turned), *reverse)), title=title, called=title,
                      platform=_spelt(platform), site=site)  # fmt: skip
    if platform is None:
        told["signs"] = (
            "an axis that points up is taken to read +g, as accelerometers do; where a log holds gravity itself, write "
            "sign = -1 at all three: no rest tells it"
        )
    rests = len(dwells(made))
    if not rests:
        raise InputError(
            f"{title}: the unit is never at rest for a second; hold it still for some seconds in each of six or more "
            'attitudes, or write a header with kind = "rotation" and use `gimbalcal import csv`'
        )
    if rests < 2:
        told["kind"] = (
            "1 rest is found: enough for `gimbalcal noise`; a calibration takes six or more in different attitudes"
        )
    told.setdefault(
        "kind",
        f"multi-position, for {rests} rests are found; rotation is for turns that are navigated sample by sample",
    )
    alone = rests == len(made.time) and not any(g.quantity == "sigma" for g in guesses.values())
    told["noise"] = (
        'a row for each rest shows no noise: state it, accelerometer = { value = 10, unit = "ug" } of such a row'
        if alone
        else "taken from the rows, where nothing is stated"
    ) + (
        '; state how well positions are set: gimbal_angle = { value = 1, unit = "arcsec" }, no row shows it'
        if gimbals
        else ""
    )
    remarks = refuse_implausible(made)
    return replace(made, remarks=(*made.remarks, *remarks)), told, (theirs, outside)


def _unknown(columns: Mapping[str, Array], guesses: Mapping[str, Guess]) -> dict[str, Array]:
    """Columns that may be angles of a rig although nothing calls them so."""
    return {n: x for n, x in columns.items() if n not in guesses and np.all(np.isfinite(x)) and not estimated(n)}


def _rig(columns: Mapping[str, Array], guesses: Mapping[str, Guess], gimbals: Mapping[str, str], title: str
         ) -> tuple[gimbal_chain.Rig | None, dict[str, Guess], tuple[str, ...]]:  # fmt: skip
    """The rig, gimbals that are found by what they hold, and columns called gimbals that no platform has."""
    chain = {"axes": [{"name": axis, "direction": "zxy"[k % 3]} for k, axis in enumerate(gimbals)]}
    unknown = _unknown(columns, guesses)
    found = None
    if gimbals:
        still = dwell_means(from_frame(columns, _entries(guesses), title=title, platform=chain, called=title))
        found = gimbal_chain.rig_of({a: still.channels["gimbal_angle", a] for a in gimbals}, still.triad(FORCE))
        if found.platform is not None or not unknown:
            return found, {}, () if found.platform is not None else tuple(gimbals.values())
        unknown |= {n: columns[n] for n in gimbals.values()}
    if not unknown:
        return None, {}, ()
    bare = _entries({n: g for n, g in guesses.items() if g.quantity != "gimbal_angle"})
    others = {n: {"quantity": "covariate", "axis": f"u{i}", "unit": "1"} for i, n in enumerate(unknown)}
    free = from_frame(columns, {**bare, **others}, title=title, called=title)
    at = {n: free.channels["covariate", f"u{i}"] for i, n in enumerate(unknown)}
    among = gimbal_chain.rig_among(at, [d.rows for d in dwells(free)], dwell_means(free).triad(FORCE))
    if among is None:
        return found, {}, tuple(gimbals.values())
    other, theirs = among
    called = {n: Guess("gimbal_angle", axis, unit, "standing still at rests, and gravity goes as it says")
              for n, (axis, unit) in theirs.items()}  # fmt: skip
    return other, called, tuple(n for n in gimbals.values() if n not in called)


def _entries(guesses: Mapping[str, Guess], backwards: tuple[str, ...] = ()) -> dict[str, dict[str, object]]:
    """Columns as a recording.toml has them."""
    return {
        name: {
            "quantity": g.quantity,
            **({"axis": g.axis} if g.axis and g.quantity != "sigma" else {}),
            **({"of": FORCE} if g.quantity == "sigma" else {}),
            **({"unit": g.unit} if g.unit else {}),
            **({"sign": -1} if name in backwards else {}),
        }
        for name, g in guesses.items()
    }


def _spelt(platform: Platform | None) -> str | dict[str, object]:
    """A platform as a recording.toml has it."""
    if platform is None or platform.name != "own":
        return platform.name if platform else "bench"
    return {"name": "own", "axes": [{"name": a.name, "direction": a.direction, "sign": a.sign,
            "offset": {"value": float(np.degrees(a.offset)), "unit": "deg"}} for a in platform.axes]}  # fmt: skip
