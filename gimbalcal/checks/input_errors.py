r"""Input errors: what a header or a logger may have stated wrongly, each of them one trial.

A `Correction` states the columns, the clock, the place or the platform otherwise. The trial is the same for all: apply
the correction, evaluate how well the recording agrees with physics then, and compare with the recording as stated. What
evaluates is the caller's: rests whose force points along gravity, turns that gyroscopes explain, a calibration whose
constants are usual. Of equally good corrections the simplest is named, so they are tried in that order.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import permutations, product
from typing import Generic, TypeVar

import numpy as np

from gimbalcal.effects.effect import TRIAD
from gimbalcal.errors import InputError
from gimbalcal.number import Array
from gimbalcal.platform import Platform
from gimbalcal.recording.record import SENSOR_OF, Recording
from gimbalcal.units import is_raw, to_si

MAX_DEVIATION_RAD = np.radians(15.0)  # far above gimbal zeros, misalignments and hand-set angles, below a wrong axis
MIN_AGREEMENT = 0.9  # share of rests, turns or rows that a correct reading of the columns explains
MIN_CHANGED = 4  # rests or turns that a correction of a part of the recording explains, and the statement does not
MIN_GAIN = 2  # rests or turns that a correction explains beyond those explained as stated
SIGN_CONVENTION = {
    "specific_force": " (f = a - g: one whose axis points down reads -9.8 m/s^2 at rest)",
    "angular_rate": "",
}
UNITS = {
    "specific_force": ("m/s^2", "g", "mg", "ug", "ft/s^2", "Gal"),
    "angular_rate": ("rad/s", "deg/s", "deg/h", "mdeg/s", "rad/h", "rev/min"),
    "gimbal_angle": ("deg", "rad", "rev", "gon", "arcmin", "mdeg", "mrad"),
    "attitude_error": ("arcsec", "arcmin", "deg", "mrad"),
}
"""Units that columns of a quantity may be in, whatever a header states."""
CLOCK_UNITS = {1e-3: "ms", 1e3: "s instead of ms", 1e-6: "us", 60.0: "min", 3600.0: "h"}
"""Seconds that one of the stated seconds really is, and the unit that it is then in."""


@dataclass(frozen=True)
class AxisPermutation:
    r"""A signed permutation of three columns: component i is `signs[i]` times column `order[i]`.

    .. math:: v' = M v, \qquad M_{i, order_i} = signs_i .
    """

    order: tuple[int, ...] = (0, 1, 2)
    signs: tuple[int, ...] = (1, 1, 1)

    @property
    def matrix(self) -> Array:
        """Return M (3, 3)."""
        return np.eye(3)[list(self.order)] * np.array(self.signs, dtype=float)[:, None]

    @property
    def handed(self) -> int:
        """Return 1 where a right-handed triad remains one, -1 where it becomes left-handed."""
        return round(float(np.linalg.det(self.matrix)))

    @property
    def complexity(self) -> tuple[int, int]:
        """Return the number of errors that lead to it, and how many of them are in the order."""
        moved = sum(a != b for a, b in enumerate(self.order))
        flipped = 1 if self.signs == (-1, -1, -1) else sum(s < 0 for s in self.signs)  # all three: one convention
        return moved + flipped, moved

    def inverse(self, sign: int = 1) -> AxisPermutation:
        """Return `sign` times M^-1."""
        back = sign * self.matrix.T
        order = tuple(int(np.argmax(np.abs(row))) for row in back)
        return AxisPermutation(order, tuple(round(float(row[i])) for i, row in zip(order, back, strict=True)))

    def in_words(self, quantity: str) -> str:
        """Return what the columns of a quantity would have to be.

        >>> AxisPermutation((1, 0, 2)).in_words("angular_rate")
        'the gyroscopes x and y are interchanged'
        >>> AxisPermutation(signs=(1, 1, -1)).in_words("angular_rate")
        'the gyroscope z had the opposite sign'
        """
        sensor, moved, parts = SENSOR_OF[quantity], [TRIAD[a] for a, b in enumerate(self.order) if a != b], []
        if len(moved) == 2:
            parts.append(f"the {sensor}s {moved[0]} and {moved[1]} are interchanged")
        elif moved:
            parts.append(f"the {sensor}s called {', '.join(TRIAD[b] for b in self.order)} are really x, y, z")
        if self.signs == (-1, -1, -1):
            parts.append(f"every {sensor} has the wrong sign{SIGN_CONVENTION[quantity]}")
        elif -1 in self.signs:
            wrong = " and ".join(TRIAD[i] for i in range(3) if self.signs[i] < 0)
            parts.append(f"the {sensor}{'s' if ' ' in wrong else ''} {wrong} had the opposite sign")
        return " and ".join(parts) or "the columns are as stated"

    def remedy(self, quantity: str) -> str:
        """Return what to write in [columns]; empty where nothing changes.

        >>> AxisPermutation((1, 0, 2), (1, -1, 1)).remedy("angular_rate")
        'for gyroscope y write axis = "x", for gyroscope x write axis = "y", sign = -1'
        """
        out = []
        for i in (i for i in range(3) if self.order[i] != i or self.signs[i] < 0):
            keys = [f'axis = "{TRIAD[i]}"'] * (self.order[i] != i) + ["sign = -1"] * (self.signs[i] < 0)
            out.append(f"for {SENSOR_OF[quantity]} {TRIAD[self.order[i]]} write {', '.join(keys)}")
        return ", ".join(out)


PERMUTATIONS = tuple(
    sorted(
        (AxisPermutation(order, signs) for order in permutations(range(3)) for signs in product((1, -1), repeat=3)),
        key=lambda p: p.complexity,
    )
)
"""All 48, the simplest first; the first of them changes nothing."""
SINGLE_ERRORS = tuple(p for p in PERMUTATIONS if p.complexity in ((1, 0), (2, 2)))
"""One sign, all three, or two columns interchanged."""


@dataclass(frozen=True, eq=False)
class Correction:
    """Another statement of a header: what it says, what to write for it, and what it changes.

    words: a clause that follows "if". matrices: by quantity, its axes and the matrix (k, k) that its columns, in that
    order, are multiplied by; offsets: by quantity of these, what is then added to its columns (k,) [SI]. clock: seconds
    that one of the stated seconds really is. latitude [rad]. unstated: sensors whose noise is not stated then.
    """

    words: str
    remedy: str = ""
    matrices: Mapping[str, tuple[tuple[str, ...], Array]] = field(default_factory=dict)
    offsets: Mapping[str, Array] = field(default_factory=dict)
    clock: float = 1.0
    latitude: float | None = None
    platform: Platform | None = None
    unstated: tuple[str, ...] = ()

    def of(self, quantity: str, values: Array) -> Array:
        """Return columns (n, k) of a quantity in the order of its axes, corrected."""
        if quantity not in self.matrices:
            return values
        return np.asarray(values @ self.matrices[quantity][1].T + self.offsets.get(quantity, 0.0))

    def corrected(self, recording: Recording) -> Recording:
        """Return the recording with this statement in its header."""
        channels, scatter = dict(recording.channels), dict(recording.scatter)
        for quantity, (axes, M) in self.matrices.items():
            own = [i for i, a in enumerate(axes) if (quantity, a) in recording.channels]
            part = M[np.ix_(own, own)]
            values = part @ np.stack([recording.channels[quantity, axes[i]] for i in own])
            values += self.offsets.get(quantity, np.zeros(len(axes)))[own, None]
            channels |= {(quantity, axes[i]): x for i, x in zip(own, values, strict=True)}
            sigma = np.abs(part) @ [recording.scatter.get((quantity, axes[i]), np.nan) for i in own]
            scatter |= {(quantity, axes[i]): float(s) for i, s in zip(own, sigma, strict=True) if np.isfinite(s)}
        latitude = recording.site.latitude if self.latitude is None else self.latitude
        return replace(
            recording,
            time=recording.time if self.clock == 1 else self.clock * recording.time,
            platform=self.platform or recording.platform,
            site=replace(recording.site, latitude=latitude),
            noise={sensor: sigma for sensor, sigma in recording.noise.items() if sensor not in self.unstated},
            channels=channels,
            scatter=scatter,
        )

    def factor(self, quantity: str) -> float:
        """Return by what the first column of a quantity that changes is multiplied; 1 where none does."""
        factors = self.matrices[quantity][1].diagonal() if quantity in self.matrices else ()
        return float(next((x for x in factors if x != 1), 1.0))

    def reversed(self, quantity: str) -> tuple[str, ...]:
        """Return the axes whose columns are of the opposite sign."""
        axes, M = self.matrices.get(quantity, ((), np.zeros((0, 0))))
        return tuple(a for a, sign in zip(axes, np.diag(M), strict=True) if sign < 0)


AS_STATED = Correction("")
Candidate = TypeVar("Candidate")


@dataclass(frozen=True, eq=False)
class Trial(Generic[Candidate]):
    """A candidate, usually a `Correction`, and the misfit of the recording to physics under it, never negative."""

    misfit: float
    candidate: Candidate


def successful_trials(
    candidates: Iterable[Candidate],
    misfit: Callable[[Candidate], float],
    sufficient: float = 0.0,
    tolerance: float = 1.0,
    most: int = 1,
) -> tuple[Trial[Candidate], ...]:
    """Try candidates in order, the simplest first, and return those under which the recording agrees with physics.

    Those are the first `most` whose misfit is at most `sufficient`; the rest are not tried. Where there is none, it is
    the first candidate whose misfit is at most `tolerance` times the least; nothing, where every one was refused
    (`InputError`) or none was given.
    """
    sufficing: list[Trial[Candidate]] = []
    others: list[Trial[Candidate]] = []
    for candidate in candidates:
        try:
            size = misfit(candidate)
        except InputError:
            continue
        trial = Trial(np.inf if np.isnan(size) else size, candidate)
        (sufficing if trial.misfit <= sufficient else others).append(trial)
        if len(sufficing) == most:
            break
    least = min((trial.misfit for trial in others), default=np.inf)
    return tuple(sufficing) or tuple(t for t in others if t.misfit <= tolerance * least)[:1]


@dataclass(frozen=True)
class PartWay:
    """A correction, by its number, that the rows from one on need, or else those before it, and how many agree so."""

    number: int
    row: int
    from_row_on: bool
    agreeing: int

    def in_words(self, words: str, time: Array) -> str:
        """Return the correction in these words with its part, by the time (n,) [s] of the rows."""
        at = f"{time[self.row]:.10g} s"
        part = f"from {at} on" if self.from_row_on else f"before {at}"
        return f"{self.agreeing} if {part} {words}; correct the rows there, or cut the recording in two"


def change_part_way(stated: Array, corrected: Array) -> PartWay | None:
    """Return the correction that nearly every row agrees with if only a part of the recording needs it; else None.

    stated (n,): which rows agree with physics as stated; corrected (c, n): which do under each correction, the simplest
    first. The part has to have `MIN_CHANGED` rows that agree only under the correction: fewer may do so by chance.
    """
    n = len(stated)
    first, then = (np.pad(np.cumsum(np.atleast_2d(x), axis=1), ((0, 0), (1, 0))) for x in (stated, corrected))
    agreeing = np.stack([first + then[:, -1:] - then, then + first[:, -1:] - first], axis=1)  # (c, 2, n + 1)
    best = int(agreeing.max())
    if best < max(MIN_AGREEMENT * n, int(first[0, -1]) + MIN_CHANGED, int(then[:, -1].max()) + MIN_GAIN):
        return None
    number, part, row = (int(i[0]) for i in np.nonzero(agreeing == best))
    return PartWay(number, row, part == 0, best)


# --- what may be stated wrongly ---------------------------------------------------------------------------------------


def permutation_correction(quantity: str, permutation: AxisPermutation) -> Correction:
    """Return the correction of a triad whose axes, or signs, are others."""
    handed = "; as stated they make a left-handed triad" if permutation.handed < 0 else ""
    return Correction(
        permutation.in_words(quantity) + handed, permutation.remedy(quantity), {quantity: (TRIAD, permutation.matrix)}
    )


def scale_correction(
    quantity: str, axes: Iterable[str], factor: float, words: str, remedy: str = "", of: tuple[str, ...] = TRIAD
) -> Correction:
    """Return the correction of columns that are to be multiplied by a factor, some of the axes `of` a quantity."""
    few = set(axes)
    return Correction(words, remedy, {quantity: (of, np.diag([factor if a in few else 1.0 for a in of]))})


def exchange_correction(quantity: str, of: tuple[str, ...], i: int, j: int, words: str) -> Correction:
    """Return the correction of two columns of a quantity that stand for each other."""
    order = list(range(len(of)))
    order[i], order[j] = j, i
    return Correction(words, "", {quantity: (of, np.eye(len(of))[order])})


def offset_correction(quantity: str, of: tuple[str, ...], i: int, offset: float, words: str) -> Correction:
    """Return the correction of column i of a quantity by an offset [SI], which is added to it."""
    return Correction(words, "", {quantity: (of, np.eye(len(of)))}, {quantity: offset * np.eye(len(of))[i]})


def in_other_units(
    quantity: str, axes: Sequence[str], stated: Iterable[str], words: str, remedy: str = "", of: tuple[str, ...] = TRIAD
) -> Iterator[Correction]:
    """Yield the corrections by which columns that state one unit are in another.

    None where they state several, or counts. words, remedy: with {unit} and {stated} for the other unit and this one.
    """
    units = set(stated)
    if len(units) != 1 or is_raw(one := units.pop()):
        return
    for unit in UNITS[quantity]:
        if unit != one:
            factor = float(to_si(1.0, unit) / to_si(1.0, one))
            in_words, to_write = (text.format(unit=unit, stated=one) for text in (words, remedy))
            yield scale_correction(quantity, axes, factor, in_words, to_write, of)
