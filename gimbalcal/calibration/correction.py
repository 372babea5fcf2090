r"""A calibration applied: readings to physics (`correct`), and physics to readings (`corrupt`), exact inverses.

Effects say what is read for what is there, y = h(f). So `corrupt` evaluates the forward model and `correct` solves it,
by Newton's method with the exact derivative dh/df. The input-output laws of accelerometers and gyroscopes are inverted;
what the mount does (errors of encoders and axes, drift of the platform, tilt of the base) becomes a change of the
readouts, so that a corrected recording is what perfect sensors on a perfect mount would have logged (`mount`). What
happened once, in a recording that the calibration was made from, is taken off that recording alone.

Time, temperature, covariates and the last move come from the recording at hand. An effect of the last move takes the
force before and after it from the angles; without angles it takes the reading itself, which is then right to the
product of two errors.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, replace
from functools import partial
from typing import Any, Protocol

import numpy as np

from gimbalcal.calibration.mount import Mount, mount, with_readouts
from gimbalcal.calibration.readout import SI, Readout, in_counts, in_si, with_noise
from gimbalcal.effects import Effect, Stimulus
from gimbalcal.effects.card import happens_once
from gimbalcal.effects.effect import GIMBALS, lacking
from gimbalcal.errors import InputError
from gimbalcal.forward import accelerometers, gyroscopes
from gimbalcal.inversion import invert
from gimbalcal.kinematics import stimulus_from_readings
from gimbalcal.number import Array, apply_matrix, complex_step
from gimbalcal.recording import Recording
from gimbalcal.recording.record import ANGLE, FORCE, RATE, Key

AXES = ("x", "y", "z")
ROUNDS_BACK = 50  # of readouts from true angles: readout = true - error(readout) contracts tenfold or more
ROUNDING = 16 * float(np.finfo(float).eps)  # of the largest angle, below which a round moves readouts by chance
ASTRAY = 1e-6  # rad by which the last round may move them, near gimbal lock
REACHED = 1e-6  # of the largest reading, by which what was there may miss it
ROUNDS = 6  # each multiplies what is left by a product of two errors, below 1e-5


class Calibrated(Protocol):
    """What `correct` and `corrupt` need of a calibration: its effects, and how the unit is read."""

    @property
    def effects(self) -> tuple[Effect, ...]:
        """Physics to reading."""

    @property
    def readout(self) -> Readout:
        """Nominal scales of a unit that reads in counts."""

    @property
    def provenance(self) -> Mapping[str, Any]:
        """What it was made from."""


def correct(calibration: Calibrated, recording: Recording) -> Recording:
    """The recording with its readings turned into what was there: force [m/s^2], rate [rad/s], true gimbal angles.

    Direction: readings to physics. Raises InputError where the calibration was made from counts and the recording is
    in another unit, or the other way round.
    """
    _refuse_other_rig(calibration, recording)
    effects = _with_needs(_of(calibration, recording), recording)
    _refuse_other_unit(calibration.readout, recording)
    made = in_si(recording, calibration.readout)
    stood = mount(made, effects)
    made = made if stood is None else with_readouts(made, made.angles() + stood.readout)
    s = _felt(made)
    force, rate = (made.triad(q) if made.has(q) else None for q in (FORCE, RATE))
    for _ in range(ROUNDS):  # force and rate enter each other's errors (g-sensitivity, lever arms)
        before = s
        if rate is not None:
            w, rate_gain = _undone(partial(_rates, s, effects), rate, RATE)
            s = s.at(rate=w)
        if force is not None:
            f, force_gain = _undone(partial(_forces, s, effects), force, FORCE)
            s = s.at(force=f)
        if np.array_equal(s.force, before.force) and np.array_equal(s.rate, before.rate):
            break
    channels = dict(made.channels)
    if force is not None:
        channels |= _columns(FORCE, _turned(s.force, stood, 1.0))
        made = with_noise(made, FORCE, force_gain)
    if rate is not None:
        channels |= _columns(RATE, _turned(s.rate, stood, 1.0))
        made = with_noise(made, RATE, rate_gain)
    return replace(made, channels=_added(channels, stood, 1.0))


def _undone(h: Callable[[Array], Array], y: Array, quantity: str) -> tuple[Array, Array]:
    """What was there (n, 3), and its derivative (n, 3, 3) by the readings; one where the law is flat and they stay.

    Raises InputError for readings that the calibrated sensors cannot have, whatever is there.
    """
    f, H, flat = invert(h, y)
    with np.errstate(over="ignore", invalid="ignore"):
        missed = np.abs(h(f) - y).max(axis=1)
    never = np.flatnonzero(~(missed <= REACHED * np.max(np.abs(y), initial=0.0)) & ~flat)
    if len(never):
        raise InputError(
            f"by this calibration no {quantity} reads what row {never[0] + 1} does, nor {len(never) - 1} others: is it "
            "of this unit, and are its numbers in the units they say?"
        )
    return f, np.linalg.inv(np.where(flat[:, None, None], np.eye(3), H))


def _turned(v: Array, stood: Mount | None, sign: float) -> Array:
    """Vectors (n, 3) of the block, where no gimbal could turn it as a perfect mount stands; or back (sign -1)."""
    if stood is None or stood.turn is None:
        return v
    return apply_matrix(stood.turn if sign > 0 else np.swapaxes(stood.turn, -1, -2), v)


def _added(channels: dict[Key, Array], stood: Mount | None, sign: float) -> dict[Key, Array]:
    """Channels with what the mount adds to them taken off, or put back (sign -1)."""
    added = (stood and stood.added) or {}
    return {key: values + sign * added[key] if key in added else values for key, values in channels.items()}


def _refuse_other_rig(calibration: Calibrated, recording: Recording) -> None:
    pointed = recording.kind.sighting and recording.has(ANGLE)
    if not (recording.has(FORCE) or recording.has(RATE) or pointed):
        raise InputError(
            f"{recording.title!r} has neither specific_force nor angular_rate, so there is nothing to correct; give a "
            "recording of the calibrated sensors"
        )
    if recording.has(ANGLE):
        refuse_other_gimbals(calibration.effects, recording)


def refuse_other_gimbals(effects: Sequence[Effect], recording: Recording) -> None:
    """Raise InputError for effects of gimbals that are for another number of them than the platform has."""
    axes = recording.platform.axis_names
    for e in effects:
        sizes = {np.size(getattr(e, f.name)) for f in fields(e) if f.metadata.get("axes") == GIMBALS}
        if sizes - {len(axes)}:
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
    effects = _with_needs(_of(calibration, recording), recording)
    read, stood = _stood_off(recording, effects)
    s = _felt(recording)
    channels = _added(dict(read.channels), stood, -1.0)
    if recording.has(FORCE):
        f = _turned(np.stack([channels[FORCE, a] for a in AXES], axis=-1), stood, -1.0)
        channels |= _columns(FORCE, _read(partial(_forces, s, effects), f, FORCE))
        read = with_noise(read, FORCE, complex_step(partial(_forces, s, effects), f))
        s = s.at(force=f)
    if recording.has(RATE):
        w = _turned(recording.triad(RATE), stood, -1.0)
        channels |= _columns(RATE, _read(partial(_rates, s, effects), w, RATE))
        read = with_noise(read, RATE, complex_step(partial(_rates, s, effects), w))
    return in_counts(replace(read, channels=channels), calibration.readout)


def _read(h: Callable[[Array], Array], f: Array, quantity: str) -> Array:
    """What is read of f (n, 3). Raises InputError where a law has no reading for it."""
    with np.errstate(over="ignore", invalid="ignore"):
        y = h(f)
    never = np.flatnonzero(~np.isfinite(y).all(axis=1))
    if len(never):
        raise InputError(
            f"by this calibration no {quantity} is read of what row {never[0] + 1} holds, nor of {len(never) - 1} "
            "others: is it of this unit, and are its numbers in the units they say?"
        )
    return y


def _stood_off(recording: Recording, effects: Sequence[Effect]) -> tuple[Recording, Mount | None]:
    """The recording with the readouts that `mount` brings to those it has, and what the mount does there."""
    true = angle = recording.angles()
    stood = mount(recording, effects)
    if stood is None:
        return recording, None
    for _ in range(ROUNDS_BACK):
        before, angle = angle, true - stood.readout
        stood = mount(with_readouts(recording, angle), effects)
        assert stood is not None  # the same effects on the same mount
        moved = np.abs(angle - before).max(axis=1, initial=0.0)
        if np.all(moved <= ROUNDING * max(1.0, float(np.abs(angle).max(initial=0.0)))):
            break
    astray = np.flatnonzero(~(moved <= ASTRAY))
    if len(astray):
        large = np.rad2deg(np.abs(stood.readout[astray]).max())
        raise InputError(
            f"by this calibration no readouts of the gimbals belong to row {astray[0] + 1}, nor to {len(astray) - 1} "
            f"others: what the mount does there, {large:.2g} deg, changes as fast as they do; is it of this unit?"
        )
    return with_readouts(recording, angle), stood


def _columns(quantity: str, v: Array) -> dict[Key, Array]:
    return {(quantity, a): v[:, i] for i, a in enumerate(AXES)}


def _of(calibration: Calibrated, recording: Recording) -> tuple[Effect, ...]:
    """The effects that a recording has in it: what happened once, only where the calibration was made from it."""
    made_from = {file["sha256"] for file in calibration.provenance.get("recordings", ()) if "sha256" in file}
    mine = {file.sha256 for file in recording.source}
    elsewhere = bool(made_from and mine) and not made_from & mine
    return tuple(e for e in calibration.effects if not (elsewhere and happens_once(type(e))))


def _with_needs(effects: Sequence[Effect], recording: Recording) -> tuple[Effect, ...]:
    """The effects, if the recording has what they need. Raises InputError, naming effect and channel, if not."""
    for e in effects:
        missing = lacking(type(e), recording.has)
        if missing:
            raise InputError(
                f"the calibration corrects {e.id}, which needs the channel {missing}, and {recording.title!r} has "
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
