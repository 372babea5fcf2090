r"""The positions of a recording, prepared once for every stage: readings per visit, noise, and visits that stay out.

Nothing tells the noise that a header leaves open, or a visit that was not held where its readouts say, but a fit of
all coefficients to the force vector at every visit: here it is made, and the stages after it do their own work alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gimbalcal.effects import CATALOGUE, Effect, Parameter, Stimulus, parameters, with_values
from gimbalcal.effects.effect import happens_once
from gimbalcal.errors import InputError
from gimbalcal.estimate.accelerometers.position_fit import PositionFit, noise_of_positions
from gimbalcal.estimate.accelerometers.position_outliers import Fault, fit_without_outliers
from gimbalcal.estimate.extra_effects import Cost, ExtraEffect, sizes_shown_by
from gimbalcal.estimate.fit import cost_of_sizes
from gimbalcal.recording import Recording
from gimbalcal.views.positions import Noise, Problem, position_parameters, problem, starting_values, view_of_positions


@dataclass(frozen=True, eq=False)
class Positions:
    """Visits that can be trusted, the faults of the others, and the fit of the force vector that distinguished them."""

    recording: Recording
    problem: Problem  # the trusted visits
    fit: PositionFit  # of all its parameters, with the setting error of each visit
    faults: tuple[Fault, ...]

    @property
    def noise(self) -> Noise:
        """Noise of a sample and of a gimbal setting, as stated or as the residual of the fit shows."""
        return self.fit.noise


def misfit_of_positions(positions: Positions, more: Sequence[ExtraEffect]) -> tuple[Cost, Stimulus]:
    """Chi^2 of every row about the fit with the sizes of extra effects beside it, and what the rows experienced."""
    p, e = problem(positions.recording, positions.problem.parameters, averaged=False), positions.fit.setting
    if any(happens_once(CATALOGUE[a.effect]) for a in more):  # a fault of one position may be what is asked for
        e = np.zeros((p.visits, p.turns))
    else:
        p = p.without([visit for fault in positions.faults for visit in fault.visits])
    sizes, x = sizes_shown_by(more, positions.recording), positions.fit.solution.x
    view = view_of_positions(replace(p, parameters=(*p.parameters, *sizes)), positions.noise)
    effects = with_values(p.effects, p.parameters, x, p.platform.axis_names)
    return cost_of_sizes([view], effects, p.parameters, sizes, [np.zeros(1)], x, [e]), p.stimulus


def trusted_positions(
    recording: Recording, effects: Sequence[Effect] = (), more: Sequence[Parameter] = ()
) -> Positions:
    """Readings per visit, their noise, and which visits to trust.

    `effects` join the baseline of coefficients, their parameters free too; or of these the parameters `more`, for which
    every row counts, as they may change inside a dwell. Raises InputError for a recording without gimbal angles or
    without specific force.
    """
    if not recording.platform.axes:
        raise InputError(
            f"{recording.title!r} has no gimbal angles, so its attitude is not known; calibrate it from the norm of "
            "the force with --method multiposition"
        )
    names = recording.platform.axis_names
    free = more or tuple(p for e in effects for p in parameters(type(e), names))
    wanted = (*position_parameters(recording.platform, grade=recording.grade), *free)
    every = problem(recording, wanted, tuple(effects), averaged=not more)
    start = starting_values(every, effects)
    return Positions(recording, *fit_without_outliers(every, noise_of_positions(recording), start))
