"""A log that nobody described yet: read, its columns guessed, several logs on one clock, and what kind it is.

What is proposed passes the checks of every recording. Where these refuse the gyroscopes in the guessed unit and take
them in another, that one is proposed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from gimbalcal.errors import InputError
from gimbalcal.importers import rig
from gimbalcal.importers.guess import by_order, sound_unit, unit_of_force, unit_of_rate, unit_of_time
from gimbalcal.importers.mmt import import_mmt
from gimbalcal.importers.names import FORCE, RATE, Guess, body_rates, by_name, by_turn, hinted, plain
from gimbalcal.importers.pointing import SPACED
from gimbalcal.importers.stars import angles_in, pointing_proposal
from gimbalcal.importers.together import Columns, on_one_clock, one_each
from gimbalcal.importers.tpoint import import_tpoint
from gimbalcal.importers.undescribed import Table, table_of
from gimbalcal.number import Array
from gimbalcal.platform import Platform
from gimbalcal.recording import Recording, dwell_means, dwells, from_frame
from gimbalcal.recording.dates import Dates
from gimbalcal.recording.plausibility import refuse_implausible

BESIDE = ("rad/s", "deg/s", "deg/h")  # units of rate that are tried where the guessed one cannot be
EACH_A_REST = 0.05  # of the norm, from row to row: no log is so slow, but a table with a row for each position
ONE_LENGTH = 0.1  # that all but a few rests agree to in the norm of the force
MOST_RESTS = 2000  # rows of such a table
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
    logs: Sequence[Path], title: str = "", rate: float = 0.0, latitude: float | None = None, height: float | None = None
) -> Proposal:
    """The recording in one log or several of one unit; rate [Hz] of its rows instead of a clock; the place, deg and m.

    Raises InputError where neither accelerometers nor the axes of a mount are found, where logs do not overlap, or
    where nothing that is guessed makes a recording, with what to write into a header by hand.
    """
    if absent := [path for path in logs if not path.is_file()]:
        raise InputError(f"{absent[0]} does not exist or is not a file; give the log of a unit")
    title, place = title or logs[0].stem, None if latitude is None else float(np.radians(latitude))
    if len(logs) == 1 and (known := _foreign(logs[0], title)):
        return known
    dates = Dates()
    tables = [table_of(path, dates) for path in logs]
    if len(logs) == 1 and (angles := angles_in(tables[0])):
        run = pointing_proposal(logs[0], tables[0], angles, title, place, height)
        guesses = {name: Guess(q, axis, run.recording.units.get((q, axis), "s"), why)
                   for (q, axis), (name, why) in run.guesses.items()}  # fmt: skip
        return Proposal(run.recording, guesses, run.left_out, run.notes)
    read = [_guessed(path, table, rate) for path, table in zip(logs, tables, strict=True)]
    columns, guesses, left, notes = read[0]
    for path, (other, theirs, unknown, _) in zip(logs[1:], read[1:], strict=True):
        columns, guesses = on_one_clock(path, (columns, guesses), (other, theirs))
        left += unknown
    missing = [a for a in "xyz" if not any((g.quantity, g.axis) == (FORCE, a) for g in guesses.values())]
    if missing:
        raise InputError(
            f"{logs[0]}: no column is an accelerometer along {' and '.join(missing)} by its name "
            f"({', '.join(tables[0].columns)}); name the columns acc_x, acc_y, acc_z, gyro_x, ..., time, or those of a "
            "mount az_true, el_true, az_encoder, el_encoder, or write a header and use `gimbalcal import csv`"
        )
    site = {} if latitude is None else {"latitude": (latitude, "deg"), **({"height": (height, "m")} if height else {})}
    tried = [guesses, *(_in_other_unit(guesses, unit) for unit in BESIDE if _rate_is_open(guesses))]
    refused: InputError | None = None
    for g in tried:
        try:
            made, told, outside = _made((columns, g), title, site, notes)
            held = {n: x for n, x in g.items() if n not in outside}
            return Proposal(made, held, (*left, *outside), told)
        except InputError as problem:
            refused = refused or problem
    if "the clock jumps back" in str(refused) or "the clock stands still" in str(refused):
        raise InputError(f"{refused}; or --rate HZ counts the rows, where none are missing") from None
    assert refused is not None
    raise refused


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
) -> tuple[Recording, dict[str, str], tuple[str, ...]]:
    """The recording, what was guessed of the whole, and gimbal columns left out because no platform has them."""
    columns, guesses = log
    gimbals = {g.axis: name for name, g in guesses.items() if g.quantity == "gimbal_angle"}
    told, platform = dict(notes), None
    reverse: tuple[str, ...] = ()
    outside: tuple[str, ...] = ()
    turned: tuple[str, ...] = ()
    if gimbals:
        chain = {"axes": [{"name": axis, "direction": "zxy"[k % 3]} for k, axis in enumerate(gimbals)]}
        still = dwell_means(from_frame(columns, _entries(guesses), title=title, platform=chain, called=title))
        found = rig.rig_of({a: still.channels["gimbal_angle", a] for a in gimbals}, still.triad(FORCE))
        told["platform"], turned, platform = found.why, found.backwards, found.platform
        if len(gimbals) == 1:
            told["platform"] += "; turns about one axis show few errors: mount the unit otherwise too for the others"
        reverse = tuple(n for n, g in guesses.items() if g.quantity == FORCE) if found.reversed else ()
        if platform is None:
            outside = tuple(gimbals.values())
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
    told["noise"] = "taken from the rows, where nothing is stated" + (
        '; state how well positions are set: gimbal_angle = { value = 1, unit = "arcsec" }, no row shows it'
        if gimbals
        else ""
    )
    remarks = refuse_implausible(made)
    return replace(made, remarks=(*made.remarks, *remarks)), told, outside


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


def _guessed(
    path: Path, table: Table, rate: float
) -> tuple[dict[str, Array], dict[str, Guess], list[str], dict[str, str]]:
    """Columns of a log that are known, what they are, the names of the others, and what was guessed of the whole."""
    columns, hint, notes = dict(table.columns), hinted(path.stem), {}
    guesses = {name: g for name in columns if (g := by_name(name, hint)) is not None}
    if not any(g.quantity == RATE for g in guesses.values()):
        guesses |= body_rates({name: plain(name) for name in columns if name not in guesses})
    if not any(g.quantity in (FORCE, RATE) for g in guesses.values()):
        named = {name: g for name, g in guesses.items() if g.quantity in ("time", "temperature")}
        rest = {name: x for name, x in columns.items() if name not in named}
        guesses = {**by_order(rest), **named} if rest else named
    columns, guesses = one_each(columns, guesses)
    seen = {g.quantity for g in guesses.values()}
    force = [columns[name] for name, g in guesses.items() if g.quantity == FORCE]
    numbered = next((columns[n] for n, g in guesses.items() if g.quantity == "position"), np.zeros(2))
    distinct = len(numbered) <= MOST_RESTS and len(np.unique(numbered)) == len(numbered)
    each_a_rest = len(force) == 3 and (distinct or _jumps(force))
    if each_a_rest:  # beside samples these are what a unit makes of itself
        guesses |= {n: g for n in columns if n not in guesses and (g := by_turn(n))}
    if each_a_rest and "position" not in seen:
        columns = {"position": np.arange(1.0, len(force[0]) + 1), **columns}
        guesses = {"position": Guess("position", "", "", "the rows: the force turns from each to the next"), **guesses}
    if rate > 0:
        guesses = {name: g for name, g in guesses.items() if g.quantity != "time"}
    if rate > 0 or "time" not in seen:
        if rate <= 0 and not each_a_rest:
            raise InputError(f"{path}: no column is a clock by its name ({', '.join(columns)}); give --rate HZ")
        rows = np.arange(len(next(iter(columns.values()))))
        columns = {"time": rows / rate if rate > 0 else SPACED * rows, **columns}
        why = (
            f"--rate {rate:g}"
            if rate > 0
            else f"its rows, counted {SPACED:g} s apart since no column is a clock: rates of drift mean nothing"
        )
        guesses = {"time": Guess("time", "", "s", why), **guesses}
    if not each_a_rest:  # a standard deviation of single samples is what the rows show
        guesses = {name: g for name, g in guesses.items() if g.quantity not in ("sigma", "weight")}
    elif any(g.quantity == "sigma" for g in guesses.values()):
        counted = any(g.quantity == "weight" for g in guesses.values())
        notes["sigma"] = (
            "standard deviations are of single samples, and a mean of N is better by sqrt(N)" if counted else
            "standard deviations are taken for those of the means; of single samples, add a column with their number, "
            'quantity = "weight"'
        )  # fmt: skip
    used = (
        {*guesses, *(name for name in columns if (g := by_name(name)) and g.quantity == "sigma")}
        if each_a_rest
        else guesses
    )
    left = [name for name in (*table.columns, *table.others) if name not in used]
    return {name: columns[name] for name in guesses}, _with_units(columns, guesses), left, notes


def _jumps(force: Sequence[Array]) -> bool:
    """Whether forces (n,) along three axes turn from each row to the next, as means of positions do."""
    f = np.stack(force, axis=-1)
    f = f[np.isfinite(f).all(axis=1)]
    if not 2 < len(f) <= MOST_RESTS:
        return False
    step, norm = np.linalg.norm(np.diff(f, axis=0), axis=1), np.linalg.norm(f, axis=1)
    alike = np.quantile(np.abs(norm / np.median(norm) - 1), 0.9) < ONE_LENGTH
    return bool(alike and np.mean(step > EACH_A_REST * np.median(norm)) > 0.5)


def _with_units(columns: Mapping[str, Array], guesses: Mapping[str, Guess]) -> dict[str, Guess]:
    """Units that no name tells, from the numbers."""
    out = dict(guesses)
    for quantity, of in ((FORCE, unit_of_force), (RATE, unit_of_rate)):
        own = [name for name, g in guesses.items() if g.quantity == quantity]
        if own and not all(sound_unit(guesses[n].unit, quantity) for n in own):
            full = np.isfinite(np.stack([columns[n] for n in own])).all(axis=0)
            unit, why = of([columns[n][full] for n in own])
            out |= {n: replace(guesses[n], unit=unit, why=f"{guesses[n].why}; {why}") for n in own}
    force = next((g.unit for g in out.values() if g.quantity == FORCE), "m/s^2")
    for name, g in out.items():
        if g.quantity == "sigma" and not sound_unit(g.unit, FORCE):
            out[name] = replace(g, unit=force, why=f"{g.why}; the unit is that of the forces")
    (clock,) = [name for name, g in guesses.items() if g.quantity == "time"]
    if not sound_unit(out[clock].unit, "time"):
        unit, why = unit_of_time(columns[clock])
        out[clock] = replace(out[clock], unit=unit, why=f"{out[clock].why}; {why}")
    return out


def _rate_is_open(guesses: Mapping[str, Guess]) -> bool:
    """Whether the unit of the gyroscopes was guessed from numbers."""
    return any(g.quantity == RATE and "up to" in g.why and g.unit != "count" for g in guesses.values())


def _in_other_unit(guesses: Mapping[str, Guess], unit: str) -> dict[str, Guess]:
    why = f"the turns between rests fit gravity in {unit}"
    return {n: replace(g, unit=unit, why=why) if g.quantity == RATE else g for n, g in guesses.items()}
