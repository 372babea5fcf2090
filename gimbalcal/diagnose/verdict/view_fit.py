"""How well the model of a view fits whose noise is not stated: rms misfits, rows held out, changed constants."""

from __future__ import annotations

from contextlib import suppress

import numpy as np

from gimbalcal.diagnose.result import Delay, RmsMisfit, RowNoise, SearchStep, Shift, ViewFit
from gimbalcal.diagnose.search.stepwise import SearchResult
from gimbalcal.diagnose.verdict.findings import shifts_of
from gimbalcal.diagnose.verdict.verify import held_out
from gimbalcal.effects import values
from gimbalcal.errors import InputError
from gimbalcal.inference.algebra import basis
from gimbalcal.number import Array
from gimbalcal.units import from_si
from gimbalcal.views.core import Fit
from gimbalcal.views.slews import lateness

SAME_WEIGHT = 1e-9  # of ln(sigma x weight), within which rows were fitted in these sigmas


def row_sigma(end: Fit) -> Array:
    """Return one sigma (n, C) of each row: the scatter about the last model, spread as the noise of the samples."""
    r = end.view.noise.weighted(end.residual)
    free = max(r.size - basis(end.reduced(end.jacobian)).shape[1], 1)
    return np.asarray(np.sqrt((r**2).sum() / free) / end.view.weight)


def view_fit(c: SearchResult, sigma: Array) -> ViewFit:
    """Return how well the last model of a search explains a view, in rows of `sigma` (n, C)."""
    v, before, after = c.start.view, c.start, c.described
    (held_before, held_rms_before), (held_after, held_rms_after) = (_held_out(m, sigma) for m in (before, after))
    late = turns = None
    if v.measurement.timing:
        every = {axis: (float(from_si(x, "ms")), float(from_si(s, "ms"))) for axis, (x, s) in lateness(v).items()}
        late = {axis: Delay(x, s, "ms") for axis, (x, s) in every.items()}
    if v.missed_by_turns is not None and c.steps:
        with suppress(InputError):  # turns too few, or all about one axis, prove nothing
            missed = [float(from_si(v.missed_by_turns(e), "arcsec")) for e in ((), after.effects)]
            turns = RmsMisfit(missed[0], missed[1], "arcsec")
    return ViewFit(
        chi2_reduced_before=_reduced(before, sigma),
        chi2_reduced_after=_reduced(after, sigma),
        heldout_before=held_before,
        heldout_after=held_after,
        heldout_rms_before=held_rms_before,
        heldout_rms_after=held_rms_after,
        noise=RowNoise(v.name, float(from_si(float(np.median(sigma)), v.unit)), v.unit),
        rms_before=float(from_si(before.rms, v.unit)),
        rms_after=float(from_si(after.rms, v.unit)),
        steps=tuple(
            SearchStep(s.cause[0].effect, s.cause[0].axis, float(from_si(s.model.rms, v.unit)), v.unit) for s in c.steps
        ),
        calibration_moved=shifts(before, after) if c.steps else (),
        late=late,
        turns=turns,
        chi2_of_samples_before=_against_samples(before),
        chi2_of_samples_after=_against_samples(after),
    )


def _against_samples(m: Fit) -> dict[str, float] | None:
    """Return reduced chi^2 of each channel in the noise of the samples alone; None where their scatter is not known."""
    v = m.view
    if v.noise.sample is None:
        return None
    n = len(m.residual)
    Q = _basis(m, v.noise.sample).reshape(n, len(v.channels), -1)
    fitted = (Q**2).sum(axis=(0, 2))  # degrees of freedom that the parameters take of each channel
    chi2 = ((m.residual / v.noise.sample) ** 2).sum(axis=0) / np.maximum(n - fitted, 1)
    return dict(zip([a for _, a in v.channels], chi2.tolist(), strict=True))


def _reduced(m: Fit, sigma: Array) -> float:
    rank = _basis(m, sigma).shape[1]
    return float(((m.residual / sigma) ** 2).sum() / max(m.residual.size - rank, 1))


def _basis(m: Fit, sigma: Array) -> Array:
    """Return an orthonormal basis (n C, q) of a model's columns in rows of `sigma` (n, C)."""
    return basis((m.jacobian / sigma[..., None]).reshape(m.residual.size, -1))


def _held_out(m: Fit, sigma: Array) -> tuple[float, float]:
    """Return the mean square misfit of rows held out, in sigma, and the rms length of a row in the unit of print."""
    left = held_out_misfit(m, sigma)
    rms = float(np.sqrt(((left * sigma) ** 2).sum() / len(left)))
    return float(np.mean(left**2)), float(from_si(rms, m.view.unit))


def held_out_misfit(m: Fit, sigma: Array) -> Array:
    """Return the misfit (n, C), in sigma, of each group of rows to a fit without it."""
    n, C = m.residual.shape
    A, r = (m.jacobian / sigma[..., None]).reshape(n * C, -1), (m.residual / sigma).ravel()
    if np.ptp(np.log(sigma * m.view.weight)) > SAME_WEIGHT:  # to the minimum in these sigmas
        Q = _basis(m, sigma)
        r = r - Q @ (Q.T @ r)
    return held_out(A, r, np.repeat(m.view.groups, C)).reshape(n, C)


def shifts(before: Fit, after: Fit) -> tuple[Shift, ...]:
    """Return the change of each constant of the baseline once the causes are in the model, the clearest first."""
    visible = np.abs(before.jacobian).max(axis=(0, 1)) > 1e-9  # means taken off leave rounding of a bias
    old = values(before.effects, before.parameters)
    new = {p.label: k for k, p in enumerate(after.parameters)}
    shown = [(p, k, new[p.label]) for k, (p, seen) in enumerate(zip(before.parameters, visible, strict=True)) if seen]
    at = [k for *_, k in shown]
    change = values(after.effects, after.parameters)[at] - old[[k for _, k, _ in shown]]
    return shifts_of([p for p, *_ in shown], change, np.sqrt(np.diag(after.covariance))[at])
