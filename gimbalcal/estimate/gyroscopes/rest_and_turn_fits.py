r"""Fits of gyroscopes to dwells (bias, and what gravity does to them) and to the turns between dwells.

Dwells may scatter beyond the noise of their means, as a wandering bias does; how far is estimated with the effects, for
each axis. Nothing states the noise of turns: sigmas are scaled to their scatter. Turns start and end where the
calibrated accelerometers say down is. An error of theirs stands in every turn alike, so that no scatter of turns shows
it, and is added to the covariance. See `views.rest_rates` and `views.turns` for the rows.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gimbalcal.calibration import Calibration
from gimbalcal.effects import CATALOGUE, Effect, Parameter, parameters, with_values
from gimbalcal.effects.baseline_effects import GYROSCOPE_INPUT_TERMS
from gimbalcal.errors import InputError, amount
from gimbalcal.estimate.extra_effects import NO_EXTENSION, Extension
from gimbalcal.estimate.fit import LEAST_SIGNAL, ViewsFit, fit, independent
from gimbalcal.estimate.term_selection import coefficients, needed, refusal
from gimbalcal.number import Array
from gimbalcal.recording import Recording
from gimbalcal.views.core import View
from gimbalcal.views.rest_rates import rest_rates
from gimbalcal.views.swept_rotations import swept
from gimbalcal.views.turns import Turns, gravity_after_turns, logged_turns

BIAS, G_SENSITIVITY = "gyro_bias", "gyro_g_sensitivity_rate"
MIN_DWELLS = 6  # four unknowns an axis, and something to test them on


def rests(recording: Recording, accelerometers: Calibration, scale: float = 1.0, turns: Turns | None = None) -> View:
    """Return the dwells of a recording, joined by turns that were logged as their linear model carries the heading."""
    carried: dict[int, Array] = {}
    if turns is not None and not recording.platform.axes and logged_turns(recording):
        carried = dict(zip(turns.ends.tolist(), swept(turns, linear_effects(turns)), strict=True))
    return rest_rates(recording, accelerometers, scale, carried)


def fit_rests(
    still: View, terms: Sequence[str] = (BIAS, G_SENSITIVITY), extra: Extension = NO_EXTENSION
) -> ViewsFit:  # fmt: skip
    """Fit gyroscope effects to dwells, with a scatter of each axis beyond the samples'."""
    wanted = (*(p for t in terms for p in parameters(CATALOGUE[t])), *extra.parameters)
    return fit([still], wanted, extra.effects, min_signal=LEAST_SIGNAL, significance=0.0)


def level_of(still: View, g_sensitivity: bool, tried: int = 0, extra: Extension = NO_EXTENSION) -> tuple[ViewsFit, str]:
    """Bias, and g-sensitivity if the dwells support it; the second value says why not, if they do not.

    tried: coefficients that were asked for in all, those of the g-sensitivity with them (left out: these alone); extra:
    effects that are fitted in any case.
    """
    plain = fit_rests(still, (BIAS,), extra)
    if not g_sensitivity:
        return plain, ""
    data = f"{len(still)} rests"
    if len(still) < MIN_DWELLS:
        return plain, f"{G_SENSITIVITY} is left out: {data} are too few for it"
    full = fit_rests(still, (BIAS, G_SENSITIVITY), extra)
    clear_of = needed(tried or coefficients([G_SENSITIVITY]), full.dof_of_scatter)
    why = refusal(G_SENSITIVITY, data, plain, full, "rad/s", clear_of)
    return (plain, why) if why else (full, "")


def by_motion(extra: Extension, still: View) -> tuple[Extension, Extension]:
    """The part of extra effects that shows in what a unit at rest reads, and the part that only turning shows.

    A constant belongs to the rests where its effect has a size that shows there.
    """
    by_id = {e.id: e for e in extra.effects}

    def shows(p: Parameter) -> bool:
        (probe,) = with_values([by_id[p.effect]], (p,), np.array([p.sigma]))
        return bool(np.any(probe.contribution(still.stimulus) != 0))

    sizes = [p for p in extra.parameters if p not in extra.constants]
    at_rest = {p for p in sizes if shows(p)}
    at_rest |= {c for c in extra.constants if any(p.effect == c.effect for p in at_rest)}
    rest, moving = (tuple(p for p in extra.parameters if (p in at_rest) is still) for still in (True, False))
    return Extension(extra.effects, rest), Extension(extra.effects, moving)


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


def with_reference_error(fitted: ViewsFit, turns: Turns, accelerometers: Calibration) -> ViewsFit:
    """Return the fit with what the accelerometers' covariance adds to that of the estimate."""
    return fitted.with_fixed_nuisances([gravity_after_turns(turns, accelerometers, fitted.effects)])
