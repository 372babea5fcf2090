r"""Turns between dwells as a diagnosis takes them: what the accelerometers leave open of gravity is noise of the rows.

With A the derivative of the rows by the parameters of the accelerometers, of covariance P, and sigma the scatter of the
turns, the rows are weighed by

.. math:: W = \left(1 + A P A^T / \sigma^2\right)^{-1/2} ,

one for a turn that the accelerometers tell well.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gimbalcal.calibration import Calibration
from gimbalcal.effects import CATALOGUE, Effect, parameters
from gimbalcal.effects.baseline_effects import ACCELEROMETER_TERMS, GYROSCOPE_INPUT_TERMS
from gimbalcal.errors import InputError
from gimbalcal.estimate.accelerometers.multiposition import multiposition
from gimbalcal.estimate.fit import LEAST_SIGNAL, fit
from gimbalcal.estimate.gyroscopes.rests import BIAS, level_of, rests
from gimbalcal.recording import Recording
from gimbalcal.views.core import View
from gimbalcal.views.turns import gravity_after_turns, turns_between_rests, with_headings

FEWEST = 12  # turns: twice as many numbers, for nine parameters of the linear model and what is asked beyond
SURE = 6  # numbers that must be left of the turns to tell their scatter beside what the accelerometers leave open


def view_of_turns(
    recording: Recording, accelerometers: Calibration | None = None, at_rest: Sequence[Effect] = ()
) -> View | None:
    """Return the turns of a recording; None where there are too few or nothing was logged on the way.

    accelerometers: their model, with its covariance (left out, bias, scale and misalignment by the norm of gravity);
    at_rest: effects by which the rests tell what gyroscopes read that do not turn (left out, bias and g-sensitivity).
    """
    if recording.position is None or not np.any(recording.position == 0):
        return None
    made = accelerometers or multiposition(recording, ACCELEROMETER_TERMS)
    try:
        turns, _, scale = turns_between_rests(recording, made, at_rest)
        level = level_of(rests(recording, made, scale, turns), True)[0]
        if not at_rest and len(level.parameters) > len(parameters(CATALOGUE[BIAS])):
            turns = turns_between_rests(recording, made, level.effects)[0]
    except InputError:
        return None
    if len(turns.ends) < FEWEST:
        return None
    view = gravity_after_turns(with_headings(turns, made.apply(recording)), made)
    return view.without_nuisances(_scatter(view))


def _scatter(view: View) -> float:
    """Scatter of turns about a linear model [rad], with all that the accelerometers leave open where enough is left."""
    wanted = [p for i in GYROSCOPE_INPUT_TERMS for p in parameters(CATALOGUE[i])]
    enough = len(wanted) + len(view.nuisances) + SURE <= 2 * len(view)
    free = tuple(replace(p, sigma=np.inf) for p in view.nuisances) if enough else ()
    return max(fit([replace(view, nuisances=free)], wanted, min_signal=LEAST_SIGNAL).excess, 1e-150)
