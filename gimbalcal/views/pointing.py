r"""A pointing run as rows: where each star was seen against where it is, across the innermost axis' plane and along it.

.. math:: r = 0 - (y, -z) \, \text{of} \, C_b^p(\text{true angles}) \, v(\text{readouts, effects}),

with v the direction in which the mount with these effects looks: a perfect model sees every star on its target. A mount
with a single axis moves the line of sight in one of these directions, and that one alone is a row.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gimbalcal.earth import EARTH_RATE
from gimbalcal.effects import Effect, Stage, Stimulus
from gimbalcal.effects.baseline_effects import BASELINE
from gimbalcal.effects.gimbal_mechanics import MIN_TURN_RAD
from gimbalcal.errors import InputError
from gimbalcal.forward import AXES, Rows, linearise, on_target
from gimbalcal.inference.algebra import orthonormal_columns
from gimbalcal.kinematics import stimulus_from_angles
from gimbalcal.number import Array
from gimbalcal.recording import Recording
from gimbalcal.recording.record import Key
from gimbalcal.views.core import Measurement, View, gauge_parameters, recording_fields
from gimbalcal.views.noise import NoiseModel, of_channels

STAGES = frozenset({Stage.ENCODER, Stage.AXIS_TILT, Stage.BASE, Stage.LINE_OF_SIGHT})
CHANNELS = tuple(("pointing", axis) for axis in AXES["pointing"])
MOVED_BY = {"z": CHANNELS[:1], "y": CHANNELS[1:]}  # where a single axis of that direction moves the line of sight, x
MAX_ROUGHNESS_RATIO = 0.5  # of the roughness of where the stars are
MAX_TRAVEL_RAD = 3 * np.pi  # rad that a mount turns, from one stop to the other
MIN_POLE_COSINE = 0.02  # of the inner angle, below which a mount points along its outer axis
MAX_FILTERED_STARS = 1000  # a log of guiding has more: noises that are filtered row by row would take half of the time
MAX_TEETH, FRAMES = 2000, 5  # of a worm wheel, and means of a log to a turn of such a worm
MIN_READOUT_ERROR_RAD = 1e-10  # misses of an axis that differ less are one number
MAX_RATE_ERROR = 0.1  # of the Earth's rate, of a mount that follows the sky
MAX_STRETCH_SHARE = 0.1  # of the rows, in as many stretches of a log; more are stars
MEDIAN_FRAMES = 7  # of which three may be thrown off
MIN_OUTLIER_SCATTERS = 12.0  # medians of |off|, eight sigma of white noise
MAX_OUTLYING_SHARE = 0.02
MIN_NIGHT_GAP_S = 6 * 3600.0  # s; a longer pause ends a night
POINTING = Measurement(
    "pointing", "arcsec", "stars", channels="pointing", channel="pointing {axis}", acts_on=("gimbal_angle",),
    patterns=frozenset({"fast time", "angles"}),
)  # fmt: skip


def pointing(recording: Recording, baseline: Sequence[str] = ()) -> View:
    """Return the view of a pointing run; every star is a visit of its own. Raises InputError as `read_axes` does."""
    s, tracking, tracked = on_stars(recording), tracking_axes(recording), follows_the_sky(recording)
    moved = moved_channels(recording)
    channels = tuple(c for c in moved if not (tracked and _lacks_readout(recording, c)))
    own = [k for k, c in enumerate(reversed(moved)) if c in channels]  # axes that move in these
    drift = orthonormal_columns(slow_drift(recording)) if tracked else np.zeros((len(recording.time), 0))

    def clear(X: Array) -> Array:
        return np.asarray(X - np.tensordot(drift, np.tensordot(drift.T, X, 1), 1))

    n = len(recording.time)
    aimed, centred = on_target(recording.platform, s), np.zeros((n, len(channels)))  # every star is seen on its target

    def against_stars(effects: Sequence[Effect], s: Stimulus = aimed) -> Rows:
        return linearise(recording.platform, s, effects, "pointing", channels, centred, STAGES)

    def rows(effects: Sequence[Effect]) -> Rows:
        return against_stars(effects).reduced(clear)

    def reference(effects: Sequence[Effect]) -> Rows:
        rows = against_stars(effects)
        there = aimed.at(readout=s.readout + ~tracking * _readout_misses(rows, own))
        return replace(against_stars(effects, there), residual=rows.residual).reduced(clear)

    fields = recording_fields(recording)
    if len(channels) < len(moved):
        fields["read_gimbals"] = tuple(read_axes(recording)[k] for k in own)
    outer = s.axis_names[0].replace("_", " ")
    measurement = replace(POINTING, channel=f"{POINTING.channel} {outer}")
    sigma = np.repeat(1 / np.sqrt(recording.weight)[:, None], len(channels), axis=1)  # in units of one of weight 1
    return View(
        measurement, channels=channels, **fields, stimulus=s, label=s.position,
        evaluate=rows, reference=reference, stages=STAGES, baseline=tuple(baseline) or BASELINE["pointing"],
        gauge=gauge_parameters({Stage.BASE}), groups=np.arange(n),
        noise=NoiseModel(
            sigma, wander=of_channels(n, len(channels)) if n <= MAX_FILTERED_STARS else None,
            of_each_channel=tracked, own_memories=tracked,
        ),
    )  # fmt: skip


def outlying_frames(recording: Recording) -> Array:
    """Return the distance [rad] of each frame (n,) of a smooth track from its neighbours; zero for those in the noise.

    A gust, a knock or a wrong star throws a few frames off by many times what they scatter about the running median of
    `MEDIAN_FRAMES`; more than a `MAX_OUTLYING_SHARE` of them are the noise of the log.
    """
    from scipy.ndimage import median_filter

    out = np.zeros(len(recording.time))
    smooth = dict(zip(recording.platform.axis_names, tracking_axes(recording), strict=True))
    for axis in (a for a in read_axes(recording) if smooth[a]):
        miss = np.unwrap(recording.channels["true_angle", axis] - recording.channels["gimbal_angle", axis])
        off = np.abs(miss - median_filter(miss, MEDIAN_FRAMES, mode="mirror"))
        scatter = max(np.median(off), np.median(np.abs(np.diff(miss))) / 2)  # a steady change is its own median
        out = np.maximum(out, np.where(off > MIN_OUTLIER_SCATTERS * scatter, off, 0.0))
    return out if np.count_nonzero(out) <= MAX_OUTLYING_SHARE * len(out) else np.zeros(len(out))


def means_of_tracking(recording: Recording) -> Recording:
    """Return the log of a mount that tracks as means over `FRAMES` to a turn of the fastest worm; others as they are.

    Frames follow each other faster than any error of the mount varies. Their means hold less of the seeing, and what
    remains has less memory from row to row.
    """
    if not follows_the_sky(recording):
        return recording
    width = 2 * np.pi / (MAX_TEETH * FRAMES * EARTH_RATE)
    stretch = np.zeros(len(recording.time)) if recording.position is None else recording.position
    at = np.stack([stretch, np.floor(recording.elapsed / width)])
    _, first, bin_, count = np.unique(at, axis=1, return_index=True, return_inverse=True, return_counts=True)
    if len(count) > len(recording.time) / 2:
        return recording

    def mean(x: Array) -> Array:
        return np.bincount(bin_, x) / count

    angles = {key for key in recording.channels if key[0] in ("gimbal_angle", "true_angle")}
    means = {key: mean(np.unwrap(x) if key in angles else x) for key, x in recording.channels.items()}
    averaged = recording.select(first)
    return replace(averaged, time=mean(recording.time), channels=means, weight=np.ones(len(count)), other_sensors=())


def slow_drift(recording: Recording) -> Array:
    """Return the columns (n, p) of what drifts slowly while a mount tracks, for whatever reason: a cubic in time.

    At a single place of the sky a tilt, flexure and refraction drift alike; the constant and the rate are terms of the
    model. Stretches of different `position` have an offset each.
    """
    t = recording.elapsed / (recording.elapsed.max() or 1.0) * 2 - 1
    curve = np.polynomial.legendre.legvander(t, 3)
    line = orthonormal_columns(curve[:, :2])
    curve = curve[:, 2:] - line @ (line.T @ curve[:, 2:])
    if recording.position is None or len(np.unique(recording.position)) > MAX_STRETCH_SHARE * len(t):
        return curve
    return np.concatenate([curve, recording.position[:, None] == np.unique(recording.position)[1:]], axis=1)


def _lacks_readout(recording: Recording, channel: Key) -> bool:
    """Return whether the axis that moves the line of sight in a channel has the same misses in all rows: no reading."""
    axis = read_axes(recording)[0 if channel == CHANNELS[1] else -1]
    misses = recording.channels["true_angle", axis] - recording.channels["gimbal_angle", axis]
    return bool(np.ptp(misses) < MIN_READOUT_ERROR_RAD)


def _readout_misses(rows: Rows, own: Sequence[int]) -> Array:
    """Return the misses of the readouts (n, k) [rad] of own axes from the angles at which the mount is on its stars.

    Near the pole of the outer axis no star determines the readouts: there they are zero.
    """
    S = rows.sensitivity(Stage.ENCODER)
    square = S[:, :, list(own)]
    determined = np.abs(np.linalg.det(square)) > MIN_POLE_COSINE
    out = np.zeros((len(S), S.shape[2]))
    misses = np.linalg.solve(square[determined], rows.residual[determined][..., None])[..., 0]
    out[np.ix_(determined, own)] = misses
    return out


def on_stars(recording: Recording) -> Stimulus:
    """Return the stimulus of the mount; every star is a visit of its own.

    A move is all of the way since an axis last turned back: by where the stars are, or by the readouts of axes
    that track. An axis that stands still or creeps goes on as it went, whatever its noise.
    """
    s = stimulus_from_angles(recording)
    n = len(recording.time)
    aimed = recording.platform.angles({a: x for (q, a), x in recording.channels.items() if q == "true_angle"}, (n,))
    track = without_jumps(np.where(tracking_axes(recording), s.readout, aimed), s.readout)
    moved = np.stack([since_turning(a) for a in track.T], axis=-1)
    number = np.arange(1, n + 1) if recording.position is None else recording.position
    return s.at(visit=np.arange(n), position=number, since_move=0 * s.time, move_angle=moved)


def follows_the_sky(recording: Recording) -> bool:
    """Return whether a mount follows the sky about its polar axis: a calm readout turns as the Earth does."""
    angle = np.unwrap(recording.angles()[:, tracking_axes(recording)], axis=0)
    rate = np.abs(angle[-1] - angle[0]) / max(float(np.ptp(recording.elapsed)), 1e-9)
    return bool(np.any(np.abs(rate / EARTH_RATE - 1) < MAX_RATE_ERROR))


def tracking_axes(recording: Recording) -> NDArray[np.bool_]:
    """Return which readouts (k,) follow the clock more closely than their stars do: those of a mount that tracks.

    There the noise is in where the star was seen, and readouts hold less of it. Where a mount goes from star to star
    both jump alike, and no axis is one of these.
    """
    out = []
    for axis in recording.platform.axis_names:
        both = (recording.channels.get((q, axis)) for q in ("gimbal_angle", "true_angle"))
        read, true = (0.0 if a is None else _roughness(recording.time, np.unwrap(a)) for a in both)
        out.append(read < MAX_ROUGHNESS_RATIO * true)
    return np.array(out, dtype=bool)


def _roughness(time: Array, angle: Array) -> float:
    """Median distance [rad] of an angle (n,) from the straight line between the rows before and after it."""
    span = np.where(time[2:] > time[:-2], time[2:] - time[:-2], 1.0)
    share = (time[1:-1] - time[:-2]) / span
    off = angle[1:-1] - (1 - share) * angle[:-2] - share * angle[2:]
    return float(np.median(np.abs(off))) if len(off) else 0.0


def without_jumps(angle: Array, readout: Array) -> Array:
    """Angles (n, k) [rad] that go on where a log starts anew after a full turn.

    A readout that is logged over more than a turn says how many turns there were; else the mount went the shorter way.
    Where these add up to more than its cables let it turn, it never went past where its log starts anew.
    """
    turns = 2 * np.pi * np.round((readout - angle) / (2 * np.pi))
    shorter = np.unwrap(angle, axis=0)
    counted = (np.ptp(readout, axis=0) > 2 * np.pi) | (np.ptp(shorter, axis=0) > MAX_TRAVEL_RAD)
    return np.where(counted, angle + turns, shorter)


def since_turning(angle: Array) -> Array:
    """Travel (n,) [rad] since the angle (n,) last turned back by more than `MIN_TURN_RAD`; zero at the first row."""
    moved = np.zeros_like(angle)
    began = furthest = angle[0]
    sense = 0.0
    for i, a in enumerate(angle.tolist()):
        if sense * (a - furthest) < -MIN_TURN_RAD or (sense == 0 and abs(a - furthest) > MIN_TURN_RAD):
            began, furthest, sense = furthest, a, np.sign(a - furthest)
        elif sense * (a - furthest) > 0:
            furthest = a
        moved[i] = a - began
    return moved


def read_axes(recording: Recording) -> tuple[str, ...]:
    """Return the axes of the mount that have a readout and a true angle, innermost first.

    Other axes of the platform belong to its drawing: the fixed tilt of a polar axis. Raises InputError if they are not
    the innermost axis or the two innermost ones, or if a single axis does not move the line of sight.
    """
    names = recording.platform.axis_names
    axes = tuple(a for a in names if ("gimbal_angle", a) in recording.channels)
    missing = [a for a in axes if ("true_angle", a) not in recording.channels]
    if missing:
        raise InputError(
            f"{recording.title!r} does not say where the stars were: it needs a true_angle along "
            f"{' and '.join(missing)}; add the column to [columns] of its recording.toml"
        )
    if len(axes) not in (1, 2) or names[: len(axes)] != axes:
        raise InputError(
            f"{recording.title!r} has readouts of {', '.join(axes) or 'no axis'}: a pointing run needs those of the "
            "innermost axis of its platform, or of the two innermost ones"
        )
    if len(axes) == 1 and recording.platform.axes[0].direction not in MOVED_BY:
        raise InputError(
            f"{axes[0]} of {recording.title!r} turns about the line of sight, x of the innermost axis, and does not "
            "move it; give the axis the direction y or z in [platform]"
        )
    return axes


def moved_channels(recording: Recording) -> tuple[Key, ...]:
    """Return the directions in which the read axes move the line of sight: both, or the one of a single axis."""
    axes = read_axes(recording)
    return CHANNELS if len(axes) == 2 else MOVED_BY[recording.platform.axes[0].direction]


def split_nights(recording: Recording) -> tuple[Recording, ...]:
    """Return the parts of a recording between pauses of more than `MIN_NIGHT_GAP_S`; without any, the recording."""
    cuts = [0, *(np.flatnonzero(np.diff(recording.time) > MIN_NIGHT_GAP_S) + 1).tolist(), len(recording.time)]
    return tuple(recording.select(slice(a, b)) for a, b in pairwise(cuts))
