r"""Whether gyroscopes feel what the readouts of a rig say that it turns by, and which other reading of them fits.

The chain of its axes, from the unit outwards, turns the unit by

.. math:: \omega = \sum_i R_1 R_2 \cdots R_{i-1} \, s_i \dot\theta_i \, e_i ,

with e_i and s_i direction and sense of axis i. Readings y follow it as :math:`y = B \omega`, fitted over spans less
their means, so that noise, biases and the Earth do not matter; B is near 1, for errors that can be calibrated are far
smaller than `UNLIKE`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise, permutations, product
from math import pi

import numpy as np

from gimbalcal.checks.axes import AXES, PERMUTATIONS, in_words, remedy
from gimbalcal.effects.history import integral
from gimbalcal.errors import InputError
from gimbalcal.number import Array
from gimbalcal.platform import Axis, Platform
from gimbalcal.recording.dwell import usual_step
from gimbalcal.recording.record import ANGLE, RATE, Recording
from gimbalcal.rotation import frame_rotation
from gimbalcal.units import to_si

SPAN = 0.1  # s; readouts of a thousandth of a turn tell the rate, and no axis turns far
MOST = 2000  # spans that are looked at
UNLIKE = 0.26  # of what gyroscopes read, left by the rig: 15 deg
TURNS = np.radians(0.1)  # rad/s; a rate that changes by less tells nothing
OF_ANGLES, OF_RATES = ("deg", "rad", "rev", "gon", "mdeg", "mrad"), ("deg/s", "rad/s", "deg/h", "rev/min")


@dataclass(frozen=True, eq=False)
class Turning:
    """Readings (m, 3) [rad/s], readouts (m, k) [rad] and their rates (m, k) [rad/s] over short spans."""

    read: Array
    angle: Array
    rate: Array
    names: tuple[str, ...]  # of the axes that are read

    def off(self, platform: Platform, scale: float | None = 1.0) -> float:
        """What the readings have beside the rate of the chain, as a share; `scale` None: whatever suits them."""
        chain, y = self.by(platform), self.read - self.read.mean(0)
        w = chain - chain.mean(0)
        felt = w @ np.linalg.lstsq(w, y, rcond=1e-6)[0]
        size, whole = float((w**2).sum()), float((felt**2).sum())
        if size == 0 or whole == 0:
            return 1.0
        s = float((w * felt).sum()) / size if scale is None else scale
        return float(np.sqrt(((felt - s * w) ** 2).sum() / max(whole, s * s * size)))

    def left(self, platform: Platform, scale: float | None = 1.0) -> float:
        """The rms of all that the readings have beside the rate of the chain, noise too, as a share of theirs."""
        chain, y = self.by(platform), self.read - self.read.mean(0)
        w = chain - chain.mean(0)
        size, whole = float((w**2).sum()), float((y**2).sum())
        s = float((w * y).sum()) / max(size, 1e-300) if scale is None else scale
        return float(np.sqrt(((y - s * w) ** 2).sum() / whole)) if whole > 0 else 1.0

    def by(self, platform: Platform) -> Array:
        """Rate (m, 3) [rad/s] of the unit by the chain; an axis that is not read stands at zero."""
        total, R = np.zeros((len(self.angle), 3)), np.eye(3)
        for axis in platform.axes:
            angle, rate = np.zeros(len(total)), np.zeros(len(total))
            if axis.name in self.names:
                k = self.names.index(axis.name)
                angle, rate = self.angle[:, k], self.rate[:, k]
            total += axis.sign * rate[:, None] * R[..., "xyz".index(axis.direction)]
            R = R @ frame_rotation(axis.direction, axis.sign * angle + axis.offset)
        return total


def turning(time: Array, read: Array, angles: Array, names: Sequence[str]) -> Turning:
    """Spans of readings (n, 3) and readouts (n, k) [rad] that may begin anew at a turn, those that turn most kept."""
    step = float(np.median(np.diff(time)))
    n = max(1, round(SPAN / step))
    whole = np.unwrap(angles, axis=0)
    starts = np.arange(0, len(time) - n, max(n, (len(time) - n) // MOST))
    sums = integral(read, time)
    span = (time[starts + n] - time[starts])[:, None]
    middle = (whole[starts] + whole[starts + n]) / 2
    return Turning((sums[starts + n] - sums[starts]) / span, middle, (whole[starts + n] - whole[starts]) / span,
                   tuple(names))  # fmt: skip


def chains(names: Sequence[str]) -> Iterator[Platform]:
    """Chains of up to three axes, each about another direction than the next, upright ones first.

    What the outermost stands on turns nothing, so that its offset is left at zero.
    """
    offsets = (0.0, pi / 2, pi, -pi / 2)
    for order, directions in product(permutations(names), product("zxy", repeat=len(names))):
        if any(a == b for a, b in pairwise(directions)):
            continue
        for signs in product((1, -1), repeat=len(names)):
            for zeros in product(offsets, repeat=len(names) - 1):
                yield Platform("own", tuple(map(Axis, order, directions, signs, (*zeros, 0.0))))


def refuse_unlike_table(r: Recording) -> None:
    """InputError where the gyroscopes of `r` do not feel what the rig is said to turn by, and what else would fit.

    Tried are, one at a time: another unit of the readouts, their senses, other axes of the gyroscopes, their unit. Of
    readings in counts only the axes are looked at.
    """
    T, scale = _of(r), None if r.counted(RATE) else 1.0
    if not _tells(T) or T.off(r.platform, scale) < UNLIKE:
        return
    for words in _slips(r, T, scale):
        raise InputError(f"{r.label}: {words}")
    step = usual_step(r)
    fast = "" if scale is None else _too_fast(T, step)
    raise InputError(
        f"{r.label}: what the gyroscopes read is not what the angles of the rig say, whichever unit, sense or axis is "
        f"changed{fast}; mount the unit with one of its axes along the table's, within 15 deg, and look at the "
        "columns of the rig and their clock"
    )


def like_table(r: Recording) -> bool:
    """Whether the gyroscopes of `r` feel what the rig turns by, so that their axes, signs and unit are vouched for."""
    T = _of(r)
    return _tells(T) and not r.counted(RATE) and T.off(r.platform) < UNLIKE


def _tells(T: Turning) -> bool:
    return float(np.std(T.rate, axis=0).max(initial=0.0)) >= TURNS


def _of(r: Recording, factor: float = 1.0) -> Turning:
    return turning(r.time, r.triad(RATE), factor * r.angles(), r.platform.axis_names)


def _too_fast(T: Turning, step: float) -> str:
    fastest = float(np.linalg.norm(T.read, axis=1).max())
    half = "; the table turns by more than half a turn from row to row, so log it faster"
    return half if fastest * step > pi else ""


def _slips(r: Recording, T: Turning, scale: float | None) -> Iterator[str]:
    """What else the gyroscopes do feel, and what to write: simpler slips first."""
    logged, physical = list(r.axes(ANGLE)), scale is not None
    was = {r.units.get((ANGLE, a), "rad") for a in logged}
    for unit, factor in _others(was, OF_ANGLES) if physical else ():
        if _of(r, factor).off(r.platform) < UNLIKE:
            yield (
                f"the gyroscopes feel the rig turn as its angles say in {unit}, not {was.pop()}: write unit = "
                f'"{unit}" for the column of {" and ".join(logged)}'
            )
    axes = r.platform.axes
    for few in sorted(product((0, 1), repeat=len(axes)), key=sum) if physical else ():
        turned = [a.name for a, f in zip(axes, few, strict=True) if f]
        other_way = tuple(replace(a, sign=-a.sign) if f else a for a, f in zip(axes, few, strict=True))
        # the readout counts backwards, whatever its zero
        if turned and set(turned) <= set(logged) and T.off(Platform("own", other_way)) < UNLIKE:
            yield (
                f"the gyroscopes feel the rig turn the other way than its angles say: write sign = -1 at the column of "
                f"{' and '.join(turned)} in [columns], or take it out where it is there"
            )
    if len(axes) == 1:
        a = axes[0]
        for direction, sign in product("xyz", (1, -1)):
            if T.off(Platform("own", (replace(a, direction=direction, sign=sign),)), scale) < UNLIKE:
                turn = "" if sign == a.sign or not physical else ", sign = -1"
                yield (
                    f"the gyroscopes feel the rig turn about {direction} of the unit, not about {a.direction} as "
                    f'[platform] says: write direction = "{direction}"{turn} for its axis {a.name}, or exchange the '
                    "gyroscopes in [columns]"
                )
    for change in PERMUTATIONS[1:]:
        if replace(T, read=T.read @ change.matrix.T).off(r.platform, scale) < UNLIKE:
            yield f"the gyroscopes feel the rig turn if {in_words(change, 'gyroscope')}: {remedy(change, 'gyroscope')}"
    read = {r.units.get((RATE, a), "rad/s") for a in AXES}
    for unit, factor in _others(read, OF_RATES) if physical else ():
        if replace(T, read=factor * T.read).off(r.platform) < UNLIKE:
            was_said = f'{unit}, not {read.pop()}: write unit = "{unit}" for them'
            yield f"the gyroscopes feel the rig turn if they read {was_said}"


def _others(was: set[str], units: Sequence[str]) -> Iterator[tuple[str, float]]:
    """Other units than the one that all columns are said to have, and what numbers are to be multiplied by."""
    said = next(iter(was))
    for unit in units if len(was) == 1 else ():
        if unit != said:
            yield unit, float(to_si(1.0, unit) / to_si(1.0, said))
