"""Where the mismatch is, in an unknown noise: the shapes that the misfit follows, or the rows that are off most."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gimbalcal.diagnose.evidence.projection import Projection, log_bayes
from gimbalcal.diagnose.library.assemble import free_rows, spans
from gimbalcal.diagnose.library.candidates import Candidate
from gimbalcal.diagnose.library.shapes import shapes_of
from gimbalcal.diagnose.result import Mismatch
from gimbalcal.diagnose.search.ranking import projections_of
from gimbalcal.inference.algebra import basis
from gimbalcal.inference.p_value import probability
from gimbalcal.number import Array
from gimbalcal.units import from_si
from gimbalcal.views.core import Fit, View
from gimbalcal.words import diagnosis_sentences

ODD = 1e-3  # p-value below which a pattern of the misfit is listed
LISTED = 3  # patterns that are listed, strongest first


def mismatches(m: Fit, sigma: Array) -> tuple[Mismatch, ...]:
    """Entries of `mismatch`: patterns of the baseline's misfit, or the channel that is off most where it has none."""
    return patterns(m) or largest(m, sigma)


def patterns(m: Fit) -> tuple[Mismatch, ...]:
    """The shapes that the misfit of the baseline follows, strongest first, by an F test each."""
    from scipy.special import fdtrc

    v, blocks = m.view, list[Array]()
    shapes = shapes_of(v, m.residual, spans(m.jacobian), blocks, free_rows(v, m.parameters))
    X = m.reduced(np.concatenate(blocks, axis=-1))
    white = projections_of(m, X, memory=False)  # in one scale, and in scales of the channels where these may differ
    dof = m.residual.size - basis(m.reduced(m.jacobian)).shape[1]
    out = []
    for c in shapes:
        at = c.variants[0].index
        ln, k = max((_ln_of_any_size(p, at), k) for k, p in enumerate(white))  # the scales that belong to the shape
        ln, likeliest = ln - white[k].log_evidence(), white[k]
        y2, taken = float(likeliest.misfit[0]), likeliest.explained(at)
        free = max(dof - len(at), 1)
        F = (taken / len(at)) / max((y2 - taken) / free, 1e-300)
        p = min(1.0, float(fdtrc(len(at), free, F)) * len(shapes))
        out.append((ln, F, p, c))
    listed = sorted((t for t in out if t[2] < ODD), key=lambda t: -t[0])[:LISTED]
    return tuple(_pattern(m, c, F, p) for _, F, p, c in listed)


def _ln_of_any_size(p: Projection, index: Sequence[int]) -> float:
    """Return ln of prior x likelihood of a noise where the columns are present, at their likeliest size."""
    return p.log_evidence() + float(log_bayes(p, np.array(index), p.scale.any_size).max())


def _pattern(m: Fit, c: Candidate, F: float, p: float) -> Mismatch:
    v = m.view
    if v.added is not None:  # in a sensor, and the rows are what a navigator makes of it
        size = float(from_si(float(np.sqrt(np.mean(m.residual**2))), v.unit))
        rows = np.argsort(-np.abs(v.noise.weighted(m.residual)).max(axis=1))[:3]
        words = diagnosis_sentences.follows_sensor(v, c.channel, c.axis, size, c.rival)
        return Mismatch(c.channel, c.axis, _where(v, rows), round(F, 2), p, words)
    i, size = _channel(m, c.axis)
    rows = np.argsort(-np.abs(m.residual[:, i]))[:3]
    words = diagnosis_sentences.follows(v, c.axis, size, c.rival)
    return Mismatch(v.channels[0][0], c.axis, _where(v, rows), round(F, 2), p, words)


def largest(m: Fit, sigma: Array) -> tuple[Mismatch, ...]:
    """The channel that the baseline misses by most, against the scatter that is left in the end."""
    v, square = m.view, ((m.residual / sigma) ** 2).mean(axis=0)
    axis = v.channels[int(np.argmax(square))][1]
    i, size = _channel(m, axis)
    rows = np.argsort(-np.abs(m.residual[:, i]))[:3]
    ratio = float(square[i])
    p = min(1.0, probability(ratio * len(m.residual), len(m.residual)) * len(v.channels))
    words = diagnosis_sentences.largest(v, axis, size, float(np.sqrt(ratio)), rows)
    return (Mismatch(v.channels[0][0], axis, _where(v, rows), round(ratio, 2), p, words),)


def _channel(m: Fit, axis: str) -> tuple[int, float]:
    i = [a for _, a in m.view.channels].index(axis)
    return i, float(from_si(float(np.sqrt(np.mean(m.residual[:, i] ** 2))), m.view.unit))


def _where(v: View, rows: Array) -> dict[str, list[float]]:
    if v.label is None:
        return {"time_s": [round(float(x), 3) for x in np.sort(v.time[rows])]}
    return {"positions": [int(k) for k in v.label[rows]]}
