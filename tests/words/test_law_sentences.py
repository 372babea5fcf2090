"""Formulas of laws in print."""

from gimbalcal.diagnose.result import Estimate
from gimbalcal.words.law_sentences import law_in_words


def test_a_constant_below_zero_is_added():
    constants = [Estimate("a", None, 6.85, 0.3, "arcsec"), Estimate("x0", None, -0.0645, 0.01, "rad")]
    text = law_in_words("a*tanh((azimuth_change - x0)/w)", [*constants, Estimate("w", None, 0.53, 0.01, "rad")], {})
    assert text == "6.85 arcsec · tanh((azimuth change + 0.06450)/0.5300)"
