r"""Find the dwells of a rig that was moved by hand or without a position channel: where its sensors are quiet.

Variance detector of Tedaldi, Pretto and Menegatti (ICRA 2014), with a noise floor taken from the
recording itself instead of from a known initial rest. In a sliding window of one second, m samples, each channel has
variance :math:`v_c`; its floor :math:`F_c` is the 10 % quantile of :math:`v_c`, which lies within the rests as long as
they fill a tenth of the time. A sample rests where

.. math:: \max_c \; v_c / F_c < T = 10 .

For white noise :math:`v_c / F_c` scatters by :math:`\sqrt{2/m}` about little more than 1; T leaves room for a table
that shakes a little and for the slow part of the noise. Gyroscopes, where they were logged, can only take away from
that: what the accelerometers call a rest is none where a gyroscope scatters by more than 20 times what it usually does
at rest, or turns on and on (about the vertical, which no accelerometer sees). Each rest loses a window at both ends,
where the move has begun or still rings, and must then last a second to count.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gimbalcal.number import Array
from gimbalcal.recording.record import FORCE, RATE, Recording
from gimbalcal.recording.scatter import pooled

WINDOW = 1.0  # s; longer than the ringing of a hand, shorter than a rest
THRESHOLD = 10.0  # in units of the floor; anything from 10 to 20 finds the same 38 rests in the Xsens set of ICRA 2014
SHORTEST = 1.0  # s, after trimming
PAUSE = 60.0  # s; rows on both sides of a longer gap are not one rest (a unit turned in a shorter one shows it)
FLOOR = 0.10  # quantile
SHAKEN = 20.0  # times the usual scatter of a gyroscope at rest: in the hand half of all rests reach ten
SUMMED = 2  # windows in one sum: next to a turn, gyroscopes of 1e-4 deg/h are at the end of a double
PIECES = 1000  # of them at a time: the sums of a day would take a gigabyte
RAW_TURNING = 100.0  # times the usual distance from the level, of counts whose size nobody knows
TURNING = np.radians(1.0)  # rad/s off the usual level, more than the Earth's rate and any drift of a bias


def detect(
    time: Array, channels: Mapping[str, Array], rates: Mapping[str, Array] | None = None, raw: bool = False
) -> NDArray[np.int64]:
    """Return the position of each row, (n,): 1, 2, ... in order of time within rests, 0 elsewhere.

    time (n,) s; channels (n,) each, in any unit: only ratios of variances count. Accelerometers find the rests: in the
    hand, a gyroscope finds none at all; `rates` (n,) each, in rad/s or `raw`, say which of them are none. All rows are
    one rest where the recording is shorter than a few windows.
    """
    n = len(time)
    step = float(np.median(np.diff(time))) if n > 1 else WINDOW
    m = max(5, round(WINDOW / step)) | 1  # odd: the window has a middle
    if n < 4 * m or not channels:
        return np.ones(n, dtype=np.int64)
    still = np.ones(n, dtype=bool)
    for x in channels.values():
        still &= _restlessness(x, m) < _threshold(m)
    if rates:
        still &= ~_turned(rates, _eroded(still, m), m, raw)
    quiet = _eroded(still, m)
    paused = np.diff(time, prepend=time[0]) > max(10 * step, PAUSE)
    starts, stops = _stretches(quiet, paused)
    long_enough = stops - starts >= max(2, round(SHORTEST / step))
    position = np.zeros(n, dtype=np.int64)
    for k, (start, stop) in enumerate(zip(starts[long_enough], stops[long_enough], strict=True), start=1):
        position[start:stop] = k
    return position


def completed(recording: Recording) -> Recording:
    """Return the recording with its rests as positions, and the scatter of its rows at rest.

    A multi-position recording without positions is searched for rests, as `read` does with a file; what a recording
    has already stays. Rows that are means say nothing of the samples, and a channel that never moves has no scatter.
    """
    if recording.kind.in_positions and recording.has(FORCE):
        recording = with_rests(recording)
    if recording.scatter or recording.kind.sighting or len(recording.time) == 0:
        return recording
    sigmas = pooled(recording.time, recording.position, recording.channels, recording.weight)
    scatter = {key: sigma for key, sigma in sigmas.items() if sigma > 0}
    return replace(recording, scatter=scatter) if scatter else recording


def with_rests(recording: Recording) -> Recording:
    """Return the recording with its rests as positions, detected where its sensors are quiet if none are numbered."""
    if recording.position is not None:
        return recording
    forces, rates = ({a: recording.channels[q, a] for a in recording.axes(q)} for q in (FORCE, RATE))
    return replace(recording, position=detect(recording.time, forces or rates, rates, recording.counted(RATE)))


def _threshold(m: int) -> float:
    """Return `THRESHOLD`, or what white noise alone reaches in windows of few samples, once in ten million.

    The variance of m samples is chi^2 of m - 1 degrees of freedom; quantiles as of Wilson and Hilferty (1931).
    """
    low, high = ((1 - 2 / (9 * (m - 1)) + z * np.sqrt(2 / (9 * (m - 1)))) ** 3 for z in (-1.2816, 5.2))
    return max(THRESHOLD, float(high / low))


def _restlessness(x: Array, m: int) -> Array:
    """Return the variance in a window of m samples about each, over its floor; the ends repeat the nearest window."""
    variance = _windows(x, m)[1]
    floor = float(np.quantile(variance, FLOOR))
    ratio: Array = variance / floor if floor > 0 else np.where(variance > 0, np.inf, 1.0)
    return np.pad(ratio, m // 2, mode="edge")


def _turned(rates: Mapping[str, Array], rest: NDArray[np.bool_], m: int, raw: bool) -> NDArray[np.bool_]:
    """Return rows (n,) in which a gyroscope is shaken or turns, measured against what it does in the rows of `rest`."""
    turned = np.zeros(len(rest), dtype=bool)
    for x in rates.values() if rest.any() else ():
        mean, variance = _windows(x - np.median(x[rest]), m)
        scatter = np.pad(np.sqrt(variance), m // 2, mode="edge")
        usual = float(np.median(scatter[rest]))
        turned |= scatter > SHAKEN * usual
        level = np.abs(np.pad(mean, m // 2, mode="edge"))
        slow = RAW_TURNING * float(np.median(level[rest])) if raw else TURNING
        turned |= level > max(slow, SHAKEN * usual)
    return turned


def _windows(x: Array, m: int) -> tuple[Array, Array]:
    """Return the mean and variance (n - m + 1,) of x (n,) in every window of m samples.

    Sums are taken over `SUMMED` windows at a time, about their own mean: over an hour at 100 Hz they would drown 1 ug.
    """
    count = len(x) - m + 1
    of = -(-count // (SUMMED * m))  # pieces, each overlapping the next by a window
    mean, variance = np.empty((of, SUMMED * m)), np.empty((of, SUMMED * m))
    for first in range(0, of, PIECES):
        stop = min(first + PIECES, of)
        part = x[first * SUMMED * m : stop * SUMMED * m + m - 1]
        padded = np.pad(part, (0, (stop - first) * SUMMED * m + m - 1 - len(part)), mode="edge")
        pieces = np.lib.stride_tricks.sliding_window_view(padded, (SUMMED + 1) * m - 1)[:: SUMMED * m]
        level = pieces.mean(axis=1, keepdims=True)
        y = np.zeros((stop - first, pieces.shape[1] + 1))
        y[:, 1:] = pieces - level
        square = np.cumsum(y * y, axis=1)
        np.cumsum(y, axis=1, out=y)
        about = (y[:, m:] - y[:, :-m]) / m
        variance[first:stop] = np.maximum((square[:, m:] - square[:, :-m]) / m - about * about, 0.0)
        mean[first:stop] = about + level
    return mean.ravel()[:count], variance.ravel()[:count]


def _eroded(quiet: NDArray[np.bool_], m: int) -> NDArray[np.bool_]:
    """Return which samples (n,) have only quiet ones within half a window; the ends of the recording are no move."""
    n, half = len(quiet), m // 2
    loud = np.zeros(n + 1, dtype=np.int64)
    np.cumsum(~quiet, out=loud[1:])
    eroded = np.empty(n, dtype=bool)
    eroded[half : n - half] = loud[2 * half + 1 :] == loud[: n - 2 * half]
    eroded[:half] = loud[half + 1 : 2 * half + 1] == 0
    eroded[n - half :] = loud[n - 2 * half : n - half] == loud[n]
    return eroded


def _stretches(flags: NDArray[np.bool_], cut: NDArray[np.bool_]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return begin and end of the runs of flags; none goes on over a row that is `cut` from the one before."""
    before, after = np.concatenate([[False], flags[:-1]]), np.concatenate([flags[1:], [False]])
    cut_after = np.concatenate([cut[1:], [True]])
    return np.flatnonzero(flags & (~before | cut)), np.flatnonzero(flags & (~after | cut_after)) + 1
