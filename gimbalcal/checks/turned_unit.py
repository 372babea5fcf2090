r"""A unit turned in its place that cannot be right: triads exchanged or logged twice, units, triads apart in time.

A unit that stays where it is feels gravity, however it turns. So the norm of its force is that of gravity in every
row, and the force f, fixed to the Earth, turns in the unit's axes as its gyroscopes say,

.. math:: \dot f = f \times \omega .

Accelerometers that come later by tau follow the rate of then, :math:`\omega(t - \tau)`; tau is where the two sides
of :math:`\dot f \times f \cdot \omega(t - \tau)` agree best.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np

from gimbalcal.checks.axes import AXES
from gimbalcal.checks.forces import ALIKE, FAR_OFF, FORCE_UNITS, GONE, check_each_norm, check_magnitude
from gimbalcal.errors import InputError
from gimbalcal.number import Array
from gimbalcal.recording.dwell import MISSED, dwell_means
from gimbalcal.recording.record import FORCE, RATE, Recording

LATE, STEPS = 0.1, 2.5  # s and steps; a latency that belongs to sensors and their electronics is less
LONGEST = 30.0  # s of lag that is looked for
BETTER = 2.0  # times: what is left of the force's change falls by more where the lag is another
ROWS = 100_000  # of the recording, at most: a turn or two tell a lag
MOST, UNIT = {FORCE: 100.0, RATE: 200.0}, {FORCE: "m/s^2", RATE: "rad/s"}  # ten g; thirty revolutions a second


def check_turned(recording: Recording) -> None:
    """Raise InputError where forces and rates of a unit turned in its place at a known latitude cannot be right.

    The recording has its rests as positions.
    """
    if recording.site.latitude is None or any(set(recording.axes(q)) != set(AXES) for q in (FORCE, RATE)):
        return
    if any(recording.counted(q) for q in (FORCE, RATE)):
        return
    _check_columns(recording)
    _check_spikes(recording)
    force = recording.triad(FORCE)
    few = force[:: max(1, len(force) // 5000)]
    step = float(np.median(np.diff(recording.time))) if len(recording.time) > 1 else 0.0
    _check_triads(recording, few, step)
    if recording.position is not None and recording.position.any():
        rests = dwell_means(recording)
        check_each_norm(rests, rests.triad(FORCE))
    check_magnitude(recording, few, step)
    if recording.position is not None and recording.position.any():
        _check_spread(recording, rests.triad(FORCE))
    _check_lag(recording, step)


def _check_columns(recording: Recording) -> None:
    """Two axes that read the same in every row are one column, named twice."""
    for q in (FORCE, RATE):
        for a, b in combinations(AXES, 2):
            x, y = recording.channels[q, a], recording.channels[q, b]
            if np.ptp(x) > 0 and np.array_equal(x, y):
                raise InputError(
                    f"{recording.label}: {q} {a} and {b} hold the same numbers in all {len(x)} rows, so one column "
                    "stands for both; name the right one in [columns]"
                )


def _check_spikes(recording: Recording) -> None:
    """A few rows that no unit in its place can read are faults of the logger; if many do, the unit is wrong."""
    for q in (FORCE, RATE):
        y = recording.triad(q)
        beyond = np.abs(y) > MOST[q]
        rows = np.flatnonzero(beyond.any(axis=1))
        if 0 < len(rows) < 0.01 * len(y):
            axis = AXES[int(np.argmax(np.abs(y[rows[0]])))]
            others = f" (one of {len(rows)} such rows)" if len(rows) > 1 else ""
            raise InputError(
                f"{recording.label}: at {recording.time[rows[0]]:.10g} s {q} {axis} is "
                f"{np.abs(y[rows[0]]).max():.3g} {UNIT[q]}, beyond anything that a unit turned in its place can read"
                f"{others}; put the mean of its neighbours there, or cut the recording there"
            )


def _check_triads(recording: Recording, force: Array, step: float) -> None:
    """Gravity among the rates, or nowhere."""
    g = recording.site.gravity
    size = float(np.median(np.linalg.norm(force, axis=1)))
    if size > 0.5 * g:
        return
    rate = recording.triad(RATE)
    turned = float(np.median(np.linalg.norm(rate[:: max(1, len(rate) // 5000)], axis=1)))
    if 0.5 < turned / g < 1.5 and size < GONE * g:
        raise InputError(
            f"{recording.label}: the angular rate is {turned:.4g} rad/s in most rows and the specific force "
            f"{size:.3g} m/s^2, so the accelerometers stand in the gyroscopes' columns; exchange the quantities in "
            "[columns]"
        )
    if size < GONE * g and not _like_a_unit(size / g, step):
        raise InputError(
            f"{recording.label}: the specific force is {size:.2g} m/s^2 in most rows, so gravity has been taken off "
            '(telephones call the rest "linear acceleration"); log what the accelerometers read, gravity included'
        )


def _like_a_unit(ratio: float, step: float) -> bool:
    """Whether a size over gravity is that of gravity in another unit, or of an increment over a step [s]."""
    others = (*FORCE_UNITS.values(), *(1 / size for size in FORCE_UNITS.values()), step)
    return any(ALIKE[0] < ratio / other < ALIKE[1] for other in others if other)


def _check_spread(recording: Recording, force: Array) -> None:
    """Whatever is wrong with an accelerometer, a norm that changes so much from rest to rest is not that of gravity."""
    size = np.linalg.norm(force, axis=1) / recording.site.gravity
    if np.sqrt(np.mean((size - 1) ** 2)) > FAR_OFF:
        reach = ", ".join(f"{a} {force[:, i].min():.3g} to {force[:, i].max():.3g}" for i, a in enumerate(AXES))
        raise InputError(
            f"{recording.label}: at rest the force is {size.min():.2g} to {size.max():.2g} times gravity ({reach} "
            "m/s^2), where each accelerometer should go from -9.8 to 9.8 and their norm stay; one of them is not what "
            "[columns] says, or has an offset that is no bias"
        )


def _check_lag(recording: Recording, step: float) -> None:
    """Triads on two clocks: the force turns when the gyroscopes do."""
    t = recording.time[:ROWS]
    if step <= 0 or len(t) < 100 or np.diff(t).max() > MISSED * step:
        return
    f, w = recording.triad(FORCE)[:ROWS], recording.triad(RATE)[:ROWS]
    w = w - np.median(w, axis=0)
    change = np.zeros_like(f)
    change[1:-1] = (f[2:] - f[:-2]) / (2 * step)
    turn = np.cross(change, f)
    n = 1 << (2 * len(t) - 1).bit_length()
    together = np.fft.irfft((np.fft.rfft(turn, n, axis=0) * np.conj(np.fft.rfft(w, n, axis=0))).sum(axis=1), n)
    most = min(round(LONGEST / step), len(t) // 2)
    lags = np.concatenate([np.arange(most + 1), np.arange(-most, 0)])
    lag = int(lags[np.argmax(together[lags])])
    if abs(lag) * step <= max(LATE, STEPS * step):
        return

    def left(k: int) -> float:
        rows = slice(max(k, 0), len(t) + min(k, 0))
        then = slice(max(-k, 0), len(t) + min(-k, 0))
        return float(np.mean((change[rows] - np.cross(f[rows], w[then])) ** 2))

    if left(0) > BETTER * left(lag):
        first, second = ("accelerometers", "gyroscopes") if lag > 0 else ("gyroscopes", "accelerometers")
        raise InputError(
            f"{recording.label}: the {first} come {abs(lag) * step:.3g} s after the {second}: what these say of the "
            "turns fits the force so, and not as the rows stand; put both on one clock (`gimbalcal new` joins two logs)"
        )
