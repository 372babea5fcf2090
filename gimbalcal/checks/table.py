r"""Wrong units, axes, signs and clocks, found before anything is estimated.

A calibration would absorb many of these: a triad with x and y interchanged fits a misalignment of 90 deg. So the
force at each rest is compared with what the gimbal readouts predict for a perfect platform on a level base,

.. math:: f^p = -g \, C_b^p(\text{angles}) \, (0, 0, 1) ,

and with what it would be if axes were interchanged, signs wrong, or the angles meant otherwise. Errors that can be
calibrated are a hundred times smaller than `CLOSE`, and single mis-set positions are left to the estimators, so a
recording is refused only where another reading of the same columns fits nearly every rest and the stated one does not.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from gimbalcal.checks.axes import AXES, CLOSE, NEARLY_ALL, PERMUTATIONS, in_words, remedy
from gimbalcal.checks.covariates import check_clock, check_marked, check_temperature
from gimbalcal.checks.driven_rates import like_table, refuse_unlike_table
from gimbalcal.checks.forces import check_each_norm, check_magnitude
from gimbalcal.checks.rates import refuse_implausible_rates
from gimbalcal.checks.sidereal import check_attitude, check_latitude, check_sidereal, check_turn
from gimbalcal.checks.sightings import check_pointing
from gimbalcal.checks.turned_unit import check_turned
from gimbalcal.errors import InputError
from gimbalcal.number import Array, apply_matrix
from gimbalcal.recording import COLOURED, SENSORS, Recording, dwell_means, dwells
from gimbalcal.recording.completed import with_rests
from gimbalcal.units import is_raw

QUIETEST = 1e-15  # SI; less than this is zero to any instrument
UNSTILL = 0.2  # of gravity, half of the rows: a table that shakes so much is no rest
STILL = 1e-3  # rad
UNCHECKED = (
    "order and signs of the accelerometers were not checked: it takes gimbal angles and physical units, or gyroscopes "
    "that were logged from rest to rest"
)
WRONG_SIGN = " (f = a - g: one whose axis points down reads -9.8 m/s^2 at rest)"


def refuse_implausible(recording: Recording) -> tuple[str, ...]:
    """`InputError` with one sentence where units, axes, signs or the clock of `recording` cannot be right.

    Returns a sentence on each triad that nothing in the recording could check, and on what is odd and may be so.
    """
    _check_noise(recording)
    odd = (*check_temperature(recording), *check_clock(recording), *check_marked(recording))
    if recording.kind.sighting:
        return (*odd, *check_pointing(recording))
    if recording.kind.stabilised:
        check_turn(recording)
        check_attitude(recording)
    if recording.kind.rotating and recording.has("angular_rate") and recording.has("specific_force"):
        recording = with_rests(recording)
        check_turned(recording)
    if recording.kind.rotating and not recording.has("specific_force") and _on_a_table(recording):
        refuse_unlike_table(recording)
        return odd
    at_rest = recording.kind.at_rest and set(recording.axes("specific_force")) == set(AXES)
    told = _check_forces(recording) if at_rest else True
    rates = refuse_implausible_rates(recording)
    if rates and recording.kind.rotating and _on_a_table(recording) and like_table(recording):
        rates = ()
    told |= recording.kind.in_positions and recording.has("angular_rate") and not rates  # they fit gravity
    return (*odd, *rates) if told else (UNCHECKED, *odd, *rates)


def _check_forces(recording: Recording) -> bool:
    """Raise `InputError` for forces that cannot be right; else whether anything tells their order and signs."""
    rests = dwell_means(recording) if recording.kind.in_positions else _thinned(recording)
    force, known = rests.triad("specific_force"), bool(rests.platform.axes) and _angles_logged(rests)
    if recording.counted("specific_force"):  # the sign of a count is as open as its size
        return False
    _check_stillness(recording)
    if not known:
        check_each_norm(rests, force)
    check_magnitude(rests, force)
    if known:
        _check_degrees(rests, force)
        _check_each_axis(rests, force)
        _check_axes(rests, force)
    else:
        check_sidereal(rests, force)
    check_latitude(rests, force)
    return known or rests.kind.stabilised


def _thinned(recording: Recording) -> Recording:
    step = max(1, len(recording.time) // 500)
    return recording.select(slice(None, None, step))


def _angles_logged(recording: Recording) -> bool:
    logged = set(recording.axes("gimbal_angle"))
    return {"platform", "middle"} <= logged if recording.kind.stabilised else bool(logged)


def _on_a_table(recording: Recording) -> bool:
    """Whether the angles of a rig say what gyroscopes along three axes should feel."""
    return set(recording.axes("angular_rate")) == set(AXES) and _angles_logged(recording)


def _check_noise(recording: Recording) -> None:
    for sensor, sigma in recording.noise.items():
        if sensor in COLOURED:
            continue
        channels = [key for key in recording.channels if key[0] == SENSORS[sensor]]
        if 0 < sigma < QUIETEST and not any(is_raw(recording.units.get(key, "")) for key in channels):
            raise InputError(
                f"{recording.label}: a noise of {sigma:g} in SI units, as [noise] states for the {sensor}, is less "
                "than any instrument has; correct it, or leave it out to have it taken from the rows"
            )


def _check_stillness(recording: Recording) -> None:
    """Within a position the force keeps its direction and size, give or take what shakes it about its mean.

    Means of an eighth of a position are compared, so that running motors are no motion.
    """
    if not recording.kind.in_positions or recording.position is None:
        return
    force = recording.triad("specific_force")
    for dwell in dwells(recording):
        rows = _eighths(force[dwell.rows])
        moved = float(np.median(np.linalg.norm(rows - rows.mean(axis=0), axis=1)))
        if moved > UNSTILL * recording.site.gravity:
            t = recording.time[[dwell.start, dwell.stop - 1]]
            raise InputError(
                f"{recording.label}: within position {dwell.position}, from {t[0]:.10g} to {t[1]:.10g} s, the force "
                f"moves by {moved:.3g} m/s^2, so this is no rest; give each rest its own position "
                "number, and 0 to the rows between, or leave the position column out to have the rests found"
            )


def _eighths(rows: Array) -> Array:
    """Means (8, 3) of eighths of rows (n, 3), the last few left out; the rows themselves where they are fewer."""
    size = len(rows) // 8
    return np.asarray(rows[: 8 * size].reshape(8, size, -1).mean(axis=1)) if size else rows


def _check_degrees(rests: Recording, force: Array) -> None:
    """The force cannot turn by more than all gimbals together; if it does, the angles are in radians."""
    if not rests.kind.in_positions:
        return
    turned = sum(float(np.ptp(rests.channels["gimbal_angle", a])) for a in rests.axes("gimbal_angle"))
    direction = force / np.linalg.norm(force, axis=1, keepdims=True)
    seen = float(np.max(np.arccos(np.clip(direction @ direction.T, -1, 1))))
    units = {rests.units.get(("gimbal_angle", a), "rad") for a in rests.axes("gimbal_angle")}
    if turned < 0.5 * seen and seen > 2 * CLOSE:
        still = turned < 1e-3
        advice = (
            "so the readouts are not those of the gimbals that moved; log them, or leave the columns out and name the "
            "platform 'bench'"
            if still or "deg" not in units
            else 'so the angles look like radians; write unit = "rad" for the gimbal angles'
        )
        raise InputError(
            f"{rests.label}: all gimbal angles together turn by {np.degrees(turned):.3g} deg while the measured "
            f"force turns by {np.degrees(seen):.3g} deg, {advice}"
        )


def _check_each_axis(rests: Recording, force: Array) -> None:
    """One accelerometer alone that follows the prediction in another unit."""
    ideal = _predicted(rests, rests.angles()) * rests.site.gravity
    for i, axis in enumerate(AXES):
        size = float(ideal[:, i] @ ideal[:, i])
        slope = float(force[:, i] @ ideal[:, i]) / size if size > len(ideal) else 1.0
        off = np.linalg.norm(force[:, i] - slope * ideal[:, i]) / np.linalg.norm(force[:, i])
        if off < 0.1 and not 0.5 < abs(slope) < 2:
            unit = rests.units.get(("specific_force", axis), "m/s^2")
            raise InputError(
                f"{rests.label}: the accelerometer {axis} alone reads {abs(slope):.4g} times what the gimbal angles "
                f"predict, so its unit is not {unit!r}; correct it in [columns]"
            )


def _predicted(rests: Recording, angles: Array) -> Array:
    return -apply_matrix(rests.platform.attitude(angles), np.array([0.0, 0.0, 1.0]))


def _agreeing(force: Array, ideal: Array) -> int:
    """How many forces point where they should."""
    cosine = np.sum(force * ideal, axis=1) / np.linalg.norm(force, axis=1)
    return int(np.count_nonzero(cosine > np.cos(CLOSE)))


def _matters(rests: Recording, i: int) -> bool:
    """Whether a turn of gimbal `i` would be felt: one about the vertical is not."""
    angles = rests.angles()
    return bool(np.abs(_predicted(rests, angles + np.eye(angles.shape[1])[i]) - _predicted(rests, angles)).max() > 0.1)


def _check_axes(rests: Recording, force: Array) -> None:
    """Another reading of the columns that fits nearly every rest, while the stated one does not, is the right one."""
    n, stated = len(force), _agreeing(force, _predicted(rests, rests.angles()))
    if n < 3 or stated >= NEARLY_ALL * n:
        return
    kind = "positions" if rests.kind.in_positions else "rows"
    # the first of equals is the simplest
    best, words, write = max(_readings(rests, force), key=lambda reading: reading[0])
    if best >= NEARLY_ALL * n and best >= stated + 2:
        raise InputError(
            f"{rests.label}: only {stated} of {n} {kind} have the force that the gimbal angles predict, and {best} "
            f"if {words}; correct [columns]{write}"
        )
    if stated < 0.5 * n:
        raise InputError(
            f"{rests.label}: only {stated} of {n} {kind} have the force within {np.degrees(CLOSE):.0f} deg "
            f"of what the gimbal angles predict, whichever axes or signs are changed{_silent_gimbals(rests)}; check "
            "the platform, its zero angles and the gimbal columns, or leave these out and name the platform 'bench'"
        )


def _silent_gimbals(rests: Recording) -> str:
    """Readouts that are missing or never move, as an aside: most likely the fault is theirs."""
    logged = {a: rests.channels["gimbal_angle", a] for a in rests.axes("gimbal_angle")}
    absent = [a for i, a in enumerate(rests.platform.axis_names) if a not in logged and _matters(rests, i)]
    still = [a for a, angle in logged.items() if np.ptp(angle) < STILL]
    asides = [f"the {' and '.join(absent)} angle is in no column and taken as zero"] if absent else []
    asides += [f"the readout of {' and of '.join(still)} never moves"] if still else []
    return f" ({', and '.join(asides)})" if asides else ""


def _readings(rests: Recording, force: Array) -> Iterator[tuple[int, str, str]]:
    """Rests that agree, in words, and what to write, for other readings of the columns: simpler ones first."""
    ideal = _predicted(rests, rests.angles())
    for change in PERMUTATIONS:
        handed = "; as stated they make a left-handed triad" if change.handed < 0 else ""
        words, write = in_words(change, "accelerometer", WRONG_SIGN) + handed, remedy(change, "accelerometer")
        yield _agreeing(force @ change.matrix.T, ideal), words, f": {write}"
    angles, names = rests.angles(), rests.platform.axis_names
    logged = [i for i, name in enumerate(names) if ("gimbal_angle", name) in rests.channels]
    for i in logged:
        turned = angles.copy()
        turned[:, i] *= -1
        yield _agreeing(force, _predicted(rests, turned)), f"the {names[i]} angle has the opposite sign", ": sign = -1"
    for i in logged:
        turned = angles.copy()
        turned[:, i] = np.degrees(angles[:, i])
        yield _agreeing(force, _predicted(rests, turned)), f"the {names[i]} angle is in radians", ""
    for i in logged:
        for j in logged:
            if i < j:
                turned = angles.copy()
                turned[:, [i, j]] = angles[:, [j, i]]
                words = f"the {names[i]} and {names[j]} angles are interchanged"
                yield _agreeing(force, _predicted(rests, turned)), words, ""
