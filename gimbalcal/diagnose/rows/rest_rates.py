"""Gyroscopes at rest as a diagnosis takes them: the view of dwells, and the turns that confirm what it finds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gimbalcal.calibration import Calibration
from gimbalcal.earth import EARTH_RATE
from gimbalcal.effects import Effect
from gimbalcal.effects.baseline_effects import ACCELEROMETER_TERMS, GYROSCOPE_INPUT_TERMS
from gimbalcal.errors import InputError
from gimbalcal.estimate.accelerometers.multiposition import multiposition
from gimbalcal.estimate.gyroscopes.rests import fit_rests, rests
from gimbalcal.estimate.gyroscopes.turn_fit import fit_turns
from gimbalcal.recording import Recording
from gimbalcal.recording.record import RATE
from gimbalcal.views.core import View
from gimbalcal.views.rest_rates import MIN_RATE_SIGMA, VERTICAL
from gimbalcal.views.turns import Turns, logged_turns, turns_between_rests

RESTS = 6  # fewer do not tell a pattern of the attitude from chance


def rest_rates(
    recording: Recording, baseline: Sequence[str] = (), accelerometers: Calibration | None = None
) -> View | None:
    """Return the mean rates of dwells, with their nuisances eliminated.

    `accelerometers` calibrates the force (left out, the positions do). None where the outputs are counts and no turns
    between the rests say how much a count is.
    """
    made = accelerometers or multiposition(recording, ACCELEROMETER_TERMS)
    moving = logged_turns(recording)
    if recording.counted(RATE) and not moving:
        return None
    turns, scale = _turns(recording, made) if moving else (None, 1.0)
    still = rests(recording, made, scale, turns)
    if any(p.name == VERTICAL for p in still.nuisances) and len(still) >= RESTS:
        (vertical,), _ = fit_rests(still, still.baseline).nuisance(VERTICAL)
        still = rests(recording, made, scale, turns, float(np.clip(vertical, -EARTH_RATE, EARTH_RATE)))
    still = still.without_nuisances()

    def missed(at_rest: Sequence[Effect]) -> float:
        return np.sqrt(2) * fit_turns(turns_between_rests(recording, made, at_rest)[0], GYROSCOPE_INPUT_TERMS).rms

    noise = still.noise
    if noise.sigma is None or np.any(noise.sigma <= MIN_RATE_SIGMA):  # one row per dwell says nothing of its scatter
        noise = replace(noise, sigma=None, sample=None)
    return replace(still, baseline=tuple(baseline) or still.baseline, noise=noise,
                   missed_by_turns=missed if moving else None)  # fmt: skip


def _turns(recording: Recording, made: Calibration) -> tuple[Turns | None, float]:
    """The turns between dwells and rad/s per unit; none where they are too few, or none is without a pause."""
    try:
        turns, _, scale = turns_between_rests(recording, made)
    except InputError:
        if recording.counted(RATE):
            raise
        return None, 1.0
    return turns, scale
