"""A whole inertial unit turned from rest to rest: accelerometers by the norm of gravity, gyroscopes by the turns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gimbalcal.calibration import Calibration
from gimbalcal.effects import CATALOGUE
from gimbalcal.errors import InputError
from gimbalcal.estimate.multiposition import multiposition
from gimbalcal.estimate.poses import gyroscopes_between_rests
from gimbalcal.estimate.turned import RATE
from gimbalcal.recording import Recording


def inertial_unit(recording: Recording, terms: Sequence[str] = ()) -> Calibration:
    """Calibrate what a unit turned from rest to rest holds: accelerometers by the norm, gyroscopes by the turns.

    terms: ids of effects of either triad (default: those of `multiposition` and of `gyroscopes_between_rests`). When
    the turns do not suffice, the accelerometers stand alone and the options say why.
    """
    of_rate = tuple(t for t in terms if t in CATALOGUE and CATALOGUE[t].stage.name == "GYROSCOPE")
    made = multiposition(recording, tuple(t for t in terms if t not in of_rate))
    if terms and not of_rate:
        return made
    try:
        return with_gyroscopes(recording, made, of_rate)
    except InputError as problem:
        if of_rate:
            raise
        options = {**made.provenance.get("options", {}), "gyroscopes": str(problem)}
        return replace(made, provenance={**made.provenance, "options": options})


def with_gyroscopes(recording: Recording, accelerometers: Calibration, terms: Sequence[str] = ()) -> Calibration:
    """Both triads in one calibration: the accelerometers', and the gyroscopes between the same rests beside it.

    Without rates, or without rows between the rests, it is the accelerometers' calibration as it came.
    """
    if not recording.has(RATE) or recording.position is None or not np.any(recording.position == 0):
        return accelerometers
    g = gyroscopes_between_rests(recording, accelerometers, terms)
    n = len(accelerometers.parameters)
    covariance = np.zeros((n + len(g.parameters),) * 2)
    covariance[:n, :n], covariance[n:, n:] = accelerometers.covariance, g.covariance
    mine, theirs = (c.provenance.get("options", {}) for c in (accelerometers, g))
    named = {f"gyro_{k}" if not k.startswith("gyro_") else k: v for k, v in theirs.items()}
    return replace(
        accelerometers,
        effects=(*accelerometers.effects, *g.effects),
        parameters=(*accelerometers.parameters, *g.parameters),
        covariance=covariance,
        unobservable=(*accelerometers.unobservable, *g.unobservable),
        residual=replace(accelerometers.residual, rms={**accelerometers.residual.rms, **g.residual.rms}),
        provenance={**accelerometers.provenance, "options": {**mine, **named}},
        stages=(*accelerometers.stages, *g.stages),
    )
