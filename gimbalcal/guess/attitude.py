"""Quaternions in a log: of a reference (optical tracking), which a recording takes, or of the unit itself.

A unit's own estimate is left out: a calibration against it would prove itself. Its name decides which of them it is.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from gimbalcal.guess.column_names import is_anonymous, plain_name
from gimbalcal.guess.log import Guess, Log
from gimbalcal.number import Array
from gimbalcal.recording.record import FORCE, RATE
from gimbalcal.units import to_si

COMPONENTS = ("qw", "qx", "qy", "qz")
MAX_NORM_ERROR = 0.02
MIN_WHOLE = 0.5  # share of the rows that hold a quaternion
MAX_UNIT_COST = 30.0  # nats
SMOOTHED_S = 0.3  # s, over which the direction of the force is averaged
MIN_TURN_RAD = 3.0  # rad in all, of a log that shows by its motion how far its gyroscopes turned
LENGTHS = (1.0, 2.0**14, 2.0**15, 2.0**30)  # of a quaternion: 1, as a number and in fixed point of 16 and 32 bits
_COMPONENT = re.compile(r"(?P<stem>.*?)_?(?P<which>[wxyz0-3])")
_REFERENCE = re.compile(
    r"(^|_)(vicon|opt|optical|optitrack|qualisys|mocap|motion_capture|ref|reference|truth|true|ground_?truth|gt|camera"
    r"|laser|tracker)\d*(_|$)"
)


def quaternions(log: Log) -> Iterator[tuple[str, tuple[str, ...], float]]:
    """Yield the stem and the columns w, x, y, z of quaternions, and their length, one of `LENGTHS`."""
    stems: dict[str, dict[str, str]] = {}
    for name in log.unknown:
        if is_anonymous(name):
            continue
        match = _COMPONENT.fullmatch(plain_name(re.sub(r"[\[(].*", "", name)))
        if match and "covariance" not in match["stem"]:  # a covariance is logged row by row: 1, 0, 0, 0
            stems.setdefault(match["stem"], {})[match["which"]] = name
    for stem, own in stems.items():
        letters = next((order for order in ("wxyz", "0123") if set(order) <= set(own)), "")
        names = tuple(own[letter] for letter in letters)
        if names and (length := _length(np.stack([log.columns[n] for n in names]))):
            yield stem, names, length


def with_reference(log: Log) -> tuple[Log | None, str]:
    """Return the log with a reference attitude, at the rows that hold one; else None, and a note on an estimate."""
    note = ""
    for stem, names, length in quaternions(log):
        if not _REFERENCE.search(stem):
            note = (
                f"{names[0].strip()}, ... is an attitude that the unit computes, by its name, and is left out; call it "
                "ref_qw, ref_qx, ref_qy, ref_qz where an independent instrument measured it"
            )
            continue
        why = f"four columns of norm 1, of a reference by the name {stem!r}"
        guesses = {n: Guess("attitude", q, "1", why) for n, q in zip(names, COMPONENTS, strict=True)}
        whole = log.without("position").including(guesses, {n: log.columns[n] / length for n in names})
        rows = np.isfinite(np.stack([whole.columns[n] for n in whole.guesses])).all(axis=0)
        return whole.rows(rows), "" if rows.all() else f"{int((~rows).sum())} rows lack a value and are left out"
    return None, note


def of_another_log(path: Path, log: Log) -> dict[str, Array]:
    """Return the quaternions (n,) of a log by their names, without jumps from q to -q, which is the same attitude.

    Names begin with that of the log where this, or its folder, is called after a reference: mocap0/data.csv.
    """
    out: dict[str, Array] = {}
    called = plain_name(f"{path.parent.name} {path.stem}")
    for stem, names, _ in quaternions(log):
        q = np.stack([log.columns[n] for n in names])
        turned = np.cumprod(np.where(np.nansum(q[:, 1:] * q[:, :-1], axis=0) < 0, -1.0, 1.0))
        own = [f"{called}_{stem}_{which}" for which in "wxyz"] if _REFERENCE.search(called) else names
        out |= zip(own, q * np.concatenate([[1.0], turned]), strict=True)
    return out


def motion_cost(log: Log, shown: tuple[float, float] | None = None) -> float:
    r"""Return how unlikely the unit of the gyroscopes is by what else shows how the unit turned, in nats.

    The cost is :math:`(\ln r / s)^2 / 2` for the ratio r of the two and its spread s, `shown` for gyroscopes of rad/s
    as `turning_ratio` returns it, which is the same in every unit of the gyroscopes.
    """
    unit = next((log.guesses[n].unit for n in log.names(RATE)), "count")
    ratio, spread = (0.0, 1.0) if unit == "count" else shown or turning_ratio(log)
    return float(min(0.5 * (np.log(to_si(ratio, unit)) / spread) ** 2, MAX_UNIT_COST)) if ratio else 0.0


def turning_ratio(log: Log) -> tuple[float, float]:
    """Return how far gyroscopes of rad/s turned over how far the unit did by what else shows it, and its spread, ln.

    A quaternion, be it the unit's own, turned from row to row by what the gyroscopes measured, within a third; the
    direction of the smoothed force within a factor of 4, for it shows accelerations too and no turn about itself. The
    ratio is 0 where nothing shows it.
    """
    w = np.stack(log.values(RATE)) if log.has(RATE) else np.zeros((0, 0))
    if len(w) != 3:
        return 0.0, 1.0
    dt = np.diff(log.seconds)
    gyro_angle = np.linalg.norm(w[:, 1:] - np.nanmedian(w, axis=1, keepdims=True), axis=0) * dt
    known = [[log.columns[n] for n in columns] for _, columns, _ in quaternions(log)]
    if attitude := log.values("attitude") or (known[0] if known else []):
        q = np.stack(attitude)
        reference_angle, spread = 2 * np.arccos(np.minimum(np.abs(np.sum(q[:, 1:] * q[:, :-1], axis=0)), 1.0)), 1 / 3
    elif len(log.values(FORCE)) == 3:
        size = min(max(1, int(SMOOTHED_S / float(np.median(dt)))), len(dt))
        f = np.stack([np.convolve(x, np.ones(size) / size, "same") for x in log.values(FORCE)])[:, size:-size:size]
        f = f / np.maximum(np.linalg.norm(f, axis=0), 1e-300)
        reference_angle, spread = np.arccos(np.clip(np.sum(f[:, 1:] * f[:, :-1], axis=0), -1, 1)), 1.4
        edges = np.arange(size, len(gyro_angle) + 2 - size, size)
        complete = len(edges) > len(reference_angle) > 1
        gyro_angle = np.add.reduceat(gyro_angle, edges[:-1])[: len(reference_angle)] if complete else gyro_angle[:0]
        reference_angle = reference_angle[: len(gyro_angle)]
    else:
        return 0.0, 1.0
    moving = np.isfinite(reference_angle) & np.isfinite(gyro_angle)
    moving &= reference_angle > np.nanmedian(reference_angle) if moving.any() else moving
    if not reference_angle[moving].sum() > MIN_TURN_RAD or not gyro_angle[moving].sum() > 0:
        return 0.0, 1.0
    return float(gyro_angle[moving].sum() / reference_angle[moving].sum()), spread


def _length(q: Array) -> float:
    """Return the length of quaternions q (4, n), one of `LENGTHS`; 0 where these are no quaternions."""
    whole = np.isfinite(q).all(axis=0)
    norm = np.linalg.norm(q[:, whole], axis=0)
    if whole.mean() <= MIN_WHOLE:
        return 0.0
    return next((one for one in LENGTHS if np.mean(np.abs(norm / one - 1) < MAX_NORM_ERROR) > 0.9), 0.0)
