r"""Guide logs of PHD2: what an equatorial mount would have done had nobody guided it.

The log has the offset of a guide star from its lock position and the pulses that were sent to the mount. With d the
offset, Omega the Earth's rate, p_j the pulses and v the guide rate of an axis,

.. math:: h = h_0 + \Omega t \quad \text{(readout of the drive)}, \qquad
          h_{looked\,at} = h - \frac{d_{RA}}{\cos\delta} - \sum_{j<k} v_{RA} \, p_j

with west pulses counted positive, and the same in declination with north positive: PHD2 sends a west pulse where the
mount lags behind the star (d positive), a south pulse where it looks north of it. Offsets are in pixels; a stretch ends
where the lock position is moved (dither), and the next has another h_0: stretches of a session are numbered as
positions. Format: the PHD2 guide log, as its project documents it.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from gimbalcal.earth import EARTH_RATE, normal_gravity
from gimbalcal.errors import InputError, number_of, shortened_text
from gimbalcal.importers.pointing_files import about_other_pole, pointing_run
from gimbalcal.importers.registry import importer
from gimbalcal.importers.tpoint import equatorial
from gimbalcal.number import Array
from gimbalcal.recording.lines import cells_of
from gimbalcal.recording.record import Recording, Site
from gimbalcal.units import to_si

_BEGINS, _HEADING, _MOVED = "Guiding Begins", "Frame,Time", ("INFO: DITHER", "INFO: SET LOCK POS")
_NUMBER = r"\s*=\s*([-+]?\d+(?:\.\d+)?)(?=,?(?:\s|$))"  # 1,50 is no number
_WESTWARD, _NORTHWARD = {"W": 1.0, "E": -1.0}, {"N": 1.0, "S": -1.0}
_KINDS = ("Mount", "AO", "DROP")  # of frames: DROP has lost its star
MIN_FRAMES = 10  # frames
MAX_LATITUDE_SPREAD = np.radians(2.0)  # between sessions of one log, which state tenths of a degree
MAX_LATITUDE = np.radians(89.0)  # azimuths have no meaning at a pole
MIN_MERIDIAN_PART = 0.3  # of a direction, in the plane of the meridian: that part shows the latitude
MAX_DIRECTION_ERROR = np.radians(1.0)  # between both ways to state a direction, refraction near the horizon included
MAX_PULSE_MS = 60_000  # PHD2 sends a few seconds at most


@dataclass(frozen=True)
class _Stretch:
    """Header lines of a guiding session and the frames (columns by name) of a stretch with one lock position.

    session: ordinal of it in the file; lines: where in the file each frame stands; gaps: those before which the numbers
    of frames leave some out; lost: those that had lost their star, and are no frames of the stretch.
    """

    session: int
    header: str
    frames: list[dict[str, str]]
    lines: list[int]
    gaps: list[int]
    lost: list[int]


def is_guide_log(head: Sequence[str]) -> bool:
    """Return whether the first lines of a file are those of a guide log."""
    frames = any(
        line.startswith(_HEADING) and ",dx,dy," in line for line in head
    )  # optical trackers number theirs, too
    return frames or any(line.startswith((_BEGINS, "PHD2 version")) for line in head)


@importer("phd2", "latitude", "stretch")
def import_phd2(files: Sequence[Path], options: Mapping[str, str]) -> Recording:
    """One PHD2 guide log; latitude = in deg (default: by its directions); stretch = 1, 2, ... (default: a session)."""
    (path,) = files
    stretches = [s for s in _stretches(path) if len(s.frames) >= MIN_FRAMES]
    if not stretches:
        raise InputError(f"{path} is not a PHD2 guide log, or it has no {MIN_FRAMES} frames of the mount in a row")
    chosen = _chosen_stretches(path, options, stretches)
    session = stretches[chosen[0]]
    scale = float(to_si(_header_value(path, session.header, "Pixel scale", "in arc-sec/px"), "arcsec"))
    pointed = _direction(session)
    declination = float(np.radians(_header_value(path, pointed, "Dec", "where the mount pointed")))
    latitude = _latitude(options, stretches)
    hour = _hour_angle(path, pointed, latitude)
    if scale <= 0 or abs(declination) >= np.pi / 2 or abs(hour) > 2 * np.pi:
        raise InputError(
            f"{path}: the session says a pixel scale of {np.degrees(scale) * 3600:.4g} arcsec, a declination of "
            f"{np.degrees(declination):.4g} deg and an hour angle of {np.degrees(hour) / 15:.4g} h, which cannot be"
        )
    lines = [line for k in chosen for line in stretches[k].lines]

    def joined(column: Callable[[_Stretch], Array]) -> Array:
        return np.concatenate([column(stretches[k]) for k in chosen])

    time = joined(lambda s: _column(path, s, "Time"))
    if (back := np.flatnonzero(np.diff(time) <= 0)).size:
        raise InputError(f"{path}, line {lines[back[0] + 1]}: the time does not go on; correct or remove the frame")
    west = joined(lambda s: _column(path, s, "RARawDistance") + _pulsed_pixels(path, s, "RA", "xRate", _WESTWARD))
    north = joined(lambda s: _column(path, s, "DECRawDistance") - _pulsed_pixels(path, s, "DEC", "yRate", _NORTHWARD))
    west, north = scale * west, scale * north
    drive = hour + EARTH_RATE * (time - time[0])
    read = {"declination": declination + 0 * time, "hour_angle": drive}
    looked_at = {"declination": declination + north, "hour_angle": drive - west / np.cos(declination)}
    site = Site(latitude, 0.0, float(normal_gravity(latitude, 0.0)))
    which, lost = f"stretch {chosen[0] + 1}", sum(len(stretches[k].lost) for k in chosen)
    without = "without a dither"
    if len(chosen) > 1:
        which, without = f"stretches {chosen[0] + 1} to {chosen[-1] + 1}", "in one session"
    remark = f"{path}: {which} of {len(stretches)}, {number_of(len(time), 'frame')} {without}, guiding undone"
    if lost:
        remark += f"; {number_of(lost, 'frame')} had lost the star and are left out"
    if "latitude" not in options:
        remark += f"; the directions in the log give a latitude of {np.degrees(latitude):.2f} deg"
    gaps = [n for k in chosen for n in stretches[k].gaps]
    missing = [f"{path}, line {n}: frames before it are missing, so that their pulses are not undone" for n in gaps[:3]]
    run = pointing_run(path, equatorial(latitude), site, time - time[0], read, looked_at)
    number = np.repeat(np.arange(1, len(chosen) + 1), [len(stretches[k].frames) for k in chosen])
    return replace(run, position=number if len(chosen) > 1 else None, remarks=(remark, *missing))


def _latitude(options: Mapping[str, str], stretches: Sequence[_Stretch]) -> float:
    """Return the latitude [rad] as stated, else that of the directions in the log, in the mean of its sessions."""
    if "latitude" in options:
        try:
            latitude = float(options["latitude"])
        except ValueError:
            latitude = np.nan
        if not abs(latitude) <= 90:
            raise InputError("the latitude of a PHD2 log is stated as --set latitude=51.0 (deg)")
        return float(np.radians(latitude))
    each = [x for s in stretches if (x := _latitude_of_direction(_direction(s))) is not None]
    if not each or np.ptp(each) > MAX_LATITUDE_SPREAD:
        raise InputError(
            "a PHD2 log does not say where the mount stood, and this one has no direction in both declination and "
            "hour angle and altitude and azimuth that shows it; state it as `gimbalcal import phd2 LOG --set "
            "latitude=51.0` or `gimbalcal new LOG --latitude 51.0` (deg)"
        )
    return float(np.mean(each))


def _direction(one: _Stretch) -> str:
    """Return the header line that states where the mount pointed; empty if there is none."""
    return next((line for line in one.header.splitlines() if line.startswith(("RA = ", "Dec = "))), "")


def _latitude_of_direction(pointed: str) -> float | None:
    """Return the latitude [rad] of a site that sees the one direction of a header line both ways.

    None if the line lacks one, if they disagree, or if azimuths counted from south would agree as well.
    """
    degrees = []
    for name, unit in (("Dec", 1.0), ("Hour angle", 15.0), ("Alt", 1.0), ("Az", 1.0)):
        if not (number := re.search(rf"\b{name}{_NUMBER}", pointed)):
            return None
        degrees.append(unit * float(number[1]))
    dec, hour, up, around = np.radians(degrees)
    latitude = _latitude_between(dec, hour, up, around)
    return latitude if _latitude_between(dec, hour, up, around + np.pi) is None else None


def _latitude_between(dec: float, hour: float, up: float, around: float) -> float | None:
    r"""Return the latitude [rad] from a direction in declination, hour angle, elevation and azimuth [rad].

    .. math:: \cos E \cos A = \sin\delta \cos L - \cos\delta \cos h \sin L, \quad
              \sin E = \sin\delta \sin L + \cos\delta \cos h \cos L, \quad
              \cos E \sin A = -\cos\delta \sin h

    None where its eastward parts or its parts in the meridian differ, the latter is short, or the site is at a pole or
    beyond it.
    """
    north, east, high = np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up)
    pole, equator, west = np.sin(dec), np.cos(dec) * np.cos(hour), np.cos(dec) * np.sin(hour)
    latitude = float(np.arctan2(pole * high - equator * north, pole * north + equator * high))
    in_meridian = np.hypot(pole, equator), np.hypot(north, high)
    agree = max(abs(east + west), abs(in_meridian[0] - in_meridian[1])) <= MAX_DIRECTION_ERROR
    return latitude if agree and min(in_meridian) > MIN_MERIDIAN_PART and abs(latitude) < MAX_LATITUDE else None


def _hour_angle(path: Path, pointed: str, latitude: float) -> float:
    """Return the hour angle [rad] as the log states it, else from the altitude and azimuth."""
    if re.search(rf"Hour angle{_NUMBER}", pointed):
        return float(np.radians(15 * _header_value(path, pointed, "Hour angle", "where the mount pointed")))
    up, around = (np.radians(_header_value(path, pointed, name, "or else its Hour angle")) for name in ("Alt", "Az"))
    return float(about_other_pole(np.array(around), np.array(up), latitude)[0])


def _chosen_stretches(path: Path, options: Mapping[str, str], stretches: Sequence[_Stretch]) -> list[int]:
    """Return the ordinals of the stretches that were asked for, or of all in the session of most frames."""
    if "stretch" not in options:
        frames = Counter[int]()
        for s in stretches:
            frames[s.session] += len(s.frames)
        session = max(frames, key=lambda k: frames[k])
        return [k for k, s in enumerate(stretches) if s.session == session]
    text = options["stretch"]
    if not re.fullmatch(r"\d{1,9}", text) or not 1 <= int(text) <= len(stretches):
        number = number_of(len(stretches), "stretch", "stretches")
        raise InputError(f"{path} has {number}; give one of them, got {shortened_text(text)!r}")
    return [int(text) - 1]


def _stretches(path: Path) -> list[_Stretch]:
    out: list[_Stretch] = []
    header: list[str] = []
    names: list[str] = []
    session = 0
    before = 0  # number of the last frame
    for number, text in enumerate(path.read_text(encoding="utf-8-sig", errors="replace").splitlines(), start=1):
        if text.startswith(_BEGINS):
            header, names, session = [], [], session + 1
        elif text.startswith(_HEADING):
            names = [name.strip() for name in text.split(",")]
            out.append(_Stretch(session, "\n".join(header), [], [], [], []))
            before = 0
        elif text.startswith(_MOVED) and names:
            out.append(_Stretch(session, out[-1].header, [], [], [], []))
        elif text.startswith("Guiding Ends"):
            names = []
        elif not names:
            header.append(text)
        elif text[:1].isdigit() or '"Mount"' in text:
            frame = dict(zip(names, (cell.strip() for cell in cells_of(text, skipinitialspace=True)), strict=False))
            if not re.fullmatch(r"\d{1,9}", frame[names[0]]) or frame.get("mount") not in _KINDS:
                raise InputError(f"{path}, line {number} is no frame as PHD2 writes them; correct or remove it")
            if before and int(frame[names[0]]) != before + 1:
                out[-1].gaps.append(number)
            before = int(frame[names[0]])
            if frame["mount"] == "DROP":
                out[-1].lost.append(number)
            if frame["mount"] == "Mount":
                out[-1].frames.append(frame)
                out[-1].lines.append(number)
    return out


def _header_value(path: Path, header: str, name: str, what: str) -> float:
    match = re.search(rf"\b{name}{_NUMBER}", header)
    if not match:
        raise InputError(f"{path}: the session does not state its {name}, {what}; log with the mount connected")
    return float(match[1])


def _column(path: Path, one: _Stretch, name: str, absent: str = "") -> Array:
    """Return the numbers (n,) of a column; `absent` stands where a cell is empty."""
    out = np.zeros(len(one.frames))
    for i, (frame, line) in enumerate(zip(one.frames, one.lines, strict=True)):
        text = frame.get(name, "") or absent
        try:
            out[i] = float(text)
        except ValueError:
            out[i] = np.nan
        if not np.isfinite(out[i]):
            raise InputError(f"{path}, line {line}: {text!r} under {name} is no number; correct or remove the frame")
    return out


def _pulsed_pixels(path: Path, one: _Stretch, axis: str, rate: str, sense: Mapping[str, float]) -> Array:
    """Return pixels by which pulses before each frame had moved the mount."""
    length, towards = _column(path, one, f"{axis}Duration", "0"), [f.get(f"{axis}Direction", "") for f in one.frames]
    for ms, where, frame, line in zip(length, towards, one.frames, one.lines, strict=True):
        duration = frame.get(f"{axis}Duration", "")
        possible = 0 <= ms <= MAX_PULSE_MS and where in ("", *sense)
        if not possible or bool(where) > bool(duration) or (ms and not where):
            raise InputError(
                f"{path}, line {line}: a pulse of {duration or 'no'} ms to {where or 'no side'!r} in {axis}, where "
                f"PHD2 writes a duration and {' or '.join(sense)}; correct or remove the frame"
            )
    if not length.any():
        return length
    speed = _header_value(path, one.header, rate, "the guide rate in pixels a second")
    signs = np.array([sense.get(where, 0.0) for where in towards])
    moved = np.cumsum(signs * length / 1000) * speed
    return np.concatenate([[0.0], moved[:-1]])
