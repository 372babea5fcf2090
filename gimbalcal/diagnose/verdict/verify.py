r"""Whether the fit improves, on data it has seen and on data held out, and whether what is left is noise.

Held out in turn: each visit of a multi-position recording, each stretch of a static run. The prediction error is
compared with its own covariance, so that one is what noise alone gives.

.. math:: \chi^2_{out} = \frac{1}{n} \sum_f r_f^T (I + A_f C_{-f} A_f^T)^{-1} r_f
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gimbalcal.diagnose.evidence.node import Node
from gimbalcal.diagnose.result import StatedNoiseFit
from gimbalcal.diagnose.search.fitted_causes import FittedCauses
from gimbalcal.diagnose.search.ranking import Search
from gimbalcal.inference.algebra import basis, eigh
from gimbalcal.number import Array
from gimbalcal.views.core import Fit, absent_effect

FOLDS = 12  # stretches of a static run
SHOWN = 1e-6  # share of a direction that the rows outside a group show; less is fitted by the group itself


@dataclass(frozen=True)
class Verification:
    """Reduced chi^2 of the fit and of held-out data, without and with what was found."""

    before: float
    after: float
    heldout_before: float
    heldout_after: float
    heldout_by: str
    autocorrelation: float  # of the whitened residual from one block to the next, after
    autocorrelation_sigma: float

    def summary(self, node: Node, scan_p_before: float, scan_p_after: float) -> StatedNoiseFit:
        """Entry `fit` of diagnosis.json, with the noise and the p-values of the scan for a mismatch."""
        return StatedNoiseFit(
            chi2_reduced_before=self.before,
            chi2_reduced_after=self.after,
            heldout_before=self.heldout_before,
            heldout_after=self.heldout_after,
            heldout_by=self.heldout_by,
            autocorrelation_after=self.autocorrelation,
            autocorrelation_sigma=self.autocorrelation_sigma,
            scan_p_before=scan_p_before,
            scan_p_after=scan_p_after,
            noise=dict(node.name),
        )


def verify(s: Search, f: FittedCauses, physical: Array) -> Verification:
    """Fit and prediction in the noise of the final model; `physical` (n, C, p) are its columns, row by row."""
    Z, X, y, fold, by = _whitened(s, f, physical)
    C = s.fit.residual.shape[1]
    A = np.concatenate([Z, X], axis=1)
    (left, q, out), (rest, qx, out_with) = ((*_residual(B, y), held_out(B, y, fold)) for B in (Z, A))
    series = rest.reshape(-1, C)
    same = fold.reshape(-1, C)[1:, 0] == fold.reshape(-1, C)[:-1, 0] if by != "time" else slice(None)
    pairs = (series[1:] * series[:-1])[same]
    lag = float(pairs.sum() / (series**2).sum()) if series.size else 0.0
    return Verification(
        float(left @ left) / max(1, len(y) - q), float(rest @ rest) / max(1, len(y) - qx),
        float(left @ out) / len(y), float(rest @ out_with) / len(y),
        by, lag, 1 / np.sqrt(max(1, pairs.size)),
    )  # fmt: skip


def _whitened(s: Search, f: FittedCauses, physical: Array) -> tuple[Array, Array, Array, Array, str]:
    """Whitened Z, X, y and the fold of each row: in visits of the reduced rows, or in stretches of the raw ones."""
    o = s.fit
    n, C = o.residual.shape
    if o.view.kind.stabilised:
        fold = np.repeat(np.arange(n) * FOLDS // n, C)
        rows = [o.view.noise.weighted(A).reshape(n * C, -1) for A in (o.Z, physical, o.residual[:, :, None])]
        return rows[0], rows[1], rows[2][:, 0], fold, "time"
    node = f.projection.node
    visits = o.view.stimulus.visit[o.view.noise.starts]
    inside = _inside_dwell(s, f)
    ordinal = np.array([np.sum(visits[:i] == v) for i, v in enumerate(visits)]) if inside else visits
    rows = [node.whiten(A) for A in (o.reduced(o.Z), o.reduced(physical), o.reduced(o.residual[:, :, None]))]
    return rows[0], rows[1], rows[2][:, 0], np.repeat(ordinal, C), "parts of each dwell" if inside else "position"


def _inside_dwell(s: Search, f: FittedCauses) -> bool:
    """Return whether a finding is at one place or instant, which no other position can predict."""
    return any(s.library.candidates[m].once for m in f.members)


def held_out(A: Array, y: Array, group: Array) -> Array:
    r"""Return the misfit (R,) of each group of white rows y (R,) to a fit of columns A (R, p) without it.

    With the misfit e of the fit to all rows and its leverage H, an orthonormal basis Q of A times its transpose,

    .. math:: r_g = (1 - H_{gg})^{-1} e_g = e_g + Q_g (1 - Q_g^T Q_g)^{-1} Q_g^T e_g , \qquad
        \chi^2_g = r_g^T (1 + A_g C_{-g} A_g^T)^{-1} r_g = e_g^T r_g .

    Directions that the other rows do not show are fitted by the group itself.
    """
    Q = basis(A)
    e = y - Q @ (Q.T @ y)
    out = e.copy()
    for k in np.unique(group):
        rows = group == k
        lam, V = eigh(np.eye(Q.shape[1]) - Q[rows].T @ Q[rows])
        V = V[:, lam > SHOWN] / np.sqrt(lam[lam > SHOWN])
        out[rows] += Q[rows] @ (V @ (V.T @ (Q[rows].T @ e[rows])))
    return out


def _residual(A: Array, y: Array) -> tuple[Array, int]:
    Q = basis(A)
    return y - Q @ (Q.T @ y), Q.shape[1]


def physical_columns(s: Search, f: FittedCauses) -> Array:
    """Columns (n, C, p) of what was found, before reduction, per prior sigma."""
    o = s.fit
    out = [np.zeros((*o.residual.shape, 0))]
    for m, v in zip(f.members, f.variants, strict=True):
        c = s.library.candidates[m]
        bent = c.variants[v].column
        if bent is not None:
            out.append(bent[:, :, None])
        elif not c.rival:
            effect = absent_effect(c.effect, o.view.stimulus, c.source, **dict(c.variants[v].constants))
            out.append(o.rows.columns(effect, c.parameters) * np.array([p.sigma for p in c.parameters]))
    return np.concatenate(out, axis=-1)


def residual_rows(o: Fit, added: Array) -> tuple[Array, Array]:
    """Residuals (n, C) in sigma without and with what was `added` (n, C), the calibration refitted each time."""
    Z = o.view.noise.weighted(o.Z).reshape(o.residual.size, -1)
    return _refitted(o, Z, o.residual), _refitted(o, Z, o.residual - added)


def _refitted(o: Fit, Z: Array, y: Array) -> Array:
    """y (n, C) less its calibration, which has the weighted columns Z (n C, q)."""
    left, _ = _residual(Z, o.view.noise.weighted(y[:, :, None]).ravel())
    return (
        left.reshape(y.shape)
        if o.view.noise.weights is None
        else np.asarray(left.reshape(y.shape) / np.sqrt(o.view.noise.weights))
    )
