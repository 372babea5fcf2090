"""Least squares of the one view that a kind of recording makes, for kinds without a method of their own."""

from __future__ import annotations

import numpy as np

from gimbalcal.calibration import Calibration, Provenance, Residual
from gimbalcal.estimate.extra_effects import NO_EXTENSION, extension, extra_effects
from gimbalcal.estimate.fit import fit
from gimbalcal.method_table import Request


def calibrate_view(request: Request) -> Calibration:
    """Fit the effects that the model of the view holds, or the terms that are asked for, and what is added to them."""
    (recording,) = request.recordings
    view = recording.kind.view_of(recording, request.terms)
    more = extra_effects(request.more, [recording], view.baseline)
    wanted = tuple(p for i in view.baseline for p in view.parameters_of(i))
    extra, fitted = NO_EXTENSION, fit([view], wanted)
    if more:
        sizes = tuple(p for e in more for p in e.parameters(view.stimulus.axis_names))
        extra = extension(more, sizes, view.stimulus, fitted.cost_of_sizes(sizes))
        fitted = fit([view], (*wanted, *extra.parameters), extra.effects)
    rms = np.sqrt(np.mean(np.square(fitted.residual[0]), axis=0))
    by_channel = {":".join(key): float(v) for key, v in zip(view.channels, rms, strict=True)}
    words = f"{len(view)} rows of {view.title}"
    return extra.complete(
        fitted.calibration(
            "least-squares",
            Residual(fitted.solution.chi2, fitted.solution.dof, by_channel),
            outcome="" if fitted.steps else "the fit did not converge, so its numbers mean nothing",
            provenance=Provenance(recordings=recording.source),
            stages=(fitted.stage(view.name, words),),
        )
    )
