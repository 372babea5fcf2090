"""How rounds of a search go on: which cause is taken, gives way or is dropped, and by how much; on evidence by hand."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gimbalcal.diagnose.evidence.odds import CLAIM, SINGLE
from gimbalcal.diagnose.library.candidates import Library, Variant
from gimbalcal.diagnose.search import about_found, likeliest, stepwise
from gimbalcal.diagnose.search.ranking import Hypothesis
from gimbalcal.views.noise import NoiseModel

VIEW: Any = SimpleNamespace(kind="pointing", title="run", stimulus=None)
FIRST: Any = SimpleNamespace(exact=False, effects=(), parameters=(), residual=np.ones(1), jacobian=np.ones((1, 1)))


def cause(name: str, rival: str = "") -> Any:
    return SimpleNamespace(key=(name, "", "", ""), effect=name, rival=rival, in_words=name, tried=1, source="",
                           parameters=(), variants=(Variant((), (0,)),))  # fmt: skip


A, B, C = ((cause(name), Variant((), (0,))) for name in "abc")


def said(_: str) -> None:
    pass


def weighed(monkeypatch: pytest.MonkeyPatch, hypotheses: list[Hypothesis], **more: Any) -> Any:
    every = (cause("a"), cause("b"), cause("c"), cause("shape", rival="sine"))
    s = SimpleNamespace(hypotheses=tuple(hypotheses), ln_total=9.0,
                        library=SimpleNamespace(candidates=every, X=np.zeros((2, 1, 1))))  # fmt: skip
    monkeypatch.setattr(likeliest, "ranked", lambda *_: s)
    monkeypatch.setattr(likeliest, "likeliest_variants", lambda _, members: [0] * len(members))
    return likeliest.weigh(VIEW, FIRST, **more)


def test_one_cause_beats_a_shape_by_itself_and_two_at_the_odds_of_a_claim(monkeypatch: pytest.MonkeyPatch) -> None:
    shape = Hypothesis((3,), 4.0, 4.0)
    assert weighed(monkeypatch, [Hypothesis((0,), 5.0, 5.0), shape]).named
    assert not weighed(monkeypatch, [Hypothesis((0, 1), 5.0, 5.0), shape]).named
    assert weighed(monkeypatch, [Hypothesis((0, 1), 4.1 + CLAIM, 4.1 + CLAIM), shape]).named
    assert not weighed(monkeypatch, [Hypothesis((0,), 5.0, 5.0), shape], shape=True).named


def test_the_lead_is_over_the_best_that_holds_what_it_is_held_against(monkeypatch: pytest.MonkeyPatch) -> None:
    ranking = [Hypothesis((0,), 7.0, 7.0), Hypothesis((1,), 5.0, 5.0), Hypothesis((1, 2), 3.0, 3.0)]
    assert weighed(monkeypatch, ranking, against=B[0]).lead == 2.0
    assert weighed(monkeypatch, ranking, against=A[0]).lead == 0.0
    assert weighed(monkeypatch, ranking).lead == 0.0


@pytest.mark.parametrize(("lead", "kept"), [(0.9, [A, B]), (1.1, [B, C])])
def test_a_cause_gives_way_to_one_that_is_clearly_likelier(
    monkeypatch: pytest.MonkeyPatch, lead: float, kept: list[Any]
) -> None:
    def weigh(_v: Any, model: Any, _memory: bool, against: Any) -> Any:
        assert against not in model
        return SimpleNamespace(lead=lead if against is A[0] else 0.0, found=(C,))

    monkeypatch.setattr(stepwise, "weigh", weigh)
    monkeypatch.setattr(stepwise, "take", lambda _v, _first, taken: [c for c, _ in taken])
    monkeypatch.setattr(stepwise, "is_usual", lambda *_: False)
    assert stepwise.exchanged(VIEW, FIRST, [A, B], said) == kept


def test_what_every_rig_has_needs_a_tenth_of_the_evidence(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stepwise, "is_usual", lambda c, _: c is A[0])
    assert stepwise.bar(VIEW, A[0]) == pytest.approx(np.log(2.0))
    assert stepwise.bar(VIEW, B[0]) == pytest.approx(np.log(20.0))


def test_the_weakest_is_dropped_first_as_it_may_hold_the_others_down(monkeypatch: pytest.MonkeyPatch) -> None:
    support = {("a", "bc"): 1.0, ("b", "ac"): 2.0, ("c", "ab"): 9.0, ("b", "c"): 5.0, ("c", "b"): 9.0,
               ("a", "c"): 5.0, ("c", "a"): 9.0}  # fmt: skip
    monkeypatch.setattr(stepwise, "sharpened", lambda _v, _first, taken: list(taken))
    monkeypatch.setattr(stepwise, "take", lambda _v, _first, taken: "".join(sorted(c.effect for c, _ in taken)))
    monkeypatch.setattr(stepwise, "alone", lambda _v, others, this: support[this[0].effect, others])
    monkeypatch.setattr(stepwise, "is_usual", lambda *_: False)
    assert stepwise.pruned(VIEW, FIRST, [A, B, C], said) == [B, C]


def test_odds_of_several_pay_the_share_of_each(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stepwise, "ordered", lambda _v, _m, taken: [stepwise.Step(t, FIRST) for t in taken])
    monkeypatch.setattr(stepwise, "alone", lambda *_: 5.0)
    monkeypatch.setattr(stepwise, "is_usual", lambda c, _: c is C[0])
    share = {A[0].key: -2.0, C[0].key: -9.0}
    made = stepwise.ln_odds(VIEW, FIRST, [A, B, C], share)  # the share of b is not known: the least, -9
    assert made == pytest.approx(3 * 5.0 - 2.0 - 9.0 + 2 * np.log(SINGLE))


@pytest.mark.parametrize(("other", "told"), [(1.0, ([A], [])), (3.0, ([B, C], [B]))])
def test_the_likelier_of_two_courses_is_told(monkeypatch: pytest.MonkeyPatch, other: float, told: Any) -> None:
    monkeypatch.setattr(stepwise, "start", lambda _: FIRST)
    monkeypatch.setattr(stepwise, "refuse_too_little", lambda *_: None)
    monkeypatch.setattr(stepwise, "climbed", lambda _v, _m, begun, _t: [B, C] if begun else [A])
    monkeypatch.setattr(stepwise, "library", lambda _: Library((A[0],), np.zeros((1, 1, 1))))
    monkeypatch.setattr(stepwise, "textbook", lambda *_: [B])
    monkeypatch.setattr(stepwise, "pruned", lambda _v, _m, taken, _t: list(taken))
    monkeypatch.setattr(stepwise, "log_priors", lambda *_: np.zeros(1))
    monkeypatch.setattr(stepwise, "ln_odds", lambda _v, _m, taken, _s: 2.0 if taken == [A] else other)
    monkeypatch.setattr(stepwise, "steps_of", lambda _v, _m, taken, standard=(): (taken, list(standard)))
    assert stepwise.course(VIEW, said) == told


@pytest.mark.parametrize(("left", "anew"), [(1.0, True), (1.6, False)])
def test_constants_that_were_dragged_far_are_looked_about_again(
    monkeypatch: pytest.MonkeyPatch, left: float, anew: bool
) -> None:
    """A misfit of nine is more than four times one, and less than that of 2.6."""
    monkeypatch.setattr(about_found, "absent_effect", lambda *_, **__: None)
    monkeypatch.setattr(about_found, "course", lambda v, _: f"the course of {v}")
    v: Any = SimpleNamespace(relinearise=lambda *_: "another view", stimulus=None, noise=NoiseModel())
    first, last = (SimpleNamespace(residual=np.array([r])) for r in (3.0, left))
    c: Any = SimpleNamespace(start=first, end=last, steps=(SimpleNamespace(taken=A),))
    expected = ("another view", "the course of another view") if anew else (v, c)
    assert about_found.about_found(v, c, said) == expected
