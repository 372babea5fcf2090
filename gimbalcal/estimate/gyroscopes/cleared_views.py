r"""Views of gyroscopes that need an estimate first: dwells and turns with their nuisances eliminated.

What the accelerometers leave open of gravity is noise of the turns. With A the derivative of the rows by the parameters
of the accelerometers, of covariance P, and sigma the scatter of the turns, the rows are weighed by

.. math:: W = \left(1 + A P A^T / \sigma^2\right)^{-1/2} ,

one for a turn that the accelerometers tell well.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gimbalcal.calibration import Calibration, Counts, Readout
from gimbalcal.effects import CATALOGUE, Effect, parameters
from gimbalcal.effects.baseline_effects import GYROSCOPE_INPUT_TERMS
from gimbalcal.errors import InputError, amount
from gimbalcal.estimate.accelerometers.multiposition import usual_accelerometers
from gimbalcal.estimate.fit import LEAST_SIGNAL, fit
from gimbalcal.estimate.gyroscopes.rate_table import on_a_table
from gimbalcal.estimate.gyroscopes.rest_and_turn_fits import BIAS, fit_rests, fit_turns, level_of, rests
from gimbalcal.recording import Recording
from gimbalcal.recording.record import RATE
from gimbalcal.views.core import View
from gimbalcal.views.rest_rates import MIN_RATE_SIGMA, VERTICAL
from gimbalcal.views.turns import gravity_after_turns, logged_turns, turns_between_rests, with_headings

MIN_RESTS = 6  # fewer do not tell a pattern of the attitude from chance

MIN_TURNS = 12  # turns: twice as many numbers, for nine parameters of the linear model and what is asked beyond
MIN_NUMBERS_LEFT = (
    6  # numbers that must be left of the turns to tell their scatter beside what the accelerometers leave open
)


def view_at_rest(
    recording: Recording, baseline: Sequence[str] = (), accelerometers: Calibration | None = None
) -> View | None:
    """Return the mean rates of dwells, with their nuisances eliminated.

    `accelerometers` calibrates the force (left out, the positions do). None where the outputs are counts and no turns
    between the rests say how much a count is.
    """
    calibration = accelerometers or usual_accelerometers(recording)
    moving, turns, scale = logged_turns(recording), None, 1.0
    if recording.counted(RATE) and not moving:
        return None
    try:
        turns, _, scale = turns_between_rests(recording, calibration) if moving else (None, None, 1.0)
    except InputError:  # too few turns: nothing carries the heading from dwell to dwell
        if recording.counted(RATE):
            raise
    still = rests(recording, calibration, scale, turns)
    unknown = any(p.name == VERTICAL for p in still.nuisances) and len(still) >= MIN_RESTS
    # in the scatter of the dwells: in that of the samples a vertical rate takes up all of a common g-sensitivity
    still = still.without_nuisances(fit_rests(still, still.baseline).sigma[0] if unknown else None)

    def missed(at_rest: Sequence[Effect]) -> float:
        turns = turns_between_rests(recording, calibration, at_rest)[0]
        return np.sqrt(2) * fit_turns(turns, GYROSCOPE_INPUT_TERMS).rms

    noise = still.noise
    if noise.sigma is None or np.any(noise.sigma <= MIN_RATE_SIGMA):  # one row per dwell says nothing of its scatter
        noise = replace(noise, sigma=None, sample=None)
    return replace(
        still, baseline=tuple(baseline) or still.baseline, noise=noise, readout=_readout(still, scale),
        missed_by_turns=missed if moving else None,
    )  # fmt: skip


def view_of_turns(
    recording: Recording, accelerometers: Calibration | None = None, at_rest: Sequence[Effect] = ()
) -> View | None:
    """Return the turns of a recording; None where there are too few or nothing was logged on the way.

    accelerometers: their model, with its covariance (left out, bias, scale and misalignment by the norm of gravity);
    at_rest: effects by which the rests tell what gyroscopes read that do not turn (left out, bias and g-sensitivity).
    """
    if recording.position is None or not np.any(recording.position == 0):
        return None
    calibration = accelerometers or usual_accelerometers(recording)
    try:
        turns, _, scale = turns_between_rests(recording, calibration, at_rest)
        level = level_of(rests(recording, calibration, scale, turns), True)[0]
        if not at_rest and len(level.parameters) > len(parameters(CATALOGUE[BIAS])):
            turns = turns_between_rests(recording, calibration, level.effects)[0]
    except InputError:
        return None
    if len(turns.ends) < MIN_TURNS:
        return None
    view = gravity_after_turns(with_headings(turns, calibration.apply(recording)), calibration)
    return replace(view.without_nuisances(_scatter(view)), readout=_readout(view, scale))


def view_on_a_table(recordings: Sequence[Recording]) -> View:
    """Return the mean rates of steady turning on a table, with mountings and the Earth's rate eliminated.

    These are eliminated in the scatter of the stretches about a linear model. Raises InputError as `on_a_table`, and
    where the stretches are too few to tell their scatter.
    """
    table = on_a_table(recordings)
    if table.linear.dof_of_scatter < MIN_NUMBERS_LEFT:
        raise InputError(
            f"{recordings[0].title!r} holds {amount(sum(table.stretches), 'stretch', 'stretches')} of steady turning, "
            "too few to tell how they scatter: turn at more rates, both ways round"
        )
    cleared = table.view.without_nuisances(table.linear.sigma[0])
    counts = Counts(tuple(map(float, table.scale))) if recordings[0].counted(RATE) else None
    return replace(cleared, readout=replace(cleared.readout, gyroscopes=counts))


def _readout(view: View, scale: float) -> Readout:
    """Return how the unit of a view is read, with gyroscopes of `scale` [rad/s] per count where they count."""
    return replace(view.readout, gyroscopes=Counts((scale,) * 3) if view.source.counted(RATE) else None)


def _scatter(view: View) -> float:
    """Scatter of turns about a linear model [rad], with all that the accelerometers leave open where enough is left."""
    wanted = [p for i in GYROSCOPE_INPUT_TERMS for p in parameters(CATALOGUE[i])]
    enough = len(wanted) + len(view.nuisances) + MIN_NUMBERS_LEFT <= 2 * len(view)
    free = tuple(replace(p, sigma=np.inf) for p in view.nuisances) if enough else ()
    return max(fit([replace(view, nuisances=free)], wanted, min_signal=LEAST_SIGNAL).excess, 1e-150)
