"""The last lines of a command: in the page's words and units, each thing said once."""

from __future__ import annotations

import re

from gimbalcal.design.observability import observe
from gimbalcal.report.console import bounds_table, findings_table, parameters_table
from gimbalcal.report.wording import answered, typeset
from tests.report.example import example
from tests.report.test_diagnosis_page import CUBIC


def test_the_table_of_a_calibration_has_the_rows_of_its_page() -> None:
    content, _, _ = example()
    lines = parameters_table(content).splitlines()
    assert len([line for line in lines if " ± " in line]) == len(content["parameters"])
    assert re.search(r"^  bias x +−?[\d.]+ ± [\d.]+ +µg$", parameters_table(content), re.MULTILINE)


def test_what_was_held_is_named_by_its_axes_where_others_were_estimated() -> None:
    content, _, _ = example()
    held = {"direction": {"misalignment:up": 1.0, "cubic_nonlinearity:x": 1.0}, "why": "declined"}
    told = parameters_table({**content, "unobservable": [held]})
    assert told.endswith("not estimated: misalignment up; cubic nonlinearity")


def test_the_evidence_of_a_finding_stands_once() -> None:
    two = [{**CUBIC["parameters"][0], "axis": a} for a in "xy"]
    told = findings_table({"findings": [{**CUBIC, "parameters": two}]})
    assert told.count("probable") == 1
    assert told.count("µg/g³") == 2


def test_a_plan_says_how_well_and_marks_what_it_does_not_tell() -> None:
    lines = bounds_table(observe("wu2018-18").to_dict()).splitlines()
    assert sum(line.endswith("*") for line in lines) == 3
    assert any(re.fullmatch(r"  bias x +± 1\.\d+ +µg +usual 500", line) for line in lines)


def test_sentences_are_printed_alike_everywhere() -> None:
    assert answered("the calibration leaves 3 m\nnot seen: bias:x") == "The calibration leaves 3 m.\nNot seen: bias x."
    assert typeset("1.03e+03 ug/sqrt(Hz), 2.5e-07 m/s^2") == "1030 µg/√Hz, 2.5·10⁻⁷ m/s²"
    assert (
        typeset("-n 200, 2026-11-22, x=-1, from -0.5 deg/h to 3 deg") == "-n 200, 2026-11-22, x=-1, from −0.5 °/h to 3°"
    )
