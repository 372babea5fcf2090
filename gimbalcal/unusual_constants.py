"""Constants beyond the grade of a unit: a question to who made the recording, with the likeliest input error tried.

An estimator accepts constants of any size, so a wrong unit, sign, latitude or clock becomes constants that no unit has,
with small sigmas. Each constant is compared with the grade of the unit, `Grade.most`. Where one is beyond, the
corrections that would make such a constant are tried one by one: the recording is corrected and calibrated again, and
those with which every constant is usual are named. The result is kept, and its outcome asks the question.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import combinations, islice

import numpy as np

from gimbalcal.calibration import Calibration
from gimbalcal.checks.forces import gimbal_corrections, other_range
from gimbalcal.checks.input_errors import (
    AS_STATED,
    CLOCK_UNITS,
    Correction,
    exchange_correction,
    in_other_units,
    scale_correction,
    successful_trials,
)
from gimbalcal.checks.sidereal import excess_rate_of_platform, measured_latitude
from gimbalcal.earth import EARTH_RATE, HOUR
from gimbalcal.effects import CATALOGUE, Parameter
from gimbalcal.effects.effect import GYROSCOPE_STAGES, TRIAD
from gimbalcal.effects.sensor_grades import drift_rate_factor
from gimbalcal.errors import list_of_alternatives
from gimbalcal.estimate.grade import Graded
from gimbalcal.estimate.gyroscopes.residual_checks import WRONG_RANGE
from gimbalcal.estimate.static_run.system import linear_misfit
from gimbalcal.forward import AXES
from gimbalcal.quantities import QUANTITIES
from gimbalcal.recording import Recording
from gimbalcal.recording.record import ANGLE, FORCE, SENSOR_OF
from gimbalcal.units import from_si

MIN_SIGMAS = 3.0  # by which a constant has to be beyond
MAX_TRIALS, MAX_SHOWN = 6, 2
TRIAL_ROWS = 60  # of a static run, in which a correction is tried
SIDEREAL_SECOND = 365.2422 / 366.2422  # of a mean solar second
MAX_CLOCK_ERROR = 2e-5  # of a clock; more is 2 s a day
MAX_REMAINING_SHARE = 1e-3  # of chi^2, as an offset is known to minutes of arc
MIN_IMPROVEMENT = 10.0  # of the linear misfit, by which a correction is worth a fit
ATTITUDE = "attitude_error"
MAX_RELATIVE_DIFFERENCE = 0.2  # relative, of a scale factor and a ratio of units
MIN_LATITUDE_ERROR_RAD = 1e-3
SCALED_QUANTITIES = {"scale_factor": "specific_force", "gyro_scale_factor": "angular_rate"}
Again = Callable[[Sequence[Recording]], Calibration]
Limit = Callable[[Parameter], float]


def with_question(
    c: Calibration, recordings: Sequence[Recording], unit: Graded, again: Again, known: Container[str] = (),
    reported: str = "",
) -> Calibration:  # fmt: skip
    """Return the calibration, whose outcome asks where a constant is none of a unit of this grade; `again` calibrates.

    known: effects that a diagnosis reports with size and evidence, which are no question; reported: what else it says
    against the recording. Where that names a wrong range already, nothing is said against other units.
    """
    duration_s = max(float(np.ptp(r.time)) for r in recordings)
    counted = c.readout.gyroscopes is not None  # where zero is and what a count is, and so of which grade, is open

    def limit(p: Parameter) -> float:
        open_size = p.effect in known or (counted and CATALOGUE[p.effect].stage in GYROSCOPE_STAGES)
        return np.inf if open_size else largest_usual(unit, duration_s, p)

    beyond = beyond_grade(c, limit)
    if not beyond:
        return c
    cause = likeliest_corrections(c, recordings, limit, again)
    if WRONG_RANGE in f"{c.outcome} {reported}":
        cause = cause or "the turns between rests show it too"
    question = in_words(c, beyond, limit, cause, f"{unit.grade.name} grade: {unit.source}")
    outcome = "; ".join(filter(None, [question, c.outcome]))
    return replace(c, outcome=outcome, provenance=c.provenance.with_options(question=question))


def with_correction(c: Calibration, recordings: Sequence[Recording], again: Again) -> Calibration:
    """Return the same calibration, or, of a static run that does not fit, one that names the correction that does.

    No check before the fit sees the sign, unit or order of a navigator's attitude errors, a gimbal that hardly moves,
    or a clock that is off by less than a platform may drift. The correction with the least linear misfit is fitted.
    """
    if c.explained or len(recordings) != 1 or not recordings[0].kind.stabilised:
        return c
    run = recordings[0]
    some = run.select(slice(None, None, max(1, len(run.time) // TRIAL_ROWS)))

    def misfit(correction: Correction) -> float:
        return linear_misfit(correction.corrected(some))

    stated = misfit(AS_STATED)
    for best in successful_trials(corrections_of_static_run(run), misfit):
        if MIN_IMPROVEMENT * best.misfit > stated:
            continue
        correction = best.candidate
        fitted = again([correction.corrected(run)])
        share = fitted.residual.chi2 / c.residual.chi2
        if fitted.explained or (correction.offsets and share < MAX_REMAINING_SHARE):
            effect = "the data are explained" if fitted.explained else f"chi^2 falls to {share:.1g} of what it is"
            words = ": ".join(filter(None, [f"{effect} if {correction.words}", correction.remedy]))
            return replace(c, outcome=f"{words}; {c.outcome}")
    return c


def corrections_of_static_run(r: Recording) -> Iterator[Correction]:
    """Yield other statements of a static run, the likeliest first: its clock, attitude errors, and gimbals."""
    if (excess := excess_rate_of_platform(r)) and abs(excess) > MAX_CLOCK_ERROR:
        drift = f"or else the platform drifts by {np.degrees(excess * EARTH_RATE) * HOUR:.3g} deg/h"
        sidereal = abs(1 + excess - SIDEREAL_SECOND) < MAX_CLOCK_ERROR
        off = f"the clock runs {abs(100 * excess):.3g} % {'slow' if excess > 0 else 'fast'}"
        words = f"{'the time is in sidereal seconds' if sidereal else off}, {drift}"
        yield Correction(words, clock=SIDEREAL_SECOND if sidereal else 1 + excess)
    names = AXES[ATTITUDE]
    axes = [a for a in names if (ATTITUDE, a) in r.channels]
    for a in axes:
        words = f"attitude error {a} is of the opposite sign"
        yield scale_correction(ATTITUDE, [a], -1.0, words, f"write sign = -1 for {a} in [columns]", names)
    stated = [r.units.get((ATTITUDE, a), QUANTITIES[ATTITUDE].si) for a in axes]
    words, remedy = "the attitude errors are in {unit}, not in {stated}", 'write unit = "{unit}" for them in [columns]'
    yield from in_other_units(ATTITUDE, axes, stated, words, remedy, names)
    for a, b in combinations(axes, 2):
        yield exchange_correction(
            ATTITUDE, names, names.index(a), names.index(b), f"attitude errors {a} and {b} are interchanged"
        )
    if all((FORCE, a) in r.channels for a in TRIAD) and r.axes(ANGLE):
        yield from gimbal_corrections(r)


def largest_usual(unit: Graded, duration_s: float, p: Parameter) -> float:
    """Return the size [SI] beyond which a constant is hardly one of this unit, recorded for so many seconds."""
    return drift_rate_factor(CATALOGUE[p.effect], duration_s) * unit.grade.most(p)


def beyond_grade(c: Calibration, limit: Limit) -> tuple[int, ...]:
    """Return the parameters beyond what a unit of this grade has, the farthest first."""
    over = (np.abs(c.values) - MIN_SIGMAS * c.sigmas) / np.array([limit(p) for p in c.parameters])
    return tuple(int(i) for i in np.argsort(-over) if over[i] > 1)


def in_words(c: Calibration, beyond: Sequence[int], limit: Limit, cause: str, grade: str) -> str:
    """Return in words the constants beyond the grade, their usual size, and the likely cause."""
    stated, printed = [], c.in_printed_units.parameters
    for i in beyond[:MAX_SHOWN]:
        p = printed[i]
        size, sigma, usual = (from_si(x, p.unit) for x in (c.values[i], c.sigmas[i], limit(c.parameters[i])))
        stated.append(
            f"{p.name.replace('_', ' ')} {p.axis} is {size:.4g} +- {sigma:.2g} {p.unit}, usual is below {usual:.3g}"
        )
    rest = len(beyond) - MAX_SHOWN
    others = "one more constant is" if rest == 1 else f"{rest} more constants are"
    more = f", and {others} as far off" if rest > 0 else ""
    end = cause or "is that so? No other unit, sign or place explains it; look at these sensors"
    return f"{', '.join(stated)}{more} ({grade}): {end}"


def likeliest_corrections(c: Calibration, recordings: Sequence[Recording], limit: Limit, again: Again) -> str:
    """Return in words the corrections with which every constant is usual; empty for none."""

    def misfit(correction: Correction) -> int:
        other = again([correction.corrected(r) for r in recordings])
        return len(beyond_grade(other, limit)) + (bool(other.outcome) and not c.outcome)

    tried = successful_trials(islice(corrections(c, recordings, limit), MAX_TRIALS), misfit, most=MAX_TRIALS)
    usual = [trial.candidate.words for trial in tried if not trial.misfit]
    return f"every constant is usual if {list_of_alternatives(usual)}; correct recording.toml" if usual else ""


def corrections(c: Calibration, recordings: Sequence[Recording], limit: Limit) -> Iterator[Correction]:
    """Yield the input errors that would make these constants, the likeliest first."""
    for r in recordings:
        measured, stated = measured_latitude(r), r.site.latitude
        if measured is not None and stated is not None and abs(measured - stated) > MIN_LATITUDE_ERROR_RAD:
            words = f"the latitude is {np.degrees(measured):.4g} deg, not {np.degrees(stated):.4g} deg"
            yield Correction(words, latitude=measured)
    for effect, quantity in SCALED_QUANTITIES.items():
        sizes = {p.axis: 1 + v for p, v in zip(c.parameters, c.values, strict=True) if p.effect == effect}
        wrong = [p.axis for p in (c.parameters[i] for i in beyond_grade(c, limit)) if p.effect == effect]
        if wrong and quantity == "angular_rate" and len(wrong) == len(sizes):
            for factor, unit in CLOCK_UNITS.items():
                if _are_alike(sizes.values(), factor):
                    yield Correction(f"the time is in {unit}", clock=factor)
        if wrong:
            yield from _of_sensors([sizes[a] for a in wrong], wrong, quantity, recordings[0])
        if wrong and set(sizes) == set(TRIAD):
            yield _common_correction(float(np.median([*sizes.values()])), quantity)


def _common_correction(factor: float, quantity: str) -> Correction:
    """Return the correction of a whole triad that reads too much, or too little, by one factor."""
    of_all = f"{abs(100 * (1 / factor - 1)):.3g} % too {'much' if factor < 1 else 'little'}"
    if quantity == "specific_force":
        cause = "as where g was converted with another constant, or gravity or the height in [site] is wrong"
        return scale_correction(quantity, TRIAD, factor, f"every accelerometer reads {of_all}, {cause}")
    return Correction(f"the clock is off, by which every gyroscope reads {of_all}", clock=factor)


def _of_sensors(sizes: Sequence[float], axes: Sequence[str], quantity: str, r: Recording) -> Iterator[Correction]:
    """Yield the other sign and other units of the sensors whose scale is wrong, all of them together."""
    several = len(axes) > 1
    which = f"the {SENSOR_OF[quantity]}{'s' if several else ''} {' and '.join(axes)} {'are' if several else 'is'}"
    if all(size < 0 for size in sizes):
        yield scale_correction(quantity, axes, -1.0, f"{which} of the opposite sign")
    ratio = other_range(float(np.median(np.abs(sizes))))
    if ratio and _are_alike(map(abs, sizes), ratio):
        yield scale_correction(quantity, axes, ratio, f"{which} of another range, {ratio:g} times the one read")
    words = which + " in {unit}, not in {stated}"
    stated = r.units.get((quantity, axes[0]), QUANTITIES[quantity].si)
    for correction in in_other_units(quantity, axes, [stated], words):
        if _are_alike(map(abs, sizes), correction.factor(quantity)):
            yield correction


def _are_alike(sizes: Iterable[float], factor: float) -> bool:
    return all(abs(size / factor - 1) < MAX_RELATIVE_DIFFERENCE for size in sizes)
