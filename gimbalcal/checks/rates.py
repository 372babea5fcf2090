r"""Checks of gyroscopes by turns between rests and by the Earth's rate: their axes, signs, unit and clock.

A calibration would absorb these input errors too, as scale errors of -170000 ppm. So the turn that the gyroscopes
measured between rests is compared with what gravity's direction (else the gimbals) did, and with what it would be under
each correction of their columns (`measured_turns`).

At rest, where the latitude is known and the gyroscopes see the Earth, its rate along the vertical shows it again, with
b a bias: :math:`f_k / |f_k| \cdot (M w_k - b) = \Omega \sin L`. Scale errors, biases and misalignments that can be
calibrated are far smaller than the thresholds here.

Gravity alone cannot distinguish a permutation of the gyroscopes that keeps them right-handed from the inverse one of
the accelerometers, so both are named unless gimbals confirm the accelerometers.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations, product

import numpy as np

from gimbalcal.checks.check import POSITIONS, ROTATION, STATIC, Check, Examined
from gimbalcal.checks.driven_rates import agrees_with_the_table
from gimbalcal.checks.input_errors import (
    AS_STATED,
    CLOCK_UNITS,
    MIN_AGREEMENT,
    MIN_GAIN,
    PERMUTATIONS,
    SINGLE_ERRORS,
    AxisPermutation,
    Correction,
    change_part_way,
    in_other_units,
    permutation_correction,
    scale_correction,
    successful_trials,
)
from gimbalcal.checks.measured_turns import MeasuredTurns, down_at_rests, turns_of
from gimbalcal.earth import EARTH_RATE
from gimbalcal.effects.effect import TRIAD
from gimbalcal.number import Array
from gimbalcal.quantities import QUANTITIES
from gimbalcal.recording.dwell import dwell_levels
from gimbalcal.recording.record import FORCE, RATE, Recording

MIN_RESTS = 8  # three of them go into the bias
MEDIAN_TURNS_RAD = np.geomspace(0.2, 20, 40)  # tried for the median turn, where the scale of a count is unknown
FACTORS = np.geomspace(1e-2, 1e2, 93)  # of all rates, in steps of 10 %
MAX_SCALE_ERROR = 3.0  # rates off by less are no wrong unit: a range that was exceeded, rows that were lost
REVERSED = AxisPermutation(signs=(-1, -1, -1))
MAX_RESIDUAL = 0.3  # of what the Earth's rate leaves without gyroscopes: they see the Earth where less remains
NOT_CHECKED = (
    "axes, signs and unit of the gyroscopes were not checked: it takes three logged turns between rests that move "
    "gravity, or the Earth's rate at eight rests at a known latitude"
)
STATIC_NOT_CHECKED = "the gyroscopes of a static run are not looked at"


def turns_explained(recording: Recording, turns: MeasuredTurns | None) -> tuple[int, int] | None:
    """Return the number of turns that the gyroscopes explain as stated, and of all; None where nothing shows it."""
    return (
        None
        if turns is None
        else (max(map(turns.agreeing, _stated_or_guessed_scales(recording, turns))), len(turns.reading))
    )


def turns_between_rests(e: Examined) -> str:
    """Refuse gyroscopes for which a correction explains nearly every turn, and the statement does not."""
    turns = e.once(turns_of)
    if turns is None:
        return ""
    n, scales = len(turns.reading), _stated_or_guessed_scales(e.recording, turns)
    stated = max(map(turns.agreeing, scales))
    if stated >= MIN_AGREEMENT * n:
        return ""
    units = [] if e.recording.counted(RATE) else _units(e.recording)
    ambiguous = not e.attitude_known and turns.reference == "gravity"
    others = range(1, len(PERMUTATIONS))
    stages: tuple[Callable[[], Iterable[tuple[Correction, int]]], ...] = (  # a correction, and the permutation after it
        lambda: (*product(units, (0,)), *product(scales, others)),
        lambda: product(units, others),
        lambda: ((_in_some(c, few), 0) for c in units for k in (1, 2) for few in combinations(TRIAD, k)),
    )

    def misfit(each: tuple[Correction, int]) -> float:
        unit, k = each
        return n - (float(turns.agreeing_permuted(_correction_size(unit))[k]) if k else turns.agreeing(unit))

    for k, stage in enumerate(stages):  # one error before two
        for best in successful_trials(stage(), misfit):
            agreeing = n - int(best.misfit)
            if agreeing >= MIN_AGREEMENT * n:
                return "" if agreeing < stated + MIN_GAIN else (
                    f"only {stated} of {n} turns between rests are by {turns.reference} what the gyroscopes say, and "
                    f"{agreeing} if {_permuted_in_words(*best.candidate, ambiguous)}"
                )  # fmt: skip
        if k == 0 and units and (sentence := _any_factor(e.recording, turns, stated)):
            return sentence
    part = _changed_part_way(turns, units)
    reference = f"only {stated} of {n} turns between rests are by {turns.reference} what the gyroscopes say, and"
    return f"{reference} {part}" if part else ""


def _changed_part_way(turns: MeasuredTurns, units: Sequence[Correction]) -> str:
    """Return in words which simple correction a part of the turns needs, and which part; empty for none."""
    in_time = np.argsort(turns.start)
    single = [*(permutation_correction(RATE, p) for p in SINGLE_ERRORS), *units]
    single += [_in_some(unit, [axis]) for unit in units for axis in TRIAD]
    if turns.reference == "gravity":  # which M turns as rates -M^-1 w do
        single += [replace(permutation_correction(RATE, p.inverse(-1)), words=p.in_words(FORCE)) for p in SINGLE_ERRORS]
    agree = np.array([turns.agrees(correction)[in_time] for correction in (AS_STATED, *single)])
    part = change_part_way(agree[0], agree[1:])
    return part.in_words(single[part.number].words, turns.start[in_time]) if part else ""


def _any_factor(recording: Recording, turns: MeasuredTurns, stated: int) -> str:
    """Name any other factor of all rates: a unit that is in no list."""
    as_stated = FACTORS[np.abs(np.log(FACTORS)) <= np.log(MAX_SCALE_ERROR)]
    fitting = turns.fitting_factor(FACTORS)
    if fitting is None or turns.fitting_factor(as_stated) is not None:
        return ""
    factor, agreeing = fitting
    return (
        f"only {stated} of {len(turns.reading)} turns between rests are by {turns.reference} what the gyroscopes say, "
        f"and {agreeing} if every rate were some {factor:.2g} times what it is; correct the unit of their "
        f"columns, {recording.units.get((RATE, 'x'), 'rad/s')!r}, or of the time"
    )


@dataclass(frozen=True, eq=False)
class EarthRate:
    """Rates (m, 3) [rad/s] at rests, the vertical `up` (m, 3) there, and the Earth's rate `due` [rad/s] along it."""

    up: Array
    rate: Array
    due: float

    def residual(self, correction: Correction) -> float:
        """Return the rms [rad/s] by which corrected rates miss the Earth's along the vertical, biases aside."""
        error = np.sum(self.up * correction.of(RATE, self.rate), axis=1) - self.due
        Q = np.linalg.qr(self.up)[0]
        return float(np.sqrt(np.mean((error - Q @ (Q.T @ error)) ** 2)))

    @cached_property
    def without(self) -> float:
        """Return the rms [rad/s] that rates of zero leave."""
        return self.residual(scale_correction(RATE, TRIAD, 0.0, ""))

    def agrees(self, correction: Correction) -> bool:
        """Return whether corrected rates show the Earth's."""
        return self.residual(correction) < MAX_RESIDUAL * self.without


def earth_rate(recording: Recording) -> EarthRate | None:
    """Return the rates at enough rests that differ enough, where gyroscopes in SI may see the Earth; else None."""
    up, latitude = down_at_rests(recording), recording.site.latitude
    if latitude is None or up is None or len(up) < MIN_RESTS or recording.counted(RATE):
        return None
    if np.linalg.matrix_rank(up[..., 0], tol=0.1 * np.sqrt(len(up))) < 3:
        return None
    due = EARTH_RATE * float(np.sin(latitude))
    earth = EarthRate(up[..., 0], dwell_levels(recording, RATE), due)
    return earth if earth.without >= 0.5 * abs(due) else None


def earth_at_rest(e: Examined) -> str:
    """Refuse gyroscopes that see the Earth's rate along the vertical under a correction, and not as stated."""
    r, earth = e.recording, e.once(earth_rate)
    if earth is None or earth.agrees(AS_STATED):
        return ""
    by_turns = e.once(turns_of) is not None  # turns confirm the gyroscopes with the accelerometers, but for all signs
    units = [AS_STATED, *(c for c in _units(r) if c.clock == 1 and not by_turns)]
    composed = [(u, p) for u in units for p in PERMUTATIONS if not by_turns or p == REVERSED]
    (best,) = successful_trials(composed, lambda each: earth.residual(_composed_correction(*each)))
    unit, p = best.candidate
    correction = _composed_correction(unit, p)
    if not earth.agrees(correction):
        return ""
    named = [] if by_turns else [(p, RATE)]
    named += [] if e.attitude_known else [(p.inverse(), FORCE)]
    south = "the latitude has the opposite sign, or " if p == REVERSED else ""
    due, stated, corrected = (
        3600 * np.degrees(x) for x in (earth.due, earth.residual(AS_STATED), earth.residual(correction))
    )
    return (
        f"at rest the gyroscopes miss the Earth's rate along the vertical, {due:.4g} deg/h, by {stated:.3g} deg/h rms, "
        f"and by {corrected:.3g} deg/h if {south}{_in_words(named, unit.words)}"
    )


def rates_not_checked(e: Examined) -> str:
    """Remark that nothing in the recording shows axes, signs and unit of the gyroscopes."""
    earth = e.once(earth_rate)
    table = e.recording.kind.rotating and e.has("attitude") and agrees_with_the_table(e.recording)
    confirmed = e.once(turns_of) is not None or (earth is not None and earth.agrees(AS_STATED)) or table
    return "" if confirmed else NOT_CHECKED


def static_rates_not_checked(_: Examined) -> str:
    """Remark that gyroscopes of a static run are not checked."""
    return STATIC_NOT_CHECKED


def _units(recording: Recording) -> list[Correction]:
    """Return other units of the rates and other clocks."""
    step = recording.step
    increments = f'they are what each step of {step:.3g} s adds to the angle (write quantity = "angle_increment")'
    stated = recording.units.get((RATE, "x"), QUANTITIES[RATE].si)
    corrections = [
        scale_correction(RATE, TRIAD, 1 / step, increments),
        *in_other_units(RATE, TRIAD, [stated], 'the rates are in {unit} (write unit = "{unit}")'),
        *(Correction(f"the time is in {u}", clock=f) for f, u in CLOCK_UNITS.items()),
    ]
    return [c for c in corrections if abs(_correction_size(c) - 1) > 1e-6]


def _correction_size(correction: Correction) -> float:
    return correction.clock * correction.factor(RATE)


def _stated_or_guessed_scales(recording: Recording, turns: MeasuredTurns) -> list[Correction]:
    """Return the rates as stated; of counts, guesses of the rad/s of a count."""
    if not recording.counted(RATE):
        return [AS_STATED]
    turned = [(np.linalg.norm(w, axis=1) * dt).sum() for w, dt in zip(turns.reading, turns.step, strict=True)]
    return [scale_correction(RATE, TRIAD, float(g), "") for g in MEDIAN_TURNS_RAD / np.median(turned)]


def _composed_correction(unit: Correction, permutation: AxisPermutation) -> Correction:
    """Return a permutation of the gyroscopes in another unit."""
    return replace(unit, matrices={RATE: (TRIAD, _correction_size(unit) / unit.clock * permutation.matrix)})


def _permuted_in_words(unit: Correction, number: int, ambiguous: bool) -> str:
    """Return a permutation of the gyroscopes in another unit; ambiguous: it may be the accelerometers' instead."""
    p = PERMUTATIONS[number]
    named = [(p, RATE)]
    if p.handed > 0 and ambiguous:
        named.append((min((p.inverse(sign) for sign in (1, -1)), key=lambda q: q.complexity), FORCE))
    handed = "; as stated the gyroscopes make a left-handed triad" if p.handed < 0 else ""
    return _in_words(named, unit.words, handed)


def _in_some(unit: Correction, axes: Sequence[str]) -> Correction:
    """Return another unit of some of the gyroscopes."""
    return scale_correction(RATE, axes, _correction_size(unit), f"{unit.words} in {' and '.join(axes)} alone")


def _in_words(named: Sequence[tuple[AxisPermutation, str]], unit: str, handed: str = "") -> str:
    """Return permutations of which one is true, the simplest first, after a unit; and what to write for the first."""
    changed = sorted((each for each in named if each[0] != PERMUTATIONS[0]), key=lambda each: each[0].complexity)
    words = [unit] if unit else []
    if changed:
        alternatives = ", or ".join(p.in_words(quantity) for p, quantity in changed)
        p, quantity = changed[0]
        words.append(f"{alternatives}{handed}; correct [columns]: {p.remedy(quantity)}")
    return " and ".join(words)


MOVED_KINDS = (*POSITIONS, *ROTATION)
CHECKS = (
    Check(turns_between_rests, MOVED_KINDS, (RATE, "no driven")),
    Check(earth_at_rest, MOVED_KINDS, (RATE, "no driven")),
    Check(rates_not_checked, MOVED_KINDS, (RATE, "no driven"), question=True),
    Check(static_rates_not_checked, STATIC, (f"any {RATE}",), question=True),
)
