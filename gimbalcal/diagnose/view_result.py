"""The diagnosis of one view: what is said of it, how well it fits, and the calibration it leads to."""

from __future__ import annotations

from collections.abc import Callable, Container, Sequence
from dataclasses import dataclass, replace
from math import inf

from gimbalcal.calibration import Calibration
from gimbalcal.diagnose.answer import Curves
from gimbalcal.diagnose.evidence.odds import CLAIM
from gimbalcal.diagnose.result import Evidence, Finding, FitSummary, LawResult, Mismatch, Shape
from gimbalcal.diagnose.verdict.decide import reported_probability
from gimbalcal.diagnose.verdict.random_walk import PartOfWalk, RandomWalkFinding
from gimbalcal.effects import CATALOGUE
from gimbalcal.recording import Recording
from gimbalcal.views.core import Fit, View
from gimbalcal.words import diagnosis_sentences, law_sentences
from gimbalcal.words.naming import without_underscores

MAX_DOUBTED_PROBABILITY = 0.45  # of a cause that leaves much, or makes held-out rows worse, or loses to a formula


@dataclass(frozen=True)
class Contradiction:
    """What recordings of one unit contradict each other in: in a sentence, and as entries of `unexplained`."""

    in_words: str
    shapes: tuple[Shape, ...]


@dataclass(frozen=True)
class ViewDiagnosis:
    """The diagnosis of one view, with its misfits without and with the findings.

    model: findings and their constants fitted, where the scale of the noise is fitted; calibration: the same where it
    is known. outcome: what else speaks against the view; evidence: what it adds to the provenance; ln_evidence: returns
    ln p(y) with the causes and laws, up to a constant of the rows and the baseline, where the scale of the noise is
    fitted.

    Several recordings of one unit in a noise of known scale have one diagnosis, of the view that is off most:
    contradictions between them are said before it, remarks after it, and together are their views. without: the
    calibration by a model without an effect, by its id, and with all of them for an empty one. used: the recording
    without rows that were omitted.
    """

    view: View
    verdict: str
    mismatch: tuple[Mismatch, ...]
    findings: tuple[Finding, ...]
    unexplained: tuple[Shape, ...]
    fit: FitSummary
    curves: Curves
    model: Fit | None = None
    calibration: Calibration | None = None
    laws: tuple[LawResult, ...] = ()
    recommend: str = ""
    outcome: str = ""
    evidence: Evidence | None = None
    ln_evidence: Callable[[], float] = lambda: -inf
    contradictions: tuple[Contradiction, ...] = ()
    remarks: tuple[str, ...] = ()
    together: tuple[View, ...] = ()
    without: Callable[[str], Calibration] | None = None
    used: Recording | None = None

    @property
    def name(self) -> str:
        """The view as diagnosis.json calls it."""
        return "forces" if self.view.measurement.known_attitude else self.view.name

    def doubted(self, effects: Container[str]) -> ViewDiagnosis:
        """Return the diagnosis with a low probability of the findings of these effects, by id.

        A formula has more evidence, a large residual is left, or held-out rows are predicted worse.
        """
        doubted = tuple(
            replace(f, probability=min(f.probability, MAX_DOUBTED_PROBABILITY)) if f.effect in effects else f
            for f in self.findings
        )
        certain = any(f.effect not in effects and not f.twins for f in self.findings)
        return replace(self, findings=doubted, verdict=self.verdict if certain else "not-identifiable")

    @property
    def effects_found(self) -> frozenset[str]:
        """The ids of the effects of the findings."""
        return frozenset(f.effect for f in self.findings)

    def with_walk(self, walk: RandomWalkFinding, only: bool) -> ViewDiagnosis:
        """Return the diagnosis with the walk of a sensor as the `only` explanation, or as another one."""
        words = [diagnosis_sentences.walk_as_explanation(walk, only), self.outcome]
        return replace(self, unexplained=(walk.shape, *self.unexplained), outcome="; ".join(filter(None, words)))

    def with_part_of_walk(self, walk: RandomWalkFinding | None) -> ViewDiagnosis:
        """Return the diagnosis of causes together with the walk of a sensor, by the part that the walk has in it."""
        if walk is None or walk.part is PartOfWalk.NONE:
            return self
        d = self
        if walk.part is PartOfWalk.SHARED:
            shared = (replace(f, probability=reported_probability(walk.share_of(f.probability))) for f in d.findings)
            d = replace(d, verdict="not-identifiable", findings=tuple(shared))
        elif any(CATALOGUE[f.effect].role.time_drift for f in d.findings):  # a drift may be the walk itself
            d = replace(d, verdict="not-identifiable")
        return d.with_walk(walk, only=False)

    def against_walk(self, walk: RandomWalkFinding, ln_odds: float) -> ViewDiagnosis:
        """Return the diagnosis with the walk of a sensor as well, unless the formulas are much likelier than it."""
        return self if ln_odds > CLAIM else self.with_walk(walk, only=ln_odds < -CLAIM)

    def tested(self, by_formulas: Callable[[], tuple[ViewDiagnosis | None, frozenset[str]]] | None) -> ViewDiagnosis:
        """Return the diagnosis after formulas and rows held out have been asked whether its causes stand.

        by_formulas: the diagnosis by formulas in the place of causes, if there is one, and the ids of doubtful effects.
        """
        if not self.findings:
            return self
        formulas, doubtful = by_formulas() if by_formulas else (None, frozenset[str]())
        if formulas is not None:
            return formulas
        if self.fit.predicts_worse:
            return replace(self.doubted(self.effects_found), outcome=diagnosis_sentences.WORSE_HELD_OUT)
        return self.doubted(doubtful) if doubtful else self


def shapes_with_laws(shapes: Sequence[Shape], laws: Sequence[LawResult]) -> tuple[Shape, ...]:
    """Return what is unexplained; of a sensor with a formula that follows something else, what the formula follows."""
    of_sensor = {f"{law.channel} {law.axis}": law for law in laws}

    def stated(s: Shape) -> Shape:
        law = of_sensor.get(s.channel)
        if law is None or all(without_underscores(v) in s.shape for v in law.variables):
            return s
        return replace(s, shape=law_sentences.shape_of_law(law))

    every = (Shape(channel, law_sentences.shape_of_law(law)) for channel, law in of_sensor.items())
    return tuple(dict.fromkeys(stated(s) for s in shapes)) or tuple(every)
