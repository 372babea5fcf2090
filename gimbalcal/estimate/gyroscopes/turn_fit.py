"""Gyroscope effects fitted to turns between dwells: the rows of gravity after each turn, and their least squares.

Nothing states the noise: sigmas are scaled to the scatter of the turns. Turns start and end where the calibrated
accelerometers say down is. An error of theirs stands in every turn alike, so that no scatter of turns shows it, and is
added to the covariance.
"""

from __future__ import annotations

from collections.abc import Sequence

from gimbalcal.calibration import Calibration
from gimbalcal.effects import CATALOGUE, Effect, parameters
from gimbalcal.effects.baseline_effects import GYROSCOPE_INPUT_TERMS
from gimbalcal.errors import InputError, amount
from gimbalcal.estimate.extra_effects import NO_EXTENSION, Extension
from gimbalcal.estimate.fit import LEAST_SIGNAL, ViewsFit, fit, fixed_nuisances, independent
from gimbalcal.views.turns import Turns, gravity_after_turns


def fit_turns(turns: Turns, terms: Sequence[str], extra: Extension = NO_EXTENSION) -> ViewsFit:
    """Fit the terms' parameters, and those of extra effects, to gravity after each turn.

    Raises InputError where there are fewer turns than parameters ask for, or none that tells some of them apart.
    """
    view, wanted = (
        gravity_after_turns(turns),
        (*(p for t in terms for p in parameters(CATALOGUE[t])), *extra.parameters),
    )
    if 2 * len(view) < len(wanted):
        raise InputError(
            f"{amount(len(view), 'turn')} for {amount(len(wanted), 'parameter')} that are asked for: turn more often"
        )
    sizes = [p for p in wanted if p not in extra.constants]  # a constant shows nothing before its effect has a size
    if not independent(view.evaluate(extra.effects).jacobian(sizes).reshape(-1, len(sizes))):
        raise InputError(f"nothing in {amount(len(view), 'turn')} tells all of {', '.join(terms)} apart")
    return fit([view], wanted, extra.effects, min_signal=LEAST_SIGNAL)


def linear_effects(turns: Turns) -> tuple[Effect, ...]:
    """Return the linear model of the gyroscopes on the way; empty where the turns do not determine all of it."""
    try:
        return fit_turns(turns, GYROSCOPE_INPUT_TERMS).effects
    except InputError:
        return ()


def with_reference_error(found: ViewsFit, turns: Turns, accelerometers: Calibration) -> ViewsFit:
    """Return the fit with what the accelerometers' covariance adds to that of the estimate."""
    return fixed_nuisances(found, [gravity_after_turns(turns, accelerometers, found.effects)])
