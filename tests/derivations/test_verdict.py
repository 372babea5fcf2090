"""The judge itself: it must see a planted slip, tell an approximation from an error, and prove what it calls zero."""

import math

import pytest
import sympy as sp

from derivations.verdict import (
    AGREES,
    APPROXIMATION,
    MISPRINT,
    NOT_DETERMINED,
    WRONG,
    Case,
    Printed,
    decide,
    is_zero,
    judge,
    order,
    slips,
    truncate,
)

a, b, e, L = sp.symbols("a b e L", real=True)


def verdict_of(formula, derived, **case):
    return judge(Printed("Eq. (0)", "as printed", formula), Case(derived, "", **case))[0]


def test_identical_formulas_in_other_words_agree():
    assert verdict_of(sp.sin(2 * L) / 2, sp.sin(L) * sp.cos(L)) == AGREES


def test_leaving_out_a_higher_order_is_an_approximation_and_its_size_is_told():
    printed = Printed("Eq. (0)", "x", sp.Integer(1))
    found = decide("001", printed, Case(1 - e**2 / 2, "{size}", small=(e,), at={e: 1e-3}, unit="ug"))
    assert (found.verdict, found.size) == (APPROXIMATION, "5.0e-07 (0.5 ug)")
    assert found.why == found.size


def test_leaving_out_the_same_order_is_not_an_approximation():
    assert verdict_of(e, e + 2 * e * a, small=(e,)) == WRONG


@pytest.mark.parametrize("planted", [-a + b * sp.sin(L), a - b * sp.sin(L), a + b, a + a * sp.sin(L)])
def test_one_slip_is_a_misprint(planted):
    assert verdict_of(planted, a + b * sp.sin(L), symbols=((a, b),), factors=(sp.sin(L),)) == MISPRINT


def test_two_slips_are_wrong():
    assert verdict_of(-a + b, a + b * sp.sin(L), factors=(sp.sin(L),)) == WRONG


def test_a_repair_acts_on_what_was_printed():
    def halve(formula):
        return formula / 2

    assert verdict_of(2 * sp.sin(a), sp.sin(a), repairs=(("twice", halve),)) == MISPRINT
    assert verdict_of(2 * sp.sin(b), sp.sin(a), repairs=(("twice", halve),)) == WRONG


def test_a_definition_agrees_and_says_so():
    found = decide("000", Printed("Eq. (0)", "x = a", a), Case(None, "It is x."))
    assert (found.verdict, found.size, found.derived) == (AGREES, "0", "a definition")
    assert found.why == "A definition: nothing to derive. It is x."


@pytest.mark.parametrize(
    ("reading", "literal", "expected"),
    [
        (None, None, NOT_DETERMINED),  # the scan shows nothing
        (a, b, NOT_DETERMINED),  # one letter for another: right or a misprint
        (a, a**2, NOT_DETERMINED),
        (b, 2 * b, WRONG),  # wrong either way
        (a, None, AGREES),  # the scan is no formula as it stands: only the reading is
    ],
)
def test_a_scan_on_which_the_verdict_hangs_is_unreadable(reading, literal, expected):
    printed = Printed("Eq. (0)", "x", reading, garbled="a speck", literal=literal)
    found = decide("000", printed, Case(a, "It is a."))
    assert found.verdict == expected
    assert found.why.startswith("unreadable: a speck. It is a.") == (expected == NOT_DETERMINED)


def test_a_slip_that_the_paper_builds_on_is_wrong():
    printed = Printed("Eq. (0)", "x", -a, carried="used in the next equation")
    assert judge(printed, Case(a, "")) == (WRONG, "the overall sign")


def test_a_matrix_with_one_faulty_entry_is_a_misprint_and_with_two_is_wrong():
    right = sp.Matrix([[a, b], [1, L]])
    assert verdict_of(sp.Matrix([[a, -b], [1, L]]), right) == MISPRINT
    assert verdict_of(sp.Matrix([[-a, b], [1, -L]]), right) == WRONG


def test_missing_rank_comes_before_everything_else():
    assert verdict_of(a, a, rank=(4, 6)) == NOT_DETERMINED
    assert verdict_of(a, a, rank=(6, 6)) == AGREES


def test_zero_is_proved_and_not_guessed():
    assert is_zero(sp.sin(L) ** 2 + sp.cos(L) ** 2 - 1)
    assert not is_zero(sp.sin(L) ** 2 + sp.cos(L) ** 2 - 1 + sp.Rational(1, 10**20) * L)


def test_order_ignores_coefficients_that_vanish():
    assert order(e * (sp.sin(L) ** 2 + sp.cos(L) ** 2 - 1) + e**2, (e,)) == 2
    assert order(sp.Integer(0), (e,)) == math.inf


def test_truncation_is_by_total_degree():
    assert sp.expand(truncate(sp.cos(a) * sp.exp(b), (a, b), 2) - (1 + b + b**2 / 2 - a**2 / 2)) == 0


def test_every_sign_of_a_sum_is_among_the_slips():
    assert {words for words, _ in slips(a + b, (), ())} == {"the overall sign", "the sign of a", "the sign of b"}
