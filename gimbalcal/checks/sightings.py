r"""Checks of a pointing run: readouts or stars along other axes, of other signs, in other units.

Where the mount looks, by its readouts with the two zeros that fit best, is compared with where its stars were,

.. math:: d_k = \arccos(u(\text{readout}_k + \theta_0) \cdot u(\text{star}_k)), \qquad
          u(\theta) = C_b^p(\theta)^T (1, 0, 0) .

The terms of a mount are seconds to a degree or two; a wrong sign, axis or unit leaves tens of degrees.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from gimbalcal.checks.check import SIGHTINGS, Check, Examined
from gimbalcal.checks.input_errors import (
    AS_STATED,
    Correction,
    exchange_correction,
    scale_correction,
    successful_trials,
)
from gimbalcal.number import Array
from gimbalcal.platform import zeros_of_axes
from gimbalcal.recording.record import ANGLE, Recording

STAR = "true_angle"
NOUN = {ANGLE: "readout", STAR: "true angle"}
MIN_STARS = 5  # two zeros are fitted to them
MAX_SEPARATION_RAD = np.radians(5.0)  # median separation of readout and star that a mount may have
RADIANS_OF_THE_SKY = 6.6  # as numbers: angles of a whole sky in radians are less, both axes
MAX_TRUE_ANGLE_RAD = 4 * np.pi
MANY_STEPS = 10.0  # of the readouts, by which a star goes on that a mount does not follow
MIN_GAIN = 5.0  # ratio by which the right correction reduces the separation
UNITS = {"rad": 1.0, "deg": np.pi / 180, "hours of 15 deg": np.pi / 12, "arcmin": np.pi / 10800}
UNITS |= {"arcsec": np.pi / 648000, "gon": np.pi / 200}


@dataclass(frozen=True, eq=False)
class Sky:
    """The readouts of the two axes of a mount (n, 2) [rad], and the angles of its stars."""

    recording: Recording
    axes: tuple[str, ...]
    read: Array
    star: Array

    def separation(self, correction: Correction) -> tuple[float, float]:
        """Return median angles [rad] between the mount, with the zeros that fit best, and its stars; and of these."""
        read, star = correction.of(ANGLE, self.read), correction.of(STAR, self.star)
        looked, there = (self.direction(angle) for angle in (read + zeros_of_axes(read, star), star))
        return _angle_between(looked, there), _angle_between(there, np.roll(there, 1, axis=0))

    def direction(self, angle: Array) -> Array:
        """Return where the innermost axis' x looks (n, 3), in axes of the base."""
        platform = self.recording.platform
        angles = platform.angles({a: angle[:, i] for i, a in enumerate(self.axes)}, angle.shape[:1])
        return np.asarray(platform.attitude(angles)[..., 0, :])


def _angle_between(a: Array, b: Array) -> float:
    return float(np.median(2 * np.arcsin(np.clip(np.linalg.norm(a - b, axis=-1) / 2, 0, 1))))


def _sky(recording: Recording) -> Sky | None:
    """Return the sky of a mount of two axes that saw enough stars."""
    names = recording.platform.axis_names
    axes = tuple(a for a in names if (ANGLE, a) in recording.channels and (STAR, a) in recording.channels)
    if len(axes) != 2 or len(recording.time) < MIN_STARS:
        return None
    read, star = (np.stack([recording.channels[q, a] for a in axes], axis=-1) for q in (ANGLE, STAR))
    return Sky(recording, axes, read, star)


def true_angles_of_many_turns(e: Examined) -> str:
    """Refuse stars that go round many times."""
    if (sky := e.once(_sky)) is None:
        return ""
    for i, axis in enumerate(sky.axes):
        most = float(np.abs(sky.star[:, i]).max())
        if most > MAX_TRUE_ANGLE_RAD:
            unit = e.recording.units.get((STAR, axis), "deg")
            return (
                f"the true angle of {axis} reaches {most / (2 * np.pi):.3g} turns, read in the "
                f"unit {unit!r}, and no star goes round so far; correct the unit of its column, for example to deg"
            )
    return ""


def readouts_against_stars(e: Examined) -> str:
    """Refuse readouts that differ from the stars by more than on any mount, with the correction that explains it."""
    if (sky := e.once(_sky)) is None:
        return ""
    distance, extent = sky.separation(AS_STATED)
    if distance < MAX_SEPARATION_RAD:
        return ""
    stated = (
        f"readouts and stars differ by {np.degrees(distance):.3g} deg on the sky (the median of "
        f"{len(sky.read)}, zeros of both axes allowed for)"
    )

    def misfit(correction: Correction) -> float:  # angles that shrink come together and show nothing
        separation, size = sky.separation(correction)
        return separation / max(size, 1e-9)

    for best in successful_trials(_corrections(sky), misfit):
        separation = sky.separation(best.candidate)[0]
        if best.misfit < distance / extent / MIN_GAIN and separation < MAX_SEPARATION_RAD:
            return f"{stated}, and {np.degrees(separation):.2g} deg if {best.candidate.words}; correct [columns]"
    return (
        f"{stated}, and no other unit, sign or order of the columns brings them together; check [columns], and the "
        "axes and their sense in [platform]"
    )


def mount_that_stands_still(e: Examined) -> str:
    """Refuse rows in which the readouts stand still while the star moves by many of their steps: it was not followed.

    A coarse readout lags behind by its own step; a mount that waits for a source, or is parked, by any angle.
    """
    if (sky := e.once(_sky)) is None:
        return ""
    still = np.all(sky.read[1:] == sky.read[:-1], axis=1)
    first, stop = np.flatnonzero(np.diff(still, prepend=False, append=False)).reshape(-1, 2).T
    if 2 * np.count_nonzero(still) < len(still):
        return ""
    levels = [np.diff(np.unique(x)) for x in sky.read.T]
    step = max((float(d.min()) for d in levels if len(d)), default=0.0)
    ends = (sky.direction(sky.star[rows]) for rows in (first, stop))
    moved = 2 * np.arcsin(np.clip(np.linalg.norm(np.subtract(*ends), axis=-1) / 2, 0, 1))
    left = moved > MANY_STEPS * step
    rows = int(np.sum((stop - first + 1)[left]))
    if 2 * rows < len(still):
        return ""
    return (
        f"both readouts stand still in {rows} of {len(sky.read)} rows, row after row, while the star moves by up to "
        f"{np.degrees(moved.max()):.3g} deg: the mount did not follow it, so that these rows are no sightings; leave "
        "them out"
    )


def stars_within_a_small_patch(e: Examined) -> str:
    """Question angles in degrees that are all as small as those of a whole sky are in radians."""
    if (sky := e.once(_sky)) is None:
        return ""
    within = float(np.degrees(np.abs(sky.star).max()))
    if {e.recording.units.get((STAR, a), "deg") for a in sky.axes} != {"deg"} or within > RADIANS_OF_THE_SKY:
        return ""
    return (
        f"all true angles lie within {within:.3g} deg of zero: is that so? If they are in radians, write "
        'unit = "rad" for the columns of the mount'
    )


def _corrections(sky: Sky) -> Iterator[Correction]:
    """Yield other statements of the four columns, the simplest first."""
    axes = sky.axes
    first, second = axes
    for a in axes:
        yield scale_correction(
            ANGLE, (a,), -1.0, f"the {a} runs the other way (its readout, or its true angle): sign = -1", of=axes
        )
    for quantities in ((ANGLE,), (STAR,), (ANGLE, STAR)):
        for which in (axes, (first,), (second,)):
            stated = [sky.recording.units.get((q, a), "deg") for q in quantities for a in which]
            if stated[0] not in UNITS or len(set(stated)) > 1 or len(quantities) > len(which):
                continue  # one axis alone that shrinks, star and readout, would come together
            nouns = " and ".join(NOUN[q] + "s" * (len(which) > 1) for q in quantities)
            are = "are" if len(which) > 1 or len(quantities) > 1 else "is"
            for unit, size in UNITS.items():
                if unit != stated[0]:
                    factor = size / UNITS[stated[0]]
                    words = f"the {nouns} of {' and '.join(which)} {are} in {unit}, not in {stated[0]}"
                    each = [scale_correction(q, which, factor, words, of=axes) for q in quantities]
                    yield Correction(words, matrices={q: m for c in each for q, m in c.matrices.items()})
    for q in (ANGLE, STAR):
        yield exchange_correction(q, axes, 0, 1, f"the {NOUN[q]}s of {first} and {second} are interchanged")
    both = f"both axes run the other way (readouts, or true angles): sign = -1 for {first}, {second}"
    yield scale_correction(ANGLE, axes, -1.0, both, of=axes)


CHECKS = (
    Check(true_angles_of_many_turns, SIGHTINGS),
    Check(mount_that_stands_still, SIGHTINGS),
    Check(readouts_against_stars, SIGHTINGS),
    Check(stars_within_a_small_patch, SIGHTINGS, question=True),
)
