"""What the columns of a log most likely hold: from their names, and their units from the numbers.

A guess says why it was made, so that whoever reads the header it goes into can correct it.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from gimbalcal.earth import G0
from gimbalcal.errors import InputError
from gimbalcal.number import Array
from gimbalcal.units import check

FORCE, RATE = "specific_force", "angular_rate"
GIMBALS = ("platform", "inner", "middle", "outer")
AXIS = {"x": "x", "y": "y", "z": "z", "0": "x", "1": "y", "2": "z"}

_TIME = re.compile(
    r"^(t|time|times|timestamp|timestamps|ts|clock|date|datetime|utc|sec|secs|seconds|millis|micros|ms|us|epoch)(_|$)"
)
_TRIADS = (
    (
        FORCE,
        re.compile(
            r"^(linear_acceleration|linacc|accelerometer|acceleration|accel|accl|acc|specific_force|force|fs|f|a)_?([xyz012])(_|$)"
        ),
    ),
    (
        RATE,
        re.compile(r"^(angular_velocity|angular_rate|angvel|gyroscope|gyro|gyr|omega|rate|om|w|g)_?([xyz012])(_|$)"),
    ),
)
_SPELLINGS = {  # how people write units into names
    "m/s^2": "m_s2 ms2 mps2 m_s_2 m_s_s", "g": "g", "mg": "mg", "ug": "ug",
    "deg/s": "dps deg_s degs deg_per_s deg_sec", "deg/h": "deg_h dph", "rad/s": "rad_s rads rad_sec rps",
    "count": "lsb count counts raw", "s": "s sec seconds", "ms": "ms msec millis", "us": "us usec micros",
    "ns": "ns nsec", "min": "min", "h": "h", "degC": "degc c", "K": "k", "deg": "deg", "rad": "rad", "arcsec": "arcsec",
}  # fmt: skip
_UNITS = {spelling: unit for unit, all_of_it in _SPELLINGS.items() for spelling in all_of_it.split()}
RATES = (1.0, 10_000.0)  # Hz that inertial sensors are logged at
LARGEST_RATE = 35.0  # rad/s, 2000 deg/s: more no hand and no gyroscope of that make turns
RAW = 200.0  # whole numbers beyond this are counts
NEAR = 0.3  # of gravity


@dataclass(frozen=True)
class Guess:
    """What one column holds, in words of recording.toml, and why; the unit may be left open."""

    quantity: str
    axis: str
    unit: str
    why: str


def plain(name: str) -> str:
    """A name as it is compared: lower case, one underscore for whatever stands between words.

    >>> plain("Acc_X [m/s^2]"), plain(" linear_acceleration.x"), plain("GyroX(dps)")
    ('acc_x_m_s2', 'linear_acceleration_x', 'gyro_x_dps')
    """
    name = re.sub(r"([a-z])([XYZ])\b", r"\1_\2", name.strip())
    return re.sub(r"_+", "_", re.sub(r"[^a-z0-9]+", "_", name.replace("^", "").lower())).strip("_")


def by_name(name: str) -> Guess | None:
    """What a column's name says, or None."""
    words = plain(name)
    if _TIME.match(words):
        return Guess("time", "", _unit_in(words, _TIME), f"its name {name.strip()!r}")
    for quantity, pattern in _TRIADS:
        found = pattern.match(words)
        if found:
            return Guess(quantity, AXIS[found[2]], _unit_in(words, pattern), f"its name {name.strip()!r}")
    if re.match(r"^(temperature|temp|tmp)(_|$)", words):
        return Guess("temperature", "", _unit_in(words, re.compile(r"^(temperature|temp|tmp)_?")) or "degC",
                     f"its name {name.strip()!r}")  # fmt: skip
    if re.match(r"^(position|pos|posture|station|rest|segment)(_(no|nr|number|id))?$", words):
        return Guess("position", "", "", f"its name {name.strip()!r}")
    gimbal = re.match(rf"^({'|'.join(GIMBALS)})(_|$)", words)
    if gimbal:
        return Guess("gimbal_angle", gimbal[1], _unit_in(words, re.compile(rf"^{gimbal[1]}_?")) or "deg",
                     f"its name {name.strip()!r}")  # fmt: skip
    return None


def _unit_in(words: str, pattern: re.Pattern[str]) -> str:
    rest = pattern.sub("", words).strip("_")
    return _UNITS.get(rest, "")


def by_order(columns: Mapping[str, Array]) -> dict[str, Guess]:
    """A table without names: a first column that grows is the time, then forces, then rates, as most loggers write."""
    names = list(columns)
    out = {}
    first = columns[names[0]]
    if len(first) > 2 and np.all(np.diff(first) >= 0) and first[-1] > first[0]:
        out[names[0]] = Guess("time", "", "", "the first column, which grows from row to row")
        names = names[1:]
    triples = [names[k : k + 3] for k in range(0, len(names) - 2, 3)]
    forces = [t for t in triples if _turns_about_a_constant([columns[n] for n in t])]
    for quantity, group in ((FORCE, forces[:1]), (RATE, [t for t in triples if t not in forces[:1]][:1])):
        for triple in group:
            for axis, name in zip("xyz", triple, strict=True):
                what = "whose length hardly changes" if quantity == FORCE else "beside the forces"
                out[name] = Guess(quantity, axis, "", f"three columns {what}")
    return out


def _turns_about_a_constant(triple: Sequence[Array]) -> bool:
    """Whether three columns are a vector of one length, as gravity is."""
    length = np.sqrt(sum(np.asarray(x) ** 2 for x in triple))
    middle = float(np.median(length))
    return middle > 0 and float(np.quantile(np.abs(length / middle - 1), 0.5)) < NEAR / 3


def unit_of_force(triad: Sequence[Array]) -> tuple[str, str]:
    """Unit of accelerometers x, y, z (n,) by the length of gravity, and why."""
    length = float(np.median(np.sqrt(sum(np.asarray(x) ** 2 for x in triad))))
    for unit, size in (("m/s^2", G0), ("g", 1.0), ("mg", 1e3), ("ug", 1e6)):
        if abs(length / size - 1) < NEAR:
            return unit, f"at rest the three together are {length:.4g}, and gravity is {size:.4g} {unit}"
    if all(np.all(x == np.round(x)) for x in triad) and length > RAW:
        return "count", f"whole numbers, {length:.4g} together: counts, whose scale the calibration finds"
    return "m/s^2", f"nothing tells: together they are {length:.4g}, which gravity is in no common unit"


def unit_of_rate(triad: Sequence[Array]) -> tuple[str, str]:
    """Unit of gyroscopes x, y, z (n,) by how fast a hand turns, and why: to be tried on the turns themselves."""
    fastest = max(float(np.abs(x - np.median(x)).max(initial=0.0)) for x in triad)
    if all(np.all(x == np.round(x)) for x in triad) and fastest > RAW:
        return "count", f"whole numbers up to {fastest:.4g}: counts, whose scale the turns tell"
    if fastest > LARGEST_RATE:
        return "deg/s", f"up to {fastest:.4g}, more than any hand turns in rad/s"
    return "rad/s", f"up to {fastest:.4g}"


def unit_of_time(time: Array) -> tuple[str, str]:
    """Unit of a clock (n,) by its step: inertial sensors are logged at 1 Hz to 10 kHz."""
    step = float(np.median(np.diff(time))) if len(time) > 1 else 0.0
    if step <= 0:
        raise InputError("the clock stands still: say what the time is by a column that grows")
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9)):
        rate = 1 / (step * size)
        if RATES[0] <= rate <= RATES[1]:
            return unit, f"steps of {step:.4g}, which in {unit} are {rate:.4g} Hz"
    return "s", f"steps of {step:.4g}, at which nothing is usually logged"


def sound_unit(unit: str, quantity: str) -> bool:
    """Whether a unit that a name tells belongs to the quantity."""
    try:
        check(unit, quantity)
    except InputError:
        return False
    return True
