"""Which further recording tells a law from the formula that comes next: the menu of manoeuvres, laid out for both."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from gimbalcal.diagnose.laws.expressions import Expression
from gimbalcal.diagnose.laws.law_file import STAGES, printed
from gimbalcal.diagnose.laws.law_search import Law
from gimbalcal.diagnose.verdict.separation import apart, fastest
from gimbalcal.effects import Stage
from gimbalcal.number import Array
from gimbalcal.views.core import Fit
from gimbalcal.words.diagnosis_sentences import separation_advice


def to_tell(o: Fit, law: Law, size: Array, other: Law, asked: bool = True) -> str:
    """The manoeuvre that tells a law with coefficients `size` (m,) [SI] from another fastest, as one sentence.

    asked: whether the question is open; else it is empty where no manoeuvre would tell.
    """

    def gained(planned: Fit) -> float:
        signal = _columns(planned, law, law.expression) @ size[:, None]
        return apart(planned, signal, _varied(planned, other))

    best = fastest(o, gained)
    if not (best.words or asked):
        return ""
    return separation_advice(best.words, best.hours, best.ln_bayes, printed(law), printed(other))


def _varied(o: Fit, law: Law) -> Iterator[Array]:
    return (_columns(o, law, e) for e in law.expression.varied())


def _columns(o: Fit, law: Law, e: Expression) -> Array:
    """Return what a unit of each coefficient adds to the reduced rows of a recording, (R, m)."""
    stage = Stage[STAGES[law.place.channel]]
    names = o.view.stimulus.axis_names if stage is Stage.ENCODER else "xyz"
    return np.asarray(o.reduced(o.rows.added(stage, names.index(law.place.axis), e.on(o.rows.seen[stage]).columns)))
