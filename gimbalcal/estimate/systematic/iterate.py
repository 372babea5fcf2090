"""Repeat filter and smoother, each pass about the estimates of the one before, until the estimates no longer move."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gimbalcal.effects import Effect, Parameter, with_values
from gimbalcal.estimate.systematic.alignment import Alignment, align, attitudes, gyro_scale_errors, refuse_carried
from gimbalcal.estimate.systematic.error_model import invert_readings, rotated
from gimbalcal.estimate.systematic.filter_pass import Pass, filter_and_smooth
from gimbalcal.estimate.systematic.innovation_tests import suspect_updates
from gimbalcal.number import Array
from gimbalcal.progress import Progress, no_progress
from gimbalcal.views.segments import Segments

MAX_PASSES = 12
CONVERGED_SIGMAS = 0.03  # largest step of an estimate, in its sigmas, at which the passes end
FROZEN_STEP_RATIO = 0.01  # of the step before: below, the sensitivities hardly change and are not computed again
UNUSUAL_BIAS_SIGMAS = 5.0
DIVERGENCE_PRIOR_SIGMAS = 1e4  # times the catalogue's size, five times what a sensor reads: divergence bound


@dataclass(frozen=True, eq=False)
class SystematicFit:
    """State of the passes where they ended: parameter values theta (p,), attitudes C (K + 1, 3, 3), motion u (n, 6).

    base_effects: effects of fixed values; prior_mean (p,) of the parameters; unregularised (p,): the estimate without
    the prior, meaningless in unobservable directions; u: force and rate behind the readings; excluded (K,): updates
    that are not used; converged: whether the estimates no longer moved.
    """

    segments: Segments
    wanted: tuple[Parameter, ...]
    base_effects: tuple[Effect, ...]
    start: Alignment
    prior_mean: Array
    theta: Array
    unregularised: Array
    u: Array
    C: Array
    excluded: NDArray[np.bool_]
    last: Pass
    passes: int
    converged: bool

    @property
    def effects(self) -> tuple[Effect, ...]:
        """The effects with the estimated values."""
        return with_values(self.base_effects, self.wanted, self.theta)


def iterate(
    segments: Segments, wanted: Sequence[Parameter], base_effects: tuple[Effect, ...] = (),
    progress: Progress = no_progress,
) -> SystematicFit:  # fmt: skip
    """Run passes of filter and smoother until the estimates no longer move.

    Raises InputError for a unit that cannot be navigated: see `alignment`.
    """
    u = invert_readings(segments, ())
    scale_errors = gyro_scale_errors(segments, u)
    initial = np.array([scale_errors["xyz".index(p.axis)] if p.effect == "gyro_scale_factor" else 0.0 for p in wanted])
    if initial.any():
        u = invert_readings(segments, with_values(base_effects, wanted, initial), u)
    start = align(segments, u)
    C = attitudes(segments, u, start)
    # the prior sigmas of the unit's grade; of a rate bias, at least a tenth of what the alignment shows
    grade, size = segments.grade, float(np.abs(start.bias).max()) / 10
    least = [size * (p.effect == "gyro_bias") for p in wanted]
    wanted = tuple(replace(p, sigma=max(p.sigma, grade.usual(p).sigma, s)) for p, s in zip(wanted, least, strict=True))
    scale = np.array([p.sigma for p in wanted])
    bias = np.array([start.bias["xyz".index(p.axis)] if p.effect == "gyro_bias" else 0.0 for p in wanted])
    # unobservable components of a bias stay at zero, not at the alignment's value, unless the bias is as large as this
    prior_mean = bias + initial if np.any(np.abs(bias) > UNUSUAL_BIAS_SIGMAS * scale) else initial
    theta = unregularised = bias + initial
    converged, passes, excluded = False, 0, np.zeros(len(segments.stop), dtype=bool)
    frozen, last_move, last, step = None, np.inf, None, np.zeros(len(wanted))
    while not converged and passes < MAX_PASSES:
        effects = with_values(base_effects, wanted, theta)
        last = None  # half a gigabyte for a day
        u = invert_readings(segments, effects, u)
        last = filter_and_smooth(segments, wanted, effects, u, C, start, prior_mean - theta, excluded, frozen)
        if not passes:
            refuse_carried(segments, last.drift)
        distance = np.abs(theta + last.regularised_step - prior_mean)
        if not np.all(distance < DIVERGENCE_PRIOR_SIGMAS * scale):  # nan included
            break
        # where the model is curved, as for a heading that one axis hardly determines, full steps oscillate
        share = 0.5 if passes > 2 and float(last.regularised_step / last.sigma**2 @ step) < 0 else 1.0
        step = share * last.regularised_step
        C = rotated(C, share * last.smoothed[:, :3])
        theta, unregularised, passes = theta + step, theta + last.step, passes + 1
        move = float(np.max(np.abs(last.regularised_step) / last.sigma))
        progress(f"filter and smoother, pass {passes}: the estimates moved by up to {move:.2g} of their sigma")
        frozen = last.model if passes > 1 and move < FROZEN_STEP_RATIO * last_move else None
        last_move, excluded_before = move, excluded
        excluded = suspect_updates(last, excluded) if move < 1.0 else excluded
        converged = move < CONVERGED_SIGMAS and passes > 1 and np.array_equal(excluded_before, excluded)
    assert last is not None  # there is always a first pass
    return SystematicFit(
        segments, wanted, base_effects, start, prior_mean, theta, unregularised, u, C, excluded, last, passes, converged
    )
