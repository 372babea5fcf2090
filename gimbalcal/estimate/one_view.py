"""Least squares of the one view that a kind of recording makes, for kinds without a method of their own."""

from __future__ import annotations

from gimbalcal.calibration import Calibration, Provenance, Residual
from gimbalcal.calibration.provenance import AssumedNoise
from gimbalcal.estimate.extra_effects import extra_effects
from gimbalcal.estimate.fit import fit
from gimbalcal.method_table import Request


def calibrate_view(request: Request) -> Calibration:
    """Fit the effects that the model of the view holds, or the terms that are asked for, and what is added to them."""
    (recording,) = request.recordings
    view = recording.kind.view_of(recording, request.terms)
    more = extra_effects(request.more, [recording], view.baseline)
    fitted = fit([view], view.baseline_parameters)
    extra = fitted.extension(more)
    if more:
        fitted = fit([view], (*view.baseline_parameters, *extra.parameters), extra.effects)
    words = f"{len(view)} rows of {view.title}"
    return extra.complete(
        fitted.calibration(
            "least-squares",
            Residual(fitted.solution.chi2, fitted.solution.dof, fitted.rms_by_channel),
            outcome="" if fitted.steps else "the fit did not converge, so its numbers mean nothing",
            provenance=Provenance(
                recordings=recording.source, noise=None if view.noise.scale_known else AssumedNoise(from_="residual")
            ),
            stages=(fitted.stage(view.name, words),),
        )
    )
