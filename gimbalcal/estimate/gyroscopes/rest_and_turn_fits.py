r"""Fits of gyroscopes to dwells (bias, and what gravity does to them) and to turns, and views that need these fits.

Dwells may scatter beyond the noise of their means, as a wandering bias does; how far is estimated with the effects, for
each axis. Nothing states the noise of turns: sigmas are scaled to their scatter. Turns start and end where the
calibrated accelerometers say down is. Their errors are common to all turns and do not appear in the scatter of turns:
they are added to the covariance. See `views.rest_rates` and `views.turns` for the rows.

In the views with eliminated nuisances, the uncertainty of gravity by the accelerometers is noise of the turns. With
A the derivative of the rows by the parameters of the accelerometers, of covariance P, and sigma the scatter of the
turns, the rows are weighed by

.. math:: W = \left(1 + A P A^T / \sigma^2\right)^{-1/2} ,

one for a turn whose gravity the accelerometers determine well.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from gimbalcal.calibration import Calibration, Counts, Readout
from gimbalcal.effects import Effect, Parameter, parameters_of_effects, with_values
from gimbalcal.effects.baseline_effects import GYROSCOPE_INPUT_TERMS
from gimbalcal.errors import InputError, number_of
from gimbalcal.estimate.accelerometers.multiposition import usual_accelerometers
from gimbalcal.estimate.extra_effects import NO_EXTENSION, Extension
from gimbalcal.estimate.fit import (
    LEAST_SIGNAL,
    MIN_NUMBERS_LEFT,
    MIN_SINGULAR_RATIO,
    ViewsFit,
    columns_are_independent,
    fit,
)
from gimbalcal.estimate.gyroscopes.residual_checks import MAX_ASTRAY
from gimbalcal.estimate.term_selection import needed_significance, refusal_sentence
from gimbalcal.inference.information import prior
from gimbalcal.number import Array
from gimbalcal.recording import Recording
from gimbalcal.recording.record import RATE
from gimbalcal.views.core import View
from gimbalcal.views.rest_rates import MIN_RATE_SIGMA, VERTICAL, rest_rates
from gimbalcal.views.swept_rotations import swept_rotation
from gimbalcal.views.turns import Turns, gravity_after_turns, logged_turns, turns_between_rests, with_headings

BIAS, G_SENSITIVITY = "gyro_bias", "gyro_g_sensitivity_rate"
LINEAR = parameters_of_effects(GYROSCOPE_INPUT_TERMS)
MIN_DWELLS = 6  # four unknowns an axis, and something to test them on
MIN_RESTS = 6  # fewer do not tell a pattern of the attitude from chance
MAX_USUAL_SIGMAS = 200.0  # of a parameter that the turns determine: 20 % of scale, 17 deg
ROUNDING = 1e-6  # of the share of a parameter that rows resolve
MIN_TURNS = 12  # turns: twice as many numbers, for nine parameters of the linear model and what is asked beyond


def rests_joined_by_turns(recording: Recording, accelerometers: Calibration, turns: Turns | None = None) -> View:
    """Return the dwells of a recording, joined by turns that were logged as their linear model carries the heading."""
    carried: dict[int, Array] = {}
    if turns is not None and not recording.platform.axes and logged_turns(recording):
        linear: tuple[Effect, ...] = ()
        with suppress(InputError):  # the turns may not determine all of it
            linear = fit_turns(turns, determined_parameters(turns, GYROSCOPE_INPUT_TERMS)).effects
        carried = dict(zip(turns.ends.tolist(), swept_rotation(turns, linear), strict=True))
    return rest_rates(recording, accelerometers, turns.scale if turns else 1.0, carried)


def fit_rests(still: View, terms: Sequence[str] = (BIAS, G_SENSITIVITY), extra: Extension = NO_EXTENSION) -> ViewsFit:
    """Fit gyroscope effects to dwells, with a scatter of each axis beyond the samples'."""
    return fit(
        [still],
        (*parameters_of_effects(terms), *extra.parameters),
        extra.effects,
        min_signal=LEAST_SIGNAL,
        significance=0.0,
    )


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
    clear_of = needed_significance(tried or len(parameters_of_effects([G_SENSITIVITY])), full.dof_of_scatter)
    why = refusal_sentence(G_SENSITIVITY, data, plain, full, "rad/s", clear_of)
    return (plain, why) if why else (full, "")


def levelled_by(level: ViewsFit, turns: Turns) -> Turns:
    """Return turns levelled by a fit of the rests if it holds more than the bias, which each level contains."""
    return turns.levelled(level.effects) if len(level.parameters) > len(parameters_of_effects([BIAS])) else turns


def by_motion(extra: Extension, still: View) -> tuple[Extension, Extension]:
    """Return the part of extra effects that acts on a unit at rest, and the part that acts in turns only.

    A constant belongs to the rests if its effect has a size that acts there.
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


def fit_turns(turns: Turns, wanted: Sequence[Parameter], extra: Extension = NO_EXTENSION) -> ViewsFit:
    """Fit parameters of gyroscopes, and those of extra effects, to gravity after each turn.

    Raises InputError where there are fewer turns than parameters require, or none that distinguishes some of them.
    """
    view, every = gravity_after_turns(turns), (*wanted, *extra.parameters)
    terms = ", ".join(dict.fromkeys(p.effect for p in every))
    if not every:
        raise InputError(f"nothing in {number_of(len(view), 'turn')} shows how gyroscopes read: turn more often")
    if 2 * len(view) < len(every):
        raise InputError(
            f"{number_of(len(view), 'turn')} for {number_of(len(every), 'parameter')} that are asked "
            "for: turn more often"
        )
    sizes = [p for p in every if p not in extra.constants]  # a constant shows nothing before its effect has a size
    if not columns_are_independent(view.evaluate(extra.effects).jacobian(sizes).reshape(-1, len(sizes))):
        raise InputError(f"nothing in {number_of(len(view), 'turn')} distinguishes all of {terms}")
    return fit([view], every, extra.effects, min_signal=LEAST_SIGNAL)


def determined_parameters(turns: Turns, terms: Sequence[str]) -> tuple[Parameter, ...]:
    r"""Return the parameters of the terms, except those with a sigma larger than the error of any gyroscope.

    A unit that turned about one axis determines the response of all gyroscopes to that rate, but hardly the scale
    factors of the others, for which a fit then returns any value. A parameter is not determined where

    .. math:: \sigma^2 (J^+ J^{+T})_{ii} + (J^+ N N^T J^{+T})_{ii} > 200^2 \quad \text{or} \quad
        (J^+ J)_{ii} < 1 - 10^{-6}

    with J the derivatives by prior sigmas about sensors without errors, N those of the nuisances, and sigma the rms of
    what a linear model leaves of the rows, at most `MAX_ASTRAY`, since a wrong range leaves more.
    """
    rows, wanted = gravity_after_turns(turns, ()).evaluate(()), parameters_of_effects(terms)
    J, r = rows.jacobian(wanted).reshape(-1, len(wanted)) * prior(wanted)[1], rows.residual.ravel()
    inverse = np.linalg.pinv(J, rcond=MIN_SINGULAR_RATIO)
    resolution = inverse @ J
    residual = r - J @ (inverse @ r)
    noise = min(float(np.sqrt(residual @ residual / max(len(r) - np.trace(resolution), 1.0))), MAX_ASTRAY)
    variance = noise**2 * (inverse**2).sum(axis=1)
    variance += ((inverse @ np.asarray(rows.nuisance).reshape(len(r), -1)) ** 2).sum(axis=1)
    clear = (variance <= MAX_USUAL_SIGMAS**2) & (np.diag(resolution) >= 1 - ROUNDING)
    return tuple(p for p, each in zip(wanted, clear, strict=True) if each)


def view_at_rest(
    recording: Recording, baseline: Sequence[str] = (), accelerometers: Calibration | None = None
) -> View | None:
    """Return the mean rates of dwells, with their nuisances eliminated.

    `accelerometers` calibrates the force (left out, the positions do). None where the outputs are counts and no turns
    between the rests say how much a count is.
    """
    calibration = accelerometers or usual_accelerometers(recording)
    moving, turns = logged_turns(recording), None
    if recording.counted(RATE) and not moving:
        return None
    try:
        turns = turns_between_rests(recording, calibration) if moving else None
    except InputError:  # too few turns: nothing carries the heading from dwell to dwell
        if recording.counted(RATE):
            raise
    still = rests_joined_by_turns(recording, calibration, turns)
    unknown = any(p.name == VERTICAL for p in still.nuisances) and len(still) >= MIN_RESTS
    # in the scatter of the dwells: in that of the samples a vertical rate takes up all of a common g-sensitivity
    still = still.without_nuisances(fit_rests(still, still.baseline).sigma[0] if unknown else None)

    def missed(at_rest: Sequence[Effect]) -> float:
        base = turns or turns_between_rests(recording, calibration)
        return np.sqrt(2) * fit_turns(base.levelled(at_rest) if at_rest else base, LINEAR).rms

    noise = still.noise
    if noise.sigma is None or np.any(noise.sigma <= MIN_RATE_SIGMA):  # one row per dwell says nothing of its scatter
        noise = replace(noise, sigma=None, sample=None)
    return replace(
        still, baseline=tuple(baseline) or still.baseline, noise=noise, readout=_readout(still, turns),
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
        turns = turns_between_rests(recording, calibration)
        turns = (
            turns.levelled(at_rest)
            if at_rest
            else levelled_by(level_of(rests_joined_by_turns(recording, calibration, turns), True)[0], turns)
        )
    except InputError:
        return None
    if len(turns.ends) < MIN_TURNS:
        return None
    view = gravity_after_turns(with_headings(turns), ())
    return replace(view.without_nuisances(_scatter(view)), readout=_readout(view, turns))


def _readout(view: View, turns: Turns | None) -> Readout:
    """Return how the unit of a view is read, with the scale of the turns for gyroscopes that count."""
    counts = Counts((turns.scale,) * 3) if turns and view.source.counted(RATE) else None
    return replace(view.readout, gyroscopes=counts)


def _scatter(view: View) -> float:
    """Return the scatter of turns about a linear model [rad], with that due to the accelerometers if possible."""
    enough = len(LINEAR) + len(view.nuisances) + MIN_NUMBERS_LEFT <= 2 * len(view)
    free = tuple(replace(p, sigma=np.inf) for p in view.nuisances) if enough else ()
    return max(fit([replace(view, nuisances=free)], LINEAR, min_signal=LEAST_SIGNAL).excess, 1e-150)
