"""Formulas as letters for a console."""

import re

from gimbalcal.effects import CATALOGUE
from gimbalcal.effects.effect import stated_law
from gimbalcal.words.plain_formula import plain_formula


def test_every_law_of_the_catalogue_is_a_line_of_letters():
    for name, cls in CATALOGUE.items():
        told = plain_formula(str(stated_law(cls)["equation"]))
        assert "=" in told, name
        assert not re.search(r"[\\{}&]|\b(?:operatorname|frac|text|mathrm|begin|sqrt)", told), f"{name}: {told}"
    assert plain_formula(r"c\, e^{-(t - t_{move}) / \tau}") == "c e^(-(t - t_move) / τ)"
    assert plain_formula(r"\frac{1}{1 + s_i} \operatorname{sign}(f)") == "1/(1 + s_i) sign(f)"
