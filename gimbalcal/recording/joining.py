"""Join several sessions of one instrument into one recording: one after the other, with a pause between them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from itertools import pairwise
from typing import NamedTuple, TypeVar

import numpy as np

from gimbalcal.earth import SOLAR_DAY
from gimbalcal.errors import InputError
from gimbalcal.number import Array
from gimbalcal.recording.record import Recording

Name = TypeVar("Name")
PAUSE = SOLAR_DAY  # between sessions of unknown separation: it keeps them in order
SINCE_1970 = 1e9, 4e9  # s; a clock that shows so much counts from 1970 UTC, and shows the years 2001 to 2096
MAX_GRAVITY_DIFFERENCE = 1e-6  # relative difference of gravity below which two sessions stand in one place


def join(sessions: Sequence[Recording]) -> Recording:
    """Return one recording of all sessions: rests are numbered on, channels are those that every session has.

    Order and spacing of the sessions are those of their dates, or of clocks that follow each other. Where neither is
    known, `restarts` has the times at which the clock of a session begins anew. Raises InputError for sessions that are
    not of one kind, platform, place and unit, and for one that is given twice.
    """
    if len(sessions) == 1:
        return sessions[0]
    sessions, time, restarts, remark = _clock(sessions)
    first = sessions[0]
    for other in sessions[1:]:
        _refuse_unlike(first, other)
    refuse_twice(sessions)
    common = [key for key in first.channels if all(key in r.channels for r in sessions)]
    dropped = sorted({" ".join(key).strip() for r in sessions for key in r.channels if key not in common})
    remarks = (f"only in some of the sessions, and left out: {', '.join(dropped)}",) if dropped else ()
    noise = _shared_rms([r.noise for r in sessions])
    return replace(
        first,
        title=" and ".join(dict.fromkeys(r.title for r in sessions)),
        date=max(r.date for r in sessions),
        noise=noise,
        time=time,
        position=_numbered_on(sessions),
        channels={key: np.concatenate([r.channels[key] for r in sessions]) for key in common},
        source=tuple(s for r in sessions for s in r.source),
        weight=np.concatenate(
            [r.weight * share for r, share in zip(sessions, _session_weights(sessions, noise), strict=True)]
        ),
        other_sensors=(),
        units={key: unit for key, unit in first.units.items() if key in common},
        scatter=_shared_rms([r.scatter for r in sessions]),
        remarks=(*(remark for r in sessions for remark in r.remarks), *remarks, remark),
        restarts=restarts,
    )


def refuse_twice(sessions: Sequence[Recording]) -> None:
    """Raise InputError where the same data stand in two recordings, or one recording stands twice."""
    files = [s for r in sessions for s in r.source if not s.path.endswith(".toml")]  # headers may well be alike
    digests = [s.sha256 for s in files]
    without_files = [r.title for r in sessions if not r.source and sum(r is other for other in sessions) > 1]
    twice = next((s.path for s in files if digests.count(s.sha256) > 1), next(iter(without_files), ""))
    if twice:
        raise InputError(f"{twice!r} is given twice: the same data are no more evidence; give it once")


def _refuse_unlike(first: Recording, other: Recording) -> None:
    pair = f"{first.title!r} and {other.title!r}"
    if (first.kind, first.platform) != (other.kind, other.platform):
        raise InputError(
            f"{first.title!r} is a {first.kind} recording of {first.platform.name!r} and {other.title!r} a "
            f"{other.kind} recording of {other.platform.name!r}: sessions of one instrument are of one kind; "
            "give each alone"
        )
    if (
        abs(other.site.gravity / first.site.gravity - 1) > MAX_GRAVITY_DIFFERENCE
        or first.site.latitude != other.site.latitude
    ):
        raise InputError(
            f"{pair} state different places (gravity {first.site.gravity:.6g} and "
            f"{other.site.gravity:.6g} m/s^2); write one [site] into both, or give each alone"
        )
    if (first.position is None) != (other.position is None):
        raise InputError(f"one of {pair} has positions and the other has none; give each alone")
    for quantity in sorted({q for q, _ in (*first.channels, *other.channels)}):
        if first.has(quantity) and other.has(quantity) and first.counted(quantity) != other.counted(quantity):
            raise InputError(f"{pair} have {quantity} in counts and in a physical unit; give both in one unit")


class _Begun(NamedTuple):
    """The start of a session [s since 1970], and whether it is known to better than a day."""

    at: float
    exact: bool


def _start_of_session(r: Recording) -> _Begun | None:
    """Return the start of a session by the dates of its clock, seconds since 1970, or the header's date."""
    if r.epoch is not None:
        return _Begun(r.epoch + float(r.time[0]), exact=True)
    if SINCE_1970[0] < r.time[0] < SINCE_1970[1]:
        return _Begun(float(r.time[0]), exact=True)
    if not r.date:
        return None
    day = datetime.fromisoformat(r.date)
    return _Begun((day if day.tzinfo else day.replace(tzinfo=UTC)).timestamp(), "T" in r.date or " " in r.date)


def _clock(sessions: Sequence[Recording]) -> tuple[Sequence[Recording], Array, tuple[float, ...], str]:
    """Return the sessions in order, continued times (n,), those at which a clock begins anew, and a remark."""
    begun = [(b, r) for r in sessions if (b := _start_of_session(r)) is not None]
    if len(begun) == len(sessions):
        begun.sort(key=lambda each: each[0].at)
        if all(_session_follows(*a, b) for a, (b, _) in pairwise(begun)):
            shift = [b.at - float(r.time[0]) for b, r in begun]
            time = np.concatenate([r.time + (s - shift[0]) for s, (_, r) in zip(shift, begun, strict=True)])
            coarse = "" if all(b.exact for b, _ in begun) else ", which are good to a day"
            return [r for _, r in begun], time, (), f"the time between sessions is that of their dates{coarse}"
    if all(a.time[-1] < b.time[0] for a, b in pairwise(sessions)):
        return sessions, np.concatenate([r.time for r in sessions]), (), "the sessions are on one clock, which goes on"
    parts, begin = [], 0.0
    for r in sessions:
        parts.append(r.time - r.time[0] + begin)
        begin = float(parts[-1][-1]) + PAUSE
    return sessions, np.concatenate(parts), tuple(float(t[0]) for t in parts[1:]), UNKNOWN


UNKNOWN = (
    "how long passed between the sessions is not recorded: what drifts or warms up is taken to begin anew in each, and "
    "nothing that changed from one to the next is reported as a drift; write when each was recorded, as in "
    "date = 2026-11-18T05:33, into its recording.toml"
)


def _session_follows(a: _Begun, r: Recording, b: _Begun) -> bool:
    """Return whether a session that began at b began after the end of one r that began at a."""
    certain = (a.exact and b.exact) or a.at // SOLAR_DAY < b.at // SOLAR_DAY
    return certain and a.at + float(r.time[-1] - r.time[0]) < b.at


def _numbered_on(sessions: Sequence[Recording]) -> Array | None:
    parts, last = [], 0
    for r in sessions:
        if r.position is None:
            return None
        parts.append(np.where(r.position > 0, r.position + last, 0))
        last = max(last, int(parts[-1].max(initial=0)))
    return np.concatenate(parts)


def _session_weights(sessions: Sequence[Recording], noise: Mapping[str, float]) -> list[float]:
    """Return the weight of a row of each session, where they state different noise."""
    sensor = sessions[0].kind.measured_by
    common = noise.get(sensor, 0.0)
    return [(common / r.noise[sensor]) ** 2 if common and r.noise[sensor] != common else 1.0 for r in sessions]


def _shared_rms(values: Sequence[Mapping[Name, float]]) -> dict[Name, float]:
    """Return the rms of the values that every session has."""
    return {
        name: float(np.sqrt(np.mean([each[name] ** 2 for each in values])))
        for name in values[0]
        if all(name in each for each in values)
    }
