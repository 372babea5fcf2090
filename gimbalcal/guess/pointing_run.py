"""A pointing run in an undescribed table: pairs of angles, or angles and offsets, of any telescope or antenna.

Numbers do not determine the sign: offsets turned round are another mount that fits as well. So the words of the file
are looked at, and where they are silent the usual sense, measured minus commanded, is taken and said.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path

import numpy as np

from gimbalcal.errors import InputError
from gimbalcal.guess import clocks
from gimbalcal.guess.celestial import angle_stated, latitude_column, sidereal, sidereal_hours
from gimbalcal.guess.column_names import (
    ANGLE_WORDS,
    ANGLES,
    by_name,
    by_spelling,
    is_anonymous,
    plain_name,
    unit_written,
)
from gimbalcal.guess.gimbal_chain import encoder_angles
from gimbalcal.guess.log import Guess
from gimbalcal.guess.text_table import Table
from gimbalcal.importers.pointing_files import elapsed_seconds, in_order, pointing_run
from gimbalcal.importers.tpoint import equatorial
from gimbalcal.number import Array
from gimbalcal.platform import KNOWN
from gimbalcal.recording.columns import ROW_STEP_S
from gimbalcal.recording.dwell import stretch_means
from gimbalcal.recording.record import UNKNOWN_SITE, Recording
from gimbalcal.recording.site import with_normal_gravity
from gimbalcal.rotation import within_half_turn
from gimbalcal.units import to_si

_AXIS = by_spelling(
    {
        "azimuth": "az azi azimuth azimut azim",
        "elevation": "el ele elev elevation alt altitude hoehe hohe",
        "hour_angle": "ha hourangle stundenwinkel hour",
        "declination": "dec decl declination deklination de",
    }
)
_PAIRS = (("azimuth", "elevation"), ("hour_angle", "declination"))
_ROLE = by_spelling(
    {
        "true": "true cmd command commanded cat catalog catalogue target star soll ref reference nominal expected calc "
        "calculated model requested demand demanded source ideal apparent topo sky computed comp solved plate "
        "astrometric solution setpoint goto",
        "read": "enc encoder meas measured obs observed raw ist actual act read reading readout mount reported tel "
        "telescope measure scope encoders current position",
        "offset": "d delta diff off offset offs err error corr correction residual ablage abweichung dev deviation",
        "sigma": "sig sigma sd std stdev unc uncertainty rms",
    }
)
_ERROR = frozenset(["err", "error", "residual", "dev", "deviation"])  # of an offset, where there is one as well
_SOLVED = frozenset(["solved", "plate", "astrometric", "solution"])  # where it looked, whatever was aimed at
_SKY = frozenset(["cos", "cosel", "cosdec", "cosalt", "x", "cross", "xel", "sky", "onsky"])
_FUSED = re.compile(rf"^(?:(d|delta|off|err)|(x|dx|crs|cross))({'|'.join(sorted(_AXIS, key=len, reverse=True))})$")
_COSINE = re.compile(r"\W*cos[\s_(]*(?:el|elev|elevation|dec|alt)\b\)?", re.IGNORECASE)
_MINUS = re.compile(r"(\w+)\s*(?:minus|[-−–])\s*(\w+)")
_READOUT = ANGLE_WORDS | {"pos", "position", "counter", "resolver", "servo", "axis", "achse", "encoder"}
MIN_JUMP_DEG, MIN_AROUND_DEG, MIN_UP_DEG = 1.0, 90.0, 30.0  # of azimuths and elevations of stars without names
MIN_CORRELATION, MAX_COLUMNS = 0.98, 6  # of a readout and a measurement of one axis; columns of such a table
MAX_RATIO = 1.25  # of two columns taken for angles of one axis, where one goes round
MAX_SHARE_OFF = 0.2  # of what an angle changes, by which its readout is off the place of the star
MIN_SLEW_STEPS, MIN_STARS, MIN_ROWS_OF_STAR = 20.0, 10, 5  # of a log of stars that a mount follows: usual steps, stars
MAX_TURNS = 100  # of an axis, beyond which a number is no angle in deg
MAX_OFFSET_DEG = 1.0  # deg; offsets beyond are arcseconds
ASSUMED_SENSE = "measured minus commanded, as most write it: nothing in the file says so"


@dataclass(frozen=True)
class AngleColumn:
    """A column of angles: its axis, what of it, its unit as far as the name states it, and whether it is on the sky."""

    name: str
    axis: str
    role: str
    unit: str
    on_sky: bool


@dataclass(frozen=True)
class PointingRun:
    """A pointing run, why each channel is what it is, by (quantity, axis), and what was assumed of the whole."""

    recording: Recording
    guesses: Mapping[tuple[str, str], tuple[str, str]]
    notes: Mapping[str, str]
    left_out: tuple[str, ...]


def angles_in(table: Table) -> tuple[AngleColumn, ...]:
    """Return the columns of two axes of a mount; none where the table holds no such pair."""
    columns = [
        angle for name in table.columns if (angle := _angle_column(name)) is not None
    ]  # with names as in `axis_angles`
    for pair in _PAIRS:
        own = [s for s in columns if s.axis in pair]
        if all(sum(s.axis == axis and s.role != "sigma" for s in own) >= 2 for axis in pair):
            return tuple(s for axis in pair for s in _one_offset([s for s in own if s.axis == axis]))
    return ()


def refuse_single_angles(path: Path, table: Table) -> None:
    """Raise InputError where a table holds one column for each angle of a mount, and none that is called an offset."""
    columns = [angle for name in table.columns if (angle := _angle_column(name)) is not None]
    for first, second in _PAIRS:
        own = [[s for s in columns if s.axis == axis] for axis in (first, second)]
        if all(len(each) == 1 for each in own):
            a, b = ("az", "el") if first == "azimuth" else ("ha", "dec")
            raise InputError(
                f"{path}: {first.replace('_', ' ')} and {second} are in one column each ({own[0][0].name.strip()}, "
                f"{own[1][0].name.strip()}); a pointing run needs the place of the star and the readout of each axis, "
                f"or one of them and the offset of the mount: add {a}_encoder, {b}_encoder, or d{a}, d{b}"
            )


def with_unnamed_angles(table: Table) -> Table:
    """Return a table without names with its azimuths, elevations and their offsets called so, if it holds any.

    Azimuths go round, elevations stay below 90 deg, and both jump from star to star; the next two columns are their
    offsets, or the next four, where every second one is what the one before is known to.
    """
    names = [] if table.named else list(table.columns)
    for k in range(len(names) - 3):
        azimuth, elevation, *rest = (table.columns[n] for n in names[k:])
        jumps = all(np.median(np.abs(np.diff(x))) > MIN_JUMP_DEG for x in (azimuth, elevation))
        around = np.nanmin(azimuth) >= 0 and MIN_AROUND_DEG < np.nanmax(azimuth) <= 360
        if not (jumps and around and 0 <= np.nanmin(elevation) and MIN_UP_DEG < np.nanmax(elevation) <= 90):
            continue
        known = len(rest) >= 4 and all(
            np.nanmin(sigma) >= 0 and np.nanmedian(sigma) < 0.2 * np.nanmedian(np.abs(x))
            for x, sigma in (rest[:2], rest[2:4])
        )
        called = ["az [deg]", "el [deg]", *(("daz", "daz sigma", "del", "del sigma") if known else ("daz", "del"))]
        new = dict(zip(names[k : k + len(called)], called, strict=True))
        return replace(table, columns={new.get(n, n): x for n, x in table.columns.items()})
    return table


def one_axis_run(path: Path, table: Table, title: str) -> PointingRun | None:
    """Return the readout of one axis with a measurement of it, in two columns that belong together, or None."""
    growing = {n: x for n, x in table.columns.items() if np.all(np.diff(x) > 0)}
    named = [n for n in growing if (g := by_name(n)) and g.quantity == "time"]
    clock = next(iter([*named, *(n for n, x in growing.items() if clocks.unit_of_epoch(x))]), "")
    triad = [
        n for n in table.columns if plain_name(n) in ("x", "y", "z")
    ]  # three axes, and no axis with its measurement
    angles = {
        n: x
        for n, x in table.columns.items()
        if n not in (clock, *table.dates, *(triad if len(triad) == 3 else ()))
        and (is_anonymous(n) or _is_readout(n))
        and np.all(np.isfinite(x))
        and np.ptp(x) > 0
        and np.max(np.abs(x)) < 360 * MAX_TURNS
    }
    few, counts = angles if len(table.columns) <= MAX_COLUMNS else {}, dict[str, int]()
    pairs = _pairs(few)
    if few and not pairs:  # an encoder goes round where the axis goes on
        turned, counts = encoder_angles(few)
        pairs, angles = (_pairs(turned), turned) if counts else (pairs, angles)
    even = {n for n, x in angles.items() if len(angles) > 2 and _is_count(x)}
    pairs = [p for p in pairs if not even.intersection(p)]
    signal = "" if pairs else _signal_along(next(iter(angles), ""), table, clock)
    if signal:
        pairs, angles = [(signal, next(iter(angles)))], {**angles, signal: table.columns[signal]}
    if len(pairs) != 1:
        return None
    first, second = pairs[0]
    roles = [{_ROLE.get(w) for w in plain_name(n).split("_")} for n in pairs[0]]
    if "true" in roles[0] and "true" not in roles[1] and not signal:
        first, second = second, first
    units = [unit if (unit := unit_written(plain_name(n))) in ANGLES else "" for n in (first, second)]
    usual = "deg" if np.ptp(angles[second if signal else first]) > 2 * np.pi else "rad"
    read, true = (np.asarray(to_si(angles[n], u or usual)) for n, u in zip((first, second), units, strict=True))
    ratio = float(np.polyfit(read, true, 1)[0])
    turns = max(np.ptp(read), np.ptp(true)) > np.radians(360)
    if len(angles) > 2 and not counts and any(is_anonymous(n) for n in pairs[0]):
        raise InputError(
            f"{path}: columns {first} and {second} go together, but there are others, and no name says that these two "
            "are angles; name them if they are, such as cmd_deg meas_deg, or name the others, such as time acc_x acc_y "
            "acc_z"
        )
    if turns and not signal and not 1 / MAX_RATIO < abs(ratio) < MAX_RATIO:
        remedy = (
            "the angle of the axis; leave out the one before a gear, or divide it by its ratio"
            if all(units)
            else "an angle in deg; name it, as angle_deg, and the other is read along its line against it"
        )
        raise InputError(
            f"{path}: columns {first} and {second} go together, but {second} changes by {abs(ratio):.4g} where {first} "
            f"changes by 1, so at most one of them is {remedy}"
        )
    if turns and not (signal or counts or any(units) or any(map(_is_readout, (first, second)))):
        raise InputError(
            f"{path}: columns {first} and {second} go together as the readout of an axis with its measurement does, "
            f"but go over {np.ptp(angles[first]):.6g}, and nothing calls them angles; name them where they are, as "
            "cmd_deg meas_deg"
        )
    if signal:
        read = np.asarray(np.polyval(np.polyfit(read, true, 1), read))
    time, remarks = (_seconds(clock, table), ()) if clock else in_order(path, len(read))
    axis = KNOWN["rate-table"].axes[0].name
    run = pointing_run(path, KNOWN["rate-table"], UNKNOWN_SITE, time, {axis: read}, {axis: true})
    why = {
        ("gimbal_angle", axis): (
            first,
            "it goes with the angle; its line against it is taken for zero and scale, which these data do not test"
            if signal
            else f"{counts[first]} counts a turn"
            if first in counts
            else "its place before the other, or its name: what was commanded or read",
        ),
        ("true_angle", axis): (second, "the other column that goes with it: what was measured"),
        **({("time", ""): (clock, "its name" if clock in named else "its numbers, which state days")} if clock else {}),
    }
    notes = {
        "kind": "one axis, read out and measured: two columns that go together",
        "order": "" if signal else "exchange gimbal_angle and true_angle where the first column is the measurement",
        "unit": f"angles are taken in {usual}, by how far they go" if not all(units) else "",
    }
    left_out = tuple(n for n in (*table.columns, *table.others) if n not in (first, second, clock))
    return PointingRun(replace(run, title=title, remarks=remarks), why, {k: v for k, v in notes.items() if v}, left_out)


def _signal_along(angle: str, table: Table, clock: str) -> str:
    """Return the column of a signal that goes with an angle by name, where a table holds no others; else empty."""
    words, others = plain_name(angle), [n for n in table.columns if n not in (angle, clock)]
    called = unit_written(words) in ANGLES or bool(ANGLE_WORDS.intersection(words.split("_")))
    if not called or len(others) != 1 or ((g := by_name(others[0])) and g.quantity != "weight"):
        return ""  # counts are called as the number of samples is
    x = table.columns[others[0]]
    alike = np.all(np.isfinite(x)) and np.ptp(x) > 0
    return others[0] if alike and abs(np.corrcoef(x, table.columns[angle])[0, 1]) > MIN_CORRELATION else ""


def _pairs(angles: Mapping[str, Array]) -> list[tuple[str, str]]:
    """Return the pairs of columns that go together."""
    return [
        (a, b) for a, b in combinations(angles, 2) if abs(np.corrcoef(angles[a], angles[b])[0, 1]) > MIN_CORRELATION
    ]


def _is_readout(name: str) -> bool:
    """Return whether a name is that of an angle, a command or a measurement."""
    words = plain_name(name).split("_")
    return (
        unit_written(plain_name(name)) in ANGLES or bool(_READOUT.intersection(words)) or any(w in _ROLE for w in words)
    )


def _is_count(x: Array) -> bool:
    return bool(np.all(np.diff(x) == x[1] - x[0]))


def _one_offset(columns: list[AngleColumn]) -> list[AngleColumn]:
    """Return the columns of an axis, an error together with an offset as the sigma of the offset.

    Raises InputError for several offsets of which no name identifies the one.
    """
    offsets = [s for s in columns if s.role == "offset"]
    if len(of_axis := [s for s in offsets if not s.on_sky]) == 1:  # with the same on the sky
        columns = [s for s in columns if s.role != "offset" or s in of_axis]
        offsets = of_axis
    named = [s for s in offsets if not _ERROR.intersection(plain_name(s.name).split("_"))]
    if len(named or offsets) > 1:
        raise InputError(
            f"which of {' and '.join(s.name for s in named or offsets)} is what the mount was off by? Leave one of "
            "them in the log"
        )
    return [replace(s, role="sigma") if named and s in offsets and s not in named else s for s in columns]


def _angle_column(name: str) -> AngleColumn | None:
    bare = re.sub(r"[\[(].*", "", _COSINE.sub(" cos ", name))
    within = [w for w in plain_name(name[len(bare) :]).split("_") if _ROLE.get(w) in ("true", "read")]  # HA(true)
    words = [*plain_name(bare).split("_"), *within]
    unit = unit_written(plain_name(name)) if re.search(r"[\[(_ ]", name) else ""
    on_sky, role, axis = bool(_SKY.intersection(words)), "", ""
    for word in words:
        fused = _FUSED.match(word)
        if fused and not axis:
            role, axis, on_sky = "offset", _AXIS[fused[3]], on_sky or bool(fused[2])
        elif word in _AXIS and not axis:
            axis = _AXIS[word]
        elif word in _ROLE:
            role = "sigma" if "sigma" in (role, _ROLE[word]) else _ROLE[word] if role != "offset" else role
    if "xel" in words:
        axis, role, on_sky = "azimuth", "offset", True
    return AngleColumn(name, axis, role, unit, on_sky) if axis else None


def pointing_proposal(
    path: Path, table: Table, columns: tuple[AngleColumn, ...], title: str, latitude: float | None, height: float | None
) -> PointingRun:
    """Return the run whose angles are `columns`; latitude [rad] and height [m] where they are known.

    Raises InputError for an equatorial mount without a latitude, and where nothing distinguishes readouts from angles.
    """
    axes = next(pair for pair in _PAIRS if all(any(s.axis == a for s in columns) for a in pair))
    notes: dict[str, str] = {}
    latitude = latitude if latitude is not None else _latitude(table, notes)
    if axes[0] == "hour_angle" and latitude is None:
        raise InputError(
            f"{path}: hour angle and declination are those of an equatorial mount, whose polar axis leans by the "
            "latitude; give --latitude DEG"
        )
    platform = KNOWN["alt-az"] if axes[0] == "azimuth" else equatorial(float(latitude or 0.0))
    read: dict[str, Array] = {}
    true: dict[str, Array] = {}
    why: dict[tuple[str, str], tuple[str, str]] = {}
    for axis in axes[::-1]:  # the lower one first: offsets on the sky are divided by its cosine
        own = [s for s in columns if s.axis == axis and s.role != "sigma"]
        off = _channels(path, table, axis, own, (read, true), why, notes)
        if off and off.on_sky and axis == axes[0]:  # the axis above turns further than the line of sight
            read[axis] = true[axis] + (read[axis] - true[axis]) / np.cos(true[axes[1]])
            lower = axes[1].replace("_", " ")
            notes["sky"] = f"{off.name} is on the sky by its name: divided by the cosine of the {lower}"
    order = {axis.name: axis for axis in platform.axes if axis.name in axes}
    site = with_normal_gravity(latitude, height)
    times = [n for n in table.columns if (g := by_name(n)) and g.quantity == "time"]
    clock = next((n for n in times if np.all(np.diff(table.columns[n]) >= 0)), "")
    rows = len(read[axes[0]])
    time, remarks = (_seconds(clock, table), ()) if clock else _sidereal_seconds(path, table, rows)
    if times and not clock:
        remark = f"{path}: the clock {times[0]} goes back, so its rows are taken in order, {ROW_STEP_S:g} s each"
        remarks = (f"{remark} and rates mean nothing; sort them by time for these",)
    if clock:
        why["time", ""] = (clock, f"its name {clock.strip()!r}")
    elif not remarks and (by := sidereal(table)):
        why["time", ""] = (by, "the sidereal time, since no column is another clock")
    whole = np.all(np.isfinite([time, *read.values(), *true.values()]), axis=0)
    recording = pointing_run(path, platform, site, time, {a: read[a] for a in order}, {a: true[a] for a in order})
    if not whole.all():
        recording = recording.select(np.flatnonzero(whole))
        remarks = (*remarks, f"{path}: {int(np.sum(~whole))} of {rows} rows lack an angle and are left out")
    starts = _starts_of_stars(recording, axes)
    if MIN_STARS <= len(starts) <= len(recording.time) / MIN_ROWS_OF_STAR:
        notes["samples"] = (
            f"{len(recording.time)} rows follow {len(starts)} stars, between which the mount slews: each star is kept "
            "as the mean of its rows, as their errors are alike"
        )
        recording = stretch_means(recording, starts)
        recording = replace(recording, weight=np.ones(len(starts)))
    notes["kind"] = f"two axes of a mount, {axes[0].replace('_', ' ')} and {axes[1]}, each twice"
    used = {name for name, _ in why.values()} | {s.name for s in columns if s.role == "offset"}
    left_out = tuple(n for n in (*table.columns, *table.others) if n not in used)
    return PointingRun(replace(recording, title=title, remarks=remarks), why, notes, left_out)


def _starts_of_stars(recording: Recording, axes: tuple[str, str]) -> list[int]:
    """Return the rows (s,) at which stars begin: the first, and those to which the mount slews.

    A slew is far longer than the usual step from row to row, in which the mount follows a star.
    """
    around, up = (recording.channels["gimbal_angle", axis] for axis in axes)
    steps = np.hypot(within_half_turn(np.diff(around)) * np.cos(up[1:]), within_half_turn(np.diff(up)))
    return [0, *(np.flatnonzero(steps > MIN_SLEW_STEPS * np.median(steps)) + 1).tolist()] if len(steps) else [0]


def _channels(
    path: Path,
    table: Table,
    axis: str,
    columns: list[AngleColumn],
    out: tuple[dict[str, Array], dict[str, Array]],
    why: dict[tuple[str, str], tuple[str, str]],
    notes: dict[str, str],
) -> AngleColumn | None:
    """Put readout and true angle [rad] of one axis into `out`; return the column of offsets, if they are by one."""
    read, true = out
    offset = next((s for s in columns if s.role == "offset"), None)
    plain_ones = [s for s in columns if s.role != "offset"]
    by_role = {role: next((s for s in plain_ones if s.role == role), None) for role in ("true", "read", "")}
    a, b = by_role["true"], by_role["read"]
    both = [s for s in plain_ones if s.role == "true"]
    solved = [s for s in both if _SOLVED.intersection(plain_name(s.name).split("_"))]
    if len(both) == 2 and len(solved) == 1 and not b:  # the mount took itself for where it was sent
        a, b = solved[0], next(s for s in both if s is not solved[0])
    if a and b:
        reason = "its name"
    elif (a or b) and by_role[""]:
        a, b, reason = a or by_role[""], b or by_role[""], "its name, and that of the other"
    elif len(plain_ones) >= 2:
        a, b, reason = plain_ones[0], plain_ones[1], "its place: the first of two is taken for the true one"
        notes["order"] = f"{a.name} is taken for where the star was and {b.name} for the readout, by their order alone"
    if a and b:
        true[axis], read[axis] = (_angle(table, s, axis, notes) for s in (a, b))
        if "order" in notes and not _go_together(true[axis], read[axis]):
            raise InputError(
                f"{path}: {a.name} and {b.name} do not go together: the place of a star and the readout of its axis "
                "differ by far less than they change; leave out the one that is neither, or call them az_true and "
                "az_encoder"
            )
        why["true_angle", axis], why["gimbal_angle", axis] = (a.name, reason), (b.name, reason)
        if offset and not _offsets_agree(read[axis] - true[axis], _offset(table, offset, axis, {})):
            raise InputError(
                f"{path}: {b.name} less {a.name} is not what {offset.name} says: leave {b.name} out of the log if the "
                f"mount was off by {offset.name}, or {offset.name} if it was not"
            )
        return None
    one = a or b or (plain_ones[0] if plain_ones else None)
    if one is None or offset is None:
        there = ", ".join(s.name for s in columns)
        raise InputError(
            f"{path}: of {axis} there is no readout with the true angle ({there}); name its columns as in az_true "
            "and az_encoder, or write a header and use `gimbalcal import csv`"
        )
    sign, sense = _sense_of_offsets(table, offset)
    notes["sign"] = f"offsets are {sense}"
    off = sign * _offset(table, offset, axis, notes)
    where = _angle(table, one, axis, notes)
    true[axis], read[axis] = (where - off, where) if b else (where, where + off)
    known, computed = ("gimbal_angle", "true_angle") if b else ("true_angle", "gimbal_angle")
    why[known, axis] = one.name, "its name"
    why[computed, axis] = (
        f"{one.name} and {offset.name}",
        f"{sense}; to turn it round, exchange gimbal_angle and true_angle",
    )
    return offset


def _go_together(true: Array, read: Array) -> bool:
    """Return whether two angles (n,) [rad] of one axis, of either sense, differ by far less than they change."""
    scatters = []
    for x in (true, read - true, read + true):
        middle = np.angle(np.nanmean(np.exp(1j * x)))
        scatters.append(float(np.nanmedian(np.abs(within_half_turn(x - middle)))))
    return min(scatters[1:]) <= MAX_SHARE_OFF * scatters[0]


def _offsets_agree(difference: Array, offset: Array) -> bool:
    """Return whether offsets (n,) are, up to their sign, the difference of two angles [rad]."""
    distance = np.abs(within_half_turn(difference))
    return bool(np.nanmedian(np.abs(distance - np.abs(offset))) < 0.5 * np.nanmedian(np.abs(offset)))


def _angle(table: Table, s: AngleColumn, axis: str, notes: dict[str, str]) -> Array:
    """Return an angle in rad: degrees, or hours where the name or hours, minutes and seconds say so."""
    x, unit = table.columns[s.name], s.unit
    hours = axis == "hour_angle" and (unit in ("h", "s", "min") or (not unit and s.name in table.sexagesimal))
    if axis == "hour_angle" and not unit and not hours and np.nanmax(np.abs(x)) <= 12.0:
        hours = True
        notes["hours"] = f"{s.name} is taken in hours: it stays within 12 (degrees if it is not so)"
    if hours:
        return np.radians(15 * x)
    return np.asarray(to_si(x, unit if unit in ANGLES else "deg"))


def _offset(table: Table, s: AngleColumn, axis: str, notes: dict[str, str]) -> Array:
    """Return an offset in rad, in the unit of its name, else arcsec where it is beyond a degree."""
    x = table.columns[s.name]
    if s.unit in ANGLES:
        return np.asarray(to_si(x, s.unit))
    if axis == "hour_angle" and s.unit == "s":
        return np.radians(x / 240)
    size = float(np.nanmax(np.abs(x)))
    unit = "arcsec" if size > MAX_OFFSET_DEG else "deg"
    notes["unit"] = f"offsets are taken in {unit}: they go up to {size:.3g} and no name states their unit"
    return np.asarray(to_si(x, unit))


def _sense_of_offsets(table: Table, offset: AngleColumn) -> tuple[int, str]:
    """Return 1 where offsets are readout minus truth, -1 where they are the reverse, and by what."""
    for text in (*table.above, offset.name):
        for minuend, subtrahend in _MINUS.findall(text.lower()):
            roles = _ROLE.get(minuend), _ROLE.get(subtrahend)
            if roles == ("read", "true"):
                return 1, f"{minuend} minus {subtrahend}, as the file says"
            if roles == ("true", "read"):
                return -1, f"{minuend} minus {subtrahend}, as the file says"
    return 1, ASSUMED_SENSE


def _sidereal_seconds(path: Path, table: Table, rows: int) -> tuple[Array, tuple[str, ...]]:
    """Return seconds by the sidereal time where it is logged and grows, else by the number of the row."""
    try:
        return (
            elapsed_seconds(path, sidereal_hours(table, clock)) if (clock := sidereal(table)) else in_order(path, rows)
        )
    except InputError:
        return in_order(path, rows)


def _seconds(name: str, table: Table) -> Array:
    x, guess = table.columns[name], by_name(name) or Guess("time", "", "", "")
    if name in table.dates or name in table.sexagesimal:
        return np.asarray(x if name in table.dates else 3600 * x)
    return np.asarray(to_si(x, guess.unit) if guess.unit else x * clocks.UNITS[clocks.unit_of_epoch(x) or "s"])


def _latitude(table: Table, notes: dict[str, str]) -> float | None:
    """Return the latitude [rad] that a column or a comment above the table states in degrees."""
    if column := latitude_column(table):
        notes["site"] = f"latitude {column[1]:.6g} deg, as the column {column[0]} says"
        return float(np.radians(column[1]))
    for line in table.above:
        stated = angle_stated(line, "lat(?:itude)?", "N", "S")
        if stated is not None and abs(stated) <= 90:
            notes["site"] = f"latitude {stated:.6g} deg, as {line.strip()!r} says"
            return float(np.radians(stated))
    return None
