r"""Checks of accelerometers at rest: their unit by the norm of gravity, their axes and signs by gimbal angles.

A calibration would absorb many input errors: a triad with x and y interchanged fits a misalignment of 90 deg. So the
force at each rest is compared with what the gimbal readouts predict for a perfect platform on a level base,

.. math:: f^p = -g \, C_b^p(\text{angles}) \, (0, 0, 1) ,

and with what it would be under each correction. Errors that can be calibrated are a hundred times smaller than
`MAX_DEVIATION_RAD`, and single mis-set positions are left to the estimators: a recording is refused only where a
correction explains nearly every rest and the statement does not.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import numpy as np

from gimbalcal.checks.check import POSITIONS, STATIC, Check, Examined
from gimbalcal.checks.input_errors import (
    AS_STATED,
    MAX_DEVIATION_RAD,
    MIN_AGREEMENT,
    MIN_GAIN,
    PERMUTATIONS,
    SINGLE_ERRORS,
    UNITS,
    Correction,
    change_part_way,
    exchange_correction,
    in_other_units,
    offset_correction,
    permutation_correction,
    scale_correction,
    successful_trials,
)
from gimbalcal.effects.effect import TRIAD
from gimbalcal.number import Array, apply_matrix
from gimbalcal.platform import Platform
from gimbalcal.recording.detection import motion
from gimbalcal.recording.dwell import dwells
from gimbalcal.recording.noise_levels import resolution
from gimbalcal.recording.record import ANGLE, FORCE, Recording
from gimbalcal.units import from_si, to_si

FORCE_UNITS = {unit: to_si(1.0, unit) for unit in UNITS[FORCE]}
MAX_NORM_ERROR = 0.3  # of gravity, rms: above that of any low-cost unit
NORM_ERROR_EXPLAINED = 0.25  # of it: what another unit may leave
NO_GRAVITY = 0.1  # of gravity: accelerometers that read less, all of them, had gravity subtracted
MAX_RANGES, MAX_RANGE_ERROR = 16.0, 0.05  # of ranges, each twice the one before: their ratio, and that to gravity
UNIT_RATIO_RANGE = 0.8, 1.25  # ratios that are one within the errors of a unit
MAX_MOTION = 0.2  # of gravity, half of the rows: a table that shakes so much is not at rest
FEWEST_RESTS = 3
STILL_RAD = 1e-3
MIN_STEP = 3.0  # of a converter, in sigmas: noise of less does not carry readings from one step to the next
MIN_FELT = 0.1  # of gravity, by which the force turns with a gimbal


def motion_within_a_position(e: Examined) -> str:
    """Refuse a position within which the force moves by more than vibration: means of eighths are compared."""
    r = e.recording
    for dwell in dwells(r):
        moved = motion(r.triad(FORCE, rows=dwell.rows))
        if moved > MAX_MOTION * r.site.gravity:
            t = r.time[[dwell.start, dwell.stop - 1]]
            return (
                f"within position {dwell.position}, from {t[0]:.10g} to {t[1]:.10g} s, the force "
                f"moves by {moved:.3g} m/s^2, so this is no rest; give each rest its own position "
                "number, and 0 to the rows between, or leave the position column out to have the rests found"
            )
    return ""


def unit_of_some(e: Examined) -> str:
    """Refuse one or two accelerometers in another unit: with it the norm is gravity at every rest."""
    rests, force, g = e.rests, e.force, e.rests.site.gravity

    def misfit(correction: Correction) -> float:
        return float(np.sqrt(np.mean((np.linalg.norm(correction.of(FORCE, force), axis=1) / g - 1) ** 2)))

    stated = misfit(AS_STATED)
    if stated < MAX_NORM_ERROR or len(force) < FEWEST_RESTS:
        return ""
    few = [(a,) for a in TRIAD] + [*combinations(TRIAD, 2)]
    corrections = [
        scale_correction(FORCE, axes, size / FORCE_UNITS.get(_unit(rests, axes[0]), 1.0), " and ".join(axes), unit)
        for axes in few
        for unit, size in FORCE_UNITS.items()
    ]
    (best,) = successful_trials(corrections, misfit)
    if best.misfit >= NORM_ERROR_EXPLAINED * min(stated, MAX_NORM_ERROR):
        return ""
    unit = best.candidate.remedy
    return (
        f"at rest the norm of the force differs from gravity by {100 * stated:.3g} % rms, and by "
        f"{100 * best.misfit:.2g} % if accelerometer {best.candidate.words} alone were in {unit}; write unit = "
        f'"{unit}" for it in [columns]'
    )


def unit_of_all(e: Examined) -> str:
    """Refuse a force whose norm at rest is not gravity within the errors of sensors."""
    return _compare_magnitude(e.rests, e.force, 0.0)


def lacks_gravity(e: Examined) -> bool:
    """Return whether the force is far less than gravity in most rows, as where it was taken off."""
    return float(np.median(np.linalg.norm(e.some_force, axis=1))) < NO_GRAVITY * e.recording.site.gravity


def unit_of_every_row(e: Examined) -> str:
    """Refuse the force of a unit turned in its place whose norm is not gravity, in most rows."""
    return _compare_magnitude(e.recording, e.some_force, e.step)


def other_range(ratio: float) -> float:
    """Return the power of two by which forces read in another range differ from gravity at this ratio to it; else 0."""
    power = 2.0 ** round(float(np.log2(ratio))) if ratio > 0 else 1.0
    within = 1 / MAX_RANGES < power < MAX_RANGES and abs(ratio / power - 1) < MAX_RANGE_ERROR
    return power if within and power != 1 else 0.0


def _compare_magnitude(recording: Recording, force: Array, step: float) -> str:
    """Compare the norm of forces (n, 3) with gravity; step [s] is that of rows that may be increments over it."""
    length = np.linalg.norm(force, axis=1)
    ratio = float(np.median(length)) / recording.site.gravity
    if 0.5 <= ratio <= 1.5:
        return ""
    unit = _unit(recording)
    factor = FORCE_UNITS.get(unit, 1.0)
    one_length = np.median(np.abs(length / np.median(length) - 1)) < MAX_MOTION if ratio else False  # as gravity has
    likely = [
        name
        for name, size in FORCE_UNITS.items()
        if one_length and UNIT_RATIO_RANGE[0] < ratio * size / factor < UNIT_RATIO_RANGE[1]
    ]
    remedy = f'the numbers look like {likely[0]}: write unit = "{likely[0]}"' if likely else "correct the unit"
    remedy += " of its columns"
    if step and not likely and UNIT_RATIO_RANGE[0] < ratio / factor / step < UNIT_RATIO_RANGE[1]:
        remedy = (
            f"the numbers look like what each step of {step:.3g} s adds to the velocity: write quantity = "
            '"velocity_increment", unit = "m/s"'
        )
    elif not likely and (range_ratio := other_range(ratio)):
        remedy = (
            f"that is {range_ratio:g} times gravity, as where the range is another than the one that was read: divide "
            'the readings by it, or write unit = "count", whose scale the calibration finds'
        )
    elif not likely and ratio < NO_GRAVITY:
        remedy = (
            "gravity was taken off (a telephone's linear acceleration: log the accelerometers themselves), or these "
            'are increments: write quantity = "velocity_increment", unit = "m/s"'
        )
    where = "in most rows" if step else "at rest"
    return (
        f"{where} the specific force is {ratio * recording.site.gravity:.4g} m/s^2 where gravity is "
        f"{recording.site.gravity:.4g} m/s^2, read in the unit {unit!r}; {remedy}"
    )


def gimbals_turn_less_than_the_force(e: Examined) -> str:
    """Refuse gimbals that turn by less than the force together: their angles are in radians, or not theirs."""
    rests, force = e.rests, e.force
    logged = rests.axes(ANGLE)
    turned = sum(float(np.ptp(rests.channels[ANGLE, a])) for a in logged)
    direction = force / np.linalg.norm(force, axis=1, keepdims=True)
    needed = float(np.max(np.arccos(np.clip(direction @ direction.T, -1, 1))))
    if turned >= 0.5 * needed or needed <= 2 * MAX_DEVIATION_RAD:
        return ""
    in_radians = turned >= STILL_RAD and "deg" in {rests.units.get((ANGLE, a), "rad") for a in logged}
    advice = (
        'so the angles look like radians; write unit = "rad" for the gimbal angles'
        if in_radians
        else "so the readouts are not those of the gimbals that moved; log them, or leave the columns out and name the "
        "platform 'bench'"
    )
    return (
        f"all gimbal angles together turn by {np.degrees(turned):.3g} deg while the measured "
        f"force turns by {np.degrees(needed):.3g} deg, {advice}"
    )


def unit_of_one_by_angles(e: Examined) -> str:
    """Refuse one accelerometer that follows the predicted force in another unit."""
    ideal = _predicted(e.rests.platform, e.rests.angles()) * e.rests.site.gravity
    for i, axis in enumerate(TRIAD):
        size = float(ideal[:, i] @ ideal[:, i])
        slope = float(e.force[:, i] @ ideal[:, i]) / size if size > len(ideal) else 1.0
        off = np.linalg.norm(e.force[:, i] - slope * ideal[:, i]) / np.linalg.norm(e.force[:, i])
        if off < 0.1 and not 0.5 < abs(slope) < 2:
            return (
                f"the accelerometer {axis} alone reads {abs(slope):.4g} times what the gimbal angles "
                f"predict, so its unit is not {_unit(e.rests, axis)!r}; correct it in [columns]"
            )
    return ""


def axes_by_angles(e: Examined) -> str:
    """Refuse a triad or gimbals for which a correction explains nearly every rest, and the statement does not."""
    rests, n = e.rests, len(e.force)

    def deviation(correction: Correction) -> Array:
        return _deviation(rests.platform, correction.of(ANGLE, rests.angles()), correction.of(FORCE, e.force))

    def misfit(correction: Correction) -> float:
        """Return the number of rests that disagree, and in tenths below one how far the others are off on average."""
        off = deviation(correction) / MAX_DEVIATION_RAD
        agree = off < 1
        tenths = min(round(float(off[agree].mean()), 1), 0.9) if agree.any() else 0.0
        return n - int(np.count_nonzero(agree)) + tenths

    stated = n - int(misfit(AS_STATED))
    if n < FEWEST_RESTS or stated >= MIN_AGREEMENT * n:
        return ""
    rows = "positions" if rests.kind.in_positions else "rows"
    of_n = f"only {stated} of {n} {rows} have the force that the gimbal angles predict, and"
    of_gimbals = [*gimbal_corrections(rests)]
    of_triad = [permutation_correction(FORCE, p) for p in PERMUTATIONS]
    best = [trial for some in (of_triad, of_gimbals) for trial in successful_trials(some, misfit)]
    least = min(trial.misfit for trial in best)
    if (agreeing := n - int(least)) >= max(MIN_AGREEMENT * n, stated + MIN_GAIN):
        equal = [trial.candidate for trial in best if trial.misfit == least]  # a triad and the gimbals may be alike
        remedy = " or ".join(each.remedy for each in equal if each.remedy)
        alternatives = ", or if ".join(each.words for each in equal)
        return f"{of_n} {agreeing} if {alternatives}; correct [columns]{': ' * bool(remedy)}{remedy}"
    single = [*(permutation_correction(FORCE, p) for p in SINGLE_ERRORS), *of_gimbals]
    agree = np.array([deviation(correction) < MAX_DEVIATION_RAD for correction in (AS_STATED, *single)])
    if part := change_part_way(agree[0], agree[1:]):
        return f"{of_n} {part.in_words(single[part.number].words, rests.time)}"
    if stated >= 0.5 * n:
        return ""
    return (
        f"only {stated} of {n} {rows} have the force within {np.degrees(MAX_DEVIATION_RAD):.0f} deg "
        f"of what the gimbal angles predict, whichever axes or signs are changed{_silent_gimbals(rests)}; check "
        "the platform, its zero angles and the gimbal columns, or leave these out and name the platform 'bench'"
    )


def gimbal_corrections(rests: Recording) -> Iterator[Correction]:
    """Yield other statements of the gimbals that were logged, the simplest first: signs, units, order, zeros."""
    names = rests.platform.axis_names
    logged = [i for i, name in enumerate(names) if (ANGLE, name) in rests.channels]
    stated = {name: rests.units.get((ANGLE, name), "rad") for name in (names[i] for i in logged)}
    for name in stated:
        remedy = f"for gimbal {name} write sign = -1"
        yield scale_correction(ANGLE, (name,), -1.0, f"the {name} angle has the opposite sign", remedy, names)
    remedy = 'write unit = "{unit}" for the gimbal '
    for name, unit in stated.items():
        yield from in_other_units(ANGLE, (name,), [unit], f"the {name} angle is in {{unit}}", remedy + name, names)
    if len(logged) > 1:
        words = "the gimbal angles are in {unit}"
        yield from in_other_units(ANGLE, [*stated], stated.values(), words, remedy + "angles", names)
    for i, j in combinations(logged, 2):
        yield exchange_correction(ANGLE, names, i, j, f"the {names[i]} and {names[j]} angles are interchanged")
    for i in logged:
        offset = _offset_by_force(rests, i)
        words = f"the zero of the {names[i]} angle is off by about {np.degrees(-offset):.3g} deg"
        yield offset_correction(ANGLE, names, i, offset, words)


def _offset_by_force(rests: Recording, gimbal: int) -> float:
    r"""Return the offset [rad] of the readout of a gimbal with which the predicted forces are nearest to the measured.

    Each predicted component is :math:`a + b \cos \delta + c \sin \delta`, so three offsets give the sum of products.
    """
    angles, force = rests.angles(), rests.triad(FORCE)
    direction = force / np.linalg.norm(force, axis=1, keepdims=True)
    turn = np.eye(angles.shape[1])[gimbal]
    tried = 2 * np.pi / 3 * np.arange(3)
    products = [float(np.sum(direction * _predicted(rests.platform, angles + x * turn))) for x in tried]
    return float(np.angle(np.dot(products, np.exp(1j * tried))))


def _silent_gimbals(rests: Recording) -> str:
    """Return in words which readouts are missing or never move: most likely the fault is theirs."""
    names, angles = rests.platform.axis_names, rests.angles()
    logged = {a: rests.channels[ANGLE, a] for a in rests.axes(ANGLE)}
    ideal = _predicted(rests.platform, angles)
    turned = [_predicted(rests.platform, angles + unit) for unit in np.eye(len(names))]  # about the vertical: not felt
    felt = [a for a, force in zip(names, turned, strict=True) if np.abs(force - ideal).max() > MIN_FELT]
    absent = [a for a in felt if a not in logged]
    still = [a for a, angle in logged.items() if np.ptp(angle) < STILL_RAD]
    asides = [f"the {' and '.join(absent)} angle is in no column and taken as zero"] if absent else []
    asides += [f"the readout of {' and of '.join(still)} never moves"] if still else []
    return f" ({', and '.join(asides)})" if asides else ""


def as_predicted(platform: Platform, angles: Array, force: Array) -> int:
    """Return at how many rests the force (n, 3) points where gimbal angles (n, k) have it."""
    return int(np.count_nonzero(_deviation(platform, angles, force) < MAX_DEVIATION_RAD))


def _deviation(platform: Platform, angles: Array, force: Array) -> Array:
    """Return the angle (n,) [rad] between forces (n, 3) and those that gimbal angles (n, k) predict."""
    cosine = np.sum(force * _predicted(platform, angles), axis=1) / np.linalg.norm(force, axis=1)
    return np.asarray(np.arccos(np.clip(cosine, -1, 1)))


def _predicted(platform: Platform, angles: Array) -> Array:
    """Return the direction (n, 3) of the force at gimbal angles (n, k)."""
    return -apply_matrix(platform.attitude(angles), np.array([0.0, 0.0, 1.0]))


def _unit(recording: Recording, axis: str = "x") -> str:
    return recording.units.get((FORCE, axis), "m/s^2")


PHYSICAL = f"physical {FORCE}"
AT_REST = (*POSITIONS, *STATIC)


def coarse_steps(e: Examined) -> str:
    """Remark on accelerometers that read in steps coarser than their noise: means of a dwell do not resolve them."""
    r = e.recording
    steps = {a: resolution(r.channels[FORCE, a]) for a in r.axes(FORCE)}
    sigma = {a: r.noise.get("accelerometer") or r.scatter.get((FORCE, a), 0.0) for a in steps}
    coarse = [a for a, step in steps.items() if step > MIN_STEP * sigma[a] > 0]
    if not coarse:
        return ""
    step = max(steps[a] for a in coarse)
    size = f"{step:.3g} count" if r.counted(FORCE) else f"{from_si(step, 'ug'):.3g} ug"
    which = f"accelerometer{'s' if len(coarse) > 1 else ''} {', '.join(coarse)}"
    return (
        f"{which} read in steps of {size}, coarser than the noise, so that a dwell is off by up to half a step however "
        "long it is: what looks like a value of its own at each position, or like a formula, may be the resolution; "
        "record in a finer range"
    )


CHECKS = (
    Check(coarse_steps, (*POSITIONS, *STATIC), (f"any {FORCE}",), question=True),
    Check(motion_within_a_position, POSITIONS, (PHYSICAL, "position")),
    Check(unit_of_some, AT_REST, (PHYSICAL,)),
    Check(unit_of_all, AT_REST, (PHYSICAL,)),
    Check(gimbals_turn_less_than_the_force, POSITIONS, (PHYSICAL, "attitude")),
    Check(unit_of_one_by_angles, AT_REST, (PHYSICAL, "attitude")),
    Check(axes_by_angles, AT_REST, (PHYSICAL, "attitude")),
)
