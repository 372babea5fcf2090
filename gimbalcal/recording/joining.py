"""Several sessions of one instrument as one recording: one after the other, with a pause between them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import TypeVar

import numpy as np

from gimbalcal.errors import InputError
from gimbalcal.number import Array
from gimbalcal.recording.record import Recording

Name = TypeVar("Name")
PAUSE = 86400.0  # s between sessions whose clocks do not say how far apart they are
ALIKE = 1e-6  # relative difference of gravity below which two sessions stand in one place


def join(sessions: Sequence[Recording]) -> Recording:
    """One recording of all sessions: rests are numbered on, channels are those that every session has.

    Sessions whose clocks follow each other (dates, seconds since 1970) keep them; others are put a day apart. Raises
    InputError for sessions that are not of one kind, platform, place and unit, and for one that is given twice.
    """
    first = sessions[0]
    if len(sessions) == 1:
        return first
    for other in sessions[1:]:
        _refuse_unlike(first, other)
    refuse_twice(sessions)
    common = [key for key in first.channels if all(key in r.channels for r in sessions)]
    dropped = sorted({" ".join(key).strip() for r in sessions for key in r.channels if key not in common})
    remarks = (f"only in some of the sessions, and left out: {', '.join(dropped)}",) if dropped else ()
    noise = _shared([r.noise for r in sessions])
    return replace(
        first,
        title=" and ".join(dict.fromkeys(r.title for r in sessions)),
        date=max(r.date for r in sessions),
        noise=noise,
        time=_clock(sessions),
        position=_numbered_on(sessions),
        channels={key: np.concatenate([r.channels[key] for r in sessions]) for key in common},
        source=tuple(s for r in sessions for s in r.source),
        weight=np.concatenate([r.weight * share for r, share in zip(sessions, _shares(sessions, noise), strict=True)]),
        beside=(),
        units={key: unit for key, unit in first.units.items() if key in common},
        scatter=_shared([r.scatter for r in sessions]),
        remarks=(*(remark for r in sessions for remark in r.remarks), *remarks),
    )  # fmt: skip


def refuse_twice(sessions: Sequence[Recording]) -> None:
    """Raise InputError where the same data stand in two recordings."""
    files = [s for r in sessions for s in r.source if not s.path.endswith(".toml")]  # headers may well be alike
    digests = [s.sha256 for s in files]
    twice = next((s.path for s in files if digests.count(s.sha256) > 1), "")
    if twice:
        raise InputError(f"{twice!r} is given twice: the same data are no more evidence; give it once")


def _refuse_unlike(first: Recording, other: Recording) -> None:
    pair = f"{first.title!r} and {other.title!r}"
    if first.kind != other.kind or first.platform != other.platform:
        raise InputError(
            f"{first.title!r} is a {first.kind} recording of {first.platform.name!r} and {other.title!r} a "
            f"{other.kind} recording of {other.platform.name!r}: sessions of one instrument are of one kind; "
            "give each alone"
        )
    if abs(other.site.gravity / first.site.gravity - 1) > ALIKE or first.site.latitude != other.site.latitude:
        raise InputError(
            f"{pair} are told to be at different places (gravity {first.site.gravity:.6g} and "
            f"{other.site.gravity:.6g} m/s^2); write one [site] into both, or give each alone"
        )
    if (first.position is None) != (other.position is None):
        raise InputError(f"one of {pair} has positions and the other has none; give each alone")
    for quantity in sorted({q for q, _ in (*first.channels, *other.channels)}):
        if first.has(quantity) and other.has(quantity) and first.counted(quantity) != other.counted(quantity):
            raise InputError(f"{pair} have {quantity} in counts and in a physical unit; give both in one unit")


def _clock(sessions: Sequence[Recording]) -> Array:
    """Times (n,) that go on: as logged where every session begins after the one before, else a day apart."""
    if all(a.time[-1] < b.time[0] for a, b in pairwise(sessions)):
        return np.concatenate([r.time for r in sessions])
    parts, begin = [], 0.0
    for r in sessions:
        parts.append(r.time - r.time[0] + begin)
        begin = float(parts[-1][-1]) + PAUSE
    return np.concatenate(parts)


def _numbered_on(sessions: Sequence[Recording]) -> Array | None:
    parts, last = [], 0
    for r in sessions:
        if r.position is None:
            return None
        parts.append(np.where(r.position > 0, r.position + last, 0))
        last = max(last, int(parts[-1].max(initial=0)))
    return np.concatenate(parts)


def _shares(sessions: Sequence[Recording], noise: Mapping[str, float]) -> list[float]:
    """What a row of each session weighs where they state different noise of what they measure."""
    sensor = "gimbal_angle" if sessions[0].kind == "pointing" else "accelerometer"
    common = noise.get(sensor, 0.0)
    return [(common / r.noise[sensor]) ** 2 if common and r.noise[sensor] != common else 1.0 for r in sessions]


def _shared(told: Sequence[Mapping[Name, float]]) -> dict[Name, float]:
    """The rms of what every session tells."""
    return {
        name: float(np.sqrt(np.mean([each[name] ** 2 for each in told])))
        for name in told[0]
        if all(name in each for each in told)
    }
