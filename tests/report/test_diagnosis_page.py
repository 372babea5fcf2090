from typing import Any

import numpy as np
import pytest

from gimbalcal.report.diagnosis_page import answer, diagnosis_report, equation
from gimbalcal.report.figures import Panel

CUBIC = {
    "effect": "cubic_nonlinearity",
    "axis": "y",
    "probability": 0.98,
    "sigma": 24.1,
    "parameters": [{"name": "K3", "value": 16.2, "sigma": 0.7, "unit": "ug/g^3"}],
    "twins": [],
    "physics": "An odd third-order bend of the input-output law.",
    "equation": r"\delta a_y = K_{3,y} f_y^3",
    "separate_by": "",
}


def diagnosis(verdict: str = "missing-physics", **changes: Any) -> dict[str, Any]:
    mismatch = {
        "channel": "specific_force",
        "axis": "y",
        "where": {"positions": [4, 10]},
        "statistic": 41.2,
        "p_value": 1e-7,
        "in_words": "y differs where it carries 1 g",
    }
    fit = {"chi2_reduced_before": 3.1, "chi2_reduced_after": 1.02, "heldout_before": 3.3, "heldout_after": 1.05}
    content = {"format": 1, "verdict": verdict, "mismatch": [mismatch], "findings": [CUBIC], "unexplained": []}
    return content | {"fit": fit, "provenance": {"seed": 1}} | changes


def test_a_found_effect_leads() -> None:
    assert answer(diagnosis()) == (
        "The model left out cubic nonlinearity y (98 % probable; K3 = 16.2 ± 0.7 µg/g³). With it, reduced χ² falls "
        "from 3.10 to 1.02 and, on data that the fit did not see, from 3.30 to 1.05."
    )


def test_nothing_missing_is_said_first() -> None:
    said = answer(diagnosis("adequate", findings=[], mismatch=[], fit={"chi2_reduced_before": 0.98}))
    assert said == "The model explains these data; nothing needs to be added. Reduced χ² is 0.980."


def test_twins_stand_together_with_what_would_separate_them() -> None:
    twin = CUBIC | {"twins": ["odd_quadratic"], "separate_by": "Tilt by 30 and 60 degrees."}
    assert answer(diagnosis("not-identifiable", findings=[twin])) == (
        "The data cannot tell which effect was left out: cubic nonlinearity y or odd quadratic. "
        "Tilt by 30 and 60 degrees."
    )


def test_the_unknown_is_not_named_by_force() -> None:
    shape = {"channel": "specific_force z", "shape": "grows with the square root of time"}
    said = answer(diagnosis("unexplained", findings=[], unexplained=[shape]))
    assert "no effect of the catalogue explains it" in said
    assert "grows with the square root of time" in said


@pytest.mark.parametrize("verdict", ["adequate", "missing-physics", "unexplained", "not-identifiable"])
def test_every_verdict_makes_a_page_that_escapes(verdict: str) -> None:
    hostile = CUBIC | {"physics": "<script>alert(1)</script>"}
    page = diagnosis_report(diagnosis(verdict, findings=[hostile]), title="<b>rig</b>")
    assert "<script>" not in page
    assert "<b>rig" not in page
    assert "16.2" in page
    assert "98.0 % probable, 24.1 σ" in page


def test_the_picture_tells_its_numbers_to_those_who_cannot_see_it() -> None:
    x = np.arange(18.0)
    panel = Panel("specific force y", "µg", x, "position", np.full(18, 30.0), np.full(18, 2.0), np.full(18, 2.0))
    page = diagnosis_report(diagnosis(), [panel])
    assert "rms specific force y: 30.0 to 2.00 µg" in page


def test_equations_are_drawn_or_left_as_text() -> None:
    drawn = equation(r"\delta a_y = K_{3,y} f_y^3")
    assert drawn is not None
    assert drawn.alt == r"\delta a_y = K_{3,y} f_y^3"
    assert equation(r"\begin{bmatrix} 1 \end{bmatrix}") is None
    assert equation("") is None
