"""The answer as a file: keys of interfaces.md section 4, in plain types."""

import json
from dataclasses import replace

from gimbalcal.diagnose.answer import VERDICTS, Diagnosis
from gimbalcal.diagnose.result import Estimate, Finding, Mismatch
from gimbalcal.recording import Source
from tests.diagnose.small import FIT, telescope

CUBIC = Finding("cubic_nonlinearity", "y", 0.9, 7.0, (Estimate("K3", "y", 16.0, 2.0, "ug/g^3"),), ("odd_quadratic",))
ANSWER = Diagnosis(
    "missing-physics", (Mismatch("specific_force", "y", {"positions": (4,)}, 9.0, 0.01, "Off."),), (CUBIC,), (), FIT,
    {"seed": 1}, "In words.",
)  # fmt: skip


def test_the_content_of_the_file():
    content = ANSWER.to_dict()
    assert list(content) == [
        "format", "verdict", "in_words", "outcome", "mismatch", "findings", "unexplained", "fit", "provenance"
    ]  # fmt: skip
    assert json.loads(json.dumps(content)) == content
    (found,) = content["findings"]
    assert (found["effect"], found["twins"], found["separate_by"]) == ("cubic_nonlinearity", ["odd_quadratic"], "")
    assert found["parameters"] == [{"name": "K3", "axis": "y", "value": 16.0, "sigma": 2.0, "unit": "ug/g^3"}]
    assert "cost" not in found  # None is absent
    assert found["twins"] == ANSWER.findings[0]["twins"]
    assert content["mismatch"][0]["where"] == {"positions": [4]}
    assert (content["format"], content["verdict"], content["unexplained"]) == (1, "missing-physics", [])
    content["fit"]["chi2_reduced_before"] = 0.0
    assert ANSWER.fit.chi2_reduced_before == 3.0  # a copy


def test_of_two_views_the_one_that_names_a_cause_is_told():
    assert max(("adequate", "unexplained"), key=VERDICTS.index) == "unexplained"
    assert max(("not-identifiable", "missing-physics", "unexplained"), key=VERDICTS.index) == "missing-physics"
    assert sorted(VERDICTS) == ["adequate", "missing-physics", "not-identifiable", "unexplained"]


def test_the_files_behind_a_recording():
    r = replace(telescope(1), source=(Source("a/recording.toml", "0" * 64), Source("a/samples.csv", "1" * 64)))
    assert r.files == [
        {"path": "a/recording.toml", "sha256": "0" * 64}, {"path": "a/samples.csv", "sha256": "1" * 64}
    ]  # fmt: skip
