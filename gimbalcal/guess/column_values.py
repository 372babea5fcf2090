"""What the columns of a log most likely hold by their numbers, and in which units.

A guess says why it was made, so that whoever reads the header it goes into can correct it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from gimbalcal.earth import G0
from gimbalcal.errors import InputError
from gimbalcal.guess.column_names import FORCE, OTHER, RATE, Guess, plain, unit_written
from gimbalcal.number import Array
from gimbalcal.quantities import check

LARGEST_RATE = 35.0  # rad/s, 2000 deg/s: more no hand and no gyroscope of that make turns
RAW = 200.0  # whole numbers beyond this are counts
NEAR = 0.3  # of gravity
GRAVITY = {"m/s^2": G0, "g": 1.0, "ft/s^2": G0 / 0.3048, "mg": 1e3, "Gal": 100 * G0, "ug": 1e6, "mGal": 1e5 * G0}


def by_order(columns: Mapping[str, Array]) -> dict[str, Guess]:
    """A table without names: a first column that grows is the time, then forces, then rates, as most loggers write."""
    out = {}
    growing = [name for name, x in columns.items() if len(x) > 2 and np.all(np.diff(x) >= 0) and x[-1] > x[0]]
    names = [name for name, x in columns.items() if name not in growing and np.nanmin(x) < np.nanmax(x)]
    if growing:
        which = "first" if growing[0] == next(iter(columns)) else "first of those"
        out[growing[0]] = Guess("time", "", "", f"the {which} column, which grows from row to row")
    triples = [names[k : k + 3] for k in range(0, len(names) - 2, 3)]
    forces = [t for t in triples if _turns_about_a_constant([columns[n] for n in t])]
    if not forces:  # something else stands before them
        windows = [names[k : k + 3] for k in range(len(names) - 2)]
        forces = [t for t in windows if _turns_about_a_constant([columns[n] for n in t]) and
                  changes([columns[n] for n in t])]  # fmt: skip
    forces.sort(key=lambda t: _unlike_gravity([columns[n] for n in t]))
    others = [t for t in triples if t not in forces[:1]]
    others.sort(key=lambda t: not all(_comes_back(columns[n]) for n in t))  # a magnetometer does not
    for quantity, group in ((FORCE, forces[:1]), (RATE, others[:1])):
        for triple in group:
            for axis, name in zip("xyz", triple, strict=True):
                what = "whose length hardly changes" if quantity == FORCE else "beside the forces"
                out[name] = Guess(quantity, axis, "", f"three columns {what}")
    return out


def alike(columns: Mapping[str, Array]) -> dict[str, Guess]:
    """Triads of neighbouring columns whose names differ in one letter, N_X N_Y N_Z or S1 S2 S3.

    The one whose length hardly changes holds the forces; the first that comes back to one level at rest the rates.
    """
    names, out = list(columns), {}
    triples = [t for t in zip(names, names[1:], names[2:], strict=False) if _one_letter(t)]
    whole = {t: [columns[n][np.isfinite(np.stack([columns[m] for m in t])).all(axis=0)] for n in t] for t in triples}
    forces = [t for t in triples if len(whole[t][0]) and _turns_about_a_constant(whole[t]) and changes(whole[t])]
    rates = [t for t in triples if t not in forces and len(whole[t][0]) and all(map(_comes_back, whole[t]))]
    for quantity, group in ((FORCE, forces[:1]), (RATE, rates[:1] if forces else [])):
        for triple in group:
            for axis, name in zip("xyz", triple, strict=True):
                what = "whose length hardly changes" if quantity == FORCE else "that come back to one level"
                out[name] = Guess(quantity, axis, unit_written(plain(name)), f"three columns called alike, {what}")
    return out


def _one_letter(triple: Sequence[str]) -> bool:
    """Whether names differ in one letter or digit that counts on; mere numbers are no names."""
    a, b, c = (name.lower() for name in triple)
    if a.isdigit() or not len(a) == len(b) == len(c):
        return False
    at = [i for i, letters in enumerate(zip(a, b, c, strict=True)) if len(set(letters)) > 1]
    return (
        bool(at)
        and {a[i] + b[i] + c[i] for i in at} <= {"xyz", "012", "123", "abc"}
        and not OTHER.intersection(plain(triple[0]).split("_"))
    )


def changes(triple: Sequence[Array]) -> bool:
    """Whether a vector points elsewhere now and then."""
    f = np.stack(triple, axis=-1)
    f = f / np.maximum(np.linalg.norm(f, axis=1, keepdims=True), 1e-300)
    return bool(np.max(np.ptp(f, axis=0)) > NEAR)


def _comes_back(x: Array) -> bool:
    """Whether most of a column stays near one level that it leaves both ways."""
    level, low, high = np.median(x), np.min(x), np.max(x)
    near = np.abs(x - level) < 0.05 * (high - low)
    return bool(high > level > low and np.mean(near) > 0.5)


def _turns_about_a_constant(triple: Sequence[Array]) -> bool:
    """Whether three columns are a vector of one length, as gravity is."""
    length = np.sqrt(sum(np.asarray(x) ** 2 for x in triple))
    middle = float(np.median(length))
    return middle > 0 and float(np.quantile(np.abs(length / middle - 1), 0.5)) < NEAR / 3


def _unlike_gravity(triple: Sequence[Array]) -> tuple[bool, float]:
    """Whether a vector's length is gravity in no common unit, and how far it goes: a bias of rates is short."""
    length = np.sqrt(sum(np.asarray(x) ** 2 for x in triple))
    middle = float(np.median(length))
    alike = any(abs(middle / size - 1) < NEAR for size in GRAVITY.values())
    return not alike, float(np.quantile(np.abs(length / middle - 1), 0.9))


def unit_of_force(triad: Sequence[Array]) -> tuple[str, str]:
    """Unit of accelerometers x, y, z (n,) by the length of gravity, and why."""
    length = float(np.median(np.sqrt(sum(np.asarray(x) ** 2 for x in triad))))
    for unit, size in GRAVITY.items():
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


def sound_unit(unit: str, quantity: str) -> bool:
    """Whether a unit that a name tells belongs to the quantity."""
    try:
        check(unit, quantity)
    except InputError:
        return False
    return True
