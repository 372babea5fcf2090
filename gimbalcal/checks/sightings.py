r"""A pointing run that cannot be right: readouts or stars along other axes, of other signs, in other units.

Where the mount looks, by its readouts with the two zeros that fit best, is held against where its stars were,

.. math:: d_k = \arccos(u(\text{readout}_k + \theta_0) \cdot u(\text{star}_k)), \qquad
          u(\theta) = C_b^p(\theta)^T (1, 0, 0) .

The terms of a mount are seconds to a degree or two; a wrong sign, axis or unit leaves tens of degrees.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from gimbalcal.errors import InputError
from gimbalcal.number import Array
from gimbalcal.recording.record import Recording

READ, STAR = "gimbal_angle", "true_angle"
CALLED = {READ: "readout", STAR: "true angle"}
FEWEST = 5  # stars; two zeros are fitted to them
FAR = np.radians(5.0)  # median distance of readout and star that no term of a mount makes
PATCH = 6.6  # as numbers: angles of a whole sky in radians are less, both axes
TURNS = 4 * np.pi  # rad; no star is further round
CLEARLY = 5.0  # times: the distance falls by more where the right slip is undone
UNITS = {"rad": 1.0, "deg": np.pi / 180, "hours of 15 deg": np.pi / 12, "arcmin": np.pi / 10800}
UNITS |= {"arcsec": np.pi / 648000}


@dataclass(frozen=True)
class Other:
    """Another reading of the columns: angles (n, 2) that the mount read and that its stars had, and what was wrong."""

    read: Array
    star: Array
    words: str


def check_pointing(recording: Recording) -> tuple[str, ...]:
    """Raise InputError where readouts and stars are apart by what no mount is, with the slip that explains it.

    Returns a sentence where all angles are as small as those of a whole sky are in radians.
    """
    names = recording.platform.axis_names
    axes = [a for a in names if (READ, a) in recording.channels and (STAR, a) in recording.channels]
    if len(axes) != 2 or len(recording.time) < FEWEST:
        return ()
    read, star = (np.stack([recording.channels[q, a] for a in axes], axis=-1) for q in (READ, STAR))
    _check_turns(recording, axes, star)
    apart, patch = _apart(recording, axes, read, star)
    if apart < FAR:
        return _small(recording, axes, star)
    said = (
        f"{recording.label}: readouts and stars are {np.degrees(apart):.3g} deg apart on the sky (the median of "
        f"{len(read)}, zeros of both axes allowed for)"
    )
    found = [(*_apart(recording, axes, o.read, o.star), o.words) for o in _others(recording, axes, read, star)]
    # the first of equals is the simplest; angles that shrink come together and tell nothing
    best, around, words = min(found, key=lambda f: f[0] / max(f[1], 1e-9))
    if best / around < apart / patch / CLEARLY and best < FAR:
        raise InputError(f"{said}, and {np.degrees(best):.2g} deg if {words}; correct [columns]")
    raise InputError(
        f"{said}, and no other unit, sign or order of the columns brings them together; check [columns], and the axes "
        "and their sense in [platform]"
    )


def _check_turns(recording: Recording, axes: list[str], star: Array) -> None:
    for i, axis in enumerate(axes):
        most, unit = float(np.abs(star[:, i]).max()), recording.units.get((STAR, axis), "deg")
        if most > TURNS:
            raise InputError(
                f"{recording.label}: the true angle of {axis} reaches {most / (2 * np.pi):.3g} turns, read in the "
                f"unit {unit!r}, and no star goes round so far; correct the unit of its column, for example to deg"
            )


def _small(recording: Recording, axes: list[str], star: Array) -> tuple[str, ...]:
    """In a sentence, that all stars lie so close together that their angles may be in radians."""
    units = {recording.units.get((STAR, a), "deg") for a in axes}
    if units != {"deg"} or float(np.degrees(np.abs(star).max())) > PATCH or len(star) < FEWEST:
        return ()
    within = float(np.degrees(np.abs(star).max()))
    ask = 'If they are in radians, write unit = "rad" for the columns of the mount'
    return (f"all true angles lie within {within:.3g} deg of zero: is that so? {ask}",)


def _apart(recording: Recording, axes: list[str], read: Array, star: Array) -> tuple[float, float]:
    """Median angles [rad] between where the mount looked, with the zeros that fit best, and its stars; and of these."""
    off = star - read
    zero = np.angle(np.median(np.cos(off), axis=0) + 1j * np.median(np.sin(off), axis=0))
    looked, there = (_direction(recording, axes, angle) for angle in (read + zero, star))
    return _between(looked, there), _between(there, np.roll(there, 1, axis=0))


def _between(a: Array, b: Array) -> float:
    return float(np.median(2 * np.arcsin(np.clip(np.linalg.norm(a - b, axis=-1) / 2, 0, 1))))


def _direction(recording: Recording, axes: list[str], angle: Array) -> Array:
    """Where the innermost axis' x looks (n, 3), in axes of the base."""
    shape = recording.time.shape
    every = recording.platform.angles({a: angle[:, i] for i, a in enumerate(axes)}, shape)
    return np.asarray(recording.platform.attitude(every)[..., 0, :])


def _others(recording: Recording, axes: list[str], read: Array, star: Array) -> Iterator[Other]:
    """Other readings of the four columns, the simplest first."""
    for i in (0, 1):
        turned = read * np.where(np.arange(2) == i, -1, 1)
        yield Other(turned, star, f"the {axes[i]} runs the other way (its readout, or its true angle): sign = -1")
    for quantities in ((READ,), (STAR,), (READ, STAR)):
        for which in ((0, 1), (0,), (1,)):
            stated = [recording.units.get((q, axes[i]), "deg") for q in quantities for i in which]
            if stated[0] not in UNITS or len(set(stated)) > 1 or len(quantities) > len(which):
                continue  # one axis alone that shrinks, star and readout, would come together
            for unit, size in UNITS.items():
                if unit == stated[0]:
                    continue
                scale = np.where(np.isin(np.arange(2), which), size / UNITS[stated[0]], 1.0)
                both = (scale * read if READ in quantities else read, scale * star if STAR in quantities else star)
                names, many = " and ".join(axes[i] for i in which), len(which) > 1
                called = " and ".join(CALLED[q] + "s" * many for q in quantities)
                are = "are" if many or len(quantities) > 1 else "is"
                yield Other(*both, f"the {called} of {names} {are} in {unit}, not in {stated[0]}")
    yield Other(read[:, ::-1], star, f"the readouts of {axes[0]} and {axes[1]} are interchanged")
    yield Other(read, star[:, ::-1], f"the true angles of {axes[0]} and {axes[1]} are interchanged")
    yield Other(
        -read, star, f"both axes run the other way (readouts, or true angles): sign = -1 for {axes[0]}, {axes[1]}"
    )
