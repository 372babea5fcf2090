r"""What a mount does to a recording, taken off: the readings as a perfect mount on a level, still base would have them.

* Where the readouts say where the platform points, they become those at which a perfect chain stands as this one does,

  .. math:: C_b^p(\theta') = R(\varphi) \, C_b^p(\theta + \delta\theta, \text{tilts}) \, C_n^b ;

  what no gimbal can turn, as in gimbal lock, is turned in the readings of the block instead.
* In a static run the gyroscopes hold the platform, so the readings change by what the model predicts without these
  effects less what it predicts with them; the zero of a gimbal that nobody read stays in the others' readouts.
* Of a pointing run the readouts become those at which a perfect mount sees the star where this one does.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gimbalcal.effects import Effect, Stage, Stimulus
from gimbalcal.effects.effect import GYROSCOPE_STAGES, SENSOR_STAGES
from gimbalcal.forward import AXES, attitude, nearest_angles, predict
from gimbalcal.kinematics import stimulus_from_angles, stimulus_from_readings, with_phase_of_force
from gimbalcal.number import Array, complex_step
from gimbalcal.recording import Recording
from gimbalcal.recording.record import ANGLE, FORCE, Key

SENSORS = GYROSCOPE_STAGES | SENSOR_STAGES
ROUNDS = 4  # of a static run, whose phase is off by what is taken off: each leaves a product of two errors
STEPS = 6  # of Newton's method from a milliradian: the second leaves 1e-12


@dataclass(frozen=True)
class Mount:
    """What to add to the readouts (n, k) [rad], how to turn force and rate (n, 3, 3), and what to add to channels."""

    readout: Array
    turn: Array | None = None
    added: Mapping[Key, Array] | None = None


def mount(recording: Recording, effects: Sequence[Effect]) -> Mount | None:
    """What takes the mount's effects off a recording with these readouts; None where there is nothing to take off."""
    mine = [e for e in effects if e.stage not in SENSORS]
    if not mine or not recording.platform.axes:
        return None
    if recording.kind.stabilised:
        return _held(recording, effects)
    if not recording.has(ANGLE):
        return None
    if recording.kind.sighting:
        return _sighted(recording, mine)
    s, told = stimulus_from_readings(recording), recording.angles()
    if all(e.stage is Stage.ENCODER for e in mine):
        return Mount(np.asarray(sum(e.contribution(s) for e in mine)))
    platform = recording.platform
    free = [platform.axis_names.index(a) for a in recording.axes(ANGLE)]
    C_np = attitude(platform, s, mine)
    angle = nearest_angles(platform, C_np, told, free)
    turn = platform.attitude(angle) @ np.swapaxes(C_np, -1, -2)
    heavier = [e for e in mine if e.stage is Stage.GRAVITY]
    perfect, felt = (predict(platform, s, chosen, recording.kind) for chosen in ((), heavier))
    added = _difference(recording, perfect, felt)
    return Mount(angle - told, turn, {k: v for k, v in added.items() if k[0] == FORCE and heavier})


def _held(recording: Recording, effects: Sequence[Effect]) -> Mount:
    """A static run, predicted at the phase that the corrected readouts tell.

    The force answers the mount alone, as its sensors' own errors are taken off before.
    """
    platform, names = recording.platform, recording.platform.axis_names
    read = np.isin(names, recording.axes(ANGLE))
    unread = _Unread(tuple(e for e in effects if e.stage is Stage.ENCODER), ~read)
    standing = [e for e in effects if e.stage not in SENSORS]
    phased = recording if (ANGLE, "platform") in recording.channels else with_phase_of_force(recording)
    off = np.zeros((len(recording.time), len(names)))
    for _ in range(ROUNDS):
        s = stimulus_from_readings(with_readouts(phased, phased.angles() + off))
        perfect, as_read, stood = (
            predict(platform, s, chosen, recording.kind) for chosen in ([unread], effects, standing)
        )
        added = _difference(recording, perfect, as_read | {FORCE: stood[FORCE]})
        off = np.stack([added.pop((ANGLE, a), np.zeros(len(recording.time))) for a in names], axis=-1)
    return Mount(off, None, added)


@dataclass(frozen=True)
class _Unread(Effect):
    """Errors of encoders, of the gimbals that nobody read alone (k,): nothing was logged that could be corrected."""

    stage = Stage.ENCODER
    effects: tuple[Effect, ...]
    mine: Array

    def contribution(self, s: Stimulus) -> Array:
        """True angle minus readout [rad], (n, k)."""
        return np.asarray(sum((e.contribution(s) for e in self.effects), start=0 * s.readout) * self.mine)


def _difference(recording: Recording, to: Mapping[str, Array], of: Mapping[str, Array]) -> dict[Key, Array]:
    """What to add to each logged channel so that the second becomes the first; angles within half a turn."""
    out = {}
    for quantity, axis in recording.channels:
        if quantity in to and quantity != "angular_rate":
            i = AXES.get(quantity, recording.platform.axis_names).index(axis)
            d = to[quantity][:, i] - of[quantity][:, i]
            out[quantity, axis] = d if quantity == FORCE else (d + np.pi) % (2 * np.pi) - np.pi
    return out


def _sighted(recording: Recording, effects: Sequence[Effect]) -> Mount:
    """A pointing run: its readouts, of the axes that are read, and the direction across and along the innermost one."""
    platform, told = recording.platform, recording.angles()
    read = np.isin(platform.axis_names, recording.axes(ANGLE))
    s = stimulus_from_angles(recording)
    seen = predict(platform, s, effects, "pointing")["pointing"]

    def missed(angle: Array) -> Array:
        return np.asarray(predict(platform, s.at(readout=angle, angle=angle), (), "pointing")["pointing"] - seen)

    angle = np.array(told)
    for _ in range(STEPS):
        J = complex_step(missed, angle)[..., read]
        # the smallest turns that do it: at the zenith an alt-azimuth mount has one axis for two directions
        angle[:, read] -= np.einsum("nki,ni->nk", np.linalg.pinv(J, rcond=1e-6), missed(angle))
    return Mount(angle - told)


def with_readouts(recording: Recording, angle: Array) -> Recording:
    """The recording with these gimbal angles (n, k) where it has readouts."""
    names = recording.platform.axis_names
    logged = {(ANGLE, n): angle[:, names.index(n)] for n in recording.axes(ANGLE)}
    return replace(recording, channels=dict(recording.channels) | logged)
