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

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Protocol

import numpy as np

from gimbalcal.calibration.readout import FORCE, RATE, SI, Readout, in_counts, in_si
from gimbalcal.effects import Effect, Stage, Stimulus
from gimbalcal.effects.effect import lacking
from gimbalcal.errors import InputError
from gimbalcal.forward import accelerometers, gyroscopes
from gimbalcal.inversion import invert
from gimbalcal.kinematics import stimulus_from_readings
from gimbalcal.number import Array
from gimbalcal.recording import Recording
from gimbalcal.recording.record import Key

ANGLE = "gimbal_angle"
AXES = ("x", "y", "z")
ROUNDS = 6  # each multiplies what is left by a product of two errors, below 1e-5


class Calibrated(Protocol):
    """What `correct` and `corrupt` need of a calibration: its effects, and how the unit is read."""

    @property
    def effects(self) -> tuple[Effect, ...]:
        """Physics to reading."""

    @property
    def readout(self) -> Readout:
        """Nominal scales of a unit that reads in counts."""


def correct(calibration: Calibrated, recording: Recording) -> Recording:
    """The recording with its readings turned into what was there: force [m/s^2], rate [rad/s], true gimbal angles.

    Direction: readings to physics. Raises InputError where the calibration was made from counts and the recording is
    in another unit, or the other way round.
    """
    _refuse_other_rig(calibration, recording)
    effects = _with_needs(calibration.effects, recording)
    _refuse_other_unit(calibration.readout, recording)
    made = _through_encoders(in_si(recording, calibration.readout), effects, 1.0)
    s = _felt(made)
    force, rate = (made.triad(q) if made.has(q) else None for q in (FORCE, RATE))
    for _ in range(ROUNDS):  # force and rate enter each other's errors (g-sensitivity, lever arms)
        before = s
        if rate is not None:
            s = s.at(rate=invert(partial(_rates, s, effects), rate)[0])
        if force is not None:
            s = s.at(force=invert(partial(_forces, s, effects), force)[0])
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
    read = _through_encoders(recording, effects, -1.0)
    s = _felt(recording if recording.platform.axes else read)
    channels = dict(read.channels)
    if recording.has(FORCE):
        f = recording.triad(FORCE)
        channels |= _columns(FORCE, accelerometers(f, s, effects))
        s = s.at(force=f)
    if recording.has(RATE):
        channels |= _columns(RATE, gyroscopes(recording.triad(RATE), s, effects))
    return in_counts(replace(read, channels=channels), calibration.readout)


def _columns(quantity: str, v: Array) -> dict[Key, Array]:
    return {(quantity, a): v[:, i] for i, a in enumerate(AXES)}


def _through_encoders(recording: Recording, effects: Sequence[Effect], sign: float) -> Recording:
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


def _refuse_other_unit(readout: Readout, recording: Recording) -> None:
    known = readout.accelerometers is not None
    if recording.has(FORCE) and recording.counted(FORCE) != known:
        have, want = (SI[FORCE], "counts") if known else ("counts", SI[FORCE])
        raise InputError(
            f"{recording.title!r} reads specific force in {have} and the calibration was made from readings in {want}: "
            "use a calibration of the same unit"
        )
