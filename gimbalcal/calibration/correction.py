r"""A calibration applied: readings to physics (`correct`), and physics to readings (`corrupt`), exact inverses.

Effects say what is read for what is there, y = h(f). So `corrupt` evaluates the forward model and `correct` solves it,
by Newton's method with the exact derivative dh/df. What belongs to the sensors is corrected: input-output law of
accelerometers and gyroscopes, and the zeros and errors of the angle encoders. What belongs to the world (tilt of the
base, drift of the platform, gravity) is not an error of a reading and stays.

Time, temperature, covariates and the last move come from the recording at hand. An effect of the last move takes the
force before and after it from the angles; without angles it takes the reading itself, which is then right to the
product of two errors.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, Protocol

import numpy as np

from gimbalcal.effects import Effect, Stage, Stimulus
from gimbalcal.effects.effect import lacking
from gimbalcal.errors import InputError
from gimbalcal.forward import accelerometers, gyroscopes
from gimbalcal.kinematics import stimulus_from_readings
from gimbalcal.number import STEP, Array
from gimbalcal.recording import Recording
from gimbalcal.recording.record import Key
from gimbalcal.units import is_raw

FORCE, RATE, ANGLE = "specific_force", "angular_rate", "gimbal_angle"
AXES = ("x", "y", "z")
FLAT = 1e-6  # of a determinant that is one for a perfect sensor
ROUNDS = 6  # each multiplies what is left by a product of two errors, below 1e-5


class Calibrated(Protocol):
    """What is asked of a calibration here: its effects, and in its provenance the nominal scale of a unit in counts."""

    @property
    def effects(self) -> tuple[Effect, ...]:
        """Physics to reading."""

    @property
    def provenance(self) -> Mapping[str, Any]:
        """`options` holds `nominal` and `gyro_nominal` where the readings were counts."""


def correct(calibration: Calibrated, recording: Recording) -> Recording:
    """The recording with its readings turned into what was there: force [m/s^2], rate [rad/s], true gimbal angles.

    Direction: readings to physics. Raises InputError where the calibration was made from counts and the recording is
    in another unit, or the other way round.
    """
    _refuse_other_rig(calibration, recording)
    effects = _with_needs(calibration.effects, recording)
    made = _from_counts(calibration, recording)
    made = _turned(made, effects, 1.0)
    s = _felt(made)
    force, rate = (made.triad(q) if made.has(q) else None for q in (FORCE, RATE))
    for _ in range(ROUNDS):  # force and rate enter each other's errors (g-sensitivity, lever arms)
        before = s
        if rate is not None:
            s = s.at(rate=_solve(partial(_rates, s, effects), rate))
        if force is not None:
            s = s.at(force=_solve(partial(_forces, s, effects), force))
        if np.array_equal(s.force, before.force) and np.array_equal(s.rate, before.rate):
            break
    channels = dict(made.channels)
    channels |= _columns(FORCE, s.force) if force is not None else {}
    channels |= _columns(RATE, s.rate) if rate is not None else {}
    return replace(made, channels=channels)


def _refuse_other_rig(calibration: Calibrated, recording: Recording) -> None:
    if not (recording.has(FORCE) or recording.has(RATE)):
        raise InputError(
            f"{recording.title!r} has neither specific_force nor angular_rate, so there is nothing to correct; give a "
            "recording of the calibrated sensors"
        )
    axes = recording.platform.axis_names
    for e in calibration.effects:
        sizes = {np.size(v) for v in vars(e).values() if np.ndim(v) == 1}
        if e.stage is Stage.ENCODER and recording.has(ANGLE) and sizes - {len(axes)}:
            raise InputError(
                f"{recording.title!r} has the gimbals {', '.join(axes) or 'none'} and the {e.id} of the calibration is "
                f"for {max(sizes)}; give a calibration of the same platform"
            )


def _felt(recording: Recording) -> Stimulus:
    """The stimulus to start from, readings for the truth; gyroscopes alone, on no platform, feel no force."""
    if recording.platform.axes or recording.has(FORCE):
        return stimulus_from_readings(recording)
    nothing = {(FORCE, a): np.zeros(len(recording.time)) for a in AXES}
    return stimulus_from_readings(replace(recording, channels=dict(recording.channels) | nothing))


def _forces(s: Stimulus, effects: Sequence[Effect], f: Array) -> Array:
    return accelerometers(f, s, effects)


def _rates(s: Stimulus, effects: Sequence[Effect], w: Array) -> Array:
    return gyroscopes(w, s, effects)


def corrupt(calibration: Calibrated, recording: Recording) -> Recording:
    """The recording as the calibrated unit would have read it, inverse of `correct`. Direction: physics to readings."""
    _refuse_other_rig(calibration, recording)
    effects = _with_needs(calibration.effects, recording)
    read = _turned(recording, effects, -1.0)
    s = _felt(recording if recording.platform.axes else read)
    channels = dict(read.channels)
    if recording.has(FORCE):
        f = recording.triad(FORCE)
        channels |= _columns(FORCE, accelerometers(f, s, effects))
        s = s.at(force=f)
    if recording.has(RATE):
        channels |= _columns(RATE, gyroscopes(recording.triad(RATE), s, effects))
    return _to_counts(calibration, replace(read, channels=channels))


def _columns(quantity: str, v: Array) -> dict[Key, Array]:
    return {(quantity, a): v[:, i] for i, a in enumerate(AXES)}


def _solve(h: Callable[[Array], Array], y: Array, steps: int = 20) -> Array:
    """Solve h(f) = y for f (n, 3) by Newton from f = y; h couples only the axes of one row.

    Where the law is flat (a dead zone) nothing can be told back: there f stays as it is.
    """
    f = np.array(y, dtype=float)
    for _ in range(steps):
        J = np.stack([h(f + 1j * STEP * unit).imag / STEP for unit in np.eye(3)], axis=-1)
        flat = np.abs(np.linalg.det(J)) < FLAT
        J[flat] = np.eye(3)
        step = np.where(flat[:, None], 0.0, np.linalg.solve(J, (y - h(f))[..., None])[..., 0])
        f = f + step
        if np.all(np.abs(step) <= 4e-16 * np.max(np.abs(y), initial=1e-300)):  # two units in the last place
            break
    return f


def _turned(recording: Recording, effects: Sequence[Effect], sign: float) -> Recording:
    """Readouts to true gimbal angles (sign 1) or back (sign -1)."""
    encoder = [e for e in effects if e.stage is Stage.ENCODER]
    if not encoder or not recording.has(ANGLE):
        return recording
    told = recording.angles()
    angle = told + _off(encoder, recording, told) if sign > 0 else told
    for _ in range(50 if sign < 0 else 0):  # readout = true - error(readout): contracts tenfold or more
        new = told - _off(encoder, recording, angle)
        done, angle = np.array_equal(new, angle), new
        if done:
            break
    return _with_angles(recording, angle)


def _with_angles(recording: Recording, angle: Array) -> Recording:
    names = recording.platform.axis_names
    logged = {(ANGLE, n): angle[:, names.index(n)] for n in recording.axes(ANGLE)}
    return replace(recording, channels=dict(recording.channels) | logged)


def _off(encoder: Sequence[Effect], recording: Recording, readout: Array) -> Array:
    """True angle minus readout (n, k) [rad] at these readouts."""
    s = stimulus_from_readings(_with_angles(recording, readout))
    return np.asarray(sum(e.contribution(s) for e in encoder))


def _with_needs(effects: Sequence[Effect], recording: Recording) -> tuple[Effect, ...]:
    """The effects, if the recording has what they need. Raises InputError, naming effect and channel, if not."""
    for e in effects:
        missing = lacking(type(e), recording.has)
        if missing:
            raise InputError(
                f"the calibration corrects {e.id}, which needs a {missing} channel, and {recording.title!r} has "
                "none: log it, or calibrate without this effect"
            )
    return tuple(effects)


def nominal(calibration: Calibrated) -> Mapping[str, Any]:
    """Scale [m/s^2 per count] and offset [count] of a calibration made from counts; empty for one in m/s^2."""
    found: Mapping[str, Any] = calibration.provenance.get("options", {}).get("nominal", {})
    return found


def gyro_scale(calibration: Calibrated) -> float | None:
    """Nominal rad/s per count of a gyroscope calibration made from counts; None for one in rad/s."""
    found = calibration.provenance.get("options", {}).get("gyro_nominal", {}).get("scale")
    return None if found is None else float(found)


def _from_counts(calibration: Calibrated, recording: Recording) -> Recording:
    known = nominal(calibration)
    if _counted(recording, FORCE) != bool(known) and recording.has(FORCE):
        have, want = ("counts", "m/s^2") if not known else ("m/s^2", "counts")
        raise InputError(
            f"{recording.title!r} reads specific force in {have} and the calibration was made from readings in {want}: "
            "use a calibration of the same unit"
        )
    channels, units = dict(recording.channels), dict(recording.units)
    if known and recording.has(FORCE):
        y = np.asarray(known["scale"]) * (recording.triad(FORCE) - np.asarray(known["offset"]))
        channels |= _columns(FORCE, y)
        units |= {(FORCE, a): "m/s^2" for a in AXES}
    scale = gyro_scale(calibration)
    if scale is not None and _counted(recording, RATE):
        channels |= _columns(RATE, scale * recording.triad(RATE))
        units |= {(RATE, a): "rad/s" for a in AXES}
    return replace(recording, channels=channels, units=units)


def _to_counts(calibration: Calibrated, recording: Recording) -> Recording:
    known, scale = nominal(calibration), gyro_scale(calibration)
    channels, units = dict(recording.channels), dict(recording.units)
    if known and recording.has(FORCE):
        N = recording.triad(FORCE) / np.asarray(known["scale"]) + np.asarray(known["offset"])
        channels |= _columns(FORCE, N)
        units |= {(FORCE, a): "count" for a in AXES}
    if scale is not None and recording.has(RATE):
        channels |= _columns(RATE, recording.triad(RATE) / scale)
        units |= {(RATE, a): "count" for a in AXES}
    return replace(recording, channels=channels, units=units)


def _counted(recording: Recording, quantity: str) -> bool:
    """Whether a quantity was logged in counts or pulses."""
    return any(is_raw(u) for (q, _), u in recording.units.items() if q == quantity)
