"""Navigate a recording by the mechanisation of its kind, with sigmas by the uncertainty of a calibration.

Two methods must agree. Linearly: the exact derivative of the forward model gives the response of the readings to a
parameter, and the navigator that of the errors. By samples: parameters drawn from the covariance correct the readings,
which are navigated.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gimbalcal.calibration import Calibration
from gimbalcal.effects import Effect, Parameter, with_values
from gimbalcal.errors import InputError
from gimbalcal.forward import linearise
from gimbalcal.kinematics import required_latitude, stimulus_from_angles, stimulus_from_readings
from gimbalcal.navigate.navigation_errors import CHANNELS, NONE, Navigated
from gimbalcal.navigate.space_stable_navigator import UNDAMPED, USUAL, Aids, InertialSite
from gimbalcal.navigate.static_run import half_difference, horizontal_distance, platform_navigated, with_inner
from gimbalcal.navigate.strapdown_unit import Intervals, navigate_intervals, thinned_intervals, unit_navigated
from gimbalcal.number import Array
from gimbalcal.progress import Progress, no_progress
from gimbalcal.recording import Recording
from gimbalcal.recording.record import ANGLE, FORCE, RATE


def navigation_errors(
    recording: Recording, calibration: Calibration | None = None, aids: Aids = USUAL, label: str = NONE
) -> Navigated:
    """Return the errors of a navigation, of readings that a calibration corrects if there is one.

    Raises InputError for what cannot be navigated: positions, a static run of another platform, no latitude, no force
    or, of a strapdown unit, no rates.
    """
    if recording.kind.stabilised:
        return platform_navigated(recording, calibration, aids, label)
    if not recording.kind.rotating:
        raise InputError(
            f"{recording.title!r} is a {recording.kind} recording; a static run of a space-stable platform is "
            'navigated, or a strapdown unit that stays in its place (kind = "rotation", both triads, every sample)'
        )
    return unit_navigated(recording, calibration, aids, label)


def usual_references(recording: Recording, damping: float | None = None, alignment: float = USUAL.alignment) -> Aids:
    """Return the references of a navigation; by default a platform is damped and a strapdown unit is not."""
    damped = (UNDAMPED if recording.kind.rotating else USUAL).damping if damping is None else damping
    return Aids(damping=damped, alignment=alignment)


PROGRESS_DRAWS = 100  # between two messages
BAND_ROWS = 240  # of the run, for bands: the response to a parameter has periods of a day and half a day
Band = tuple[Array, Array]  # time (m,) [s] and one sigma (m, 7), or response to parameters (m, 7, p)


def before_and_after(
    recording: Recording,
    calibrations: Sequence[tuple[str, Calibration]],
    aids: Aids = USUAL,
    samples: int = 0,
    seed: int = 1,
    progress: Progress = no_progress,
) -> tuple[Navigated, ...]:
    """Navigate a recording without and with each labelled calibration, with bands from `samples` draws if any.

    Raises InputError for what cannot be navigated, see `navigation_errors`.
    """
    out = [navigation_errors(recording, None, aids, NONE)]
    for label, calibration in calibrations:
        progress(f"navigating with {label}")
        result = navigation_errors(recording, calibration, aids, label)
        if samples:

            def drawn(k: int, label: str = label) -> None:
                if k % PROGRESS_DRAWS == 0:
                    progress(f"navigating with {label}: draw {k} of {samples}")

            linear, sampled = sigma_bands(recording, calibration, aids, samples, seed, drawn)
            result = replace(
                result,
                linear=_interpolated_sigma(result.time, *linear),
                sampled=_interpolated_sigma(result.time, *sampled),
            )
        out.append(result)
    return tuple(out)


def sigma_bands(
    recording: Recording, calibration: Calibration, aids: Aids, samples: int, seed: int,
    drawn: Callable[[int], None] = lambda _: None,
) -> tuple[Band, Band]:  # fmt: skip
    r"""Return one sigma of each error by the uncertainty of the calibration, propagated and sampled.

    .. math:: \sigma^2 = \mathrm{diag}(J P J^T), \qquad J = \partial \text{error} / \partial \text{parameters}

    A thinned run suffices, as noise cancels. `drawn` receives the number of samples done.
    """
    thin = _thinned_run(recording)
    time = thin.error(thin.rows, aids).time
    return (time, _propagated_sigma(thin, calibration, aids)), (
        time,
        _sampled_sigma(thin, calibration, aids, samples, seed, drawn),
    )


def position_uncertainty(recording: Recording, calibration: Calibration, aids: Aids = USUAL) -> float:
    """Return the largest one sigma of the horizontal position [m] by the uncertainty of a calibration, propagated."""
    sigma, place = _propagated_sigma(_thinned_run(recording), calibration, aids), recording.site
    return float(
        horizontal_distance(
            sigma, InertialSite(required_latitude(place.latitude), place.height, place.gravity, 0.0)
        ).max()
    )


@dataclass(frozen=True, eq=False)
class _ThinnedRun:
    """A thinned run, and, of a strapdown unit, the intervals that its rows are means over."""

    rows: Recording
    intervals: Intervals | None

    def error(self, rows: Recording, aids: Aids) -> Navigated:
        """Return the errors of the navigation with these readings in place of its own."""
        if self.intervals is not None:
            return navigate_intervals(self.intervals, rows, aids, "")
        return navigation_errors(rows, None, aids)


def _thinned_run(recording: Recording) -> _ThinnedRun:
    if recording.kind.rotating:
        intervals = thinned_intervals(recording, float(np.ptp(recording.time)) / BAND_ROWS)
        return _ThinnedRun(intervals.rows, intervals)
    rows = recording.select(np.arange(0, len(recording.time), max(1, len(recording.time) // BAND_ROWS)))
    return _ThinnedRun(with_inner(rows), None)


def sensitivity(
    run: Recording, effects: Sequence[Effect], wanted: Sequence[Parameter], step: Array, aids: Aids = USUAL
) -> Band:
    """Return times (n,) [s], and the errors (n, 7, p) of a perfect run by a step (p,) of each parameter."""
    thin = _thinned_run(run) if run.kind.rotating else _ThinnedRun(run, None)
    return thin.error(thin.rows, aids).time, _sensitivity(thin, thin.rows, effects, wanted, step, aids)


def _sensitivity(
    thin: _ThinnedRun, run: Recording, effects: Sequence[Effect], wanted: Sequence[Parameter], step: Array, aids: Aids
) -> Array:
    if not wanted:
        return np.zeros((len(thin.error(run, aids).time), len(CHANNELS), 0))
    if thin.intervals is None:
        s, kind, quantities = stimulus_from_angles(run), "static-run", (FORCE, ANGLE)
    else:
        s, kind, quantities = stimulus_from_readings(run), "rotation", (FORCE, RATE)
    keys = tuple(key for key in run.channels if key[0] in quantities)
    rows = linearise(run.platform, s, effects, kind, keys)

    def moved(k: int) -> tuple[Recording, Recording]:
        """Return the readings with a step of a parameter, and with a step back."""
        added = step[k] * rows.jacobian(wanted[k : k + 1])[..., 0]
        steps = {key: added[:, i] for i, key in enumerate(keys)}
        there, back = (
            run.with_channels({key: run.channels[key] + way * x for key, x in steps.items()}) for way in (1, -1)
        )
        return there, back

    pairs = (moved(k) for k in range(len(wanted)))
    if thin.intervals is None:
        return half_difference(list(pairs), aids)
    odd = [(thin.error(there, aids).error - thin.error(back, aids).error) / 2 for there, back in pairs]
    return np.stack(odd, axis=-1)


def _propagated_sigma(thin: _ThinnedRun, calibration: Calibration, aids: Aids) -> Array:
    """Return one sigma (m, 7) by the derivative."""
    sigma = calibration.sigmas
    uncertain = np.flatnonzero(sigma > 0)
    run = calibration.apply(thin.rows)
    wanted = [calibration.parameters[i] for i in uncertain]
    D = _sensitivity(thin, run, calibration.effects, wanted, sigma[uncertain], aids)
    P, s = np.asarray(calibration.covariance)[np.ix_(uncertain, uncertain)], sigma[uncertain]
    correlation = P / np.outer(s, s)
    return np.asarray(np.sqrt(np.maximum(np.einsum("ncp,pq,ncq->nc", D, correlation, D), 0.0)))


def _sampled_sigma(
    thin: _ThinnedRun, calibration: Calibration, aids: Aids, samples: int, seed: int, drawn: Callable[[int], None]
) -> Array:
    """Return one sigma (m, 7) of errors with drawn parameters about the one with estimated parameters."""
    x, names = calibration.values, thin.rows.platform.axis_names
    w, V = np.linalg.eigh(np.asarray(calibration.covariance))
    root, rng = V * np.sqrt(np.maximum(w, 0.0)), np.random.default_rng(seed)

    def error(values: Array) -> Array:
        effects = with_values(calibration.effects, calibration.parameters, values, names)
        return thin.error(replace(calibration, effects=effects).apply(thin.rows), aids).error

    middle = error(x)
    squares = np.zeros_like(middle)
    for k in range(samples):
        squares += (error(x + root @ rng.standard_normal(len(x))) - middle) ** 2
        drawn(k + 1)
    return np.asarray(np.sqrt(squares / samples))


def _interpolated_sigma(time: Array, t: Array, sigma: Array) -> Array:
    return np.stack([np.interp(time, t, column) for column in sigma.T], axis=-1)
