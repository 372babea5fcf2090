"""What the uncertainty of a calibration leaves of navigation errors: one sigma over time, on two roads that must meet.

Linearly: the exact derivative of the forward model says what a parameter does to the readings, and the navigator what
that does to the errors. By samples: parameters drawn from the covariance correct the readings, and these are navigated.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from gimbalcal.calibration import Calibration
from gimbalcal.effects import CATALOGUE, Effect, Parameter, with_values
from gimbalcal.forward import linearise
from gimbalcal.kinematics import required_latitude, stimulus_from_angles, stimulus_from_readings
from gimbalcal.navigate.mean_intervals import Intervals, thinned
from gimbalcal.navigate.mechanisations import is_strapdown, navigated
from gimbalcal.navigate.navigation_errors import CHANNELS, NONE, Navigated
from gimbalcal.navigate.space_stable import USUAL, Aids, Site
from gimbalcal.navigate.static_run import half_apart, horizontal, with_inner
from gimbalcal.navigate.strapdown_unit import block_of, legs_navigated
from gimbalcal.number import Array
from gimbalcal.recording import Recording
from gimbalcal.recording.record import ANGLE, FORCE, RATE

TOLD = 100  # draws
ROWS = 240  # of the run, for bands: what a parameter does follows the day and half of it
Band = tuple[Array, Array]  # time (m,) [s] and one sigma (m, 7), or what each parameter does (m, 7, p)


def before_and_after(
    recording: Recording,
    calibrations: Sequence[tuple[str, Calibration]],
    aids: Aids = USUAL,
    samples: int = 0,
    seed: int = 1,
    tell: Callable[[str], None] = lambda _: None,
) -> tuple[Navigated, ...]:
    """A recording navigated as it was read and with each labelled calibration, with bands where `samples` are asked.

    Raises InputError for what cannot be navigated, see `run.navigated`.
    """
    out = [navigated(recording, None, aids, NONE)]
    for label, calibration in calibrations:
        tell(f"navigating with {label}")
        made = navigated(recording, calibration, aids, label)
        if samples:
            drawn = partial(_told, tell, label, samples)
            linear, sampled = bands(recording, calibration, aids, samples, seed, drawn)
            made = replace(made, linear=_at(made.time, *linear), sampled=_at(made.time, *sampled))
        out.append(made)
    return tuple(out)


def _told(tell: Callable[[str], None], label: str, samples: int, k: int) -> None:
    if k % TOLD == 0:
        tell(f"navigating with {label}: draw {k} of {samples}")


def bands(
    recording: Recording, calibration: Calibration, aids: Aids, samples: int, seed: int,
    drawn: Callable[[int], None] = lambda _: None,
) -> tuple[Band, Band]:  # fmt: skip
    r"""One sigma of each error by what the calibration does not know: propagated, and sampled.

    .. math:: \sigma^2 = \mathrm{diag}(J P J^T), \qquad J = \partial \text{error} / \partial \text{parameters}

    A thinned run serves, as noise cancels. `drawn` is told how many samples are done.
    """
    few = _few(recording)
    time = few.error(few.rows, aids).time
    return (time, _propagated(few, calibration, aids)), (time, _sampled(few, calibration, aids, samples, seed, drawn))


def uncertain(recording: Recording, calibration: Calibration, aids: Aids = USUAL) -> float:
    """Largest one sigma of the horizontal position [m] by what the calibration does not know, propagated."""
    sigma, place = _propagated(_few(recording), calibration, aids), recording.site
    return float(horizontal(sigma, Site(required_latitude(place.latitude), place.height, place.gravity, 0.0)).max())


@dataclass(frozen=True, eq=False)
class _Few:
    """Some rows that stand for a run, and, of a strapdown unit, the intervals that they are means over."""

    rows: Recording
    legs: Intervals | None

    def error(self, rows: Recording, aids: Aids) -> Navigated:
        """The navigation with these readings in place of its own."""
        if self.legs is not None:
            return legs_navigated(self.legs, rows, aids, "")
        return navigated(rows, None, aids)


def _few(recording: Recording) -> _Few:
    if is_strapdown(recording):
        legs = thinned(recording, block_of(recording, float(recording.time[-1] - recording.time[0]) / ROWS))
        return _Few(legs.rows, legs)
    rows = recording.select(np.arange(0, len(recording.time), max(1, len(recording.time) // ROWS)))
    return _Few(with_inner(rows), None)


def sensitivity(
    run: Recording, effects: Sequence[Effect], wanted: Sequence[Parameter], step: Array, aids: Aids = USUAL
) -> Band:
    """Times (n,) [s], and what each parameter does to the errors (n, 7, p) of a perfect run, wrong by its step (p,)."""
    few = _few(run) if is_strapdown(run) else _Few(run, None)
    return few.error(few.rows, aids).time, _sensitivity(few, few.rows, effects, wanted, step, aids)


def _sensitivity(
    few: _Few, run: Recording, effects: Sequence[Effect], wanted: Sequence[Parameter], step: Array, aids: Aids
) -> Array:
    if not wanted:
        return np.zeros((len(few.error(run, aids).time), len(CHANNELS), 0))
    if few.legs is None:
        s, kind, quantities = stimulus_from_angles(run), "static-run", (FORCE, ANGLE)
    else:
        s, kind, quantities = stimulus_from_readings(run), "rotation", (FORCE, RATE)
    keys = tuple(key for key in run.channels if key[0] in quantities)
    stages = dict.fromkeys(CATALOGUE[p.effect].stage for p in wanted)
    rows = linearise(run.platform, s, effects, kind, keys, stages=stages)

    def moved(k: int) -> tuple[Recording, Recording]:
        """The readings with what a step of the parameter does to them, and with what a step back does."""
        added = step[k] * rows.jacobian(wanted[k : k + 1])[..., 0]
        there, back = (
            replace(run, channels=dict(run.channels) | {key: run.channels[key] + way * added[:, i]
                                                        for i, key in enumerate(keys)})
            for way in (1, -1)
        )  # fmt: skip
        return there, back

    pairs = (moved(k) for k in range(len(wanted)))
    if few.legs is None:
        return half_apart(list(pairs), aids)
    odd = [(few.error(there, aids).error - few.error(back, aids).error) / 2 for there, back in pairs]
    return np.stack(odd, axis=-1)


def _propagated(few: _Few, calibration: Calibration, aids: Aids) -> Array:
    """One sigma (m, 7) by the derivative."""
    sigma = calibration.sigmas
    seen = np.flatnonzero(sigma > 0)
    run = calibration.apply(few.rows)
    wanted = [calibration.parameters[i] for i in seen]
    D = _sensitivity(few, run, calibration.effects, wanted, sigma[seen], aids)
    correlation = np.asarray(calibration.covariance)[np.ix_(seen, seen)] / np.outer(sigma[seen], sigma[seen])
    return np.asarray(np.sqrt(np.maximum(np.einsum("ncp,pq,ncq->nc", D, correlation, D), 0.0)))


def _sampled(
    few: _Few, calibration: Calibration, aids: Aids, samples: int, seed: int, drawn: Callable[[int], None]
) -> Array:
    """One sigma (m, 7) of errors with drawn parameters about that with the estimated ones."""
    x, names = calibration.values, few.rows.platform.axis_names
    w, V = np.linalg.eigh(np.asarray(calibration.covariance))
    root, rng = V * np.sqrt(np.maximum(w, 0.0)), np.random.default_rng(seed)

    def error(values: Array) -> Array:
        effects = with_values(calibration.effects, calibration.parameters, values, names)
        return few.error(replace(calibration, effects=effects).apply(few.rows), aids).error

    middle = error(x)
    squares = np.zeros_like(middle)
    for k in range(samples):
        squares += (error(x + root @ rng.standard_normal(len(x))) - middle) ** 2
        drawn(k + 1)
    return np.asarray(np.sqrt(squares / samples))


def _at(time: Array, t: Array, sigma: Array) -> Array:
    return np.stack([np.interp(time, t, column) for column in sigma.T], axis=-1)
