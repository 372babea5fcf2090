r"""Time stamps that jitter although the sensor's clock is regular: times of arrival, not of sampling.

A reading is predicted by the cubic through its four neighbours: once at the times that were logged, once at the
numbers of the rows. What the noise of the five leaves is the same both ways,

.. math:: \left\langle \frac{(x_i - \sum_j w_j x_j)^2}{1 + \sum_j w_j^2} \right\rangle ,

so where a unit moves and the rows' numbers do clearly better, the stamps are wrong and the sampling was regular; where
the sampling was irregular and the stamps are right, they do better. Measured on the OpenAXES logs (a radio link, steps
that scatter by 30 %): rates 0.5 times as rough, and turns between rests that miss gravity by half.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from gimbalcal.number import Array

MIN_JITTER = 0.02  # of a step: less is below what any turn shows
MAX_ROUGHNESS = 0.9  # times the roughness with the stamps: white noise alone gives 1
GAP = 3.0  # steps; a longer one is a pause, and a clock of its own begins
MIN_ROWS = 100  # rows from one pause to the next to fit a clock to
MAX_DEVIATION_STEPS = 2.0  # by which a stamp may be off the regular clock, but for one in a hundred
ROWS_ASIDE = 10  # rows on each side of a long step that show whether later stamps stay late: then rows were lost


@dataclass(frozen=True)
class Jitter:
    """Scatter of the steps over the usual one, roughness on the regular clock over that with the stamps, rate [Hz].

    clock (n,) s: the regular clock, None where the stamps are too far from any.
    """

    scatter: float
    roughness: float
    rate: float
    clock: Array | None


def jitter_of(time: Array, row: Array, channels: Sequence[Array]) -> Jitter | None:
    """Return the jitter of the stamps `time` (n,) [s] of rows number `row` (n,); None where none shows."""
    n, dt = len(time), np.diff(time)
    if n < MIN_ROWS or not channels or dt.min() <= 0:
        return None
    step = float(np.median(dt / np.diff(row)))
    usual = dt < GAP * step
    scatter = float(np.std(dt[usual])) / step if usual.any() else 0.0
    if scatter < MIN_JITTER:
        return None
    five = usual[:-3] & usual[1:-2] & usual[2:-1] & usual[3:]
    if np.count_nonzero(five) < MIN_ROWS:
        return None
    rough = [
        [float(np.mean(_prediction_error(x, clock)[five] ** 2)) for clock in (row.astype(float), time)]
        for x in channels
    ]
    ratio = float(np.sqrt(np.mean([a / b for a, b in rough if b > 0]))) if any(b > 0 for _, b in rough) else 1.0
    clock = regular_clock(time, row)
    rate = 1 / float(np.mean(np.diff(time)[usual] / np.diff(row)[usual]))
    return Jitter(scatter, ratio, rate, clock)


def regular_clock(time: Array, row: Array, stated: bool = False) -> Array | None:
    """Return the regular clock (n,) [s] through the stamps, a line from pause to pause; None where it misses them.

    `stated`: the clock is known to be regular, however coarse the stamps are; None then if it runs backwards.
    """
    dt = np.diff(time)
    if not len(dt) or time[-1] <= time[0]:
        return None
    step = float(np.median(dt / np.diff(row))) or float((time[-1] - time[0]) / (row[-1] - row[0]))
    coarse = float(dt[dt > 0].min()) if np.median(dt) == 0 else 0.0
    pause = np.maximum(np.maximum(GAP * np.diff(row), 10.0) * step, GAP * coarse)
    edges = [0, *(np.flatnonzero(dt > pause) + 1), len(time)]
    out, deviations = np.array(time, dtype=float), []
    for start, stop in pairwise(edges):
        if stop - start >= (3 if stated else MIN_ROWS):
            k, t = row[start:stop] - row[start], time[start:stop] - time[start]
            k = k if stated else k + _lost_rows(t, k)
            out[start:stop] = time[start] + np.polyval(np.polyfit(k, t, 1), k)
            deviations.append(np.abs(out[start:stop] - time[start:stop]) / step)
    irregular = not stated and bool(deviations) and np.quantile(np.concatenate(deviations), 0.99) > MAX_DEVIATION_STEPS
    if not deviations or irregular or np.any(np.diff(out) <= 0):
        return None
    return out


def _lost_rows(t: Array, k: Array) -> Array:
    """Return the rows (n,) that were lost before each: where stamps are late by whole steps, and stay late."""
    far = min(2 * ROWS_ASIDE, len(t) - 1)
    step = float(np.median((t[far:] - t[:-far]) / (k[far:] - k[:-far])))
    late = t / step - k
    lost = np.zeros(len(t))
    jump = np.diff(late)
    for i in sorted(np.flatnonzero(jump > 0.5) + 1, key=lambda i: -jump[i - 1]):  # the clearest first
        before, after = late[max(0, i - ROWS_ASIDE) : i], late[i : i + ROWS_ASIDE]
        lost[i] = max(0.0, np.round(np.median(after) - np.median(before)))
        late[i:] -= lost[i]
    return np.cumsum(lost)


def _prediction_error(x: Array, clock: Array) -> Array:
    """Return readings (n - 4,) less the cubic through their four neighbours, over the noise of all five."""
    T = np.stack([clock[:-4], clock[1:-3], clock[3:-1], clock[4:]], axis=1) - clock[2:-2, None]
    X = np.stack([x[:-4], x[1:-3], x[3:-1], x[4:]], axis=1)
    w = np.ones_like(T)
    for j in range(4):
        for k in range(4):
            if k != j:
                w[:, j] *= T[:, k] / (T[:, k] - T[:, j])
    return np.asarray((x[2:-2] - (w * X).sum(1)) / np.sqrt(1 + (w**2).sum(1)))
