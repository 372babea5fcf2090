r"""Whether the fit improves, on data it has seen and on data held out, and whether what is left is noise.

Held out in turn: each visit of a multi-position recording, each stretch of a static run. The prediction error is
compared with its own covariance, so that one is what noise alone gives.

.. math:: \chi^2_{out} = \frac{1}{n} \sum_f r_f^T (I + A_f C_{-f} A_f^T)^{-1} r_f
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress

import numpy as np

from gimbalcal.diagnose.result import Delay, RmsMisfit, RowNoise, SearchStep, Shift, StatedNoiseFit, ViewFit
from gimbalcal.diagnose.search.fitted_causes import FittedCauses
from gimbalcal.diagnose.search.stepwise import SearchResult
from gimbalcal.effects import Parameter
from gimbalcal.errors import InputError
from gimbalcal.inference.algebra import beyond, eigh, orthonormal_columns
from gimbalcal.number import Array
from gimbalcal.units import from_si
from gimbalcal.views.core import Fit
from gimbalcal.views.slews import channel_delays

SAME_WEIGHT = 1e-9  # of ln(sigma x weight), within which rows were fitted in these sigmas
MIN_SHOWN_SHARE = 1e-6  # share of a direction that the rows outside a group show; less is fitted by the group itself


def verify(f: FittedCauses, physical: Array, scan_p_before: float = 1.0, scan_p_after: float = 1.0) -> StatedNoiseFit:
    """Return fit and prediction in the noise of the final model; `physical` (n, C, p) are its columns, row by row.

    scan_p_before, scan_p_after: p-values of the scans for a mismatch.
    """
    Z, X, y, fold, by = _whitened_model(f, physical)
    C = f.search.fit.residual.shape[1]
    A = np.concatenate([Z, X], axis=1)
    (residual, q, out), (rest, qx, out_with) = ((*_residual(B, y), held_out(B, y, fold)) for B in (Z, A))
    series = rest.reshape(-1, C)
    same = fold.reshape(-1, C)[1:, 0] == fold.reshape(-1, C)[:-1, 0] if by != "time" else slice(None)
    pairs = (series[1:] * series[:-1])[same]
    lag = float(pairs.sum() / (series**2).sum()) if series.size else 0.0
    return StatedNoiseFit(
        chi2_reduced_before=float(residual @ residual) / max(1, len(y) - q),
        chi2_reduced_after=float(rest @ rest) / max(1, len(y) - qx),
        heldout_before=float(residual @ out) / len(y),
        heldout_after=float(rest @ out_with) / len(y),
        heldout_by=by,
        autocorrelation_after=lag,  # of the whitened residual from one block to the next
        autocorrelation_sigma=1 / np.sqrt(max(1, pairs.size)),
        scan_p_before=scan_p_before,
        scan_p_after=scan_p_after,
        noise=dict(f.projection.node.name),
    )


def _whitened_model(f: FittedCauses, physical: Array) -> tuple[Array, Array, Array, Array, str]:
    """Whitened Z, X, y and the fold of each row: in visits of the reduced rows, or in stretches of the raw ones."""
    o = f.search.fit
    C = o.residual.shape[1]
    if not o.view.noise.in_blocks:
        fold = np.repeat(o.view.groups, C)
        rows = [o.view.noise.weighted(A).reshape(o.residual.size, -1) for A in (o.Z, physical, o.residual[:, :, None])]
        return rows[0], rows[1], rows[2][:, 0], fold, "time"
    node = f.projection.node
    visits = o.view.stimulus.visit[o.view.noise.starts]
    inside = any(c.once for c, _ in f.causes)  # at one place or instant, which no other position can predict
    ordinal = np.array([np.sum(visits[:i] == v) for i, v in enumerate(visits)]) if inside else visits
    rows = [node.whiten(A) for A in (o.reduced(o.Z), o.reduced(physical), o.reduced(o.residual[:, :, None]))]
    return rows[0], rows[1], rows[2][:, 0], np.repeat(ordinal, C), "parts of each dwell" if inside else "position"


def held_out(A: Array, y: Array, group: Array) -> Array:
    r"""Return the misfit (R,) of each group of white rows y (R,) to a fit of columns A (R, p) without it.

    With the misfit e of the fit to all rows and its leverage H, an orthonormal basis Q of A times its transpose,

    .. math:: r_g = (1 - H_{gg})^{-1} e_g = e_g + Q_g (1 - Q_g^T Q_g)^{-1} Q_g^T e_g , \qquad
        \chi^2_g = r_g^T (1 + A_g C_{-g} A_g^T)^{-1} r_g = e_g^T r_g .

    Directions that the other rows do not show are fitted by the group itself.
    """
    Q = orthonormal_columns(A)
    e = beyond(Q, y)
    out = e.copy()
    for k in np.unique(group):
        rows = group == k
        lam, V = eigh(np.eye(Q.shape[1]) - Q[rows].T @ Q[rows])
        V = V[:, lam > MIN_SHOWN_SHARE] / np.sqrt(lam[lam > MIN_SHOWN_SHARE])
        out[rows] += Q[rows] @ (V @ (V.T @ (Q[rows].T @ e[rows])))
    return out


def _residual(A: Array, y: Array) -> tuple[Array, int]:
    Q = orthonormal_columns(A)
    return beyond(Q, y), Q.shape[1]


def residual_rows(o: Fit, added: Array) -> tuple[Array, Array]:
    """Residuals (n, C) in sigma without and with what was `added` (n, C), the calibration refitted each time."""
    noise, shape = o.view.noise, o.residual.shape
    Z, root = noise.weighted(o.Z).reshape(o.residual.size, -1), 1.0 if noise.weights is None else np.sqrt(noise.weights)
    rest = (_residual(Z, noise.weighted(y[:, :, None]).ravel())[0] for y in (o.residual, o.residual - added))
    without, with_added = (r.reshape(shape) / root for r in rest)
    return without, with_added


def known_noise_shifts(f: FittedCauses) -> tuple[Shift, ...]:
    """Return how far each calibration constant moves once the findings are in the model."""
    before, after, sigma = f.calibration()
    wanted = f.search.fit.parameters
    scale = np.array([p.sigma for p in wanted])
    return shifts_of(wanted, (after - before) * scale, sigma * scale)


def shifts_of(parameters: Sequence[Parameter], change: Array, sigma: Array) -> tuple[Shift, ...]:
    """Return changes (p,) of constants with one sigma (p,), both in SI, as entries; the clearest first."""
    out = []
    for p, d, e in zip(parameters, change, sigma, strict=True):
        in_sigmas = round(float(d / e), 2) if e > 0 else 0.0
        out.append(Shift(p.name, p.axis, float(from_si(d, p.unit)), float(from_si(e, p.unit)), p.unit, in_sigmas))
    return tuple(sorted(out, key=lambda row: -abs(row.in_sigmas)))


def row_sigma(end: Fit) -> Array:
    """Return one sigma (n, C) of each row: the scatter about the last model, spread as the noise of the samples."""
    r = end.view.noise.weighted(end.residual)
    free = max(r.size - orthonormal_columns(end.reduced(end.jacobian)).shape[1], 1)
    return np.asarray(np.sqrt((r**2).sum() / free) / end.view.weight)


def view_fit(c: SearchResult, sigma: Array) -> ViewFit:
    """Return how well the last model of a search explains a view, in rows of `sigma` (n, C)."""
    v, before, after = c.start.view, c.start, c.with_shapes
    (held_before, held_rms_before), (held_after, held_rms_after) = (_held_out(m, sigma) for m in (before, after))
    late = turns = None
    if v.measurement.timing:
        every = {axis: (float(from_si(x, "ms")), float(from_si(s, "ms"))) for axis, (x, s) in channel_delays(v).items()}
        late = {axis: Delay(x, s, "ms") for axis, (x, s) in every.items()}
    if v.missed_by_turns is not None and c.steps:
        with suppress(InputError):  # turns too few, or all about one axis, prove nothing
            missed = [float(from_si(v.missed_by_turns(e), "arcsec")) for e in ((), after.effects)]
            turns = RmsMisfit(missed[0], missed[1], "arcsec")
    channels = None
    if v.separate_settings and after.view.noise.scales:
        each = zip(v.channels, after.rms_of_channels, strict=True)
        channels = {axis: float(from_si(x, v.unit)) for (_, axis), x in each}
    return ViewFit(
        chi2_reduced_before=_reduced_chi2(before, sigma),
        chi2_reduced_after=_reduced_chi2(after, sigma),
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
        calibration_moved=view_shifts(before, after) if c.steps else (),
        late=late,
        turns=turns,
        rms_of_channels=channels,
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


def _reduced_chi2(m: Fit, sigma: Array) -> float:
    rank = _basis(m, sigma).shape[1]
    return float(((m.residual / sigma) ** 2).sum() / max(m.residual.size - rank, 1))


def _basis(m: Fit, sigma: Array) -> Array:
    """Return an orthonormal basis (n C, q) of a model's columns in rows of `sigma` (n, C)."""
    return orthonormal_columns((m.jacobian / sigma[..., None]).reshape(m.residual.size, -1))


def _held_out(m: Fit, sigma: Array) -> tuple[float, float]:
    """Return the mean square misfit of rows held out, in sigma, and the rms length of a row in the unit of print."""
    misfit = held_out_misfit(m, sigma)
    rms = float(np.sqrt(((misfit * sigma) ** 2).sum() / len(misfit)))
    return float(np.mean(misfit**2)), float(from_si(rms, m.view.unit))


def held_out_misfit(m: Fit, sigma: Array) -> Array:
    """Return the misfit (n, C), in sigma, of each group of rows to a fit without it."""
    n, C = m.residual.shape
    A, r = (m.jacobian / sigma[..., None]).reshape(n * C, -1), (m.residual / sigma).ravel()
    if np.ptp(np.log(sigma * m.view.weight)) > SAME_WEIGHT:  # to the minimum in these sigmas
        Q = _basis(m, sigma)
        r = beyond(Q, r)
    return held_out(A, r, np.repeat(m.view.groups, C)).reshape(n, C)


def view_shifts(before: Fit, after: Fit) -> tuple[Shift, ...]:
    """Return the change of each constant of the baseline once the causes are in the model, the clearest first."""
    visible = np.abs(before.jacobian).max(axis=(0, 1)) > 1e-9  # means taken off leave rounding of a bias
    new = {p.label: k for k, p in enumerate(after.parameters)}
    shown = [(p, k, new[p.label]) for k, p in enumerate(before.parameters) if visible[k]]
    at = [k for *_, k in shown]
    change = after.x[at] - before.x[[k for _, k, _ in shown]]
    return shifts_of([p for p, *_ in shown], change, after.sigmas[at])
