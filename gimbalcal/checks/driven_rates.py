r"""Checks of gyroscopes on a rate table: whether they feel the turn of the rig's axes, and under which correction.

The chain of its axes, from the unit outwards, turns the unit by

.. math:: \omega = \sum_i R_1 R_2 \cdots R_{i-1} \, s_i \dot\theta_i \, e_i ,

with e_i and s_i direction and sense of axis i. Readings y follow it as :math:`y = B \omega`, fitted over spans less
their means, so that noise, biases and the Earth do not matter; B is near 1, for errors that can be calibrated are far
smaller than `MAX_RESIDUAL`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from math import pi

import numpy as np

from gimbalcal.checks.check import ROTATION, Check, Examined
from gimbalcal.checks.input_errors import (
    PERMUTATIONS,
    Correction,
    in_other_units,
    permutation_correction,
    scale_correction,
    successful_trials,
)
from gimbalcal.effects.effect import TRIAD
from gimbalcal.effects.history import integral
from gimbalcal.errors import InputError
from gimbalcal.number import Array
from gimbalcal.platform import Platform
from gimbalcal.quantities import QUANTITIES
from gimbalcal.recording.dwell import usual_step
from gimbalcal.recording.record import ANGLE, RATE, Recording
from gimbalcal.rotation import frame_rotation

SPAN_S = 0.1  # readouts of a thousandth of a turn show the rate, and no axis turns far
MAX_SPANS = 2000
MAX_RESIDUAL = 0.26  # of what gyroscopes read, unexplained by the rig: 15 deg
MIN_RATE_CHANGE = np.radians(0.1)  # rad/s; a rate that changes by less shows nothing


@dataclass(frozen=True, eq=False)
class DrivenTurn:
    """Readings (m, 3) [rad/s], readouts (m, k) [rad] and their rates (m, k) [rad/s] over short spans."""

    read: Array
    angle: Array
    rate: Array
    names: tuple[str, ...]  # of the axes that are read

    def corrected(self, correction: Correction) -> DrivenTurn:
        """Return the turn with other readings or readouts."""
        angle, rate = (correction.of(ANGLE, x) for x in (self.angle, self.rate))
        return replace(self, read=correction.of(RATE, self.read), angle=angle, rate=rate)

    def misfit(self, platform: Platform, scale: float | None = 1.0) -> float:
        """Return the share of the readings that is linear in the chain's rate and not the rate; scale None: free."""
        y, w = self._centred(platform)
        felt = w @ np.linalg.lstsq(w, y, rcond=1e-6)[0]
        size, whole = float((w**2).sum()), float((felt**2).sum())
        if size == 0 or whole == 0:
            return 1.0
        s = float((w * felt).sum()) / size if scale is None else scale
        return float(np.sqrt(((felt - s * w) ** 2).sum() / max(whole, s * s * size)))

    def residual(self, platform: Platform, scale: float | None = 1.0) -> float:
        """Return the rms of the readings less the rate of the chain, noise included, as a share of theirs."""
        y, w = self._centred(platform)
        size, whole = float((w**2).sum()), float((y**2).sum())
        s = float((w * y).sum()) / max(size, 1e-300) if scale is None else scale
        return float(np.sqrt(((y - s * w) ** 2).sum() / whole)) if whole > 0 else 1.0

    def by(self, platform: Platform) -> Array:
        """Return the rate (m, 3) [rad/s] of the unit by the chain; an axis that is not read stands at zero."""
        total, R = np.zeros((len(self.angle), 3)), np.eye(3)
        for axis in platform.axes:
            angle, rate = np.zeros(len(total)), np.zeros(len(total))
            if axis.name in self.names:
                k = self.names.index(axis.name)
                angle, rate = self.angle[:, k], self.rate[:, k]
            total += axis.sign * rate[:, None] * R[..., "xyz".index(axis.direction)]
            R = R @ frame_rotation(axis.direction, axis.sign * angle + axis.offset)
        return total

    def _centred(self, platform: Platform) -> tuple[Array, Array]:
        w = self.by(platform)
        return self.read - self.read.mean(0), w - w.mean(0)


def driven_turn(time: Array, read: Array, angles: Array, names: Sequence[str]) -> DrivenTurn:
    """Return spans of readings (n, 3) and readouts (n, k) [rad] that may begin anew at a turn."""
    step = float(np.median(np.diff(time)))
    n = max(1, min(round(SPAN_S / step), len(time) - 1))  # a log shorter than a span is one
    whole = np.unwrap(angles, axis=0)
    starts = np.arange(0, len(time) - n, max(n, (len(time) - n) // MAX_SPANS))
    sums = integral(read, time)
    span = (time[starts + n] - time[starts])[:, None]
    middle = (whole[starts] + whole[starts + n]) / 2
    return DrivenTurn(
        (sums[starts + n] - sums[starts]) / span, middle, (whole[starts + n] - whole[starts]) / span, tuple(names)
    )


def rates_of_the_table(e: Examined) -> str:
    """Refuse gyroscopes that do not feel the rig turn as stated; name the first correction under which they do.

    Readings in counts show their axes only.
    """
    r, turn, scale = e.recording, e.once(_turn_by_rig), None if e.recording.counted(RATE) else 1.0
    if not _shows_rates(turn) or turn.misfit(r.platform, scale) < MAX_RESIDUAL:
        return ""

    def misfit(c: Correction) -> float:
        corrected = _turn_by_rig(c.corrected(r)) if ANGLE in c.matrices else turn.corrected(c)
        return corrected.misfit(c.platform or r.platform, scale)

    for best in successful_trials(_corrections(r, physical=scale is not None), misfit, sufficient=MAX_RESIDUAL):
        if best.misfit <= MAX_RESIDUAL:
            return f"the gyroscopes feel the rig turn {best.candidate.words}: {best.candidate.remedy}"
    fastest = float(np.linalg.norm(turn.read, axis=1).max())
    aliased = scale is not None and fastest * usual_step(r) > pi
    half = "; the table turns by more than half a turn from row to row, so log it faster" if aliased else ""
    return (
        "what the gyroscopes read is not what the angles of the rig say, whichever unit, sense or axis is "
        f"changed{half}; mount the unit with one of its axes along the table's, within 15 deg, and look at the "
        "columns of the rig and their clock"
    )


def refuse_unlike_table(recording: Recording) -> None:
    """Raise `InputError` where three gyroscopes and the angles of a rig are not logged, or they do not feel it turn."""
    if set(recording.axes(RATE)) != {"x", "y", "z"}:
        raise InputError(
            f"{recording.title!r} does not hold rates along x, y and z; a rate table calibrates three gyroscopes"
        )
    if not recording.platform.axes or not recording.has(ANGLE):
        raise InputError(
            f'{recording.title!r} does not say how the table turned: give its angle as a column, quantity = "{ANGLE}", '
            "and its axis in [platform]; against an attitude that was logged: --method attitude"
        )
    if sentence := rates_of_the_table(Examined(recording)):
        raise InputError(f"{recording.label}: {sentence}")


def agrees_with_the_table(recording: Recording) -> bool:
    """Return whether the gyroscopes feel the rig turn as stated: their axes, signs and unit are confirmed."""
    turn = _turn_by_rig(recording)
    return _shows_rates(turn) and not recording.counted(RATE) and turn.misfit(recording.platform) < MAX_RESIDUAL


def _turn_by_rig(r: Recording) -> DrivenTurn:
    return driven_turn(r.time, r.triad(RATE), r.angles(), r.platform.axis_names)


def _shows_rates(turn: DrivenTurn) -> bool:
    return float(np.std(turn.rate, axis=0).max(initial=0.0)) >= MIN_RATE_CHANGE


def _corrections(r: Recording, physical: bool) -> Iterator[Correction]:
    """Yield other statements of a rig and of gyroscopes on it, the simplest first; of counts only the axes."""
    logged, names = r.axes(ANGLE), r.platform.axis_names
    if physical:
        remedy = 'write unit = "{unit}" for the column of ' + " and ".join(logged)
        stated = [r.units.get((ANGLE, a), QUANTITIES[ANGLE].si) for a in logged]
        yield from in_other_units(ANGLE, logged, stated, "as its angles say in {unit}, not {stated}", remedy, names)
    for few in sorted(product((0, 1), repeat=len(names)), key=sum) if physical else ():
        turned = [a for a, wrong in zip(names, few, strict=True) if wrong]
        if turned and set(turned) <= set(logged):  # the readout counts backwards, whatever its zero
            column = f"at the column of {' and '.join(turned)} in [columns]"
            remedy = f"write sign = -1 {column}, or take it out where it is there"
            yield scale_correction(ANGLE, turned, -1.0, "the other way than its angles say", remedy, names)
    for direction, sign in product("xyz", (1, -1)) if len(names) == 1 else ():
        (axis,) = r.platform.axes
        turn = "" if sign == axis.sign or not physical else ", sign = -1"
        yield Correction(
            f"about {direction} of the unit, not about {axis.direction} as [platform] says",
            f'write direction = "{direction}"{turn} for its axis {axis.name}, or exchange the gyroscopes in [columns]',
            platform=Platform("own", (replace(axis, direction=direction, sign=sign),)),
        )
    for p in PERMUTATIONS[1:]:
        yield replace(permutation_correction(RATE, p), words=f"if {p.in_words(RATE)}")
    stated = [r.units.get((RATE, a), QUANTITIES[RATE].si) for a in TRIAD]
    words = "if they read {unit}, not {stated}"
    yield from in_other_units(RATE, TRIAD, stated, words, 'write unit = "{unit}" for them')


CHECKS = (Check(rates_of_the_table, ROTATION, ("driven",)),)
