r"""Guide logs of PHD2: what an equatorial mount would have done had nobody guided it.

The log has the offset of a guide star from its lock position and the pulses that were sent to the mount. With d the
offset, Omega the Earth's rate, p_j the pulses and v the guide rate of an axis,

.. math:: h = h_0 + \Omega t \quad \text{(readout of the drive)}, \qquad
          h_{looked\,at} = h - \frac{d_{RA}}{\cos\delta} - \sum_{j<k} v_{RA} \, p_j

with west pulses counted positive, and the same in declination with north positive: PHD2 sends a west pulse where the
mount lags behind the star (d positive), a south pulse where it looks north of it. Offsets are in pixels; a stretch ends
where the lock position is moved (dither). Format: the PHD2 guide log, as its project documents it.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from gimbalcal.earth import EARTH_RATE, normal_gravity
from gimbalcal.errors import InputError, amount
from gimbalcal.importers.pointing import pointing_run
from gimbalcal.importers.table import one_file, only
from gimbalcal.importers.tpoint import equatorial
from gimbalcal.number import Array
from gimbalcal.recording.record import Recording, Site
from gimbalcal.units import to_si

_BEGINS, _HEADING, _MOVED = "Guiding Begins", "Frame,Time", ("INFO: DITHER", "INFO: SET LOCK POS")
_NUMBER = r"\s*=\s*([-+]?\d+(?:\.\d+)?)"
_WESTWARD, _NORTHWARD = {"W": 1.0, "E": -1.0}, {"N": 1.0, "S": -1.0}
FEWEST = 10  # frames


@dataclass(frozen=True)
class _Stretch:
    """Header lines of a guiding session and the frames (columns by name) of a stretch with one lock position."""

    header: str
    frames: list[dict[str, str]]


def import_phd2(files: Sequence[Path], options: Mapping[str, str]) -> Recording:
    """One PHD2 guide log; latitude = of the site in deg; stretch = 1, 2, ... between dithers (default: the longest)."""
    only(options, ("latitude", "stretch"))
    path = one_file(files)
    latitude = _latitude(options)
    stretches = [s for s in _stretches(path) if len(s.frames) >= FEWEST]
    if not stretches:
        raise InputError(f"{path} is not a PHD2 guide log, or it has no {FEWEST} frames of the mount in a row")
    number = _chosen(path, options, stretches)
    one = stretches[number - 1]
    scale = float(to_si(_told(path, one.header, "Pixel scale", "in arc-sec/px"), "arcsec"))
    pointed = next((line for line in one.header.splitlines() if line.startswith("RA = ")), "")
    declination = float(np.radians(_told(path, pointed, "Dec", "where the mount pointed")))
    hour = _hour_angle(path, pointed, latitude)
    time = _column(path, one, "Time")
    west = scale * (_column(path, one, "RARawDistance") + _pulsed(path, one, "RA", "xRate", _WESTWARD))
    north = scale * (_column(path, one, "DECRawDistance") - _pulsed(path, one, "DEC", "yRate", _NORTHWARD))
    drive = hour + EARTH_RATE * (time - time[0])
    read = {"declination": declination + 0 * time, "hour_angle": drive}
    looked_at = {"declination": declination + north, "hour_angle": drive - west / np.cos(declination)}
    site = Site(latitude, 0.0, float(normal_gravity(latitude, 0.0)))
    told = (
        f"{path}: stretch {number} of {len(stretches)}, {amount(len(time), 'frame')} without a dither, guiding undone"
    )
    return replace(pointing_run(path, equatorial(latitude), site, time - time[0], read, looked_at), remarks=(told,))


def _latitude(options: Mapping[str, str]) -> float:
    try:
        latitude = float(options["latitude"])
    except (KeyError, ValueError):
        latitude = np.nan
    if not abs(latitude) <= 90:
        raise InputError("a PHD2 log does not say where the mount stood; give it as --set latitude=51.0 (deg)")
    return float(np.radians(latitude))


def _hour_angle(path: Path, pointed: str, latitude: float) -> float:
    """Hour angle [rad] as the log tells it, else of the altitude and azimuth that it tells."""
    if re.search(rf"Hour angle{_NUMBER}", pointed):
        return float(np.radians(15 * _told(path, pointed, "Hour angle", "where the mount pointed")))
    up, around = (np.radians(_told(path, pointed, name, "or else its Hour angle")) for name in ("Alt", "Az"))
    west = -np.cos(up) * np.sin(around)
    south = np.sin(up) * np.cos(latitude) - np.cos(up) * np.sin(latitude) * np.cos(around)
    return float(np.arctan2(west, south))


def _chosen(path: Path, options: Mapping[str, str], stretches: Sequence[_Stretch]) -> int:
    if "stretch" not in options:
        return 1 + int(np.argmax([len(s.frames) for s in stretches]))
    text = options["stretch"]
    if not text.isdigit() or not 1 <= int(text) <= len(stretches):
        raise InputError(f"{path} has {amount(len(stretches), 'stretch', 'stretches')}; give one of them, got {text!r}")
    return int(text)


def _stretches(path: Path) -> list[_Stretch]:
    out: list[_Stretch] = []
    header: list[str] = []
    names: list[str] = []
    for text in path.read_text(encoding="utf-8", errors="replace").splitlines():
        if text.startswith(_BEGINS):
            header, names = [], []
        elif text.startswith(_HEADING):
            names = [name.strip() for name in text.split(",")]
            out.append(_Stretch("\n".join(header), []))
        elif text.startswith(_MOVED) and names:
            out.append(_Stretch(out[-1].header, []))
        elif text.startswith("Guiding Ends"):
            names = []
        elif not names:
            header.append(text)
        elif text[:1].isdigit():
            frame = dict(zip(names, (cell.strip().strip('"') for cell in text.split(",")), strict=False))
            if frame.get("mount") == "Mount" and frame.get("RARawDistance"):
                out[-1].frames.append(frame)
    return out


def _told(path: Path, header: str, name: str, what: str) -> float:
    found = re.search(rf"\b{name}{_NUMBER}", header)
    if not found:
        raise InputError(f"{path}: the session does not tell its {name}, {what}; log with the mount connected")
    return float(found[1])


def _column(path: Path, one: _Stretch, name: str) -> Array:
    try:
        return np.array([float(frame[name] or 0) for frame in one.frames])
    except (KeyError, ValueError):
        raise InputError(f"{path}: a frame has no number under {name}; the log seems to be cut short") from None


def _pulsed(path: Path, one: _Stretch, axis: str, rate: str, sense: Mapping[str, float]) -> Array:
    """Pixels by which pulses before each frame had moved the mount."""
    if not any(frame.get(f"{axis}Duration", "0") not in ("", "0") for frame in one.frames):
        return np.zeros(len(one.frames))
    speed = _told(path, one.header, rate, "the guide rate in pixels a second")
    signs = np.array([sense.get(frame.get(f"{axis}Direction", ""), 0.0) for frame in one.frames])
    moved = np.cumsum(signs * _column(path, one, f"{axis}Duration") / 1000) * speed
    return np.concatenate([[0.0], moved[:-1]])
