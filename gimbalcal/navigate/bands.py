"""What the uncertainty of a calibration leaves of navigation errors: one sigma over time, on two roads that must meet.

Linearly: the exact derivative of the forward model says what a parameter does to the readings, and the navigator what
that does to the errors. By samples: parameters drawn from the covariance correct the readings, and these are navigated.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from gimbalcal.calibration import Calibration
from gimbalcal.effects import Effect, Parameter, with_values
from gimbalcal.forward import jacobian
from gimbalcal.kinematics import stimulus_from_angles
from gimbalcal.navigate.space_stable import USUAL, Aids
from gimbalcal.navigate.static_run import ANGLE, CHANNELS, FORCE, NONE, Navigated, navigated, with_inner
from gimbalcal.number import Array
from gimbalcal.recording import Recording

ROWS = 240  # of the run, for bands: what a parameter does follows the day and half of it
Band = tuple[Array, Array]  # time (m,) and one sigma (m, 7)


def before_and_after(
    recording: Recording,
    calibrations: Sequence[tuple[str, Calibration]],
    aids: Aids = USUAL,
    samples: int = 0,
    seed: int = 1,
    tell: Callable[[str], None] = lambda _: None,
) -> tuple[Navigated, ...]:
    """A static run navigated as it was read and with each labelled calibration, with bands where `samples` are asked.

    Raises InputError for what cannot be navigated: another kind of recording, another platform, no latitude, no force.
    """
    out = [navigated(recording, None, aids, NONE)]
    for label, calibration in calibrations:
        tell(f"navigating with {label}")
        made = navigated(recording, calibration, aids, label)
        if samples:
            linear, sampled = bands(recording, calibration, aids, samples, seed)
            made = replace(made, linear=_at(made.time, *linear), sampled=_at(made.time, *sampled))
        out.append(made)
    return tuple(out)


def bands(recording: Recording, calibration: Calibration, aids: Aids, samples: int, seed: int) -> tuple[Band, Band]:
    r"""One sigma of each error by what the calibration does not know: propagated, and sampled.

    .. math:: \sigma^2 = \mathrm{diag}(J P J^T), \qquad J = \partial \text{error} / \partial \text{parameters}

    A thinned run serves, as noise cancels.
    """
    few = recording.select(np.arange(0, len(recording.time), max(1, len(recording.time) // ROWS)))
    t = few.time - recording.time[0]
    return (t, _propagated(few, calibration, aids)), (t, _sampled(few, calibration, aids, samples, seed))


def sensitivity(
    run: Recording, effects: Sequence[Effect], wanted: Sequence[Parameter], step: Array, aids: Aids = USUAL
) -> Array:
    """What each wanted parameter does to the errors (n, 7, p) of a corrected run when it is wrong by its step (p,)."""
    if not wanted:
        return np.zeros((len(run.time), len(CHANNELS), 0))
    J = jacobian(run.platform, stimulus_from_angles(run), effects, wanted, "static-run")

    def error(k: int, side: float) -> Array:
        """The readings keep what the parameter does to them."""
        force, angle = (
            v + side * step[k] * J[q][..., k] for q, v in ((FORCE, run.triad(FORCE)), (ANGLE, run.angles()))
        )
        moved = {(FORCE, a): force[:, i] for i, a in enumerate("xyz")}
        moved |= {(ANGLE, a): angle[:, run.platform.axis_names.index(a)] for a in run.axes(ANGLE)}
        return navigated(replace(run, channels=dict(run.channels) | moved), None, aids).error

    return np.stack([(error(k, 1.0) - error(k, -1.0)) / 2 for k in range(len(wanted))], axis=-1)


def _propagated(few: Recording, calibration: Calibration, aids: Aids) -> Array:
    """One sigma (m, 7) by the derivative."""
    sigma = calibration.sigmas
    seen = np.flatnonzero(sigma > 0)
    run = calibration.apply(with_inner(few))
    D = sensitivity(run, calibration.effects, [calibration.parameters[i] for i in seen], sigma[seen], aids)
    correlation = np.asarray(calibration.covariance)[np.ix_(seen, seen)] / np.outer(sigma[seen], sigma[seen])
    return np.asarray(np.sqrt(np.maximum(np.einsum("ncp,pq,ncq->nc", D, correlation, D), 0.0)))


def _sampled(few: Recording, calibration: Calibration, aids: Aids, samples: int, seed: int) -> Array:
    """One sigma (m, 7) of errors with drawn parameters about that with the estimated ones."""
    x, names = calibration.values, few.platform.axis_names
    w, V = np.linalg.eigh(np.asarray(calibration.covariance))
    root, rng = V * np.sqrt(np.maximum(w, 0.0)), np.random.default_rng(seed)

    def error(values: Array) -> Array:
        effects = with_values(calibration.effects, calibration.parameters, values, names)
        return navigated(few, replace(calibration, effects=effects), aids).error

    middle = error(x)
    drawn = [error(x + root @ rng.standard_normal(len(x))) - middle for _ in range(samples)]
    return np.asarray(np.sqrt(np.mean(np.square(drawn), axis=0)))


def _at(time: Array, t: Array, sigma: Array) -> Array:
    return np.stack([np.interp(time, t, column) for column in sigma.T], axis=-1)
