r"""The positions of a recording, prepared once for every stage: readings per visit, noise, and visits that stay out.

Nothing tells the noise that a header leaves open, or a visit that was not held where its readouts say, but a fit of
all coefficients to the force vector at every visit: here it is made, and the stages after it do their own work alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from gimbalcal.effects import CATALOGUE, Effect, Parameter, Stimulus, parameters, values
from gimbalcal.effects.effect import happens_once
from gimbalcal.errors import InputError
from gimbalcal.estimate.accelerometers.position_fit import Positions, noise_of_positions
from gimbalcal.estimate.accelerometers.position_outliers import fit_without_outliers
from gimbalcal.estimate.extra_effects import Cost, ExtraEffect, sizes_shown_by
from gimbalcal.recording import Recording
from gimbalcal.views.positions import position_parameters, view_of_positions, without_visits


def misfit_of_positions(
    recording: Recording, positions: Positions, more: Sequence[ExtraEffect]
) -> tuple[Cost, Stimulus]:
    """Chi^2 of every row about the fit with the sizes of extra effects beside it, and what the rows experienced."""
    fit, sizes = positions.fit, sizes_shown_by(more, recording)
    ids = [p.effect for p in (*fit.parameters, *sizes)]
    view, e = view_of_positions(recording, positions.noise, ids, averaged=False), positions.setting
    if any(happens_once(CATALOGUE[a.effect]) for a in more):  # a fault of one position may be what is asked for
        e = view.local.zero if view.local else e
    else:
        view = without_visits(view, [visit for fault in positions.faults for visit in fault.visits])
    return replace(fit, views=(view,), local=(e,)).cost_of_sizes(sizes), view.stimulus


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
    ids, noise = [*(p.effect for p in wanted), *(e.id for e in effects)], noise_of_positions(recording)
    view = view_of_positions(recording, noise, ids, averaged=not more)
    return fit_without_outliers(view, noise, wanted, effects, values(effects, wanted))
