r"""The model with what was found in it: sizes with their uncertainty, and what that does to the calibration.

Generalised least squares, calibration and causes together, averaged over the noise with the weight that the data give
each; the spread between noises is part of the stated sigma.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gimbalcal.diagnose.evidence.projection import Projection, log_bayes
from gimbalcal.diagnose.library.candidates import Constants, SelectedCause
from gimbalcal.diagnose.search.ranking import Search, selected_causes
from gimbalcal.effects import Effect, with_values
from gimbalcal.number import Array


@dataclass(frozen=True, eq=False)
class FittedCauses:
    """Causes of one search, each with its likeliest constants, fitted with the calibration in its noises.

    members: their ordinals among the candidates. x (p,) and covariance (p, p) are the sizes in prior sigmas, projection
    the likeliest noise, weights (nodes,) the probability of each.
    """

    search: Search
    members: tuple[int, ...]
    causes: tuple[SelectedCause, ...]
    x: Array
    covariance: Array
    projection: Projection
    weights: Array

    @property
    def index(self) -> tuple[int, ...]:
        """The columns of all causes in the library of the search."""
        return tuple(i for _, variant in self.causes for i in variant.index)

    @property
    def misfit(self) -> float:
        """The chi^2 that calibration and causes leave in the likeliest noise."""
        return float(self.projection.misfit[0]) - self.projection.explained(self.index)

    def columns_of_others(self, member: int) -> list[int]:
        """Return the columns of all causes but one in the library of the search."""
        return [i for n, (_, variant) in enumerate(self.causes) if n != member for i in variant.index]

    def slice_of(self, member: int) -> slice:
        """Return where the sizes of one of the causes stand in x."""
        first = sum(len(c.parameters) for c, _ in self.causes[:member])
        return slice(first, first + len(self.causes[member][0].parameters))

    def size(self, member: int) -> Array:
        """Return the sizes (p,) of one of the causes, SI."""
        return np.asarray(self.x[self.slice_of(member)] * [p.sigma for p in self.causes[member][0].parameters])

    def significance(self, member: int) -> float:
        """Return the significance [sigma] of one of the causes beyond what everything else explains."""
        own = self.causes[member][1].index
        return float(np.sqrt(max(self.projection.explained(own, self.columns_of_others(member)), 0.0)))

    def effects(self) -> list[Effect]:
        """Return each cause as an effect with its size and its constants."""
        s, out = self.search.fit.view.stimulus, []
        for n, (c, variant) in enumerate(self.causes):
            none = c.absent(s, variant.constants)
            out.append(with_values((none,), c.parameters, self.size(n), s.axis_names)[0])
        return out

    def spread(self, member: int) -> dict[str, float]:
        """Return one sigma (SI) of each nonlinear constant of one of the causes, by fits of all its variants."""
        c, others = self.causes[member][0], self.columns_of_others(member)
        ln = np.array([self.projection.explained(v.index, others) / 2 + np.log(v.weight) for v in c.variants])
        w = np.exp(ln - ln.max())
        w /= w.sum()
        out = {}
        for n, (name, _) in enumerate(c.variants[0].constants):
            x = np.array([v.constants[n][1] for v in c.variants])
            out[name] = float(np.sqrt(np.sum(w * (x - np.sum(w * x)) ** 2)))
        return out

    def calibration(self) -> tuple[Array, Array, Array]:
        """Return calibration constants (q,) in prior sigmas without and with the causes, and their sigma with them."""
        o, node = self.search.fit, self.projection.node
        X = self.search.library.X[:, list(self.index)]
        Z, X, y = (node.whiten(A) for A in (o.reduced(o.Z), X, o.reduced(o.residual[:, :, None])))
        q = Z.shape[1]
        before = np.linalg.lstsq(Z, y[:, 0], rcond=1e-9)[0]
        A = np.concatenate([Z, X], axis=1)
        after = np.linalg.lstsq(A, y[:, 0], rcond=1e-9)[0][:q]
        C = np.linalg.pinv(A.T @ A, rcond=1e-12, hermitian=True)
        return before, after, np.sqrt(np.diag(C)[:q])

    def columns(self, at: Sequence[Constants] = ()) -> Array:
        """Return the columns (n, C, p) of the causes before reduction, per prior sigma; at: other constants of each."""
        o = self.search.fit
        out = [np.zeros((*o.residual.shape, 0))]
        for n, (c, variant) in enumerate(self.causes):
            if variant.column is not None:
                out.append(variant.column[:, :, None])
            elif not c.rival:
                effect = c.absent(o.view.stimulus, at[n] if at else variant.constants)
                out.append(o.rows.columns(effect, c.parameters) * np.array([p.sigma for p in c.parameters]))
        return np.concatenate(out, axis=-1)


def fit_causes(s: Search, members: Sequence[int]) -> FittedCauses:
    """Fit members jointly in the noise that their presence makes likely."""
    causes = selected_causes(s, members)
    at = np.array([i for _, variant in causes for i in variant.index], dtype=int)
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
    return FittedCauses(s, tuple(members), causes, x, covariance, p, weights)


def _weights(s: Search, at: Array) -> Array:
    """Return the probability (nodes,) of each noise given these columns at their likeliest size."""
    if not len(at):
        ln = s.null
    else:
        ln = np.array([n + log_bayes(p, at, p.scale.sizes).max()
                       for n, p in zip(s.null, s.projections, strict=True)])  # fmt: skip
    w = np.exp(ln - ln.max())
    return np.asarray(w / w.sum())
