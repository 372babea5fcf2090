"""Sentences of a diagnosis, from numbers given here; every effect has its words."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from gimbalcal.diagnose import wording
from gimbalcal.diagnose.result import Finding, FitSummary, Mismatch, Shape, TurnMisfit, ViewFit
from gimbalcal.diagnose.rows.views import pointing
from gimbalcal.effects import CATALOGUE
from gimbalcal.views.noise import NoiseModel
from tests.diagnose.small import telescope

NUMBERS = {"chi2_reduced_before": 3.14159, "chi2_reduced_after": 1.01234, "heldout_before": 3.5, "heldout_after": 1.05}
FIT = FitSummary(**NUMBERS, noise={})
CUBIC = Finding("cubic_nonlinearity", "y", 0.9, 9.0, ())
ODD = Finding("odd_quadratic", "", 0.9, 9.0, (), ("cubic_nonlinearity", "soft_saturation"))
WAVE = Shape("specific_force x", "a smooth function of time")
OFF = [Mismatch("specific_force", "y", {"positions": (4,)}, 9.0, 0.01, "Specific force y is off at position 4")]
STARS = pointing(telescope(1))
VIEW_FIT = ViewFit(
    **NUMBERS,
    noise={},
    rms_before=1921.3,
    rms_after=0.9317,
    heldout_rms_before=2000.0,
    heldout_rms_after=1.25,
    steps=(),
)


@pytest.mark.parametrize("effect", CATALOGUE)
def test_every_effect_has_a_sentence(effect: str) -> None:
    said = Finding(effect, "", 0.9, 9.0, ()).physics
    assert said[0].isupper() or not said[0].isalpha()
    assert said.endswith(".")
    assert "\n" not in said
    assert "_" not in wording.spoken(effect)


def test_an_equation_is_that_of_the_card() -> None:
    assert CUBIC["equation"] == re.sub(
        r"\s+", " ", (CATALOGUE["cubic_nonlinearity"].__doc__ or "").split(".. math::")[1].split("\n\n")[0].strip()
    )
    assert "K_{3" in CUBIC["equation"]


def test_findings_stand_with_what_is_confounded_with_them() -> None:
    assert wording.named("cubic_nonlinearity", "y") == "cubic nonlinearity (y)"
    assert wording.named(ODD.effect, ODD.axis, ODD.twins) == "odd quadratic or cubic nonlinearity or soft saturation"
    assert wording.causes("missing-physics", [CUBIC, ODD]) == (
        "What was left out: cubic nonlinearity (y) and odd quadratic or cubic nonlinearity or soft saturation"
    )
    assert wording.causes("not-identifiable", [ODD], [WAVE]).endswith(
        "soft saturation, or none that is known: a smooth function of time in specific force x"
    )


def test_the_answer_in_a_known_noise() -> None:
    assert wording.answer("adequate", [], [], OFF, FIT) == (
        "The calibrated model explains these data: reduced chi^2 3.14."
    )
    assert wording.answer("missing-physics", [CUBIC], [WAVE], OFF, FIT) == (
        "What was left out: cubic nonlinearity (y). Reduced chi^2 goes from 3.14 to 1.01, on held-out data from 3.5 to "
        "1.05. Part of it may have no known cause: a smooth function of time in specific force x. "
        "Specific force y is off at position 4."
    )
    assert wording.answer("unexplained", [], [WAVE], OFF, FIT) == (
        "The model does not explain these data, and no cause of the catalogue does. What is left is a smooth function "
        "of time in specific force x. Specific force y is off at position 4."
    )
    assert wording.answer("unexplained", [], [], [], FIT) == wording.NO_CAUSE


def test_the_answer_in_an_unknown_noise_is_in_the_unit_of_the_readings() -> None:
    def said(verdict: str, findings: list[Finding], shapes: list[Shape]) -> str:
        return wording.answer_of_views(verdict, [(STARS, VIEW_FIT, findings)], shapes, OFF)

    assert said("adequate", [], []) == (
        "The calibrated model explains these data. What is left of pointing is 0.932 arcsec rms without a pattern."
    )
    assert said("missing-physics", [CUBIC], [WAVE]) == (
        "What was left out: cubic nonlinearity (y). The misfit of pointing goes from 1921 to 0.932 arcsec rms, and for "
        "stars that the fit has not seen from 2000 to 1.25 arcsec. What is left has no known cause: a smooth function "
        "of time in specific force x. Specific force y is off at position 4."
    )
    assert said("unexplained", [], [WAVE]) == wording.answer("unexplained", [], [WAVE], OFF, FIT)


def test_a_shape_of_a_gimbal_names_its_gimbal_once() -> None:
    shape = "a third or higher harmonic of the inner gimbal angle"
    assert wording.left_over(wording.shape(shape, "gimbal_angle", "inner")) == shape
    assert wording.left_over(wording.shape("a pattern", "gimbal_angle", "inner")) == "a pattern in gimbal angle inner"


def test_scatter_beyond_that_of_the_samples_is_said() -> None:
    def said(chi2: float) -> str:
        v = replace(STARS, noise=NoiseModel(sample=np.ones((80, 2))))
        return wording.scatter(v, replace(VIEW_FIT, chi2_of_samples_after={"across": chi2, "along": chi2}))

    assert said(1.44).endswith("rms without a pattern, 1.2 times what the scatter of the samples makes of a mean.")
    assert said(9.0).endswith(
        "but 3 times what the scatter of the samples makes of a mean: the outputs wander from one position to the next."
    )


def test_what_a_view_gained_or_has_left() -> None:
    assert wording.view_in_words(STARS, VIEW_FIT, [], "unexplained") == ""
    assert wording.view_in_words(STARS, VIEW_FIT, [CUBIC], "missing-physics").startswith("The misfit of pointing goes")
    assert wording.view_in_words(STARS, VIEW_FIT, [], "adequate").startswith("What is left of pointing")
    turned = replace(VIEW_FIT, turns=TurnMisfit(100.4, 20.2, "arcsec"))
    assert wording.misfit_improved(STARS, turned).endswith("gravity is missed by 20 arcsec rms instead of 100.")
    assert wording.follows(STARS, "along", 12.345, "a wave") == (
        "The misfit of pointing along elevation (12.3 arcsec rms) follows a wave"
    )
