"""Sentences of a diagnosis, from numbers given here; every effect has its words."""

import re
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gimbalcal.diagnose.result import (
    DetectionLimit,
    Estimate,
    Finding,
    FitSummary,
    Mismatch,
    RmsMisfit,
    RowNoise,
    Shape,
    ViewFit,
)
from gimbalcal.diagnose.verdict.agreement import ConstantsAgreement
from gimbalcal.diagnose.verdict.random_walk import RandomWalkFinding
from gimbalcal.effects import CATALOGUE, parameters
from gimbalcal.estimate.sharing import Agreement
from gimbalcal.views.pointing import pointing
from gimbalcal.words import diagnosis_sentences
from gimbalcal.words.naming import without_underscores
from tests.diagnose.small import telescope

NUMBERS = {"chi2_reduced_before": 3.14159, "chi2_reduced_after": 1.01234, "heldout_before": 3.5, "heldout_after": 1.05}
FIT = FitSummary(**NUMBERS, noise={})
CUBIC = Finding("cubic_nonlinearity", "y", 0.9, 9.0, ())
ODD = Finding("odd_quadratic", "", 0.9, 9.0, (), ("cubic_nonlinearity", "soft_saturation"))
WAVE = Shape("specific_force x", "a smooth function of time")
OFF = [Mismatch("specific_force", "y", {"positions": (4,)}, 9.0, 0.01, "Specific force y is off at position 4")]
WALK = RandomWalkFinding("y", 12.3, 0.4, 3.0, 9.0)
STARS = pointing(telescope(1))
FORCES: Any = SimpleNamespace(noise=SimpleNamespace(scale_known=True))
VIEW_FIT = ViewFit(
    **NUMBERS,
    noise=RowNoise("stars", 1.0, "arcsec"),
    rms_before=1921.3,
    rms_after=0.9317,
    heldout_rms_before=2000.0,
    heldout_rms_after=1.25,
    steps=(),
)


@pytest.mark.parametrize("effect", CATALOGUE)
def test_every_effect_has_a_sentence(effect):
    said = Finding(effect, "", 0.9, 9.0, ()).physics
    assert said[0].isupper() or not said[0].isalpha()
    assert said.endswith(".")
    assert "\n" not in said
    assert "_" not in without_underscores(effect)


def test_an_equation_is_that_of_the_card():
    assert CUBIC["equation"] == re.sub(
        r"\s+", " ", (CATALOGUE["cubic_nonlinearity"].__doc__ or "").split(".. math::")[1].split("\n\n")[0].strip()
    )
    assert "K_{3" in CUBIC["equation"]


def test_the_sentences_of_a_diagnosis(golden):
    turned = replace(VIEW_FIT, turns=RmsMisfit(100.4, 20.2, "arcsec"))
    few = replace(VIEW_FIT, heldout_rms_after=90.0)
    loose = replace(VIEW_FIT, rms_of_channels={"across": 23.1, "along": 2.34})
    late = Finding("gyro_latency", "", 0.9, 9.0, (Estimate("gyro_latency", "", 3.2, 0.1, "ms"),), ("readout_latency",))
    sampled = {chi2: replace(VIEW_FIT, chi2_of_samples_after={"across": chi2, "along": chi2}) for chi2 in (1.44, 9.0)}
    cases = {
        "adequate": of_forces("adequate", [], []),
        "missing physics": of_forces("missing-physics", [CUBIC, ODD], [WAVE]),
        "not identifiable": of_forces("not-identifiable", [ODD], [WAVE]),
        "unexplained": of_forces("unexplained", [], [WAVE]),
        "unexplained without a shape": of_forces("unexplained", [], [], []),
        "adequate, in the unit of the readings": of_view("adequate", [], []),
        "missing physics, in the unit of the readings": of_view("missing-physics", [CUBIC], [WAVE]),
        "few readings": diagnosis_sentences.answer("missing-physics", [(STARS, few, [CUBIC])], [], OFF),
        "two views": diagnosis_sentences.answer("adequate", [(FORCES, FIT, []), (STARS, VIEW_FIT, [])], [], OFF),
        "turns": diagnosis_sentences.misfit_reduction(STARS, turned),
        "standard error": diagnosis_sentences.residual_sentence(STARS, sampled[1.44]),
        "excess scatter": diagnosis_sentences.residual_sentence(STARS, sampled[9.0]),
        "loose readout": diagnosis_sentences.residual_sentence(STARS, loose),
        "pattern": diagnosis_sentences.pattern_sentence(STARS, "along", 12.345, "a wave"),
        "largest": diagnosis_sentences.largest_misfit_sentence(STARS, "along", 12.345, 2.0, np.array([3, 8])),
        "reservation, unexplained": diagnosis_sentences.reservation_sentence("unexplained", [], [WAVE]),
        "reservation, not identifiable": diagnosis_sentences.reservation_sentence("not-identifiable", [ODD], [WAVE]),
        "delay": diagnosis_sentences.delay_sentences([late]),
        "outliers": diagnosis_sentences.omitted_stars([3, 80], [0.763, 12.0], "arcsec", "mistaken or not centred"),
        "motion": diagnosis_sentences.motion_not_analysed("no rows between positions were logged"),
        "rate": diagnosis_sentences.rate_not_analysed("no model explains the forces"),
        "walk": diagnosis_sentences.walk_as_explanation(WALK, only=True),
        "walk or a cause": diagnosis_sentences.walk_as_explanation(WALK, only=False),
        "detection limits": diagnosis_sentences.limits_in_words(
            [DetectionLimit(e, "x", 12.34, 3.0, "ug/h") for e in ("bias_drift", "warm_up", "bias_step", "self_heating")]
        ),
        "separation": diagnosis_sentences.separation_advice("reverse the order", 0.5, 12.3, "friction", "eccentricity"),
        "no separation": diagnosis_sentences.separation_advice("", 0.0, 0.0, "friction", "eccentricity"),
        "sizes differ": diagnosis_sentences.size_disagreement("bias drift (x)", Agreement(38.2, 6, 1e-6)),
        "constants differ": diagnosis_sentences.constants_disagreement(
            ConstantsAgreement(38.2, 6, 1e-6, -1, tuple(parameters(CATALOGUE["bias"])[:1]), np.ones(1), np.ones(1))
        ),
        "gyroscopes": diagnosis_sentences.gyroscopes_not_analysed(diagnosis_sentences.COUNTS_WITHOUT_SCALE),
    }
    golden("sentences/in_words", "\n".join(f"{name}: {text}" for name, text in cases.items()))
    assert of_view("unexplained", [], [WAVE]) == cases["unexplained"]


def of_view(verdict, findings, shapes):
    return diagnosis_sentences.answer(verdict, [(STARS, VIEW_FIT, findings)], shapes, OFF)


def of_forces(verdict, findings, shapes, mismatch=OFF):
    return diagnosis_sentences.answer(verdict, [(FORCES, FIT, findings)], shapes, mismatch)


def test_a_shape_of_a_gimbal_names_its_gimbal_once():
    shape = "a third or higher harmonic of the inner gimbal angle"
    assert diagnosis_sentences.shape_in_words(Shape("gimbal_angle inner", shape)) == shape
    assert diagnosis_sentences.shape_in_words(Shape("gimbal_angle inner", "a pattern")).endswith("gimbal angle inner")
