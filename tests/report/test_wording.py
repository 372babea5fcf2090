from typing import Any

import pytest

from gimbalcal.report.answer import answer, fit, verdict
from gimbalcal.report.wording import (
    counted,
    direction_in_words,
    leading,
    listed,
    unit_in_print,
    unobservable_of,
    why_in_words,
)


def content(chi2: float = 38.0, dof: int = 37, outcome: str = "", unobservable: int = 0) -> dict[str, Any]:
    direction = {"misalignment:xz": 1.0, "gimbal_zero:platform": -1.0}
    return {
        "outcome": outcome,
        "parameters": [{"name": "misalignment", "axis": "xz"}, {"name": "gimbal_zero", "axis": "platform"}] * 9,
        "unobservable": [{"direction": direction, "why": "a common turn"}] * unobservable,
        "residual": {"chi2": chi2, "dof": dof},
        "provenance": {},
    }


def test_a_good_calibration_in_one_sentence() -> None:
    assert answer(content()) == (
        "The calibration explains these data: what is left is 1.01 times the stated noise. All 18 parameters are "
        "known. Next: `gimbalcal apply` corrects recordings with it."
    )
    assert verdict(content()) == "fits"


def test_what_cannot_be_seen_is_named() -> None:
    assert (
        "16 of 18 parameters are known; these data cannot tell misalignment xz and gimbal zero platform from each "
        "other: the report says why."
    ) in answer(content(unobservable=1))
    alone = content() | {"unobservable": [{"direction": {"misalignment:xz": 1.0}, "why": ""}]}
    assert "17 of 18 parameters are known; these data cannot tell misalignment xz: the report" in answer(alone)


def test_what_tells_less_than_half_is_not_applied_but_joined() -> None:
    few = {"parameters": [{"name": "bias", "axis": a} for a in "xyz"]}
    direction = {"bias:x": 1.0, "bias:y": -1.0}
    told = answer(content() | few | {"unobservable": [{"direction": direction, "why": ""}]})
    assert "Next: record more attitudes and calibrate them together with this; `gimbalcal observe`" in told
    assert "Next: `gimbalcal apply`" in answer(content(unobservable=1))


def test_a_misfit_says_so() -> None:
    assert "3.00 times the stated noise, more than chance allows" in answer(content(chi2=9 * 37))
    assert verdict(content(chi2=9 * 37)) == "misfit"


def test_noise_that_is_overstated_says_so() -> None:
    assert "the noise is smaller than stated" in answer(content(chi2=0.25 * 37))


@pytest.mark.parametrize("noise", [{"accelerometer_from": "samples"}, {"from": "samples"}])
def test_noise_that_nobody_stated_is_not_called_stated(noise: dict[str, str]) -> None:
    seen = {"provenance": {"noise": noise}}
    assert answer(content() | seen).startswith(
        "The calibration explains these data: what is left is 1.01 times the noise that the samples show."
    )
    for chi2 in (9 * 37, 0.25 * 37):
        assert "stated" not in answer(content(chi2=chi2) | seen)
        assert "stated" in answer(content(chi2=chi2) | {"provenance": {"noise": {"accelerometer_from": "header"}}})


def test_a_failure_leads_with_its_outcome() -> None:
    assert answer(content(outcome="only five positions remain")) == "Only five positions remain."
    assert verdict(content(outcome="only five positions remain.")) == "reserved"


def test_no_degrees_of_freedom() -> None:
    assert "as many unknowns as data" in answer(content(chi2=0.0, dof=0))


@pytest.mark.parametrize(
    ("chi2", "dof", "expected"),
    [
        (1.05**2 * 100_000, 100_000, "fits"),  # highly significant, and too small to act on
        (1.3**2 * 10, 10, "fits"),  # large, and chance does that once in seven
        (1.3**2 * 1000, 1000, "misfit"),
    ],
)
def test_a_misfit_is_both_significant_and_large(chi2: float, dof: int, expected: str) -> None:
    assert fit(chi2, dof)[2] == expected


def test_direction_starts_with_the_heaviest_and_drops_the_negligible() -> None:
    direction = {"bias:x": 0.5, "scale_factor:y": -1.0, "bias:z": 0.001}
    assert direction_in_words(direction) == "scale factor y − 0.50 bias x"
    assert leading(direction) == ["scale_factor:y", "bias:x"]
    assert leading({}) == []


def test_words_and_units() -> None:
    assert counted(0, "direction") == "no directions"
    assert counted(13, "axis", "axes") == "13 axes"
    assert listed([]) == ""
    assert listed(["a"]) == "a"
    assert unit_in_print("deg/sqrt(h)") == "°/√h"


def test_what_was_held_is_not_counted_as_unobservable() -> None:
    held = content()
    held["unobservable"] = [{"direction": {"misalignment:xz": 1.0, "K3:x": 1.0}, "why": "declined"}]
    assert unobservable_of(held) == []
    assert "All 18 parameters are known." in answer(held)


@pytest.mark.parametrize(
    "provenance", [{"options": {"excess_scatter": 1e-4}}, {"noise": {"gimbal_angle_from": "residual"}}]
)
def test_noise_from_the_residual_proves_nothing(provenance: dict[str, Any]) -> None:
    judged = content() | {"provenance": provenance}
    assert answer(judged).startswith(
        "The readings scatter about the calibration, and every sigma is scaled to that. All 18"
    )


def test_what_is_no_noise_is_no_success() -> None:
    star = content() | {"provenance": {"pattern": {"channel": "across", "axis": "hour_angle"}}}
    assert verdict(star) == "misfit"


def test_reasons_say_labels_in_words() -> None:
    told = {"direction": {"bias:x": 1.0, "misalignment:xy": 0.3}, "why": "+1 bias:x +0.3 misalignment:xy leave it"}
    assert why_in_words(told) == "+1 bias x +0.3 misalignment xy leave it."


def test_reasons_say_effects_and_micro_g_in_words() -> None:
    left_out = {
        "direction": {"K3:x": 1.0},
        "why": "cubic_nonlinearity is left out: its sigma is 3 ug/g^3 (a.inter_triad)",
    }
    assert why_in_words(left_out) == "Cubic nonlinearity is left out: its sigma is 3 µg/g³ (a.inter_triad)."
