"""Which effects the model of a recording can hold: the recording has what they act on, and the way it is fitted."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gimbalcal.calibration import Calibration
from gimbalcal.effects import Effect
from gimbalcal.effects.effect import GYROSCOPE_STAGES, SENSOR_STAGES, follows
from gimbalcal.errors import InputError
from gimbalcal.estimate.extra_effects import unfit as not_shown
from gimbalcal.recording import Recording
from gimbalcal.recording.columns import SPARSE
from gimbalcal.views.core import known_effect


def unfit(effect_id: str, recording: Recording) -> str:
    """Return why the model of a recording cannot hold an effect, to follow "which"; empty where it can."""
    cls, logs = known_effect(effect_id), recording.axes("covariate")
    reason = not_shown(cls, recording)
    if not reason and follows(cls) == "" and len(logs) > 1:
        return f"follows one covariate, and {recording.title!r} has {len(logs)} of them"
    return reason


def check_baseline(ids: Sequence[str], recordings: Sequence[Recording]) -> None:
    """Raise InputError for an effect that none of the recordings can hold in its model."""
    for effect_id in ids:
        reasons = [unfit(effect_id, r) for r in recordings]
        if all(reasons):
            raise InputError(f"the baseline names {effect_id!r}, which {reasons[0]}; leave it out of --baseline")


def by_triad(ids: Sequence[str]) -> tuple[list[str], list[str]]:
    """Effects of the forces, and those of the gyroscopes."""
    gyro = [i for i in ids if known_effect(i).stage in GYROSCOPE_STAGES]
    return [i for i in ids if i not in gyro], gyro


def check_finite(recording: Recording) -> None:
    """Raise InputError, with row and channel, for a value that is no number."""
    for (quantity, axis), x in recording.channels.items():
        bad = np.flatnonzero(~np.isfinite(x)) if quantity not in SPARSE else np.zeros(0)
        if bad.size:
            name = f"{quantity} {axis}".strip()
            raise InputError(
                f"{recording.title!r}, row {bad[0] + 1}, {name}: the value is not a finite number; leave such rows out"
            )


def carried(calibration: Calibration | None, baseline: Sequence[str]) -> tuple[Effect, ...]:
    """Effects of a calibration that hold on another day: the baseline's and the sensors', not how the rig stood."""
    held = SENSOR_STAGES | GYROSCOPE_STAGES
    return tuple(e for e in (calibration.effects if calibration else ()) if e.id in baseline or e.stage in held)
