r"""How strong "something is missing" looks on clean recordings of this very design: simulated, not looked up.

Clean data are drawn in the noises that the recording itself makes likely and sent through the same evidence. Gram
matrices do not depend on the data, so a thousand recordings cost little more than one. In a recording that lacks
nothing a cause would have shown from the size

.. math:: x_{least} = 8 \, \sigma_x, \qquad \sigma_x^{-2} = X_\perp^T V^{-1} X_\perp

by the column of the cause that the calibration leaves, in the likeliest noise; of causes with a time constant or an
order at the one that shows best, of several axes at the one that shows least. From eight sigma nine of ten are found.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gimbalcal.diagnose.evidence.gram import Gram
from gimbalcal.diagnose.evidence.projection import Projection, ReducedRows
from gimbalcal.diagnose.evidence.scale import SIZE_PRIOR, SIZES
from gimbalcal.diagnose.library.candidates import Candidate, Layout
from gimbalcal.diagnose.result import DetectionLimit
from gimbalcal.diagnose.search.ranking import Ranking, Search
from gimbalcal.effects import Parameter
from gimbalcal.inference.algebra import eigh, logsumexp
from gimbalcal.number import Array
from gimbalcal.units import from_si

DRAWS = 200  # clean recordings: the 99 % point rests on two of them, and CLAIM is above it but for odd designs
VISIBLE_SIGMAS = 8.0  # sigmas
# sigmas at the usual size; a hundred times that would not show: the calibration takes all of it
MIN_SIGNAL_SIGMAS = 0.08
MIN_NOISE_WEIGHT = 1e-4  # weight of a noise below which it is left out


def clean_evidence(c: Ranking, rng: np.random.Generator) -> tuple[Array, tuple[Array, ...]]:
    """Return ln Bayes factors (DRAWS,) of "something is missing" on simulated clean recordings of these designs.

    First those of all recordings together, then those of each by itself.
    """
    drawn = [clean_singles(s, rng) for s in c.searches]
    each = tuple(evidence_of_any(d, s.share) for d, s in zip(drawn, c.searches, strict=True))
    return evidence_of_any(c.summed(drawn), c.share), each


def evidence_of_any(singles: Array, share: Array) -> Array:
    """ln Bayes factors (draws,) of any single candidate, from those of each (candidates, draws) and its prior share."""
    return logsumexp(singles + share[:, None], axis=0)


def clean_singles(s: Search, rng: np.random.Generator) -> Array:
    """ln Bayes factors (candidates, DRAWS) of each candidate on simulated clean recordings, noise integrated over."""
    weights = np.exp(s.null - logsumexp(s.null))
    kept = [k for k in np.argsort(-weights) if weights[k] > MIN_NOISE_WEIGHT]
    low, tail = _draw_clean(s.rows, [s.projections[k] for k in kept], weights[kept], rng)
    empty, full = [], []
    for k in kept:
        p = s.projections[k]
        b, misfit = _draw_scores(s.rows, p, low, tail)
        ln = np.log(p.node.prior) - 0.5 * (misfit + p.penalty)
        empty.append(ln)
        full.append(ln + _evidence_of_each(p.G, b, s.library.layout))
    return logsumexp(np.array(full), axis=0) - logsumexp(np.array(empty), axis=0)


def _draw_clean(
    rows: ReducedRows, projections: Sequence[Projection], weights: Array, rng: np.random.Generator
) -> tuple[Array, Array]:
    """Clean coloured rows (R', DRAWS) and the products (q + P, DRAWS) of white rows with the columns."""
    n, m = rows.low.shape[0], rows.q + rows.P
    low = np.empty((n, DRAWS))
    picked = rng.choice(len(projections), size=DRAWS, p=weights / weights.sum())
    noise = rng.standard_normal((n, DRAWS))
    for k, p in enumerate(projections):
        mine = picked == k
        if mine.any():
            low[:, mine] = p.node.colour(noise[:, mine])
    white = rng.standard_normal((m, DRAWS))
    if not rows.high.any():  # as those of positions
        return low, 0 * white
    lam, V = eigh(rows.high[:m, :m])
    return low, V @ (np.sqrt(np.maximum(lam, 0.0))[:, None] * white)


def _draw_scores(rows: ReducedRows, p: Projection, low: Array, tail: Array) -> tuple[Array, Array]:
    """Scores (P, draws) and misfits (draws,) up to a constant, the calibration profiled out."""
    q, P = rows.q, rows.P
    W = p.node.whiten(rows.low)[:, : q + P]
    y = p.node.whiten(low)
    v = W.T @ y + tail
    A = W[:, :q].T @ W + rows.high[:q, : q + P]
    L = np.linalg.cholesky(A[:, :q])
    z = np.linalg.solve(L, v[:q])
    K = np.linalg.solve(L, A[:, q:])
    return v[q:] - K.T @ z, (y**2).sum(axis=0) - (z**2).sum(axis=0)


def _evidence_of_each(G: Gram, b: Array, layout: Layout) -> Array:
    """ln Bayes factor (candidates, draws) of every single candidate, sizes and variants mixed, in one noise."""
    ln = np.full((len(layout.log_share), b.shape[1]), -np.inf)
    for members, index in layout.widths:
        lam, V = eigh(G.block(index))
        c2 = (np.swapaxes(V, -1, -2) @ b[index]) ** 2
        for size, prior in zip(SIZES, SIZE_PRIOR, strict=True):
            s2l = size**2 * np.maximum(lam, 0.0)
            gain = ((size**2 / (1 + s2l))[:, None] @ c2)[:, 0] - np.log1p(s2l).sum(axis=1)[:, None]
            ln[members] = np.logaddexp(ln[members], 0.5 * gain + np.log(prior))
    return np.asarray(np.logaddexp.reduceat(ln + layout.log_share[:, None], layout.starts, axis=0))


def detection_limits(
    each: Sequence[tuple[Sequence[Candidate], Sequence[Projection]]],
) -> tuple[DetectionLimit, ...]:
    """Return, of each effect that was compared, the least size that would have shown and the usual one, as printed.

    each: candidates of each view of a unit, and the projections of their columns; what one shows and another shows adds
    up in quadrature. What happened once, as a step, is left out; what bends with its size is taken as it begins.
    """
    shown: dict[tuple[str, ...], tuple[float, Candidate, Parameter]] = {}
    for candidates, projections in each:
        p = max(projections, key=Projection.log_evidence)
        shows = np.sqrt(np.maximum(p.G.diagonal, 0.0)) / float(p.scale.sigma(p.misfit[0]))
        for c in candidates:
            if c.rival or c.once or "," in c.axis:
                continue
            sigmas, q = max(
                ((float(shows[i]), q) for v in c.variants for i, q in zip(v.index, c.parameters, strict=True)),
                key=lambda one: one[0],
            )
            before, first, own = shown.get(c.key, (0.0, c, q))
            shown[c.key] = (float(np.hypot(before, sigmas)), first, own)
    worst: dict[str, tuple[float, Candidate, Parameter]] = {}
    for sigmas, c, q in shown.values():
        if sigmas > MIN_SIGNAL_SIGMAS and sigmas < worst.get(c.effect, (np.inf,))[0]:
            worst[c.effect] = (sigmas, c, q)
    return tuple(
        DetectionLimit(effect, c.axis, float(from_si(VISIBLE_SIGMAS / sigmas * q.sigma, q.unit)),
                       float(from_si(q.sigma, q.unit)), q.unit)
        for effect, (sigmas, c, q) in sorted(worst.items())
    )  # fmt: skip
