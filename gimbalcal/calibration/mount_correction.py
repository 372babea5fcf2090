r"""Remove the errors of a mount: the readings of a perfect mount on a level base at rest.

* Where the readouts give the attitude of the platform, they become those of a perfect chain in the same attitude,

  .. math:: C_b^p(\theta') = R(\varphi) \, C_b^p(\theta + \delta\theta, \text{tilts}) \, C_n^b ;

  a rotation that no gimbal can make, as in gimbal lock, is applied to the readings of the block instead.
* In a static run the gyroscopes hold the platform, so the readings change by the prediction without these effects
  minus the prediction with them; the zero of a gimbal without a readout remains in the readouts of the others.
* In a pointing run the readouts become those at which a perfect mount points to the same star.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from gimbalcal.effects import Effect, Stage, Stimulus
from gimbalcal.effects.effect import GYROSCOPE_STAGES, SENSOR_STAGES
from gimbalcal.forward import AXES, attitude, linearise, nearest_angles, predict
from gimbalcal.kinematics import stimulus_from_angles, stimulus_from_readings, with_phase_of_force
from gimbalcal.number import Array
from gimbalcal.recording import Recording
from gimbalcal.recording.record import ANGLE, FORCE, Key
from gimbalcal.rotation import within_half_turn

SENSORS = GYROSCOPE_STAGES | SENSOR_STAGES
MAX_STEPS = 4  # of a static run, whose phase depends on the correction: each leaves a product of two errors
NEWTON_STEPS = 6  # from a milliradian: the second leaves 1e-12


@dataclass(frozen=True)
class Mount:
    """Corrections of readouts (n, k) [rad] and channels, and the rotation (n, 3, 3) of force and rate."""

    readout: Array
    turn: Array | None = None
    added: Mapping[Key, Array] | None = None


def mount(recording: Recording, effects: Sequence[Effect]) -> Mount | None:
    """Return the correction of the mount's effects at these readouts; None where there are none."""
    mine = [e for e in effects if e.stage not in SENSORS]
    if not mine or not recording.platform.axes:
        return None
    if recording.kind.stabilised:
        return _static_run(recording, effects)
    if not recording.has(ANGLE):
        return None
    if recording.kind.sighting:
        return _pointing_correction(recording, mine)
    s, readout = stimulus_from_readings(recording), recording.angles()
    if all(e.stage is Stage.ENCODER for e in mine):
        return Mount(np.asarray(sum(e.contribution(s) for e in mine)))
    platform = recording.platform
    free = [platform.axis_names.index(a) for a in recording.axes(ANGLE)]
    C_np = attitude(platform, s, mine)
    angle = nearest_angles(platform, C_np, readout, free)
    turn = platform.attitude(angle) @ np.swapaxes(C_np, -1, -2)
    of_gravity = [e for e in mine if e.stage is Stage.GRAVITY]
    perfect, actual = (predict(platform, s, chosen, recording.kind) for chosen in ((), of_gravity))
    added = _channel_differences(recording, perfect, actual)
    return Mount(angle - readout, turn, {k: v for k, v in added.items() if k[0] == FORCE and of_gravity})


def _static_run(recording: Recording, effects: Sequence[Effect]) -> Mount:
    """Return the correction of a static run, predicted at the phase of the corrected readouts.

    The force depends on the mount alone, because the errors of its sensors are corrected before.
    """
    platform, names = recording.platform, recording.platform.axis_names
    read = np.isin(names, recording.axes(ANGLE))
    unread = _Unread(tuple(e for e in effects if e.stage is Stage.ENCODER), ~read)
    of_mount = [e for e in effects if e.stage not in SENSORS]
    phased = recording if (ANGLE, "platform") in recording.channels else with_phase_of_force(recording)
    off = np.zeros((len(recording.time), len(names)))
    for _ in range(MAX_STEPS):
        s = stimulus_from_readings(with_readouts(phased, phased.angles() + off))
        perfect, as_read, tilted = (
            predict(platform, s, chosen, recording.kind) for chosen in ([unread], effects, of_mount)
        )
        added = _channel_differences(recording, perfect, as_read | {FORCE: tilted[FORCE]})
        off = np.stack([added.pop((ANGLE, a), np.zeros(len(recording.time))) for a in names], axis=-1)
    return Mount(off, None, added)


@dataclass(frozen=True)
class _Unread(Effect):
    """Errors of encoders of gimbals that were not read: nothing was logged that a correction could be added to.

    unread (k,): which of the gimbals have no readout.
    """

    stage = Stage.ENCODER
    effects: tuple[Effect, ...]
    unread: Array

    def contribution(self, s: Stimulus) -> Array:
        """Return the true angle minus readout [rad], (n, k), zero for gimbals that are corrected."""
        return np.asarray(sum((e.contribution(s) for e in self.effects), start=0 * s.readout) * self.unread)


def _channel_differences(recording: Recording, to: Mapping[str, Array], of: Mapping[str, Array]) -> dict[Key, Array]:
    """Return what to add to each logged channel so that `of` becomes `to`; angles within half a turn."""
    out = {}
    for quantity, axis in recording.channels:
        if quantity in to and quantity != "angular_rate":
            i = AXES.get(quantity, recording.platform.axis_names).index(axis)
            d = to[quantity][:, i] - of[quantity][:, i]
            out[quantity, axis] = d if quantity == FORCE else within_half_turn(d)
    return out


def _pointing_correction(recording: Recording, effects: Sequence[Effect]) -> Mount:
    """Return the correction of a pointing run, to the readouts of a perfect mount that points to the same star."""
    platform, readout = recording.platform, recording.angles()
    read = np.isin(platform.axis_names, recording.axes(ANGLE))
    s = stimulus_from_angles(recording)
    observed = predict(platform, s, effects, "pointing")["pointing"]
    channels, angle = tuple(("pointing", a) for a in AXES["pointing"]), np.array(readout)
    for _ in range(NEWTON_STEPS):
        perfect = s.at(readout=angle, angle=angle)
        rows = linearise(platform, perfect, (), "pointing", channels, observed)
        # the smallest turns: at the zenith an alt-azimuth mount has one axis for two directions
        inverse = np.linalg.pinv(rows.sensitivity(Stage.ENCODER)[..., read], rcond=1e-6)
        angle[:, read] += np.einsum("nki,ni->nk", inverse, rows.residual)
    return Mount(angle - readout)


def with_readouts(recording: Recording, angle: Array) -> Recording:
    """Return the recording with these gimbal angles (n, k) where it has readouts."""
    names = recording.platform.axis_names
    logged = {(ANGLE, n): angle[:, names.index(n)] for n in recording.axes(ANGLE)}
    return recording.with_channels(logged)
