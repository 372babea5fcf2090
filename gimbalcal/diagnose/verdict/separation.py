r"""Which experiment separates causes that this recording confounds: expected log Bayes factor per hour of bench time.

For two causes i and j and the size at which i was found, the recording extended by a manoeuvre separates them by

.. math:: \lambda^2 = \min_a \| X_i \hat\beta - X_j a \|^2_{V^{-1}}, \qquad E[\ln BF] = \lambda^2 / 2 ,

the calibration profiled out of both. Each manoeuvre of the menu is laid out as rows and passed through the same model.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from gimbalcal.design.manoeuvres import available_manoeuvres
from gimbalcal.diagnose.evidence.stated_noise import nominal_noise
from gimbalcal.diagnose.library.assemble import columns_at
from gimbalcal.diagnose.library.candidates import Candidate, SelectedCause
from gimbalcal.diagnose.search.refit import fit_baseline
from gimbalcal.inference.algebra import beyond, orthonormal
from gimbalcal.number import Array
from gimbalcal.views.core import Fit
from gimbalcal.views.known_attitude import view_at_known_attitude

MAX_VARIANTS = 12  # variants of the other cause: the grid of its constants
MAX_PLANNED_ROWS = 720  # rows of a static run that a planned one is laid out with
SETTLED_NATS = 3.0  # nats: a factor 20


@dataclass(frozen=True)
class Advice:
    """The best manoeuvre ("" where none helps), the log Bayes factor it is expected to bring, and its hours."""

    words: str
    ln_bayes: float
    hours: float


def advise_manoeuvre(o: Fit, cause: SelectedCause, size: Array, other: Candidate) -> Advice:
    """Return the manoeuvre that separates a cause, at its fitted size in prior sigmas, from another one fastest."""
    return fastest_manoeuvre(o, lambda planned: expected_separation(planned, cause, size, other))


def fastest_manoeuvre(o: Fit, gained: Callable[[Fit], float]) -> Advice:
    """The manoeuvre of the menu that brings most per hour; `gained`: ln Bayes factor of the planned rows."""
    step = max(1, len(o.view.source.time) // MAX_PLANNED_ROWS) if o.view.kind.stabilised else 1
    thin = o.view.source.select(slice(None, None, step))
    ids = tuple(dict.fromkeys(p.effect for p in o.parameters))
    best = Advice("", 0.0, 0.0)
    for m in available_manoeuvres(thin):
        planned = view_at_known_attitude(m.apply(thin), ids, o.effects)  # readings do not matter, only where and when
        ln_bayes = step * gained(fit_baseline(planned, o.effects, steps=0))
        if ln_bayes > SETTLED_NATS and (not best.words or ln_bayes / m.hours > best.ln_bayes / best.hours):
            best = Advice(m.words, ln_bayes, m.hours)
    return best


def expected_separation(o: Fit, cause: SelectedCause, size: Array, other: Candidate) -> float:
    """Return the expected log Bayes factor between the two causes in the nominal noise."""
    signal = columns_at(o, cause[0], cause[1].constants) @ size[:, None]
    return expected_ln_bayes(o, signal, [columns_at(o, other, v.constants) for v in other.variants[:MAX_VARIANTS]])


def expected_ln_bayes(o: Fit, signal: Array, others: Iterable[Array]) -> float:
    """Expected log Bayes factor of a signal (R, 1) against the best of other columns (R, p), in the nominal noise."""
    node = nominal_noise(o)
    Q = orthonormal(node.whiten(o.reduced(o.Z)))
    y = node.whiten(signal)[:, 0]
    y = beyond(Q, y)
    least = float(y @ y)
    for columns in others:
        X = node.whiten(columns)
        X = beyond(Q, X)
        residual = y - X @ np.linalg.lstsq(X, y, rcond=1e-9)[0]
        least = min(least, float(residual @ residual))
    return least / 2
