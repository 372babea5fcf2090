"""Columns of a log by their numbers: which of them are the triads, and in which units.

A guess says why it was made, so that whoever reads the header it goes into can correct it.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from itertools import combinations

import numpy as np

from gimbalcal.checks.forces import MAX_RANGE_ERROR, other_range
from gimbalcal.earth import G0
from gimbalcal.errors import InputError
from gimbalcal.guess.attitude import LENGTHS, MAX_NORM_ERROR
from gimbalcal.guess.clocks import may_be_clock, states_days
from gimbalcal.guess.column_names import NOT_A_TRIAD, by_name, differ_in_axis, is_counter, plain_name, unit_written
from gimbalcal.guess.log import Guess
from gimbalcal.number import Array
from gimbalcal.quantities import refuse_unit
from gimbalcal.recording.record import FORCE, RATE
from gimbalcal.units import to_si

MAX_RATE = 35.0  # rad/s, 2000 deg/s: the range of the fastest gyroscopes in such units
MIN_FULL_SCALE_ROWS = 5  # at the largest reading, which otherwise is reached once or twice
MIN_FAST_ROWS = 3  # beyond it, of a turn: fewer are broken lines of the log
USUAL_NOISE_DEG_S, MAX_BIAS_DEG_S = 0.05, 3.0  # of gyroscopes, from row to row and at rest
RATE_UNIT_COSTS = {"rad/s": 0.0, "deg/s": 0.0, "deg/h": 4.0}  # nats, of the units of gyroscopes before any number
MAX_BIAS_COST = 3.0  # nats: a larger one may be a steady turn
TOO_FAST_COST = 20.0  # nats, of a unit in which they would turn faster than `MAX_RATE`
CHIP_STEP_GAIN = 5.0  # nats, by which a unit is likelier in which they are quantised as a chip is
WHOLE_NUMBERS_COST = 6.0  # nats, of a unit of numbers that look like counts
UNLIKE_COUNTS_COST, POSSIBLE_COUNTS_COST = 12.0, 5.0  # nats, of counts; small whole numbers may be some
LSB_DEG_S = (1 / 131, 1 / 65.5, 1 / 32.8, 1 / 16.4, 1 / 16, 0.07, 0.035, 0.0175, 0.00875, 1 / 14.375, 0.05, 0.02)
FULL_SCALES_DEG_S = (250, 500, 1000, 2000)
ROUND = (0.1, 0.01, 0.001, 1e-4, 1e-5, 1e-6)  # steps in which numbers are printed, whatever they are
MAX_UNEVENNESS = 3.0  # nats, between the scatter of the axes of one triad
MIN_FILLED = 0.9  # of the rows of a column that is looked at
MIN_STAMPS = 10  # distinct values, at the least, of a clock without a name
MIN_STANDING_ROWS = 10  # on average, in which the place of a station is repeated
MIN_COUNT = 200.0  # whole numbers beyond this are counts
MAX_SAMPLED_ROWS = 500_000  # of a log, evenly spaced, that show its usual numbers
MIN_SHARE_OF_TURN, MAX_SPREAD_OF_DISTANCE = 0.6, 0.05  # of gravity: half the range of each axis, and 90 % of the spread
MIN_SHARE_OF_OFFSET = 0.03  # of the offset of a converter, which gravity is; steps of a reading at rest are less
MAX_SHARE_OF_SPREAD = 0.2  # of that about zero, which the spread about an offset is
MAX_QUATERNION_SPREAD = 2e-3  # of its length, which is 1 but for rounding
MAX_SPREAD_OF_ROUNDING = 1e-5  # of a length that no sensor reads, as it was computed
MAX_UNLIKE = 0.1  # of its length, which a filter changes of a vector
MAX_GRAVITY_ERROR = 0.3  # of gravity: bias and scale errors of any unit
_MATRIX = re.compile(r"(^|_)[a-z]?_?[0-3]_?[0-3](_|$)")  # elements of a matrix, M11, r_0_1
_PLACE = re.compile(r"position|translation|displacement")  # in metres, whatever moves
MM_S2 = 1e3 * G0  # gravity in mm/s^2, which counts may be, too
GRAVITY = {"m/s^2": G0, "g": 1.0, "ft/s^2": G0 / 0.3048, "mg": 1e3, "Gal": 100 * G0, "ug": 1e6, "mGal": 1e5 * G0}


def by_order(columns: Mapping[str, Array], hint: str = "") -> dict[str, Guess]:
    """Return guesses for columns without names: a first column that grows is the time, then forces, then rates.

    Forces are three columns whose length is gravity in some unit, or large enough for counts. hint: the quantity that
    the log is called after. Rows that lack a value, as lines that were cut do, are not looked at.
    """
    out = {}
    columns = {name: x for name, x in columns.items() if np.mean(np.isfinite(x)) > MIN_FILLED}
    filled = np.isfinite(np.stack([*columns.values()])).all(axis=0) if columns else np.zeros(0, dtype=bool)
    columns = {name: x[filled] for name, x in columns.items()} if filled.any() else {}
    growing = [
        name
        for name, x in columns.items()
        if (len(x) > 2 and np.all(np.diff(x) >= 0) and x[-1] > x[0]) or states_days(x)
    ]
    attitude = attitude_columns(columns)
    names = [n for n, x in columns.items() if n not in (*growing, *attitude) and not _stands_still(x)]
    if clock := next((n for n in growing if may_be_clock(columns[n]) and _has_stamps(columns[n])), ""):
        that = ", which" if clock == next(iter(columns)) else " that"
        out[clock] = Guess("time", "", "", f"the first column{that} grows from row to row")

    def values(triple: Sequence[str]) -> list[Array]:
        return [columns[name] for name in triple]

    triples = [names[k : k + 3] for k in range(0, len(names) - 2, 3)]
    if hint == RATE and len(triples) == 1:
        return out | _triads(triples, RATE, lambda _: "", "three columns in a log that is called after the gyroscope")
    windows = [names[k : k + 3] for k in range(len(names) - 2)]  # other columns may precede them
    forces = [t for t in windows if _may_be_force(values(t))]
    forces = [t for t in forces if t in triples or changes_direction(values(t)) or not _unlike_gravity(values(t))[0]]
    forces.sort(key=lambda t: _rank_as_force(values(t), t in triples))
    why = "three columns whose length hardly changes"
    if hint == FORCE and len(triples) == 1 and not forces and not _unlike_gravity(values(triples[0]))[0]:
        forces, why = triples, "three columns in a log that is called after the accelerometer"
    if forces:
        at = names.index(forces[0][0])
        triples = [names[k : k + 3] for k in (*range(at + 3, len(names) - 2, 3), *range(at - 3, -1, -3))]
    rates = [t for t in triples if t not in forces[:1] and not _points_everywhere(values(t))] if forces else []
    rates = [t for t in rates if not _same_vector(values(t), values(forces[0]))]
    rates.sort(key=lambda t: (not all(map(_returns_to_a_level, values(t))), _decades_from_zero(values(t))))
    out |= _triads(forces[:1], FORCE, lambda _: "", why)
    return out | _triads(rates[:1], RATE, lambda _: "", "three columns with the forces")


def attitude_columns(columns: Mapping[str, Array]) -> list[str]:
    """Return nine consecutive columns of a rotation matrix, or four of a quaternion; empty for none.

    The norm of a quaternion is the same at every row. Where it was measured rather than computed, the norm of any three
    of its columns must change: that of gravity at rest does not, with or without a small rate.
    """
    names = list(columns)
    for nine in (names[k : k + 9] for k in range(len(names) - 8)):
        R = np.stack([columns[n] for n in nine], axis=-1).reshape(-1, 3, 3)
        off = np.abs(R @ R.swapaxes(-1, -2) - np.eye(3)).max(axis=(1, 2))
        if len(off) and np.quantile(off, 0.99) < MAX_QUATERNION_SPREAD:
            return nine
    for four in (names[k : k + 4] for k in range(len(names) - 3)):
        q = [columns[n] for n in four]
        length = float(np.median(_length(q)))
        if not any(abs(length / one - 1) < MAX_NORM_ERROR for one in LENGTHS):
            continue
        of_four, *of_three = (
            float(np.quantile(np.abs(_length(x) / length - 1), 0.99)) for x in (q, *combinations(q, 3))
        )
        if of_four < MAX_SPREAD_OF_ROUNDING or of_four < MAX_QUATERNION_SPREAD < MAX_SPREAD_OF_DISTANCE < min(of_three):
            return four
    return []


def _stands_still(x: Array) -> bool:
    """Return whether a column (n,) holds one value, or a few values that it returns to, as the latitudes of stations.

    A sensor at rest returns to its values too, but these are steps of its quantisation; values that a recorder repeats
    are not returned to.
    """
    values, stretches = len(np.unique(x)), int(np.count_nonzero(np.diff(x))) + 1
    comes_back = 1.5 * values < stretches <= len(x) / MIN_STANDING_ROWS
    return values == 1 or (values > 2 and comes_back and quantum(x) == 0)


def _has_stamps(x: Array) -> bool:
    """Return whether a growing column has enough distinct values to be a clock, which the day of a date has not."""
    return bool(np.count_nonzero(np.diff(x)) + 1 >= min(MIN_STAMPS, len(x)))


def by_similar_names(columns: Mapping[str, Array]) -> dict[str, Guess]:
    """Return guesses for triads of neighbouring columns whose names differ in one letter, N_X N_Y N_Z or S1 S2 S3.

    The one whose length may be that of gravity holds the forces; the first that returns to one level at rest the rates.
    """
    names = list(columns)
    triples = [t for t in zip(names, names[1:], names[2:], strict=False) if _is_triad(t)]
    whole = {t: np.isfinite(np.stack([columns[n] for n in t])).all(axis=0) for t in triples}
    values = {t: [columns[n][whole[t]] for n in t] for t in triples if whole[t].any()}
    of_gravity = [t for t, x in values.items() if np.median(_length(x)) > MIN_COUNT or not _unlike_gravity(x)[0]]
    forces = [t for t in of_gravity if _of_constant_length(values[t]) and changes_direction(values[t])]
    others = [t for t in values if t not in forces]
    behind = {
        tuple(f"{n[:-1]}{int(n[-1]) + 3}" for n in t) for t in forces[:1] if t[0][-1] == "1"
    }  # imu_4 behind imu_3
    level = [t for t in others if all(map(_returns_to_a_level, values[t]))]
    rates = [t for t in others if t in behind] or level
    why = "three columns called alike,"
    out = _triads(forces[:1], FORCE, _unit_of_name, f"{why} whose length hardly changes")
    how = "that come back to one level" if rates == level else "that follow those of the forces"
    return out | _triads(rates[:1] if forces else [], RATE, _unit_of_name, f"{why} {how}")


def _unit_of_name(name: str) -> str:
    return unit_written(plain_name(name))


def _triads(triples: Sequence[Sequence[str]], quantity: str, unit: Callable[[str], str], why: str) -> dict[str, Guess]:
    return {n: Guess(quantity, axis, unit(n), why) for t in triples for axis, n in zip("xyz", t, strict=True)}


def _is_triad(triple: Sequence[str]) -> bool:
    """Return whether names that differ in one letter may be those of a triad of accelerometers or gyroscopes."""
    words = plain_name(triple[0])
    elsewhere = NOT_A_TRIAD.intersection(words.split("_")) or _MATRIX.search(words) or _PLACE.search(words)
    return differ_in_axis(triple) and not elsewhere


def changes_direction(triple: Sequence[Array]) -> bool:
    """Return whether a vector points elsewhere now and then; one of no length points nowhere."""
    triple = _sampled_rows(triple)
    length = _length(triple)
    read = length > 0
    return bool(read.any()) and any(np.ptp(x[read] / length[read]) > MAX_GRAVITY_ERROR for x in triple)


def _returns_to_a_level(x: Array) -> bool:
    """Return whether most of a column stays near one level that it leaves both ways."""
    level, low, high = np.median(x), np.min(x), np.max(x)
    at_level = np.abs(x - level) < 0.05 * (high - low)
    return bool(high > level > low and np.mean(at_level) > 0.5)


def _decades_from_zero(triple: Sequence[Array]) -> int:
    """Return how far a vector is from zero, in powers of ten of its scatter: a magnetometer at rest is farther off."""
    scatter = float(np.linalg.norm([np.mean(np.abs(np.diff(x))) for x in triple]))
    level = float(np.linalg.norm([np.median(x) for x in triple]))
    return round(np.log10(max(level / max(scatter, 1e-300), 1.0)))


def _sampled_rows(triple: Sequence[Array]) -> list[Array]:
    """Return rows of a triad, evenly spaced, that show its usual numbers."""
    return [x[:: max(1, len(x) // MAX_SAMPLED_ROWS)] for x in triple]


def _length(triple: Sequence[Array]) -> Array:
    return np.asarray(np.sqrt(sum(np.asarray(x) ** 2 for x in triple)))


def _of_constant_length(triple: Sequence[Array]) -> bool:
    r"""Return whether three columns are a vector of one length, as gravity is; counts about any centre.

    The centre c of the sphere follows from :math:`|x|^2 = 2 c \cdot x + k` by least squares.
    """
    length = _length(triple)
    middle = float(np.median(length))
    if middle > 0 and float(np.quantile(np.abs(length / middle - 1), 0.5)) < MAX_GRAVITY_ERROR / 3:
        return True
    if middle < MIN_COUNT or not changes_direction(triple):
        return False
    centre, size, spread = _sphere(triple)
    return spread < MAX_GRAVITY_ERROR / 6 and float(np.linalg.norm(centre)) < size


def _sphere(triple: Sequence[Array]) -> tuple[Array, float, float]:
    """Return centre and radius of a sphere through a vector, and the median of the distances from it, relative."""
    x = np.stack(triple, axis=-1)
    solution = np.linalg.lstsq(np.column_stack([2 * x, np.ones(len(x))]), _length(triple) ** 2, rcond=None)[0]
    radius = np.linalg.norm(x - solution[:3], axis=1)
    size = float(np.median(radius))
    return solution[:3], size, float(np.quantile(np.abs(radius / max(size, 1e-300) - 1), 0.5))


def _points_everywhere(triple: Sequence[Array]) -> bool:
    """Return whether a vector about any centre has one length and points all ways, as that of a magnetometer does.

    Rates that come back to one level lie on any sphere through it most of the time.
    """
    _, size, spread = _sphere(triple)
    widths = [float(np.ptp(x)) / 2 for x in triple]
    alike = spread < MAX_GRAVITY_ERROR / 6 and 0.6 * size < min(widths) <= max(widths) < 1.4 * size
    return alike and not all(map(_returns_to_a_level, triple))


def _same_vector(triple: Sequence[Array], other: Sequence[Array]) -> bool:
    """Return whether two triads hold the same vector, as before and behind a filter."""
    apart = _length([x - y for x, y in zip(triple, other, strict=True)])
    return bool(np.median(apart) < MAX_UNLIKE * np.median(_length(other)))


def _rank_as_force(triple: Sequence[Array], aligned: bool) -> tuple[bool, bool, bool, float, float]:
    """Return what sorts forces: gravity in some unit, axes that scatter alike, third columns, little spread first."""
    unlike, spread = _unlike_gravity(triple)
    uneven = _unevenness(triple)
    return unlike, uneven > MAX_UNEVENNESS, not aligned, 0.0 if unlike else round(spread, 2), 0.0 if aligned else uneven


def _unevenness(triple: Sequence[Array]) -> float:
    """Return by how much the scatter from row to row differs between three columns, in nats.

    Less than a tenth of a step of their quantisation shows no scatter: a level between two steps leaves one rarely.
    """
    scatter = [float(np.mean(np.abs(np.diff(x)))) for x in triple]
    least = max(0.1 * max(map(quantum, triple)), 1e-3 * max(scatter), 1e-300)
    return float(np.ptp(np.log(np.maximum(scatter, least))))


def _may_be_force(triple: Sequence[Array]) -> bool:
    """Return whether three columns are a vector of one length that gravity may have, in a unit or in counts.

    Of a vector that never turns the length is the only evidence: it may be off by half as much.
    """
    counted = float(np.median(_length(triple))) > MIN_COUNT and _unevenness(triple) < MAX_UNEVENNESS
    error = MAX_GRAVITY_ERROR if changes_direction(triple) else MAX_GRAVITY_ERROR / 2
    return _of_constant_length(triple) and (counted or not _unlike_gravity(triple, error)[0])


def _unlike_gravity(triple: Sequence[Array], error: float = MAX_GRAVITY_ERROR) -> tuple[bool, float]:
    """Return whether a vector's length is gravity in no common unit, and its spread: a bias of rates is short."""
    length = _length(triple)
    middle = float(np.median(length))
    alike = any(abs(middle / size - 1) < error for size in GRAVITY.values())
    return not alike, float(np.quantile(np.abs(length / middle - 1), 0.9))


def in_another_unit(triad: Sequence[Array], named: str) -> bool:
    """Return whether accelerometers x, y, z (n,) read the length of gravity throughout, but not in the unit named."""
    triad = _sampled_rows(triad)
    if not len(triad[0]):
        return False
    unlike, spread = _unlike_gravity(triad)
    off = abs(float(np.median(_length(triad))) / GRAVITY.get(named, np.nan) - 1)
    return not unlike and spread < MAX_GRAVITY_ERROR and off > 1 - MAX_GRAVITY_ERROR


def unit_of_force(triad: Sequence[Array]) -> tuple[str, str]:
    """Return the unit of accelerometers x, y, z (n,) by the length of gravity, and why.

    Where they point all ways about a centre farther from zero than any bias is, the length says nothing.
    """
    triad = _sampled_rows(triad)
    lengths = _length(triad)
    length = float(np.median(lengths))
    if offset := _offset_of_counts(triad, lengths):
        return "count", offset
    for unit, size in GRAVITY.items():
        if abs(length / size - 1) < MAX_GRAVITY_ERROR:
            return unit, f"at rest the three together are {length:.4g}, and gravity is {size:.4g} {unit}"
    whole = _are_counts(triad)
    if not whole and abs(length / MM_S2 - 1) < MAX_RANGE_ERROR:
        return "mm/s^2", f"at rest the three together are {length:.4g} and no whole numbers, and gravity is {MM_S2:.4g}"
    if length > MIN_COUNT:
        kind = "whole numbers" if whole else "numbers"
        return "count", f"{kind}, {length:.4g} together: counts, whose scale the calibration finds"
    alike = length > 0 and float(np.quantile(np.abs(lengths / length - 1), 0.9)) < MAX_RANGE_ERROR
    for unit in ("g", "m/s^2"):
        if alike and (range_ratio := other_range(length / GRAVITY[unit])):
            return "count", (
                f"at rest the three together are {length:.4g}, {range_ratio:g} times gravity in {unit}, as where the "
                "range is another than the one that was read: counts, whose scale the calibration finds"
            )
    return "m/s^2", f"nothing shows it: together they are {length:.4g}, which gravity is in no common unit"


def _offset_of_counts(triad: Sequence[Array], lengths: Array) -> str:
    """Return what shows that accelerometers x, y, z (n,) count from an offset; empty where nothing does.

    They point all ways about a centre farther from zero than gravity is long, and their distance from it is constant,
    unlike their length (n,).
    """
    if len(triad) != 3 or not len(lengths):
        return ""
    centre, size, _ = _sphere(triad)
    distance = _length([x - c for x, c in zip(triad, centre, strict=True)])
    middle = float(np.median(lengths))
    spread, about_zero = (float(np.quantile(np.abs(x), 0.9)) for x in (distance - size, lengths - middle))
    all_ways = min(float(np.ptp(x)) / 2 for x in triad) > MIN_SHARE_OF_TURN * size > MIN_SHARE_OF_OFFSET * middle
    constant = spread < min(MAX_SPREAD_OF_DISTANCE * size, MAX_SHARE_OF_SPREAD * about_zero)
    if not (all_ways and constant and float(np.linalg.norm(centre)) > size):
        return ""
    at = ", ".join(f"{c:.4g}" for c in centre)
    return f"gravity is {size:.4g} about {at}: counts with an offset, which the calibration finds"


def _full_scale(x: Array) -> float:
    """Return the value that the largest readings (n,) share, as those of a sensor at its full scale; else 0."""
    most = float(np.max(np.abs(x), initial=0.0))
    return most if np.count_nonzero(np.abs(x) > (1 - 1e-3) * most) >= MIN_FULL_SCALE_ROWS else 0.0


def costs_of_rate(triad: Sequence[Array], counted: bool) -> dict[str, tuple[float, str]]:
    r"""Return how unlikely each unit of gyroscopes x, y, z (n,) is by their numbers alone, in nats, and what shows it.

    Gyroscopes of no kind turn faster than `MAX_RATE`; their noise from row to row is some 0.05 deg/s, less or more by
    e^2, :math:`\frac{1}{2} (\ln(\sigma / 0.05) / 2)^2`, their bias a few deg/s. The step in which they are quantised is
    one of a chip's in one unit only. counted: the accelerometers of the log are counts.
    """
    every = max(1, len(triad[0]) // MAX_SAMPLED_ROWS)
    levels = [float(np.median(x[::every])) for x in triad]
    far = [max(x.max() - level, level - x.min()) for x, level in zip(triad, levels, strict=True) if len(x)]
    fastest = float(max(far, default=0.0))
    scatter = max(float(np.median(np.abs(x[1::every] - x[:-1:every]))) / 0.954 if len(x) > 1 else 0.0 for x in triad)
    bias = max(map(abs, levels))
    whole, step = _are_counts(triad), max(map(quantum, triad))
    full_scale = max(map(_full_scale, triad))
    out = {}
    for unit, prior in RATE_UNIT_COSTS.items():
        size = float(to_si(1.0, unit))
        sigma = np.degrees(max(scatter, step / 3) * size)
        cost = prior + (0.5 * (np.log(sigma / USUAL_NOISE_DEG_S) / 2) ** 2 if sigma > 0 else 0.0)
        why = [f"{sigma:.2g} deg/s from row to row"] if sigma > 0 else []
        excess = np.log(np.degrees(bias * size) / MAX_BIAS_DEG_S) if bias > 0 else 0.0
        cost += min(0.5 * max(0.0, excess) ** 2, MAX_BIAS_COST)
        if fastest * size > MAX_RATE and _rows_beyond(triad, levels, MAX_RATE / size) >= MIN_FAST_ROWS:
            cost, why = cost + TOO_FAST_COST, [f"up to {fastest:.4g}, more than any hand turns"]
        if any(abs(np.degrees(step * size) / lsb - 1) < 1e-3 for lsb in LSB_DEG_S) and step not in ROUND:
            cost, why = (
                cost - CHIP_STEP_GAIN,
                [f"in steps of {np.degrees(step * size):.4g} deg/s, as chips are quantised"],
            )
        if any(abs(np.degrees(full_scale * size) / most - 1) < 2e-3 for most in FULL_SCALES_DEG_S):
            cost -= CHIP_STEP_GAIN
            why.append(f"cut off at {np.degrees(full_scale * size):.4g} deg/s, the full scale of a chip")
        if whole and (counted or scatter > 3.0):
            cost += WHOLE_NUMBERS_COST
        out[unit] = float(cost), ", ".join(why) or f"up to {fastest:.4g}"
    range_in_counts = f"whole numbers up to {fastest + bias:.4g}: counts, whose scale the turns show"
    if fastest > 0 and (counted or whole):
        counts = 0.0 if whole and (counted or fastest > MIN_COUNT) else POSSIBLE_COUNTS_COST
    else:
        counts = UNLIKE_COUNTS_COST
    return {**out, "count": (counts, range_in_counts)}


def _rows_beyond(triad: Sequence[Array], levels: Sequence[float], limit: float) -> int:
    """Return the most rows in which a column (n,) of a triad is farther than a limit from its level."""
    return max(int(np.count_nonzero(np.abs(x - level) > limit)) for x, level in zip(triad, levels, strict=True))


def quantum(x: Array) -> float:
    """Return the step of which a column (n,) holds multiples; 0 where it has none."""
    levels = np.unique(x[:20_000])
    if len(levels) < 3 or len(levels) > 0.5 * min(len(x), 20_000):
        return 0.0
    step = float(np.diff(levels).min())
    steps = np.diff(levels)
    step, offset, k = float(np.median(steps[steps < 1.5 * step])), levels - levels[0], 2
    while step > 0 and k < len(levels):  # numbers are rounded, so the step follows from ever longer distances
        step, k = float(offset[k] / max(np.round(offset[k] / step), 1.0)), 2 * k
    at = offset / step if step > 0 else offset + 0.5
    return step if np.mean(np.abs(at - np.round(at)) < 0.1) > 0.9 else 0.0


def signed_counts(columns: Mapping[str, Array]) -> tuple[dict[str, Array], tuple[str, ...]]:
    """Return columns (n,) of which those of two's complement have their signs again, and their names.

    A count of 16 bits that is logged without sign jumps by more than half its range where it passes zero, and does not
    once the upper half of the range is negative. The others of its triad, which are called alike, are such counts, too;
    none is if the signs bring one of them more jumps. A column that only grows is a counter.
    """
    half, full = 2.0**15, 2.0**16

    def with_signs(x: Array) -> Array:
        return np.where(x < half, x, x - full)

    def jumps(x: Array) -> int:
        return int(np.count_nonzero(np.abs(np.diff(x)) > half))

    whole = {n: x[np.isfinite(x)] for n, x in columns.items() if np.fmax.reduce(x, initial=0.0) > half}
    whole = {n: x for n, x in whole.items() if len(x) and x.min() >= 0 and half < x.max() < full}
    whole = {n: x for n, x in whole.items() if np.all(x == np.round(x))}
    signed = {n: with_signs(x) for n, x in whole.items()}
    gained = {n: jumps(signed[n]) - jumps(x) for n, x in whole.items()}
    shown = {n for n, x in signed.items() if gained[n] < 0 and not jumps(x) and not _is_clock(n, x)}
    names = list(columns)
    for triad in filter(_is_triad, zip(names, names[1:], names[2:], strict=False)):
        if shown.intersection(triad):
            of_counts = whole.keys() & set(triad)
            shown = shown - of_counts if any(gained[n] > 0 for n in of_counts) else shown | of_counts
    kept = {n: with_signs(x) if n in shown else x for n, x in columns.items()}
    return kept, tuple(n for n in names if n in shown)


def _is_clock(name: str, x: Array) -> bool:
    """Return whether a column (n,) is a clock or counter by its name, or grows from row to row but for a few."""
    guess = by_name(name)
    grows = bool(np.mean(np.diff(x) > 0) > MIN_FILLED)
    return (guess is not None and guess.quantity == "time") or is_counter(name) or grows


def _are_counts(triad: Sequence[Array]) -> bool:
    return all(np.all(x == np.round(x)) for x in triad)


def is_unit_of(quantity: str, unit: str) -> bool:
    """Return whether a unit belongs to the quantity."""
    try:
        refuse_unit(unit, quantity)
    except InputError:
        return False
    return True
