r"""Checks of a unit turned in its place: triads exchanged or logged twice, units, and a delay between triads.

A unit that stays in its place feels gravity, however it turns. So the norm of its force is that of gravity in every
row, and the force f, fixed to the Earth, turns in the unit's axes as its gyroscopes read,

.. math:: \dot f = f \times \omega .

Accelerometers that come later by tau follow the rate of then, :math:`\omega(t - \tau)`; tau is where the two sides
of :math:`\dot f \times f \cdot \omega(t - \tau)` agree best.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np

from gimbalcal.checks.check import ROTATION, SOME_ROWS, Check, Examined
from gimbalcal.checks.forces import (
    FORCE_UNITS,
    MAX_NORM_ERROR,
    NO_GRAVITY,
    UNIT_RATIO_RANGE,
    unit_of_every_row,
    unit_of_some,
)
from gimbalcal.effects.effect import TRIAD
from gimbalcal.quantities import QUANTITIES
from gimbalcal.recording.dwell import MISSED_ROW_STEPS
from gimbalcal.recording.record import FORCE, RATE

MAX_LATENCY_S, MAX_LATENCY_STEPS = 0.1, 2.5  # a latency that belongs to sensors and their electronics is less
MAX_LAG_S = 30.0  # that is looked for
MIN_IMPROVEMENT = 2.0  # ratio of the force's unexplained change, squared, by which another lag must be better
MAX_ROWS = 100_000  # of the recording: a turn or two show a lag
MIN_ROWS = 100
MAX_READING = {FORCE: 100.0, RATE: 200.0}  # ten g; thirty revolutions a second
MAX_SHARE_BEYOND = 0.01  # of the rows; where more are beyond, the unit is wrong


def one_column_twice(e: Examined) -> str:
    """Refuse two axes that read the same in every row: one column, named twice."""
    for q in (FORCE, RATE):
        for a, b in combinations(TRIAD, 2):
            x, y = e.recording.channels[q, a], e.recording.channels[q, b]
            if np.ptp(x) > 0 and np.array_equal(x, y):
                return (
                    f"{q} {a} and {b} hold the same numbers in all {len(x)} rows, so one column "
                    "stands for both; name the right one in [columns]"
                )
    return ""


def impossible_readings(e: Examined) -> str:
    """Refuse a few rows that no unit in its place can read: faults of the logger."""
    for q in (FORCE, RATE):
        y = e.recording.triad(q)
        rows = np.flatnonzero((np.abs(y) > MAX_READING[q]).any(axis=1))
        if 0 < len(rows) < MAX_SHARE_BEYOND * len(y):
            axis = TRIAD[int(np.argmax(np.abs(y[rows[0]])))]
            others = f" (one of {len(rows)} such rows)" if len(rows) > 1 else ""
            return (
                f"at {e.recording.time[rows[0]]:.10g} s {q} {axis} is "
                f"{np.abs(y[rows[0]]).max():.3g} {QUANTITIES[q].si}, beyond anything that a unit turned in its place "
                f"can read{others}; put the mean of its neighbours there, or cut the recording there"
            )
    return ""


def triads_exchanged(e: Examined) -> str:
    """Refuse gravity among the rates, or nowhere."""
    g, rate = e.recording.site.gravity, e.recording.triad(RATE)
    size = float(np.median(np.linalg.norm(e.some_force, axis=1)))
    turned = float(np.median(np.linalg.norm(rate[:: max(1, len(rate) // SOME_ROWS)], axis=1)))
    if size >= NO_GRAVITY * g:
        return ""
    if 0.5 < turned / g < 1.5:
        return (
            f"the angular rate is {turned:.4g} rad/s in most rows and the specific force "
            f"{size:.3g} m/s^2, so the accelerometers stand in the gyroscopes' columns; exchange the quantities in "
            "[columns]"
        )
    units = (*FORCE_UNITS.values(), *(1 / unit for unit in FORCE_UNITS.values()), e.step)
    if any(UNIT_RATIO_RANGE[0] < size / g / unit < UNIT_RATIO_RANGE[1] for unit in units if unit):
        return ""
    return (
        f"the specific force is {size:.2g} m/s^2 in most rows, so gravity has been taken off "
        '(telephones call the rest "linear acceleration"); log what the accelerometers read, gravity included'
    )


def norm_from_rest_to_rest(e: Examined) -> str:
    """Refuse a norm that changes from rest to rest as no error of accelerometers makes it."""
    size = np.linalg.norm(e.force, axis=1) / e.recording.site.gravity
    if np.sqrt(np.mean((size - 1) ** 2)) <= MAX_NORM_ERROR:
        return ""
    reach = ", ".join(f"{a} {e.force[:, i].min():.3g} to {e.force[:, i].max():.3g}" for i, a in enumerate(TRIAD))
    return (
        f"at rest the force is {size.min():.2g} to {size.max():.2g} times gravity ({reach} "
        "m/s^2), where each accelerometer should go from -9.8 to 9.8 and their norm stay; one of them is not what "
        "[columns] says, or has an offset that is no bias"
    )


def lag_between_triads(e: Examined) -> str:
    """Refuse triads on two clocks: the force turns when the gyroscopes do."""
    t, step = e.recording.time[:MAX_ROWS], e.step
    if step <= 0 or len(t) < MIN_ROWS or np.diff(t).max() > MISSED_ROW_STEPS * step:
        return ""
    f, w = e.recording.triad(FORCE)[:MAX_ROWS], e.recording.triad(RATE)[:MAX_ROWS]
    w = w - np.median(w, axis=0)
    change = np.zeros_like(f)
    change[1:-1] = (f[2:] - f[:-2]) / (2 * step)
    n = 1 << (2 * len(t) - 1).bit_length()
    spectra = np.fft.rfft(np.cross(change, f), n, axis=0) * np.conj(np.fft.rfft(w, n, axis=0))
    correlation = np.fft.irfft(spectra.sum(axis=1), n)
    most = min(round(MAX_LAG_S / step), len(t) // 2)
    lags = np.concatenate([np.arange(most + 1), np.arange(-most, 0)])
    lag = int(lags[np.argmax(correlation[lags])])
    if abs(lag) * step <= max(MAX_LATENCY_S, MAX_LATENCY_STEPS * step):
        return ""

    def unexplained(k: int) -> float:
        rows = slice(max(k, 0), len(t) + min(k, 0))
        then = slice(max(-k, 0), len(t) + min(-k, 0))
        return float(np.mean((change[rows] - np.cross(f[rows], w[then])) ** 2))

    if unexplained(0) <= MIN_IMPROVEMENT * unexplained(lag):
        return ""
    first, second = ("accelerometers", "gyroscopes") if lag > 0 else ("gyroscopes", "accelerometers")
    return (
        f"the {first} come {abs(lag) * step:.3g} s after the {second}: what these say of the "
        "turns fits the force so, and not as the rows stand; put both on one clock (`gimbalcal new` joins two logs)"
    )


UNIT_IN_PLACE = ("latitude", f"physical {FORCE}", f"physical {RATE}")
CHECKS = (
    Check(one_column_twice, ROTATION, UNIT_IN_PLACE),
    Check(impossible_readings, ROTATION, UNIT_IN_PLACE),
    Check(triads_exchanged, ROTATION, UNIT_IN_PLACE),
    Check(unit_of_some, ROTATION, (*UNIT_IN_PLACE, "dwells")),
    Check(unit_of_every_row, ROTATION, UNIT_IN_PLACE),
    Check(norm_from_rest_to_rest, ROTATION, (*UNIT_IN_PLACE, "dwells")),
    Check(lag_between_triads, ROTATION, UNIT_IN_PLACE),
)
