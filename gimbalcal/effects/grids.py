"""Starting values of a search for a non-linear constant, as the effect declares and a recording bounds them."""

from __future__ import annotations

import dataclasses

import numpy as np

from gimbalcal.effects.effect import Grid, Stimulus
from gimbalcal.number import Array
from gimbalcal.units import from_si

STARTING_VALUES = 7  # of a constant before refinement
MAX_ORDERS_TRIED = 12  # whole numbers that are all tried; of more, `STARTING_VALUES`
MAX_ORDERS_SCANNED = 700  # whole numbers at the most
MAX_INSTANTS = 50  # of a recording in which nothing moves
MAX_VISITS = 150  # of visits at which something may have happened: of more, so many evenly among them
MIN_SETTING_STEP_RAD = 0.02  # rad; settings of a gimbal nearer than this are one
PLACES_OF_A_TURN = 16384  # of a turn, in which a gimbal stands or not: 0.4 mrad
RESOLVED_COHERENCE, ALIASED_COHERENCE = (
    0.5,
    0.9,
)  # of the settings that are in phase: as many as tell an order from none, or do not

Constant = dataclasses.Field[float]


def kind(f: Constant) -> Grid:
    """Return the kind of a constant."""
    value: Grid = f.metadata["grid"]
    return value


def limits(f: Constant, s: Stimulus) -> tuple[float, float]:
    """Return the range of a constant that this recording could distinguish; one value twice where there is none."""
    low, high = float(f.metadata["low"]), float(f.metadata["high"])
    of, last = kind(f), float(np.max(s.time))
    if of is Grid.EPOCH:
        return 0.0, float(s.onwards[-1])
    if of in (Grid.LAG, Grid.PERIOD):
        step = float(np.median(np.diff(s.time))) if len(s.time) > 1 else 0.0
        least = 2.0 if of is Grid.PERIOD else 0.5  # of a lag of less than half a step only the first row tells
        low, high = max(low, least * step), min(high, 3 * last)
    if of is Grid.WHOLE:
        high = min(high, highest_order(s))
    return (low, high) if low < high else (low, low)


def range_beyond(f: Constant, x: float) -> tuple[str, ...]:
    """Return the ends of the range of a constant in its unit of print where a value x [SI] is outside; else nothing."""
    low, high, unit = float(f.metadata["low"]), float(f.metadata["high"]), f.metadata["unit"]
    return () if low <= x <= high else tuple(f"{from_si(end, unit):g}" for end in (low, high))


def grid(f: Constant, s: Stimulus) -> Array:
    """Return starting values of a constant."""
    of, last = kind(f), float(np.max(s.time))
    low, high = limits(f, s)
    if of is Grid.POSITION:
        return np.unique(s.position).astype(float)
    if of is Grid.SPAN:
        return np.array([last])
    if of is Grid.FOUND:
        return np.array([min(max(_default(f), low), high)])
    if of is Grid.JUMP:  # steps are even, as the phase of a wave is no likelier near zero
        return np.unique([*np.linspace(low, high, STARTING_VALUES), min(max(_default(f), low), high)])
    if of is Grid.EPOCH:
        first = np.flatnonzero(np.diff(s.visit)) + 1
        first = first[(first > 1) & (first < len(s.time) - 1)]  # before or after one row it is an error of it
        starts = s.onwards[first]
        few = np.unique(np.linspace(0, len(starts) - 1, min(len(starts), MAX_VISITS)).round().astype(int))
        return starts[few] - 1e-3 if len(starts) else np.linspace(0, s.onwards[-1], MAX_INSTANTS)[1:-1]
    if of is Grid.DECAY:
        return np.concatenate([[low], np.geomspace(1 / last, high, 5)])
    if of is Grid.PERIOD:
        return periods(_default(f), low, high, last)
    if of is Grid.WHOLE:
        every = np.arange(low, high + 0.5)
        return (
            every if len(every) <= MAX_ORDERS_TRIED else np.unique(np.round(np.geomspace(low, high, STARTING_VALUES)))
        )
    return values_between(f, low, high, STARTING_VALUES)


def _default(f: Constant) -> float:
    return f.default if isinstance(f.default, float) else 0.0


def values_between(f: Constant, low: float, high: float, count: int) -> Array:
    """Return `count` values from `low` to `high`: even steps, logarithmic for a time constant or a positive value."""
    if low == high:
        return np.array([low])
    logarithm = kind(f) in (Grid.VALUE, Grid.LAG) and float(f.metadata["low"]) > 0 and low > 0
    return np.geomspace(low, high, count) if logarithm else np.linspace(low, high, count)


def periods(usual: float, low: float, high: float, duration: float) -> Array:
    """Return the usual period, and others within 5 % of it in steps of one third of a line width (at most 9)."""
    low, high = max(low, 0.95 * usual), min(high, 1.05 * usual)
    step = usual**2 / duration / 3
    m = min(4, int((high - low) / 2 / step)) if step > 0 else 0
    return usual + step * np.arange(-m, m + 1) if low < high else np.array([usual])


def highest_order(s: Stimulus) -> float:
    r"""Return the highest harmonic of an angle that settings distinguish from lower ones: below half the order of
    aliasing.

    .. math:: m < M / 2, \qquad \left| \frac{1}{n} \sum_k e^{i M \theta_k} \right| > 0.9

    with M the first order at which all settings of a gimbal coincide again: three where all stand on multiples of 45
    degrees. Settings that stand on no common step, as stars do, tell every order.
    """
    return max(highest_orders(s), default=0.0)


def highest_orders(s: Stimulus) -> tuple[float, ...]:
    """Return of each gimbal the highest harmonic that its own settings distinguish from lower ones."""
    return tuple(_highest_resolved_order(angle) for angle in s.readout.T)


def _highest_resolved_order(angle: Array) -> float:
    """Return the highest order that the settings `angle` (n,) of a gimbal resolve, by their spectrum; 0 for one."""
    occupied = np.zeros(PLACES_OF_A_TURN)
    occupied[
        np.unique(np.round(np.mod(angle, 2 * np.pi) / (2 * np.pi) * PLACES_OF_A_TURN).astype(int) % PLACES_OF_A_TURN)
    ] = 1.0
    spectrum = np.abs(np.fft.rfft(occupied)) / occupied.sum()
    resolved_orders = np.flatnonzero(spectrum[: PLACES_OF_A_TURN // 4] < RESOLVED_COHERENCE)
    if not len(resolved_orders):
        return 0.0
    aliased = np.flatnonzero(spectrum[resolved_orders[0] : PLACES_OF_A_TURN // 4] > ALIASED_COHERENCE)
    return float(np.ceil((resolved_orders[0] + aliased[0]) / 2) - 1) if len(aliased) else PLACES_OF_A_TURN / 8


def resolved_numbers(f: Constant, s: Stimulus) -> Array:
    r"""Return every whole number that a recording distinguishes, for a scan: in steps of a third of a line or more.

    .. math:: \Delta m = \frac{2 \pi}{3 R}, \qquad m < \pi / \Delta\theta

    with R the range of the gimbal that moves most and the step between one row and the next, where a gimbal sweeps.
    """
    low, high = float(f.metadata["low"]), float(f.metadata["high"])
    angle = s.readout[:, int(np.argmax(np.ptp(s.readout, axis=0)))]
    step = float(np.median(np.abs(np.diff(angle)))) if len(angle) > 1 else MIN_SETTING_STEP_RAD
    nyquist = np.pi / step if 0 < step < MIN_SETTING_STEP_RAD else highest_order(s)
    every = max(1, int(2 * np.pi / max(float(np.ptp(angle)), 1e-9) / 3))
    return np.arange(low, min(high, nyquist, low + MAX_ORDERS_SCANNED * every) + 0.5, every)
