r"""Apply a calibration: readings to physics (`correct`) and physics to readings (`corrupt`), exact inverses.

Effects define the reading as a function of the physics, y = h(f). So `corrupt` evaluates the forward model and
`correct` solves it, by Newton's method with the exact derivative dh/df. The input-output laws of accelerometers and
gyroscopes are inverted; errors of the mount (encoders and axes, drift of the platform, tilt of the base) become a
change of the readouts, so that a corrected recording is what perfect sensors on a perfect mount would have logged
(`mount`). An event that happened once, in a recording that the calibration was estimated from, is removed from that
recording alone.

Time, temperature, covariates and the last move are those of the recording. An effect of the last move takes the force
before and after it from the angles; without angles from the reading itself, with an error of second order.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from gimbalcal.calibration.mount_correction import Mount, mount, with_readouts
from gimbalcal.calibration.readout import Readout, in_counts, in_si, with_noise
from gimbalcal.effects import Effect, Stimulus
from gimbalcal.effects.effect import GIMBALS, TRIAD, happens_once, lacking_quantity
from gimbalcal.errors import InputError
from gimbalcal.forward import accelerometers, gyroscopes
from gimbalcal.inversion import invert_response, response_with_derivative
from gimbalcal.kinematics import stimulus_from_readings
from gimbalcal.number import Array, apply_matrix
from gimbalcal.quantities import QUANTITIES
from gimbalcal.recording import Recording
from gimbalcal.recording.record import ANGLE, FORCE, RATE, Key

if TYPE_CHECKING:
    from gimbalcal.calibration.calibration import Calibration

MAX_READOUT_STEPS = 50  # of readout = true - error(readout), which contracts tenfold or more
ROUNDING = 16 * float(np.finfo(float).eps)  # of the largest angle, below which a step is rounding
MAX_LAST_STEP = 1e-6  # rad, of the readouts near gimbal lock
MAX_MISFIT = 1e-6  # of the largest reading, of the reading that the solution predicts
MAX_STEPS = 6  # each multiplies the error by a product of two errors, below 1e-5


def correct(calibration: Calibration, recording: Recording) -> Recording:
    """Return the recording with force [m/s^2], rate [rad/s] and true gimbal angles instead of readings.

    Direction: readings to physics. Raises InputError where the calibration was estimated from counts and the recording
    is in another unit, or vice versa.
    """
    _refuse_other_rig(calibration, recording)
    effects = _with_needs(_effects_on_recording(calibration, recording), recording)
    _refuse_other_unit(calibration.readout, recording)
    out = in_si(recording, calibration.readout)
    change = mount(out, effects)
    out = out if change is None else with_readouts(out, out.angles() + change.readout)
    s = _initial_stimulus(out)
    force, rate = (out.triad(q) if out.has(q) else None for q in (FORCE, RATE))
    for _ in range(MAX_STEPS):  # force and rate enter each other's errors (g-sensitivity, lever arms)
        before = s
        if rate is not None:
            w, rate_gain = _physics_of_readings(partial(gyroscopes, s=s, effects=effects), rate, RATE)
            s = s.at(rate=w)
        if force is not None:
            f, force_gain = _physics_of_readings(partial(accelerometers, s=s, effects=effects), force, FORCE)
            s = s.at(force=f)
        if np.array_equal(s.force, before.force) and np.array_equal(s.rate, before.rate):
            break
    channels = dict(out.channels)
    if force is not None:
        channels |= _columns(FORCE, _turn_vectors(s.force, change, 1.0))
        out = with_noise(out, FORCE, force_gain)
    if rate is not None:
        channels |= _columns(RATE, _turn_vectors(s.rate, change, 1.0))
        out = with_noise(out, RATE, rate_gain)
    return replace(out, channels=_with_channel_errors(channels, change, 1.0))


def extrapolations(calibration: Calibration, recording: Recording) -> tuple[str, ...]:
    """Return a remark for each law that a corrected recording leads out of where it was determined."""
    laws = [e for e in _effects_on_recording(calibration, recording) if e.domain]
    if not laws:
        return ()
    s = _initial_stimulus(recording)
    return tuple(
        f"{recording.title!r} extrapolates {e.id}: {words}; record there, or do not use it beyond"
        for e in laws for d in e.domain if (words := d.exceeded(s))
    )  # fmt: skip


def _physics_of_readings(h: Callable[[Array], Array], y: Array, quantity: str) -> tuple[Array, Array]:
    """Return the physics (n, 3) and its derivative (n, 3, 3) by the readings; the identity where the law is flat.

    Raises InputError for readings outside the range of the calibrated sensors.
    """
    f, H, flat = invert_response(h, y)
    with np.errstate(over="ignore", invalid="ignore"):
        misfit = np.abs(h(f) - y).max(axis=1)
    never = np.flatnonzero(~(misfit <= MAX_MISFIT * np.max(np.abs(y), initial=0.0)) & ~flat)
    if len(never):
        raise InputError(
            f"by this calibration no {quantity} gives the reading of row {never[0] + 1}, nor of {len(never) - 1} "
            "others: does it belong to this unit, and are the stated units right?"
        )
    return f, np.linalg.inv(np.where(flat[:, None, None], np.eye(3), H))


def _turn_vectors(v: Array, change: Mount | None, sign: float) -> Array:
    """Return vectors (n, 3) of the block in the attitude of a perfect mount; the inverse for sign -1."""
    if change is None or change.turn is None:
        return v
    return apply_matrix(change.turn if sign > 0 else np.swapaxes(change.turn, -1, -2), v)


def _with_channel_errors(channels: dict[Key, Array], change: Mount | None, sign: float) -> dict[Key, Array]:
    """Return channels without the errors that the mount adds to them, or with them for sign -1."""
    added = (change and change.added) or {}
    return {key: values + sign * added[key] if key in added else values for key, values in channels.items()}


def _refuse_other_rig(calibration: Calibration, recording: Recording) -> None:
    pointed = recording.kind.sighting and recording.has(ANGLE)
    if not (recording.has(FORCE) or recording.has(RATE) or pointed):
        raise InputError(
            f"{recording.title!r} has neither specific_force nor angular_rate to correct; give a "
            "recording of the calibrated sensors"
        )
    if recording.has(ANGLE):
        refuse_other_gimbals(calibration.effects, recording)


def refuse_other_gimbals(effects: Sequence[Effect], recording: Recording) -> None:
    """Raise InputError for effects of gimbals whose number differs from that of the platform."""
    axes = recording.platform.axis_names
    for e in effects:
        sizes = {np.size(getattr(e, f.name)) for f in fields(e) if f.metadata.get("axes") == GIMBALS}
        if sizes - {len(axes)}:
            raise InputError(
                f"{recording.title!r} has the gimbals {', '.join(axes) or 'none'} and the {e.id} of the calibration is "
                f"for {max(sizes)}; give a calibration of the same platform"
            )


def _initial_stimulus(recording: Recording) -> Stimulus:
    """Return the stimulus of the readings as they are; gyroscopes alone, without a platform, have zero force."""
    if recording.platform.axes or recording.has(FORCE):
        return stimulus_from_readings(recording)
    nothing = {(FORCE, a): np.zeros(len(recording.time)) for a in TRIAD}
    return stimulus_from_readings(recording.with_channels(nothing))


def corrupt(calibration: Calibration, recording: Recording) -> Recording:
    """Return what the calibrated unit would have read, inverse of `correct`. Direction: physics to readings."""
    _refuse_other_rig(calibration, recording)
    effects = _with_needs(_effects_on_recording(calibration, recording), recording)
    read, change = _with_mount(recording, effects)
    s = _initial_stimulus(recording)
    channels = _with_channel_errors(dict(read.channels), change, -1.0)
    if recording.has(FORCE):
        f = _turn_vectors(replace(read, channels=channels).triad(FORCE), change, -1.0)
        y, H = _readings_of(partial(accelerometers, s=s, effects=effects), f, FORCE)
        channels |= _columns(FORCE, y)
        read = with_noise(read, FORCE, H)
        s = s.at(force=f)
    if recording.has(RATE):
        w = _turn_vectors(recording.triad(RATE), change, -1.0)
        y, H = _readings_of(partial(gyroscopes, s=s, effects=effects), w, RATE)
        channels |= _columns(RATE, y)
        read = with_noise(read, RATE, H)
    return in_counts(replace(read, channels=channels), calibration.readout)


def _readings_of(h: Callable[[Array], Array], f: Array, quantity: str) -> tuple[Array, Array]:
    """Return the readings of f (n, 3), and dh/df (n, 3, 3). Raises InputError where a law has no reading for it."""
    with np.errstate(over="ignore", invalid="ignore"):
        y, H = response_with_derivative(h, f)
    never = np.flatnonzero(~np.isfinite(y).all(axis=1))
    if len(never):
        raise InputError(
            f"by this calibration the {quantity} of row {never[0] + 1} has no reading, nor have {len(never) - 1} "
            "others: does it belong to this unit, and are the stated units right?"
        )
    return y, H


def _with_mount(recording: Recording, effects: Sequence[Effect]) -> tuple[Recording, Mount | None]:
    """Return the recording with the readouts that `mount` changes into its angles, and that change."""
    true = angle = recording.angles()
    change = mount(recording, effects)
    if change is None:
        return recording, None
    for _ in range(MAX_READOUT_STEPS):
        before, angle = angle, true - change.readout
        change = mount(with_readouts(recording, angle), effects)
        assert change is not None  # the same effects on the same mount
        moved = np.abs(angle - before).max(axis=1, initial=0.0)
        if np.all(moved <= ROUNDING * max(1.0, float(np.abs(angle).max(initial=0.0)))):
            break
    divergent = np.flatnonzero(~(moved <= MAX_LAST_STEP))
    if len(divergent):
        large = np.rad2deg(np.abs(change.readout[divergent]).max())
        raise InputError(
            f"by this calibration no readouts of the gimbals belong to row {divergent[0] + 1}, nor to "
            f"{len(divergent) - 1} others: the error of the mount there, {large:.2g} deg, changes as fast as the "
            "readouts; does it belong to this unit?"
        )
    return with_readouts(recording, angle), change


def _columns(quantity: str, v: Array) -> dict[Key, Array]:
    return {(quantity, a): v[:, i] for i, a in enumerate(TRIAD)}


def _effects_on_recording(calibration: Calibration, recording: Recording) -> tuple[Effect, ...]:
    """Return the effects of a recording: single events only where the calibration was estimated from it."""
    estimated_from = {file.sha256 for file in calibration.provenance.recordings}
    own = {file.sha256 for file in recording.source}
    elsewhere = bool(estimated_from and own) and not estimated_from & own
    return tuple(e for e in calibration.effects if not (elsewhere and happens_once(type(e))))


def _with_needs(effects: Sequence[Effect], recording: Recording) -> tuple[Effect, ...]:
    """Return the effects. Raises InputError, which names effect and channel, if the recording lacks a channel."""
    for e in effects:
        missing = lacking_quantity(type(e), recording.has)
        if missing:
            raise InputError(
                f"the calibration corrects {e.id}, which needs the channel {missing}, and {recording.title!r} has "
                "none: log it, or calibrate without this effect"
            )
    return tuple(effects)


def _refuse_other_unit(readout: Readout, recording: Recording) -> None:
    known = readout.accelerometers is not None
    if recording.has(FORCE) and recording.counted(FORCE) != known:
        have, want = (QUANTITIES[FORCE].si, "counts") if known else ("counts", QUANTITIES[FORCE].si)
        raise InputError(
            f"{recording.title!r} has specific force in {have} and the calibration was estimated from readings in "
            f"{want}: use a calibration of the same unit"
        )
