r"""Angles and clocks in files of telescope pointing runs: sexagesimal, sidereal, on the horizon; and a run of rows.

A direction has azimuth A (from north through east) and elevation E, or hour angle h (westward) and declination delta.
At latitude L

.. math:: \sin E = \sin\delta \sin L + \cos\delta \cos L \cos h, \qquad
          \tan A = \frac{-\cos\delta \sin h}{\sin\delta \cos L - \cos\delta \sin L \cos h}

and the same with (A, E) and (h, delta) exchanged.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from gimbalcal.errors import InputError
from gimbalcal.number import Array
from gimbalcal.platform import Platform
from gimbalcal.recording.columns import ROW_STEP_S
from gimbalcal.recording.kinds import POINTING
from gimbalcal.recording.record import Recording, Site, Source

SIDEREAL_SECOND_S = 86164.0905 / 86400  # mean solar seconds, Explanatory Supplement to the Astronomical Almanac

MAX_DISORDER_H = 1.0  # h; a sidereal time that falls back by less is out of order


def sexagesimal(words: Sequence[str]) -> float:
    """Return the number of sexagesimal words: ``["-00", "30", "36"]`` is -0.51, the sign belongs to the whole."""
    sign = -1.0 if words[0].startswith("-") else 1.0
    return sign * sum(abs(float(word)) / 60**i for i, word in enumerate(words))


def about_other_pole(around: Array, up: Array, latitude: float) -> tuple[Array, Array]:
    """Return azimuth and elevation [rad] of hour angle and declination, or hour angle and declination of those."""
    s, c = np.sin(latitude), np.cos(latitude)
    height = np.sin(up) * s + np.cos(up) * c * np.cos(around)
    meridian = np.sin(up) * c - np.cos(up) * s * np.cos(around)
    across = -np.cos(up) * np.sin(around)
    return np.arctan2(across, meridian), np.arctan2(height, np.hypot(meridian, across))


def elapsed_seconds(path: Path, sidereal_hours: Array) -> tuple[Array, tuple[str, ...]]:
    """Return seconds since the first row, from the local sidereal time [h] of rows in order, and remarks on them.

    A clock that falls back by more than `MAX_DISORDER_H` is that of a later night, after an unknown number of days.
    """
    step = np.diff(sidereal_hours)
    step = np.where(step < -12, step + 24, step)  # past 24 h
    back = np.flatnonzero((step < 0) & (step > -MAX_DISORDER_H))
    if len(back):
        raise InputError(
            f"{path}, observation {back[0] + 2}: the sidereal time does not grow; put the rows in order of time"
        )
    later = np.flatnonzero(step < 0)
    seconds = np.concatenate([[0.0], np.cumsum(np.where(step < 0, step + 24, step))]) * 3600 * SIDEREAL_SECOND_S
    if not len(later):
        return seconds, ()
    first = ", ".join(str(i + 2) for i in later[:3])
    return seconds, (f"{path}: the sidereal time falls back at observation {first}: taken as the night after",)


def in_order(path: Path, rows: int) -> tuple[Array, tuple[str, ...]]:
    """Return a time [s] that only counts the rows, for files without a clock, and a remark on it."""
    remark = f"{path} has no clock: its rows are taken in order, {ROW_STEP_S:g} s each, so that rates mean nothing"
    return ROW_STEP_S * np.arange(rows), (remark,)


def pointing_run(
    path: Path, platform: Platform, site: Site, time: Array, readout: Mapping[str, Array], true: Mapping[str, Array]
) -> Recording:
    """Return a pointing recording: by axis, the encoder readouts and the angles [rad] of a perfect mount on the star.

    `true` is brought to the side of the pier that `readout` shows, and within half a turn of it.
    """
    channels = {("gimbal_angle", axis): angle for axis, angle in readout.items()}
    for axis, angle in _on_its_side(readout, true).items():
        turns = np.round((readout[axis] - angle) / (2 * np.pi))
        channels["true_angle", axis] = angle + 2 * np.pi * turns
    return Recording(
        kind=POINTING,
        title=path.stem,
        platform=platform,
        site=site,
        noise={},
        time=time,
        position=None,
        channels=channels,
        source=(Source.of(path),),
        units=dict.fromkeys(channels, "deg"),
    )


def _on_its_side(readout: Mapping[str, Array], true: Mapping[str, Array]) -> Mapping[str, Array]:
    """Return true angles [rad] with those of an equatorial mount on the side of the pier that its readouts show.

    A readout of the declination beyond 90 deg is the other side: the same direction has the hour angle h + 180 deg and
    the declination 180 deg - delta there. An encoder whose zero lies anywhere reads beyond 90 deg, too: there the
    differences from the readouts scatter more with the sides exchanged than without.
    """
    if set(readout) != {"hour_angle", "declination"}:
        return true
    other = (np.cos(readout["declination"]) < 0) & (np.cos(true["declination"]) > 0)
    exchanged = {
        "declination": np.where(other, np.pi - true["declination"], true["declination"]),
        "hour_angle": np.where(other, np.pi + true["hour_angle"], true["hour_angle"]),
    }

    def concentration(angles: Mapping[str, Array]) -> float:
        return float(sum(abs(np.nanmean(np.exp(1j * (readout[axis] - angle)))) for axis, angle in angles.items()))

    return exchanged if concentration(exchanged) >= concentration(true) else true
