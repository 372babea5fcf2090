"""First sentences of a diagnosis: every effect, every verdict, in words of somebody who has never seen one."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest

from gimbalcal.diagnose.answer import Curves
from gimbalcal.effects import CATALOGUE, parameters
from gimbalcal.effects.effect import constants
from gimbalcal.report.headline import does, headline, size_in_words

JARGON = re.compile(r"\{|}|_|chi|p-value|directions that|statistic|\\bnan|None|null|posterior|prior|\^")
WARM = {"effect": "bias_temperature", "axis": "y", "twins": [], "separate_by": "", "probability": 0.9, "sigma": 44.0,
        "parameters": [{"name": "b_T", "axis": "y", "value": 14.83, "sigma": 0.34, "unit": "ug/degC"}]}  # fmt: skip
FIT = {"chi2_reduced_before": 1.06}


def finding(effect: str) -> dict[str, Any]:
    """A finding of an effect on its first axis, with all its parameters and constants."""
    cls = CATALOGUE[effect]
    own = parameters(cls, ("inner",))
    axis = own[0].axis
    told = [
        {"name": p.name, "axis": p.axis, "value": -12.3, "sigma": 0.4, "unit": p.unit} for p in own if p.axis == axis
    ]
    told += [
        {"name": c.name, "axis": "", "value": 7.0, "sigma": 0.1, "unit": c.metadata["unit"]} for c in constants(cls)
    ]
    return {"effect": effect, "axis": axis, "parameters": told, "twins": [], "probability": 0.9, "sigma": 20.0}


def content(verdict: str, *findings: Any, **more: Any) -> dict[str, Any]:
    shape = {"channel": "specific_force z", "shape": "grows with the square root of time"}
    return {"verdict": verdict, "findings": list(findings), "unexplained": [shape] if verdict == "unexplained" else [],
            "mismatch": [], "fit": FIT, "outcome": "", **more}  # fmt: skip


@pytest.mark.parametrize("effect", sorted(CATALOGUE))
def test_every_effect_says_what_it_does_and_how_much(effect: str) -> None:
    said = does(finding(effect))
    assert CATALOGUE[effect].says
    assert "12.3" in said or "17.4" in said or "1230" in said  # alone, a sine with its cosine, in percent
    assert not JARGON.search(said), said
    assert said[0].isupper()
    assert said.endswith(".")
    assert len(said) < 170


@pytest.mark.parametrize("effect", sorted(CATALOGUE))
def test_every_finding_ends_in_a_next_step_that_names_it(effect: str) -> None:
    told = headline(content("missing-physics", finding(effect)))
    step = told.partition("Next: ")[2]
    assert f"--with {effect}" in step or "time stamps" in step or "leave position 7 out" in step


def test_what_how_large_what_next() -> None:
    assert headline(content("missing-physics", WARM)) == (
        "Accelerometer y drifts with temperature, by 14.83 ± 0.34 µg per °C. Next: use the calibration.json written "
        "here, which holds it; calibrate later recordings `--with bias_temperature:y`."
    )


def test_how_large_it_is_in_the_readings_is_told_in_their_unit() -> None:
    before = np.array([[0.0, 1.0], [0.0, -30.0]])
    at = (("specific_force", "x"), ("specific_force", "y"))
    curves = Curves(np.arange(2.0), np.ones(2), at, before, 0 * before, np.full((2, 2), 50.0), ("ug", "ug"))
    assert "Left out, readings are off by up to 1.5 mg." in headline(content("missing-physics", WARM), curves)
    assert "readings are off" not in headline(content("missing-physics", WARM))


def test_each_verdict_says_what_to_do() -> None:
    twin = WARM | {"twins": ["bias_drift"], "separate_by": "Warm it and let it cool."}
    told = {v: headline(content(v, *f)) for v, f in (
        ("adequate", ()), ("unexplained", ()), ("not-identifiable", (twin,)), ("missing-physics", (WARM,)),
    )}  # fmt: skip
    assert told["adequate"].startswith("Nothing is missing: the model explains these data")
    assert told["unexplained"].startswith("Something is missing that no known effect explains.")
    assert "square root of time" in told["unexplained"]
    assert "or it is bias drift" in told["not-identifiable"]
    assert told["not-identifiable"].endswith("Next: warm it and let it cool.")
    for said in told.values():
        assert not JARGON.search(said.replace("bias_temperature", "")), said
    assert all("Next: " in told[v] for v in told if v != "adequate")


def test_a_reservation_is_not_hidden_behind_adequate() -> None:
    told = headline(content("adequate", outcome="the residuals are 2.1 times the noise"))
    assert "The residuals are 2.1 times the noise." in told
    assert "Nothing is missing" not in told


def test_all_axes_at_once_and_what_is_not_told_apart() -> None:
    each = {"effect": "soft_saturation", "axis": "x, y, z", "twins": ["dead_zone"],
            "parameters": [{"name": "saturation", "axis": a, "value": v, "sigma": 1.0, "unit": "mg/g^2"}
                           for a, v in zip("xyz", (-9.0, 5.0, 0.4), strict=True)]
            + [{"name": "soft_saturation.f_0", "axis": "", "value": 3.0, "sigma": 34.0, "unit": "m/s^2"}]}  # fmt: skip
    told = headline(content("missing-physics", each))
    assert told.startswith("Each accelerometer falls short near its full scale, by −9.0 ± 1.0 mg per g² (x) and 5.0")
    assert "0.4" not in told  # no size, within its sigma
    assert "34" not in told
    assert "It may as well be dead zone: these data fit alike." in told


def test_a_delay_says_which_way() -> None:
    late = {"effect": "readout_latency", "axis": "", "twins": [],
            "parameters": [{"name": "readout_latency", "axis": "", "value": 3.2, "sigma": 0.1,
                            "unit": "ms"}]}  # fmt: skip
    assert does(late).startswith("The gimbal angle is logged 3.20 ± 0.10 ms later")
    late["parameters"][0]["value"] = -3.2
    assert "ms earlier" in does(late)


def test_an_effect_of_a_user_without_words_is_still_told() -> None:
    own = WARM | {"effect": "my_own"}
    assert does(own) == "My own y is in these data, 14.83 ± 0.34 µg per °C."


def test_many_sizes_are_told_by_the_largest() -> None:
    several = [
        {"name": "blunder", "axis": a, "value": v, "sigma": 1.0, "unit": "arcsec"}
        for a, v in zip("xyz", (3, -50, 9), strict=True)
    ]
    assert size_in_words({"effect": "base_tilt", "axis": "", "parameters": several}) == (
        "−50.0 ± 1.0 arcsec (y), 9.0 ± 1.0 arcsec (z) and one smaller"
    )


def test_the_teeth_of_a_worm_wheel_are_counted() -> None:
    """A plain number is told as a share, in per cent: 144 teeth were "14400 %"."""
    said = does(finding("periodic_worm_error"))
    assert "7.00 ± 0.10" in said or "7 ± 0.1" in said
    assert "%" not in said


def test_an_odd_constant_does_not_unsay_what_was_found() -> None:
    told = headline(content("missing-physics", WARM, outcome="bias drift y is far from usual"))
    assert told.startswith(headline(content("missing-physics", WARM)))
    assert told.endswith("Bias drift y is far from usual.")
    assert "No known physics" not in told


def test_a_fault_of_the_recording_comes_before_what_no_effect_explains() -> None:
    content = {"verdict": "unexplained", "findings": [], "unexplained": [], "mismatch": [], "fit": {}}
    words = headline({**content, "outcome": "position 9 is mis-set"})
    assert words.startswith("Position 9 is mis-set. Something is missing")


def test_that_two_sessions_are_two_units_comes_first_and_shortly() -> None:
    outcome = (
        "the 2 sessions do not share their constants: a does not agree (bias:z by +35 mg). The positions scatter by "
        "0.11 m/s^2, and `gimbalcal diagnose` looks for what the model misses"
    )
    told = headline(content("missing-physics", WARM, outcome=outcome, provenance={"sessions": [{}, {}]}))
    assert told.startswith("The 2 sessions do not share their constants: a does not agree (bias z by")
    assert "gimbalcal diagnose" not in told


def test_a_size_that_is_not_told_from_zero_is_a_bound() -> None:
    small = finding("bias_temperature")
    small["parameters"] = [{"name": "b_T", "axis": "y", "value": -1.0, "sigma": 18.0, "unit": "ug/degC"}]
    assert "by at most 37 µg per °C" in does(small)
