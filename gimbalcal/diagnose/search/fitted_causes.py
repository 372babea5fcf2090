r"""The model with what was found in it: sizes with their uncertainty, and what that does to the calibration.

Generalised least squares, calibration and causes together, averaged over the noise with the weight that the data give
each; the spread between noises is part of the stated sigma.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gimbalcal.diagnose.evidence.projection import Projection, log_bayes
from gimbalcal.diagnose.library.candidates import Candidate, Constants
from gimbalcal.diagnose.search.ranking import Search, likeliest_variants
from gimbalcal.effects import Effect, with_values
from gimbalcal.number import Array


@dataclass(frozen=True)
class FittedCauses:
    """Sizes (p,) in prior sigmas with covariance (p, p), the columns they belong to, and the likeliest noise."""

    members: tuple[int, ...]
    variants: tuple[int, ...]
    index: tuple[int, ...]
    x: Array
    covariance: Array
    significance: tuple[float, ...]  # per member, sigmas beyond what everything else explains
    projection: Projection
    weights: Array  # (nodes,) probability of each noise given these causes

    def columns_of(self, s: Search, member: int) -> tuple[int, ...]:
        """Return the columns of one of the members in the library of its search."""
        return s.library.candidates[self.members[member]].variants[self.variants[member]].index


def fit_causes(s: Search, members: Sequence[int]) -> FittedCauses:
    """Joint fit of the members in the noise that their presence makes likely."""
    candidates = s.library.candidates
    variants = likeliest_variants(s, members)
    index = tuple(i for m, v in zip(members, variants, strict=True) for i in candidates[m].variants[v].index)
    at = np.array(index, dtype=int)
    weights = _weights(s, at)
    xs, Cs = [], []
    for p in s.projections:
        C = np.linalg.pinv(p.G.block(at), rcond=1e-10, hermitian=True)
        xs.append(C @ p.b[at, 0])
        Cs.append(C)
    x = np.einsum("k,kp->p", weights, np.array(xs))
    spread = np.array(xs) - x
    covariance = np.einsum("k,kpq->pq", weights, np.array(Cs)) + np.einsum("k,kp,kq->pq", weights, spread, spread)
    p = s.projections[int(np.argmax(weights))]
    significance = _significance(p, candidates, members, variants)
    return FittedCauses(tuple(members), variants, index, x, covariance, significance, p, weights)


def _weights(s: Search, at: Array) -> Array:
    """Posterior (nodes,) of the noise given these columns at their likeliest size."""
    if not len(at):
        ln = s.null
    else:
        ln = np.array([n + log_bayes(p, at, p.scale.sizes).max()
                       for n, p in zip(s.null, s.projections, strict=True)])  # fmt: skip
    w = np.exp(ln - ln.max())
    return np.asarray(w / w.sum())


def _significance(
    p: Projection, candidates: Sequence[Candidate], members: Sequence[int], variants: Sequence[int]
) -> tuple[float, ...]:
    spans = [candidates[m].variants[v].index for m, v in zip(members, variants, strict=True)]
    out = []
    for j, own in enumerate(spans):
        others = [i for n, span in enumerate(spans) if n != j for i in span]
        out.append(float(np.sqrt(max(p.explained(own, others), 0.0))))
    return tuple(out)


def fitted_effects(s: Search, f: FittedCauses) -> list[tuple[Effect, Candidate]]:
    """Return each fitted cause as an effect with its size and its constants."""
    out, at, names = [], 0, s.fit.view.stimulus.axis_names
    for m, v in zip(f.members, f.variants, strict=True):
        c = s.library.candidates[m]
        size = f.x[at : at + len(c.parameters)] * [p.sigma for p in c.parameters]
        at += len(c.parameters)
        none = c.absent(s.fit.view.stimulus, c.variants[v].constants)
        out.append((with_values((none,), c.parameters, size, names)[0], c))
    return out


def constant_value(s: Search, f: FittedCauses, j: int) -> tuple[tuple[str, float, float], ...]:
    """Non-linear constants of member j: name, value and sigma in SI, from the fits of all its variants."""
    c = s.library.candidates[f.members[j]]
    spans = [s.library.candidates[m].variants[v].index for m, v in zip(f.members, f.variants, strict=True)]
    others = [i for n, span in enumerate(spans) if n != j for i in span]
    ln = np.array([f.projection.explained(v.index, others) / 2 + np.log(v.weight) for v in c.variants])
    w = np.exp(ln - ln.max())
    w /= w.sum()
    out = []
    for n, (name, value) in enumerate(c.variants[f.variants[j]].constants):
        x = np.array([v.constants[n][1] for v in c.variants])
        sigma = float(np.sqrt(np.sum(w * (x - np.sum(w * x)) ** 2)))
        out.append((name, float(value), sigma))
    return tuple(out)


def calibration_fit(s: Search, f: FittedCauses) -> tuple[Array, Array, Array]:
    """Calibration constants, in prior sigmas, without and with what was found, and their sigma with it (q,) each."""
    o, node = s.fit, f.projection.node
    Z, X, y = (
        node.whiten(A) for A in (o.reduced(o.Z), s.library.X[:, list(f.index)], o.reduced(o.residual[:, :, None]))
    )
    q = Z.shape[1]
    before = np.linalg.lstsq(Z, y[:, 0], rcond=1e-9)[0]
    A = np.concatenate([Z, X], axis=1)
    after = np.linalg.lstsq(A, y[:, 0], rcond=1e-9)[0][:q]
    C = np.linalg.pinv(A.T @ A, rcond=1e-12, hermitian=True)
    return before, after, np.sqrt(np.diag(C)[:q])


def columns_of_causes(s: Search, f: FittedCauses, at: Sequence[Constants] = ()) -> Array:
    """Return the columns (n, C, p) of the fitted causes before reduction, per prior sigma.

    at: constants of each, if not those of the fit.
    """
    o = s.fit
    out = [np.zeros((*o.residual.shape, 0))]
    for n, (m, v) in enumerate(zip(f.members, f.variants, strict=True)):
        c = s.library.candidates[m]
        column = c.variants[v].column
        if column is not None:
            out.append(column[:, :, None])
        elif not c.rival:
            effect = c.absent(o.view.stimulus, at[n] if at else c.variants[v].constants)
            out.append(o.rows.columns(effect, c.parameters) * np.array([p.sigma for p in c.parameters]))
    return np.concatenate(out, axis=-1)
