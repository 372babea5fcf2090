r"""Find the dwells of a rig that was moved by hand or without a position channel: where its sensors are quiet.

Variance detector of Tedaldi, Pretto and Menegatti (ICRA 2014), with window and noise floor taken from the recording
itself instead of from a known initial rest. In a sliding window of m samples, each channel has variance :math:`v_c`;
its floor is a low quantile of it, divided by that of :math:`\chi^2_{m-1}/(m-1)`, and at least
:math:`q^2/4`, the variance of readings that go to and fro between two steps of its quantisation. A sample rests where

.. math:: \max_c \; v_c / F_c(m) < T = 10 ,

which leaves room for a table that shakes a little and for the slow part of the noise. A stretch whose mean ratio is
more than three times that of most of them is rejected, and one within which the force moves by more than
`MAX_NOISE_SHARE` of it and more than its noise, :math:`\sqrt{T \sum_c F_c}`: there the unit still moved.

**Whether anything rests.** The floor of noise does not depend on the window; that of motion grows with it, as
:math:`m^2` for a steady turn and as m for a random walk. The window is the longest of at most one second with

.. math:: Q_q\left(\sum_c v_c(4m)\right) < 1.25 \, Q_q\left(\sum_c v_c(m)\right)

of low quantiles over all windows, by chi^2 of the channels that take part, so that a window is quiet in all
channels at once. Gyroscopes, where they were logged, have to show no growth from the short windows to the long one that
holds them, in the quietest of the long ones; or a triad has a scatter that no motion has, as flicker and random walks
of a unit on a table grow as motion does. Where dwells are shorter than four seconds the growth is that of the dwells,
and the window becomes shorter; where it has as few rows as noise allows, it is compared with three or two of its kind.
A floor of more than `MAX_NOISE_SHARE` of gravity is rejected as the vibration of a drive.

Gyroscopes, where they were logged, also reject rests of the accelerometers: those in which a gyroscope scatters by
more than 20 times its usual scatter at rest, or turns steadily (about the vertical, which accelerometers do not
sense). Two stretches between which the unit was knocked but not turned are one dwell.
"""

from __future__ import annotations

import weakref
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import reduce

import numpy as np
from numpy.typing import NDArray

from gimbalcal.number import Array
from gimbalcal.recording.noise_levels import pooled_scatter
from gimbalcal.recording.record import FORCE, RATE, Recording

WINDOW = 1.0  # s; the longest: longer than the ringing of a hand, shorter than a rest
SHORTEST_DWELL = 0.4  # s; that a hand holds
ROWS = 9  # of the longest window at least
MIN_ROWS = 5  # of a window: below that the variance of noise itself scatters by the threshold
MAX_LONGER_WINDOWS = 4  # windows at most, whose floor is compared
OVERLAP = 16  # windows of that length that hold a row: their floor is needed to a few percent
GROWTH = 1.25  # of the floor from one window to `MAX_LONGER_WINDOWS` of them, at rest
QUIET_FORCE = 1e-3  # of the force; no hand and no vehicle holds still to a milli-g, whatever the colour of its noise
QUIET_RATE = 1e-3  # rad/s
MAX_NOISE_SHARE = 0.03  # of the force, in a row: no accelerometer is as noisy, but the vibration of a drive or a drone
THRESHOLD = 10.0  # in units of the floor; anything from 10 to 20 finds the same 38 rests in the Xsens set of ICRA 2014
PAUSE = 60.0  # s; rows on both sides of a longer gap are not one rest (a unit turned in a shorter one shows it)
FLOORS = ((0.10, -1.2816), (0.03, -1.8808))  # quantile and normal deviate: rests that fill a tenth of the time, or less
LEAST_AT_REST = min(share for share, _ in FLOORS)  # of the rows, that are found as rests
UNUSUAL_VARIANCE_RATIO = 3.0  # times that of most rests: a hand that still moves, among rests on a table
SHAKEN_SCATTER_RATIO = 20.0  # times the usual scatter of a gyroscope at rest: in the hand half of all rests reach ten
WINDOWS_PER_SUM = 2  # windows in one sum: next to a turn, gyroscopes of 1e-4 deg/h are at the end of a double
PIECES = 200  # of them at a time: their sums stay in the cache of a processor
RAW_TURNING = 100.0  # times the usual distance from the level, of counts of unknown scale
USUAL_ROWS = 100_000  # evenly spaced, that show the usual force, and what gyroscopes usually do at rest
TURNING = np.radians(1.0)  # rad/s off the usual level, more than the Earth's rate and any drift of a bias

_LAST: list[tuple[list[weakref.ref[Array]], NDArray[np.int64]]] = []
"""Columns that were searched last, and their positions: checks and estimator of a long recording ask for the same."""


def detect_rests(
    time: Array,
    channels: Mapping[str, Array],
    rates: Mapping[str, Array] | None = None,
    rate_unit: float = 1.0,
    gravity: bool = True,
) -> NDArray[np.int64]:
    """Return the position of each row, (n,): 1, 2, ... in order of time within rests, 0 elsewhere.

    time (n,) s; channels (n,) each, in any unit: only ratios of variances count. Accelerometers find the rests: in the
    hand, a gyroscope is never at rest; `rates` (n,) each, in a `rate_unit` [rad/s], 0 where its size is not known,
    reject some of them. gravity: the three channels are accelerometers. All rows are one rest where the recording is
    shorter than a few windows, none where its quietest windows are those of a motion.
    """
    n = len(time)
    step = float(np.median(np.diff(time), overwrite_input=True)) if n > 1 else WINDOW
    if n < MAX_LONGER_WINDOWS * max(ROWS, round(WINDOW / step)) or not channels:
        return np.ones(n, dtype=np.int64)
    rates = rates or {}
    triads = [[*t.values()] for t in (channels, rates) if t]
    position = np.zeros(n, dtype=np.int64)
    some = slice(None, None, max(1, n // USUAL_ROWS))
    level = float(np.median(np.linalg.norm(_some_rows(triads[0], some), axis=1)))
    quiet_rate = QUIET_RATE / rate_unit if rate_unit else 0.0
    small = (QUIET_FORCE * level if gravity else quiet_rate, quiet_rate)
    vibration = MAX_NOISE_SHARE * level if gravity and len(channels) == 3 else np.inf
    m, floor, variances = _longest_window(triads, n, step, small, (vibration, np.inf))
    if m == 0:
        return position
    for v, f in zip(variances, floor, strict=True):
        v[:] = np.divide(v, f, out=v) if f > 0 else np.where(v > 0, np.inf, 0.0)
        np.maximum(variances[0], v, out=variances[0])
    restless = np.pad(variances[0], m // 2, mode="edge")
    del variances, v  # each is as large as a channel
    still = restless <= _threshold(m)
    if rates and still.any():
        still &= ~_turning_rows(triads[1], m, still, rate_unit)
    pause = np.diff(time, prepend=time[0])
    paused = pause > max(10 * step, PAUSE)
    starts, stops = _stretches(still, paused)
    for row in np.flatnonzero(pause > 10 * step):  # longer than all else of a stretch, it is no part of a rest
        k = int(np.searchsorted(starts, row, side="right")) - 1
        paused[row] |= k >= 0 and row < stops[k] and 2 * pause[row] > time[stops[k] - 1] - time[starts[k]]
    starts, stops = _stretches(still, paused)
    mean = np.array([restless[start:stop].mean() for start, stop in zip(starts, stops, strict=True)])
    kept = stops - starts >= max(m, SHORTEST_DWELL / step)
    if gravity and len(channels) == 3:
        most = max(MAX_NOISE_SHARE * level, float(np.sqrt(THRESHOLD * floor.sum())))
        moves = [motion(_some_rows(triads[0], slice(a, b))) for a, b in zip(starts, stops, strict=True)]
        kept &= np.array(moves) <= most
    kept &= mean <= UNUSUAL_VARIANCE_RATIO * np.median(mean[kept]) if kept.any() else True
    same = np.zeros(0, dtype=bool)
    if kept.any():
        same = _unmoved_stretches(triads, starts[kept], stops[kept], m, step, rate_unit)
    number = np.cumsum(~same | paused[starts[kept]])
    for start, stop, k in zip(starts[kept], stops[kept], number, strict=True):
        position[start:stop] = k
    return position


def motion(force: Array) -> float:
    """Return by how much a force (n, 3) moves within a stretch, beyond vibration: the median of means over eighths."""
    size = len(force) // 8
    means = force[: 8 * size].reshape(8, size, -1).mean(axis=1) if size else force
    return float(np.median(np.linalg.norm(means - means.mean(axis=0), axis=1)))


def with_rests_as_positions(recording: Recording) -> Recording:
    """Return the recording with its rests as positions, and the scatter of its rows at rest.

    A multi-position recording without positions is searched for rests, as `read` does with a file; what a recording
    has already stays. Rows that are means say nothing of the samples, and a channel that never moves has no scatter.
    """
    if recording.kind.in_positions and recording.has(FORCE):
        recording = with_rests(recording)
    if recording.scatter or recording.kind.sighting or len(recording.time) == 0:
        return recording
    sigmas = pooled_scatter(recording.time, recording.position, recording.channels, recording.weight)
    scatter = {key: sigma for key, sigma in sigmas.items() if sigma > 0}
    return replace(recording, scatter=scatter) if scatter else recording


def with_rests(recording: Recording) -> Recording:
    """Return the recording with its rests as positions, detected where its sensors are quiet if none are numbered."""
    if recording.position is not None:
        return recording
    forces, rates = ({a: recording.channels[q, a] for a in recording.axes(q)} for q in (FORCE, RATE))
    arrays = (recording.time, *forces.values(), *rates.values())
    before = [each() for each in _LAST[0][0]] if _LAST else []
    if len(before) != len(arrays) or any(a is not b for a, b in zip(arrays, before, strict=True)):
        position = detect_rests(
            recording.time, forces or rates, rates, 0.0 if recording.counted(RATE) else 1.0, bool(forces)
        )
        _LAST[:] = [([weakref.ref(each) for each in arrays], position)]
    return replace(recording, position=_LAST[0][1].copy())


def _longest_window(
    triads: Sequence[Sequence[Array]], n: int, step: float, small: Sequence[float], large: Sequence[float]
) -> tuple[int, Array, list[Array]]:
    """Return the rows m of the longest window whose floor is noise, or 0, the floors of the first triad, and its
    variances in every window.

    small, large: scatter of each triad that no motion has, whether it grows with the window or not, and that no rest
    has beyond the steps of its quantisation.
    """
    least = [max(_quantum(x) for x in triad) ** 2 / 4 for triad in triads]  # a channel may show one value of it only
    most = [max(limit**2, 4 * quantised) for limit, quantised in zip(large, least, strict=False)]
    m, longer = max(ROWS, round(WINDOW / step)) | 1, MAX_LONGER_WINDOWS  # odd: the window has a middle
    while longer > 1 and longer * m * step >= SHORTEST_DWELL:
        if n > (longer + 1) * m:
            quiet, variances = np.ones(len(FLOORS), dtype=bool), list[Array]()
            for triad, quantised, limit, loud in zip(triads, least, small, most, strict=False):
                alike = bool(variances)
                short, long = zip(*(_short_and_long(x, m, longer, alike) for x in triad), strict=True)
                variances = variances or [*short]
                quiet &= _is_quiet(short, long, m, longer, len(triad) * quantised, limit, loud, alike)
                if not quiet.any():
                    break
            else:
                q, z = FLOORS[int(np.argmax(quiet))]
                floor = np.array([np.quantile(v, q) for v in variances]) / _chi_square(m - 1, z)
                return m, np.maximum(_floor_of_most(floor, variances, q), least[0]), variances
        m, longer = (min(int(m / 1.2) | 1, m - 2), MAX_LONGER_WINDOWS) if m > MIN_ROWS else (m, longer - 1)
    return 0, np.zeros(0), []


def _floor_of_most(floor: Array, variances: Sequence[Array], q: float) -> Array:
    """Return floors (C,); a channel that is far quieter in a few rests than in most has the floor of most.

    A table that rocks tilts gravity, which shows in the axes that lie level and not in the one that stands upright.
    """
    together = reduce(np.add, variances)
    quiet = together <= THRESHOLD * np.quantile(together, q)
    out = np.array(floor)
    for c, v in enumerate(variances):
        if 2 * np.count_nonzero(quiet & (v > UNUSUAL_VARIANCE_RATIO * floor[c])) > np.count_nonzero(quiet):
            out[c] = np.median(v[quiet])
    return out


def _is_quiet(
    short: Sequence[Array],
    long: Sequence[Array],
    m: int,
    longer: int,
    quantised: float,
    limit: float,
    loud: float,
    alike: bool,
) -> NDArray[np.bool_]:
    """Return by each of `FLOORS` whether the floor of a triad does not grow from short windows to long ones.

    A window counts by the sum of all channels: turned about x, the x axis is quiet and the others are not. alike: the
    short windows are those of the long ones, so that a knock, which is in both, is no motion. loud: the variance beyond
    which a floor is that of a drive that vibrates: a shorter window may find the rest before it started.
    """
    a, b = (reduce(np.add, v) for v in (short, long))
    shares = [float(np.mean(v)) for v in short]
    channels = max(1.0, sum(shares) ** 2 / max(float(np.dot(shares, shares)), 1e-300))  # by Satterthwaite
    order = np.argsort(b) if alike else None
    out = np.zeros(len(FLOORS), dtype=bool)
    for i, (q, z) in enumerate(FLOORS):
        if order is None:
            floor, grown = (
                np.quantile(v, q) / _chi_square(channels * (r * m - 1), z) for v, r in ((a, 1), (b, longer))
            )
        else:
            floor, grown = (v[order[: max(1, round(q * len(b)))]].mean() for v in (a, b))
        grown = max(grown, quantised)
        out[i] = (grown <= GROWTH * max(floor, quantised) or grown < limit**2) and floor <= loud
    return out


def _short_and_long(x: Array, m: int, longer: int, alike: bool) -> tuple[Array, Array]:
    """Return the variance of x (n,) in every window of m samples, and in some windows of `longer` times m samples.

    alike: instead of the former, the mean variance of the short windows in each of the long ones; both are then without
    bias in white noise.
    """
    mean, variance = _window_statistics(x, m)
    count, step = len(mean) - (longer - 1) * m, max(1, longer * m // OVERLAP)
    parts = [slice(k, k + count, step) for k in range(0, longer * m, m)]
    level = np.asarray(sum(mean[part] for part in parts) / longer)
    within = np.asarray(sum(variance[part] for part in parts) / longer)
    between = np.asarray(sum((mean[part] - level) ** 2 for part in parts) / longer)
    return within * m / (m - 1) if alike else variance, (within + between) * longer * m / (longer * m - 1)


def _quantum(x: Array) -> float:
    """Return the step of a coarse quantisation of readings (n,), where a tenth of the rows change; else 0."""
    step, changes = step_of_most_changes(x)
    return 0.0 if changes < 0.1 * len(x) else step


def step_of_most_changes(x: Array) -> tuple[float, int]:
    """Return the least change of readings (n,) where most changes are as small, else 0; and how many rows change."""
    changes = np.diff(x)
    np.abs(changes, out=changes)
    none = ~(changes > 1e-9 * np.ptp(x))  # rounding of decimals is no step
    count = len(changes) - int(np.count_nonzero(none))
    changes[none] = np.inf
    step = float(changes.min(initial=np.inf))
    return step if 2 * np.count_nonzero(changes < 1.5 * step) > count else 0.0, count


def _chi_square(dof: float, z: float) -> float:
    """Return a quantile of chi^2 / dof, by Wilson and Hilferty (1931)."""
    return float((1 - 2 / (9 * dof) + z * np.sqrt(2 / (9 * dof))) ** 3)


def _threshold(m: int) -> float:
    """Return `THRESHOLD`, or what white noise alone reaches in windows of few samples, once in ten million."""
    return max(THRESHOLD, _chi_square(m - 1, 5.2))


def _unmoved_stretches(
    triads: Sequence[Sequence[Array]],
    starts: NDArray[np.int64],
    stops: NDArray[np.int64],
    m: int,
    step: float,
    rate_unit: float,
) -> NDArray[np.bool_]:
    """Return which stretches (k,), of m rows at least, go on with the one before: knocked in between, but not turned.

    The level of the force is the same to the noise of a row, or of the means of few rows, and never leaves it by more
    than a rest allows; a turn about the vertical shows in the integral of the rates, beyond that of their noise. Rates
    of unknown size cannot deny one.
    """
    force, rate = triads[0], triads[1] if len(triads) > 1 else ()
    out = np.zeros(len(starts), dtype=bool)
    if rate and not rate_unit:
        return out
    for k in range(1, len(starts)):
        before, after = slice(stops[k - 1] - m, stops[k - 1]), slice(starts[k], starts[k] + m)
        y = _some_rows(force, before)
        level, noise = y.mean(axis=0), float(np.linalg.norm(y.std(axis=0)))
        if np.linalg.norm(_some_rows(force, after).mean(axis=0) - level) > noise * max(1.0, np.sqrt(2 * THRESHOLD / m)):
            continue
        way = slice(before.stop - m // 2, after.start + m // 2 + 1)
        means = np.stack([_window_statistics(x[way], m)[0] for x in force], axis=1)
        shaken = np.sqrt(THRESHOLD) * noise
        if np.linalg.norm(means - level, axis=1).max() > shaken:
            continue
        if rate:
            w, rows, angle = _some_rows(rate, before), way.stop - way.start, step * rate_unit
            turn = np.cumsum(_some_rows(rate, way) - w.mean(axis=0), axis=0) * angle
            random = THRESHOLD * float(w.var(axis=0).sum()) * angle**2 * (rows + rows**2 / m)  # of sum and mean
            if np.linalg.norm(turn, axis=1).max() > np.hypot(shaken / np.linalg.norm(level), np.sqrt(random)):
                continue
        out[k] = True
    return out


def _some_rows(channels: Sequence[Array], which: slice) -> Array:
    """Return some of the rows (n,) of each channel, (rows, C)."""
    return np.stack([x[which] for x in channels], axis=1)


def _turning_rows(rates: Sequence[Array], m: int, rest: NDArray[np.bool_], rate_unit: float) -> NDArray[np.bool_]:
    """Return rows (n,) in which a gyroscope is shaken or turns, measured against what it does in the rows of `rest`.

    m: rows of a window.
    """
    at_rest = np.flatnonzero(rest)
    some = at_rest[:: max(1, len(at_rest) // USUAL_ROWS)]
    windows = np.clip(some - m // 2, 0, len(rest) - m)  # those about these rows
    turned = np.zeros(len(rest) - m + 1, dtype=bool)
    for x in rates:
        mean, variance = _window_statistics(x, m)
        shaken = SHAKEN_SCATTER_RATIO * float(np.median(np.sqrt(variance[windows])))
        turned |= variance > shaken**2
        level = np.abs(np.subtract(mean, np.median(x[some]), out=mean), out=mean)
        slow = TURNING / rate_unit if rate_unit else RAW_TURNING * float(np.median(level[windows]))
        turned |= level > max(slow, shaken)
    return np.pad(turned, m // 2, mode="edge")


def _window_statistics(x: Array, m: int) -> tuple[Array, Array]:
    """Return the mean and variance (n - m + 1,) of x (n,) in every window of m samples.

    Sums are taken over `WINDOWS_PER_SUM` windows at a time,
    about their own mean: over an hour at 100 Hz they would drown 1 ug.
    """
    count, width = len(x) - m + 1, WINDOWS_PER_SUM * m
    of = -(-count // width)  # pieces, each overlapping the next by a window
    mean, variance = np.empty((of, width)), np.empty((of, width))
    sums = np.empty((min(of, PIECES), width + m), dtype=complex)  # of values, and of squares as imaginary part
    for first in range(0, of, PIECES):
        stop = min(first + PIECES, of)
        part = x[first * width : stop * width + m - 1]
        if stop == of:
            part = np.pad(part, (0, (stop - first) * width + m - 1 - len(part)), mode="edge")
        pieces = np.lib.stride_tricks.sliding_window_view(part, width + m - 1)[::width]
        level = pieces.mean(axis=1, keepdims=True)
        y = sums[: stop - first]
        y[:, 0] = 0.0
        np.subtract(pieces, level, out=y.real[:, 1:])
        np.multiply(y.real, y.real, out=y.imag)
        np.cumsum(y, axis=1, out=y)
        added, about, v = y[:, m:] - y[:, :-m], mean[first:stop], variance[first:stop]
        np.divide(added.real, m, out=about)
        np.divide(added.imag, m, out=v)
        np.maximum(np.subtract(v, about * about, out=v), 0.0, out=v)
        about += level
    return mean.ravel()[:count], variance.ravel()[:count]


def _stretches(flags: NDArray[np.bool_], cut: NDArray[np.bool_]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return begin and end of the runs of flags; none goes on over a row that is `cut` from the one before."""
    before, after = np.concatenate([[False], flags[:-1]]), np.concatenate([flags[1:], [False]])
    cut_after = np.concatenate([cut[1:], [True]])
    return np.flatnonzero(flags & (~before | cut)), np.flatnonzero(flags & (~after | cut_after)) + 1
