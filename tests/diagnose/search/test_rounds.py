"""How rounds of a search go on: which cause is taken, gives way or is dropped, and by how much; on evidence by hand."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gimbalcal.diagnose.evidence.odds import CLAIM, SINGLE
from gimbalcal.diagnose.library.candidates import Library, Variant
from gimbalcal.diagnose.search import relinearise, stepwise
from gimbalcal.diagnose.search.ranking import Hypothesis
from gimbalcal.views.noise import NoiseModel

VIEW: Any = SimpleNamespace(kind="pointing", title="run", stimulus=None, noise=NoiseModel())
FIRST: Any = SimpleNamespace(
    exact=False,
    effects=(),
    parameters=(),
    residual=np.ones(1),
    jacobian=np.ones((1, 1)),
    view=VIEW,
    expanded=lambda X: X,
)
ALIKE: Any = SimpleNamespace(view=SimpleNamespace(kind="pointing", noise=NoiseModel(one_scale=True)))
VIEW.of_one_scale = lambda: ALIKE.view


def cause(name, rival=""):
    return SimpleNamespace(key=(name, "", "", ""), effect=name, rival=rival, in_words=name, tried=1, source="",
                           parameters=(), variants=(Variant((), (0,)),), absent=lambda *_: None)  # fmt: skip


A, B, C, D = ((cause(name), Variant((), (0,))) for name in "abcd")


def said(_):
    pass


def weighed(monkeypatch, hypotheses, **more):
    every = (cause("a"), cause("b"), cause("c"), cause("shape", rival="sine"))
    s = SimpleNamespace(hypotheses=tuple(hypotheses), ln_total=9.0, fit=FIRST,
                        library=SimpleNamespace(candidates=every, X=np.zeros((2, 1))))  # fmt: skip
    monkeypatch.setattr(
        stepwise, "selected_causes", lambda _, members: [(every[i], every[i].variants[0]) for i in members]
    )
    return stepwise.likeliest_round(s, **more)


def test_one_cause_beats_a_shape_by_itself_and_two_at_the_odds_of_a_claim(monkeypatch):
    shape = Hypothesis((3,), 4.0, 4.0)
    assert weighed(monkeypatch, [Hypothesis((0,), 5.0, 5.0), shape]).named
    assert not weighed(monkeypatch, [Hypothesis((0, 1), 5.0, 5.0), shape]).named
    assert weighed(monkeypatch, [Hypothesis((0, 1), 4.1 + CLAIM, 4.1 + CLAIM), shape]).named
    assert not weighed(monkeypatch, [Hypothesis((0,), 5.0, 5.0), shape], shape=True).named


def test_the_lead_is_over_the_best_that_holds_what_it_is_held_against(monkeypatch):
    ranking = [Hypothesis((0,), 7.0, 7.0), Hypothesis((1,), 5.0, 5.0), Hypothesis((1, 2), 3.0, 3.0)]
    assert weighed(monkeypatch, ranking, against=B[0]).ln_odds_over == 2.0
    assert weighed(monkeypatch, ranking, against=A[0]).ln_odds_over == 0.0
    assert weighed(monkeypatch, ranking).ln_odds_over == 0.0


@pytest.mark.parametrize(("lead", "kept"), [(0.9, [A, B]), (1.1, [B, C])])
def test_a_cause_gives_way_to_one_that_is_clearly_likelier(monkeypatch, lead, kept):
    def likeliest(model, against):
        assert against not in model
        return SimpleNamespace(ln_odds_over=lead if against is A[0] else 0.0, causes=(C,))

    monkeypatch.setattr(stepwise, "possible_noises", lambda *_: [])
    monkeypatch.setattr(stepwise, "search", lambda model, nodes: model)
    monkeypatch.setattr(stepwise, "likeliest_round", likeliest)
    monkeypatch.setattr(stepwise, "likeliest_after_refit", lambda _first, _others, _s, best, _against: best)
    monkeypatch.setattr(stepwise, "with_causes", lambda _first, selected: [c for c, _ in selected])
    monkeypatch.setattr(stepwise, "is_usual", lambda *_: False)
    assert stepwise.swap_causes(FIRST, [A, B], said) == kept


def test_what_every_rig_has_needs_a_tenth_of_the_evidence(monkeypatch):
    monkeypatch.setattr(stepwise, "is_usual", lambda c, _: c is A[0])
    assert stepwise.needed_evidence(FIRST, A[0]) == pytest.approx(np.log(2.0))
    assert stepwise.needed_evidence(FIRST, B[0]) == pytest.approx(np.log(20.0))


def test_the_weakest_is_dropped_first_as_it_may_hold_the_others_down(monkeypatch):
    support = {("a", "bc"): 1.0, ("b", "ac"): 2.0, ("c", "ab"): 9.0, ("b", "c"): 5.0, ("c", "b"): 9.0,
               ("a", "c"): 5.0, ("c", "a"): 9.0}  # fmt: skip
    monkeypatch.setattr(stepwise, "refine_constants", lambda _first, selected: list(selected))
    monkeypatch.setattr(stepwise, "with_causes", lambda _f, selected: "".join(sorted(c.effect for c, _ in selected)))
    monkeypatch.setattr(stepwise, "evidence_for", lambda others, this: support[this[0].effect, others])
    monkeypatch.setattr(stepwise, "is_usual", lambda *_: False)
    assert stepwise.backward_eliminate(FIRST, [A, B, C], said) == [B, C]


def test_odds_of_several_pay_the_share_of_each(monkeypatch):
    monkeypatch.setattr(stepwise, "with_causes", lambda _m, selected: selected)
    monkeypatch.setattr(stepwise, "ln_evidence", lambda m: 40.0 if m is FIRST else 40.0 + 5.0 * len(m))
    monkeypatch.setattr(stepwise, "is_usual", lambda c, _: c is C[0])
    share = {A[0].key: -2.0, C[0].key: -9.0}
    made = stepwise.ln_odds(FIRST, [A, B, C], share)  # the share of b is not known: the least, -9
    assert made == pytest.approx(3 * 5.0 - 2.0 - 9.0 + 2 * np.log(SINGLE))


def selecting(monkeypatch, odds, alike):
    """Select A from nothing, B and C from B, which every rig has, at these odds against 2; `alike` in one scale."""

    def selected(m, begun, _t, keep_usual=False):
        assert keep_usual == (B in begun)
        return alike if m is ALIKE else [*begun, C] if begun else [A]

    monkeypatch.setattr(stepwise, "start_with_baseline", lambda v: ALIKE if v is ALIKE.view else FIRST)
    monkeypatch.setattr(stepwise, "refuse_too_little", lambda *_: None)
    monkeypatch.setattr(stepwise, "forward_select", selected)
    monkeypatch.setattr(stepwise, "with_causes", lambda m, _: m)
    monkeypatch.setattr(stepwise, "assemble_library", lambda _: Library((A[0],), np.zeros((1, 1))))
    monkeypatch.setattr(stepwise, "textbook_causes", lambda m, _: [] if m is ALIKE else [B])
    monkeypatch.setattr(stepwise, "backward_eliminate", lambda _m, selected, _t: list(selected))
    monkeypatch.setattr(stepwise, "log_priors", lambda *_: np.zeros(1))
    monkeypatch.setattr(stepwise, "ln_odds", lambda _m, these, _s: 2.0 if these == [A] else 9.0 if D in these else odds)
    monkeypatch.setattr(stepwise, "result_of", lambda _m, selected, standard=(): (selected, list(standard)))


@pytest.mark.parametrize(("odds", "told"), [(0.9, ([A], [])), (1.1, ([B, C], [B])), (3.0, ([B, C], [B]))])
def test_the_likelier_of_two_courses_is_told(monkeypatch, odds, told):
    """At equal odds it is that of what every rig has."""
    selecting(monkeypatch, odds, [D])
    assert stepwise.stepwise(VIEW, said) == told


@pytest.mark.parametrize(("alike", "told"), [([D], ([D, C], [])), ([A], ([A], []))])
def test_what_shows_in_one_scale_is_a_start_where_channels_have_their_own(monkeypatch, alike, told):
    selecting(monkeypatch, 0.0, alike)
    monkeypatch.setattr(VIEW, "noise", NoiseModel(scales=(1.0, 3.0)))
    assert stepwise.stepwise(VIEW, said) == told


@pytest.mark.parametrize("scales", [(), (3.0, 1.0)])
@pytest.mark.parametrize(("left", "anew"), [(1.0, True), (1.6, False)])
def test_constants_that_were_dragged_far_are_looked_about_again(monkeypatch, left, anew, scales):
    """A misfit of nine is more than four times one, and less than that of 2.6, whatever scales it made of channels."""
    monkeypatch.setattr(relinearise, "stepwise", lambda v, _: f"the search of {v}")
    alike = SimpleNamespace(noise=NoiseModel())
    v: Any = SimpleNamespace(relinearise=lambda *_: "another view", stimulus=None, noise=NoiseModel(scales=scales),
                             of_scales=lambda: alike)  # fmt: skip
    first, last = (SimpleNamespace(residual=np.array([[r, 0.0]]), view=v) for r in (3.0, left))
    c: Any = SimpleNamespace(start=first, end=last, steps=(A,), causes=[A])
    assert relinearise.about_first_cause(c, said) == ("the search of another view" if anew else c)
