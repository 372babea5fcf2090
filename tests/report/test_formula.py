"""Formulas of cards as MathML."""

from xml.etree import ElementTree as ET

import pytest
import sympy

from gimbalcal.effects import CATALOGUE
from gimbalcal.effects.effect import equation
from gimbalcal.report.formulas import formula


@pytest.mark.parametrize("effect", sorted(CATALOGUE))
def test_every_card_can_be_set(effect):
    text = "".join(ET.fromstring(str(formula(equation(CATALOGUE[effect])))).itertext())
    assert "\\" not in text
    assert "_" not in text


def test_laws_as_sympy_writes_them_can_be_set():
    t, f = sympy.symbols("T f_y")
    law = sympy.exp(-t / 3) * f**2 / sympy.sqrt(1 + t) + sympy.Abs(f) * sympy.sin(2 * t) + 1.5e-7 * sympy.sign(f)
    assert "<msqrt>" in str(formula(sympy.latex(law)))


@pytest.mark.parametrize("latex", ["", r"\nonsense x", r"\begin{bmatrix} 1 & 2", "x^"])
def test_what_is_no_formula_is_left_out(latex):
    assert formula(latex) is None


def test_tags_of_a_user_do_not_come_through():
    assert "<mi onclick" not in str(formula(r"\text{<mi onclick='x()'>a</mi>} < 3"))
    assert "<mo>&#x0003C;</mo>" in str(formula("a < 3"))
