"""Formulas of cards as MathML."""

from xml.etree import ElementTree as ET

import pytest
import sympy

from gimbalcal.effects import CATALOGUE
from gimbalcal.effects.card import equation
from gimbalcal.report.mathml import mathml


@pytest.mark.parametrize("effect", sorted(CATALOGUE))
def test_every_card_can_be_set(effect: str) -> None:
    text = mathml(equation(CATALOGUE[effect]))
    root = ET.fromstring(text)
    assert "\\" not in "".join(root.itertext())
    assert "_" not in "".join(root.itertext())


def test_laws_as_sympy_writes_them_can_be_set() -> None:
    t, f = sympy.symbols("T f_y")
    law = sympy.exp(-t / 3) * f**2 / sympy.sqrt(1 + t) + sympy.Abs(f) * sympy.sin(2 * t) + 1.5e-7 * sympy.sign(f)
    ET.fromstring(mathml(sympy.latex(law)))


@pytest.mark.parametrize("latex", [r"\frac{a}", "{a", "a}", r"\nonsense x", r"\begin{bmatrix} 1 & 2", "x^"])
def test_what_is_no_formula_is_refused(latex: str) -> None:
    with pytest.raises(ValueError, match=r"."):
        mathml(latex)


def test_letters_of_a_user_are_escaped() -> None:
    assert "<b>" not in mathml(r"\text{<b>} < 3")
